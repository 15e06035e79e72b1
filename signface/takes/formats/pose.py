"""`.pose` files (pose-format): MediaPipe Holistic's face landmarks as markers.

Landmarks come from one camera: x and y in pixels with y down, z relative to the head and smaller towards the camera.
They become a right-handed system with x to the signer's left, y up and z towards the camera, in millimetres. The scale
of a picture is unknown; it is set once for a take so that the eyes are as far apart as an adult's.
"""

from __future__ import annotations

import struct
import warnings
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from signface.errors import SignfaceError
from signface.files import reading
from signface.marker_names import SeveralSigners
from signface.takes.formats.doubts import doubt
from signface.takes.formats.missing import mark_missing
from signface.takes.formats.people import RIVAL, followed
from signface.takes.formats.registry import FileHead, register_format
from signface.takes.formats.timing import SLOWEST
from signface.takes.take import Take

#: No film of a signer has more frames a second (Hz).
FASTEST_FILM = 480.0

FACE = "FACE_LANDMARKS"

#: Pairs of landmarks (the outer and the inner corners of the eyes) and their distance in an adult, in millimetres:
#: exocanthion to exocanthion (mean of 91.2 for men and 87.8 for women) and endocanthion to endocanthion (33.3 and
#: 31.8), L. G. Farkas, Anthropometry of the Head and Face, 2nd edition, 1994. MediaPipe's own canonical face has 88.9
#: between landmarks 33 and 263.
EYE_CORNERS = (("33", "263", 89.5), ("133", "362", 32.5))

#: Depth is in pixels when it varies over a face by at least this part of its width; else in picture widths.
FLATTEST_FACE = 0.05


def _landmarks(pose: Any, file: Path, subject: str | None) -> tuple[np.ndarray, np.ndarray, list[str], list[str], bool]:
    """(F, N, 3) raw landmarks, (F, N) confidence, names, notes, and whether there is a depth."""
    names = [component.name for component in pose.header.components]
    if FACE not in names:
        raise SignfaceError(
            f"the .pose file has no component {FACE}, only {', '.join(names[:6]) or 'none'}",
            file=file,
            hint="extract it with MediaPipe Holistic",
        )
    component = pose.header.components[names.index(FACE)]
    begin = sum(len(other.points) for other in pose.header.components[: names.index(FACE)])
    points = slice(begin, begin + len(component.points))
    with np.errstate(invalid="ignore"):  # NaN of the signalling kind
        data = np.ma.getdata(pose.body.data)[:, :, points].astype(np.float64)
    confidence = np.array(np.ma.getdata(pose.body.confidence)[:, :, points], dtype=np.float64)
    if 0 in data.shape[:3]:
        raise SignfaceError("the .pose file shows nobody", file=file, hint="extract it again")
    data, confidence, notes = followed(data, confidence)
    people = [str(number + 1) for number in range(data.shape[1])]
    if subject is not None:
        if subject not in people:
            raise SignfaceError(f"shows no person {subject!r}", file=file, hint=f"its persons are {', '.join(people)}")
        person = people.index(subject)
    else:
        seen = (confidence > 0).any(axis=2).sum(axis=0)
        rivals = [str(number + 1) for number, frames in enumerate(seen) if frames >= RIVAL * max(seen)]
        if len(rivals) > 1:
            raise SeveralSigners.named(rivals, str(file))
        person = int(np.argmax(seen))
    if data.shape[1] > 1:
        notes.append(f"person {person + 1} of {data.shape[1]}")
    data, confidence = data[:, person], confidence[:, person]
    deep = data.shape[2] >= 3 and "Z" in component.format
    landmarks = np.zeros((*data.shape[:2], 3))
    landmarks[..., : 3 if deep else 2] = data[..., : 3 if deep else 2]
    return landmarks, confidence, [str(point) for point in component.points], notes, deep


