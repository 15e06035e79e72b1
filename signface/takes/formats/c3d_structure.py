"""The structure of a C3D file: what it declares, and whether all of that lies inside it.

- `read_structure`: walks the header and the parameter section by the C3D User Guide (c3d.org).
- `Structure`: the parameters, and where the frames are and how they are written.

Nothing that a file declares is trusted before it is checked: a damaged file is refused, and can do no harm.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from pathlib import Path

from signface.errors import SignfaceError
from signface.files import reading
from signface.takes.formats.doubts import doubt

BLOCK = 512
MAGIC = 0x50
CHARACTERS = -1
MOST_DIMENSIONS, LONGEST_DESCRIPTION = 7, 127
DEC = 85
#: Processor byte of the parameter section: Intel (little endian), DEC (VAX floats), SGI/MIPS (big endian).
BYTE_ORDER = {84: "<", DEC: "<", 86: ">"}

#: Frames are counted in 16 bits in the header; longer takes have their length among the parameters.
MOST_FRAMES = 65535

#: Parameters that are numbers, and not empty, in every whole file that has them.
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


@dataclass(frozen=True)
class Structure:
    """What a whole C3D file declares.

    Parameters
    ----------
    points, frames : int
        How many there are.
    first : int
        Number of frames of the trial before the first one of the file.
    rate : float
        Frames per second by POINT:RATE, or by the header where that is absent; 0 when neither is a rate.
    labels, units : list of str
        POINT:LABELS and POINT:UNITS with their continuations; they may be fewer than the points.
    offset : int
        The byte at which the data begin.
    words : int
        Numbers in a frame: four for each point, then the analog samples.
    scale : float
        Positive: coordinates are 16-bit integers, to be multiplied by it; negative: they are 32-bit floats.
    order : str
        `<` or `>`, the order of bytes.
    dec : bool
        Whether floats are DEC's: words swapped, and four times as large.
    """

    points: int
    frames: int
    first: int
    rate: float
    labels: list[str]
    units: list[str]
    offset: int
    words: int
    scale: float
    order: str
    dec: bool


def _damaged(file: Path, what: str) -> SignfaceError:
    return SignfaceError(f"is a damaged C3D file: {what}", file=file, hint="export or copy it again")


def _parameters(section: bytes, order: str, file: Path) -> dict[str, dict[str, _Parameter]]:
    """Groups of parameters by name; every record lies inside the section, or SignfaceError."""
    names: dict[int, str] = {}
    parameters: list[tuple[int, str, _Parameter]] = []
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
            parameters.append((group, name, parameter))
        if end >= len(section) or end + 1 + section[end] > len(section) or section[end] > LONGEST_DESCRIPTION:
            raise _damaged(file, f"the description of {name} lies outside it")
        if offset == 0:
            break
        at = name_end + offset
        if at != end + 1 + section[end]:
            raise _damaged(file, f"{name} is longer or shorter than it declares")
    groups: dict[str, dict[str, _Parameter]] = {name: {} for name in names.values()}
    for group, name, parameter in parameters:
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


def read_structure(file: Path) -> Structure:
    """What a C3D file declares, once it is known that its header, parameters and data lie inside it.

    Raises
    ------
    SignfaceError
        It is no C3D file, or it has no points, or it is damaged or cut short; the message says where.
    """
    with reading(file), file.open("rb") as stream:
        size = file.stat().st_size
        header = stream.read(BLOCK)
        if len(header) < 2 or header[1] != MAGIC or header[0] < 2:
            raise SignfaceError("is no C3D file", file=file, hint="export the recording as C3D")
        stream.seek((header[0] - 1) * BLOCK)
        section = stream.read(255 * BLOCK)  # no parameter section is longer
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
    return _checked(file, size, header, groups, _Numbers(order, dec=section[3] == DEC))


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


def _parts(group: dict[str, _Parameter], name: str) -> list[_Parameter]:
    """A parameter and its continuations (`LABELS`, `LABELS2`, ...: 255 entries each at most)."""
    parts: list[_Parameter] = []
    while (parameter := group.get(f"{name}{len(parts) + 1}" if parts else name)) is not None:
        parts.append(parameter)
    return parts


def _texts(group: dict[str, _Parameter], name: str) -> list[str]:
    """The texts of a parameter and its continuations."""
    texts = []
    for parameter in _parts(group, name):
        if parameter.kind != CHARACTERS:
            continue
        width = parameter.dimensions[0]
        for at in range(0, len(parameter.content), max(width, 1)):
            entry = parameter.content[at : at + width]
            try:
                text = entry.decode("utf-8")
            except UnicodeDecodeError:
                text = entry.decode("latin-1")
            texts.append(text.partition("\0")[0].strip())
    return texts


def _field(trial: dict[str, _Parameter], name: str, numbers: _Numbers) -> int:
    """A frame number of TRIAL, in two words with the lower one first; 0 when there is none."""
    parameter = trial.get(name)
    if parameter is None or parameter.kind not in (2, 4) or not parameter.content:
        return 0
    size = abs(parameter.kind)
    ends = range(size, len(parameter.content) + 1, size)[:2]
    values = [numbers.first(_Parameter(parameter.kind, (), parameter.content[end - size : end])) for end in ends]
    if not all(math.isfinite(value) for value in values):
        return 0
    return (int(values[0]) & 0xFFFF) + ((int(values[1]) & 0xFFFF) << 16 if len(values) > 1 else 0)


def _checked(
    file: Path, size: int, header: bytes, groups: dict[str, dict[str, _Parameter]], numbers: _Numbers
) -> Structure:
    """The structure, when the data section has room for the frames, points and analog samples that are declared."""
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
    calibrated = [sum(math.prod(part.dimensions) for part in _parts(analog, name)) for name in ("SCALE", "OFFSET")]
    if channels and min(calibrated) < channels:
        raise _damaged(file, f"its {channels:g} analog channels have no scale or no offset")
    frames = last - first + 1 if first else last
    declared = numbers.first(point.get("FRAMES"))
    trial = groups.get("TRIAL", {})
    start, end = (_field(trial, name, numbers) for name in ("ACTUAL_START_FIELD", "ACTUAL_END_FIELD"))
    if 0 < declared < MOST_FRAMES or (declared > MOST_FRAMES and declared == int(declared)):
        frames = int(declared)
    elif last == MOST_FRAMES and end - start + 1 > frames and start >= 1:
        frames = end - start + 1
    if frames < 1:
        raise SignfaceError("the C3D file has no frames", file=file, hint="export the trajectories with it")
    word = 4 if scale < 0 else 2
    offset = (data_block - 1) * BLOCK
    words = points * 4 + (round(channels) * round(ratio) if "USED" in analog else analog_in_header)
    from_header = points * 4 + analog_in_header, last - first + 1 if first else last
    if words != from_header[0] or frames != from_header[1]:
        words, frames = _by_size(file, size - offset, word, (words, frames), from_header)
    if size - offset < frames * words * word:
        raise _damaged(file, f"it ends after {max(0, (size - offset) // (words * word))} of {frames} frames")
    _check_rotations(file, size, groups.get("ROTATION", {}), numbers, frames)
    rates = [*([rate] if "RATE" in point else []), numbers.real(header, 20)]
    return Structure(
        points=points,
        frames=frames,
        first=start - 1 if start >= 1 else max(0, first - 1),
        rate=next((value for value in rates if math.isfinite(value) and value > 0), 0.0),
        labels=_texts(point, "LABELS"),
        units=_texts(point, "UNITS"),
        offset=offset,
        words=words,
        scale=scale,
        order=numbers.order,
        dec=numbers.dec,
    )


def _by_size(file: Path, size: int, word: int, parameters: tuple[int, int], header: tuple[int, int]) -> tuple[int, int]:
    """Numbers a frame and frames, where parameters and header disagree: those that the size of the data bears out.

    Data are filled up to a whole block, so that what is right leaves less than one.
    """
    for words, frames in dict.fromkeys([parameters, (header[0], parameters[1]), (parameters[0], header[1]), header]):
        if frames >= 1 and 0 <= size - frames * words * word < BLOCK:
            if words != parameters[0]:
                doubt(file, f"its parameters say {parameters[0]} numbers a frame; by its size there are {words}")
            if frames != parameters[1]:
                doubt(file, f"POINT:FRAMES or TRIAL says {parameters[1]} frames; by its size there are {frames}")
            return words, frames
    return parameters


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
