"""Recordings whose frames do not come evenly: frames that a camera dropped, clocks that tick coarsely.

- `usual_rate`: the rate at which most frames came.
- `even_frames`: positions on an even grid, nothing invented where frames are missing for long.
"""

from __future__ import annotations

import numpy as np

from signface.errors import SignfaceError

#: Where two rows are farther apart than this (s), what lies between them is missing.
LONGEST_STEP_S = 0.2

#: A rate this near to a whole number is that number: clocks of milliseconds cannot tell 16 Hz from 16.13 Hz.
WHOLE = 0.03


def usual_rate(times: np.ndarray) -> float:
    """Frames per second (Hz) of most rows, whatever was dropped between others.

    Parameters
    ----------
    times : (R,) array
        Seconds, rising.

    Raises
    ------
    SignfaceError
        Fewer than two rows, or times that do not rise, or that leap so far that more frames are lost than kept.

    Examples
    --------
    >>> usual_rate(np.array([0.0, 0.062, 0.125, 0.187, 0.5, 0.562]))
    16.0
    """
    if len(times) < 2:
        raise SignfaceError("has one frame, and a rate needs two", hint="export more of the recording")
    steps = np.diff(times)
    if not np.isfinite(times).all() or not (steps > 0).all():
        row = int(np.argmin(np.where(np.isfinite(steps), steps, -np.inf) > 0)) + 1
        raise SignfaceError(f"its times do not rise from row to row (row {row + 1})", hint="export it again")
    rate = 1 / float(np.median(steps))
    if (times[-1] - times[0]) * rate > 20 * len(times) + 1000:
        raise SignfaceError("its times leap: more frames are lost than kept", hint="record it again")
    return float(round(rate)) if abs(rate - round(rate)) <= WHOLE * rate and round(rate) > 0 else rate


def even_frames(
    times: np.ndarray, values: np.ndarray, rate: float, *, longest_s: float = LONGEST_STEP_S
) -> tuple[np.ndarray, np.ndarray]:
    """Values on an even grid that begins with the first row, by straight lines between neighbouring rows.

    Parameters
    ----------
    times : (R,) array
        Seconds, rising.
    values : (R, ...) array
        NaN where something is missing; then it is missing in the frames to both sides of the row.
    rate : float
        Frames per second of the grid.
    longest_s : float
        Frames between rows farther apart than this are NaN, but for one within half a step of a row, which has its
        values.

    Returns
    -------
    (F, ...) array
        The values at `times[0] + k / rate`.
    (F,) bool array
        Frames that are missing because no row is near.

    Examples
    --------
    >>> values, missing = even_frames(np.array([0.0, 0.15, 0.2, 0.6]), np.array([0.0, 15.0, 20.0, 60.0]), 10.0)
    >>> values.round(6).tolist(), missing.tolist()
    ([0.0, 10.0, 20.0, nan, nan, nan, 60.0], [False, False, False, True, True, True, False])
    """
    times, values = np.asarray(times, dtype=np.float64), np.asarray(values, dtype=np.float64)
    grid = times[0] + np.arange(int(np.floor((times[-1] - times[0]) * rate + 1e-6)) + 1) / rate
    after = np.clip(np.searchsorted(times, grid - 1e-9), 1, len(times) - 1)
    before = after - 1
    share = np.clip((grid - times[before]) / (times[after] - times[before]), 0.0, 1.0)
    far = times[after] - times[before] > longest_s
    share = np.where(far, np.round(share), share)
    nearest = np.where(share < 0.5, before, after)
    missing = far & (np.abs(grid - times[nearest]) > 0.5 / rate + 1e-9)
    shares = share.reshape(-1, *[1] * (values.ndim - 1))
    # A row that counts nothing must not make a frame missing: 0 times NaN is NaN.
    even = np.where(shares == 0, values[before], np.where(shares == 1, values[after], np.nan))
    mixed = (share > 0) & (share < 1)
    even[mixed] = (1 - shares[mixed]) * values[before[mixed]] + shares[mixed] * values[after[mixed]]
    even[missing] = np.nan
    return even, missing
