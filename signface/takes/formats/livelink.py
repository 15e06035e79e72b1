"""Live Link Face CSV: the 52 ARKit weights that an iPhone measures, with the head's rotation.

Columns `Timecode, BlendshapeCount`, 52 weights in UpperCamel (`EyeBlinkLeft`), then `HeadYaw, HeadPitch, HeadRoll` and
the rotation of each eye. The timecode is `hours:minutes:seconds:frame.part`, frames counted at the recording's rate.
"""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path

import numpy as np

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.takes.formats.registry import FileHead, register_format
from signface.takes.formats.text import header_cells, numbers, read_text

TIMECODE = re.compile(r"^\s*(\d+):(\d+):(\d+)[:;](\d+)(\.\d+)?\s*$")
ROTATIONS = ("HeadYaw", "HeadPitch", "HeadRoll")
#: Rates at which phones record; a timecode cannot tell 29.97 from 30.
USUAL_RATES = (24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 120.0)
USUAL_RATE = 60.0
#: A count that ends this near a usual rate (part of it) has lost its last frames.
NEAR = 0.9
DAY_S = 86400.0


def base_name(column: str) -> str:
    """The ARKit name of a column: `EyeBlinkLeft` is `eyeBlinkLeft`."""
    return column[:1].lower() + column[1:]


def _turns(seconds: np.ndarray, frames: np.ndarray) -> float | None:
    """The rate that most seconds end at, where frames are counted one by one; None where they do not agree."""
    ends = np.flatnonzero(np.diff(seconds) == 1)
    within = np.diff(frames)[np.diff(seconds) == 0]
    if len(ends) == 0 or len(within) == 0 or (within == 1).mean() < 0.9:
        return None
    values, counts = np.unique(frames[ends] + 1, return_counts=True)
    return float(values[counts.argmax()]) if counts.max() > len(ends) / 2 else None


def _frames(cells: list[str], file: Path) -> tuple[np.ndarray, float]:
    """(F,) whole number of the frame of each row, from 0 and rising, and the rate in Hz, from timecodes."""
    matches = [TIMECODE.match(cell) for cell in cells]
    wrong = next((row for row, match in enumerate(matches) if match is None), None)
    if wrong is not None:
        raise SignfaceError(f"row {wrong + 2} has no timecode ({cells[wrong][:20]!r})", file=file)
    fields = np.array([[float(field or 0) for field in match.groups()] for match in matches if match])
    if len(fields) < 2:
        raise SignfaceError("has one frame, and a rate needs two", file=file, hint="export more of the recording")
    seconds = fields[:, :3] @ (3600.0, 60.0, 1.0)
    seconds += DAY_S * np.cumsum(np.diff(seconds, prepend=seconds[0]) < -DAY_S / 2)  # past midnight
    # Within a second the frame numbers rise to the rate less one. A take within one second does not show it.
    highest = fields[:, 3].max() + 1
    least = highest if (np.diff(seconds) > 0).any() else max(highest, USUAL_RATE)
    counted = min((rate for rate in USUAL_RATES if rate >= least), default=highest)
    turning = _turns(seconds, fields[:, 3])
    if turning is not None and turning < NEAR * counted:
        counted = turning  # slower than any usual rate, and counted to its end in most seconds: no frames are lost
    whole = seconds * counted + fields[:, 3]
    if (np.diff(whole) > 0).mean() > 0.9:
        frames, rate = whole, counted  # the parts of frames only say how far the camera runs beside the clock
    else:
        times = seconds + (fields[:, 3] + fields[:, 4]) / counted
        step = float(np.median(np.diff(times)))
        if step <= 0:
            raise SignfaceError("its timecodes do not rise", file=file, hint="export it again")
        rate = min(USUAL_RATES, key=lambda usual: abs(usual * step - 1))
        rate = rate if abs(rate * step - 1) < 0.03 else 1 / step
        frames = np.round((times - times[0]) * rate)
    frames = frames - frames[0]
    if (np.diff(frames) < 0).any():
        raise SignfaceError("its timecodes do not rise", file=file, hint="export it again")
    if frames[-1] > 20 * len(frames) + 1000:
        raise SignfaceError("its timecodes leap: more frames are lost than kept", file=file, hint="record it again")
    return frames.astype(np.int64), rate


