"""Qualisys Track Manager's TSV export of 3-D trajectories.

Lines of `NAME<tab>value` (`NO_OF_FRAMES`, `NO_OF_MARKERS`, `FREQUENCY`, `DATA_INCLUDED`, `MARKER_NAMES` ...), then a
row a frame with X, Y, Z of each marker in millimetres; optionally a line of column names, and the frame's number and
time before the coordinates (QTM user manual, "Motion data (.tsv)").
"""

from __future__ import annotations

import math
import re
from os import PathLike
from pathlib import Path

import numpy as np

from signface.errors import SignfaceError
from signface.takes.formats.doubts import doubt
from signface.takes.formats.registry import FileHead, register_format
from signface.takes.formats.text import TextFile, TextRows, marker_rows
from signface.takes.formats.timing import Clock, declared_clock
from signface.takes.labels import kept_labels
from signface.takes.recording import TakeFile
from signface.takes.take import Take

#: The names that open header lines; a line that opens with a number is the first frame.
HEADER_WORD = re.compile(r"^[A-Z][A-Z_]+$")

#: Lines within which a header ends; events are a line each.
LONGEST_HEADER = 1000


def _header(lines: list[str]) -> tuple[dict[str, list[str]], int]:
    """The header's fields, and the number of its lines."""
    fields: dict[str, list[str]] = {}
    for number, line in enumerate(lines):
        cells = [cell.strip() for cell in line.rstrip("\r\n").split("\t")]
        if not HEADER_WORD.match(cells[0]):
            return fields, number
        if cells[0] not in fields:  # EVENT may come several times
            fields[cells[0]] = cells[1:]
    return fields, len(lines)


def _certainty(head: FileHead) -> float:
    return 0.95 * any(line.startswith(("NO_OF_MARKERS\t", "MARKER_NAMES\t")) for line in head.lines[:40])


@register_format(
    "qtm", title="Qualisys TSV", written_by="Qualisys Track Manager", endings=(".tsv",), recognise=_certainty
)
def open_qtm(path: str | PathLike[str], *, unit: str | None = None, rate: float | None = None) -> TakeFile | Take:
    """Open a TSV file of Qualisys Track Manager with 3-D data and its header; frames are read when asked for.

    A marker is missing where its cells are empty, not finite, or all exactly zero (QTM's way of writing gaps).

    Raises
    ------
    SignfaceError
        No 3-D data, no marker names, an external time base without a rate, or a first row cut short or not numeric.
        Later rows are looked at when they are read.
    """
    file = Path(path)
    text = TextFile(file)
    lines = [line for _, line in text.lines(0, LONGEST_HEADER)]
    fields, length = _header(lines)
    if "MARKER_NAMES" not in fields and "NO_OF_MARKERS" not in fields:
        raise SignfaceError("is no TSV file of Qualisys with its header", file=file, hint="export it with a header")
    included = " ".join(fields.get("DATA_INCLUDED", ["3D"]))
    if "3D" not in included:
        raise SignfaceError(f"the TSV file has {included[:20]} data", file=file, hint="export 3D data")
    names = fields.get("MARKER_NAMES", [])
    declared = " ".join(fields.get("NO_OF_MARKERS", [])).strip()
    markers = int(declared) if declared.isdigit() else sum(map(bool, names))
    names = (names + [""] * markers)[:markers]
    if markers == 0:
        raise SignfaceError("the TSV file has no markers", file=file, hint="export the trajectories with it")
    if not any(names):
        raise SignfaceError("the TSV file has no marker names", file=file, hint="export it with MARKER_NAMES")
    try:
        declared_rate = float(" ".join(fields.get("FREQUENCY", ["nan"])).replace(",", "."))
    except ValueError:
        declared_rate = math.nan
    rows = lines[length:]
    before, time_at = 0, None
    if rows and rows[0].split("\t")[0].strip().lower() in ("frame", "time"):
        heads = [cell.strip().lower() for cell in rows[0].split("\t")]
        before = sum(1 for cell in heads[:2] if cell in ("frame", "time"))
        time_at = heads.index("time") if "time" in heads[:2] else None
        rows, length = rows[1:], length + 1
    elif rows and re.match(r"^[^\t]*[XYZ](\t|$)", rows[0].strip()):
        rows, length = rows[1:], length + 1
    filled = next((line for line in rows if line.strip()), "")
    extra = len(filled.rstrip("\t\r\n ").split("\t")) - 3 * markers
    if not before and extra in (1, 2):
        before, time_at = extra, extra - 1  # (frame and) time without a line of column names
    table = TextRows(text, length, before + 3 * markers, "\t")
    kept, labels, notes = kept_labels(names, file, what="markers in the TSV file")
    times = None if time_at is None else table.column(time_at)
    if times is not None and extra == 1 and time_at == 0 and (np.diff(times) == np.round(np.diff(times))).all():
        times = None  # numbers of frames
    clock = Clock(rate, 0.0) if rate else declared_clock(declared_rate, times, file, name="FREQUENCY")
    stated = " ".join(fields.get("NO_OF_FRAMES", [])).strip()
    if stated.isdigit() and int(stated) != len(table):
        notes = [doubt(file, f"has {len(table)} frames and NO_OF_FRAMES says {stated}: it may be cut short"), *notes]
    return marker_rows(
        table,
        np.array(kept)[:, None] * 3 + np.arange(before, before + 3),
        labels,
        clock,
        units="mm",
        unit=unit,
        history=(f"read {file.name} (Qualisys TSV)", *notes),
    )
