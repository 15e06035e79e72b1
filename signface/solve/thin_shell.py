"""The thin-shell regularised solve: markers to weights (seed 001, 5.2.3, eq. 5.21 to 5.30).

The energy of the weights `c` of one frame is

    E(c) = D(c) + TOLERANCE^2 * alpha * T(c) + (1 - alpha) * B(c)

- `D`: squared distances between the given and the solved markers, summed over the markers present, divided by what
  one typical base does to all markers (`MarkerBases.scale`): 1 is a typical base missed altogether.
- `T`: the thin-shell energy of the deformed skin, half stretching and half bending, each divided by its mean over the
  bases that the markers observe: 1 is one typical base, fully active.
- `B`: the bound energy (`signface.solve.bounds`), summed over the weights: exactly 0 where all lie between 0 and 1.

Why not eq. 5.25 as printed: its pointwise form depends on the unit of length and on how finely the face is meshed
(on a dense face in centimetres it is of the order of 10^9 against 10 for the markers). Here every term is a ratio of
like quantities, so that alpha means the same on any face: the weights do not change with the unit of length, and
hardly with the subdivision of the mesh. Eq. 5.25 leaves out the rows of the vertices with markers; a vertex's share of
an energy is proportional to the area around it, and 40 of 3,500 are a hundredth of it that vanishes as the mesh is
refined, so nothing is left out here. `docs/solver.md` has the figures.

The energy is convex; where the markers and the shell leave a weight undetermined it is held at 0 by the shell.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.face.operators import thin_shell_matrices
from signface.solve.bounds import bound_curvature, bound_energy, bound_slope
from signface.solve.solver import MarkerBases, Solution, presence_patterns

#: How much the shell counts beside the markers: a typical base's shell energy weighs as much as missing the markers
#: by this share of what the base does to them.
TOLERANCE = 0.1
#: The weight of the thin shell that the thesis settles on (5.3, 6.3).
ALPHA = 0.3
#: The gradient's norm at which a frame counts as solved, relative to that at rest or to 1.
GRADIENT = 1e-9
#: Newton's steps are few; this many are never needed (the tests look).
STEPS = 60
#: Frames solved side by side.
BATCH = 1024


class ThinShellSolver:
    """Weights that bring the avatar's markers to given places and bend its skin least.

    Parameters
    ----------
    face : FaceModel
    layout : MarkerLayout
    alpha : float
        Weight of the thin shell, from 0 (only the bounds regularise) to 1 (only the shell does); `1 - alpha` is the
        weight of the bounds.

    Raises
    ------
    SignfaceError
        `alpha` is not between 0 and 1, there are too few markers, or bases are linearly dependent at the markers.
    """

    def __init__(self, face: FaceModel, layout: MarkerLayout, *, alpha: float = ALPHA) -> None:
        if not (np.isfinite(alpha) and 0.0 <= alpha <= 1.0):
            raise SignfaceError(f"alpha must lie between 0 and 1, not {alpha}")
        self.names = face.names
        self.alpha = float(alpha)
        self.markers = MarkerBases(face, layout)
        observed = self.markers.observed
        shell = np.zeros((int(observed.sum()),) * 2)
        for part in thin_shell_matrices(face):
            seen = part[np.ix_(observed, observed)]
            shell += 0.5 * seen / np.diag(seen).mean()
        self.shell = TOLERANCE**2 * self.alpha * shell
        self.bounds = 1.0 - self.alpha
        self._columns = self.markers.matrix[:, observed]

    def energy(self, weights: np.ndarray, displacements: np.ndarray) -> np.ndarray:
        """(F,) energy of (F, N) weights for (F, P, 3) displacements: what `solve` minimises."""
        rows, present = self.markers.checked(displacements)
        seen = np.repeat(present, 3, axis=1)
        error = (weights @ self.markers.matrix.T - rows) * seen
        own = weights[:, self.markers.observed]
        data = np.einsum("fi,fi->f", error, error) / self.markers.scale
        return data + np.einsum("fi,ij,fj->f", own, self.shell, own) + self.bounds * bound_energy(own).sum(axis=1)

    def solve(self, displacements: np.ndarray) -> Solution:
        """Weights of each frame at the optimum of the energy.

        Parameters
        ----------
        displacements : (F, P, 3) array
            Displacements of the layout's face markers from their neutral places (eq. 5.21), in the face's unit; NaN
            where a marker is missing.

        Returns
        -------
        Solution
        """
        rows, present = self.markers.checked(displacements)
        weights = np.zeros((len(rows), len(self.names)))
        for pattern, frames in presence_patterns(present):
            columns = self._columns * np.repeat(pattern, 3)[:, None]
            normal = columns.T @ columns / self.markers.scale + self.shell
            for start in range(0, len(frames), BATCH):
                batch = frames[start : start + BATCH]
                right = rows[batch] @ columns / self.markers.scale
                weights[np.ix_(batch, self.markers.observed)] = _minimise(normal, right, self.bounds)
        return self.markers.solution(weights, rows, present)


def _minimise(normal: np.ndarray, right: np.ndarray, bounds: float) -> np.ndarray:
    """(F, N) minimisers of `c' normal c - 2 right' c + bounds * sum B(c)`, by Newton's method on all frames at once.

    A frame whose unbounded minimiser lies within the bounds is done at once. The steps of the others are shortened
    until the energy falls (Armijo), which makes the method converge from anywhere on a convex energy.
    """
    slack = np.finfo(float).eps * len(normal) * np.trace(normal)
    factor = cho_factor(normal + slack * np.eye(len(normal)))
    weights = cho_solve(factor, right.T).T
    if bounds == 0.0:
        return weights
    scale = GRADIENT * np.maximum(1.0, np.abs(right).max(axis=1))
    active = np.arange(len(right))
    # The exponential overflows far outside; what starts there starts from the nearest point just outside instead.
    weights = np.clip(weights, -1.0, 2.0)
    for _ in range(STEPS):
        c, b = weights[active], right[active]
        gradient = 2.0 * (c @ normal - b) + bounds * bound_slope(c)
        left = np.abs(gradient).max(axis=1) > scale[active]
        if not left.any():
            break
        active, c, b, gradient = active[left], c[left], b[left], gradient[left]
        hessian = np.broadcast_to(2.0 * normal, (len(active), *normal.shape)).copy()
        diagonal = np.arange(len(normal))
        hessian[:, diagonal, diagonal] += bounds * bound_curvature(c) + 2.0 * slack
        step = -np.linalg.solve(hessian, gradient[:, :, None])[:, :, 0]
        weights[active] = _shortened(normal, b, bounds, c, step, gradient)
    return weights


def _shortened(
    normal: np.ndarray, right: np.ndarray, bounds: float, c: np.ndarray, step: np.ndarray, gradient: np.ndarray
) -> np.ndarray:
    """The points `c + t * step`, t halved in each frame until the energy falls enough."""
    slope = np.einsum("fi,fi->f", gradient, step)
    before = _energy(normal, right, bounds, c)
    length = np.ones(len(c))
    for _ in range(40):
        after = _energy(normal, right, bounds, c + length[:, None] * step)
        short = after > before + 1e-4 * length * slope + 1e-15 * np.abs(before)
        if not short.any():
            break
        length[short] *= 0.5
    return c + length[:, None] * step


def _energy(normal: np.ndarray, right: np.ndarray, bounds: float, c: np.ndarray) -> np.ndarray:
    """(F,) energies, but for the constant."""
    return np.einsum("fi,fi->f", c @ normal - 2.0 * right, c) + bounds * bound_energy(c).sum(axis=1)
