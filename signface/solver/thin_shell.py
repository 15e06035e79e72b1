"""The thin-shell regularised solve: markers to weights (Reverdy 2019, 5.2.3, eq. 5.21 to 5.30).

The energy of the weights `c` of one frame is

    E(c) = D(c) + TOLERANCE^2 * alpha * T(c) + (1 - alpha) * H(c)

- `D`: squared distances between the given and the solved markers, summed over the markers present, divided by what
  one typical base does to all markers (`MarkerBases.scale`): 1 is a typical base missed altogether. The head markers
  creep too, and every face marker then moves with them as one. `D` therefore is the least over small rigid motions
  `h` of the head (three shifts, three turns), whose own square is added divided by `HEAD_SLACK`: with a slack of 0.3, a
  shift of the head is as likely as errors of half its size in all markers.
- `T`: the thin-shell energy of the deformed skin, half stretching and half bending, each divided by its mean over the
  bases that the markers observe: 1 is one typical base, fully active.
- `H`: what holds the weights from 0 to 1 and at rest (`signface.solver.bounds`), summed over the weights.

Why not eq. 5.25 as printed: its pointwise form depends on the unit of length and on how finely the face is meshed (on
a dense face in centimetres it is of the order of 10^9 against 10 for the markers). Here every term is a ratio of like
quantities, so that alpha means the same on any face: the weights do not change with the unit of length, and hardly
with the subdivision of the mesh. Eq. 5.25 leaves out the rows of the vertices with markers. A vertex's share of an
energy is proportional to the area around it: 40 vertices of 3,400 hold a hundredth of it, which vanishes as the mesh is
refined, so nothing is left out here. `docs/solver.md` has the figures.

The energy is convex and has one minimum: weights that the markers leave undetermined are held by the shell. Rest
shrinks what it holds, so that a second solve, as convex, lets go of the weights that the first found clearly active
(`signface.solver.bounds.released`).
"""

from __future__ import annotations

import numpy as np

from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.face.operators import thin_shell_matrices
from signface.solver.base import MarkerBases, Solution, presence_patterns
from signface.solver.bounds import holding_curvature, holding_energy, released
from signface.solver.newton import Problem, minimise

#: How much the shell counts beside the markers: a typical base's shell energy weighs as much as missing the markers
#: by this share of what the base does to them.
TOLERANCE = 0.05
#: The weight of the thin shell that the thesis settles on (5.3, 6.3).
ALPHA = 0.3
#: Weight of the rest energy.
SPARSITY = 0.006
#: Variance of the head's residual shift (and of its turn, at the markers' distance from their centre) beside that of a
#: marker's coordinate.
HEAD_SLACK = 0.3
#: A marker further from the solved face than this share of a typical base's root mean square displacement pulls no
#: harder than one at that distance (1.3 mm on the default face).
SLIP = 0.4
#: The length of the gradient at which a frame counts as solved. Energies are of the order of 1.
GRADIENT = 1e-8
#: Frames solved at a time, so that a long take needs little memory.
CHUNK = 16384


