"""The optimum of every frame: frames in blocks and on several cores, in the loops of `signface.solver.loops`.

- `Problem`: what the frames that show the same markers share.
- `minimise`: all frames, on several cores.
- `minimise_damped`: single frames by Newton's method with a line search: slower, and sure.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from math import inf

import numpy as np

from signface.solver.bounds import AT_REST, KNEE, SMOOTHING, holding_curvature, holding_energy, holding_slope, released
from signface.solver.loops import RENEW, finish, follow, products

#: Markers that stand too far off are drawn nearer until no weight of the frame changes by more than this.
SLIP_TOLERANCE = 1e-4
#: Rounds after which a frame is left as it is all the same. Two of 40 markers that are 4 mm off need some ten.
#: Landmarks of films fit no face better than 3 mm, nearly all are too far off, and after 80 rounds one frame of 1,000
#: has a weight that is more than 0.05 from the optimum (of 20 rounds without momentum it is one of six).
SLIP_ROUNDS = 100
#: Steps of the damped method, each halving the gradient at worst near the optimum.
DAMPED_STEPS = 400
#: Frames taken together: what they need then stays in the processor's cache from one loop to the next.
BLOCK = 256
#: Weights are padded to a multiple of this: two vector registers of eight.
PADDING = 16
#: Frames under which a second thread costs more than it gives.
FRAMES_PER_THREAD = 1024


class Problem:
    """What the frames that show the same markers share: `c' A c - 2 r' c`, with `r` linear in the markers.

    Parameters
    ----------
    normal : (n, n) array
        `A`, symmetric and positive definite.
    inverse : (n, n) array
        `A^-1`, symmetric.
    project : (n, k) array
        `r = project @ row` for the k marker coordinates `row` of a frame.
    bases : (k, n) array
        The marker coordinates that weights give, for the residual; rows of missing markers are 0.
    count : int
        Number of markers present.
    places : (n,) int array
        Where the n weights stand among all.
    width : int
        Number of all weights; those not named by `places` are 0.
    """

    def __init__(
        self,
        normal: np.ndarray,
        inverse: np.ndarray,
        project: np.ndarray,
        bases: np.ndarray,
        *,
        count: int,
        places: np.ndarray,
        width: int,
    ) -> None:
        self.normal, self.project, self.count, self.width = normal, project, count, width
        self.places = np.ascontiguousarray(places, dtype=np.int64)
        n = len(normal)
        padded = n + -n % PADDING
        self._quad, self._free = np.eye(padded), np.eye(padded)
        self._quad[:n, :n], self._free[:n, :n] = 2.0 * normal, 0.5 * inverse
        self._project = np.zeros((padded, project.shape[1]))
        self._project[:n] = 2.0 * project
        self._bases = np.zeros((len(bases) + len(bases) % 2, padded))
        self._bases[: len(bases), :n] = bases

    def solve(
        self, rows: np.ndarray, first: np.ndarray | None, stiffness: float, pull: float, release: bool, tolerance: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Weights, residuals, farthest markers and numbers of steps of consecutive frames, in this thread.

        `stiffness` is the slope unit of the bounds (weight * AT_REST / SMOOTHING), `pull` the slope of the rest energy.
        The number of steps is -1 in frames with a NaN, -2 in those not solved.
        """
        padded, frames = len(self._quad), len(rows)
        weights, residual, farthest = np.zeros((frames, self.width)), np.empty(frames), np.empty(frames)
        steps = np.zeros(frames, dtype=np.int64)
        which = np.empty(padded, dtype=np.int64)
        room = min(frames, BLOCK)
        right, solved, placed = np.empty((room, padded)), np.empty((room, padded)), np.empty((room, len(self._bases)))
        # The first and the second solve each go on from their own last frame.
        inverses, states, ages = np.empty((2, padded, padded)), np.zeros((2, 9, padded)), [RENEW, RENEW]
        if first is not None:
            states[:, 0, : len(first)] = first
        for begin in range(0, frames, BLOCK):
            some = slice(begin, min(begin + BLOCK, frames))
            block, done = rows[some], steps[some]
            right, solved, placed = right[: len(block)], solved[: len(block)], placed[: len(block)]
            products(block, self._project, right)
            for turn in range(1 + release):
                if turn == 1:
                    right += pull * released(solved)
                ages[turn] = follow(
                    right, self._quad, self._free, stiffness, SMOOTHING, pull, KNEE if pull > 0.0 else 0.0, tolerance,
                    inverses[turn], states[turn], which, ages[turn], solved, done,
                )  # fmt: skip
            products(solved, self._bases, placed)
            finish(block, placed, solved, self.places, float(self.count), weights[some], residual[some], farthest[some])
        return weights, residual, farthest, steps

    def distances(self, weights: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances between given and solved markers for (F, width) weights: (F,) root mean square, (F,) largest."""
        squared = np.square(self._apart(weights, rows)).sum(axis=2)
        return np.sqrt(squared.sum(axis=1) / self.count), np.sqrt(squared.max(axis=1))

    def beyond(self, weights: np.ndarray, rows: np.ndarray, reach: float) -> np.ndarray:
        """(F, k) by how much each marker is further than `reach` from where weights put it."""
        apart = self._apart(weights, rows)
        distance = np.sqrt(np.square(apart).sum(axis=2, keepdims=True))
        return (apart * (1.0 - reach / np.maximum(distance, reach))).reshape(len(rows), -1)

    def _apart(self, weights: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """(F, P, 3) from the solved markers to the given ones."""
        padded, placed = np.zeros((len(rows), len(self._quad))), np.empty((len(rows), len(self._bases)))
        padded[:, : len(self.places)] = weights[:, self.places]
        products(padded, self._bases, placed)
        return (rows - placed[:, : rows.shape[1]]).reshape(len(rows), -1, 3)


def minimise(
    rows: np.ndarray,
    problem: Problem,
    *,
    bounds: float,
    sparsity: float,
    tolerance: float,
    release: bool = False,
    reach: float = inf,
    first: np.ndarray | None = None,
    threads: int | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Weights at the optimum of every frame, and how far from the markers they leave the face.

    Frames in which markers stand too far off are solved again with those drawn nearer. These are Huber's modified
    residuals (P. J. Huber, Robust Statistics, 1981, 7.8): the least squares of each round have the same matrix. They
    are proximal gradient steps on what is taken off the markers, which is why momentum may be added (A. Beck and
    M. Teboulle, A fast iterative shrinkage-thresholding algorithm, 2009).

    Parameters
    ----------
    rows : (F, k) array
        Marker coordinates.
    problem : Problem
    bounds : float
        Weight of the holding energy; 0 leaves it out.
    sparsity : float
        Weight of the rest energy within it.
    tolerance : float
        The length of the gradient at which a frame counts as solved.
    release : bool
        Solve a second time without the rest energy of clearly active weights.
    reach : float
        Distance from the solved face beyond which a marker pulls no harder.
    first : (n,) array, optional
        Weights to start frame 0 from.
    threads : int, optional
        By default as many as there are cores.

    Returns
    -------
    (F, width) array
        The weights. Frames of which `rows` has a NaN are not solved.
    (F,) array
        Root mean square distance of the markers, NaN in the frames not solved.
    """
    rows = np.require(rows, np.float64, ["C", "W"])
    if threads is None:
        threads = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    how = (bounds, sparsity, release, tolerance)
    weights, residual, farthest = _optimum(rows, problem, first, threads, *how)
    frames = np.flatnonzero(farthest > reach)
    taken, ahead = (np.zeros((len(frames), rows.shape[1])) for _ in range(2))
    momentum = np.ones(len(frames))
    for _ in range(SLIP_ROUNDS):
        if not len(frames):
            break
        before, last = weights[frames], taken
        taken = problem.beyond(before, rows[frames], reach)
        # Nesterov's momentum (FISTA), begun again in each frame where it points uphill (O'Donoghue and Candes 2015).
        uphill = ((ahead - taken) * (taken - last)).sum(axis=1) > 0.0
        momentum[uphill] = 1.0
        further = 0.5 + np.sqrt(0.25 + momentum**2)
        ahead = taken + ((momentum - 1.0) / further)[:, None] * (taken - last)
        momentum = further
        weights[frames] = _optimum(rows[frames] - ahead, problem, first, threads, *how)[0]
        residual[frames] = problem.distances(weights[frames], rows[frames])[0]
        going = np.abs(weights[frames] - before).max(axis=1) > SLIP_TOLERANCE
        frames, taken, ahead, momentum = frames[going], taken[going], ahead[going], momentum[going]
    return weights, residual


def _optimum(
    rows: np.ndarray,
    problem: Problem,
    first: np.ndarray | None,
    threads: int,
    bounds: float,
    sparsity: float,
    release: bool,
    tolerance: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Weights, residuals and farthest markers of all frames, each thread with a span of them."""
    how = (bounds * AT_REST / SMOOTHING, bounds * sparsity, release, tolerance)
    spans = min(threads, max(1, len(rows) // FRAMES_PER_THREAD))
    if spans == 1:
        weights, residual, farthest, steps = problem.solve(rows, first, *how)
    else:
        cuts = np.linspace(0, len(rows), spans + 1).astype(int)
        with ThreadPoolExecutor(spans) as pool:
            solved = pool.map(
                lambda start, stop: problem.solve(rows[start:stop], first if start == 0 else None, *how),
                cuts[:-1],
                cuts[1:],
            )
            weights, residual, farthest, steps = map(np.concatenate, zip(*solved))
    left = np.flatnonzero(steps == -2)
    if len(left):
        right = rows[left] @ problem.project.T
        sure = minimise_damped(problem.normal, right, bounds=bounds, sparsity=sparsity, tolerance=tolerance)
        if release:
            right = right + 0.5 * bounds * sparsity * released(sure)
            sure = minimise_damped(problem.normal, right, bounds=bounds, sparsity=sparsity, tolerance=tolerance)
        weights[np.ix_(left, problem.places)] = sure
        residual[left], farthest[left] = problem.distances(weights[left], rows[left])
    return weights, residual, farthest


def minimise_damped(
    normal: np.ndarray, right: np.ndarray, *, bounds: float, sparsity: float, tolerance: float
) -> np.ndarray:
    """(F, n) weights at the optimum of every frame, by Newton's method with steps halved until the energy falls.

    Parameters
    ----------
    normal : (n, n) array
        `A`.
    right : (F, n) array
        `r`.
    bounds, sparsity, tolerance
        See `minimise`.
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
