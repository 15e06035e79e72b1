"""Reading a face: `read_face` finds out what a name or a path is and brings it to millimetres."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from signface.errors import SignfaceError
from signface.face.gltf import RawFace, read_gltf
from signface.face.mesh import Mesh
from signface.face.model import FaceModel
from signface.files import shipped

#: Millimetres in each unit a face may come in.
MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1000.0}
#: A head, from a bare mask to head with shoulders, has a box whose diagonal lies in this range (mm).
_SMALLEST, _LARGEST = 90.0, 900.0


def find_unit(vertices: np.ndarray) -> str | None:
    """The unit that makes a mesh as large as a human face: `mm`, `cm` or `m`; None when none does.

    The diagonal of the bounding box, from a mask cut at the hairline to a bust, is 90 to 900 mm; the three ranges do
    not overlap between millimetres (90 to 900), centimetres (9 to 90) and metres (0.09 to 0.9).
    """
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    return next((unit for unit, size in MILLIMETRES.items() if _SMALLEST <= diagonal * size < _LARGEST), None)


def read_face(name_or_path: str | PathLike[str] = "default", *, neutral: str | None = None) -> FaceModel:
    """Read a face by the name of a shipped one, or from a file or folder, in millimetres.

    Parameters
    ----------
    name_or_path : str or path
        A shipped name (`default`), a `.glb` or `.gltf` with morph targets, a folder of OBJ files of one topology (one
        for each base), or a CANDIDE `.wfm`.
    neutral : str, optional
        For a folder of OBJ files: the name of the neutral's file.

    Returns
    -------
    FaceModel
        `unit` says what the file was in.

    Raises
    ------
    SignfaceError
        No such face, or the file is foreign, damaged, or no face.

    Examples
    --------
    >>> face = read_face("default")
    >>> face.n_bases
    51
    """
    faces = shipped("faces", ".glb")
    path = faces.get(str(name_or_path), Path(name_or_path))
    if not path.exists():
        raise SignfaceError(
            "no such face", file=path, hint=f"give a file, a folder, or a shipped face: {', '.join(faces)}"
        )
    suffix = path.suffix.lower()
    if suffix in (".glb", ".gltf") and path.is_file():
        raw = read_gltf(path)
    else:
        raise SignfaceError("is not a face that signface reads", file=path, hint="give .glb, .gltf, a folder of .obj")
    return face_in_millimetres(raw, path)


def face_in_millimetres(raw: RawFace, path: Path) -> FaceModel:
    """A `FaceModel` from what a file held, its unit named by the file or found from the size of the head.

    Raises
    ------
    SignfaceError
        No unit makes the mesh as large as a face, or its shapes disagree.
    """
    if not np.isfinite(raw.vertices).all() or not len(raw.vertices):
        raise SignfaceError("has no vertices, or some that are not finite", file=path, hint="export it again")
    unit = raw.unit or find_unit(raw.vertices)
    if unit is None:
        diagonal = np.linalg.norm(np.ptp(raw.vertices, axis=0))
        raise SignfaceError(
            f"its size ({diagonal:.3g} across) is not that of a face in m, cm or mm",
            file=path,
            hint="scale it to the size of a head",
        )
    scale = MILLIMETRES[unit]
    try:
        return FaceModel(
            mesh=Mesh(raw.vertices * scale, raw.triangles),
            bases=raw.bases * scale,
            names=raw.names,
            unit=unit,
            identities=None if raw.identities is None else raw.identities * scale,
            identity_names=raw.identity_names,
            name=path.stem or path.name,
            history=(f"read_face {path.name} ({unit})",),
        )
    except SignfaceError as error:
        raise SignfaceError(error.problem, file=path, hint=error.hint) from error
