"""Whether a C3D file is whole, looked at before ezc3d opens it.

ezc3d trusts the counts and offsets that a file declares, and can crash the whole process on a damaged one. This
walks the header and the parameter section by the C3D User Guide (c3d.org) and checks that everything declared lies
inside the file.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

from signface.errors import SignfaceError

BLOCK = 512
MAGIC = 0x50
#: Processor byte of the parameter section: Intel (little endian), DEC (VAX floats), SGI/MIPS (big endian).
BYTE_ORDER = {84: "<", 85: "<", 86: ">"}


@dataclass(frozen=True)
class _Parameter:
    kind: int  # -1 characters, 1 bytes, 2 16-bit integers, 4 32-bit floats
    dimensions: tuple[int, ...]
    content: bytes


def _damaged(file: Path, what: str) -> SignfaceError:
    return SignfaceError(f"is a damaged C3D file: {what}", file=file, hint="export or copy it again")


def _parameters(section: bytes, order: str, file: Path) -> dict[str, dict[str, _Parameter]]:
    """Groups of parameters by name; every record lies inside the section, or SignfaceError."""
    names: dict[int, str] = {}
    loose: list[tuple[int, str, _Parameter]] = []
    at = 4
    while True:
        if at + 2 > len(section):
            raise _damaged(file, "its parameters do not end")
        length, group = struct.unpack_from("<bb", section, at)
        length = abs(length)
        if length == 0 or group == 0:
            break
        name_end = at + 2 + length
        if name_end + 2 > len(section):
            raise _damaged(file, "a parameter's name lies outside it")
        name = section[at + 2 : name_end].decode("latin-1").strip().upper()
        if not name or any(ord(letter) < 32 or ord(letter) > 126 for letter in name):
            raise _damaged(file, "a parameter has no readable name")
        (offset,) = struct.unpack_from(order + "H", section, name_end)
        here = name_end + 2
        if group < 0:
            if here + 1 > len(section) or here + 1 + section[here] > len(section):
                raise _damaged(file, "a group's description lies outside it")
            end = here + 1 + section[here]
            if -group in names:
                raise _damaged(file, "two groups have one number")
            names[-group] = name
        else:
            if here + 2 > len(section):
                raise _damaged(file, f"the parameter {name} lies outside it")
            (kind, count) = struct.unpack_from("<bB", section, here)
            if kind not in (-1, 1, 2, 4) or count > 7 or here + 2 + count > len(section):
                raise _damaged(file, f"the parameter {name} is of no known type")
            dimensions = tuple(section[here + 2 : here + 2 + count])
            size = abs(kind)
            for extent in dimensions:
                size *= extent
            begin = here + 2 + count
            if begin + size + 1 > len(section) or begin + size + 1 + section[begin + size] > len(section):
                raise _damaged(file, f"the parameter {name} lies outside it")
            end = begin + size + 1 + section[begin + size]
            loose.append((group, name, _Parameter(kind, dimensions, section[begin : begin + size])))
        if offset == 0:
            break
        following = name_end + offset
        if following < end:
            raise _damaged(file, f"the parameter {name} overlaps the next")
        at = following
    groups: dict[str, dict[str, _Parameter]] = {name: {} for name in names.values()}
    for group, name, parameter in loose:
        if group not in names:
            raise _damaged(file, f"the parameter {name} belongs to no group")
        groups[names[group]][name] = parameter
    return groups


def check_structure(file: Path) -> None:
    """Check that a file is a C3D file whose header, parameters and data lie inside it.

    Raises
    ------
    SignfaceError
        It is no C3D file, or damaged or cut short; the message says where.
    """
    try:
        size = file.stat().st_size
        with file.open("rb") as stream:
            header = stream.read(BLOCK)
            if len(header) < 2 or header[1] != MAGIC or header[0] < 2:
                raise SignfaceError("is no C3D file", file=file, hint="export the recording as C3D")
            stream.seek((header[0] - 1) * BLOCK)
            start = stream.read(4)
            blocks = start[2] if len(start) == 4 else 0
            stream.seek((header[0] - 1) * BLOCK)
            section = stream.read(max(blocks, 1) * BLOCK if blocks else 255 * BLOCK)
    except OSError as error:
        raise SignfaceError(f"cannot be read ({error.strerror})", file=file) from error
    if len(header) < BLOCK or len(start) < 4 or len(section) < BLOCK:
        raise _damaged(file, "it is cut short in its header")
    order = BYTE_ORDER.get(start[3])
    if order is None:
        raise _damaged(file, "its processor type is unknown")
    _check_data(file, size, header, _parameters(section, order, file), order)


def _number(parameter: _Parameter | None, order: str) -> int | None:
    """The first value of an integer parameter, unsigned."""
    if parameter is None or parameter.kind not in (1, 2) or not parameter.content:
        return None
    if parameter.kind == 1:
        return parameter.content[0]
    return int(struct.unpack_from(order + "H", parameter.content)[0])


def _check_data(file: Path, size: int, header: bytes, groups: dict[str, dict[str, _Parameter]], order: str) -> None:
    """Check that the data section holds as many frames, points and analog samples as the header declares."""
    points, analog_per_frame, first, last = struct.unpack_from(order + "HHHH", header, 2)
    scale = struct.unpack_from(order + "f", header, 12)[0]
    data_block, analog_samples = struct.unpack_from(order + "HH", header, 16)
    point = groups.get("POINT")
    if point is None:
        raise SignfaceError("the C3D file has no points", file=file, hint="export the trajectories with it")
    declared = _number(point.get("USED"), order)
    if declared is not None and declared != points:
        raise _damaged(file, f"its header declares {points} points and its parameters {declared}")
    if points == 0:
        raise SignfaceError("the C3D file has no points", file=file, hint="export the trajectories with it")
    if not scale == scale or scale == 0:
        raise _damaged(file, "its scale is not a number")
    if data_block < 2:
        raise _damaged(file, "its data have no place")
    word = 4 if scale < 0 else 2
    frame = (points * 4 + analog_per_frame) * word
    frames = last - first + 1
    if frames < 1:
        raise SignfaceError("the C3D file has no frames", file=file, hint="export the trajectories with it")
    room = size - (data_block - 1) * BLOCK
    if room < frames * frame:
        raise _damaged(file, f"it ends after {max(0, room // frame)} of {frames} frames")
