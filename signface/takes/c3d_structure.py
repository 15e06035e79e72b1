"""Whether a C3D file is whole, looked at before ezc3d opens it.

ezc3d trusts the counts and offsets that a file declares, and can crash the whole process on a damaged one. This
walks the header and the parameter section by the C3D User Guide (c3d.org) and checks that everything declared lies
inside the file.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from pathlib import Path

from signface.errors import SignfaceError

BLOCK = 512
MAGIC = 0x50
CHARACTERS = -1
MOST_DIMENSIONS, LONGEST_DESCRIPTION = 7, 127
DEC = 85
#: Processor byte of the parameter section: Intel (little endian), DEC (VAX floats), SGI/MIPS (big endian).
BYTE_ORDER = {84: "<", DEC: "<", 86: ">"}

#: Numbers that ezc3d takes the first value of without looking whether there is one.
NEEDED = {
    "POINT": ("USED", "SCALE", "RATE", "FRAMES"),
    "ANALOG": ("USED", "RATE", "GEN_SCALE"),
    "ROTATION": ("USED", "RATE", "RATIO", "DATA_START"),
}


@dataclass(frozen=True)
class _Parameter:
    kind: int  # CHARACTERS, 1 bytes, 2 16-bit integers, 4 32-bit floats
    dimensions: tuple[int, ...]
    content: bytes


def _damaged(file: Path, what: str) -> SignfaceError:
    return SignfaceError(f"is a damaged C3D file: {what}", file=file, hint="export or copy it again")


def _parameters(section: bytes, order: str, file: Path) -> dict[str, dict[str, _Parameter]]:
    """Groups of parameters by name; every record lies inside the section, or SignfaceError."""
    names: dict[int, str] = {}
    found: list[tuple[int, str, _Parameter]] = []
    at = 4
    while True:
        if at + 2 > len(section):
            raise _damaged(file, "its parameters do not end")
        length, group = struct.unpack_from("<bb", section, at)
        if length == 0:
            break
        name_end = at + 2 + abs(length)
        if name_end + 3 > len(section) or group == 0:
            raise _damaged(file, "a parameter lies outside it")
        name = section[at + 2 : name_end].decode("latin-1").strip().upper()
        if not name or not name.isprintable():
            raise _damaged(file, "a parameter has no readable name")
        (offset,) = struct.unpack_from(order + "H", section, name_end)
        if group < 0:
            end = name_end + 2
            if names.setdefault(-group, name) != name:
                raise _damaged(file, "two groups have one number")
        else:
            parameter, end = _parameter(section, name_end + 2, name, file)
            found.append((group, name, parameter))
        if end >= len(section) or end + 1 + section[end] > len(section) or section[end] > LONGEST_DESCRIPTION:
            raise _damaged(file, f"the description of {name} lies outside it")
        if offset == 0:
            break
        at = name_end + offset
        if at != end + 1 + section[end]:
            raise _damaged(file, f"{name} is longer or shorter than it declares")
    groups: dict[str, dict[str, _Parameter]] = {name: {} for name in names.values()}
    for group, name, parameter in found:
        if group not in names:
            raise _damaged(file, f"the parameter {name} belongs to no group")
        groups[names[group]][name] = parameter
    return groups


def _parameter(section: bytes, at: int, name: str, file: Path) -> tuple[_Parameter, int]:
    """The parameter whose type stands at `at`, and where it ends (before its description)."""
    kind, count = struct.unpack_from("<bB", section, at) if at + 2 <= len(section) else (0, 0)
    begin = at + 2 + count
    if kind not in (CHARACTERS, 1, 2, 4) or count > MOST_DIMENSIONS or begin > len(section):
        raise _damaged(file, f"the parameter {name} is of no known type")
    if kind == CHARACTERS and count == 0:
        raise _damaged(file, f"the text of {name} has no length")
    dimensions = tuple(section[at + 2 : begin])
    end = begin + abs(kind) * math.prod(dimensions)
    if end > len(section):
        raise _damaged(file, f"the parameter {name} lies outside it")
    return _Parameter(kind, dimensions, section[begin:end]), end


def check_structure(file: Path) -> None:
    """Check that a file is a C3D file whose header, parameters and data lie inside it.

    Raises
    ------
    SignfaceError
        It is no C3D file, or it has no points, or it is damaged or cut short; the message says where.
    """
    try:
        size = file.stat().st_size
        with file.open("rb") as stream:
            header = stream.read(BLOCK)
            if len(header) < 2 or header[1] != MAGIC or header[0] < 2:
                raise SignfaceError("is no C3D file", file=file, hint="export the recording as C3D")
            stream.seek((header[0] - 1) * BLOCK)
            section = stream.read(255 * BLOCK)  # no parameter section is longer
    except OSError as error:
        raise SignfaceError(f"cannot be read ({error.strerror})", file=file) from error
    if len(header) < BLOCK or len(section) < BLOCK:
        raise _damaged(file, "it is cut short in its header")
    order = BYTE_ORDER.get(section[3])
    if order is None:
        raise _damaged(file, "its processor type is unknown")
    groups = _parameters(section, order, file)
    if "POINT" not in groups:
        raise SignfaceError("the C3D file has no points", file=file, hint="export the trajectories with it")
    for group, names in NEEDED.items():
        for name in names:
            parameter = groups.get(group, {}).get(name)
            if parameter is not None and (not parameter.content or parameter.kind not in (2, 4)):
                raise _damaged(file, f"{group}:{name} is empty or no number")
    _check_data(file, size, header, groups, _Numbers(order, dec=section[3] == DEC))


@dataclass(frozen=True)
class _Numbers:
    """Reads numbers as the file's processor wrote them."""

    order: str
    dec: bool

    def word(self, content: bytes, at: int = 0) -> int:
        """An unsigned 16-bit integer."""
        return int(struct.unpack_from(self.order + "H", content, at)[0])

    def real(self, content: bytes, at: int = 0) -> float:
        """A 32-bit float; DEC's has its words swapped and counts its exponent two higher."""
        if self.dec:
            low, high = struct.unpack_from("<HH", content, at)
            return float(struct.unpack("<f", struct.pack("<HH", high, low))[0]) / 4
        return float(struct.unpack_from(self.order + "f", content, at)[0])

    def first(self, parameter: _Parameter | None, default: float = 0.0) -> float:
        """The first value of a numeric parameter."""
        if parameter is None:
            return default
        return float(self.word(parameter.content)) if parameter.kind == 2 else self.real(parameter.content)


