"""TRC, Motion Analysis' text format of trajectories, also written by OpenSim, Cortex and OptiTrack.

Five lines of header: `PathFileType 4 (X/Y/Z) name`; the names of the fields (`DataRate`, `NumFrames`, `Units`, ...);
their values; `Frame# Time` and the marker names, one for every three columns; `X1 Y1 Z1 ...`. Then a row a frame.
"""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path

import numpy as np

from signface.errors import SignfaceError
from signface.takes.labels import clean_labels
from signface.takes.take import Take
from signface.takes.text import even_rate, numbers, read_text
from signface.takes.units import to_millimetres


def _float(word: str) -> float:
    try:
        return float(word.replace(",", "."))
    except ValueError:
        return math.nan


def read_trc(path: str | PathLike[str], *, unit: str | None = None) -> Take:
    """Read a TRC file.

    A marker is missing where its cells are empty, not finite, or all exactly zero. The unit is the header's
    `Units`.

    Raises
    ------
    SignfaceError
        The header is not a TRC header, a row is cut short or holds words, the rate is 0, or the unit is unknown.
    """
    file = Path(path)
    lines = read_text(file).splitlines()
    if not lines[0].startswith("PathFileType"):
        raise SignfaceError("is no TRC file", file=file, hint="its first line begins with PathFileType")
    if len(lines) < 5:
        raise SignfaceError("the TRC file is cut short in its header", file=file, hint="export it again")
    fields = dict(zip(lines[1].split("\t"), lines[2].split("\t")))
    fields = {name.strip().lower(): value.strip() for name, value in fields.items()}
    heads = [cell.strip() for cell in lines[3].rstrip("\r\n").split("\t")]
    if len(heads) < 3 or heads[0].lower() not in ("frame#", "frame") or heads[1].lower() != "time":
        raise SignfaceError("the TRC file has no line of marker names", file=file, hint="export it again")
    declared = fields.get("nummarkers", "")
    markers = int(declared) if declared.isdigit() else sum(1 for name in heads[2:] if name)
    names = (heads[2::3] + [""] * markers)[:markers]
    if markers == 0:
        raise SignfaceError("the TRC file has no markers", file=file, hint="export the trajectories with it")
    if 2 + 3 * (markers - 1) > len(heads) - 1 and not any(names):
        raise SignfaceError(f"the TRC file names none of its {markers} markers", file=file, hint="export it again")
    if len(heads) < 2 + 3 * (markers - 1) + 1:
        raise SignfaceError(f"the TRC file declares {markers} markers and names {sum(map(bool, names))}", file=file)
    values = numbers(lines[5:], 2 + 3 * markers, "\t", file, 6)
    rate = _float(fields.get("datarate", ""))
    if math.isnan(rate):
        rate = even_rate(values[:, 1], file)
    if not (math.isfinite(rate) and rate > 0):
        raise SignfaceError("the TRC file has the rate 0", file=file, hint="set DataRate to its frames per second")
    kept, labels, notes = clean_labels(names)
    if not kept:
        raise SignfaceError("none of the markers in the TRC file has a label", file=file, hint="label the markers")
    positions = values[:, 2:].reshape(len(values), markers, 3)[:, kept]
    positions[(positions == 0).all(axis=2)] = np.nan
    try:
        positions, note = to_millimetres(positions, fields.get("units"), unit)
    except SignfaceError as error:
        raise SignfaceError(error.problem, file=file, hint=error.hint) from error
    start = float(values[0, 1])
    return Take(
        positions,
        tuple(labels),
        rate,
        start=start if math.isfinite(start) else 0.0,
        name=file.stem,
        history=(f"read {file.name} (TRC)", note, *notes),
    )
