"""OpenFace tables, whatever is taken from them: one face's columns on an even grid of times.

OpenFace 2.x writes a row a frame and face: `frame, face_id, timestamp, confidence, success, pose_Tx, ..., x_0, ...,
X_0, ..., AU01_r, ...`, with or without blanks after the commas, and any subset of the columns.

- `read_table`: the table of the face that is seen most.
- `is_openface`: whether a file begins like one.
"""

from __future__ import annotations

import warnings
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np

from signface.errors import SignfaceError, SignfaceWarning
from signface.marker_names import SeveralSigners
from signface.takes.formats.people import RIVAL
from signface.takes.formats.text import TextFile, TextRows, header_cells
from signface.takes.formats.uneven import even_frames

#: Under this confidence OpenFace itself counts a frame as failed.
LEAST_CONFIDENCE = 0.7
#: The rate of a table without times, with a warning (Hz).
USUAL_RATE = 30.0
#: Frames this far apart, in typical steps, have a gap between them that is not filled.
GAP_STEPS = 2.5
#: Times this close to a regular grid, in steps, are taken as on it.
EVEN_STEPS = 0.25
#: Of the camera's axes (x to the right of the picture, y down, z away), ours: x to the signer's left, y up, z near.
SIGNS = np.array([1.0, -1.0, -1.0])


class Table(NamedTuple):
    """One face's columns on an even grid of times."""

    values: np.ndarray  #: (F, C), NaN where the face was not found
    columns: list[str]
    rate: float
    start: float
    notes: tuple[str, ...]

    def place(self, names: list[str]) -> np.ndarray:
        """(F, K) the columns of some names."""
        return self.values[:, [self.columns.index(name) for name in names]]


def read_table(path: str | PathLike[str], subject: str | None = None) -> Table:
    """The columns of one face; NaN where it was not found, at even times.

    Parameters
    ----------
    path : path
    subject : str, optional
        The number of the face, as in `face_id`; the one seen most where the others are seen too little to be signers
        (`signface.takes.formats.people.RIVAL`).

    Raises
    ------
    SeveralSigners
        Several faces are seen much, and none was chosen.
    SignfaceError
        A row is cut short or holds words, no face was found, or the times do not rise.
    """
    file = Path(path)
    text = TextFile(file)
    cells, separator = header_cells(text.lines(0, 1)[0][1])
    columns = [cell.strip() for cell in cells]
    while columns and not columns[-1]:
        columns.pop()
    rows = TextRows(text, 1, len(columns), separator)
    values = rows.values(0, len(rows))
    notes: list[str] = []
    values, more = _one_face(values, columns, subject, file)
    notes += more
    times, more = _times(values, columns, file)
    notes += more
    lost = np.zeros(len(values), dtype=bool)
    if "success" in columns:
        lost |= ~(values[:, columns.index("success")] > 0)
    if "confidence" in columns:
        lost |= ~(values[:, columns.index("confidence")] >= LEAST_CONFIDENCE)
    if lost.all():
        raise SignfaceError("OpenFace found no face in it", file=file, hint="look at the film, and track it again")
    if lost.any():
        notes.append(f"no face in {lost.sum()} of {len(lost)} frames")
    values[lost] = np.nan
    values, rate, more = _even(values, times, file)
    return Table(values, columns, rate, float(times[0]), (*notes, *more))