def _rotations(angles: np.ndarray) -> np.ndarray:
    """(F, 4, 4) head poses from (F, 3) yaw, pitch and roll in radians (degrees when beyond a turn).

    Yaw turns about the vertical axis y, pitch about x, roll about z, in this order from the outside in.
    """
    from scipy.spatial.transform import Rotation

    angles = np.nan_to_num(angles, nan=0.0)
    poses = np.tile(np.eye(4), (len(angles), 1, 1))
    degrees = bool(np.abs(angles).max(initial=0.0) > np.pi)
    poses[:, :3, :3] = Rotation.from_euler("YXZ", angles, degrees=degrees).as_matrix()
    return poses


def first_timecode(path: str | PathLike[str]) -> float:
    """The time of the day of the first frame, in seconds; frames are counted at the recording's rate."""
    lines = [line for line in read_text(Path(path)).splitlines() if line.strip()]
    _, separator = header_cells(lines[0])
    cells = [line.split(separator, 1)[0] for line in lines[1:]]
    _, rate = _frames(cells, Path(path))
    match = TIMECODE.match(cells[0])
    assert match is not None
    hours, minutes, seconds, frame, part = (float(field or 0) for field in match.groups())
    return 3600 * hours + 60 * minutes + seconds + (frame + part) / rate


def _certainty(head: FileHead) -> float:
    return 0.9 * ([cell.lower() for cell in head.cells[:2]] == ["timecode", "blendshapecount"])


@register_format(
    "livelink",
    title="Live Link Face CSV",
    written_by="Live Link Face on an iPhone",
    endings=(".csv",),
    recognise=_certainty,
    holds="weights",
    timecode=first_timecode,
)
def read_livelink(path: str | PathLike[str], *, unit: str | None = None) -> Descriptors:
    """Read the weights of a Live Link Face CSV.

    Bases get their ARKit names (`eyeBlinkLeft`); `tongueOut` is left out, as in the default face. Frames the phone
    dropped are filled by straight lines between their neighbours, so that the rate is even. Positions of the head are
    not in the file: poses are rotations only.

    Parameters
    ----------
    path : path
    unit : str, optional
        Not used: weights have no unit of length.

    Raises
    ------
    SignfaceError
        The columns are others, a row is cut short or holds words, or the timecodes do not rise.
    """
    file = Path(path)
    numbered = [(number, line) for number, line in enumerate(read_text(file).splitlines(), 1) if line.strip()]
    lines = [line for _, line in numbered]
    columns, separator = header_cells(lines[0])
    if [column.lower() for column in columns[:2]] != ["timecode", "blendshapecount"]:
        raise SignfaceError("is no Live Link Face CSV", file=file, hint="its first column is Timecode")
    if len(set(columns)) != len(columns):
        raise SignfaceError("has columns of one name", file=file, hint="export it again")
    bases = [
        column
        for column in columns[2:]
        if column and not re.search(r"(Yaw|Pitch|Roll)$", column) and column.lower() != "tongueout"
    ]
    if not bases:
        raise SignfaceError("has no weights", file=file, hint="export it again")
    if len(lines) < 2:
        raise SignfaceError("the file has no frames, only a header", file=file, hint="export it again")
    rows = [line.split(separator, 1) for line in lines[1:]]
    frame, rate = _frames([row[0] for row in rows], file)
    cells = [(number, row[1]) for (number, _), row in zip(numbered[1:], rows) if len(row) > 1 and row[1].strip()]
    values = numbers(cells, len(columns) - 1, separator, file)
    if len(values) != len(frame):
        raise SignfaceError("a row has a timecode and nothing else", file=file, hint="the file may be cut short")
    kept = np.flatnonzero(np.diff(frame, prepend=-1) > 0)
    even = np.arange(frame[-1] + 1)
    wanted = [columns.index(column) - 1 for column in (*bases, *(angle for angle in ROTATIONS if angle in columns))]
    filled = np.column_stack([np.interp(even, frame[kept], values[kept, column]) for column in wanted])
    notes = [f"read {file.name} (Live Link Face, {rate:g} Hz)"]
    if len(even) > len(kept):
        notes.append(f"filled {len(even) - len(kept)} dropped frames")
    head = None
    if all(rotation in columns for rotation in ROTATIONS):
        head = _rotations(filled[:, len(bases) :])
    return Descriptors(
        weights=filled[:, : len(bases)],
        names=tuple(base_name(column) for column in bases),
        rate=rate,
        head=head,
        name=file.stem,
        history=tuple(notes),
    )
