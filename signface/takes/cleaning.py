"""A recording cleaned piece by piece: the markers of a layout, without gaps and jitter.

- `cleaning_stages`: what `rename_to`, `fill_gaps` and `lowpass` do to a take, as stages for any recording.
- `Kept`: a recording that keeps the frames asked for last.
- `Progress`, `silently`: how long work shows how far it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from signface.frames import Timed
from signface.takes.filtering import CUTOFF_HZ, Lowpass
from signface.takes.gaps import LONG_S, SHORT_S, GapFiller
from signface.takes.labels import Renaming
from signface.takes.marker_check import MarkerCheck
from signface.takes.recording import PIECE, Recording, pieces
from signface.takes.stages import Stage
from signface.takes.take import Take

#: Goes through pieces, showing how far we are: `progress(pieces, "cleaning")`, as `signface.progress.progress`.
Progress = Callable[[Sequence[tuple[int, int]], str], Iterable[tuple[int, int]]]


def silently(items: Sequence[tuple[int, int]], what: str) -> Iterable[tuple[int, int]]:
    """The `Progress` that shows nothing."""
    return items


class Kept(Timed):
    """A recording that keeps the frames asked for last: what lies among them costs nothing. Itself a `Recording`.

    Parameters
    ----------
    recording : Recording
        One whose frames cost something, such as `signface.takes.stages.Staged`.
    """

    rate: float
    start: float
    name: str
    n_frames: int

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self.labels, self.rate, self.start = recording.labels, recording.rate, recording.start
        self.name, self.n_frames = recording.name, recording.n_frames
        self._kept: tuple[int, int, np.ndarray] = (0, 0, np.empty((0, len(self.labels), 3)))

    @property
    def history(self) -> tuple[str, ...]:
        """The recording's history until now."""
        return self._recording.history

    def frames(self, begin: int, end: int, step: int = 1) -> np.ndarray:
        """(K, M, 3) positions of every `step`-th frame from `begin` to before `end`, read only."""
        begin, end = self.clamp(begin, end)
        first, last, known = self._kept
        if not first <= begin <= end <= last:
            known = self._recording.frames(begin, end)
            known = known if known.base is None else known.copy()  # a part of an array would keep all of it
            known.setflags(write=False)
            first = begin
            self._kept = (begin, end, known)
        return known[begin - first : end - first : step]

    def glance(self, most: int, *, piece: int = PIECE, progress: Progress = silently) -> Take:
        """All of it, or evenly spaced frames where it has more than `most`, as a take at the lower rate.

        The one pass over a long recording in which what holds for all of it is found.
        """
        step = max(1, -(-self.n_frames // most))
        blocks = []
        for begin, end in progress(pieces(self.n_frames, piece), "cleaning"):
            block = self.frames(begin, end)[-begin % step :: step]
            blocks.append(block if step == 1 else block.copy())  # a part of an array would keep all of it
        positions = np.concatenate(blocks) if len(blocks) > 1 else blocks[0]
        return Take(positions, self.labels, self.rate / step, self.start, self.name)


def cleaning_stages(
    labels: Sequence[str],
    *,
    short_gap_s: float = SHORT_S,
    long_gap_s: float = LONG_S,
    cutoff_hz: float = CUTOFF_HZ,
    filter_method: str = "butterworth",
    check: bool = False,
    known: Mapping[str, np.ndarray] | None = None,
) -> tuple[Stage, ...]:
    """The markers of a layout, with gaps filled and filtered.

    Parameters
    ----------
    labels : sequence of str
        A layout's; see `signface.takes.labels.rename_to`.
    short_gap_s, long_gap_s : float
        See `signface.takes.gaps.fill_gaps`.
    cutoff_hz, filter_method
        See `signface.takes.filtering.lowpass`. With `raised-sine` every frame depends on all others: each piece costs
        the whole recording.
    check : bool
        Also look for ghosts, swapped and frozen markers, before gaps are filled.
    known : mapping of str to (3,) array, optional
        See `signface.takes.marker_check.MarkerCheck`.

    Raises
    ------
    SignfaceError
        A parameter is out of range; when they learn, the recording does not have the markers.

    See Also
    --------
    signface.takes.stages.View.through : put a recording behind them.

    Examples
    --------
    >>> import signface as sf
    >>> from signface.takes.stages import View
    >>> view = View(sf.open_recording(sf.datasets.mini_file()))
    >>> clean = view.through(*cleaning_stages(["LBROI", "LBROM", "LBROO"])).recording
    >>> clean.frames(100, 300).shape, clean.history[-1]
    ((200, 3, 3), 'lowpass butterworth 12 Hz')
    """
    return (
        Renaming(labels),
        *([MarkerCheck(known)] if check else []),
        GapFiller(short_s=short_gap_s, long_s=long_gap_s),
        Lowpass(cutoff_hz=cutoff_hz, method=filter_method),
    )
