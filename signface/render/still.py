"""Stills of a face: shaded pictures.

- `render`: a mesh to a picture.
- `draw_face`: a face with weights, its eyes and teeth with it where they ship.
- `whole_mesh`: what there is to draw of a face.
"""

from __future__ import annotations

import numpy as np

from signface.face.camera import Camera, face_camera
from signface.face.mesh import Mesh
from signface.face.model import FaceModel
from signface.face.reading import read_parts
from signface.render.raster import Scene, Style

SKIN = (0.85, 0.68, 0.58)


def render(mesh: Mesh, camera: Camera, colours: np.ndarray, background: float = 1.0, samples: int = 2) -> np.ndarray:
    """A shaded picture of a mesh.

    Parameters
    ----------
    mesh : Mesh
    camera : Camera
    colours : (V, 3) array
        Colour of each vertex, 0 to 1.
    background : float
        Grey of what the mesh leaves free.
    samples : int
        Samples per pixel and axis, against jagged edges.

    Returns
    -------
    (height, width, 3) uint8 array

    See Also
    --------
    signface.render.raster.Scene : draws many pictures of one mesh.
    """
    style = Style(background=(background,) * 3, samples=samples)
    return Scene(mesh.triangles, colours, camera, style).draw(mesh.vertices)


def draw_face(
    face: FaceModel,
    weights: np.ndarray | None = None,
    *,
    yaw: float = 0.0,
    pitch: float = 0.0,
    size: tuple[int, int] = (500, 600),
    samples: int = 2,
) -> np.ndarray:
    """A picture of a face.

    Parameters
    ----------
    face : FaceModel
        With the default face, its eyes, teeth and mouth are drawn too.
    weights : (N,) array, optional
        By default the neutral.
    yaw, pitch : float
        Where it is seen from, as for `Camera`.
    size : (int, int)
        Width and height in pixels.
    samples : int
        Samples per pixel and axis.

    Returns
    -------
    (height, width, 3) uint8 array

    Examples
    --------
    >>> import signface as sf
    >>> sf.draw_face(sf.read_face("default"), size=(50, 60)).shape
    (60, 50, 3)
    """
    mesh, colours = whole_mesh(face, weights)
    return render(mesh, face_camera(face, yaw=yaw, pitch=pitch, size=size), colours, samples=samples)


def whole_mesh(face: FaceModel, weights: np.ndarray | None = None) -> tuple[Mesh, np.ndarray]:
    """The posed skin with its colours (V, 3), and what else ships with the default face."""
    weights = np.zeros(face.n_bases) if weights is None else np.asarray(weights, dtype=np.float64)
    colours = np.tile(SKIN, (len(face.mesh.vertices), 1)) if face.colours is None else np.asarray(face.colours)
    skin = Mesh(face.pose(weights), face.mesh.triangles)
    if face.name != "default":
        return skin, colours
    parts = read_parts()
    assert parts.colours is not None
    if parts.names != face.names:
        return skin, colours
    together = Mesh(
        np.concatenate([skin.vertices, parts.pose(weights)]),
        np.concatenate([skin.triangles, parts.mesh.triangles + len(skin.vertices)]),
    )
    return together, np.concatenate([colours, parts.colours])