def _in_pixels(landmarks: np.ndarray, width: int, height: int, deep: bool) -> tuple[np.ndarray, list[str]]:
    """Landmarks with all three coordinates in pixels; y still down."""
    notes = []
    spread = np.nanmedian(np.nanmax(landmarks, axis=1) - np.nanmin(landmarks, axis=1), axis=0)
    if np.nanmedian(np.abs(landmarks[..., :2])) <= 2.0:  # x and y are parts of the picture, not pixels
        landmarks = landmarks * (width, height, width)
        notes.append("coordinates were parts of the picture")
    elif deep and spread[2] < FLATTEST_FACE * max(spread[0], spread[1]):
        landmarks = landmarks * (1.0, 1.0, width)
        notes.append(f"depth times the picture's width ({width})")
    if not deep:
        notes.append("no depth in the file: the face is flat")
    return landmarks, notes


def _millimetres_per_pixel(landmarks: np.ndarray, names: list[str], file: Path) -> tuple[float, str]:
    """One scale for the take: the median 3-D distance of the corners of the eyes is an adult's."""
    for one, other, distance in EYE_CORNERS:
        if one in names and other in names:
            apart = np.linalg.norm(landmarks[:, names.index(one)] - landmarks[:, names.index(other)], axis=1)
            apart = apart[np.isfinite(apart)]
            if len(apart) and np.median(apart) > 0:
                return distance / float(np.median(apart)), f"landmarks {one} and {other} are {distance} mm apart"
    problem = "the corners of the eyes are never seen, so the scale is unknown"
    raise SignfaceError(problem, file=file, hint="extract it with MediaPipe Holistic")


def _certainty(head: FileHead) -> float:
    """A file begins with the format's version; 0 could be anything."""
    if len(head.content) < 10:
        return 0.0
    (version,) = struct.unpack("<f", head.content[:4])
    if round(version, 3) in (0.1, 0.2):
        return 0.9
    return 0.5 * (version == 0 and head.path.suffix.lower() == ".pose")


@register_format(
    "pose",
    title=".pose",
    written_by="pose-format, from MediaPipe Holistic",
    endings=(".pose",),
    recognise=_certainty,
    chooses_subject=True,
)
def read_pose(path: str | PathLike[str], *, unit: str | None = None, subject: str | None = None) -> Take:
    """Read the face landmarks of a `.pose` file as a take; labels are the landmarks' indices ("33", "263").

    Works with the 468, the 478 (with irises) and the 128-point (contours) sets. A landmark is missing where its
    confidence is 0, or all its coordinates are. People are followed by where they are, whatever their index
    (`people.followed`). The scale is one number for the
    whole take: nearer and farther from the camera remain visible as growing and shrinking.

    Parameters
    ----------
    path : path
    unit : str, optional
        Not used: a picture has no unit of length. The scale is noted in the history.
    subject : str, optional
        The number of the person, from 1 for the leftmost in the picture when they appear, where several are seen much.

    Raises
    ------
    SignfaceError
        The file is no whole `.pose` file, has no face landmarks, or they are never seen.
    """
    from pose_format import Pose

    file = Path(path)
    with reading(file):
        content = file.read_bytes()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            pose = Pose.read(content)
    except Exception as error:  # pose-format has no error of its own: struct, Unicode, memory, type errors
        raise SignfaceError("is a damaged .pose file", file=file, hint="extract it again") from error
    rate = float(pose.body.fps)
    if not (np.isfinite(rate) and rate > 0):
        raise SignfaceError("the .pose file has the rate 0", file=file, hint="extract it again from the video")
    landmarks, confidence, names, notes, deep = _landmarks(pose, file, subject)
    if not SLOWEST <= rate <= FASTEST_FILM:
        notes.append(doubt(file, f"{rate:g} frames a second are no film's: give its own with --rate"))
    landmarks[~(confidence > 0) | (np.abs(landmarks) > 1e6).any(axis=2)] = np.nan
    missing = np.isnan(mark_missing(landmarks)[..., 0])
    if missing.all():
        raise SignfaceError("no face is seen in the .pose file", file=file, hint="extract it again")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # frames without a face
        dimensions = pose.header.dimensions
        landmarks, depth_notes = _in_pixels(landmarks, dimensions.width, dimensions.height, deep)
    scale, scale_note = _millimetres_per_pixel(landmarks, names, file)
    note = f"unit pixel, {scale:.4g} mm each, so that {scale_note} (an adult's eyes)"
    return Take(
        landmarks * (scale, -scale, -scale),
        tuple(names),
        rate,
        name=file.stem,
        history=(f"read {file.name} (.pose)", note, *notes, *depth_notes),
    )
