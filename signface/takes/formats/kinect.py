"""Face points of Kinect's first face tracker, as the text files of UCI's Grammatical Facial Expressions have them.

A header `0.0 0x 0y 0z 1x ...`, then a row a frame: the time, and for each of 100 points its place in the colour picture
(x and y in pixels of 640 x 480, y down) and the depth there (z in millimetres, 0 where Kinect measured none).

They become a right-handed system with x to the signer's left, y up and z towards the camera. Points 0 to 7 are the left
eye, and they lie to the left in the picture: Kinect's picture is mirrored, as the picture in a mirror is.
"""

from __future__ import annotations

import warnings
from os import PathLike
from pathlib import Path

import numpy as np

from signface.errors import SignfaceError
from signface.takes.formats.registry import FileHead, register_format
from signface.takes.formats.text import BLANK, numbers, read_text
from signface.takes.formats.uneven import even_frames, usual_rate
from signface.takes.take import Take

#: The middle of the colour picture and its focal length in pixels, as Microsoft's Kinect for Windows SDK gives them for
#: 640 x 480 (NUI_CAMERA_COLOR_NOMINAL_FOCAL_LENGTH_IN_PIXELS).
CENTRE, FOCAL = (320.0, 240.0), 531.15

#: A depth this far (mm) from where the point usually is beside the middle of the face is not the face's: a hand, hair,
#: or the wall; so is one this far behind the middle, whatever is usual. (A turn of the head by 30 degrees moves the
#: corner of an eye by 25 mm.)
LEAP_MM, BEHIND_MM = 50.0, 150.0

#: Depths beside the middle of the face are medians over so many rows, half a second: they come in steps of some 4 mm
#: and jump by more, while skin hardly moves along the line of sight.
DEPTH_ROWS = 9


def clock(cell: str) -> float:
    """Seconds of a time `seconds.milliseconds` whose milliseconds are not padded: `083.5` is 83.005 s.

    Raises
    ------
    ValueError
        It is no such time.

    Examples
    --------
    >>> clock("1390385453.5"), clock("12.062")
    (1390385453.005, 12.062)
    """
    seconds, _, milliseconds = cell.strip().partition(".")
    if len(milliseconds) > 3:
        raise ValueError(cell)
    return int(seconds) + int(milliseconds or "0") / 1000


def kinect_times(lines: list[tuple[int, str]], file: Path) -> np.ndarray:
    """(R,) seconds of rows (number in the file and text), from the first row.

    Raises
    ------
    SignfaceError
        A row does not begin with a time.
    """
    times = []
    for number, line in lines:
        cell = line.split(None, 1)[0]
        try:
            times.append(clock(cell))
        except ValueError as error:
            problem = f"line {number} begins with no time: {cell[:20]!r}"
            raise SignfaceError(problem, file=file, hint="correct it") from error
    return np.array(times) - times[0]


def kinect_lines(file: Path) -> tuple[list[str], list[tuple[int, str]]]:
    """The names of the columns, and number and text of each row.

    Raises
    ------
    SignfaceError
        The file is none of Kinect's face points, or has no frames.
    """
    numbered = [(number, line) for number, line in enumerate(read_text(file).splitlines(), 1) if line.strip(BLANK)]
    columns = numbered[0][1].split()
    if not _is_header(columns):
        raise SignfaceError("is no file of Kinect's face points", file=file, hint="its first line is 0.0 0x 0y 0z ...")
    if len(numbered) < 2:
        raise SignfaceError("the file has no frames, only a header", file=file, hint="export it again")
    return columns, numbered[1:]


def _is_header(columns: list[str]) -> bool:
    """Whether columns are a time, then x, y and z of points that have numbers, each three of one point."""
    points = columns[1:]
    return (
        len(points) >= 3
        and len(points) % 3 == 0
        and all(name[:-1].isdecimal() and name[-1] == "xyz"[k % 3] for k, name in enumerate(points))
        and all(len({name[:-1] for name in points[k : k + 3]}) == 1 for k in range(0, len(points), 3))
    )


def _certainty(head: FileHead) -> float:
    """The beginning of the header; all of it is looked at where the file is opened."""
    return 0.9 * (bool(head.lines) and head.lines[0].split()[1:7] == ["0x", "0y", "0z", "1x", "1y", "1z"])


