"""Is a face fit for the solve? `check_face` looks for what would harm the thin shell or hide a base from markers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from signface.face.layout import MarkerLayout
from signface.face.mesh import Mesh
from signface.face.model import FaceModel

#: A base that moves nothing by this much is one that nobody sees (mm).
STILL_MM = 0.1
#: Two bases whose displacements have a cosine above this are told apart by noise alone.
ALIKE = 0.98
#: A triangle whose smallest height is below this share of its longest edge is degenerate.
FLAT = 1e-6


@dataclass(frozen=True)
class FaceReport:
    """What `check_face` found.

    Parameters
    ----------
    duplicate_vertices : int
        Vertices that lie exactly where an earlier one lies and are moved alike: seams where the skin is cut.
    unreferenced_vertices : int
        Vertices in no triangle.
    degenerate_triangles : int
        Triangles without area.
    nonmanifold_edges : int
        Edges of more than two triangles.
    components : int
        Connected pieces of skin.
    boundaries : int
        Closed rims (lips, lids, the cut at the neck).
    still_on_skin : tuple of str
        Bases that move no vertex by a tenth of a millimetre: markers cannot observe them.
    still_at_markers : tuple of str
        Bases that move the skin, but no marker of the layout (empty without a layout).
    alike : tuple of (str, str, float)
        Pairs of bases with nearly proportional displacements, and their cosine.
    condition : float
        Ratio of the largest to the smallest singular value of the bases, each scaled to unit length; over the markers
        when a layout was given, else over the skin. Large means that some mixture of bases is nearly no motion.
    """

    duplicate_vertices: int
    unreferenced_vertices: int
    degenerate_triangles: int
    nonmanifold_edges: int
    components: int
    boundaries: int
    still_on_skin: tuple[str, ...]
    still_at_markers: tuple[str, ...]
    alike: tuple[tuple[str, str, float], ...]
    condition: float

    @property
    def clean(self) -> bool:
        """Whether the mesh is one connected skin without duplicates, loose vertices, flat triangles, forked edges."""
        flaws = (self.duplicate_vertices, self.unreferenced_vertices, self.degenerate_triangles, self.nonmanifold_edges)
        return not any(flaws) and self.components == 1


def check_face(face: FaceModel, layout: MarkerLayout | None = None) -> FaceReport:
    """Check the mesh of a face and what its bases move.

    Parameters
    ----------
    face : FaceModel
    layout : MarkerLayout, optional
        To say as well which bases move no marker.
    """
    edges, uses = _edges(face.mesh)
    moved = np.linalg.norm(face.bases, axis=2).max(axis=1)
    seen = face.bases if layout is None else layout.bases(face)
    visible = np.linalg.norm(seen, axis=2).max(axis=1, initial=0.0)
    columns = seen.reshape(face.n_bases, -1)[visible >= STILL_MM]
    names = [name for name, size in zip(face.names, visible) if size >= STILL_MM]
    columns = columns / np.linalg.norm(columns, axis=1, keepdims=True)
    cosines = columns @ columns.T
    pairs = np.argwhere(np.triu(np.abs(cosines) > ALIKE, k=1))
    singular = np.linalg.svd(columns, compute_uv=False) if len(columns) else np.ones(1)
    fewer = min(columns.shape) < len(columns)  # more bases than coordinates: some mixture moves nothing
    return FaceReport(
        duplicate_vertices=len(face.mesh.vertices) - len(np.unique(_signature(face), axis=0)),
        unreferenced_vertices=len(face.mesh.vertices) - len(np.unique(face.mesh.triangles)),
        degenerate_triangles=int(_degenerate(face.mesh).sum()),
        nonmanifold_edges=int((uses > 2).sum()),
        components=_components(edges, np.unique(face.mesh.triangles), len(face.mesh.vertices)),
        boundaries=_components(edges[uses == 1], np.unique(edges[uses == 1]), len(face.mesh.vertices)),
        still_on_skin=tuple(name for name, size in zip(face.names, moved) if size < STILL_MM),
        still_at_markers=tuple(
            name for name, size, at in zip(face.names, moved, visible) if size >= STILL_MM and at < STILL_MM
        ),
        alike=tuple((names[i], names[j], float(cosines[i, j])) for i, j in pairs),
        condition=float("inf") if fewer or singular[-1] <= 1e-15 else float(singular[0] / singular[-1]),
    )


def clean_face(face: FaceModel) -> tuple[FaceModel, np.ndarray]:
    """Weld duplicate vertices, drop flat triangles and loose vertices.

    Returns
    -------
    face : FaceModel
    number : (V,) int array
        Where each vertex of the given face went; -1 for a dropped one.
    """
    rows = _signature(face)
    _, first, same = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    target = first[same.ravel()]
    triangles = target[face.mesh.triangles][~_degenerate(face.mesh)]
    distinct = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    triangles = triangles[distinct]
    _, once = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    triangles = triangles[np.sort(once)]
    keep = np.unique(triangles)
    number = np.full(len(face.mesh.vertices), -1)
    number[keep] = np.arange(len(keep))
    cleaned = replace(
        face,
        mesh=Mesh(face.mesh.vertices[keep], number[triangles]),
        bases=face.bases[:, keep],
        identities=None if face.identities is None else face.identities[:, keep],
        history=(*face.history, "clean_face"),
        colours=None if face.colours is None else face.colours[keep],
    )
    return cleaned, number[target]


def _signature(face: FaceModel) -> np.ndarray:
    """(V, 3 + 3 N) position and displacements of each vertex, in whole micrometres."""
    all_shapes = np.concatenate([face.mesh.vertices[None], face.bases])
    return np.round(all_shapes.transpose(1, 0, 2).reshape(len(face.mesh.vertices), -1) * 1000).astype(np.int64)


def _degenerate(mesh: Mesh) -> np.ndarray:
    """(T,) whether a triangle is flat."""
    corners = mesh.vertices[mesh.triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return 2 * mesh.triangle_areas <= FLAT * np.maximum(longest, 1e-12) ** 2


def _edges(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """(E, 2) edges and (E,) how many triangles each has."""
    pairs = np.concatenate([mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]], mesh.triangles[:, [2, 0]]])
    return np.unique(np.sort(pairs, axis=1), axis=0, return_counts=True)


def _components(edges: np.ndarray, used: np.ndarray, count: int) -> int:
    """Number of connected pieces among the used vertices."""
    if len(used) == 0:
        return 0
    graph = sparse.coo_matrix((np.ones(len(edges)), edges.T), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    return len(np.unique(label[used]))
