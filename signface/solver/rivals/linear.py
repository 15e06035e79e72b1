"""Rivals of the thin shell that need nothing but the markers: least squares, with and without bounds.

- `LeastSquares`: the unconstrained minimum of eq. 5.23, one matrix product a frame.
- `NonNegative`: weights of at least 0 (Lawson and Hanson's NNLS, Reverdy 2019, 2.3.3).
- `Bounded`: weights from 0 to 1.
"""

from __future__ import annotations

import numpy as np

from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.solver.base import MarkerBases, Solution, presence_patterns


class _OnMarkers:
    """What the three share: frames grouped by the markers they have, each group solved on its own rows."""

    def __init__(self, face: FaceModel, layout: MarkerLayout) -> None:
        self.names = face.names
        self.markers = MarkerBases(face, layout)

    def solve(self, displacements: np.ndarray) -> Solution:
        """Weights of each frame; see `signface.solver.base.Solver`."""
        rows, present = self.markers.checked(displacements)
        weights = np.zeros((len(rows), len(self.names)))
        for pattern, frames in presence_patterns(present):
            seen = np.repeat(pattern, 3)
            columns = self.markers.matrix[np.ix_(seen, self.markers.observed)]
            weights[np.ix_(frames, self.markers.observed)] = self._weights(columns, rows[np.ix_(frames, seen)])
        return self.markers.solution(weights, rows, present)

    def _weights(self, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """(F, n) weights for the observed bases (k, n) and the frames' displacements (F, k)."""
        raise AssertionError("each solver has its own")


class LeastSquares(_OnMarkers):
    """Least squares without bounds (eq. 5.23): fast, and useless where bases are nearly dependent."""

    def _weights(self, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        return rows @ np.linalg.pinv(columns).T


class NonNegative(_OnMarkers):
    """Non-negative least squares, frame by frame."""

    def _weights(self, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        from scipy.optimize import nnls

        return np.array([nnls(columns, row)[0] for row in rows])


class Bounded(_OnMarkers):
    """Least squares with weights from 0 to 1 (bounded-variable least squares), frame by frame."""

    def _weights(self, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        from scipy.optimize import lsq_linear

        return np.array([lsq_linear(columns, row, bounds=(0.0, 1.0), method="bvls").x for row in rows])
