"""Taking head motion away: rigid alignment in two steps (thesis, 5.2.1).

- `rigid_transform`: the best rigid motion between two point sets.
- `align_neutral`: the neutral frame's face markers onto the avatar's points.
- `stabilise`: every frame onto the neutral frame by the head markers.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from signface.errors import SignfaceError
from signface.takes.rigid import apply, flatness, inverse, rigid_transforms
from signface.takes.runs import runs
from signface.takes.take import Take

#: Markers nearer than this to one line (root mean square, mm) do not fix a rotation about it.
FLATTEST = 1.0

#: A head marker this far (mm) from where the others place it counts half; far ones hardly count (Cauchy weights).
#: Noisy recordings get a greater one: twice the typical distance.
SLIP_MM = 0.5

#: Poses are interpolated over at most this long without enough head markers, in seconds.
LONGEST_BLIND_S = 0.25


def rigid_transform(source: np.ndarray, target: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
    """The proper rotation and translation that bring `source` onto `target`, by weighted least squares.

    Parameters
    ----------
    source, target : (Q, 3) array
        Points with NaN in either are left out.
    weights : (Q,) array, optional
        Not negative; 1 by default.

    Returns
    -------
    (4, 4) array
        `target = pose @ source`.

    Raises
    ------
    SignfaceError
        Fewer than three points in both, or they lie on one line.

    Examples
    --------
    >>> points = np.array([[0.0, 0, 0], [100, 0, 0], [0, 100, 0]])
    >>> rigid_transform(points, points + [1, 2, 3])[:3, 3].round(6).tolist()
    [1.0, 2.0, 3.0]
    """
    source, target = np.asarray(source, dtype=np.float64), np.asarray(target, dtype=np.float64)
    own = np.ones(len(source)) if weights is None else np.asarray(weights, dtype=np.float64)
    seen = np.isfinite(source).all(axis=1) & np.isfinite(target).all(axis=1) & (own > 0)
    own = np.where(seen, own, 0.0)[None]
    if seen.sum() < 3:
        raise SignfaceError(f"a rigid motion needs 3 common points, and there are {int(seen.sum())}")
    spread = np.ptp(source[seen], axis=0).max()
    if min(flatness(source, own)[0], flatness(target, own)[0]) <= 1e-6 * max(spread, 1e-300):
        raise SignfaceError("the points lie on one line and do not fix a rotation")
    return rigid_transforms(source, target[None], own)[0]


def align_neutral(take: Take, labels: Sequence[str], points: np.ndarray, neutral_s: float) -> Take:
    """The take moved rigidly as a whole, so that its neutral frame's face markers lie on the avatar's points.

    The first step of the thesis' stabilisation (5.2.1). Nothing is scaled: fitting the signer's face to the
    avatar's is the morphological adaptation's work.

    Parameters
    ----------
    take : Take
    labels : (P,) sequence of str
        Face markers.
    points : (P, 3) array
        Where they stand on the avatar's neutral face, millimetres.
    neutral_s : float
        Time of the neutral frame in seconds.

    Raises
    ------
    SignfaceError
        The time is outside the take, or the neutral frame shows fewer than three of the markers.
    """
    frame = take.frame_at(neutral_s)
    try:
        pose = rigid_transform(take.select(labels)[frame], points)
    except SignfaceError as error:
        raise SignfaceError(
            f"the neutral frame at {neutral_s:.3f} s cannot be aligned: {error.problem}",
            file=take.name,
            hint="choose a neutral frame that shows the face markers",
        ) from error
    return take.changed(
        f"align_neutral {len(labels)} markers at {neutral_s:.3f} s", positions=apply(pose, take.positions)
    )


def _head_poses(head: np.ndarray, neutral: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(F, 4, 4) poses by iteratively reweighted least squares and the (F, Q) distances that remain, mm.

    Parameters
    ----------
    head : (F, Q, 3) array
    neutral : (Q, 3) array
        Without NaN.
    """
    seen = np.isfinite(head[..., 0])
    enough = flatness(neutral, seen.astype(float)) >= FLATTEST
    weights = (seen & enough[:, None]).astype(float)
    poses = rigid_transforms(neutral, head, weights)
    distances = np.linalg.norm(apply(poses, neutral) - head, axis=2)
    known = np.isfinite(distances)
    slip = max(SLIP_MM, 2 * float(np.median(distances[known]))) if known.any() else SLIP_MM
    busy = np.flatnonzero((np.nan_to_num(distances) > 0.25 * slip).any(axis=1) & (seen.sum(axis=1) > 3))
    for _ in range(10):
        if len(busy) == 0:
            break
        own = weights[busy] / (1 + (np.nan_to_num(distances[busy]) / slip) ** 2)
        poses[busy] = rigid_transforms(neutral, head[busy], own)
        before = distances[busy]
        distances[busy] = np.linalg.norm(apply(poses[busy], neutral) - head[busy], axis=2)
        busy = busy[(np.abs(np.nan_to_num(distances[busy] - before)) > 0.02 * slip).any(axis=1)]
    return poses, distances


def _bridge(poses: np.ndarray, longest: int) -> int:
    """Fill short stretches of NaN poses in place between known ones (slerp and straight lines); how many frames."""
    from scipy.spatial.transform import Rotation, Slerp

    blind = np.isnan(poses[:, 0, 0])
    filled = 0
    for begin, end in runs(blind):
        if begin == 0 or end == len(poses) or end - begin > longest:
            continue
        ends = [begin - 1, end]
        between = np.arange(begin, end)
        part = ((between - ends[0]) / (ends[1] - ends[0]))[:, None]
        poses[begin:end] = np.eye(4)
        poses[begin:end, :3, :3] = Slerp(ends, Rotation.from_matrix(poses[ends, :3, :3]))(between).as_matrix()
        poses[begin:end, :3, 3] = (1 - part) * poses[ends[0], :3, 3] + part * poses[ends[1], :3, 3]
        filled += end - begin
    return filled


