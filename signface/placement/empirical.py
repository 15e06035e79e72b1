"""Layouts that laboratories have used, placed on any face by anatomical landmarks.

- `EMPIRICAL`: their names.
- `find_landmarks`: where the landmarks of a face are.
- `place_layout`: a layout on a face.

The landmarks and the layouts are data (`models/layouts/empirical`), with their sources beside them.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pandas as pd

from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.layout_files import nearest_points, read_layout
from signface.face.model import FaceModel
from signface.face.reading import read_face
from signface.files import models_folder

#: The layouts of Reverdy (2019), 3.5, and where each comes from.
EMPIRICAL = {
    "mpeg4-53": "feature points of MPEG-4 (ISO/IEC 14496-2) that lie on skin, without the lids' edges",
    "face-robot-35": "32 controls driven by motion capture and 3 markers for the head, after Face Robot's manual",
    "signcom-41": "41 markers spread as the SignCom corpus is described; its figure is lost",
    "sign3d-60": "60 markers, none on the lids, as the Sign3D corpus is described; its figure is lost",
    "man-62": "a mixture of the above, as in 3.5.2; its figure is lost",
    "man-46": "the same without what seems least useful",
    "man-30": "the same, half of it",
    "man-15": "the same, a quarter of it",
}


@lru_cache(maxsize=1)
def _tables() -> tuple[pd.DataFrame, pd.DataFrame]:
    folder = models_folder() / "layouts" / "empirical"
    try:
        landmarks = pd.read_csv(folder / "landmarks.csv")
        markers = pd.read_csv(folder / "markers.csv", dtype=str)
    except OSError as error:
        raise SignfaceError("cannot be read", file=folder, hint="install signface again") from error
    return landmarks, markers


@lru_cache(maxsize=1)
def landmark_layout() -> tuple[FaceModel, MarkerLayout]:
    """The default face and its landmarks, those beside the midline on both sides (`L_` and `R_`)."""
    table, _ = _tables()
    face = read_face("default")
    labels, points = [], []
    for row in table.itertuples(index=False):
        place = np.array([row.x, row.y, row.z], dtype=float)
        for side, sign in (("", 1.0),) if row.x == 0.0 else (("L_", 1.0), ("R_", -1.0)):
            labels.append(side + str(row.landmark))
            points.append(place * (sign, 1.0, 1.0))
    corners, barycentric, _ = nearest_points(face.mesh, np.array(points))
    return face, MarkerLayout(tuple(labels), ("face",) * len(labels), corners, barycentric, "landmarks")


def find_landmarks(face: FaceModel) -> dict[str, np.ndarray]:
    """The (3,) place of every landmark on a face, millimetres.

    A face with the default's topology (any head of it) has them at the same vertices. On another, the default's
    landmarks are laid on the skin by registration, as `layout suggest` lays markers: look at the result.

    Raises
    ------
    SignfaceError
        The registration fails.
    """
    default, layout = landmark_layout()
    same = len(face.mesh.vertices) == len(default.mesh.vertices) and np.array_equal(
        face.mesh.triangles, default.mesh.triangles
    )
    if same:
        places = layout.points(face)
    else:
        from signface.face.suggestion import suggest_layout

        carried = suggest_layout(layout.labels, layout.points(default), face).layout
        places = carried.points(face, layout.labels)
    return dict(zip(layout.labels, places))


def place_layout(name: str, face: FaceModel, *, landmarks: dict[str, np.ndarray] | None = None) -> MarkerLayout:
    """An empirical layout on a face.

    A marker stands on the skin's nearest point to a landmark, or to the mean of several.

    Parameters
    ----------
    name : str
        A key of `EMPIRICAL`.
    face : FaceModel
    landmarks : dict, optional
        Landmark to (3,) place; by default `find_landmarks(face)`.

    Returns
    -------
    MarkerLayout
        Where a layout has no head markers of its own, with those of `default-40` as labels without a place.

    Raises
    ------
    SignfaceError
        There is no such layout, or it names a landmark that is not given.

    Examples
    --------
    >>> from signface.face.reading import read_face
    >>> len(place_layout("man-15", read_face("default")).face_labels)
    15
    """
    if name not in EMPIRICAL:
        raise SignfaceError(f"no empirical layout is called {name}", hint=f"they are {', '.join(EMPIRICAL)}")
    known = find_landmarks(face) if landmarks is None else landmarks
    _, markers = _tables()
    placed_markers = markers[[name in layouts.split() for layouts in markers["layouts"]]]
    points = []
    for row in placed_markers.itertuples(index=False):
        terms = [term.strip() for term in str(row.place).split("+")]
        missing = [term for term in terms if term not in known]
        if missing:
            raise SignfaceError(f"the marker {row.marker} of {name} needs the landmark {missing[0]}")
        points.append(np.mean([known[term] for term in terms], axis=0))
    corners, barycentric, _ = nearest_points(face.mesh, np.array(points))
    placed = MarkerLayout(tuple(placed_markers["marker"]), tuple(placed_markers["role"]), corners, barycentric, name)
    return placed if placed.head_labels else with_head_markers(placed, face)


def with_head_markers(layout: MarkerLayout, face: FaceModel) -> MarkerLayout:
    """The layout with the head markers of `default-40`, placed where the face is the default one."""
    head = read_layout("default-40", read_face("default"))
    head = head.restricted(head.head_labels)
    default, _ = landmark_layout()
    placed = np.array_equal(face.mesh.triangles, default.mesh.triangles)
    corners = head.corners if placed else np.full_like(head.corners, -1)
    barycentric = head.barycentric if placed else np.zeros_like(head.barycentric)
    return MarkerLayout(
        (*layout.labels, *head.labels),
        (*layout.roles, *head.roles),
        np.concatenate([layout.corners, corners]),
        np.concatenate([layout.barycentric, barycentric]),
        layout.name,
    )
