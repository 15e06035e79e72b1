"""Filling gaps in trajectories.

- `fill_gaps`: short gaps by a spline, longer ones from the motion of the neighbouring markers.
- `gap_table`: the gaps of each marker.
"""

from __future__ import annotations

import numpy as np

from signface.errors import SignfaceError
from signface.takes.rigid import apply, inverse, rigid_transforms
from signface.takes.runs import runs
from signface.takes.take import Take

#: Default limits in seconds: gaps up to the first are splined, up to the second taken from the neighbours.
SHORT_S, LONG_S = 0.1, 0.5

#: The trajectory beside a gap that its ends' velocities are taken from, in seconds.
SUPPORT_S = 0.04

#: How many neighbours carry a marker over a gap, and how many frames they are learnt from.
NEIGHBOURS, TRAINING_FRAMES = 6, 300

#: Weight of the ridge in the neighbours' regression, in square millimetres a frame: the size of the markers' jitter.
RIDGE_MM2 = 0.05


def gap_runs(take: Take) -> dict[str, np.ndarray]:
    """For each marker, the (R, 2) first frame and frame after the last of each of its gaps."""
    missing = np.isnan(take.positions[..., 0])
    return {label: runs(missing[:, marker]) for marker, label in enumerate(take.labels)}


def _end(trajectory: np.ndarray, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity (per frame) at the last of some frames, from a parabola (or a line) through them all.

    Jitter would send a spline through two single frames astray by more than the gap's own motion.
    """
    at = frames - frames[-1]
    powers = np.vander(at, 3 if len(at) >= 6 else 2, increasing=True)
    coefficients, *_ = np.linalg.lstsq(powers, trajectory[frames], rcond=None)
    return trajectory[frames[-1]], coefficients[1]


def _spline(trajectory: np.ndarray, begin: int, end: int, support: int) -> bool:
    """Fill one short gap in place by a cubic through both sides (Hermite's form); False where a side has no support."""
    before = np.arange(max(0, begin - support), begin)
    after = np.arange(end, min(len(trajectory), end + support))
    before = before[np.isfinite(trajectory[before, 0])]
    after = after[np.isfinite(trajectory[after, 0])]
    before = before[before > before[-1] - support] if len(before) else before
    if len(before) < 2 or len(after) < 2:
        return False
    left, left_velocity = _end(trajectory, before)
    right, right_velocity = _end(trajectory, after[::-1])
    span = end - (begin - 1)
    t = ((np.arange(begin, end) - (begin - 1)) / span)[:, None]
    trajectory[begin:end] = (
        (2 * t**3 - 3 * t**2 + 1) * left
        + (t**3 - 2 * t**2 + t) * span * left_velocity
        + (-2 * t**3 + 3 * t**2) * right
        + (t**3 - t**2) * span * right_velocity
    )
    return True


def _carry(positions: np.ndarray, known: np.ndarray, marker: int, begin: int, end: int, near: np.ndarray) -> bool:
    """Fill one longer gap in place from the motion of the neighbours; False where they do not suffice.

    The neighbours' rigid motion gives a moving frame. In it, the marker's place is learnt from the neighbours'
    deviations by ridge regression over frames in which all are seen; a line in time then joins the known ends.
    """
    sides = [frame for frame in (begin - 1, end) if 0 <= frame < len(positions)]
    window = np.arange(max(0, begin - 1), min(len(positions), end + 1))
    carriers = [other for other in near if known[window, other].all()][:NEIGHBOURS]
    if len(carriers) < 3 or len(sides) < 2:
        return False
    together = np.flatnonzero(known[:, [*carriers, marker]].all(axis=1))
    if len(together) > TRAINING_FRAMES:  # those around the gap, and others from the whole take
        nearest = together[np.argsort(np.abs(together - (begin + end) / 2), kind="stable")[: TRAINING_FRAMES // 2]]
        spaced = together[np.linspace(0, len(together) - 1, TRAINING_FRAMES // 2).astype(int)]
        together = np.union1d(nearest, spaced)
    together = np.union1d(together, sides)
    frames = np.concatenate((together, np.arange(begin, end)))
    shape = np.median(positions[np.ix_(together, carriers)], axis=0)
    shape = positions[sides[0], carriers] if not np.isfinite(shape).all() else shape
    reference = positions[sides[0], carriers]
    moving = positions[np.ix_(frames, carriers)]
    poses = rigid_transforms(reference, moving, np.ones((len(frames), len(carriers))))
    back = inverse(poses)
    deviations = (apply(back, moving) - reference).reshape(len(frames), -1)
    own = apply(back[: len(together)], positions[together, marker][:, None])[:, 0]
    train = deviations[: len(together)]
    middle, own_middle = train.mean(axis=0), own.mean(axis=0)
    normal = (train - middle).T @ (train - middle)
    normal[np.diag_indices_from(normal)] += RIDGE_MM2 * len(together)
    slopes = np.linalg.solve(normal, (train - middle).T @ (own - own_middle))
    predicted = own_middle + (deviations - middle) @ slopes
    at_sides = np.searchsorted(together, sides)
    errors = own[at_sides] - predicted[at_sides]
    part = ((np.arange(begin, end) - (begin - 1)) / (end - begin + 1))[:, None]
    joined = predicted[len(together) :] + (1 - part) * errors[0] + part * errors[1]
    positions[begin:end, marker] = apply(poses[len(together) :], joined[:, None])[:, 0]
    return True


def fill_gaps(take: Take, *, short_s: float = SHORT_S, long_s: float = LONG_S) -> Take:
    """The take with its gaps filled where that can be done well; the rest stays NaN.

    Gaps up to `short_s` are bridged by a cubic that joins position and velocity on both sides. Gaps up to `long_s`
    follow the neighbouring markers: their rigid motion, and what the marker does against them elsewhere in the take
    (least squares). Longer gaps, and gaps at the take's ends, stay.

    Parameters
    ----------
    take : Take
    short_s, long_s : float
        Limits in seconds.

    Raises
    ------
    SignfaceError
        A limit is negative or not a number.
    """
    if not (short_s >= 0 and long_s >= 0):
        raise SignfaceError("the longest gaps to fill are given in seconds, 0 or more")
    positions = take.positions.copy()
    missing = np.isnan(positions[..., 0])
    support = max(3, round(SUPPORT_S * take.rate) + 1)
    counts = {"splined": 0, "from neighbours": 0, "left": 0}
    later: list[tuple[int, int, int]] = []
    for marker in np.flatnonzero(missing.any(axis=0)):
        trajectory = positions[:, marker].copy()
        original = trajectory.copy()
        for begin, end in runs(missing[:, marker]):
            if (end - begin) / take.rate > short_s:
                later.append((int(marker), int(begin), int(end)))
                continue
            piece = original.copy() if False else trajectory
            if _spline(piece, int(begin), int(end), support):
                counts["splined"] += 1
            else:
                later.append((int(marker), int(begin), int(end)))
        positions[:, marker] = trajectory
    known = np.isfinite(positions[..., 0])
    distances = _rest_distances(take.positions)
    filled = positions.copy()
    for marker, begin, end in later:
        near = np.argsort(distances[marker], kind="stable")
        near = near[np.isfinite(distances[marker, near])]
        if (end - begin) / take.rate <= long_s and _carry(filled, known, marker, begin, end, near):
            counts["from neighbours"] += 1
        else:
            counts["left"] += 1
    said = ", ".join(f"{number} {what}" for what, number in counts.items() if number)
    return take.changed(f"fill_gaps up to {short_s:g} and {long_s:g} s: {said or 'no gaps'}", positions=filled)


def _rest_distances(positions: np.ndarray) -> np.ndarray:
    """(M, M) typical distances between markers, mm: the median over some frames; infinite to itself and when unknown."""
    sample = positions[:: max(1, len(positions) // 50)]
    apart = np.linalg.norm(sample[:, :, None] - sample[:, None], axis=3)
    apart = np.sort(apart, axis=0)  # NaN sorts last
    counts = np.isfinite(apart).sum(axis=0)
    middle = np.take_along_axis(apart, np.maximum(counts - 1, 0)[None] // 2, axis=0)[0]
    middle[counts == 0] = np.inf
    np.fill_diagonal(middle, np.inf)
    return middle
