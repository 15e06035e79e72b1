"""OpenFace tables: 68 landmarks of one camera as markers, or the action units as weights.

OpenFace 2.x writes a row a frame and face: `frame, face_id, timestamp, confidence, success, pose_Tx, ..., x_0, ...,
X_0, ..., AU01_r, ...`, with or without blanks after the commas, and any subset of the columns. `X, Y, Z` are
millimetres from the camera, x to the right of the picture, y down, z away; they become x to the signer's left, y up,
z towards the camera.

- `read_openface`: the landmarks.
- `read_action_units`: the action units, and the head's pose.
"""

from __future__ import annotations

import re
import warnings
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np

from signface.descriptors import Descriptors
from signface.errors import SignfaceError, SignfaceWarning
from signface.takes.formats.registry import FileHead, register_format
from signface.takes.formats.text import TextFile, TextRows, header_cells
from signface.takes.take import Take

LANDMARKS = 68
#: Under this confidence OpenFace itself counts a frame as failed.
LEAST_CONFIDENCE = 0.7
#: The rate of a table without times, with a warning (Hz).
USUAL_RATE = 30.0
#: Frames this far apart, in typical steps, have a gap between them that is not filled.
GAP_STEPS = 2.5
#: Times this close to a regular grid, in steps, are taken as on it.
EVEN_STEPS = 0.25

AXES = ("X", "Y", "Z")
POSE = ("pose_Rx", "pose_Ry", "pose_Rz", "pose_Tx", "pose_Ty", "pose_Tz")
#: Of the camera's axes (x right, y down, z away), ours.
SIGNS = np.array([1.0, -1.0, -1.0])
#: OpenFace's intensities go from 0 to this.
FULL_INTENSITY = 5.0
_UNIT = re.compile(r"AU\d\d_[rc]")


class _Table(NamedTuple):
    """One face's columns on an even grid of times."""

    values: np.ndarray  #: (F, C), NaN where the face was not found
    columns: list[str]
    rate: float
    start: float
    notes: tuple[str, ...]

    def place(self, names: list[str]) -> np.ndarray:
        return self.values[:, [self.columns.index(name) for name in names]]


def _read(path: str | PathLike[str]) -> _Table:
    file = Path(path)
    text = TextFile(file)
    cells, separator = header_cells(text.lines(0, 1)[0][1])
    columns = [cell.strip() for cell in cells]
    while columns and not columns[-1]:
        columns.pop()
    rows = TextRows(text, 1, len(columns), separator)
    values = rows.values(0, len(rows))
    notes: list[str] = []
    values, more = _one_face(values, columns)
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
    return _Table(values, columns, rate, float(times[0]), (*notes, *more))


def _one_face(values: np.ndarray, columns: list[str]) -> tuple[np.ndarray, list[str]]:
    """The rows of the face that is seen most surely, where there are several."""
    if "face_id" not in columns:
        return values, []
    faces = values[:, columns.index("face_id")]
    known = np.unique(faces[np.isfinite(faces)])
    if len(known) < 2:
        return values, []
    sure = values[:, columns.index("confidence")] if "confidence" in columns else np.ones(len(values))
    total = [np.nansum(sure[faces == face]) for face in known]
    chosen = known[int(np.argmax(total))]
    return values[faces == chosen], [f"took face {chosen:g} of {len(known)}, the one seen most"]


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
    whole = steps[steps < 1.5 * typical]
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
    after = np.searchsorted(place, even, side="left").clip(1, len(place) - 1)
    before = after - 1
    share = ((even - place[before]) / (place[after] - place[before])).clip(0, 1)[:, None]
    out = (1 - share) * values[before] + share * values[after]
    out[(place[after] - place[before]) > GAP_STEPS] = np.nan
    note = f"put its uneven times on a grid of {rate:.4g} Hz"
    return out, rate, [note]


def _is_openface(head: FileHead) -> bool:
    cells = {cell.strip() for cell in head.cells}
    return {"confidence", "success"} <= cells and bool({"frame", "timestamp"} & cells)


def _landmark_certainty(head: FileHead) -> float:
    return 0.95 * (_is_openface(head) and {"X_0", "Y_0", "Z_0"} <= {cell.strip() for cell in head.cells})


def _unit_certainty(head: FileHead) -> float:
    return 0.9 * _is_openface(head)


