"""C3D, the binary format of motion-capture systems, through ezc3d.

- `read_c3d`: a file to a `Take`.
- `write_c3d`: a `Take` to a file.

The format is described in the C3D User Guide (c3d.org): a header block of 512 bytes, a parameter section of groups
(POINT holds labels, unit, rate), and the data section, frame by frame x, y, z and the residual of each point.
"""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from signface.errors import SignfaceError
from signface.files import whole_file
from signface.takes.c3d_structure import check_structure
from signface.takes.labels import clean_labels
from signface.takes.take import Take
from signface.takes.units import to_millimetres

#: Frames are counted in 16 bits; ezc3d cuts longer takes without a word.
MOST_FRAMES = 65535


def _values(group: dict[str, Any], name: str) -> list[Any]:
    """The values of a parameter and of its continuations (`LABELS`, `LABELS2`, ...: 255 entries each at most)."""
    values: list[Any] = []
    number = 1
    while (key := name if number == 1 else f"{name}{number}") in group:
        value = group[key].get("value", [])
        values.extend(np.ravel(value).tolist() if isinstance(value, np.ndarray) else value)
        number += 1
    return values


def _rate(point: dict[str, Any], header: dict[str, Any]) -> float:
    """Hz: POINT:RATE, or the header's where that is absent; 0 when neither is a rate."""
    rates = [*_values(point, "RATE")[:1], header["frame_rate"]]
    for rate in rates:
        if isinstance(rate, int | float) and math.isfinite(rate) and rate > 0:
            return float(rate)
    return 0.0


def _first_frame(parameters: dict[str, Any], header: dict[str, Any]) -> int:
    """Number of frames before the first one of the file: TRIAL:ACTUAL_START_FIELD (two words), or the header's."""
    words = _values(parameters.get("TRIAL", {}), "ACTUAL_START_FIELD")
    if words and all(isinstance(word, int | float) and math.isfinite(word) for word in words):
        low, high = int(words[0]) & 0xFFFF, int(words[1]) & 0xFFFF if len(words) > 1 else 0
        first = low + (high << 16)
        if first >= 1:
            return first - 1
    return max(0, int(header["first_frame"]))


def read_c3d(path: str | PathLike[str], *, unit: str | None = None) -> Take:
    """Read a C3D file.

    A point is missing where its residual is negative, where its coordinates are not finite, or where all three are
    exactly zero (several exporters write that instead of a residual). Unlabelled points (`*12`) and points that are
    missing throughout are ignored with a note. Time 0 is frame 1 of the trial, so a file cut from a longer one
    starts later.

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
    check_structure(file)
    import ezc3d

    try:
        content = ezc3d.c3d(str(file))
    except Exception as error:  # ezc3d lets C++ errors of every kind through
        raise SignfaceError("is a C3D file that cannot be read", file=file, hint="export it again") from error
    parameters, header = content["parameters"], content["header"]["points"]
    point = parameters["POINT"]
    points = content["data"]["points"]  # (4, M, F)
    if points.size == 0:
        raise SignfaceError("the C3D file has no points", file=file, hint="export the trajectories with it")
    rate = _rate(point, header)
    if rate == 0:
        raise SignfaceError("the C3D file has the rate 0", file=file, hint="set POINT:RATE to its frames per second")
    labels = [str(label) for label in _values(point, "LABELS")]
    labels += [""] * (points.shape[1] - len(labels))
    kept, names, notes = clean_labels(labels[: points.shape[1]])
    if not kept:
        raise SignfaceError("none of the points in the C3D file has a label", file=file, hint="label the markers")
    positions = np.ascontiguousarray(points[:3, kept].transpose(2, 1, 0))
    residuals = content["data"]["meta_points"]["residuals"]
    missing = residuals[0][kept].T < 0 if residuals.size else np.zeros(positions.shape[:2], dtype=bool)
    missing |= (positions == 0).all(axis=2)
    positions[missing] = np.nan
    units = [str(word) for word in _values(point, "UNITS")]
    try:
        if len(units) > 1:
            units += [units[-1]] * (points.shape[1] - len(units))
            units = [units[index] for index in kept]
        positions, note = to_millimetres(positions, units, unit)
    except SignfaceError as error:
        raise SignfaceError(error.problem, file=file, hint=error.hint) from error
    return Take(
        positions,
        tuple(names),
        rate,
        start=_first_frame(parameters, header) / rate,
        name=file.stem,
        history=(f"read {file.name} (C3D)", note, *notes),
    )


def write_c3d(take: Take, path: str | PathLike[str]) -> None:
    """Write a take as C3D: millimetres, 32-bit floats, a residual of -1 where a marker is missing.

    The same take gives the same bytes. Coordinates are rounded to 32-bit floats (0.0001 mm for a head two metres
    from the origin), and the start to a whole frame, as the format has it.

    Raises
    ------
    SignfaceError
        The ending is not .c3d, the take starts before time 0 or has more frames than the format counts (65535), or
        the file cannot be written.
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