class ThinShellSolver:
    """Weights that bring the avatar's markers to given places and bend its skin least.

    Parameters
    ----------
    face : FaceModel
    layout : MarkerLayout
    alpha : float
        Weight of the thin shell, from 0 (only bounds and rest regularise) to 1 (only the shell does).
    sparsity : float
        Weight of the rest energy, 0 or more: what decides between explanations that the markers hardly tell apart.
    release : bool
        Solve a second time without the rest energy of the weights that are clearly active, so that expressions are not
        weakened by it.
    head_slack : float
        How far the head's motion may have been taken away wrongly, 0 or more; 0 trusts the head markers.
    slip : float
        How far a marker may be from the solved face before it counts less (Huber's estimator), as a share of what a
        typical base does to a marker; 0 trusts every marker. A marker that has slipped does not bend the face then.
    signer_bases : (N, P, 3) array, optional
        The bases as this signer shows them at the markers (`signface.solver.calibration.calibrate`); by default the
        avatar's.
    threads : int, optional
        Cores to use; all by default.

    Raises
    ------
    SignfaceError
        `alpha` or `sparsity` is out of range, there are too few markers, or bases are linearly dependent on the skin
        (with `alpha` 0, at the markers).

    Examples
    --------
    >>> import signface as sf
    >>> face = sf.read_face()
    >>> layout = sf.read_layout("default-40", face)
    >>> smile = 0.8 * layout.bases(face)[[face.names.index("mouthSmileLeft")]]
    >>> solution = ThinShellSolver(face, layout).solve(smile)
    >>> solution.weights.shape, face.names[solution.weights[0].argmax()]
    ((1, 51), 'mouthSmileLeft')
    """

    def __init__(
        self,
        face: FaceModel,
        layout: MarkerLayout,
        *,
        alpha: float = ALPHA,
        sparsity: float = SPARSITY,
        release: bool = True,
        head_slack: float = HEAD_SLACK,
        slip: float = SLIP,
        signer_bases: np.ndarray | None = None,
        threads: int | None = None,
    ) -> None:
        if not (np.isfinite(alpha) and 0.0 <= alpha <= 1.0):
            raise SignfaceError(f"alpha must lie between 0 and 1, not {alpha}")
        for name, value in {"sparsity": sparsity, "head_slack": head_slack, "slip": slip}.items():
            if not (np.isfinite(value) and value >= 0.0):
                raise SignfaceError(f"{name} must be 0 or more, not {value}")
        self.names = face.names
        self.alpha, self.sparsity, self.threads = float(alpha), float(sparsity), threads
        self.release = release and self.sparsity > 0.0 and self.alpha < 1.0
        self.markers = MarkerBases(face, layout, skin=self.alpha > 0.0, signer_bases=signer_bases)
        self._reach = slip * np.sqrt(self.markers.scale / self.markers.n_markers) if slip > 0.0 else np.inf
        observed = self.markers.observed
        shell = np.zeros((int(observed.sum()),) * 2)
        for energy in thin_shell_matrices(face):
            seen = energy[np.ix_(observed, observed)]
            shell += 0.5 * seen / np.diag(seen).mean()
        self.shell = TOLERANCE**2 * self.alpha * shell
        self.holding = 1.0 - self.alpha
        # The head's six motions stand beside the bases. The inverse's part that belongs to the bases is what solving
        # for both and keeping the weights amounts to.
        self._n = len(shell)
        motions = _rigid_motions(layout.points(face)) if head_slack > 0.0 else np.empty((3 * self.markers.n_markers, 0))
        self._columns = np.hstack([self.markers.matrix[:, observed], motions]) / np.sqrt(self.markers.scale)
        self._prior = np.zeros((self._columns.shape[1],) * 2)
        self._prior[: self._n, : self._n] = self.shell
        slack = np.arange(self._n, len(self._prior))
        self._prior[slack, slack] = 1.0 / (head_slack * self.markers.scale) if head_slack > 0.0 else 0.0
        full = self._columns.T @ self._columns + self._prior
        # Rounding must not make bases that are opposed to one another (an eye turned in and out) undetermined.
        bases = np.arange(self._n)
        full[bases, bases] += 1e-12 * np.trace(full[: self._n, : self._n])
        self._full = 0.5 * (full + full.T)
        self._inverse = _inverse(self._full)
        self._whole = self._problem(np.ones(self.markers.n_markers, dtype=bool))

    def energy(self, weights: np.ndarray, displacements: np.ndarray, first: np.ndarray | None = None) -> np.ndarray:
        """(F,) energy of (F, N) weights for (F, P, 3) displacements: what `solve` minimises.

        With `release` there are two: the first solve's, and, given the (F, N) weights `first` at its optimum (those of
        a solver without release), the second's.
        """
        rows, present = self.markers.checked(displacements)
        error = (weights @ self.markers.matrix.T - rows) / np.sqrt(self.markers.scale)
        acting = weights[:, self.markers.observed]
        data = np.zeros(len(rows))
        for pattern, frames in presence_patterns(present):
            seen = np.repeat(pattern, 3)
            # The least over the head's motions h of |error + J h|^2 + h' P h, by stacking both.
            motions = self._columns[seen, self._n :]
            stacked = np.vstack([motions, np.sqrt(self._prior[self._n :, self._n :])])
            wanted = np.zeros((len(stacked), len(frames)))
            wanted[: len(motions)] = error[np.ix_(frames, seen)].T
            left = wanted - stacked @ np.linalg.lstsq(stacked, wanted, rcond=None)[0]
            data[frames] = (left**2).sum(axis=0)
        shell = np.einsum("fi,ij,fj->f", acting, self.shell, acting)
        held = holding_energy(acting, self.sparsity)
        if first is not None:
            held -= self.sparsity * released(first[:, self.markers.observed]) * acting
        return data + shell + self.holding * held.sum(axis=1)

    def solve(self, displacements: np.ndarray) -> Solution:
        """Weights of each frame at the optimum of the energy; see `signface.solver.base.Solver`."""
        starts = range(0, max(1, len(displacements)), CHUNK)
        chunks = [self._solve_chunk(displacements[start : start + CHUNK]) for start in starts]
        weights, residual = ([getattr(chunk, name) for chunk in chunks] for name in ("weights", "residual"))
        return Solution(np.concatenate(weights), np.concatenate(residual))

    def _solve_chunk(self, displacements: np.ndarray) -> Solution:
        rows = self.markers.rows(displacements)
        weights, residual = self._minimise(rows, self._whole)
        left = np.flatnonzero(np.isnan(residual))
        if len(left):
            some, present = self.markers.checked(displacements[left])
            weights[left] = np.nan
            for pattern, frames in presence_patterns(present):
                before = weights[max(left[frames[0]] - 1, 0), self._whole.places]
                first = before if np.isfinite(before).all() else None
                solved = self._minimise(some[frames], self._problem(pattern), first)
                weights[left[frames]], residual[left[frames]] = solved
        return Solution(weights, residual)

    def _minimise(
        self, rows: np.ndarray, problem: Problem, first: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        return minimise(
            rows,
            problem,
            bounds=self.holding,
            sparsity=self.sparsity,
            tolerance=GRADIENT,
            release=self.release,
            reach=self._reach,
            first=first,
            threads=self.threads,
        )

    def stream(self) -> Stream:
        """A live capture to be solved frame by frame; several may share one solver.

        See Also
        --------
        solve : all frames of a recording.

        Examples
        --------
        >>> import signface as sf
        >>> face = sf.read_face("default")
        >>> solver = ThinShellSolver(face, sf.read_layout("default-40", face))
        >>> stream = solver.stream()
        >>> stream.push(np.zeros((40, 3))).weights.round(6).max().item()
        0.0
        """
        return Stream(self)

    def uncertainty(self, weights: np.ndarray, marker_error: float | np.ndarray) -> np.ndarray:
        """Standard deviation of each weight, from the curvature of the energy at the optimum.

        With independent errors of the markers' coordinates and the energy read as a log-likelihood, the weights'
        covariance is the inverse of the energy's second derivative (Laplace's approximation). It says how well the
        markers and the regularisation determine a weight, not how well the face fits the signer.

        Parameters
        ----------
        weights : (F, N) array
            Solved weights.
        marker_error : float or (F,) array
            Standard deviation of a marker's coordinate in the face's unit (jitter and misfit, 0.3 mm say), the same or
            each frame's own.

        Returns
        -------
        (F, N) array
            NaN for the bases that the markers do not observe.
        """
        observed = self.markers.observed
        result = np.full(np.shape(weights), np.nan)
        acting = np.asarray(weights)[:, observed]
        held = self.holding * holding_curvature(acting, self.sparsity)
        # D is the squared error over `scale`: a log-likelihood is it times scale / (2 * marker_error^2).
        factor = np.broadcast_to(marker_error, len(acting))[:, None] / np.sqrt(self.markers.scale)
        diagonal = np.arange(acting.shape[1])
        normal = self._whole.normal
        for start in range(0, len(acting), 1024):
            some = slice(start, start + 1024)
            hessian = np.broadcast_to(normal, (len(acting[some]), *normal.shape)).copy()
            hessian[:, diagonal, diagonal] += 0.5 * held[some]
            variance = np.linalg.inv(hessian)[:, diagonal, diagonal]
            result[some, observed] = factor[some] * np.sqrt(np.maximum(variance, 0.0))
        return result

    def _problem(self, pattern: np.ndarray) -> Problem:
        """The quadratic form when only the markers of `pattern` are there, the head's motions eliminated.

        The inverse is that of all markers, updated. Taking k rows `a` out of `A = sum a' a + shell` gives
        `V + V a' (I - a V a')^-1 a V` with `V = A^-1` (Woodbury); past a third as many rows as bases it is cheaper to
        invert anew.
        """
        full, inverse = self._full, self._inverse
        gone = self._columns[np.repeat(~pattern, 3)]
        if len(gone):
            full = full - gone.T @ gone
            if 3 * len(gone) > len(full):
                inverse = _inverse(full)
            else:
                across = inverse @ gone.T
                inverse = inverse + across @ np.linalg.solve(np.eye(len(gone)) - gone @ across, across.T)
        n, observed = self._n, self.markers.observed
        # Weights c leave the head's best motions h at h = F_hh^-1 (J' row - F_hc c).
        motions = np.linalg.solve(full[n:, n:], full[n:, :n])
        return Problem(
            full[:n, :n] - full[:n, n:] @ motions,
            inverse[:n, :n],
            (self._columns[:, :n] - self._columns[:, n:] @ motions).T / np.sqrt(self.markers.scale),
            self.markers.matrix[:, observed] * np.repeat(pattern, 3)[:, None],
            count=int(pattern.sum()),
            places=np.flatnonzero(observed),
            width=len(self.names),
        )


class Stream:
    """Frames of one live capture, each solved from the one pushed before it; made by `ThinShellSolver.stream`."""

    def __init__(self, solver: ThinShellSolver) -> None:
        self._solver = solver
        self._pattern, self._problem = np.ones(solver.markers.n_markers, dtype=bool), solver._whole
        self._last: np.ndarray | None = None

    def push(self, frame: np.ndarray) -> Solution:
        """Weights of one frame, as `solve` gives them, from its (P, 3) displacements of the face markers."""
        solver = self._solver
        rows, present = solver.markers.checked(np.asarray(frame, dtype=np.float64)[None])
        if not present.any():
            return Solution(np.full((1, len(solver.names)), np.nan), np.full(1, np.nan))
        if (present[0] != self._pattern).any():
            self._pattern, self._problem = present[0], solver._problem(present[0])
        weights, residual = solver._minimise(rows, self._problem, self._last)
        self._last = weights[0, solver._whole.places]
        return Solution(weights, residual)


def _rigid_motions(points: np.ndarray) -> np.ndarray:
    """(3P, 6) displacements of (P, 3) points by the shifts along and the small turns about the three axes.

    The turns go through the points' centre and are scaled to the same root mean square displacement for all sizes.
    """
    spread = points - points.mean(axis=0)
    spread /= np.sqrt((spread**2).sum(axis=1).mean())
    axes = np.eye(3)
    shifts = [np.tile(axis, (len(points), 1)) for axis in axes]
    turns = [np.cross(axis, spread) for axis in axes]
    return np.stack([*shifts, *turns], axis=-1).reshape(-1, 6)


def _inverse(matrix: np.ndarray) -> np.ndarray:
    """The inverse of a symmetric positive definite matrix, symmetric to the last bit."""
    inverse = np.linalg.inv(matrix)
    return 0.5 * (inverse + inverse.T)
