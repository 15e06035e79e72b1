"""Stills of a face: shaded pictures.

- `render`: a mesh to a picture.
- `draw_face`: a face with weights, its eyes and teeth with it where they ship.
- `whole_face`, `whole_mesh`: what there is to draw of a face.
- `SKINS`: tones of skin.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from signface.errors import SignfaceError
from signface.face.camera import Camera, face_camera
from signface.face.mesh import Mesh
from signface.face.model import FaceModel
from signface.face.reading import read_hair, read_parts, read_tint
from signface.render.raster import Scene, Style

#: Tones of skin by name, red, green and blue from 0 to 1.
SKINS = {
    "fair": (0.93, 0.76, 0.66),
    "light": (0.85, 0.68, 0.58),
    "tan": (0.75, 0.56, 0.44),
    "brown": (0.58, 0.40, 0.30),
    "dark": (0.42, 0.28, 0.21),
}
SKIN = "light"


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
    skin: str = SKIN,
) -> np.ndarray:
    """A picture of a face.

    Parameters
    ----------
    face : FaceModel
        With the default face, its eyes, mouth, brows and lashes are drawn too.
    weights : (N,) array, optional
        By default the neutral.
    yaw, pitch : float
        Where it is seen from, as for `Camera`.
    size : (int, int)
        Width and height in pixels.
    samples : int
        Samples per pixel and axis.
    skin : str
        Tone of the default face's skin: fair, light, tan, brown, dark.

    Returns
    -------
    (height, width, 3) uint8 array

    Raises
    ------
    SignfaceError
        No tone of skin has this name.

    Examples
    --------
    >>> import signface as sf
    >>> sf.draw_face(sf.read_face("default"), size=(50, 60)).shape
    (60, 50, 3)
    """
    whole = whole_face(face, skin=skin)
    camera = face_camera(face, yaw=yaw, pitch=pitch, size=size)
    style = Style(background=(1.0,) * 3, samples=samples)
    rest = whole.mesh.vertices
    scene = Scene(
        whole.mesh.triangles, np.asarray(whole.colours), camera, style, rest=rest, skin=len(face.mesh.vertices)
    )
    return scene.draw(rest if weights is None else whole.pose(weights))


def whole_face(face: FaceModel, *, skin: str = SKIN, hair: bool = True) -> FaceModel:
    """A face with what ships for it: the skin's vertices first, then eyes and mouth, then brows and lashes, coloured.

    Parameters
    ----------
    face : FaceModel
        The default face gets its parts; any other is only its skin, in its own colours where it has some.
    skin : str
        A name from `SKINS`.
    hair : bool
        With brows and lashes, which hide the skin under them.

    Raises
    ------
    SignfaceError
        No tone of skin has this name.

    Examples
    --------
    >>> from signface.face.reading import read_face
    >>> whole = whole_face(read_face("default"))
    >>> len(whole.mesh.vertices) > 3411, whole.n_bases
    (True, 51)
    """
    if skin not in SKINS:
        raise SignfaceError(f"no tone of skin is called {skin!r}", hint=f"choose one of {', '.join(SKINS)}")
    colours = np.tile(SKINS[skin], (len(face.mesh.vertices), 1)) if face.colours is None else np.asarray(face.colours)
    pieces = [FaceModel(face.mesh, face.bases, face.names, name=face.name, history=face.history, colours=colours)]
    if face.name == "default" and read_parts().names == face.names:
        if face.colours is None and len(read_tint()) == len(colours):
            pieces[0] = replace(pieces[0], colours=np.minimum(colours * read_tint(), 1.0))
        pieces += [read_parts(), read_hair()] if hair else [read_parts()]
    starts = np.cumsum([0, *(len(piece.mesh.vertices) for piece in pieces)])
    return FaceModel(
        mesh=Mesh(
            np.concatenate([piece.mesh.vertices for piece in pieces]),
            np.concatenate([piece.mesh.triangles + start for piece, start in zip(pieces, starts)]),
        ),
        bases=np.concatenate([piece.bases for piece in pieces], axis=1),
        names=face.names,
        name=face.name,
        history=face.history,
        colours=np.concatenate([np.asarray(piece.colours) for piece in pieces]),
    )


def whole_mesh(face: FaceModel, weights: np.ndarray | None = None, *, hair: bool = True) -> tuple[Mesh, np.ndarray]:
    """`whole_face` with (N,) weights, at rest by default: its mesh, and its colours (V, 3)."""
    whole = whole_face(face, hair=hair)
    mesh = whole.mesh if weights is None else Mesh(whole.pose(weights), whole.mesh.triangles)
    return mesh, np.asarray(whole.colours)
