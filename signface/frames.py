"""What is counted in frames: runs of them, states from curves, means over stretches of time.

- `runs`: where something holds without a break.
- `hysteresis`, `bridge`, `long_enough`: from a curve to the stretches in which something is on.
- `Means`: means of a signal over any stretches of time.
"""

from __future__ import annotations

import numpy as np


def runs(mask: np.ndarray) -> np.ndarray:
    """(R, 2) first frame and frame after the last of each run of True.

    Parameters
    ----------
    mask : (F,) bool array

    Examples
    --------
    >>> runs(np.array([True, True, False, True])).tolist()
    [[0, 2], [3, 4]]
    """
    edges = np.diff(np.concatenate(([0], mask.astype(np.int8), [0])))
    return np.column_stack((np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)))


def hysteresis(signal: np.ndarray, on: float, off: float) -> np.ndarray:
    """(F,) bool: on from the frame that reaches `on` until the frame that falls under `off`. NaN is off."""
    state = np.where(signal >= on, 1, np.where(signal >= off, -1, 0))  # -1: as before
    state[np.isnan(signal)] = 0
    decided = np.flatnonzero(state >= 0)
    last = np.searchsorted(decided, np.arange(len(state)), side="right") - 1
    return np.where(last >= 0, state[decided[last.clip(min=0)]] if len(decided) else 0, 0) == 1


def bridge(active: np.ndarray, frames: int) -> np.ndarray:
    """(F,) bool with pauses shorter than `frames` filled; those at the ends are no pauses."""
    filled = active.copy()
    for start, end in runs(~active):
        if start > 0 and end < len(active) and end - start < frames:
            filled[start:end] = True
    return filled


def long_enough(active: np.ndarray, shortest: float, longest: float = np.inf) -> np.ndarray:
    """(F,) bool without stretches shorter than `shortest` or longer than `longest` frames."""
    kept = active.copy()
    for start, end in runs(active):
        if not shortest - 1e-9 <= end - start <= longest + 1e-9:
            kept[start:end] = False
    return kept


class Means:
    """Means of a signal over any stretches of time, from its running integral; the ends are held."""

    def __init__(self, values: np.ndarray, rate: float) -> None:
        self.values, self.rate = values, rate
        self.integral = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)]) / rate

    def between(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """(K, N) means of the signal from `start` to `end`, seconds from the first frame."""
        return (self._until(end) - self._until(start)) / (end - start)[:, None]

    def _until(self, time: np.ndarray) -> np.ndarray:
        place = time * self.rate
        inside = place.clip(0, len(self.values))
        whole = np.minimum(inside.astype(int), len(self.values) - 1)
        part = (inside - whole)[:, None]
        total = self.integral[whole] + part * self.values[whole] / self.rate
        before, after = (place - inside).clip(max=0)[:, None], (place - inside).clip(min=0)[:, None]
        return total + (before * self.values[0] + after * self.values[-1]) / self.rate
