"""CANDIDE faces: the `.wfm` wireframe files of J. Ahlberg, "CANDIDE-3: an updated parameterised face" (2001).

Sections begin with a comment line that names them (`# VERTEX LIST:`, `# FACE LIST:`, `# ANIMATION UNITS LIST:`,
`# SHAPE UNITS LIST:`); a count follows, then the entries. Animation units become bases, shape units identities.
"""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path

import numpy as np

from signface.errors import SignfaceError
from signface.face.files.gltf import RawFace

#: CANDIDE has no unit: its vertices lie between about -1 and 1. This is the width of a head (mm) it is scaled to.
HEAD_WIDTH_MM = 150.0


def read_wfm(path: str | PathLike[str]) -> RawFace:
    """Read a CANDIDE face. It has no unit, so it is scaled to a head 150 mm wide.

    Raises
    ------
    SignfaceError
        The file is no `.wfm`, is damaged, or has no animation units.
    """
    file = Path(path)
    try:
        sections = _sections(file.read_text(encoding="latin-1"))
        vertices = _table(sections["VERTEX LIST"], 3)
        triangles = _table(sections["FACE LIST"], 3).astype(np.int64)
        bases, names = _units(sections["ANIMATION UNITS LIST"], len(vertices))
        identities, identity_names = _units(sections.get("SHAPE UNITS LIST", []), len(vertices))
    except (OSError, ValueError, KeyError, IndexError) as error:
        raise SignfaceError(
            "cannot be read as a CANDIDE face (foreign, damaged or cut short)",
            file=file,
            hint="give the .wfm file as it was distributed",
        ) from error
    if not len(names):
        raise SignfaceError("has no animation units", file=file, hint="use candide3.wfm")
    width = float(np.ptp(vertices[:, 0]))
    if not np.isfinite(vertices).all() or width <= 0:
        raise SignfaceError("its vertices are damaged", file=file, hint="give the .wfm file as it was distributed")
    scale = HEAD_WIDTH_MM / width
    return RawFace(vertices * scale, triangles, bases * scale, names, "mm", identities * scale, identity_names)


def _sections(text: str) -> dict[str, list[str]]:
    """The lines of each section, by its title; within a section, comments stay (they name the units)."""
    sections: dict[str, list[str]] = {}
    lines: list[str] = []
    for raw in text.splitlines():
        line = raw.strip()
        title = re.match(r"#\s*([A-Z ]+ LIST):?", line)
        if title:
            lines = sections.setdefault(title.group(1).strip(), [])
        elif line:
            lines.append(line)
    return sections


def _table(lines: list[str], width: int) -> np.ndarray:
    rows = [line.split() for line in lines if not line.startswith("#")]
    count = int(rows[0][0])
    table = np.array([[float(word) for word in row[:width]] for row in rows[1 : count + 1]])
    if table.shape != (count, width):
        raise ValueError("fewer rows than the file says")
    return table


def _units(lines: list[str], vertices: int) -> tuple[np.ndarray, tuple[str, ...]]:
    """(N, V, 3) displacements and names of a list of units: a comment names each, its length follows, then its rows."""
    numbers = [line for line in lines if not line.startswith("#")]
    if not numbers:
        return np.zeros((0, vertices, 3)), ()
    total = int(numbers[0].split()[0])
    units: list[np.ndarray] = []
    names: list[str] = []
    name = ""
    position = lines.index(numbers[0]) + 1
    while len(units) < total:
        line = lines[position]
        position += 1
        if line.startswith("#"):
            name = line.lstrip("# ").strip() or name
            continue
        moved = np.zeros((vertices, 3))
        left = int(line.split()[0])
        while left:
            row = lines[position]
            position += 1
            if row.startswith("#"):
                continue
            vertex, *offset = row.split()[:4]
            if not 0 <= int(vertex) < vertices or len(offset) != 3:
                raise ValueError("a unit names a vertex that does not exist")
            moved[int(vertex)] = [float(word) for word in offset]
            left -= 1
        title = name or f"unit{len(units)}"
        names.append(title if title not in names else f"{title} ({len(units)})")
        units.append(moved)
    return np.stack(units) if units else np.zeros((0, vertices, 3)), tuple(names)
