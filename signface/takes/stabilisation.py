"""Taking head motion away: rigid alignment in two steps (thesis, 5.2.1).

- `rigid_transform`: the best rigid motion between two point sets.
- `align_neutral`: the neutral frame's face markers onto the avatar's points; `NeutralAlignment`: the same as a stage.
- `stabilise`: every frame onto the neutral frame by the head markers; `HeadMotion`: the same as a stage.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from signface.errors import SignfaceError
from signface.frames import runs
from signface.takes.rigid import apply, flatness, inverse, rigid_transforms
from signface.takes.stages import Block, Stage, View, block_of, run
from signface.takes.take import Take, columns_of

#: Markers nearer than this to one line (root mean square, mm) do not fix a rotation about it.
FLATTEST = 1.0

#: A head marker this far (mm) from where the others place it counts half; far ones hardly count (Cauchy weights).
#: Noisy recordings get a greater one: twice the typical distance.
SLIP_MM = 0.5

#: A head marker has slipped where, in the worst tenth of the frames, it is farther than this (mm) from where the
#: others place it, and than this many times the distance usual among them: trackers of pictures are millimetres off as
#: the head turns, with all landmarks alike. (Four times the median distance, without regard to that, named some in 36
#: of 62 takes of real signers, this in 5.)
SLIPPED_MM, SLIPPED = 2.0, 3.0

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
    shares = np.ones(len(source)) if weights is None else np.asarray(weights, dtype=np.float64)
    seen = np.isfinite(source).all(axis=1) & np.isfinite(target).all(axis=1) & (shares > 0)
    shares = np.where(seen, shares, 0.0)[None]
    if seen.sum() < 3:
        raise SignfaceError(f"a rigid motion needs 3 common points, and there are {int(seen.sum())}")
    spread = np.ptp(source[seen], axis=0).max()
    if min(flatness(source, shares)[0], flatness(target, shares)[0]) <= 1e-6 * max(spread, 1e-300):
        raise SignfaceError("the points lie on one line and do not fix a rotation")
    return rigid_transforms(source, target[None], shares)[0]


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

    See Also
    --------
    stabilise : the second step.
    rigid_transform : the motion that is found.

    Examples
    --------
    >>> import signface as sf
    >>> face = sf.read_face("default")
    >>> take = sf.datasets.mini_take()
    >>> layout = sf.choose_layout(take.labels, face)
    >>> points = layout.points(face)
    >>> aligned = align_neutral(take, layout.face_labels, points, neutral_s=0.1)
    >>> away = aligned.select(layout.face_labels)[aligned.frame_at(0.1)] - points
    >>> bool(np.linalg.norm(np.nanmean(away, axis=0)) < 1e-6)
    True
    """
    return run(take, NeutralAlignment(labels, points, neutral_s))


class NeutralAlignment(Stage):
    """The recording moved rigidly as a whole onto the avatar; see `align_neutral`, whose parameters it has.

    With `rest`, (M, 3) places of the markers on the signer's resting face, these stand for the neutral frame.
    """

    def __init__(
        self, labels: Sequence[str], points: np.ndarray, neutral_s: float, *, rest: np.ndarray | None = None
    ) -> None:
        self._labels, self._points, self._neutral_s, self._rest = list(labels), points, neutral_s, rest

    def learn(self, view: View) -> None:
        """The rigid motion, from the neutral frame."""
        recording, neutral = view.recording, self._rest
        if neutral is None:
            frame = recording.frame_at(self._neutral_s)
            neutral = recording.frames(frame, frame + 1)[0, columns_of(recording, self._labels)]
        try:
            self._pose = rigid_transform(neutral, self._points)
        except SignfaceError as error:
            raise SignfaceError(
                f"the neutral frame at {self._neutral_s:.3f} s cannot be aligned: {error.problem}",
                file=recording.name,
                hint="choose a neutral frame that shows the face markers",
            ) from error

    def apply(self, block: Block) -> Block:
        """The block in the avatar's place."""
        return block.changed(apply(self._pose, block.positions))

    @property
    def note(self) -> str:
        """By how many markers, and when."""
        when = f"at {self._neutral_s:.3f} s" if self._rest is None else "of the signer's rest"
        return f"align_neutral {len(self._labels)} markers {when}"


