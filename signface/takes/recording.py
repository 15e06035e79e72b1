"""A recording that need not lie in memory: its markers, rate and length, and its frames in pieces.

- `Recording`: what a `Take` and a `TakeFile` share, and all that cleaning and solving ask of either.
- `TakeFile`: a recording on disk, of which only the frames asked for are read.
- `pieces`: the pieces in which a long recording is worked through.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from signface.content import Summary
from signface.frames import TimedArrays
from signface.takes.take import Labelled, Take

#: Frames worked on at a time: 46 markers then take 18 MB, and the two minutes of an ordinary take are two pieces.
PIECE = 16384


class Recording(Labelled, Protocol):
    """Trajectories of markers, in memory or on disk; attributes as of `Take`."""

    @property
    def rate(self) -> float: ...

    @property
    def start(self) -> float: ...

    @property
    def n_frames(self) -> int: ...

    @property
    def history(self) -> tuple[str, ...]: ...

    def frame_at(self, seconds: float) -> int:
        """Index of the frame nearest to a time in seconds; see `signface.frames.Timed`."""
        ...

    def frames(self, begin: int, end: int, step: int = 1) -> np.ndarray:
        """(K, M, 3) positions of every `step`-th frame from `begin` to before `end`, millimetres, NaN where missing.

        Frames beyond the first and the last are left out, as slices of arrays do.
        """
        ...


@dataclass(frozen=True, repr=False)
class TakeFile(TimedArrays, Summary):
    """A recording on disk.

    Parameters
    ----------
    labels, rate, start, name, history
        As of `Take`.
    n_frames : int
    read : callable
        `read(begin, end, step)` gives the positions of these frames, millimetres, NaN where missing. It is asked for
        frames that there are.
    """

    labels: tuple[str, ...]
    rate: float
    n_frames: int
    read: Callable[[int, int, int], np.ndarray]
    start: float = 0.0
    name: str = "take"
    history: tuple[str, ...] = ()

    def frames(self, begin: int, end: int, step: int = 1) -> np.ndarray:
        """(K, M, 3) positions of every `step`-th frame from `begin` to before `end`, read now.

        Raises
        ------
        SignfaceError
            The file cannot be read there: a row is cut short or holds words.
        """
        begin, end = self.clamp(begin, end)
        if begin == end:
            return np.empty((0, len(self.labels), 3))
        positions = self.read(begin, end, step)
        positions[~np.isfinite(positions).all(axis=2)] = np.nan
        return positions

    def _sizes(self) -> str:
        return f"{self.n_frames} frames at {self.rate:g} Hz, {len(self.labels)} markers, on disk"

    def whole(self) -> Take:
        """All of it, in memory."""
        positions = self.frames(0, self.n_frames)
        return Take(positions, self.labels, self.rate, self.start, self.name, self.history)

    def _rows(self, begin: int, end: int) -> dict[str, Any]:
        def read(first: int, last: int, step: int) -> np.ndarray:
            return self.read(begin + first, begin + last, step)

        return {"read": read, "n_frames": end - begin}


def pieces(frames: int, length: int = PIECE) -> list[tuple[int, int]]:
    """First frame, and frame after the last, of consecutive pieces of at most `length` frames.

    Examples
    --------
    >>> pieces(10, 4)
    [(0, 4), (4, 8), (8, 10)]
    """
    return [(begin, min(begin + length, frames)) for begin in range(0, frames, length)]
