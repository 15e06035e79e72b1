"""A segment as one row of numbers: how each column runs through it, not only its mean.

- `segment_courses`: of the segments of a take.
- `courses_width`: how many numbers that are.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from signface.descriptors import Descriptors
from signface.label.spans import frames_within

#: Of each column: mean, deviation, three percentiles, the means of three thirds, speed, turns.
OF_A_COLUMN = 10


def courses_width(columns: int) -> int:
    """How many numbers `segment_courses` gives for so many columns."""
    return OF_A_COLUMN * columns + 1


def segment_courses(descriptors: Descriptors, spans: np.ndarray) -> np.ndarray:
    """What runs through each span, in one row.

    Of each column its mean and standard deviation, the 10th, 50th and 90th percentile, the means of the first, second
    and last third, the mean speed (1/s) and how often a second it turns back; then the duration in seconds. A headshake
    and a nod have the mean of a still head; their courses differ.

    Parameters
    ----------
    descriptors : Descriptors
    spans : (S, 2) array
        Start and end of each in seconds, as for `signface.label.spans.segment_means`.

    Returns
    -------
    (S, courses_width(N)) array
        NaN for a span without any frame that is known.

    Examples
    --------
    >>> import signface as sf
    >>> take = sf.datasets.mini_weights().on(("jawOpen",))
    >>> segment_courses(take, np.array([[0.5, 1.5]])).shape
    (1, 11)
    """
    rows = np.full((len(spans), courses_width(descriptors.weights.shape[1])), np.nan)
    for row, (start, end) in enumerate(spans):
        frames = frames_within(descriptors, start, end)
        if len(frames):
            rows[row] = np.append(_course(descriptors.weights[frames], descriptors.rate), end - start)
    return rows


def _course(values: np.ndarray, rate: float) -> np.ndarray:
    count = len(values)
    limits = [round(count * third / 3) for third in range(4)]
    thirds = [values[min(a, count - 1) : max(b, a + 1)].mean(axis=0) for a, b in pairwise(limits)]
    speed = np.gradient(values, axis=0) * rate if count > 1 else np.zeros_like(values)
    turns = (np.diff(np.sign(speed), axis=0) != 0).sum(axis=0) * rate / count
    spread = np.percentile(values, [10, 50, 90], axis=0)
    return np.concatenate(
        [values.mean(axis=0), values.std(axis=0), *spread, *thirds, np.abs(speed).mean(axis=0), turns]
    )
