"""What is counted in frames: their times, runs of them, states from curves, means over stretches of time.

- `Timed`: what has frames at times; `TimedArrays` can be cut in time.
- `runs`: where something holds without a break; `stretches`: where a value stays.
- `hysteresis`, `bridge`, `long_enough`: from a curve to the stretches in which something is on.
- `Means`: means of a signal over any stretches of time.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from signface.errors import SignfaceError

#: Where a cut falls, in frames: times that were rounded for a table must not decide.
CUT_SLACK = 1e-3


class Timed:
    """What has frames at times: `n_frames` of them, `rate` a second (Hz), the first at `start` seconds."""

    if TYPE_CHECKING:  # fields or properties of those who take this in

        @property
        def rate(self) -> float: ...

        @property
        def start(self) -> float: ...

        @property
        def name(self) -> str: ...

        @property
        def n_frames(self) -> int: ...

    @property
    def duration(self) -> float:
        """Duration in seconds: frames over rate."""
        return self.n_frames / self.rate

    @property
    def time(self) -> np.ndarray:
        """(F,) time of each frame in seconds."""
        return self.start + np.arange(self.n_frames) / self.rate

    def clamp(self, begin: int, end: int) -> tuple[int, int]:
        """What there is of the frames from `begin` to before `end`: frames beyond the first and the last are left out.

        Examples
        --------
        >>> from signface.datasets import mini_take
        >>> mini_take().clamp(1000, 2000), mini_take().clamp(5000, 6000)
        ((1000, 1184), (1184, 1184))
        """
        begin = min(max(begin, 0), self.n_frames)
        return begin, min(max(begin, end), self.n_frames)

    def frame_at(self, seconds: float) -> int:
        """Index of the frame nearest to a time in seconds.

        Raises
        ------
        SignfaceError
            The time lies outside the take.
        """
        frame = round((seconds - self.start) * self.rate) if np.isfinite(seconds) else -1
        if not 0 <= frame < self.n_frames:
            last = self.start + (self.n_frames - 1) / self.rate
            raise SignfaceError(
                f"{self.name}: the time {seconds:g} s is outside the take",
                hint=f"give a time from {self.start:.3f} to {last:.3f} s",
            )
        return frame


class TimedArrays(Timed):
    """A timed dataclass with a history, every array of which has a row for each frame."""

    if TYPE_CHECKING:

        @property
        def history(self) -> tuple[str, ...]: ...

    def between(self, start_s: float, end_s: float) -> Self:
        """The frames whose time t is `start_s <= t < end_s`, at their times: `start` becomes that of the first.

        Times count to a thousandth of a frame, so that rounded ones cut where they seem to, and neighbouring
        stretches share no frame and lose none.

        Parameters
        ----------
        start_s, end_s : float
            Seconds on the time line of the take; `-math.inf` and `math.inf` leave an end as it is.

        Raises
        ------
        SignfaceError
            No frame lies there.

        Examples
        --------
        >>> from signface.descriptors import Descriptors
        >>> take = Descriptors(np.zeros((500, 1)), ("jawOpen",), rate=100)
        >>> part = take.between(2.0, 4.5)
        >>> part.n_frames, part.start, part.history
        (250, 2.0, ('between 2 and 4.5 s',))
        """
        begin, end = (self._frame_from(seconds) for seconds in (start_s, end_s))
        if not begin < end:
            last = self.start + (self.n_frames - 1) / self.rate
            raise SignfaceError(
                f"{self.name}: no frame lies between {start_s:g} and {end_s:g} s",
                hint=f"the take goes from {self.start:.3f} to {last:.3f} s",
            )
        note = f"between {start_s:g} and {end_s:g} s"
        return self.changed(note, start=self.start + begin / self.rate, **self._rows(begin, end))

    def changed(self, operation: str, **values: object) -> Self:
        """A copy with some fields replaced and `operation` appended to its history."""
        return replace(self, history=(*self.history, operation), **values)  # type: ignore[type-var]

    def _frame_from(self, seconds: float) -> int:
        """The first frame that is not before a time; nan is after all."""
        frame = (seconds - self.start) * self.rate - CUT_SLACK
        return int(np.ceil(np.nan_to_num(min(max(frame, 0.0), self.n_frames), nan=self.n_frames)))

    def _rows(self, begin: int, end: int) -> dict[str, Any]:
        """The fields that change when only these frames stay."""
        values = {item.name: getattr(self, item.name) for item in fields(self)}  # type: ignore[arg-type]
        return {name: value[begin:end] for name, value in values.items() if isinstance(value, np.ndarray)}


def runs(mask: np.ndarray) -> np.ndarray:
    """(R, 2) first frame and frame after the last of each run of True in an (F,) bool array.

    Examples
    --------
    >>> runs(np.array([True, True, False, True])).tolist()
    [[0, 2], [3, 4]]
    """
    edges = np.diff(np.concatenate(([0], mask.astype(np.int8), [0])))
    return np.column_stack((np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)))


def stretches(values: np.ndarray) -> np.ndarray:
    """(R, 2) first frame and frame after the last of each stretch of one value in an (F,) array; together all frames.

    Examples
    --------
    >>> stretches(np.array([3, 3, 1, 1, 1, 3])).tolist()
    [[0, 2], [2, 5], [5, 6]]
    """
    changes = np.flatnonzero(values[1:] != values[:-1]) + 1
    edges = np.concatenate(([0], changes, [len(values)])) if len(values) else np.zeros(1, int)
    return np.column_stack((edges[:-1], edges[1:]))


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
        frame = time * self.rate
        inside = frame.clip(0, len(self.values))
        whole = np.minimum(inside.astype(int), len(self.values) - 1)
        share = (inside - whole)[:, None]
        total = self.integral[whole] + share * self.values[whole] / self.rate
        before, after = (frame - inside).clip(max=0)[:, None], (frame - inside).clip(min=0)[:, None]
        return total + (before * self.values[0] + after * self.values[-1]) / self.rate
