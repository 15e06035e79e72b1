"""TRC, Motion Analysis' text format of trajectories, also written by OpenSim, Cortex and OptiTrack.

Five lines of header: `PathFileType 4 (X/Y/Z) name`; the names of the fields (`DataRate`, `NumFrames`, `Units`, ...);
their values; `Frame# Time` and the marker names, one for every three columns; `X1 Y1 Z1 ...`. Then a row a frame. Cells
are separated by tabs; commas and blanks, which other programs put there, are read too.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from signface.errors import SignfaceError
from signface.takes.formats.doubts import doubt
from signface.takes.formats.registry import register_format
from signface.takes.formats.text import TextFile, TextRows, marker_rows, number_or_nan
from signface.takes.formats.timing import Clock, declared_clock
from signface.takes.labels import kept_labels
from signface.takes.recording import TakeFile
from signface.takes.take import Take


def _separator(names: str) -> str | None:
    """What separates the cells of the line of names: tabs, in files of other programs commas, or blanks (None)."""
    return next((sign for sign in ("\t", ",", ";") if sign in names), None)


@register_format(
    "trc",
    title="TRC",
    written_by="Cortex, OpenSim, OptiTrack Motive",
    endings=(".trc",),
    recognise=lambda head: head.text.startswith("PathFileType"),
)
def open_trc(path: str | PathLike[str], *, unit: str | None = None, rate: float | None = None) -> TakeFile | Take:
    """Open a TRC file; its frames are read when they are asked for.

    A marker is missing where its cells are empty, not finite, or all exactly zero. The unit is the header's
    `Units`.

    Raises
    ------
    SignfaceError
        The header is not a TRC header, the first row is cut short or holds words, the rate is 0, or the unit is
        unknown. Later rows are looked at when they are read.
    """
    file = Path(path)
    text = TextFile(file)
    # The third line may be blank cells, and the sixth is blank in many files: lines are told by their numbers.
    lines = {number: line for number, line in text.lines(0, 5) if number <= 5}
    if not lines.get(1, "").startswith("PathFileType"):
        raise SignfaceError("is no TRC file", file=file, hint="its first line begins with PathFileType")
    if 4 not in lines or text.line_numbers[-1] < 5:
        raise SignfaceError("the TRC file is cut short in its header", file=file, hint="export it again")
    separator = _separator(lines[4])
    fields = dict(zip(lines.get(2, "").split(separator), lines.get(3, "").split(separator)))
    fields = {name.strip().lower(): value.strip() for name, value in fields.items()}
    heads = [cell.strip() for cell in lines[4].rstrip("\r\n").split(separator)]
    if len(heads) < 3 or heads[0].lower() not in ("frame#", "frame") or heads[1].lower() != "time":
        raise SignfaceError("the TRC file has no line of marker names", file=file, hint="export it again")
    declared = fields.get("nummarkers", "")
    named = sum(1 for name in heads[2:] if name)
    if separator is None or (all(heads[2:]) and declared == str(named) and named > 1):
        heads = [*heads[:2], *(cell for name in heads[2:] for cell in (name, "", ""))]  # a name each, not one in three
    markers = int(declared) if declared.isdigit() else named
    if markers < named:  # the rows have as many cells as markers are named, or they are refused for it
        note = doubt(file, f"names {named} markers and NumMarkers says {declared}: the names were believed")
        markers = named
    else:
        note = ""
    names = (heads[2::3] + [""] * markers)[:markers]
    if markers == 0:
        raise SignfaceError("the TRC file has no markers", file=file, hint="export the trajectories with it")
    if 2 + 3 * (markers - 1) > len(heads) - 1 and not any(names):
        raise SignfaceError(f"the TRC file names none of its {markers} markers", file=file, hint="export it again")
    if len(heads) < 2 + 3 * (markers - 1) + 1:
        raise SignfaceError(f"the TRC file declares {markers} markers and names {sum(map(bool, names))}", file=file)
    rows = TextRows(text, int(np.searchsorted(text.line_numbers, 6)), 2 + 3 * markers, separator)
    declared_rate = number_or_nan(fields.get("datarate", ""))
    clock = Clock(rate, 0.0) if rate else declared_clock(declared_rate, rows.column(1), file, name="DataRate")
    stated = fields.get("numframes", "")
    doubts = []
    if stated.isdigit() and int(stated) != len(rows):
        doubts = [doubt(file, f"has {len(rows)} frames and NumFrames says {stated}: it was cut, or is cut short")]
    kept, labels, notes = kept_labels(names, file, what="markers in the TRC file")
    return marker_rows(
        rows,
        np.array(kept)[:, None] * 3 + np.arange(2, 5),
        labels,
        clock,
        units=fields.get("units"),
        unit=unit,
        history=(f"read {file.name} (TRC)", *doubts, *([note] if note else []), *notes),
    )
