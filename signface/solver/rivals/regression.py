"""Mappings learnt from pairs of markers and weights.

- `RbfNetwork`: a radial basis function network (Reverdy 2019, eq. 2.13 and 2.14).
- `GaussianProcessSolve`: Gaussian process regression.
- `SparseGaussianProcessSolve`: its sparse online form (Csato and Opper, "Sparse On-Line Gaussian Processes", Neural
  Computation 14, 2002; Reverdy 2019, 3.3.1).
- `example_pairs`: pairs made with the avatar, where none were recorded.

The three share `solve`; a missing marker is first put where the pairs would expect it from the others.
"""

from __future__ import annotations

import numpy as np

from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.solver.base import MarkerBases, Solution, presence_patterns
from signface.solver.rivals.gaussian_process import GaussianProcess, SparseOnlineGaussianProcess, gaussian_kernel

#: Pairs made where none are given, and the jitter of their markers beside the typical displacement.
PAIRS, JITTER = 800, 0.02


def example_pairs(
    face: FaceModel, layout: MarkerLayout, *, count: int = PAIRS, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Expressions of the avatar: a few random bases each, and where they carry the markers.

    Returns
    -------
    (count, P, 3) array, (count, N) array
        Displacements in the face's unit, with a little jitter, and weights.
    """
    rng = np.random.default_rng(seed)
    weights = rng.uniform(0.0, 1.0, (count, face.n_bases)) * (rng.random((count, face.n_bases)) < 0.15)
    marked = np.tensordot(weights, layout.bases(face), axes=1)
    return marked + rng.normal(0.0, JITTER * marked.std(), marked.shape), weights


class _Learnt:
    """What the three share: the pairs, and filling in of missing markers by their linear regression."""

    def __init__(
        self, face: FaceModel, layout: MarkerLayout, pairs: tuple[np.ndarray, np.ndarray] | None = None
    ) -> None:
        self.names = face.names
        self.markers = MarkerBases(face, layout)
        displacements, weights = example_pairs(face, layout) if pairs is None else pairs
        rows, present = self.markers.checked(displacements)
        if not present.all() or weights.shape != (len(rows), len(self.names)) or len(rows) < 2:
            raise SignfaceError("a mapping is learnt from at least two frames with all markers and their weights")
        self._scale = float(rows.std())
        self._covariance = rows.T @ rows / len(rows)
        self._learn(rows / self._scale, weights)

    def solve(self, displacements: np.ndarray) -> Solution:
        """Weights of each frame; see `signface.solver.base.Solver`."""
        rows, present = self.markers.checked(displacements)
        filled = rows.copy()
        for pattern, frames in presence_patterns(present):
            if not pattern.all():
                seen = np.repeat(pattern, 3)
                among = self._covariance[np.ix_(seen, seen)]
                among = among + 1e-4 * np.trace(among) / len(among) * np.eye(len(among))
                expected = np.linalg.solve(among, self._covariance[np.ix_(seen, ~seen)])
                filled[np.ix_(frames, ~seen)] = rows[np.ix_(frames, seen)] @ expected
        chunks = np.array_split(filled / self._scale, -(-len(rows) // 4096))
        weights = np.concatenate([self._predict(chunk) for chunk in chunks])
        return self.markers.solution(weights, rows, present)

    def _learn(self, inputs: np.ndarray, weights: np.ndarray) -> None:
        raise AssertionError("each mapping has its own")

    def _predict(self, inputs: np.ndarray) -> np.ndarray:
        raise AssertionError("each mapping has its own")


class RbfNetwork(_Learnt):
    """`sum_l c_l exp(-|x - x_l|^2 / 2 sigma^2)` with regularised coefficients (eq. 2.13 and 2.14).

    `sigma` is twice the median distance between the pairs, the regularisation a thousandth.
    """

    def _learn(self, inputs: np.ndarray, weights: np.ndarray) -> None:
        from scipy.spatial.distance import pdist

        self._centres, self._width = inputs, 2.0 * float(np.median(pdist(inputs[:500])))
        kernel = gaussian_kernel(inputs, inputs, self._width)
        self._coefficients = np.linalg.solve(kernel.T @ kernel + 1e-3 * np.eye(len(kernel)), kernel.T @ weights)

    def _predict(self, inputs: np.ndarray) -> np.ndarray:
        return gaussian_kernel(inputs, self._centres, self._width) @ self._coefficients


class GaussianProcessSolve(_Learnt):
    """Gaussian process regression, see `signface.solver.rivals.gaussian_process`."""

    estimator: type[GaussianProcess | SparseOnlineGaussianProcess] = GaussianProcess

    def _learn(self, inputs: np.ndarray, weights: np.ndarray) -> None:
        self._process = self.estimator().fit(inputs, weights)

    def _predict(self, inputs: np.ndarray) -> np.ndarray:
        return self._process.predict(inputs)


class SparseGaussianProcessSolve(GaussianProcessSolve):
    """A Gaussian process that takes one pair at a time and keeps the most telling of them."""

    estimator = SparseOnlineGaussianProcess
