"""The `Take`: what every reader returns and every later step of `takes` works on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from signface.errors import SignfaceError


@dataclass(frozen=True)
class Take:
    """Trajectories of markers.

    Parameters
    ----------
    positions : (F, M, 3) float64 array
        Positions in millimetres; NaN (all three coordinates) where a marker is missing.
    labels : (M,) tuple of str
        Marker names, unique.
    rate : float
        Frames per second (Hz), positive and finite.
    start : float
        Time of frame 0 in seconds, so that frames line up with a video.
    name : str
        Name of the take, usually the stem of its file.
    history : tuple of str
        What was done, oldest first; the first entry says which file was read.

    Raises
    ------
    SignfaceError
        Shapes disagree, a label is repeated, the rate is not positive, or there is no frame.
    """

    positions: np.ndarray
    labels: tuple[str, ...]
    rate: float
    start: float = 0.0
    name: str = "take"
    history: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        positions = np.array(self.positions, dtype=np.float64)
        labels = tuple(str(label) for label in self.labels)
        if positions.ndim != 3 or positions.shape[2] != 3:
            raise SignfaceError(f"positions must have the shape (frames, markers, 3), not {positions.shape}")
        if positions.shape[1] != len(labels):
            raise SignfaceError(f"{positions.shape[1]} trajectories but {len(labels)} marker labels")
        if positions.shape[0] == 0:
            raise SignfaceError("the take has no frame")
        if len(set(labels)) != len(labels):
            twice = sorted({label for label in labels if labels.count(label) > 1})
            raise SignfaceError(f"marker labels are repeated: {', '.join(twice[:5])}", hint="rename the markers")
        if not (np.isfinite(self.rate) and self.rate > 0):
            raise SignfaceError(f"the rate must be positive, not {self.rate}", hint="export it with its rate")
        positions[~np.isfinite(positions).all(axis=2)] = np.nan  # a half-known or infinite point is a missing one
        positions.setflags(write=False)
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "labels", labels)
        object.__setattr__(self, "rate", float(self.rate))
        object.__setattr__(self, "start", float(self.start))
        object.__setattr__(self, "history", tuple(self.history))

    @property
    def n_frames(self) -> int:
        """Number of frames F."""
        return self.positions.shape[0]

    @property
    def duration(self) -> float:
        """Duration in seconds: frames over rate."""
        return self.n_frames / self.rate

    @property
    def time(self) -> np.ndarray:
        """(F,) time of each frame in seconds."""
        return self.start + np.arange(self.n_frames) / self.rate

    def frame_at(self, seconds: float) -> int:
        """Index of the frame nearest to a time in seconds.

        Raises
        ------
        SignfaceError
            The time lies outside the take.
        """
        return frame_at(self, seconds)

    def frames(self, begin: int, end: int, step: int = 1) -> np.ndarray:
        """(K, M, 3) positions of every `step`-th frame from `begin` to before `end`."""
        return self.positions[begin:end:step]

    def select(self, labels: Sequence[str]) -> np.ndarray:
        """(F, len(labels), 3) positions of the named markers, in the order asked for.

        Raises
        ------
        SignfaceError
            A marker is not in the take.
        """
        index = {label: i for i, label in enumerate(self.labels)}
        missing = [label for label in labels if label not in index]
        if missing:
            raise SignfaceError(f"{self.name}: no marker named {', '.join(missing[:5])}")
        return self.positions[:, [index[label] for label in labels]]

    def changed(self, operation: str, **fields: object) -> Take:
        """A copy with some fields replaced and `operation` appended to its history."""
        return replace(self, history=(*self.history, operation), **fields)  # type: ignore[arg-type]


class Timed(Protocol):
    """What has frames at times."""

    @property
    def rate(self) -> float: ...

    @property
    def start(self) -> float: ...

    @property
    def name(self) -> str: ...

    @property
    def n_frames(self) -> int: ...


def frame_at(recording: Timed, seconds: float) -> int:
    """Index of the frame of a recording that is nearest to a time; see `Take.frame_at`."""
    frame = round((seconds - recording.start) * recording.rate) if np.isfinite(seconds) else -1
    if not 0 <= frame < recording.n_frames:
        last = recording.start + (recording.n_frames - 1) / recording.rate
        raise SignfaceError(
            f"{recording.name}: the time {seconds:g} s is outside the take",
            hint=f"give a time from {recording.start:.3f} to {last:.3f} s",
        )
    return frame
