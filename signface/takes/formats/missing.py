"""How programs write a marker that was not seen, in words and in numbers.

- `MISSING`: what stands in the cells of text.
- `mark_missing`: positions that stand for none, as NaN.
"""

from __future__ import annotations

import numpy as np

_WORDS = {"nan", "null", "none", "na", "n/a", "n.a.", "nil", "missing", "undefined", "<na>", "<null>", "#na", "#n/a"}
_WORDS |= {"#n/a n/a", "#value!", "#num!", "#div/0!", "#ref!", "#null!", "#name?", "nan(ind)", "nan(snan)"}
_WORDS |= {"1.#ind", "1.#qnan", "1.#snan", "1.#inf", "inf", "infinity"}

#: What stands in the cells of a missing marker, as programs and spreadsheets write it.
MISSING = {"", "-", "--", "---", ".", "..", "...", "?", "*", "x"}
MISSING |= {form(sign + word) for sign in ("", "-", "+") for word in _WORDS for form in (str, str.upper, str.title)}
MISSING |= {"NaN", "-NaN", "+NaN", "NaN(ind)", "-NaN(ind)"}

#: Where x, y and z are all one of these, up to their sign, they are a program's word for none, not a place.
SENTINELS: tuple[float, ...] = (999.0, 999.9, 999.99, 999.999, 9999.0, 9999.9, 9999.99, 9999.999)
SENTINELS += (
    99999.0,
    99999.9,
    99999.99,
    999999.0,
    9999999.0,
    99999999.0,
    999999999.0,
    9999999999.0,
    32767.0,
    32768.0,
    1e6,
    1e7,
    1e8,
    1e9,
    1e10,
)
#: Beyond this, in any unit, nothing is a place (float's largest number and its like).
FARTHEST = 1e12


def mark_missing(positions: np.ndarray) -> np.ndarray:
    """The positions, changed in place: NaN where a marker is missing.

    A marker is missing where a coordinate is not finite or beyond reach, where all three are exactly zero, and where
    all three are one of the numbers that stand for none (-9999, 99999.9 ...).

    Parameters
    ----------
    positions : (..., 3) float64 array
        As the file has them, in its own unit.

    Examples
    --------
    >>> mark_missing(np.array([[1.0, 2, 3], [0, 0, 0], [-9999, -9999, -9999], [0, 0, 1]])).tolist()
    [[1.0, 2.0, 3.0], [nan, nan, nan], [nan, nan, nan], [0.0, 0.0, 1.0]]
    """
    x, y, z = (positions[..., axis] for axis in range(3))
    with np.errstate(invalid="ignore"):
        missing = ~np.isfinite(positions).all(axis=-1) | (np.abs(positions) > FARTHEST).any(axis=-1)
        alike = np.abs(x) == np.abs(y)
        alike &= np.abs(y) == np.abs(z)
        if alike.any():
            size = np.abs(x[alike])
            near = np.searchsorted(_SORTED, size * (1 - 1e-6))
            known = np.abs(_SORTED[np.minimum(near, len(_SORTED) - 1)] - size) <= 1e-6 * size
            missing[alike] |= (size == 0) | known
    positions[missing] = np.nan
    return positions


_SORTED = np.sort(np.array(SENTINELS))
