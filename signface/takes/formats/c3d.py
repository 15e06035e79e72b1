"""C3D, the binary format of motion-capture systems.

- `open_c3d`: a file whose frames are read in pieces.
- `write_c3d`: a `Take` to a file, through ezc3d.

The format is described in the C3D User Guide (c3d.org): a header block of 512 bytes, a parameter section of groups
(POINT holds labels, unit, rate), and the data section, frame by frame x, y, z and the residual of each point.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from signface.errors import SignfaceError
from signface.files import reading, whole_file
from signface.takes.formats.c3d_structure import MOST_FRAMES, Structure, read_structure
from signface.takes.formats.registry import FileHead, register_format
from signface.takes.formats.units import in_millimetres
from signface.takes.labels import kept_labels
from signface.takes.recording import TakeFile
from signface.takes.take import Take


def _certainty(head: FileHead) -> float:
    """The first byte says where the parameters begin, the second is the format's number."""
    content = head.content
    if len(content) < 2 or content[1] != 0x50 or not 2 <= content[0] < 32:
        return 0.0
    return float(len(content) < 4 or b"\0" in content)  # a text may begin with a line break and a P


@register_format(
    "c3d",
    title="C3D",
    written_by="Vicon Nexus, Qualisys Track Manager, OptiTrack Motive and most systems of motion capture",
    endings=(".c3d",),
    recognise=_certainty,
)
def open_c3d(path: str | PathLike[str], *, unit: str | None = None) -> TakeFile:
    """Open a C3D file; its frames are read when they are asked for.

    A point is missing where its residual is negative, where its coordinates are not finite, or where all three are
    exactly zero (several exporters write that instead of a residual). Unlabelled points (`*12`) are ignored with a
    note. Time 0 is frame 1 of the trial, so a file cut from a longer one starts later.

    Parameters
    ----------
    path : path
    unit : str, optional
        The unit of length, where POINT:UNITS is absent or wrong.

    Raises
    ------
    SignfaceError
        The file is no whole C3D file, has no points or no rate, or its unit is unknown.
    """
    file = Path(path)
    structure = read_structure(file)
    if structure.rate == 0:
        raise SignfaceError("the C3D file has the rate 0", file=file, hint="set POINT:RATE to its frames per second")
    labels = structure.labels + [""] * (structure.points - len(structure.labels))
    kept, names, notes = kept_labels(labels[: structure.points], file, what="points in the C3D file")
    units = structure.units
    if len(units) > 1:
        units = [*units, *[units[-1]] * (structure.points - len(units))]
        units = [units[index] for index in kept]

    def raw(begin: int, end: int, step: int = 1) -> np.ndarray:
        return _frames(file, structure, kept, begin, end, step)

    read, note = in_millimetres(raw, structure.frames, units, unit, markers=len(kept), file=file)
    return TakeFile(
        tuple(names),
        structure.rate,
        structure.frames,
        read,
        start=structure.first / structure.rate,
        name=file.stem,
        history=(f"read {file.name} (C3D)", note, *notes),
    )


def _frames(file: Path, structure: Structure, kept: list[int], begin: int, end: int, step: int) -> np.ndarray:
    """(K, M, 3) coordinates of some frames, as the file has them; NaN where a point is missing."""
    kind = np.dtype(structure.order + ("f4" if structure.scale < 0 else "i2"))
    width = structure.words * kind.itemsize
    with reading(file), file.open("rb") as stream:
        if step == 1:
            stream.seek(structure.offset + begin * width)
            content = stream.read((end - begin) * width)
        else:
            rows = []
            for frame in range(begin, end, step):
                stream.seek(structure.offset + frame * width)
                rows.append(stream.read(width))
            content = b"".join(rows)
    frames = len(range(begin, end, step))
    if len(content) < frames * width:
        raise SignfaceError("has become shorter while it was read", file=file, hint="wait until it is written")
    if structure.dec and structure.scale < 0:
        words = np.frombuffer(content, dtype="<u2").reshape(frames, -1, 2)[:, : 4 * structure.points, ::-1]
        numbers = np.ascontiguousarray(words).view("<f4").reshape(frames, structure.points, 4) / 4
    else:
        numbers = np.frombuffer(content, dtype=kind).reshape(frames, -1)[:, : 4 * structure.points]
        numbers = numbers.reshape(frames, structure.points, 4)
    numbers = numbers[:, kept]
    positions = numbers[..., :3].astype(np.float64)
    if structure.scale > 0:
        positions *= structure.scale
    positions[numbers[..., 3] < 0] = np.nan
    return positions


def write_c3d(take: Take, path: str | PathLike[str]) -> None:
    """Write a take as C3D: millimetres, 32-bit floats, a residual of -1 where a marker is missing.

    The same take gives the same bytes. Coordinates are rounded to 32-bit floats (0.0001 mm for a head two metres
    from the origin), and the start to a whole frame, as the format has it.

    Raises
    ------
    SignfaceError
        The ending is not .c3d, the take starts before time 0 or has more frames than the format counts (65535), or
        the file cannot be written.

    See Also
    --------
    signface.takes.formats.table.write_table : readable by eye.

    Examples
    --------
    >>> take = Take([[[1.0, 2, 3]], [[1, 2, np.nan]]], ("NOSE",), rate=50)
    >>> write_c3d(take, "take.c3d")
    >>> open_c3d("take.c3d").whole().positions.tolist()
    [[[1.0, 2.0, 3.0]], [[nan, nan, nan]]]
    """
    import ezc3d

    if Path(path).suffix.lower() != ".c3d":
        raise SignfaceError("the ending of a C3D file is .c3d", file=path)  # ezc3d would add it to the name
    first = round(take.start * take.rate)
    frames, markers = take.positions.shape[:2]
    if not 0 <= first < 2**31:
        raise SignfaceError(f"{take.name}: a C3D file starts at time 0 or later", file=path, hint="shift its start")
    if frames >= MOST_FRAMES:
        raise SignfaceError(
            f"{take.name}: {frames} frames are too many for a C3D file", file=path, hint="write shorter takes"
        )
    missing = np.isnan(take.positions).any(axis=2)
    points = np.ones((4, markers, frames))
    points[:3] = np.where(missing[..., None], 0.0, take.positions).transpose(2, 1, 0)
    content = ezc3d.c3d()
    point = content["parameters"]["POINT"]
    point["RATE"]["value"] = [take.rate]
    point["UNITS"]["value"] = ["mm"]
    for number, begin in enumerate(range(0, markers, 255), start=1):
        suffix = "" if number == 1 else str(number)
        content.add_parameter("POINT", f"LABELS{suffix}", list(take.labels[begin : begin + 255]))
    for name, frame in (("ACTUAL_START_FIELD", first + 1), ("ACTUAL_END_FIELD", first + frames)):
        content.add_parameter("TRIAL", name, [frame & 0xFFFF, frame >> 16])  # two words, the lower one first
        content["parameters"]["TRIAL"][name]["type"] = 2  # integers; ezc3d takes every number for a float
    content["data"]["points"] = points
    content["data"]["meta_points"]["residuals"] = np.where(missing, -1.0, 0.0).T[None]
    with whole_file(path) as temporary:
        content.write(str(temporary))
