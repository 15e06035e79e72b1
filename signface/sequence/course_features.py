"""What a frame looks like within its sentence: the columns there, around it, and against the whole take.

- `course_features`: of every frame of a take.
"""

from __future__ import annotations

import numpy as np

from signface.descriptors import Descriptors
from signface.frames import Means
from signface.segmentation.energy import bridged

#: Windows around a frame, seconds.
WINDOWS = ((-1.0, -0.5), (-0.5, -0.2), (-0.2, 0.2), (0.2, 0.5), (0.5, 1.0))
#: The frame itself, and how fast it changes: means over so long, and the difference of those before and after.
FRAME_S, SLOPE_S = 0.04, 0.22
#: Movement back and forth is sought over so long.
SWING_S = 1.0
#: The beginning of a take, where a face is often at rest, seconds.
BEGINNING_S = 0.3
#: The low end of a take, percentile, and the high one.
LOW, HIGH = 10.0, 90.0


def width(columns: int) -> int:
    """How many features `course_features` gives for so many columns."""
    return columns * (2 + len(WINDOWS) + 2 + 4) + 3


def course_features(take: Descriptors, times: np.ndarray) -> np.ndarray:
    """Features of the frames of a take.

    Of each column: its mean at the frame and in five windows over the second before and after, its slope, how fast it
    swings and how far, how it stands against the low end and the beginning of the take, and the take's mean and range.
    Then where in the take the frame is: its share, and the seconds from the beginning and to the end.

    Parameters
    ----------
    take : Descriptors
        Frames without weights are bridged in a straight line.
    times : (K,) array
        Seconds, on the take's clock.

    Returns
    -------
    (K, N) float32 array

    Examples
    --------
    >>> import signface as sf
    >>> take = sf.datasets.mini_weights().on(("jawOpen", "browInnerUp"))
    >>> course_features(take, take.start + np.array([0.5, 1.0])).shape == (2, width(2))
    True
    """
    weights, since = bridged(take), times - take.start
    means = Means(weights, take.rate)

    def around(low: float, high: float) -> np.ndarray:
        return means.between(since + low, since + high)

    here = around(-FRAME_S / 2, FRAME_S / 2)
    parts = [here, *(around(low, high) for low, high in WINDOWS)]
    parts.append(around(FRAME_S, FRAME_S + SLOPE_S) - around(-FRAME_S - SLOPE_S, -FRAME_S))
    speed = Means(np.abs(np.gradient(weights, axis=0)) * take.rate if len(weights) > 1 else weights * 0.0, take.rate)
    parts.append(speed.between(since - SWING_S / 2, since + SWING_S / 2))
    squares = Means(weights**2, take.rate).between(since - SWING_S / 2, since + SWING_S / 2)
    parts.append(np.sqrt((squares - around(-SWING_S / 2, SWING_S / 2) ** 2).clip(0)))
    low, high = np.percentile(weights, [LOW, HIGH], axis=0)
    beginning = weights[: max(1, round(BEGINNING_S * take.rate))].mean(axis=0)
    parts += [here - low, here - beginning]
    parts += [np.tile(row, (len(times), 1)) for row in (weights.mean(axis=0), high - low)]
    parts.append(np.column_stack([since / take.duration, since, take.duration - since]))
    return np.concatenate(parts, axis=1).astype(np.float32)
