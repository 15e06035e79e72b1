"""Where the solved face lies far from the markers, so that what was found there cannot be trusted.

- `Stretch`: some seconds of a take and how far off the face is in them.
- `untrusted`: the stretches that cannot be trusted.
- `worst`: the worst stretch of a take, trusted or not.
- `residual_words`: the median residual and the worst stretch, for a summary.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from signface.frames import bridge, long_enough, runs

#: A residual is too great beyond this (mm), and this many times the take's median: glued markers lie up to 1.2 mm off
#: at the height of an expression (median 0.2), landmarks of films up to 10 (median 2 to 5), each take with noise of its
#: own. Beyond the second length it is whatever is usual: then most of the take may be wrong.
TOO_FAR_MM, TOO_FAR, EVER_MM = 2.5, 4.0, 20.0
#: Moments nearer than this are one stretch; a shorter one is none; a longer one without a solved face is one (s).
JOINED_S, SHORTEST_S, UNSOLVED_S = 0.1, 0.02, 0.25
#: The worst stretch of a take without untrusted ones is as long as this (s).
WORST_S = 0.5


@dataclass(frozen=True)
class Stretch:
    """Some seconds of a take.

    Parameters
    ----------
    start_s, end_s : float
        On the take's own clock.
    residual_mm : float
        The greatest residual in it; NaN where no face could be solved.

    Examples
    --------
    >>> print(Stretch(2.0, 3.5, 12.345))
    12.35 mm at 2.000 to 3.500 s
    """

    start_s: float
    end_s: float
    residual_mm: float

    def __str__(self) -> str:
        size = f"{self.residual_mm:.2f} mm" if np.isfinite(self.residual_mm) else "no face"
        return f"{size} at {self.start_s:.3f} to {self.end_s:.3f} s"


def untrusted(residual: np.ndarray, rate: float, start: float = 0.0) -> list[Stretch]:
    """The stretches in which the face lies too far from the markers, or could not be solved for a while.

    Parameters
    ----------
    residual : (F,) array
        Millimetres; NaN where no face was solved. NaN throughout, as for weights of a phone, says nothing.
    rate, start : float
        As of `signface.descriptors.Descriptors`.

    Examples
    --------
    >>> residual = np.full(1000, 0.3)
    >>> residual[400:700] = 12.0
    >>> [str(stretch) for stretch in untrusted(residual, 200.0)]
    ['12.00 mm at 2.000 to 3.500 s']
    """
    known = np.isfinite(residual)
    if not known.any():
        return []
    limit = max(TOO_FAR_MM, min(TOO_FAR * float(np.median(residual[known])), EVER_MM))
    far = bridge(np.nan_to_num(residual) > limit, round(JOINED_S * rate))
    lost = long_enough(~known, UNSOLVED_S * rate)
    spans = [*runs(long_enough(far, min(SHORTEST_S * rate, 2))), *runs(lost & ~far)]
    return sorted((_stretch(residual, begin, end, rate, start) for begin, end in spans), key=lambda one: one.start_s)


def worst(residual: np.ndarray, rate: float, start: float = 0.0) -> Stretch | None:
    """The untrusted stretch of the greatest residual, or else the half second of the greatest mean; None for none."""
    known = np.isfinite(residual)
    if not known.any():
        return None
    far = [one for one in untrusted(residual, rate, start) if np.isfinite(one.residual_mm)]
    if far:
        return max(far, key=lambda one: one.residual_mm)
    length = min(len(residual), max(1, round(WORST_S * rate)))
    total = np.convolve(np.nan_to_num(residual), np.ones(length), mode="valid")
    count = np.convolve(known, np.ones(length), mode="valid")
    begin = int(np.argmax(np.where(count > length / 2, total / np.maximum(count, 1), -1.0)))
    return _stretch(residual, begin, begin + length, rate, start)


def residual_words(residual: np.ndarray, rate: float, start: float = 0.0) -> str:
    """The median residual, and how far off the face is at worst and when; `unknown` where nothing was solved.

    Examples
    --------
    >>> residual = np.full(1000, 0.3)
    >>> residual[400:700] = 12.0
    >>> residual_words(residual, 200.0)
    'median residual 0.30 mm, worst 12.00 mm at 2.000 to 3.500 s'
    """
    at_worst = worst(residual, rate, start)
    if at_worst is None:
        return "median residual unknown"
    return f"median residual {np.median(residual[np.isfinite(residual)]):.2f} mm, worst {at_worst}"


def _stretch(residual: np.ndarray, begin: int, end: int, rate: float, start: float) -> Stretch:
    inside = residual[begin:end]
    most = float(np.nanmax(inside)) if np.isfinite(inside).any() else float("nan")
    return Stretch(start + begin / rate, start + end / rate, most)
