"""Movement of the synthetic corpus: how weights, heads and skin go from one moment to the next.

- `minimum_jerk`: the easing of natural movements.
- `pose_track`: weights that go from face to face, each unit in its own time.
- `pulse`: something that comes, stays and goes (a raised brow, a nod).
- `smooth_noise`: slow fluctuation.
- `saturate`: muscles that add up do not add without limit.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq


def minimum_jerk(progress: np.ndarray) -> np.ndarray:
    """Smooth step from 0 to 1 with no velocity or acceleration at either end.

    T. Flash and N. Hogan, The coordination of arm movements, J. Neurosci. 5(7), 1985, eq. 3: the path of least jerk.

    Examples
    --------
    >>> minimum_jerk(np.array([-1.0, 0.0, 0.5, 1.0, 2.0])).tolist()
    [0.0, 0.0, 0.5, 1.0, 1.0]
    """
    u = np.clip(progress, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def pose_track(
    time: np.ndarray,
    poses: np.ndarray,
    starts: Sequence[float],
    ends: Sequence[float],
    groups: np.ndarray,
    rng: np.random.Generator,
) -> np.ndarray:
    """(F, N) weights that hold a pose, go over to the next one, and so on.

    Parts of a face do not move in step: each group of bases starts up to a tenth of a second earlier or later, each
    base a little more, and the easing leans towards the beginning or the end.

    Parameters
    ----------
    time : (F,) array
        Seconds.
    poses : (K, N) array
        Weights of each pose.
    starts, ends : (K - 1,) sequences
        When the movement from pose k to pose k + 1 begins and ends, seconds.
    groups : (N,) int array
        Group of each base.
    rng : numpy Generator
    """
    count = poses.shape[1]
    track = np.tile(poses[0], (len(time), 1))
    for k, (start, end) in enumerate(zip(starts, ends)):
        delay = np.clip(rng.normal(0.0, 0.035, groups.max() + 1), -0.09, 0.09)[groups] + rng.normal(0.0, 0.012, count)
        stretch = np.exp(rng.normal(0.0, 0.12, count))
        lean = np.exp(rng.normal(0.0, 0.18, groups.max() + 1))[groups]
        change = poses[k + 1] - poses[k]
        for base in np.flatnonzero(change):
            length = (end - start) * stretch[base]
            middle = 0.5 * (start + end) + delay[base]
            progress = np.clip((time - (middle - 0.5 * length)) / length, 0.0, 1.0) ** lean[base]
            track[:, base] += change[base] * minimum_jerk(progress)
    return track


def pulse(time: np.ndarray, start: float, end: float, rise: float, fall: float) -> np.ndarray:
    """(F,) curve that rises to 1 after `start` within `rise` seconds and is back at 0 at `end`."""
    rise, fall = max(rise, 1e-3), max(fall, 1e-3)
    return minimum_jerk((time - start) / rise) * minimum_jerk((end - time) / fall)


def smooth_noise(rng: np.random.Generator, frames: int, rate: float, cutoff_hz: float, width: int = 1) -> np.ndarray:
    """(F, width) Gaussian noise of unit variance whose power falls to a half at `cutoff_hz`.

    White noise under a Gaussian window in frequency. More is drawn than asked for, so that the period of the Fourier
    transform does not tie the end to the beginning.
    """
    sigma = np.sqrt(np.log(2.0)) / (2.0 * np.pi * cutoff_hz)
    count = next_fast_len(frames + int(np.ceil(4.0 * sigma * rate)), real=True)
    spectrum = rfft(rng.standard_normal((count, width)), axis=0)
    gain = np.exp(-0.5 * (2.0 * np.pi * sigma * rfftfreq(count, 1.0 / rate)) ** 2)
    smooth = irfft(spectrum * gain[:, None], count, axis=0)[:frames]
    return smooth * np.sqrt(2.0 * np.sqrt(np.pi) * sigma * rate)


def saturate(weights: np.ndarray, knee: float = 0.75) -> np.ndarray:
    """Weights kept in [0, 1]: unchanged up to the knee, then bent smoothly so that 1 is never passed."""
    above = np.maximum(weights - knee, 0.0)
    room = 1.0 - knee
    return np.clip(np.minimum(weights, knee) + room * (1.0 - np.exp(-above / room)), 0.0, 1.0)
