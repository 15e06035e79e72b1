"""Direct thin-shell deformation: the mesh moved by the markers, no bases (Reverdy 2019, 2.3.4, eq. 2.15 to 2.17).

All vertices are free; the skin takes the displacement of least stretching and bending that carries the markers where
they are. Weights are then read off by projecting that displacement on the bases.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.face.operators import stiffness_and_mass
from signface.solver.base import MarkerBases, Solution, presence_patterns

#: The length, as a share of the square root of the skin's area, above which the skin resists stretching more than
#: bending.
BENDING_LENGTH = 0.1


class ThinShellDeformation:
    """Marker displacements to displacements of all vertices, and to weights.

    Minimises `d' (S + l^2 S M^-1 S) d` (eq. 2.16, `k_s = 1` and `k_b = l^2`) under the condition that the markers'
    points move with the markers. The response of the skin to each marker is computed once.

    Parameters
    ----------
    face : FaceModel
    layout : MarkerLayout
    """

    def __init__(self, face: FaceModel, layout: MarkerLayout) -> None:
        from scipy.sparse.linalg import splu

        self.names = face.names
        self.markers = MarkerBases(face, layout)
        stiffness, mass = stiffness_and_mass(face.mesh)
        count, area = self.markers.n_markers, mass.sum()
        shell = stiffness + BENDING_LENGTH**2 * area * stiffness @ sparse.diags(1.0 / mass) @ stiffness
        # A shift of the whole skin bends nothing: a trace of mass decides for the smallest.
        shell = (shell + 1e-6 / area * sparse.diags(mass)).tocsc()
        rows = [layout.labels.index(label) for label in layout.face_labels]
        points = sparse.csr_matrix(
            (layout.barycentric[rows].ravel(), (np.repeat(np.arange(count), 3), layout.corners[rows].ravel())),
            shape=(count, len(mass)),
        )
        self._response = splu(shell).solve(points.T.toarray())  # (V, P)
        self._at_markers = points @ self._response
        bases = face.bases[self.markers.observed] * np.sqrt(mass)[:, None]
        self._projection = np.linalg.pinv(bases.reshape(len(bases), -1).T) * np.repeat(np.sqrt(mass), 3)

    def deform(self, displacements: np.ndarray) -> np.ndarray:
        """(F, V, 3) displacement of every vertex for (F, P, 3) displacements of the markers."""
        rows, present = self.markers.checked(displacements)
        result = np.full((len(rows), len(self._response), 3), np.nan)
        for pattern, frames in presence_patterns(present):
            forces = self._forces(pattern, rows[frames])
            result[frames] = np.einsum("vp,fpd->fvd", self._response[:, pattern], forces, optimize=True)
        return result

    def solve(self, displacements: np.ndarray) -> Solution:
        """Weights of each frame; see `signface.solver.base.Solver`."""
        rows, present = self.markers.checked(displacements)
        weights = np.zeros((len(rows), len(self.names)))
        by_vertex = self._projection.reshape(len(self._projection), -1, 3)
        for pattern, frames in presence_patterns(present):
            across = np.einsum("nvd,vp->npd", by_vertex, self._response[:, pattern], optimize=True)
            solved = np.einsum("npd,fpd->fn", across, self._forces(pattern, rows[frames]), optimize=True)
            weights[np.ix_(frames, self.markers.observed)] = solved
        return self.markers.solution(weights, rows, present)

    def _forces(self, pattern: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """(F, p, 3) forces at the markers present that carry them where they are."""
        inner = self._at_markers[np.ix_(pattern, pattern)]
        moved = rows.reshape(len(rows), -1, 3)[:, pattern]
        return np.einsum("pq,fqd->fpd", np.linalg.inv(inner), moved, optimize=True)
