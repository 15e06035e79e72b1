"""CSV with one row a frame: `time_s`, then `LABEL_x, LABEL_y, LABEL_z` for each marker.

A column `frame` may stand before the times.

- `open_table`, `write_table`.
"""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path

import numpy as np

from signface.errors import SignfaceError
from signface.files import whole_file
from signface.takes.formats.registry import FileHead, register_format
from signface.takes.formats.text import TextFile, TextRows, header_cells, marker_rows
from signface.takes.formats.timing import Clock, read_clock
from signface.takes.labels import kept_labels
from signface.takes.recording import TakeFile
from signface.takes.take import Take

AXES = ("x", "y", "z")

#: A column of times: `time_s`, `Time`, `Time (Seconds)`, `timestamp_ms`, `t` ...
TIME = re.compile(
    r"^(time|timestamp|time ?code|t)([ _]*[\[(]?(s|sec|seconds?|ms|msec|us|µs|ns|min|unix|utc)?[\])]?)$", re.I
)
#: A column of frames' numbers, which may stand before it.
FRAME = re.compile(r"^(frame|frame ?(number|no|nr|id|#)|#)\.?$", re.I)


def _time_column(columns: list[str]) -> int:
    """The number of the column of times: the first, or the one after frames' numbers; -1 where there is none."""
    after_frames = len(columns) > 1 and FRAME.match(columns[0]) and TIME.match(columns[1])
    return 1 if after_frames else 0 if columns and TIME.match(columns[0]) else -1


def _markers(columns: list[str], first: int, file: Path) -> tuple[list[str], np.ndarray]:
    """Labels in order, and the (M, 3) column numbers of their coordinates, which begin at `first`."""
    numbers_of: dict[str, list[int]] = {}
    order: list[tuple[str, list[int]]] = []
    for number, column in enumerate(columns[first:], start=first):
        label, _, axis = column.rpartition("_")
        if axis.lower() not in AXES or not label:
            raise SignfaceError(
                f"the column {column[:40]!r} is no coordinate of a marker",
                file=file,
                hint="its columns are time_s and LABEL_x, LABEL_y, LABEL_z for each marker",
            )
        axis_number = AXES.index(axis.lower())
        if label not in numbers_of or numbers_of[label][axis_number] >= 0:
            numbers_of[label] = [-1, -1, -1]
            order.append((label, numbers_of[label]))
        numbers_of[label][axis_number] = number
    broken = [label for label, numbers in order if min(numbers) < 0]
    if broken:
        raise SignfaceError(f"not all of x, y and z are there for {', '.join(broken[:5])}", file=file)
    if not order:
        raise SignfaceError("has no markers", file=file, hint="its columns are time_s and LABEL_x, LABEL_y, LABEL_z")
    return [label for label, _ in order], np.array([numbers for _, numbers in order])


def _certainty(head: FileHead) -> float:
    begin = max(0, _time_column(head.cells)) + 1
    coordinates = [cell.lower().rpartition("_")[2] in AXES for cell in head.cells[begin : begin + 3]]
    return 0.7 * (len(coordinates) == 3 and all(coordinates))


@register_format(
    "table",
    title="CSV of markers",
    written_by="signface, scripts and spreadsheets: time_s, then LABEL_x, LABEL_y, LABEL_z",
    endings=(".csv",),
    recognise=_certainty,
)
def open_table(path: str | PathLike[str], *, unit: str | None = None, rate: float | None = None) -> TakeFile | Take:
    """Open a wide CSV (separated by commas, semicolons or tabs): `time_s`, then three columns a marker.

    Empty cells are missing markers. The unit is inferred from the spread of the markers unless it is given.

    Raises
    ------
    SignfaceError
        The columns are others, a row is cut short, a cell is no number, or the times are none of a camera's.
    """
    file = Path(path)
    text = TextFile(file)
    columns, separator = header_cells(text.lines(0, 1)[0][1])
    timed = _time_column(columns)
    if timed < 0:
        raise SignfaceError("its first column is not time_s", file=file, hint="put the time in seconds there")
    while columns and not columns[-1]:
        columns.pop()
    labels, coordinates = _markers(columns, timed + 1, file)
    rows = TextRows(text, 1, len(columns), separator)
    clock = Clock(rate, 0.0) if rate else read_clock(rows.column(timed), file, heading=columns[timed])
    kept, names, notes = kept_labels(labels, file)
    return marker_rows(
        rows,
        coordinates[kept],
        names,
        clock,
        units=None,
        unit=unit,
        history=(f"read {file.name} (CSV)", *notes),
    )


def write_table(take: Take, path: str | PathLike[str]) -> None:
    """Write a take as a wide CSV in millimetres; missing markers are empty cells.

    Raises
    ------
    SignfaceError
        The file cannot be written.

    See Also
    --------
    signface.takes.formats.c3d.write_c3d : smaller, and read by every motion-capture program.

    Examples
    --------
    >>> take = Take([[[1.0, 2, 3]], [[1, 2, np.nan]]], ("NOSE",), rate=50)
    >>> write_table(take, "take.csv")
    >>> Path("take.csv").read_text().splitlines()
    ['time_s,NOSE_x,NOSE_y,NOSE_z', '0.000000,1.000000,2.000000,3.000000', '0.020000,,,']
    """
    import pandas as pd

    columns = [f"{label}_{axis}" for label in take.labels for axis in AXES]
    table = pd.DataFrame(take.positions.reshape(take.n_frames, -1), columns=columns)
    table.insert(0, "time_s", take.time)
    with whole_file(path) as temporary:
        table.to_csv(temporary, index=False, float_format="%.6f")