def _one_face(values: np.ndarray, columns: list[str], subject: str | None, file: Path) -> tuple[np.ndarray, list[str]]:
    """The rows of the face that was chosen, or else that is seen most surely, where there are several."""
    if "face_id" not in columns:
        if subject is not None:
            raise SignfaceError("has one face, without a number", file=file, hint="leave out --subject")
        return values, []
    faces = values[:, columns.index("face_id")]
    known = np.unique(faces[np.isfinite(faces)])
    if subject is not None:
        names = [f"{face:g}" for face in known]
        if subject not in names:
            raise SignfaceError(f"has no face {subject!r}", file=file, hint=f"its faces are {', '.join(names[:12])}")
        return values[faces == float(subject)], [f"face {subject} of {len(known)}"]
    if len(known) < 2:
        return values, []
    sure = values[:, columns.index("confidence")] if "confidence" in columns else np.ones(len(values))
    total = [np.nansum(sure[faces == face]) for face in known]
    rivals = [f"{face:g}" for face, much in zip(known, total, strict=True) if much >= RIVAL * max(total)]
    if len(rivals) > 1 and _at_once(values, columns, [float(rival) for rival in rivals]):
        raise SeveralSigners.named(rivals, str(file))
    chosen = known[int(np.argmax(total))]
    return values[faces == chosen], [f"took face {chosen:g} of {len(known)}, the one seen most"]


def _at_once(values: np.ndarray, columns: list[str], faces: list[float]) -> bool:
    """Whether two of the faces are seen in one frame: else it may be one person who was found again."""
    name = next(name for name in ("frame", "timestamp") if name in columns)
    shown = values[np.isin(values[:, columns.index("face_id")], faces)]
    if "success" in columns:
        shown = shown[shown[:, columns.index("success")] > 0]
    times = shown[:, columns.index(name)]
    return len(np.unique(times)) < len(times)


def _times(values: np.ndarray, columns: list[str], file: Path) -> tuple[np.ndarray, list[str]]:
    """(F,) seconds of the rows; counted from their numbers where the table has no times (pictures), with a warning."""
    if len(values) < 2:
        raise SignfaceError("has one frame, and a rate needs two", file=file, hint="track the whole film")
    for name in ("timestamp", "frame"):
        if name not in columns:
            continue
        times = values[:, columns.index(name)].copy()
        if not (np.diff(times) > 0).all():
            continue
        if name == "timestamp":
            return times, []
        note = f"it has no times: {USUAL_RATE:g} frames a second are assumed"
        warnings.warn(f"{file}: {note}", SignfaceWarning, stacklevel=2)
        return (times - times[0]) / USUAL_RATE, [note]
    raise SignfaceError("its times do not rise from row to row", file=file, hint="track the film again")


def _even(values: np.ndarray, times: np.ndarray, file: Path) -> tuple[np.ndarray, float, list[str]]:
    """Values at even times, the rate (Hz), and notes.

    A frame that lies on the grid but for the rounding of its time stays as it is, so that an even file is not smoothed.
    """
    steps = np.diff(times)
    typical = float(np.median(steps))
    even_mostly = np.mean(np.abs(steps - typical) < EVEN_STEPS * typical) > 0.5
    whole = steps[steps < (1.5 if even_mostly else GAP_STEPS) * typical]  # without those over dropped frames
    rate = 1 / float(whole.mean())
    if abs(rate - round(rate)) < 0.02:
        rate = float(round(rate))
    place = (times - times[0]) * rate
    near = np.round(place).astype(np.int64)
    if near[-1] > 20 * len(near) + 1000:
        raise SignfaceError("its times leap: more frames are lost than kept", file=file, hint="track the film again")
    even = np.arange(near[-1] + 1)
    if np.abs(place - near).max() <= EVEN_STEPS and (np.diff(near) > 0).all():
        out = np.full((len(even), values.shape[1]), np.nan)
        out[near] = values
        lost = len(even) - len(near)
        return out, rate, [f"{lost} frames are missing"] if lost else []
    out, _ = even_frames(times, values, rate, longest_s=GAP_STEPS / rate)
    note = f"put its uneven times on a grid of {rate:.4g} Hz"
    return out, rate, [note]


def is_openface(cells: list[str]) -> bool:
    """Whether the cells of a header are those of OpenFace."""
    names = {cell.strip() for cell in cells}
    return {"confidence", "success"} <= names and bool({"frame", "timestamp"} & names)
