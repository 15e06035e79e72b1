"""CSV of markers as the programs of motion-capture systems export it: Vicon Nexus and OptiTrack Motive.

- `open_nexus`: a section `Trajectories`, its rate, names over `Frame, Sub Frame, X, Y, Z ...`, units, a row a frame.
- `open_motive`: a line of names and values (`Format Version, 1.23, ... Length Units, Millimeters`), then lines that say
  of each column its type, name and kind, `Frame, Time (Seconds), X, Y, Z ...`, and a row a frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from os import PathLike
from pathlib import Path

import numpy as np

from signface.errors import SignfaceError
from signface.takes.formats.registry import FileHead, register_format
from signface.takes.formats.text import ROWS, TextFile, TextRows, header_cells, marker_rows, number_or_nan
from signface.takes.formats.timing import Clock, declared_clock
from signface.takes.labels import kept_labels
from signface.takes.recording import TakeFile
from signface.takes.take import Take

#: The sections of Nexus's files, each begun by a line that holds its name alone.
SECTIONS = ("trajectories", "devices", "model outputs", "joints", "segments", "events")
#: A line with the name of a section is no longer than this, with separators for every column behind it.
LONGEST_NAME = 400
#: More lines than these stand over no rows of numbers.
LONGEST_HEADER = 12
#: Columns of positions that Motive gives to markers; rigid bodies and bones have some, too.
MARKER_TYPES = ("marker", "rigid body marker", "bone marker")


def _cells(line: str) -> list[str]:
    return header_cells(line)[0]


def _alone(line: str) -> str:
    """The word of a line that holds one, in small letters."""
    return line.strip().strip(",;\t \"'").lower()


def _triples(axes: Sequence[str]) -> list[int]:
    """Where x, y and z follow one another."""
    low = [axis.lower() for axis in axes]
    return [number for number in range(len(low) - 2) if low[number : number + 3] == ["x", "y", "z"]]


def _sections(text: TextFile) -> Iterator[tuple[int, str]]:
    """Number among the lines, and name, of each line that begins a section; a piece of the file at a time."""
    for begin in range(0, len(text), ROWS):
        for number, (_, line) in enumerate(text.lines(begin, begin + ROWS), begin):
            if len(line) < LONGEST_NAME and _alone(line) in SECTIONS:
                yield number, _alone(line)


def _is_nexus(head: FileHead) -> float:
    return 0.9 * (
        len(head.lines) > 2 and _alone(head.lines[0]) in SECTIONS and number_or_nan(_alone(head.lines[1])) > 0
    )


@register_format(
    "nexus",
    title="Vicon Nexus CSV",
    written_by="Vicon Nexus: Export ASCII, trajectories",
    endings=(".csv",),
    recognise=_is_nexus,
)
def open_nexus(path: str | PathLike[str], *, unit: str | None = None, rate: float | None = None) -> TakeFile | Take:
    """Open the trajectories of a CSV that Vicon Nexus exported.

    Frames that are not there are gaps; the start is that of the first frame, frame 1 being time 0.

    Raises
    ------
    SignfaceError
        The file has no section `Trajectories`, or one after it; its header is another; a row is cut short or holds
        words.

    Examples
    --------
    >>> lines = ["Trajectories", "100", ",,LBRO,,", "Frame,Sub Frame,X,Y,Z", ",,mm,mm,mm", "1,0,1,2,3", "2,0,1,2,4"]
    >>> _ = Path("nexus.csv").write_text("\\n".join(lines))
    >>> take = open_nexus("nexus.csv")
    >>> take.labels, take.rate, take.n_frames
    (('LBRO',), 100.0, 2)
    """
    file = Path(path)
    text = TextFile(file)
    sections = list(_sections(text))
    first = next((number for number, word in sections if word == "trajectories"), None)
    if first is None:
        raise SignfaceError("holds no trajectories", file=file, hint="export them from Nexus (Export ASCII)")
    if later := [word for number, word in sections if number > first]:
        raise SignfaceError(
            f"has a section {later[0]} after the trajectories", file=file, hint="export the trajectories alone, or C3D"
        )
    header = [line for _, line in text.lines(first + 1, first + 5)]
    if len(header) < 4 or not _cells(header[2])[0].lower().startswith("frame"):
        raise SignfaceError("has no header of trajectories", file=file, hint="export it again from Nexus, or as C3D")
    declared, names, axes, units = number_or_nan(_alone(header[0])), *(_cells(line) for line in header[1:])
    places = _triples(axes)
    labels = [names[place] if place < len(names) else "" for place in places]
    rows = TextRows(text, first + 5, len(axes), header_cells(header[2])[1])
    frames = rows.column(0)
    if rate or not declared > 0:
        clock = Clock(rate, 0.0) if rate else declared_clock(math.nan, None, file, name="the rate of Trajectories")
    else:
        clock = declared_clock(declared, (frames - 1) / declared, file, name="the rate of Trajectories")
    stated = units[places[0]] if places and places[0] < len(units) else None
    return _recording(rows, places, labels, clock, stated or None, unit, "Vicon Nexus CSV")


def _motive_header(head: Sequence[str]) -> dict[str, str]:
    cells = _cells(head[0]) if head else []
    return {name.lower(): value for name, value in zip(cells[::2], cells[1::2], strict=False)}


def _is_motive(head: FileHead) -> float:
    fields = _motive_header(head.lines)
    return 0.95 * ("format version" in fields and ("capture frame rate" in fields or "export frame rate" in fields))


@register_format(
    "motive",
    title="OptiTrack Motive CSV",
    written_by="OptiTrack Motive: Export tracking data, markers",
    endings=(".csv",),
    recognise=_is_motive,
)
def open_motive(path: str | PathLike[str], *, unit: str | None = None, rate: float | None = None) -> TakeFile | Take:
    """Open the markers of a CSV that OptiTrack Motive exported; rigid bodies and bones are left out.

    Raises
    ------
    SignfaceError
        The file has no markers, its header is another, or a row is cut short or holds words.

    Examples
    --------
    >>> lines = ["Format Version,1.23,Export Frame Rate,100,Length Units,Meters", ",Type,Marker,Marker,Marker"]
    >>> lines += [",Name,LBRO,LBRO,LBRO", ",ID,1,1,1", ",,Position,Position,Position"]
    >>> lines += ["Frame,Time (Seconds),X,Y,Z", "0,0.00,0.1,0.2,0.3", "1,0.01,0.1,0.2,0.4"]
    >>> _ = Path("motive.csv").write_text("\\n".join(lines))
    >>> take = open_motive("motive.csv")
    >>> take.labels, take.rate, take.n_frames
    (('LBRO',), 100.0, 2)
    """
    file = Path(path)
    text = TextFile(file)
    header = [line for _, line in text.lines(0, LONGEST_HEADER)]
    fields = _motive_header(header)
    rows_of = [_cells(line) for line in header]
    last = next((n for n, cells in enumerate(rows_of) if cells and cells[0].lower() == "frame"), None)
    if last is None:
        raise SignfaceError(
            "has no line Frame, Time, X, Y, Z", file=file, hint="export it again from Motive, or as C3D"
        )
    said = {cells[1].lower(): cells for cells in rows_of[1:last] if len(cells) > 1 and cells[1]}
    width = len(rows_of[last])
    types, names = ([*said.get(what, []), *[""] * width][:width] for what in ("type", "name"))
    places = [place for place in _triples(rows_of[last]) if types[place].lower() in MARKER_TYPES]
    # A marker of a rigid body may be there twice, as it was seen and as the body puts it: the one seen counts.
    seen = {names[place] for place in places if types[place].lower() == "marker"}
    places = [place for place in places if types[place].lower() == "marker" or names[place] not in seen]
    if not places:
        raise SignfaceError("has no markers", file=file, hint="tick Markers when you export from Motive, or export C3D")
    rows = TextRows(text, last + 1, width, header_cells(header[last])[1])
    declared = number_or_nan(fields.get("export frame rate", fields.get("capture frame rate", "")))
    clock = Clock(rate, 0.0) if rate else declared_clock(declared, rows.column(1), file, name="Export Frame Rate")
    units = fields.get("length units")
    return _recording(rows, places, [names[p] for p in places], clock, units, unit, "OptiTrack Motive CSV")


def _recording(
    rows: TextRows,
    places: Sequence[int],
    labels: Sequence[str],
    clock: Clock,
    units: str | None,
    unit: str | None,
    title: str,
) -> TakeFile | Take:
    """Rows of numbers with x, y and z of each marker from `places` on."""
    file = rows.text.file
    kept, names, notes = kept_labels(labels, file)
    columns = np.array([places[number] for number in kept])[:, None] + np.arange(3)
    history = (f"read {file.name} ({title})", *notes)
    return marker_rows(rows, columns, names, clock, units=units, unit=unit, history=history)
