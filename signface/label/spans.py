"""Frames and mean descriptors of stretches of a take.

- `segment_means`: the mean descriptor of each segment (eq. 4.6).
- `frames_within`: the frames of a stretch.
"""

from __future__ import annotations

import numpy as np

from signface.descriptors import Descriptors


def segment_means(descriptors: Descriptors, spans: np.ndarray) -> np.ndarray:
    """(S, N) mean weights of the frames of each span (eq. 4.6); NaN for a span without any.

    Parameters
    ----------
    descriptors : Descriptors
    spans : (S, 2) array
        Start and end of each span in seconds; the frames with `start <= time < end` belong to it, and a span that
        falls between two frames takes the nearest one.
    """
    means = np.full((len(spans), descriptors.weights.shape[1]), np.nan)
    for row, (start, end) in enumerate(spans):
        frames = frames_within(descriptors, start, end)
        if len(frames):
            means[row] = descriptors.weights[frames].mean(axis=0)
    return means


def frames_within(descriptors: Descriptors, start: float, end: float) -> np.ndarray:
    """Indices of the frames with `start <= time < end`, at least the nearest one, that have weights."""
    tiny = 1e-6 / descriptors.rate  # a boundary that stands on a frame but for rounding
    first = int(np.ceil((start - descriptors.start) * descriptors.rate - tiny))
    last = int(np.ceil((end - descriptors.start) * descriptors.rate - tiny))
    if last <= first:
        first = round(((start + end) / 2 - descriptors.start) * descriptors.rate)
        last = first + 1
    frames = np.arange(max(first, 0), min(last, descriptors.n_frames))
    return frames[np.isfinite(descriptors.weights[frames]).all(axis=1)]
