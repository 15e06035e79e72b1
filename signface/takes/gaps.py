"""Filling gaps in trajectories.

- `fill_gaps`: short gaps by a spline, longer ones from the motion of the neighbouring markers.
- `GapFiller`: the same as a stage, for any recording.
- `gap_runs`: the gaps of each marker.
"""

from __future__ import annotations

import warnings

import numpy as np

from signface.errors import SignfaceError
from signface.frames import runs
from signface.takes.rigid import apply, flatness, inverse, rigid_transforms
from signface.takes.stages import Block, Stage, View, run
from signface.takes.take import Take

#: Default limits in seconds: gaps up to the first are splined, up to the second taken from the neighbours.
SHORT_S, LONG_S = 0.05, 0.5

#: The trajectory beside a gap that its ends' velocities are taken from, in seconds.
SUPPORT_S = 0.04

#: How many neighbours carry a marker over a gap, and how many frames they are learnt from.
NEIGHBOURS, TRAINING_FRAMES = 6, 300

#: Frames of a take, evenly spaced, among which those to learn from are looked for: at least so many where there are.
SAMPLE_FRAMES = 1500

#: Markers nearer than this to one line (root mean square, mm) do not carry a head.
FLATTEST_MM = 5.0

#: Weight of the ridge in the neighbours' regression, in square millimetres a frame: the size of the markers' jitter.
RIDGE_MM2 = 0.05


def gap_runs(take: Take) -> dict[str, np.ndarray]:
    """For each marker, the (R, 2) first frame and frame after the last of each of its gaps.

    See Also
    --------
    fill_gaps : fill them.

    Examples
    --------
    >>> take = Take([[[np.nan] * 3], [[0, 0, 0]], [[np.nan] * 3]], ("NOSE",), rate=50)
    >>> gap_runs(take)["NOSE"].tolist()
    [[0, 1], [2, 3]]
    """
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


def _spline(trajectory: np.ndarray, begin: int, end: int, support: int) -> np.ndarray | None:
    """(end - begin, 3) positions over a short gap: a cubic that joins both sides, or None where one has no support."""
    before = np.arange(max(0, begin - support), begin)
    after = np.arange(end, min(len(trajectory), end + support))
    before = before[np.isfinite(trajectory[before, 0])]
    after = after[np.isfinite(trajectory[after, 0])]
    if len(before) < 2 or len(after) < 2:
        return None
    left, left_velocity = _end(trajectory, before)
    right, right_velocity = _end(trajectory, after[::-1])
    span = end - begin + 1
    t = (np.arange(1, span) / span)[:, None]
    return (
        (2 * t**3 - 3 * t**2 + 1) * left
        + (t**3 - 2 * t**2 + t) * span * left_velocity
        + (-2 * t**3 + 3 * t**2) * right
        + (t**3 - t**2) * span * right_velocity
    )


