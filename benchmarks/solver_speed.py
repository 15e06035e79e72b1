"""What the solver and its rivals cost, and how near the optimum they come, in one run.

L-BFGS-B is measured as a user would call it, from rest and with SciPy's own settings, on the energy of one solve:

- with the energy's gradient, which somebody has worked out. It stops some 1e-5 of the energy above the optimum;
- so, with tolerances under which it comes as near as 1e-6; and that started from the optimum of the frame before;
- without the gradient: SciPy takes finite differences, an energy for every weight.

The energy it is given is a quadratic form that was multiplied out beforehand, so that no call goes over the markers.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize

from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.solver.adaptation import MorphologicalAdaptation
from signface.solver.bounds import holding_energy, holding_slope
from signface.solver.methods import METHODS, make_solver
from signface.solver.thin_shell import ThinShellSolver

#: Methods that are timed on every sixtieth frame, and one on every six hundredth.
SLOW, SLOWEST = ("nnls", "gaussian-process"), "bounded"
#: Frames, evenly spaced, that L-BFGS-B solves.
GENERAL = 24


def best_of(times: int, call: Callable[[], object]) -> float:
    """Seconds of the fastest of several calls: what else the machine does only adds."""
    return min(_seconds(call) for _ in range(times))


def _seconds(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def speed(face: FaceModel, layout: MarkerLayout, frames: np.ndarray) -> dict[str, object]:
    """Microseconds a frame of every method on one take, and what the way to the optimum costs and reaches.

    `thin-shell` is the default: a solve, a second one that lets go of active weights, and slipped markers drawn nearer.
    `thin-shell, one solve` does what L-BFGS-B is asked to do.
    """
    solver = ThinShellSolver(face, layout)
    alone = ThinShellSolver(face, layout, threads=1)
    plain = ThinShellSolver(face, layout, release=False, slip=0.0)
    solver.solve(frames[:1000])  # compiled, or read from the cache
    result = {
        name: best_of(7, lambda one=one: one.solve(frames)) / len(frames) * 1e6
        for name, one in (("thin-shell", solver), ("thin-shell, one core", alone), ("thin-shell, one solve", plain))
    }
    busy = time.process_time()
    alone.solve(frames)
    busy = (time.process_time() - busy) / len(frames)
    for method in METHODS:
        if method != "thin-shell":
            few = frames[::600] if method == SLOWEST else frames[::60] if method in SLOW else frames
            rival = make_solver(method, face, layout)
            result[method] = best_of(2, lambda rival=rival, few=few: rival.solve(few)) / len(few) * 1e6
    seconds, above = _general_optimiser(plain, frames)
    result |= {name: value * 1e6 for name, value in seconds.items()}
    holes = frames.copy()
    rng = np.random.default_rng(0)
    for start in rng.integers(0, len(frames) - 40, 200):
        holes[start : start + 40, rng.integers(0, frames.shape[1], 2)] = np.nan
    gaps = best_of(3, lambda: solver.solve(holes)) / len(frames) * 1e6
    stream = solver.stream()
    pushed = np.array([_seconds(lambda frame=frame: stream.push(frame)) for frame in frames[:3000]])
    neutral = layout.points(face)
    adaptation = MorphologicalAdaptation(neutral, 1.1 * neutral)
    adapt = best_of(3, lambda: adaptation.transform(frames + neutral)) / len(frames) * 1e6
    return {
        "microseconds": result,
        "processor_microseconds": busy * 1e6,
        "with_gaps": gaps,
        "stream_ms": {"median": float(np.median(pushed) * 1e3), "p99": float(np.quantile(pushed, 0.99) * 1e3)},
        "rbf_adaptation": adapt,
        "relative_gap_to_optimum": above.pop("thin-shell, one solve"),
        "relative_gaps_of_rivals": above,
    }


def _general_optimiser(solver: ThinShellSolver, frames: np.ndarray) -> tuple[dict[str, float], dict[str, float]]:
    """Seconds a frame of L-BFGS-B, and by what share of the energy each lies above a polished optimum at most."""
    problem = solver._whole
    numbers = np.arange(len(frames) // GENERAL, len(frames), len(frames) // GENERAL)
    solved = solver.solve(frames).weights
    rights = frames[numbers].reshape(len(numbers), -1) @ problem.project.T

    def energy(c: np.ndarray, right: np.ndarray) -> float:
        return c @ problem.normal @ c - 2.0 * right @ c + solver.holding * holding_energy(c, solver.sparsity).sum()

    def both(c: np.ndarray, right: np.ndarray) -> tuple[float, np.ndarray]:
        slope = 2.0 * (problem.normal @ c - right) + solver.holding * holding_slope(c, solver.sparsity)
        return energy(c, right), slope

    rest = np.zeros_like(rights)
    tight = {"ftol": 1e-10, "gtol": 1e-6}
    ways = {
        "L-BFGS-B, gradient given": (both, True, rest, {}),
        "L-BFGS-B, gradient given, to 1e-6": (both, True, rest, tight),
        "L-BFGS-B, gradient given, to 1e-6, from the frame before": (
            both, True, solved[numbers - 1][:, problem.places], tight,
        ),
        "L-BFGS-B, finite differences": (energy, None, rest, {}),
    }  # fmt: skip
    seconds, reached = {}, {"thin-shell, one solve": solved[numbers][:, problem.places]}
    for name, (function, jac, starts, options) in ways.items():
        begin = time.perf_counter()
        found = [
            minimize(function, start, args=(right,), jac=jac, method="L-BFGS-B", options=options).x
            for start, right in zip(starts, rights)
        ]
        seconds[name] = (time.perf_counter() - begin) / len(numbers)
        reached[name] = np.array(found)
    above = dict.fromkeys(reached, 0.0)
    for number, (right, frame) in enumerate(zip(rights, frames[numbers])):
        start = reached["thin-shell, one solve"][number]
        best = minimize(both, start, args=(right,), jac=True, method="BFGS", options={"gtol": 1e-10, "maxiter": 500})
        full = np.zeros((1, problem.width))
        full[0, problem.places] = best.x
        total = solver.energy(full, frame[None])[0]
        for name, found in reached.items():
            above[name] = max(above[name], float((energy(found[number], right) - best.fun) / max(total, 1e-9)))
    return seconds, above
