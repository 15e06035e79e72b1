"""Segments of a take: stable stretches and the transitions between them.

- `segment`: cut a take where its energy curve peaks (thesis 4.4.2).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pandas as pd

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.segmentation.energy import Energies, energies
from signface.segmentation.noise import jitter
from signface.segmentation.segments import Segments


def segment(
    descriptors: Descriptors,
    *,
    prominence: float = 0.15,
    least_activity: float = 0.5,
    noise_factor: float = 8.0,
    jitter_factor: float = 3.0,
    extent: float = 0.5,
    least_stable_s: float = 0.15,
    least_transition_s: float = 0.08,
    window_s: float = 0.23,
    time_constant_s: float = 0.15,
    pulse_s: float = 0.3,
) -> Segments:
    """Cut a take into stable segments and the transitions between them.

    Peaks of the combined energy (see `signface.segmentation.energy.energies`) are found on its square root, which is
    linear in the weights. What of the velocity and the acceleration of a base may be jitter of the tracker
    (`signface.segmentation.noise.jitter`) is taken off before they are added. A peak is kept when its prominence (the
    descent on either side before a higher peak) is at least the largest of four: a fraction of the take's own level, a
    multiple of its unrest, what is left of jitter alone, and a small absolute activity. Around every kept peak the
    transition reaches to where the activity has fallen to a fraction of the peak. Transitions that touch, or leave too
    little between them to be a held expression, become one.

    The *level* of the take is the 98th percentile of its activity above its *floor*, the 5th percentile. The *unrest*
    is the distance of the 5th from the 25th percentile in units of a standard deviation: it looks at the quiet part.

    Parameters
    ----------
    descriptors : Descriptors
        A take of at least one frame.
    prominence : float
        Least prominence of a peak, as a fraction of the take's level. Between 0 and 1.
    least_activity : float
        Least prominence of a peak, as an activity (1/s): 0.5 is one base that moves by 0.12 in half a second.
    noise_factor : float
        Least prominence of a peak, in standard deviations of the take's unrest.
    jitter_factor : float
        How many standard deviations of the tracker's jitter in each base do not count; 0 counts jitter as motion.
        Chosen on synthetic takes at 30 Hz whose markers jitter by 1 and 2 mm.
    extent : float
        A transition ends where the activity has fallen to this fraction of its peak above the floor. For eased
        movements of 0.3 to 0.8 s half the height lies up to 0.1 s inside the movement, where it has gone a
        hundredth of its way and the eye does not see it yet.
    least_stable_s : float
        Transitions with less than this between them are merged (s).
    least_transition_s : float
        Shorter transitions are jolts, not movements of a face, and are left in their stable segment (s).
    window_s, time_constant_s, pulse_s : float
        See `energies`.

    Returns
    -------
    Segments
        `start_s`, `end_s`, `kind`, alternating, without gaps, from the first frame to the end of the last one
        (`start + duration`). A take without motion, and one too short to hold a transition
        (less than twice `least_transition_s`, or than three frames), is one stable segment.

    Raises
    ------
    SignfaceError
        The take has no frame or no weights, or a parameter is out of its range.

    Examples
    --------
    >>> import numpy as np
    >>> import signface as sf
    >>> time = np.arange(400) / 200
    >>> smile = np.clip((time - 0.8) / 0.4, 0, 1)
    >>> take = sf.Descriptors((3 * smile**2 - 2 * smile**3)[:, None], ("mouthSmileLeft",), rate=200)
    >>> list(sf.segment(take).table.kind)
    ['stable', 'transition', 'stable']
    """
    if not (0 < prominence < 1 and 0 < extent < 1):
        raise SignfaceError("prominence and extent of the segmentation are fractions between 0 and 1")
    if min(least_activity, noise_factor, jitter_factor, least_stable_s, least_transition_s) < 0:
        raise SignfaceError("the thresholds of the segmentation cannot be negative")
    if descriptors.n_frames == 0:
        raise SignfaceError(f"{descriptors.name}: the take has no frame")
    begin, end = descriptors.start, descriptors.start + descriptors.duration
    transitions: list[tuple[float, float]] = []
    if descriptors.n_frames >= 3 and descriptors.duration > 2 * least_transition_s:
        windows = {"window_s": window_s, "time_constant_s": time_constant_s, "pulse_s": pulse_s}
        noise = jitter(descriptors, factor=jitter_factor, **windows)
        spared = (jitter_factor * noise.velocities, jitter_factor * noise.accelerations) if jitter_factor else None
        curves = energies(descriptors, **windows, spared=spared)
        threshold, floor = _threshold(curves.activity, prominence, least_activity, noise_factor)
        threshold = max(threshold, noise.highest) if jitter_factor else threshold
        transitions = _around_peaks(curves, threshold, floor, extent)
        transitions = _merged(transitions, least_stable_s, curves.time[0], curves.time[-1], end)
        transitions = [(first, last) for first, last in transitions if last - first >= least_transition_s]
    elif not np.isfinite(descriptors.weights).all(axis=1).any():
        raise SignfaceError(f"{descriptors.name}: no frame has weights")
    return Segments(
        _table(transitions, begin, end),
        name=descriptors.name,
        history=(*descriptors.history, f"segment prominence={prominence:g} extent={extent:g} window_s={window_s:g}"),
    )


def _threshold(
    activity: np.ndarray, prominence: float, least_activity: float, noise_factor: float
) -> tuple[float, float]:
    """Least prominence of a peak and the floor of the activity (1/s)."""
    floor, quarter, high = np.percentile(activity, (5, 25, 98))
    unrest = (quarter - floor) / 0.970  # distance of these percentiles in a normal distribution of unit deviation
    return max(prominence * (high - floor), noise_factor * unrest, least_activity), float(floor)


def _around_peaks(curves: Energies, threshold: float, floor: float, extent: float) -> list[tuple[float, float]]:
    """Start and end of the movement around each peak that is prominent enough, in the order of the peaks."""
    from scipy.signal import find_peaks  # slow to import, and sequence models do without

    activity, time = curves.activity, curves.time
    # A movement that the recording cuts off peaks at its first or last frame: padded, that is a peak as well.
    peaks, _ = find_peaks(np.concatenate(([floor], activity, [floor])), prominence=threshold)
    around = []
    for peak in peaks - 1:
        height = floor + extent * (activity[peak] - floor)
        below = np.flatnonzero(activity < height)
        left, right = below[below < peak], below[below > peak]
        start = _crossing(time, activity, left[-1], height) if len(left) else time[0]
        stop = _crossing(time, activity, right[0] - 1, height) if len(right) else time[-1]
        around.append((start, stop))
    return around


def _crossing(time: np.ndarray, activity: np.ndarray, frame: int, height: float) -> float:
    """Time between `frame` and the next at which the activity crosses `height`, on the line between them."""
    low, high = activity[frame], activity[frame + 1]
    return float(time[frame] + (height - low) / (high - low) * (time[frame + 1] - time[frame]))


def _merged(
    transitions: list[tuple[float, float]], least_stable_s: float, first: float, last: float, end: float
) -> list[tuple[float, float]]:
    """Transitions with what is too short to be stable, between them or at the ends of the take, taken in."""
    merged: list[tuple[float, float]] = []
    for start, stop in sorted(transitions):
        start = first if start - first < least_stable_s else start
        stop = end if last - stop < least_stable_s else stop
        if merged and start - merged[-1][1] < least_stable_s:
            merged[-1] = (merged[-1][0], max(stop, merged[-1][1]))
        else:
            merged.append((start, stop))
    return merged


def _table(transitions: list[tuple[float, float]], begin: float, end: float) -> pd.DataFrame:
    """The alternating table: what is not a transition is stable."""
    marks = [begin, *(mark for pair in transitions for mark in pair), end]
    rows = [
        (start, stop, "transition" if number % 2 else "stable")
        for number, (start, stop) in enumerate(pairwise(marks))
        if stop > start
    ]
    return pd.DataFrame(rows, columns=["start_s", "end_s", "kind"])
