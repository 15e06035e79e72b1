"""What a sequence model sees of a take: evenly spaced frames with what lies around each of them.

- `FrameFeatures`: the settings, and `of`, the features of a take.
- `frame_states`: the reference's label of each of those frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.frames import Means
from signface.segmentation.energy import bridged
from signface.segmentation.segments import Segments, value_at

#: What stands for every transition among the states.
TRANSITION = "transition"

#: Frames per second that a sequence model looks at. A boundary then lies at most 20 ms from the nearest frame.
FRAME_RATE = 25.0


@dataclass(frozen=True)
class FrameFeatures:
    """How the features of a frame are made from the weights around it.

    The weights are averaged over the time of each frame (which takes out the markers' jitter) and over the windows
    whose limits are `edges`, in seconds from the frame. Beside these means stand, on request, how much the weights
    change over the frame, how unsteady they are around it, and the signer's own scale.

    Parameters
    ----------
    rate : float
        Frames per second (Hz).
    edges : tuple of float
        Limits of the windows around a frame, seconds, rising; K + 1 limits make K windows.
    changes : bool
        For each base, the mean of the half second after the frame less that of the half second before: a movement
        that stays is large, a blink or a mouthed syllable, which comes back, is not.
    unsteadiness : bool
        For each base, its standard deviation within `edges`: a mouth that talks is unsteady, a held smile is not.
    relative : bool
        Divide by the take's own level (the 95th percentile of the norm of its weights), so that a signer who moves
        little is like one who moves much. The intensity is lost with it.
    """

    rate: float = FRAME_RATE
    edges: tuple[float, ...] = (-0.6, -0.34, -0.18, -0.06, 0.06, 0.18, 0.34, 0.6)
    changes: bool = True
    unsteadiness: bool = True
    relative: bool = False

    def __post_init__(self) -> None:
        if self.rate <= 0 or len(self.edges) < 2 or (np.diff(self.edges) <= 0).any():
            raise SignfaceError("the rate of the frames must be positive, and the limits of their windows must rise")

    def times(self, descriptors: Descriptors) -> np.ndarray:
        """(K,) times of the frames in seconds; the middles of stretches of `1 / rate` that fill the take."""
        count = max(1, round(descriptors.duration * self.rate))
        return descriptors.start + (np.arange(count) + 0.5) * descriptors.duration / count

    def width(self, bases: int) -> int:
        """How many features `of` gives for so many bases; they stand window by window, each with all bases."""
        return bases * (len(self.edges) - 1 + 2 * self.changes + self.unsteadiness)

    def of(self, descriptors: Descriptors, bases: Sequence[str]) -> np.ndarray:
        """(K, features) features of the frames of a take.

        Parameters
        ----------
        descriptors : Descriptors
            Frames without weights are bridged in a straight line.
        bases : sequence of str
            The columns wanted, in this order.
        """
        weights = bridged(descriptors)[:, [descriptors.names.index(name) for name in bases]]
        if self.relative:
            weights = weights / max(float(np.percentile(np.linalg.norm(weights, axis=1), 95)), 1e-6)
        times = self.times(descriptors) - descriptors.start
        sums = Means(weights, descriptors.rate)
        parts = [sums.between(times + low, times + high) for low, high in zip(self.edges, self.edges[1:])]
        if self.changes:
            for reach in (0.25, 0.5):
                parts.append(sums.between(times, times + reach) - sums.between(times - reach, times))
        if self.unsteadiness:
            squares = Means(weights**2, descriptors.rate)
            low, high = times + self.edges[0], times + self.edges[-1]
            variance = squares.between(low, high) - sums.between(low, high) ** 2
            parts.append(np.sqrt(variance.clip(0)))
        return np.concatenate(parts, axis=1)


def frame_states(reference: Segments, times: np.ndarray) -> np.ndarray:
    """(K,) state of the reference at each time: a label, `TRANSITION`, or empty where nothing is annotated."""
    labels, kinds = (value_at(reference.table, column, times) for column in ("label", "kind"))
    return np.where(kinds == TRANSITION, TRANSITION, labels).astype(str)