def least_moving(take: Take, neutral_s: float, labels: Sequence[str] | None = None) -> list[str]:
    """The markers that move least relative to one another: a stand-in for head markers.

    All markers give first poses; those that keep their place best under them give the next, three times over, until
    a fifth of the markers (at least six) is left.

    Raises
    ------
    SignfaceError
        The neutral frame shows fewer than three markers.
    """
    names = list(take.labels if labels is None else labels)
    frame = take.frame_at(neutral_s)
    step = max(1, take.n_frames // 600)
    positions = take.select(names)
    shown = np.isfinite(positions[frame, :, 0])
    names = [name for name, own in zip(names, shown) if own]
    neutral, sample = positions[frame, shown], positions[::step, shown]
    if len(names) < 3:
        raise SignfaceError(
            f"the neutral frame at {neutral_s:.3f} s shows {len(names)} markers, and 3 are needed", file=take.name
        )
    chosen = np.arange(len(names))
    for part in (0.6, 0.35, 0.2):
        poses, _ = _head_poses(sample[:, chosen], neutral[chosen])
        away = np.linalg.norm(apply(inverse(poses), sample) - neutral, axis=2)
        seen = np.isfinite(away).mean(axis=0)
        moves = np.where(seen > 0.5, np.sqrt(np.nanmean(np.where(np.isfinite(away), away, 1e6) ** 2, axis=0)), np.inf)
        order = np.argsort(moves, kind="stable")
        count = min(len(names), max(6, round(part * len(names))))
        while count < len(names) and flatness(neutral, np.isin(range(len(names)), order[:count])[None])[0] < 10.0:
            count += 1  # six points of one brow do not carry a head
        chosen = np.sort(order[:count])
    return [names[index] for index in chosen]


def stabilise(
    take: Take, *, head: Sequence[str], neutral_s: float, fallback: str | None = None
) -> tuple[Take, np.ndarray]:
    """The take without head motion: every frame brought onto the neutral frame by the head markers.

    The second step of the thesis' stabilisation (5.2.1): weighted least squares with a proper rotation, robust to
    head markers that are missing or have slipped (weights are found again from the distances that remain). A
    frame that shows fewer than three head markers, or only markers on one line, gets a pose interpolated between its
    neighbours over at most 0.25 s; in longer stretches its pose and its markers are NaN.

    Parameters
    ----------
    take : Take
    head : sequence of str
        Labels of the head markers; those that are not in the take are passed over.
    neutral_s : float
        Time of the neutral frame in seconds.
    fallback : str, optional
        `least-moving`: where the head markers do not suffice, use the markers that move least.

    Returns
    -------
    (Take, (F, 4, 4) array)
        The take in the neutral frame's place, and the head's poses: each maps a point of the neutral head to its
        place in the recording, millimetres.

    Raises
    ------
    SignfaceError
        Fewer than three head markers that are not on one line (and no fallback), or the time is outside the take.
    """
    if fallback not in (None, "least-moving"):
        raise SignfaceError(f"no fallback named {fallback}", hint="the fallback is least-moving")
    frame = take.frame_at(neutral_s)
    present = [label for label in head if label in take.labels]
    shown = [label for label in present if np.isfinite(take.select([label])[frame, 0, 0])]
    places = take.select(shown)[frame] if shown else np.zeros((0, 3))
    note = f"stabilise by {len(shown)} head markers"
    if len(shown) < 3 or flatness(places, np.ones((1, len(shown))))[0] < FLATTEST:
        if fallback is None:
            why = "and 3 are needed" if len(shown) < 3 else "but they lie on one line"
            raise SignfaceError(
                f"the neutral frame at {neutral_s:.3f} s shows {len(shown)} of {len(list(head))} head markers, {why}",
                file=take.name,
                hint="choose another neutral frame, or the fallback least-moving",
            )
        shown = least_moving(take, neutral_s)
        places = take.select(shown)[frame]
        note = f"stabilise by the {len(shown)} least-moving markers ({', '.join(shown[:6])}{' ...' * (len(shown) > 6)})"
        if flatness(places, np.ones((1, len(shown))))[0] < FLATTEST:
            raise SignfaceError("the markers lie on one line and do not fix a rotation", file=take.name)
    trajectories = take.select(shown)
    poses, distances = _head_poses(trajectories, places)
    bridged = _bridge(poses, int(LONGEST_BLIND_S * take.rate))
    blind = int(np.isnan(poses[:, 0, 0]).sum())
    typical = [float(np.nanmedian(own)) if np.isfinite(own).any() else 0.0 for own in distances.T]
    farthest = [float(np.nanquantile(own, 0.9)) if np.isfinite(own).any() else 0.0 for own in distances.T]
    limit = 4 * max(SLIP_MM, float(np.median(typical)))
    slipped = [f"{label} ({far:.1f} mm)" for label, far in zip(shown, farthest) if far > limit]
    note += f"; slipped: {', '.join(slipped)}" if slipped else ""
    note += f"; {bridged} frames interpolated" if bridged else ""
    note += f"; {blind} frames without a pose" if blind else ""
    return take.changed(note, positions=apply(inverse(poses), take.positions)), poses
