"""`Mesh`: a triangulated surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from signface.content import Content
from signface.errors import SignfaceError


@dataclass(frozen=True, eq=False)
class Mesh(Content):
    """A triangle mesh.

    Parameters
    ----------
    vertices : (V, 3) float64 array
        Positions in millimetres.
    triangles : (T, 3) int64 array
        Vertex indices, counter-clockwise seen from outside.

    Raises
    ------
    SignfaceError
        Shapes are wrong, a coordinate is not finite, or a triangle names a vertex that does not exist.
    """

    vertices: np.ndarray
    triangles: np.ndarray

    def __post_init__(self) -> None:
        vertices = np.array(self.vertices, dtype=np.float64)
        triangles = np.array(self.triangles, dtype=np.int64)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or len(vertices) < 3:
            raise SignfaceError(f"vertices must have the shape (V, 3), not {vertices.shape}")
        if triangles.ndim != 2 or triangles.shape[1] != 3 or len(triangles) == 0:
            raise SignfaceError(f"triangles must have the shape (T, 3), not {triangles.shape}")
        if not np.isfinite(vertices).all():
            raise SignfaceError("the mesh has vertices that are not finite")
        if triangles.min() < 0 or triangles.max() >= len(vertices):
            raise SignfaceError("the mesh has triangles that name vertices it does not have")
        self._hold(vertices=vertices, triangles=triangles)

    @property
    def triangle_normals(self) -> np.ndarray:
        """(T, 3) normals, their length twice the triangle's area."""
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        return np.cross(b - a, c - a)

    @property
    def triangle_areas(self) -> np.ndarray:
        """(T,) areas in square millimetres."""
        return 0.5 * np.linalg.norm(self.triangle_normals, axis=1)

    @property
    def vertex_normals(self) -> np.ndarray:
        """(V, 3) unit normals, the mean of the triangles' around each vertex, weighted by area."""
        total = np.zeros_like(self.vertices)
        for corner in range(3):
            np.add.at(total, self.triangles[:, corner], self.triangle_normals)
        return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
