"""Stages: what is done to a recording on its way to the solver, and the one driver that runs them.

- `Stage`: what every stage is (names, gaps, filter, alignment, head motion; adaptation and creep in the solver's room).
- `Block`: frames on their way through stages.
- `View`: what a stage learns from; `View.through` puts stages in a row.
- `Staged`: a recording behind a stage: the driver. In memory, in pieces or by single frames it is the same.
- `run`: stages over a take in memory, as `fill_gaps`, `lowpass` and their siblings do it.

A stage learns once, from the recording that reaches it. Then it is given blocks of frames, with as many frames beside
those wanted as it says that it reaches, so that no frame depends on where a block was cut.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import numpy as np

from signface.content import Content
from signface.frames import Timed
from signface.takes.recording import PIECE, Recording, pieces
from signface.takes.take import Take


@dataclass(frozen=True, eq=False)
class Block(Content):
    """Frames of a recording on their way through stages.

    Parameters
    ----------
    positions : (K, M, 3) array
        Millimetres, NaN where a marker is missing. Stages do not write into it.
    frames : range
        The frames' numbers in the recording; with a step where frames stand alone.
    wanted : range, optional
        Those asked for; the others stand beside them. All by default.
    head : (K, 4, 4) array, optional
        Poses of the head, once a stage has found them.
    """

    positions: np.ndarray
    frames: range
    wanted: range | None = None
    head: np.ndarray | None = None

    @property
    def inner(self) -> slice:
        """Where the wanted frames are in the block."""
        if self.wanted is None:
            return slice(0, len(self.frames))
        return slice(self.wanted.start - self.frames.start, self.wanted.stop - self.frames.start)

    def changed(self, positions: np.ndarray, head: np.ndarray | None = None) -> Block:
        """The block with other positions, and with poses of the head where they are given."""
        return replace(self, positions=positions, head=self.head if head is None else head)

    def cut(self) -> Block:
        """The wanted frames alone."""
        if self.wanted is None or self.wanted == self.frames:
            return self
        return Block(self.positions[self.inner], self.wanted, head=None if self.head is None else self.head[self.inner])


class Stage(ABC):
    """A step that is done to a recording: it learns from all of it, then works on any of its frames.

    A subclass writes `apply` and `note`, and `learn` where it needs to know the rate or the recording. A stage object
    serves one recording.

    Attributes
    ----------
    reach : int or None
        How many frames to either side a frame's result depends on, once it has learnt; None for all of them.
    alone : bool
        Whether frames far apart can be worked on, each by itself.

    See Also
    --------
    run : stages over a take in memory.
    View.through : stages over any recording.

    Examples
    --------
    Positions in the frame of the first marker:

    >>> class Centred(Stage):
    ...     note = "centred on the first marker"
    ...
    ...     def apply(self, block):
    ...         return block.changed(block.positions - block.positions[:, :1])
    >>> take = run(Take([[[1.0, 2, 3], [2, 2, 5]]], ("NOSE", "CHIN"), rate=50), Centred())
    >>> take.positions[0].tolist(), take.history
    ([[0.0, 0.0, 0.0], [1.0, 0.0, 2.0]], ('centred on the first marker',))
    """

    reach: int | None = 0
    alone: bool = True

    @property
    def causal(self) -> bool:
        """Whether a frame's result waits for no other frame, so that the stage can follow a live capture."""
        return self.reach == 0

    def learn(self, view: View) -> None:  # noqa: B027  (most stages of one frame have nothing to learn)
        """Find what holds for the whole recording."""

    def labels_of(self, labels: tuple[str, ...]) -> tuple[str, ...]:
        """The labels behind the stage, from those before it: the same, unless it chooses markers."""
        return labels

    @abstractmethod
    def apply(self, block: Block) -> Block:
        """The block behind the stage: the same frames, right where they are wanted."""

    @property
    @abstractmethod
    def note(self) -> str:
        """What was done until now, for the history."""


