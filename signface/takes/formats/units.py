"""Units of length: every reader turns what it finds into millimetres here.

- `millimetres_per`: the factor of a named unit.
- `unit_factor`: the factor of the unit that a file names (or does not), with a note for the history.
- `in_millimetres`: a reader of positions made one of millimetres.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from signface.errors import SignfaceError
from signface.takes.formats.doubts import doubt
from signface.takes.formats.missing import mark_missing

#: Millimetres in one of each unit, by the spellings that motion-capture software writes.
MILLIMETRES = {
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres", "mms"), 1.0),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres", "cms"), 10.0),
    **dict.fromkeys(("dm", "decimeter", "decimeters", "decimetre", "decimetres"), 100.0),
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres", "ms"), 1000.0),
    **dict.fromkeys(("um", "µm", "micrometer", "micrometers", "micrometre", "micrometres"), 0.001),
    **dict.fromkeys(("in", "inch", "inches"), 25.4),
    **dict.fromkeys(("ft", "foot", "feet"), 304.8),
}

#: A cloud of markers (on a face, a head or a whole body) is narrower than this in metres, then in centimetres.
WIDEST_IN_METRES, WIDEST_IN_CENTIMETRES = 4.0, 45.0

#: A face, or a cloud that has one, is neither narrower nor wider (mm).
NARROWEST, WIDEST = 10.0, 20000.0

#: Some so many frames, evenly taken, tell the width of the cloud.
SAMPLE = 300


def millimetres_per(unit: str) -> float:
    """Millimetres in one `unit` ("mm", "cm", "m", "inches" and the like, in any case).

    Raises
    ------
    SignfaceError
        The unit is not one of length.
    """
    factor = MILLIMETRES.get(unit.strip().strip(".").lower())
    if factor is None:
        raise SignfaceError(f"the unit of length {unit.strip()[:20]!r} is unknown", hint="give one of mm, cm, m, in")
    return factor


def extent(positions: np.ndarray) -> float:
    """Width of the marker cloud: the median over frames of the diagonal of its bounding box, in its own unit.

    Parameters
    ----------
    positions : (F, M, 3) array
        NaN where a marker is missing.

    Returns
    -------
    float
        NaN when no frame shows two markers.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # frames without any marker
        sides = np.nanmax(positions, axis=1, initial=-np.inf) - np.nanmin(positions, axis=1, initial=np.inf)
    diagonals = np.linalg.norm(sides, axis=1)
    seen = (np.isfinite(positions).all(axis=2).sum(axis=1) > 1) & np.isfinite(diagonals)
    return float(np.median(diagonals[seen])) if seen.any() else float("nan")


def inferred_unit(positions: np.ndarray) -> str:
    """The unit that makes the marker cloud as wide as a face (or a body) can be.

    A face in metres is some 0.2 wide, in centimetres 20, in millimetres 200; a whole body is 2 in metres.
    A cloud without extent is taken as millimetres.
    """
    width = extent(positions)
    if not np.isfinite(width) or width == 0:
        return "mm"
    return "m" if width < WIDEST_IN_METRES else "cm" if width < WIDEST_IN_CENTIMETRES else "mm"


def unit_factor(
    in_file: str | Sequence[str] | None, given: str | None, *, markers: int, sample: Callable[[], np.ndarray]
) -> tuple[float | np.ndarray, str]:
    """What positions are to be multiplied with to be millimetres, and a note that says from which unit.

    Parameters
    ----------
    in_file : str or sequence of str, optional
        The unit that the file names: one for all, or one for each marker. Empty or None when it names none.
    given : str, optional
        The unit that the user gives; it has the last word.
    markers : int
        How many there are.
    sample : callable
        Gives (F, M, 3) positions of some frames, in the file's unit, from whose width it is inferred.

    Returns
    -------
    (float or (M, 1) array, str)
        The factor; "unit m", "unit mm (given)" or "unit mm (not in the file, from the spread)".

    Raises
    ------
    SignfaceError
        A unit is not one of length.
    """
    if given is not None:
        return millimetres_per(given), f"unit {given} (given)"
    units = [in_file] if isinstance(in_file, str) else list(in_file or ())
    units = [unit.strip() for unit in units]
    named = [unit for unit in units if unit]
    if not named:
        unit = inferred_unit(sample())
        return millimetres_per(unit), f"unit {unit} (not in the file, from the spread of the markers)"
    if len(units) == 1 or len(set(unit.lower() for unit in named)) == 1:
        return millimetres_per(named[0]), f"unit {named[0]}"
    each = [unit or named[0] for unit in units[:markers]]
    each += [each[-1]] * (markers - len(each))
    factors = np.array([millimetres_per(unit) for unit in each])
    return factors[:, None], f"unit {', '.join(sorted(set(each)))} (one per marker)"


def in_millimetres(
    raw: Callable[[int, int, int], np.ndarray],
    frames: int,
    in_file: str | Sequence[str] | None,
    given: str | None,
    *,
    markers: int,
    file: Path,
) -> tuple[Callable[[int, int, int], np.ndarray], str]:
    """`raw(begin, end, step)`, which reads positions in the file's unit, made to read millimetres; and a note of it.

    Missing markers (`signface.takes.formats.missing`) come as NaN.

    A unit that is not one of length is a `SignfaceError` that names the file.
    """
    step = max(1, frames // SAMPLE)

    def seen(begin: int, end: int, step: int) -> np.ndarray:
        return mark_missing(raw(begin, end, step))

    try:
        factor, note = unit_factor(in_file, given, markers=markers, sample=lambda: seen(0, frames, step))
    except SignfaceError as error:
        raise error.at(file) from error
    width = extent(seen(0, frames, step) * factor) if given is None and markers > 2 else math.nan
    if 0 < width < NARROWEST or width > WIDEST:
        size = "small" if width < NARROWEST else "large"
        note += "; " + doubt(
            file, f"its markers are {width:.3g} mm wide, too {size} for a face: give the unit with --unit"
        )
    return lambda begin, end, step: seen(begin, end, step) * factor, note