def _unweighted(head: np.ndarray, neutral: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Weights (0 or 1), poses and the distances that remain, before any marker is found to have slipped."""
    seen = np.isfinite(head[..., 0])
    enough = flatness(neutral, seen.astype(float)) >= FLATTEST
    weights = (seen & enough[:, None]).astype(float)
    poses = rigid_transforms(neutral, head, weights)
    return weights, poses, np.linalg.norm(apply(poses, neutral) - head, axis=2)


def _slip(head: np.ndarray, neutral: np.ndarray) -> float:
    """The distance (mm) at which a head marker counts half, from (F, Q, 3) frames of them."""
    distances = _unweighted(head, neutral)[2]
    known = np.isfinite(distances)
    return max(SLIP_MM, 2 * float(np.median(distances[known]))) if known.any() else SLIP_MM


def _head_poses(head: np.ndarray, neutral: np.ndarray, slip: float) -> tuple[np.ndarray, np.ndarray]:
    """(F, 4, 4) poses by iteratively reweighted least squares and the (F, Q) distances that remain, mm.

    Parameters
    ----------
    head : (F, Q, 3) array
    neutral : (Q, 3) array
        In the neutral frame; without NaN.
    slip : float
        See `_slip`.
    """
    weights, poses, distances = _unweighted(head, neutral)
    busy = np.flatnonzero((np.nan_to_num(distances) > 0.25 * slip).any(axis=1) & ((weights > 0).sum(axis=1) > 3))
    for _ in range(10):
        if len(busy) == 0:
            break
        trust = weights[busy] / (1 + (np.nan_to_num(distances[busy]) / slip) ** 2)
        poses[busy] = rigid_transforms(neutral, head[busy], trust)
        before = distances[busy]
        distances[busy] = np.linalg.norm(apply(poses[busy], neutral) - head[busy], axis=2)
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
        share = ((between - ends[0]) / (ends[1] - ends[0]))[:, None]
        poses[begin:end] = np.eye(4)
        poses[begin:end, :3, :3] = Slerp(ends, Rotation.from_matrix(poses[ends, :3, :3]))(between).as_matrix()
        poses[begin:end, :3, 3] = (1 - share) * poses[ends[0], :3, 3] + share * poses[ends[1], :3, 3]


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
    known = np.isfinite(neutral[:, 0])
    names = [label for label, here in zip(labels, known) if here]
    neutral, sample = neutral[known], sample[:, known]
    if len(names) < 3:
        raise SignfaceError(f"the neutral frame shows {len(names)} markers, and 3 are needed", file=name)
    chosen = np.arange(len(names))
    for share in (0.6, 0.35, 0.2):
        slip = _slip(sample[:, chosen], neutral[chosen])
        poses, _ = _head_poses(sample[:, chosen], neutral[chosen], slip)
        away = np.linalg.norm(apply(inverse(poses), sample) - neutral, axis=2)
        seen = np.isfinite(away).mean(axis=0)
        moves = np.where(seen > 0.5, np.sqrt(np.nanmean(np.where(np.isfinite(away), away, 1e6) ** 2, axis=0)), np.inf)
        order = np.argsort(moves, kind="stable")
        count = min(len(names), max(6, round(share * len(names))))
        while count < len(names) and flatness(neutral, np.isin(range(len(names)), order[:count])[None])[0] < 10.0:
            count += 1  # six points of one brow do not carry a head
        chosen = np.sort(order[:count])
    return [names[index] for index in chosen]


class HeadMotion(Stage):
    """The motion of the head taken away; see `stabilise`, whose parameters and errors it has.

    Blocks get the head's poses. Frames that stand alone get none from their neighbours. With `rest`, places of markers
    on the signer's resting face by label, these stand for the neutral frame.

    Attributes
    ----------
    labels : list of str
        The markers that carry the head, once it has learnt.
    """

    def __init__(
        self,
        head: Sequence[str],
        *,
        neutral_s: float,
        fallback: str | None = None,
        rest: Mapping[str, np.ndarray] | None = None,
    ) -> None:
        if fallback not in (None, "least-moving"):
            raise SignfaceError(f"no fallback named {fallback}", hint="the fallback is least-moving")
        self._head, self._neutral_s, self._fallback, self._rest = list(head), neutral_s, fallback, rest

    def learn(self, view: View) -> None:
        """Which markers carry the head, where they are in the neutral frame, and how well they keep their places."""
        recording = view.recording
        if self._rest is None:
            frame = recording.frame_at(self._neutral_s)
            neutral = recording.frames(frame, frame + 1)[0]
        else:
            neutral = np.array([self._rest.get(label, np.full(3, np.nan)) for label in recording.labels])
        sample = view.spread(SAMPLE_FRAMES).positions
        column = {label: index for index, label in enumerate(recording.labels)}
        carriers = [label for label in self._head if label in column and np.isfinite(neutral[column[label], 0])]
        self._note = f"by {len(carriers)} head markers"
        if len(carriers) < 3 or _flat(neutral[[column[label] for label in carriers]]):
            if self._fallback is None:
                why = "and 3 are needed" if len(carriers) < 3 else "but they lie on one line"
                raise SignfaceError(
                    f"the neutral frame at {self._neutral_s:.3f} s shows {len(carriers)} of {len(self._head)}"
                    f" head markers, {why}",
                    file=recording.name,
                    hint="choose another neutral frame, or the fallback least-moving (--head-fallback least-moving)",
                )
            few = sample[:: max(1, len(sample) // 600)]
            carriers = least_moving(recording.labels, neutral, few, recording.name)
            names = ", ".join(carriers[:6]) + " ..." * (len(carriers) > 6)
            self._note = f"by the {len(carriers)} least-moving markers ({names})"
            if _flat(neutral[[column[label] for label in carriers]]):
                raise SignfaceError("the markers lie on one line and do not fix a rotation", file=recording.name)
        self.labels = carriers
        self._columns = [column[label] for label in carriers]
        self._neutral = neutral[self._columns]
        self._slip = _slip(sample[:, self._columns], self._neutral)
        self._longest = int(LONGEST_BLIND_S * recording.rate)
        self.reach = self._longest + 1
        self._distances = np.full((recording.n_frames, len(carriers)), np.nan)
        self._bridged, self._blind = np.zeros((2, recording.n_frames), dtype=bool)

    def apply(self, block: Block) -> Block:
        """The block in the neutral frame's place, with the head's poses."""
        poses, distances = _head_poses(block.positions[:, self._columns], self._neutral, self._slip)
        if block.frames.step == 1:
            unseen = np.isnan(poses[:, 0, 0])
            _bridge(poses, self._longest)
            wanted, blind = block.frames[block.inner], np.isnan(poses[:, 0, 0])
            frames = slice(wanted.start, wanted.stop)
            self._distances[frames] = distances[block.inner]
            self._blind[frames], self._bridged[frames] = blind[block.inner], (unseen & ~blind)[block.inner]
        return block.changed(apply(inverse(poses), block.positions), head=poses)

    @property
    def note(self) -> str:
        """Which markers carry the head, which of them slipped, and where there was no pose, until now."""
        columns = self._distances.T
        farthest = [float(np.nanquantile(column, 0.9)) if np.isfinite(column).any() else 0.0 for column in columns]
        limit = max(SLIPPED_MM, SLIPPED * float(np.median(farthest)))
        slipped = [f"{label} ({far:.1f} mm)" for label, far in zip(self.labels, farthest) if far > limit]
        bridged, blind = int(self._bridged.sum()), int(self._blind.sum())
        note = f"stabilise {self._note}"
        note += f"; slipped: {', '.join(slipped)}" if slipped else ""
        note += f"; {bridged} frames interpolated" if bridged else ""
        return note + (f"; {blind} frames without a pose" if blind else "")


def _flat(neutral: np.ndarray) -> bool:
    return bool(flatness(neutral, np.ones((1, len(neutral))))[0] < FLATTEST)


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

    See Also
    --------
    align_neutral : the first step.
    signface.takes.neutral.find_neutral : a neutral time.

    Examples
    --------
    >>> import signface as sf
    >>> take = sf.datasets.mini_take()
    >>> layout = sf.choose_layout(take.labels, sf.read_face("default"))
    >>> still, poses = stabilise(take, head=layout.head_labels, neutral_s=0.1)
    >>> poses.shape, still.history[-1]
    ((1184, 4, 4), 'stabilise by 6 head markers')
    """
    view = View(take).through(HeadMotion(head, neutral_s=neutral_s, fallback=fallback))
    block = block_of(view.recording, 0, take.n_frames)
    assert block.head is not None
    return replace(take, positions=block.positions, history=view.recording.history), block.head