def true_positions(landmarks: np.ndarray) -> np.ndarray:
    """Landmarks as rigid motion moves them, from those that OpenFace writes.

    OpenFace fits its model of a face by weak perspective, as if all points were as far away as the face is, and then
    writes each point along the ray that goes through its pixel. A turning head is thereby sheared: points that come
    nearer also come towards the middle of the picture. With the mean depth in place of each point's own, the shape is
    the fitted one again, to the rounding of the file.

    Parameters
    ----------
    landmarks : (F, 68, 3) array
        X, Y, Z in millimetres, in the camera's axes. Of a subset of landmarks, the mean depth is the subset's.

    Returns
    -------
    (F, 68, 3) array
        In the same axes.

    Examples
    --------
    >>> written = np.array([[[90.0, 0.0, 900.0], [110.0, 0.0, 1100.0]]])
    >>> true_positions(written)[0, :, 0]
    array([100., 100.])
    """
    depth = landmarks[:, :, 2:]
    with np.errstate(invalid="ignore", divide="ignore"):
        out = landmarks * (depth.mean(axis=1, keepdims=True) / depth)
    out[..., 2:] = depth
    return out


@register_format(
    "openface",
    title="OpenFace CSV",
    written_by="OpenFace 2 (FeatureExtraction), its 68 landmarks in millimetres",
    endings=(".csv",),
    recognise=_landmark_certainty,
)
def read_openface(path: str | PathLike[str], *, unit: str | None = None) -> Take:
    """Read the 3-D landmarks of an OpenFace table as a take; landmark 30 has the label `L30`.

    Frames of low confidence or without success are missing, of several faces the one seen most is taken, and uneven
    times are put on an even grid. What OpenFace's way of writing points does to a turning head is undone
    (`true_positions`). The pose of the head is in the landmarks.

    Parameters
    ----------
    path : path
    unit : str, optional
        Not used: the file is in millimetres.

    Raises
    ------
    SignfaceError
        A row is cut short or holds words, no face was found, landmarks lack coordinates, or the times do not rise.
    """
    del unit
    file = Path(path)
    table = _read(file)
    known = set(table.columns)
    numbers = [number for number in range(LANDMARKS) if f"X_{number}" in known]
    partial = [number for number in numbers if not {f"Y_{number}", f"Z_{number}"} <= known]
    if partial:
        raise SignfaceError(f"landmark {partial[0]} has not all of X, Y and Z", file=file, hint="export all columns")
    landmarks = np.stack([table.place([f"{axis}_{number}" for number in numbers]) for axis in AXES], axis=-1)
    if len(numbers) > 1:
        landmarks = true_positions(landmarks)
    return Take(
        landmarks * SIGNS,
        tuple(f"L{number}" for number in numbers),
        table.rate,
        start=table.start,
        name=file.stem,
        history=(
            f"read {file.name} (OpenFace, {table.rate:.4g} Hz)",
            "perspective of single points undone",
            *table.notes,
        ),
    )


@register_format(
    "aus",
    title="OpenFace action units",
    written_by="OpenFace 2 with action units; a table of them alone, or any with --as aus",
    endings=(".csv",),
    recognise=_unit_certainty,
    holds="weights",
)
def read_action_units(path: str | PathLike[str], *, unit: str | None = None) -> Descriptors:
    """Read the action units of an OpenFace table as weights, and the head's pose where it is there.

    `AU01_r` (0 to 5) is divided by 5, `AU01_c` (there or not) stays 0 or 1. Columns keep OpenFace's names.

    Parameters
    ----------
    path : path
    unit : str, optional
        Not used: action units have no unit of length.

    Raises
    ------
    SignfaceError
        As `read_openface`, or there are no action units.
    """
    del unit
    file = Path(path)
    table = _read(file)
    names = [name for name in table.columns if _UNIT.fullmatch(name)]
    if not names:
        raise SignfaceError(
            "has neither 3-D landmarks (X_0, ...) nor action units (AU01_r, ...)",
            file=file,
            hint="run OpenFace with -3Dfp or -aus",
        )
    weights = table.place(names) / [FULL_INTENSITY if name.endswith("_r") else 1.0 for name in names]
    present = set(POSE) <= set(table.columns)
    return Descriptors(
        weights,
        tuple(names),
        table.rate,
        start=table.start,
        head=_poses(table.place(list(POSE))) if present else None,
        name=file.stem,
        history=(f"read {file.name} (OpenFace action units, {table.rate:.4g} Hz)", *table.notes),
    )


def _poses(values: np.ndarray) -> np.ndarray:
    """(F, 4, 4) poses in our axes from (F, 6) angles (radians, about x, then the turned y and z) and places (mm)."""
    from scipy.spatial.transform import Rotation

    poses = np.full((len(values), 4, 4), np.nan)
    known = np.isfinite(values).all(axis=1)
    turned = Rotation.from_euler("XYZ", values[known, :3]).as_matrix()
    poses[known] = np.eye(4)
    poses[known, :3, :3] = SIGNS[:, None] * turned * SIGNS
    poses[known, :3, 3] = values[known, 3:] * SIGNS
    return poses