class _Carriers:
    """What fills a marker's longer gaps: the other markers, seen from the head.

    All markers together give every frame a rigid pose, and so a place of each marker in the head, whatever the
    head does. There a marker's place is learnt from its neighbours' places by ridge regression over frames in which
    all are seen.

    Parameters
    ----------
    sample : (S, M, 3) array
        Frames of the take to learn from.
    """

    def __init__(self, sample: np.ndarray) -> None:
        known = np.isfinite(sample[..., 0])
        self.rest = sample[np.argmax(known.sum(axis=1))]
        weights = (known & np.isfinite(self.rest[:, 0])).astype(float)
        poses = rigid_transforms(np.nan_to_num(self.rest), sample, weights)
        poses[weights.sum(axis=1) < 3] = np.nan
        self.in_head = apply(inverse(poses), sample)  # (S, M, 3) in the head
        self.seen = np.isfinite(self.in_head[..., 0])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # markers that are never seen
            middle = np.nanmedian(self.in_head[:: max(1, len(sample) // 200)], axis=0)
        distances = np.linalg.norm(middle[:, None] - middle[None], axis=2)
        np.fill_diagonal(distances, np.inf)
        self.nearest = np.argsort(np.where(np.isfinite(distances), distances, np.inf), axis=1, kind="stable")

    def fill(self, positions: np.ndarray, marker: int, begin: int, end: int) -> np.ndarray | None:
        """(end - begin, 3) positions over a gap, or None where the neighbours do not suffice."""
        if begin == 0 or end == len(positions):
            return None
        recorded = positions[begin - 1 : end + 1]
        known = np.isfinite(recorded[..., 0])
        near = self.nearest[marker]
        carriers = near[known[:, near].all(axis=0) & (near != marker)][:NEIGHBOURS]
        if len(carriers) < 3 or not known[[0, -1], marker].all():
            return None
        together = np.flatnonzero(self.seen[:, carriers].all(axis=1) & self.seen[:, marker])
        if len(together) == 0:
            return None
        if len(together) > TRAINING_FRAMES:
            together = together[np.linspace(0, len(together) - 1, TRAINING_FRAMES).astype(int)]
        train = self.in_head[together][:, carriers].reshape(len(together), -1)
        carried = self.in_head[together, marker]
        middle, carried_middle = train.mean(axis=0), carried.mean(axis=0)
        normal = (train - middle).T @ (train - middle)
        normal[np.diag_indices_from(normal)] += RIDGE_MM2 * len(together)
        slopes = np.linalg.solve(normal, (train - middle).T @ (carried - carried_middle))
        # Over the gap the pose comes from one set of markers: it would jump where a marker comes or goes.
        steady = known.all(axis=0) & np.isfinite(self.rest[:, 0])
        steady[marker] = False
        if flatness(self.rest, steady[None])[0] < FLATTEST_MM:
            return None
        poses = rigid_transforms(self.rest[steady], recorded[:, steady], np.ones((len(recorded), steady.sum())))
        back = inverse(poses)
        over = apply(back, recorded[:, carriers]).reshape(len(recorded), -1)
        predicted = carried_middle + (over - middle) @ slopes
        errors = apply(back[[0, -1]], recorded[[0, -1], marker][:, None])[:, 0] - predicted[[0, -1]]
        share = np.linspace(0.0, 1.0, end - begin + 2)[:, None]
        joined = predicted + (1 - share) * errors[0] + share * errors[1]  # a line in time joins the known ends
        return apply(poses[1:-1], joined[1:-1, None])[:, 0]


class GapFiller(Stage):
    """Fills the gaps of a recording; see `fill_gaps`, whose parameters and errors it has."""

    alone = False

    def __init__(self, *, short_s: float = SHORT_S, long_s: float = LONG_S) -> None:
        if not (short_s >= 0 and long_s >= 0):
            raise SignfaceError("the longest gaps to fill are given in seconds, 0 or more")
        self.short_s, self.long_s = short_s, long_s
        self._carriers: _Carriers | None = None
        self._outcomes: dict[tuple[int, int], str] = {}

    def learn(self, view: View) -> None:
        """How far gaps are looked over. How markers follow their neighbours is learnt when a gap asks for it."""
        self._view, self._rate = view, view.recording.rate
        self._support = max(3, round(SUPPORT_S * self._rate) + 1)
        self.reach = int(np.ceil(max(self.short_s, self.long_s) * self._rate)) + self._support + 1

    def apply(self, block: Block) -> Block:
        """The block with its gaps filled."""
        wanted = block.wanted or block.frames
        first = block.frames.start
        positions = block.positions.copy()
        missing = np.isnan(positions[..., 0])
        later: list[tuple[int, int, int]] = []
        for marker in np.flatnonzero(missing.any(axis=0)).tolist():
            for begin, end in runs(missing[:, marker]).tolist():
                short = (end - begin) / self._rate <= self.short_s
                path = _spline(block.positions[:, marker], begin, end, self._support) if short else None
                if path is None:
                    later.append((marker, begin, end))
                else:
                    positions[begin:end, marker] = path
                    self._count(wanted, marker, first + begin, "splined")
        for marker, begin, end in later:
            path = None
            if (end - begin) / self._rate <= self.long_s:
                path = self._learnt().fill(positions, marker, begin, end)
            if path is not None:
                positions[begin:end, marker] = path
            self._count(wanted, marker, first + begin, "left" if path is None else "from neighbours")
        return block.changed(positions)

    def _learnt(self) -> _Carriers:
        if self._carriers is None:
            self._carriers = _Carriers(self._view.spread(SAMPLE_FRAMES).positions)
        return self._carriers

    def _count(self, wanted: range, marker: int, begin: int, outcome: str) -> None:
        if begin in wanted:  # a gap that begins beside the wanted frames is another block's
            self._outcomes[marker, begin] = outcome

    @property
    def note(self) -> str:
        """How many gaps were filled until now, and how."""
        outcomes = list(self._outcomes.values())
        counts = {outcome: outcomes.count(outcome) for outcome in ("splined", "from neighbours", "left")}
        words = ", ".join(f"{number} {outcome}" for outcome, number in counts.items() if number)
        return f"fill_gaps up to {self.short_s:g} and {self.long_s:g} s: {words or 'no gaps'}"


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

    See Also
    --------
    gap_runs : where gaps are.
    signface.takes.filtering.lowpass : the next step.

    Examples
    --------
    >>> import signface as sf
    >>> take = sf.datasets.mini_take()
    >>> positions = take.positions.copy()
    >>> positions[100:105, 7] = np.nan
    >>> filled = fill_gaps(take.changed("cut", positions=positions))
    >>> filled.history[-1]
    'fill_gaps up to 0.05 and 0.5 s: 3 splined, 5 from neighbours'
    >>> bool(np.nanmax(np.linalg.norm(filled.positions - take.positions, axis=2)) < 0.5)
    True
    """
    return run(take, GapFiller(short_s=short_s, long_s=long_s))
