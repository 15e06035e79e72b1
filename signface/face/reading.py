"""Reading a face.

- `read_face`: finds out what a name or a path is, and brings it to millimetres.
- `find_unit`: the unit of a mesh, from the size of a head.
- `read_identities`: shapes of other heads on the default face.
- `read_parts`, `read_hair`, `read_tint`: its eyes and mouth, brows and lashes, tint of skin, for pictures.
"""

from __future__ import annotations

import zipfile
from functools import lru_cache
from os import PathLike
from pathlib import Path

import numpy as np

from signface.errors import SignfaceError
from signface.face.files.gltf import RawFace, read_gltf
from signface.face.files.obj import read_obj_folder
from signface.face.files.wfm import read_wfm
from signface.face.mesh import Mesh
from signface.face.model import FaceModel
from signface.files import models_folder, shipped

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
    >>> import signface as sf
    >>> face = sf.read_face("default")
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
    if path.is_dir():
        raw = read_obj_folder(path, neutral)
    elif suffix == ".wfm":
        raw = read_wfm(path)
    elif suffix in (".glb", ".gltf"):
        raw = read_gltf(path)
    elif suffix == ".obj":
        raise SignfaceError("is one shape, not a face", file=path, hint="give the folder with one .obj for each base")
    else:
        raise SignfaceError(
            "is not a face that signface reads", file=path, hint="give .glb, .gltf, .wfm or a folder of .obj files"
        )
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
            colours=raw.colours,
            name=path.stem or path.name,
            history=(f"read_face {path.name} ({unit})",),
        )
    except SignfaceError as error:
        raise error.at(path) from error


def read_identities() -> tuple[np.ndarray, tuple[str, ...]]:
    """Shapes of other heads on the skin of the default face.

    Returns
    -------
    shapes : (K, V, 3) float64 array
        Displacements from the default face, millimetres.
    names : (K,) tuple of str
        MakeHuman's names. `l-` and `r-` open the names of the two sides of one change.

    Raises
    ------
    SignfaceError
        The file does not ship with this installation, or is damaged.
    """
    file = models_folder() / "heads" / "identities.npz"
    try:
        with np.load(file, allow_pickle=False) as content:
            return content["hundredths_mm"].astype(np.float64) / 100.0, tuple(map(str, content["names"]))
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        problem = "the shipped head shapes cannot be read"
        raise SignfaceError(problem, file=file, hint="install signface again") from error


@lru_cache(maxsize=1)
def read_parts() -> FaceModel:
    """Eyes, teeth, tongue and mouth cavity of the default face, with its 51 bases, for pictures only.

    Raises
    ------
    SignfaceError
        The file does not ship with this installation, or is damaged.
    """
    return _with_the_face("parts.glb")


@lru_cache(maxsize=1)
def read_hair() -> FaceModel:
    """Brows and lashes of the default face, bound to its skin, with its 51 bases, for pictures only.

    Raises
    ------
    SignfaceError
        The file does not ship with this installation, or is damaged.
    """
    return _with_the_face("hair.glb")


def _with_the_face(name: str) -> FaceModel:
    file = models_folder() / "heads" / name
    if not file.is_file():
        raise SignfaceError("no such file", file=file, hint="install signface again")
    return face_in_millimetres(read_gltf(file), file)


def read_tint() -> np.ndarray:
    """(V, 3) factors on the colour of the default face's skin: lips, cheeks and lids are not like the rest.

    Raises
    ------
    SignfaceError
        The file does not ship with this installation, or is damaged.
    """
    file = models_folder() / "heads" / "tint.npz"
    try:
        with np.load(file, allow_pickle=False) as content:
            return content["hundredths"].astype(np.float64) / 100.0
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise SignfaceError("the tint of the skin cannot be read", file=file, hint="install signface again") from error
