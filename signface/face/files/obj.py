"""A face from a folder of OBJ files: one for the neutral, one for each base, all of one topology."""

from __future__ import annotations

from itertools import pairwise
from os import PathLike
from pathlib import Path

import numpy as np

from signface.errors import SignfaceError
from signface.face.files.gltf import RawFace

#: Names that the neutral's file often has.
NEUTRAL_NAMES = ("neutral", "base", "rest", "basis", "default")


def read_obj(path: str | PathLike[str]) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) and triangles (T, 3) of an OBJ file; polygons are cut into fans.

    Raises
    ------
    SignfaceError
        The file has no vertices or no faces, a line is damaged, or a face names a vertex that does not exist.
    """
    file = Path(path)
    try:
        lines = file.read_text(encoding="utf-8", errors="strict").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise SignfaceError("cannot be read as an OBJ file", file=file) from error
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    for number, line in enumerate(lines, start=1):
        kind, *words = line.split() or [""]
        try:
            if kind == "v":
                vertices.append([float(word) for word in words[:3]])
                if len(words) < 3:
                    raise ValueError
            elif kind == "f":
                corners = [int(word.split("/")[0]) for word in words]
                if len(corners) < 3 or 0 in corners:
                    raise ValueError
                corners = [corner - 1 if corner > 0 else len(vertices) + corner for corner in corners]
                triangles += [(corners[0], b, c) for b, c in pairwise(corners[1:])]
        except ValueError as error:
            problem = f"line {number} is damaged: {line[:40]!r}"
            raise SignfaceError(problem, file=file, hint="export it again") from error
    if not vertices or not triangles:
        raise SignfaceError("has no mesh", file=file, hint="an OBJ file of a face has vertices (v) and faces (f)")
    points, corners_ = np.array(vertices), np.array(triangles, dtype=np.int64)
    if corners_.min() < 0 or corners_.max() >= len(points):
        raise SignfaceError("its faces name vertices it does not have", file=file, hint="export it again")
    return points, corners_


def read_obj_folder(folder: str | PathLike[str], neutral: str | None = None) -> RawFace:
    """Read a folder of OBJ files; each file but the neutral is a base named after its file.

    Parameters
    ----------
    folder : path
    neutral : str, optional
        File name of the neutral, with or without `.obj`. Without it, a file named neutral, base, rest, basis or
        default is taken.

    Raises
    ------
    SignfaceError
        No OBJ files, no neutral, or a file of another topology.
    """
    directory = Path(folder)
    files = {file.stem: file for file in sorted(directory.iterdir()) if file.suffix.lower() == ".obj"}
    if len(files) < 2:
        raise SignfaceError(
            f"has {len(files)} OBJ files", file=directory, hint="a face needs a neutral and one file for each base"
        )
    if neutral is not None:
        stem = neutral[:-4] if neutral.lower().endswith(".obj") else neutral
    else:
        stem = next((name for name in files if name.lower() in NEUTRAL_NAMES), "")
    if stem not in files:
        problem = f"has no neutral named {neutral}" if neutral else "does not say which file is the neutral"
        raise SignfaceError(
            problem, file=directory, hint=f"name one with --neutral-shape: {', '.join(list(files)[:8])}"
        )
    vertices, triangles = read_obj(files[stem])
    bases, names = [], []
    for name, file in files.items():
        if name == stem:
            continue
        shape, _ = read_obj(file)
        if len(shape) != len(vertices):
            raise SignfaceError(
                f"has {len(shape)} vertices but the neutral {files[stem].name} has {len(vertices)}",
                file=file,
                hint="all shapes of a face must share one topology",
            )
        bases.append(shape - vertices)
        names.append(name)
    return RawFace(vertices, triangles, np.stack(bases), tuple(names))