class Staged(Timed):
    """A recording behind a stage; itself a `Recording`, so that stages stand in a row.

    Parameters
    ----------
    recording : Recording
        What reaches the stage.
    stage : Stage
        One that has learnt from it.
    """

    rate: float
    start: float
    name: str
    n_frames: int

    def __init__(self, recording: Recording, stage: Stage) -> None:
        self._recording, self._stage = recording, stage
        self.labels = stage.labels_of(recording.labels)
        self.rate, self.start, self.name = recording.rate, recording.start, recording.name
        self.n_frames = recording.n_frames

    @property
    def history(self) -> tuple[str, ...]:
        """The recording's history and what the stage did until now."""
        return (*self._recording.history, self._stage.note)

    def block(self, begin: int, end: int, step: int = 1) -> Block:
        """Every `step`-th frame from `begin` to before `end`, behind the stage, with the head's poses where known."""
        begin, end = self.clamp(begin, end)
        if begin == end:
            return Block(np.empty((0, len(self.labels), 3)), range(begin, end, step))
        if step > 1 and not self._stage.alone:
            every = [
                self.block(begin + first, begin + last).positions[-first % step :: step].copy()
                for first, last in pieces(end - begin, PIECE)
            ]
            return Block(np.concatenate(every), range(begin, end, step))
        beside = 0 if step > 1 else self.n_frames if self._stage.reach is None else self._stage.reach
        first, last = max(0, begin - beside), min(self.n_frames, end + beside)
        block = block_of(self._recording, first, last, step)
        return self._stage.apply(replace(block, wanted=range(begin, end, step))).cut()

    def frames(self, begin: int, end: int, step: int = 1) -> np.ndarray:
        """(K, M, 3) positions of every `step`-th frame from `begin` to before `end`, behind the stage."""
        return self.block(begin, end, step).positions


def block_of(recording: Recording, begin: int, end: int, step: int = 1) -> Block:
    """Frames of a recording as a block; behind a stage, with the head's poses where known."""
    if isinstance(recording, Staged):
        return recording.block(begin, end, step)
    return Block(recording.frames(begin, end, step), range(begin, end, step))


class View:
    """A recording to learn from: any of its frames, and frames spread evenly over all of it.

    Parameters
    ----------
    recording : Recording
        What reaches the stage that learns.
    known : Block, optional
        Frames spread over a recording some stages before, so that it need not be gone through again.
    between : tuple of Stage
        Those stages.
    """

    def __init__(self, recording: Recording, known: Block | None = None, between: tuple[Stage, ...] = ()) -> None:
        self.recording = recording
        self._known, self._between = known, between

    @property
    def rate(self) -> float:
        """Frames per second (Hz) of those known, or of all."""
        return self.recording.rate / (1 if self._known is None else self._known.frames.step)

    def spread(self, least: int) -> Block:
        """Frames spread evenly over the recording: at least so many, where there are."""
        if self._known is None:
            frames = self.recording.n_frames
            return block_of(self.recording, 0, frames, max(1, frames // least))
        return self.every(max(1, len(self._known.frames) // least))

    def every(self, step: int) -> Block:
        """Every `step`-th frame: of those known, or of all."""
        if self._known is None:
            return block_of(self.recording, 0, self.recording.n_frames, step)
        block = Block(self._known.positions[::step], self._known.frames[::step])
        for stage in self._between:
            block = stage.apply(block)
        return block

    def through(self, *stages: Stage) -> View:
        """The view behind stages, each of which learns from what reaches it."""
        view = self
        for stage in stages:
            stage.learn(view)
            behind = Staged(view.recording, stage)
            known = view._known if stage.alone else None
            view = View(behind, known, (*view._between, stage) if known is not None else ())
        return view


def run(take: Take, *stages: Stage) -> Take:
    """A take in memory behind stages, the history saying what they did.

    See Also
    --------
    signface.takes.gaps.fill_gaps, signface.takes.filtering.lowpass : one stage each.

    Examples
    --------
    >>> from signface.takes.filtering import Lowpass
    >>> from signface.takes.gaps import GapFiller
    >>> import signface as sf
    >>> run(sf.datasets.mini_take(), GapFiller(), Lowpass()).history[-2:]
    ('fill_gaps up to 0.05 and 0.5 s: 2 splined, 5 from neighbours', 'lowpass butterworth 12 Hz')
    """
    staged = View(take).through(*stages).recording
    positions = staged.frames(0, take.n_frames)
    return replace(take, positions=positions, labels=staged.labels, history=staged.history)
