"""Taking head motion away: rigid alignment in two steps (thesis, 5.2.1).

- `rigid_transform`: the best rigid motion between two point sets.
- `align_neutral`: the neutral frame's face markers onto the avatar's points.
- `stabilise`: every frame onto the neutral frame by the head markers; `HeadMotion`: the same in pieces.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from signface.errors import SignfaceError
from signface.frames import runs
from signface.takes.rigid import apply, flatness, inverse, rigid_transforms
from signface.takes.take import Take

#: Markers nearer than this to one line (root mean square, mm) do not fix a rotation about it.
FLATTEST = 1.0

#: A head marker this far (mm) from where the others place it counts half; far ones hardly count (Cauchy weights).
#: Noisy recordings get a greater one: twice the typical distance.
SLIP_MM = 0.5

#: Poses are interpolated over at most this long without enough head markers, in seconds.
LONGEST_BLIND_S = 0.25

#: Frames of a take, evenly spaced, that tell how well head markers keep their places: at least so many where there are.
SAMPLE_FRAMES = 1500


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
    pose = neutral_alignment(take.select(labels)[frame], points, take.name, neutral_s)
    return take.changed(
        f"align_neutral {len(labels)} markers at {neutral_s:.3f} s", positions=apply(pose, take.positions)
    )


def neutral_alignment(markers: np.ndarray, points: np.ndarray, name: str, neutral_s: float) -> np.ndarray:
    """(4, 4) pose that brings the neutral frame's (P, 3) face markers onto the avatar's; see `align_neutral`."""
    try:
        return rigid_transform(markers, points)
    except SignfaceError as error:
        raise SignfaceError(
            f"the neutral frame at {neutral_s:.3f} s cannot be aligned: {error.problem}",
            file=name,
            hint="choose a neutral frame that shows the face markers",
        ) from error


def _unweighted(head: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Weights (0 or 1), poses and the distances that remain, before any marker is found to have slipped."""
    seen = np.isfinite(head[..., 0])
    enough = flatness(places, seen.astype(float)) >= FLATTEST
    weights = (seen & enough[:, None]).astype(float)
    poses = rigid_transforms(places, head, weights)
    return weights, poses, np.linalg.norm(apply(poses, places) - head, axis=2)


def _slip(head: np.ndarray, places: np.ndarray) -> float:
    """The distance (mm) at which a head marker counts half, from (F, Q, 3) frames of them."""
    distances = _unweighted(head, places)[2]
    known = np.isfinite(distances)
    return max(SLIP_MM, 2 * float(np.median(distances[known]))) if known.any() else SLIP_MM


def _head_poses(head: np.ndarray, places: np.ndarray, slip: float) -> tuple[np.ndarray, np.ndarray]:
    """(F, 4, 4) poses by iteratively reweighted least squares and the (F, Q) distances that remain, mm.

    Parameters
    ----------
    head : (F, Q, 3) array
    places : (Q, 3) array
        In the neutral frame; without NaN.
    slip : float
        See `_slip`.
    """
    weights, poses, distances = _unweighted(head, places)
    busy = np.flatnonzero((np.nan_to_num(distances) > 0.25 * slip).any(axis=1) & ((weights > 0).sum(axis=1) > 3))
    for _ in range(10):
        if len(busy) == 0:
            break
        own = weights[busy] / (1 + (np.nan_to_num(distances[busy]) / slip) ** 2)
        poses[busy] = rigid_transforms(places, head[busy], own)
        before = distances[busy]
        distances[busy] = np.linalg.norm(apply(poses[busy], places) - head[busy], axis=2)
        busy = busy[(np.abs(np.nan_to_num(distances[busy] - before)) > 0.02 * slip).any(axis=1)]
    return poses, distances


def _bridge(poses: np.ndarray, longest: int) -> None:
    """Fill short stretches of NaN poses in place between known ones (slerp and straight lines)."""
    from scipy.spatial.transform import Rotation, Slerp

    blind = np.isnan(poses[:, 0, 0])
    for begin, end in runs(blind):
        if begin == 0 or end == len(poses) or end - begin > longest:
            continue
        ends = [begin - 1, end]
        between = np.arange(begin, end)
        part = ((between - ends[0]) / (ends[1] - ends[0]))[:, None]
        poses[begin:end] = np.eye(4)
        poses[begin:end, :3, :3] = Slerp(ends, Rotation.from_matrix(poses[ends, :3, :3]))(between).as_matrix()
        poses[begin:end, :3, 3] = (1 - part) * poses[ends[0], :3, 3] + part * poses[ends[1], :3, 3]


def least_moving(labels: Sequence[str], neutral: np.ndarray, sample: np.ndarray, name: str = "take") -> list[str]:
    """The markers that move least relative to one another: a stand-in for head markers.

    All markers give first poses; those that keep their place best under them give the next, three times over, until
    a fifth of the markers (at least six) is left.

    Parameters
    ----------
    labels : (M,) sequence of str
    neutral : (M, 3) array
        Where they are in the neutral frame.
    sample : (S, M, 3) array
        Frames of the take.
    name : str
        The take's, for errors.

    Raises
    ------
    SignfaceError
        The neutral frame shows fewer than three markers.
    """
    shown = np.isfinite(neutral[:, 0])
    names = [label for label, own in zip(labels, shown) if own]
    neutral, sample = neutral[shown], sample[:, shown]
    if len(names) < 3:
        raise SignfaceError(f"the neutral frame shows {len(names)} markers, and 3 are needed", file=name)
    chosen = np.arange(len(names))
    for part in (0.6, 0.35, 0.2):
        slip = _slip(sample[:, chosen], neutral[chosen])
        poses, _ = _head_poses(sample[:, chosen], neutral[chosen], slip)
        away = np.linalg.norm(apply(inverse(poses), sample) - neutral, axis=2)
        seen = np.isfinite(away).mean(axis=0)
        moves = np.where(seen > 0.5, np.sqrt(np.nanmean(np.where(np.isfinite(away), away, 1e6) ** 2, axis=0)), np.inf)
        order = np.argsort(moves, kind="stable")
        count = min(len(names), max(6, round(part * len(names))))
        while count < len(names) and flatness(neutral, np.isin(range(len(names)), order[:count])[None])[0] < 10.0:
            count += 1  # six points of one brow do not carry a head
        chosen = np.sort(order[:count])
    return [names[index] for index in chosen]