def face_depth(depth: np.ndarray) -> np.ndarray:
    """Depths of a face from measured ones: what is not the face's is left out, what jitters is smoothed.

    Parameters
    ----------
    depth : (F, N) array
        Millimetres from the camera; 0 where there is none.

    Returns
    -------
    (F, N) array
        The middle of the face (the median over the points, each beside its usual place) in each row, and beside it a
        running median of each point; NaN where the point has no depth in the row, or that of something else.

    Examples
    --------
    >>> depth = np.tile([1000.0, 1004, 1010, 0, 1020], (30, 1))
    >>> depth[7, 2], depth[12, 0] = 1018, 1400
    >>> face_depth(depth)[[7, 12]].tolist()
    [[1000.0, 1004.0, 1010.0, nan, 1020.0], [nan, 1004.0, 1010.0, nan, 1020.0]]
    """
    depth = np.where(depth > 0, depth, np.nan)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # rows and points without any depth
        middle = np.nanmedian(depth, axis=1, keepdims=True)
        usual = np.nanmedian(depth - middle, axis=0)  # so that the middle does not leap with the points that are seen
        middle = np.nanmedian(depth - usual, axis=1, keepdims=True)
        beside = depth - middle
        beside[beside > BEHIND_MM] = np.nan
        beside[np.abs(beside - np.nanmedian(beside, axis=0)) > LEAP_MM] = np.nan
        reach = DEPTH_ROWS // 2
        wide = np.pad(beside, ((reach, reach), (0, 0)), constant_values=np.nan)
        windows = np.lib.stride_tricks.sliding_window_view(wide, DEPTH_ROWS, axis=0)
        smooth = np.nanmedian(windows, axis=-1)
    return np.where(np.isfinite(beside), middle + smooth, np.nan)


def in_space(points: np.ndarray) -> np.ndarray:
    """Places in the picture and depths as positions in millimetres.

    Parameters
    ----------
    points : (F, N, 3) array
        x and y in pixels, z in millimetres.

    Returns
    -------
    (F, N, 3) array
        x to the signer's left, y up, z towards the camera, which is the origin; NaN where z is.

    Examples
    --------
    >>> in_space(np.array([[[320.0, 240.0, 1000.0], [267.0, 240.0, 1000.0]]]))[0].round().tolist()
    [[0.0, 0.0, -1000.0], [100.0, 0.0, -1000.0]]
    """
    depth = points[..., 2]
    across, up = ((CENTRE[axis] - points[..., axis]) * depth / FOCAL for axis in (0, 1))
    return np.stack([across, up, -depth], axis=-1)


@register_format(
    "kinect",
    title="Kinect face points",
    written_by="UCI's Grammatical Facial Expressions",
    endings=(".txt",),
    recognise=_certainty,
)
def read_kinect(path: str | PathLike[str], *, unit: str | None = None) -> Take:
    """Read Kinect's face points as a take; labels are `K0` to `K99`.

    Depths are noisy: those of something else than the face are left out, and each point's depth beside the middle of
    the face is smoothed over half a second (`face_depth`). Rows come about every 62 ms, with gaps. They are put on an
    even grid at their usual rate; in gaps of more than 0.2 s all points are missing. Time 0 is the first row.

    Parameters
    ----------
    path : path
    unit : str, optional
        Not used: pixels and depths in millimetres are what the format has.

    Raises
    ------
    SignfaceError
        The file is none of Kinect's face points, a row is cut short or holds words, times do not rise, or no point has
        a depth.
    """
    file = Path(path)
    columns, lines = kinect_lines(file)
    times = kinect_times(lines, file)
    rate = usual_rate(times)
    cells = [(number, line.lstrip(BLANK).partition(" ")[2]) for number, line in lines]
    points = numbers(cells, len(columns) - 1, None, file).reshape(len(lines), -1, 3)
    if not (points[..., 2] > 0).any():
        raise SignfaceError("no point has a depth", file=file, hint="export it again with depths in millimetres")
    measured = points[..., 2] > 0
    points[..., 2] = face_depth(points[..., 2])
    others = (measured & np.isnan(points[..., 2])).sum() / measured.sum()
    even, missing = even_frames(times, in_space(points), rate)
    notes = [f"unit pixel and mm, by a focal length of {FOCAL:g} pixels; the picture is a mirror's"]
    notes += [f"{others:.1%} of the depths, of something else than the face, left out; the others smoothed over 0.5 s"]
    notes += [f"{len(lines)} rows put on {len(even)} frames at {rate:g} Hz, {int(missing.sum())} of them in gaps"]
    labels = tuple(f"K{name[:-1]}" for name in columns[1::3])
    return Take(even, labels, rate, name=file.stem, history=(f"read {file.name} (Kinect face points)", *notes))