def _values(group: dict[str, _Parameter], name: str) -> int:
    """How many values a parameter and its continuations (`SCALE2`, ...) hold."""
    total, number = 0, 1
    while (parameter := group.get(name if number == 1 else f"{name}{number}")) is not None:
        total += math.prod(parameter.dimensions)
        number += 1
    return total


def _check_data(
    file: Path, size: int, header: bytes, groups: dict[str, dict[str, _Parameter]], numbers: _Numbers
) -> None:
    """Check that the data section has room for the frames, points and analog samples that are declared."""
    points, analog_in_header, first, last = (numbers.word(header, at) for at in (2, 4, 6, 8))
    scale, data_block = numbers.real(header, 12), numbers.word(header, 16)
    point, analog = groups["POINT"], groups.get("ANALOG", {})
    used = numbers.first(point.get("USED"), points)
    if points == 0 or used == 0:
        raise SignfaceError("the C3D file has no points", file=file, hint="export the trajectories with it")
    if used != points:
        raise _damaged(file, f"its header declares {points} points and its parameters {used:g}")
    if not math.isfinite(scale) or scale == 0 or data_block < 2:
        raise _damaged(file, "its data have no scale or no place")
    rate, analog_rate = numbers.first(point.get("RATE")), numbers.first(analog.get("RATE"))
    ratio = analog_rate / rate if rate > 0 else 0.0
    channels = numbers.first(analog.get("USED"))
    if not (math.isfinite(rate) and math.isfinite(analog_rate) and 0 <= ratio <= 65535 and 0 <= channels <= 65535):
        raise _damaged(file, "its rates are not numbers")
    if channels and min(_values(analog, "SCALE"), _values(analog, "OFFSET")) < channels:
        raise _damaged(file, f"its {channels:g} analog channels have no scale or no offset")
    frames = last - first + 1 if first else last
    declared = numbers.first(point.get("FRAMES"))
    if 0 < declared < 65535 or (declared > 65535 and declared == int(declared)):
        frames = int(declared)
    if frames < 1:
        raise SignfaceError("the C3D file has no frames", file=file, hint="export the trajectories with it")
    word = 4 if scale < 0 else 2
    frame = (points * 4 + max(analog_in_header, int(channels) * int(ratio))) * word
    room = size - (data_block - 1) * BLOCK
    if room < frames * frame:
        raise _damaged(file, f"it ends after {max(0, room // frame)} of {frames} frames")
    _check_rotations(file, size, groups.get("ROTATION", {}), numbers, frames)


def _check_rotations(file: Path, size: int, group: dict[str, _Parameter], numbers: _Numbers, frames: int) -> None:
    """Check that the rotations of segments (newer C3D files), which follow the points, lie inside the file."""
    used, ratio, block = (numbers.first(group.get(name)) for name in ("USED", "RATIO", "DATA_START"))
    if used == 0:
        return
    if not (math.isfinite(used) and math.isfinite(ratio) and math.isfinite(block)):
        raise _damaged(file, "its rotations are not declared in numbers")
    numbers_in_a_rotation = 17  # a 4 x 4 matrix and how reliable it is
    if size - (block - 1) * BLOCK < used * max(ratio, 1.0) * frames * numbers_in_a_rotation * 4:
        raise _damaged(file, "it ends before its rotations do")