class HeadMotion:
    """The motion of the head in a recording, found once and taken away from any of its frames; see `stabilise`.

    Parameters
    ----------
    labels : (M,) sequence of str
        Of all markers.
    neutral : (M, 3) array
        Where they are in the neutral frame.
    sample : (S, M, 3) array
        Frames of the recording, evenly taken.
    rate : float
    head : sequence of str
        Labels of the head markers; those that are not among the markers are passed over.
    fallback : str, optional
        `least-moving`: where the head markers do not suffice, use the markers that move least.
    name : str
    neutral_s : float
        The take's, and the time of its neutral frame, for errors.

    Attributes
    ----------
    reach : int
        So many frames beside a piece decide its poses.

    Raises
    ------
    SignfaceError
        Fewer than three head markers that are not on one line (and no fallback).
    """

    def __init__(
        self,
        labels: Sequence[str],
        neutral: np.ndarray,
        sample: np.ndarray,
        rate: float,
        *,
        head: Sequence[str],
        fallback: str | None = None,
        name: str = "take",
        neutral_s: float = 0.0,
    ) -> None:
        if fallback not in (None, "least-moving"):
            raise SignfaceError(f"no fallback named {fallback}", hint="the fallback is least-moving")
        place = {label: index for index, label in enumerate(labels)}
        shown = [label for label in head if label in place and np.isfinite(neutral[place[label], 0])]
        said = f"by {len(shown)} head markers"
        if len(shown) < 3 or self._flat(neutral[[place[label] for label in shown]]):
            if fallback is None:
                why = "and 3 are needed" if len(shown) < 3 else "but they lie on one line"
                raise SignfaceError(
                    f"the neutral frame at {neutral_s:.3f} s shows {len(shown)} of {len(head)} head markers, {why}",
                    file=name,
                    hint="choose another neutral frame, or the fallback least-moving",
                )
            shown = least_moving(labels, neutral, sample[:: max(1, len(sample) // 600)], name)
            said = f"by the {len(shown)} least-moving markers ({', '.join(shown[:6])}{' ...' * (len(shown) > 6)})"
            if self._flat(neutral[[place[label] for label in shown]]):
                raise SignfaceError("the markers lie on one line and do not fix a rotation", file=name)
        self.labels = shown
        self._columns = [place[label] for label in shown]
        self._places = neutral[self._columns]
        self._slip = _slip(sample[:, self._columns], self._places)
        self._longest = int(LONGEST_BLIND_S * rate)
        self.reach = self._longest + 1
        self._said = said
        self._distances: list[np.ndarray] = []
        self._bridged = self._blind = 0

    @staticmethod
    def _flat(places: np.ndarray) -> bool:
        return bool(flatness(places, np.ones((1, len(places))))[0] < FLATTEST)

    def poses(self, positions: np.ndarray, piece: slice = slice(None)) -> np.ndarray:
        """(F, 4, 4) poses of (F, M, 3) positions, and what happened in the frames of `piece` noted."""
        poses, distances = _head_poses(positions[:, self._columns], self._places, self._slip)
        unseen = np.isnan(poses[piece, 0, 0])
        _bridge(poses, self._longest)
        blind = int(np.isnan(poses[piece, 0, 0]).sum())
        self._bridged += int(unseen.sum()) - blind
        self._blind += blind
        self._distances.append(distances[piece])
        return poses

    @property
    def note(self) -> str:
        """What was found until now, for the history."""
        columns = np.concatenate(self._distances).T
        typical = [float(np.nanmedian(own)) if np.isfinite(own).any() else 0.0 for own in columns]
        farthest = [float(np.nanquantile(own, 0.9)) if np.isfinite(own).any() else 0.0 for own in columns]
        limit = 4 * max(SLIP_MM, float(np.median(typical)))
        slipped = [f"{label} ({far:.1f} mm)" for label, far in zip(self.labels, farthest) if far > limit]
        note = f"stabilise {self._said}"
        note += f"; slipped: {', '.join(slipped)}" if slipped else ""
        note += f"; {self._bridged} frames interpolated" if self._bridged else ""
        return note + (f"; {self._blind} frames without a pose" if self._blind else "")


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
    neutral = take.positions[take.frame_at(neutral_s)]
    sample = take.positions[:: max(1, take.n_frames // SAMPLE_FRAMES)]
    motion = HeadMotion(
        take.labels,
        neutral,
        sample,
        take.rate,
        head=head,
        fallback=fallback,
        name=take.name,
        neutral_s=neutral_s,
    )
    poses = motion.poses(take.positions)
    return take.changed(motion.note, positions=apply(inverse(poses), take.positions)), poses
