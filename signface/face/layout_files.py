"""Marker layouts on disk: a csv with the columns `marker, role` and `vertex` or `x, y, z`.

- `read_layout`, `write_layout`: one file.
- `choose_layout`: the shipped layout that fits the labels of a take best.
- `nearest_points`: the points of a skin nearest to given ones.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from signface.errors import SignfaceError
from signface.face.layout import ROLES, MarkerLayout
from signface.face.mesh import Mesh
from signface.face.model import FaceModel
from signface.face.reading import MILLIMETRES
from signface.files import shipped, whole_file
from signface.marker_names import by_subject

#: A point of a layout may lie this far from the skin, in millimetres; farther, the layout is for another face.
FARTHEST_MM = 10.0

#: A shipped layout fits a take when it recognises at least this many of its face markers.
FEWEST = 8


def read_layout(name_or_path: str | PathLike[str], face: FaceModel) -> MarkerLayout:
    """Read a shipped layout by name, or a csv.

    Parameters
    ----------
    name_or_path : str or path
        `default-40`, `mediapipe`, or a file.
    face : FaceModel
        The face it stands on. Points given as `x, y, z` (in the unit of the face's file) are put on the nearest
        place of its neutral skin.

    Raises
    ------
    SignfaceError
        The file is missing or no layout, a role is unknown, a marker is repeated or has no place, a vertex is not in
        the face, or a point is far from its skin.

    See Also
    --------
    signface.choose_layout : the one that fits a recording.

    Examples
    --------
    >>> import signface as sf
    >>> layout = sf.read_layout("default-40", sf.read_face())
    >>> len(layout.face_labels), layout.head_labels
    (40, ('HEADF', 'HEADL', 'HEADR', 'HEADTL', 'HEADTR', 'HEADB'))
    """
    known = shipped("layouts", ".csv")
    file = known.get(str(name_or_path), Path(name_or_path))
    if not file.is_file():
        raise SignfaceError("no such layout", file=file, hint=f"the shipped layouts are {', '.join(known)}")
    table = _columns(file)
    has_points = {"x", "y", "z"} <= set(table)
    if not {"marker", "role"} <= set(table) or not (has_points or "vertex" in table):
        raise SignfaceError("is no layout", file=file, hint="its columns are marker, role, and vertex or x, y, z")
    try:
        return _placed(table, face, file, has_points)
    except SignfaceError as error:
        raise error.at(file) from error


def _columns(file: Path) -> dict[str, np.ndarray]:
    """The cells of a csv by column, without spaces around them; what follows a `#` is a comment."""
    try:
        text = file.read_text(encoding="utf-8-sig")
        lines = [line.partition("#")[0] for line in text.splitlines()]
        heads, *rows = [[cell.strip() for cell in row] for row in csv.reader(line for line in lines if line.strip())]
    except (OSError, ValueError, csv.Error) as error:
        raise SignfaceError("cannot be read as a csv", file=file) from error
    if len(set(heads)) < len(heads) or any(len(row) > len(heads) for row in rows):
        raise SignfaceError("cannot be read as a csv", file=file, hint="every row has as many cells as the first")
    return {
        head: np.array([row[number] if number < len(row) else "" for row in rows], dtype=str)
        for number, head in enumerate(heads)
    }


def _numbers(cells: np.ndarray) -> np.ndarray:
    """Cells as numbers; NaN where a cell is none."""

    def number(cell: str) -> float:
        try:
            return float(cell)
        except ValueError:
            return math.nan

    return np.array([number(cell) for cell in cells], dtype=float)


def _placed(table: dict[str, np.ndarray], face: FaceModel, file: Path, has_points: bool) -> MarkerLayout:
    """The layout of a table, every marker on its place."""
    labels, roles = table["marker"], table["role"]
    if (labels == "").any():
        raise SignfaceError(f"row {int(np.argmax(labels == '')) + 1} names no marker")
    unknown = sorted(set(roles) - set(ROLES))
    if unknown:
        raise SignfaceError(f"unknown role {unknown[0]!r}", hint="a role is face or head")
    corners = np.full((len(labels), 3), -1)
    barycentric = np.zeros((len(labels), 3))
    if "vertex" in table:
        vertices = _numbers(table["vertex"])
        given = np.isfinite(vertices)
        wrong = given & ((vertices < 0) | (vertices >= len(face.mesh.vertices)) | (vertices != np.round(vertices)))
        if wrong.any():
            row = int(np.argmax(wrong))
            raise SignfaceError(
                f"the marker {labels[row]} stands on vertex {vertices[row]:g}, which {face.name} does not have",
                hint=f"its vertices are 0 to {len(face.mesh.vertices) - 1}",
            )
        corners[given] = vertices[given, None].astype(int)
        barycentric[given] = (1.0, 0.0, 0.0)
    if has_points:
        points = np.column_stack([_numbers(table[axis]) for axis in "xyz"])
        given = np.isfinite(points).all(axis=1) & (corners[:, 0] < 0)
        points = points[given] * MILLIMETRES.get(face.unit, 1.0)
        if given.any():
            corners[given], barycentric[given], distance = nearest_points(face.mesh, points)
            if distance.max() > FARTHEST_MM:
                row = int(np.flatnonzero(given)[np.argmax(distance)])
                raise SignfaceError(
                    f"the marker {labels[row]} lies {distance.max():.0f} mm from the skin of {face.name}",
                    hint="use a layout made for this face, in the unit of its file",
                )
    return MarkerLayout(tuple(labels), tuple(roles), corners, barycentric, name=file.stem)


def write_layout(layout: MarkerLayout, path: str | PathLike[str], face: FaceModel) -> None:
    """Write a layout: markers on a vertex by `vertex`, others by `x, y, z` in the unit of the face's file."""
    on_vertex = (layout.corners >= 0).all(axis=1) & (layout.barycentric.max(axis=1) == 1.0)
    rows = []
    scale = 1.0 / MILLIMETRES.get(face.unit, 1.0)
    for row, (label, role) in enumerate(zip(layout.labels, layout.roles, strict=True)):
        cells: tuple[object, ...] = (None, None, None, None)
        if on_vertex[row]:
            cells = (int(layout.corners[row, np.argmax(layout.barycentric[row])]), None, None, None)
        elif layout.corners[row, 0] >= 0:
            point = layout.points(face, [label])[0] * scale
            cells = (None, *(round(float(value), 5) for value in point))
        rows.append((label, role, *cells))
    import pandas as pd

    table = pd.DataFrame(rows, columns=["marker", "role", "vertex", "x", "y", "z"]).astype({"vertex": "Int64"})
    with whole_file(path) as temporary:
        table.dropna(axis="columns", how="all").to_csv(temporary, index=False)


def choose_layout(take_labels: Sequence[str], face: FaceModel) -> MarkerLayout:
    """The shipped layout that recognises most of the labels of a take.

    Raises
    ------
    SignfaceError
        No shipped layout recognises enough of them.

    See Also
    --------
    signface.read_layout : a layout by its name, or a file.

    Examples
    --------
    >>> import signface as sf
    >>> sf.choose_layout(sf.datasets.mini_take().labels, sf.read_face()).name
    'default-40'
    """
    best, fit = None, 0
    for name, file in shipped("layouts", ".csv").items():
        table = _columns(file)
        faces = [label for label in table["marker"][table["role"] == "face"]]
        matched = max(map(len, by_subject(take_labels, faces).values()), default=0)
        if matched > fit:
            best, fit = name, matched
    if best is None or fit < FEWEST:
        some = ", ".join(list(take_labels)[:6])
        raise SignfaceError(
            f"no shipped layout knows the markers of this take ({some}, ...)",
            hint="make one with: signface layout suggest TAKE -o layout.csv, and give it as --layout",
        )
    return read_layout(best, face)


def nearest_points(mesh: Mesh, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The points of a mesh nearest to (K, 3) points.

    Returns
    -------
    corners : (K, 3) int array
        Vertices of the triangles they lie on.
    barycentric : (K, 3) array
    distance : (K,) array
        Distances from the points to the mesh.
    """
    points = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    centroids = mesh.vertices[mesh.triangles].mean(axis=1)
    reach = np.linalg.norm(mesh.vertices[mesh.triangles] - centroids[:, None], axis=2).max()
    tree = cKDTree(centroids)
    # The nearest centroid is a point of the mesh, so no triangle farther off than that can hold a nearer one.
    bound = tree.query(points)[0]
    candidates = tree.query_ball_point(points, bound + reach + 1e-9)
    owner = np.repeat(np.arange(len(points)), [len(near) for near in candidates])
    triangle = np.concatenate([np.zeros(0, np.int64), *(np.sort(near).astype(np.int64) for near in candidates)])
    a, b, c = (mesh.vertices[mesh.triangles[triangle, k]] for k in range(3))
    weights = _closest_barycentric(points[owner], a, b, c)
    nearest = weights[:, :1] * a + weights[:, 1:2] * b + weights[:, 2:] * c
    apart = np.linalg.norm(nearest - points[owner], axis=1)
    order = np.lexsort((triangle, apart, owner))
    best = order[np.searchsorted(owner[order], np.arange(len(points)))]
    return mesh.triangles[triangle[best]], weights[best], apart[best]


def _closest_barycentric(point: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """(T, 3) barycentric weights of the point of each triangle nearest to `point`.

    Inside the triangle's prism it is the projection; elsewhere the nearest of its three edges.
    """
    ab, ac, ap = b - a, c - a, point - a
    aa, bb, ab_ac = (ab * ab).sum(1), (ac * ac).sum(1), (ab * ac).sum(1)
    d1, d2 = (ap * ab).sum(1), (ap * ac).sum(1)
    area = np.maximum(aa * bb - ab_ac**2, 1e-300)
    v, w = (bb * d1 - ab_ac * d2) / area, (aa * d2 - ab_ac * d1) / area
    inside = (v >= 0) & (w >= 0) & (v + w <= 1)
    best = np.stack([1 - v - w, v, w], axis=1)
    nearest = np.where(inside, ((point - (best[:, :1] * a + best[:, 1:2] * b + best[:, 2:] * c)) ** 2).sum(1), np.inf)
    for first, second, start, stop in ((0, 1, a, b), (1, 2, b, c), (2, 0, c, a)):
        edge = stop - start
        along = np.clip(((point - start) * edge).sum(1) / np.maximum((edge * edge).sum(1), 1e-300), 0, 1)
        apart = ((point - start - along[:, None] * edge) ** 2).sum(1)
        closer = ~inside & (apart < nearest)
        nearest = np.where(closer, apart, nearest)
        weights = np.zeros_like(best)
        weights[:, first], weights[:, second] = 1 - along, along
        best[closer] = weights[closer]
    return best
