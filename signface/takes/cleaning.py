"""A recording cleaned piece by piece: the markers of a layout, without gaps and jitter.

- `CleanRecording`: what `rename_to`, `fill_gaps` and `lowpass` make of a take, for any recording, however long.

A piece is cleaned with as many frames on either side as gaps and filters look at, so that it does not depend on where
it was cut. What gap filling learns from the take, it learns from frames spread evenly over all of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from signface.frames import Timed
from signface.takes.filtering import CUTOFF_HZ, filtered, note, reach
from signface.takes.gaps import LONG_S, SHORT_S, GapFiller
from signface.takes.labels import find_labels
from signface.takes.recording import PIECE, Recording, pieces
from signface.takes.take import Take

#: Goes through pieces, showing how far we are: `progress(pieces, "cleaning")`, as `signface.progress.progress`.
Progress = Callable[[Sequence[tuple[int, int]], str], Iterable[tuple[int, int]]]


def silently(items: Sequence[tuple[int, int]], what: str) -> Iterable[tuple[int, int]]:
    """The `Progress` that shows nothing."""
    return items


class CleanRecording(Timed):
    """The markers of a layout in a recording, with gaps filled and filtered; itself a `Recording`.

    Parameters
    ----------
    recording : Recording
    labels : sequence of str
        A layout's; see `signface.takes.labels.rename_to`.
    short_gap_s, long_gap_s : float
        See `signface.takes.gaps.fill_gaps`.
    cutoff_hz, filter_method
        See `signface.takes.filtering.lowpass`. With `raised-sine` every frame depends on all others: each piece costs
        the whole recording.

    Raises
    ------
    SignfaceError
        The recording does not have the markers, or a parameter is out of range.
    """

    rate: float
    start: float
    name: str
    n_frames: int

    def __init__(
        self,
        recording: Recording,
        labels: Sequence[str],
        *,
        short_gap_s: float = SHORT_S,
        long_gap_s: float = LONG_S,
        cutoff_hz: float = CUTOFF_HZ,
        filter_method: str = "butterworth",
    ) -> None:
        found, self._renamed = find_labels(recording, labels)
        self.labels, self.rate, self.start = tuple(found), recording.rate, recording.start
        self.name, self.n_frames = recording.name, recording.n_frames
        self._recording, self._cutoff_hz, self._method = recording, cutoff_hz, filter_method
        self._columns = [recording.labels.index(own) for own in found.values()]
        self._filter_note = note(self.rate, cutoff_hz, filter_method)
        self._reach = reach(self.rate, cutoff_hz, filter_method)
        self._gaps = GapFiller(_Part(recording, self._columns), short_s=short_gap_s, long_s=long_gap_s)
        self._kept: tuple[int, int, np.ndarray] = (0, 0, np.empty((0, len(found), 3)))

    @property
    def history(self) -> tuple[str, ...]:
        """The recording's history and what was done until now."""
        return (*self._recording.history, self._renamed, self._gaps.note, self._filter_note)

    def frames(self, begin: int, end: int, step: int = 1) -> np.ndarray:
        """(K, M, 3) cleaned positions of every `step`-th frame from `begin` to before `end`, read only.

        Those asked for last are kept: what lies among them costs nothing.
        """
        first, last, known = self._kept
        if not first <= begin <= end <= last:
            known = self._cleaned(begin, end)
            known.setflags(write=False)
            first = begin
            self._kept = (begin, end, known)
        return known[begin - first : end - first : step]

    def _cleaned(self, begin: int, end: int) -> np.ndarray:
        beside = self.n_frames if self._reach is None else self._reach
        first, last = max(0, begin - beside), min(self.n_frames, end + beside)
        outer = max(0, first - self._gaps.reach)
        given = self._recording.frames(outer, min(self.n_frames, last + self._gaps.reach))[:, self._columns]
        full = self._gaps.fill(given, outer, (begin, end))[first - outer : last - outer]
        smooth = filtered(full, self.rate, self._cutoff_hz, self._method)
        return smooth[begin - first : end - first].copy() if last - first > end - begin else smooth

    def view(self, most: int, *, piece: int = PIECE, progress: Progress = silently) -> Take:
        """All of it, or evenly spaced frames where it has more than `most`, as a take at the lower rate."""
        step = max(1, -(-self.n_frames // most))
        parts = []
        for begin, end in progress(pieces(self.n_frames, piece), "cleaning"):
            own = self.frames(begin, end)[-begin % step :: step]
            parts.append(own if step == 1 else own.copy())  # a part of an array would keep all of it
        return Take(
            np.concatenate(parts) if len(parts) > 1 else parts[0],
            self.labels,
            self.rate / step,
            start=self.start,
            name=self.name,
        )


class _Part:
    """Some markers of a recording."""

    def __init__(self, recording: Recording, columns: list[int]) -> None:
        self._recording, self._columns = recording, columns
        self.labels = tuple(recording.labels[column] for column in columns)
        self.rate, self.start, self.name = recording.rate, recording.start, recording.name
        self.history, self.n_frames = recording.history, recording.n_frames

    def frames(self, begin: int, end: int, step: int = 1) -> np.ndarray:
        return self._recording.frames(begin, end, step)[:, self._columns]
