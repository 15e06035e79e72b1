"""The inner loop of the thin-shell solve: one small convex problem a frame, compiled.

Each frame minimises `c' A c - 2 r' c + sum_i H(c_i)`, with `H` the energy that holds weights in range and at rest
(`signface.solve.bounds`). Two things make it cheap. `A` is the same in every frame, so that its inverse is computed
once. And the slope of `H` is one constant, `pull`, between the knee (0, or `KNEE` with sparsity) and 1: with
`c0 = A^-1 (r - pull / 2)`, one matrix product for all frames, and `G = A^-1 / 2`, the optimum satisfies

    c = c0 - G g(c),        g_i(c) = H'(c_i) - pull,

where only the k weights outside knee to 1 enter `g`. A Newton step is a Cholesky factorisation of k x k, k being about
20 of 51, and k columns of `G`; consecutive frames start from one another and take two or three steps.

- `minimise`: all frames, on several cores.
- `minimise_damped`: the same for single frames by Newton's method with a line search: slower, and sure.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numba
import numpy as np

from signface.solve.bounds import AT_REST, KNEE, SMOOTHING, holding_curvature, holding_energy, holding_slope

#: Newton steps after which a frame is left to the damped method. The longest seen are 12.
QUICK_STEPS = 30
#: Steps of the damped method, each halving the gradient at worst near the optimum.
DAMPED_STEPS = 400
#: Frames under which a second thread costs more than it gives.
FRAMES_PER_THREAD = 256


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz", "arcp"})
def _solve_frames(base, inverse, stiffness, pull, tolerance, first, result, steps):
    """Solve frames one after the other from `first`; `steps` counts Newton's steps, 0 in a frame left unsolved.

    `stiffness` is the slope unit of the bounds (weight * AT_REST / SMOOTHING), `pull` the slope of the rest energy.
    """
    frames, n = base.shape
    knee = KNEE if pull > 0.0 else 0.0
    lean = pull / KNEE
    active = np.empty(n, dtype=np.int64)
    factor = np.empty((n, n))
    force = np.empty(n)
    push = np.zeros(n)
    weights = np.empty(n)
    start = first.copy()
    for frame in range(frames):
        origin = base[frame]
        for step in range(QUICK_STEPS):
            # Where g is taken as g(start) + D (c - start): (D^-1 + G_SS) force = c0_S + D^-1 g - start_S.
            count = 0
            for i in range(n):
                if start[i] < knee or start[i] > 1.0:
                    active[count] = i
                    count += 1
            for row in range(count):
                i = active[row]
                if start[i] < 0.0 or start[i] > 1.0:
                    beyond = start[i] if start[i] < 0.0 else start[i] - 1.0
                    growth = np.exp(abs(beyond) / SMOOTHING)
                    softness = SMOOTHING / (stiffness * growth)
                    slope = stiffness * (growth - 1.0) if beyond > 0.0 else -stiffness * (growth - 1.0) - pull
                else:
                    softness = 1.0 / lean
                    slope = lean * start[i] - pull
                force[row] = origin[i] + slope * softness - start[i]
                line = inverse[i]
                for column in range(row):
                    factor[row, column] = line[active[column]]
                factor[row, row] = line[i] + softness
            for row in range(count):
                for column in range(row):
                    total = factor[row, column]
                    for k in range(column):
                        total -= factor[row, k] * factor[column, k]
                    factor[row, column] = total * factor[column, column]
                total = factor[row, row]
                value = force[row]
                for k in range(row):
                    total -= factor[row, k] * factor[row, k]
                    value -= factor[row, k] * force[k]
                factor[row, row] = 1.0 / np.sqrt(total)
                force[row] = value * factor[row, row]
            for row in range(count - 1, -1, -1):
                value = force[row] * factor[row, row]
                force[row] = value
                for k in range(row):
                    force[k] -= factor[row, k] * value
            for i in range(n):
                weights[i] = origin[i]
            for row in range(count):
                value = force[row]
                push[active[row]] = value
                line = inverse[active[row]]
                for i in range(n):
                    weights[i] -= line[i] * value
            # The gradient of the energy is g where the weights now are, less the g that the step took them to have.
            # The next linearisation is at the weight, or where g is as the step took it (for a weight that the step
            # took to be inside: one smoothing outside), whichever is less far outside: the exponential would throw
            # the step away otherwise.
            worst = 0.0
            for i in range(n):
                taken, weight = push[i], weights[i]
                push[i] = 0.0
                start[i] = weight
                wanted = 0.0
                if weight < 0.0:
                    wanted = -stiffness * (np.exp(-weight / SMOOTHING) - 1.0) - pull
                    if taken < -pull:
                        start[i] = max(weight, -SMOOTHING * np.log1p((-taken - pull) / stiffness))
                    else:
                        start[i] = max(weight, -SMOOTHING)
                elif weight < knee:
                    wanted = lean * weight - pull
                elif weight > 1.0:
                    wanted = stiffness * (np.exp((weight - 1.0) / SMOOTHING) - 1.0)
                    if taken > 0.0:
                        start[i] = min(weight, 1.0 + SMOOTHING * np.log1p(taken / stiffness))
                    else:
                        start[i] = min(weight, 1.0 + SMOOTHING)
                worst = max(worst, abs(wanted - taken))
            if worst <= tolerance:
                steps[frame] = step + 1
                break
        for i in range(n):
            result[frame, i] = weights[i]


def minimise(
    base: np.ndarray,
    inverse: np.ndarray,
    *,
    bounds: float,
    sparsity: float,
    tolerance: float,
    first: np.ndarray | None = None,
    threads: int | None = None,
) -> np.ndarray:
    """Weights at the optimum of every frame.

    Parameters
    ----------
    base : (F, n) array
        `A^-1 r`, the optimum without holding energy.
    inverse : (n, n) array
        `A^-1`, symmetric.
    bounds : float
        Weight of the holding energy; 0 leaves it out.
    sparsity : float
        Weight of the rest energy within it.
    tolerance : float
        The largest component of the gradient at which a frame counts as solved.
    first : (n,) array, optional
        Weights to start frame 0 from.
    threads : int, optional
        By default as many as there are cores.

    Returns
    -------
    (F, n) array
    """
    if bounds == 0.0 or not len(base):
        return base.copy()
    pull = bounds * sparsity
    half = np.ascontiguousarray(inverse / 2.0)
    base = base - pull * half.sum(axis=0)
    result, steps = np.empty_like(base), np.zeros(len(base), dtype=np.int64)
    stiffness = bounds * AT_REST / SMOOTHING

    def part(start: int, stop: int) -> None:
        opening = np.clip(base[start], -0.05, 1.05) if first is None or start else np.clip(first, -0.05, 1.05)
        _solve_frames(
            base[start:stop], half, stiffness, pull, tolerance, opening, result[start:stop], steps[start:stop]
        )

    threads = len(os.sched_getaffinity(0)) if threads is None and hasattr(os, "sched_getaffinity") else threads or 1
    pieces = min(threads, max(1, len(base) // FRAMES_PER_THREAD))
    cuts = np.linspace(0, len(base), pieces + 1).astype(int)
    if pieces == 1:
        part(0, len(base))
    else:
        with ThreadPoolExecutor(pieces) as pool:
            list(pool.map(part, cuts[:-1], cuts[1:]))
    left = np.flatnonzero(steps == 0)
    if len(left):
        normal = np.linalg.inv(inverse)
        right = (base[left] + pull * half.sum(axis=0)) @ normal
        result[left] = minimise_damped(normal, right, bounds=bounds, sparsity=sparsity, tolerance=tolerance)
    return result


def minimise_damped(
    normal: np.ndarray, right: np.ndarray, *, bounds: float, sparsity: float, tolerance: float
) -> np.ndarray:
    """Weights at the optimum of every frame, by Newton's method with steps that are halved until the energy falls.

    Parameters
    ----------
    normal : (n, n) array
        `A`.
    right : (F, n) array
        `r`.
    bounds, sparsity, tolerance
        See `minimise`.

    Returns
    -------
    (F, n) array
    """

    def energy(c: np.ndarray, r: np.ndarray) -> np.ndarray:
        held = holding_energy(np.clip(c, -50.0, 51.0), sparsity).sum(axis=1)
        return np.einsum("fi,fi->f", c @ normal - 2.0 * r, c) + bounds * held

    weights = np.clip(np.linalg.solve(normal, right.T).T, 0.0, 1.0)
    active = np.arange(len(right))
    diagonal = np.arange(len(normal))
    for _ in range(DAMPED_STEPS):
        c, r = weights[active], right[active]
        gradient = 2.0 * (c @ normal - r) + bounds * holding_slope(c, sparsity)
        left = np.abs(gradient).max(axis=1) > tolerance
        if not left.any():
            break
        active, c, r, gradient = active[left], c[left], r[left], gradient[left]
        hessian = np.broadcast_to(2.0 * normal, (len(active), *normal.shape)).copy()
        hessian[:, diagonal, diagonal] += bounds * holding_curvature(c, sparsity)
        step = -np.linalg.solve(hessian, gradient[:, :, None])[:, :, 0]
        promised = np.einsum("fi,fi->f", gradient, step)
        before, length = energy(c, r), np.ones(len(c))
        for _ in range(60):
            after = energy(c + length[:, None] * step, r)
            short = after > before + 1e-4 * length * promised + 1e-14 * np.abs(before)
            if not short.any():
                break
            length[short] *= 0.5
        weights[active] = c + length[:, None] * step
    return weights
