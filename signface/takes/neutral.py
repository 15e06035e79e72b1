"""Finding a neutral frame: where the face rests.

- `find_neutral`: the time of a neutral frame in seconds.
- `neutral_candidates`: a time for each pose in which the face rests, where more than stillness can choose.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from signface.errors import SignfaceError
from signface.frames import runs
from signface.takes.rigid import apply, inverse, rigid_transforms
from signface.takes.take import Take

#: Speeds are means over this long, in seconds; a shorter rest is no rest.
SMOOTHING_S, SHORTEST_S = 0.1, 0.2

#: Speeds up to this many times that of the stillest tenth are the markers' jitter.
JITTER = 1.3

#: Still stretches whose mean poses are nearer than this (root mean square over the markers, mm) are one pose.
SAME_POSE_MM = 0.3


def _without_motion(positions: np.ndarray, head: np.ndarray) -> np.ndarray:
    """Positions brought onto the head markers' own median shape, frame by frame; NaN where fewer than 3 are seen."""

    def onto(shape: np.ndarray, frames: np.ndarray) -> np.ndarray:
        weights = (np.isfinite(frames[..., 0]) & np.isfinite(shape[:, 0])).astype(float)
        poses = inverse(rigid_transforms(np.nan_to_num(shape), frames, weights))
        poses[weights.sum(axis=1) < 3] = np.nan
        return poses

    fullest = head[np.argmax(np.isfinite(head[..., 0]).sum(axis=1))]
    sample = head[:: max(1, len(head) // 500)]
    shape = np.nanmedian(apply(onto(fullest, sample), sample), axis=0)
    return apply(onto(shape if np.isfinite(shape[:, 0]).sum() >= 3 else fullest, head), positions)


def _rolling_mean(values: np.ndarray, length: int) -> np.ndarray:
    """Centred means over `length` values, NaN left out; NaN where all are."""
    known = np.isfinite(values)
    kernel = np.ones(length)
    count = np.convolve(known, kernel, mode="same")
    total = np.convolve(np.where(known, values, 0.0), kernel, mode="same")
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def find_neutral(take: Take, labels: Sequence[str] | None = None, *, head: Sequence[str] | None = None) -> float:
    """Time of a neutral frame: in the longest still stretch closest to the take's median pose.

    A frame's speed is the root mean square speed of its markers. Still stretches are those slower than the slowest
    third of the take, or hardly faster than its stillest tenth (jitter), and at least 0.2 s long. Of these the one
    with the greatest `duration / (1 + (d / s)^2)` is
    taken, where `d` is the distance of its mean pose from the take's median pose and `s` the smallest such distance
    of any stretch (or 0.5 mm): length counts among stretches that are near the median pose. In it, the frame nearest
    to the stretch's own median pose is the answer.

    Parameters
    ----------
    take : Take
    labels : sequence of str, optional
        The markers that are looked at (a layout's face markers); all by default.
    head : sequence of str, optional
        Head markers: when at least three are in the take, head motion is removed first. Otherwise it is removed by
        all the markers looked at, which follow the head more than the face.

    Returns
    -------
    float
        Seconds, on the take's own clock.

    Raises
    ------
    SignfaceError
        No frame shows three markers.

    See Also
    --------
    neutral_candidates : one time for each pose in which the face rests.
    signface.solver.resting.resting_time : the neutral time by what the avatar explains, which the pipeline uses.

    Examples
    --------
    >>> import signface as sf
    >>> take = sf.datasets.mini_take()
    >>> layout = sf.choose_layout(take.labels, sf.read_face("default"))
    >>> 0 <= find_neutral(take, layout.face_labels, head=layout.head_labels) <= take.duration
    True
    """
    return _longest_nearest(take, _motion(take, labels, head))


def _longest_nearest(take: Take, motion: _Motion) -> float:
    """The time that `find_neutral` gives."""
    away, stretches = motion.away, motion.stretches
    if not stretches:
        return motion.fallback
    distance = np.array([np.mean(away[begin:end]) for begin, end in stretches])
    duration = np.array([(end - begin) / take.rate for begin, end in stretches])
    scale = max(0.5, float(distance.min()))
    begin, end = stretches[int(np.argmax(duration / (1 + (distance / scale) ** 2)))]
    return float(take.time[begin + _most_typical(motion.poses[begin:end])])


def neutral_candidates(
    take: Take, labels: Sequence[str] | None = None, *, head: Sequence[str] | None = None, most: int = 8
) -> list[float]:
    """Times at which the face rests, one for each pose that it rests in, the longest rest first.

    Parameters are those of `find_neutral`; at most `most` times are given, and always the one of `find_neutral`.

    See Also
    --------
    find_neutral : the best of them by length and nearness to the median pose.

    Examples
    --------
    >>> import signface as sf
    >>> take = sf.datasets.mini_take()
    >>> find_neutral(take) in neutral_candidates(take)
    True
    """
    motion = _motion(take, labels, head)
    times = [_longest_nearest(take, motion)]
    kept: list[np.ndarray] = []
    for begin, end in sorted(motion.stretches, key=lambda stretch: stretch[0] - stretch[1]):
        rest = motion.poses[begin:end]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # markers that are not seen in this stretch
            mean = np.nanmean(rest, axis=0)
        if all(np.sqrt(np.nanmean(np.sum((mean - other) ** 2, axis=1))) > SAME_POSE_MM for other in kept):
            kept.append(mean)
            times.append(float(take.time[begin + _most_typical(rest)]))
        if len(kept) == most:
            break
    return list(dict.fromkeys(times))


@dataclass(frozen=True)
class _Motion:
    """How a face moves on its head.

    Parameters
    ----------
    poses : (F, M, 3) array
        Markers without head motion, mm.
    away : (F,) array
        Distance from the median pose, mm; NaN for frames that cannot be neutral ones.
    stretches : list of (int, int)
        First frame, and frame after the last, of each still stretch.
    fallback : float
        The best time where there is no still stretch.
    """

    poses: np.ndarray
    away: np.ndarray
    stretches: list[tuple[int, int]]
    fallback: float


def _motion(take: Take, labels: Sequence[str] | None, head: Sequence[str] | None) -> _Motion:
    """The face's motion and its still stretches; raises as `find_neutral` does."""
    names = [label for label in (take.labels if labels is None else labels) if label in take.labels]
    carriers = [label for label in head or () if label in take.labels]
    positions = take.select(names)
    carried = take.select(carriers) if len(carriers) >= 3 else positions
    seen = np.isfinite(positions[..., 0])
    carrying = np.isfinite(carried[..., 0]).sum(axis=1)
    usable = (seen.sum(axis=1) >= min(3, len(names))) & (carrying >= 3)
    if not usable.any():
        raise SignfaceError("no frame shows three markers", file=take.name, hint="give the neutral time in seconds")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # markers or frames that are missing throughout
        poses = _without_motion(positions, carried)
        median = np.nanmedian(poses, axis=0)
        away = np.sqrt(np.nanmean(np.sum((poses - median) ** 2, axis=2), axis=1))
        if take.n_frames == 1:
            return _Motion(poses, away, [], take.start)
        steps = np.sqrt(np.nanmean(np.sum(np.diff(poses, axis=0) ** 2, axis=2), axis=1)) * take.rate
    share = seen.mean(axis=1)
    # A neutral frame shows nearly all that can be seen, and all head markers: the others are measured against it.
    least = carrying[usable].max() if len(carriers) >= 3 else 3
    away[~usable | (share < 0.8 * share.max()) | (carrying < least)] = np.nan
    speed = _rolling_mean(np.append(steps, steps[-1]), max(1, round(SMOOTHING_S * take.rate)))
    known = np.isfinite(speed) & np.isfinite(away)
    if not known.any():
        best = np.nanargmin(away) if np.isfinite(away).any() else np.argmax(usable)
        return _Motion(poses, away, [], float(take.time[best]))
    tenth, third = np.quantile(speed[known], (0.1, 1 / 3))
    # Where the face rests most of the time, jitter alone spreads the speeds of rest over much more than a third.
    still = known & (speed <= max(third, JITTER * tenth))
    stretches = [(int(begin), int(end)) for begin, end in runs(still) if end - begin >= SHORTEST_S * take.rate]
    return _Motion(poses, away, stretches, float(take.time[np.nanargmin(np.where(known, away, np.nan))]))


def _most_typical(rest: np.ndarray) -> int:
    """Index of the frame of a stretch that is nearest to the stretch's own median pose."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        distances = np.sqrt(np.nanmean(np.sum((rest - np.nanmedian(rest, axis=0)) ** 2, axis=2), axis=1))
    return int(np.nanargmin(distances))
