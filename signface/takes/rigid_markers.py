"""Which markers of a face carry the motion of its head best, where nobody has said.

- `movements`: how much each marker moves on the head.
- `carriers_of_head`: those of some candidates that keep their places and stand far apart.
- `with_head_markers`: a layout whose head markers are these, where it has too few or they stand together.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.takes.rigid import apply, flatness, inverse, rigid_transforms
from signface.takes.take import Take

#: So many are chosen where there are.
COUNT = 8

#: Poses and how much markers move under them are found from one another so many times.
TURNS = 4

#: No marker counts as stiller than this (mm), nor than this part of what the stillest quarter move under the first
#: poses: else a few neighbours that move together would draw the poses to themselves.
STILLEST_MM, STILLEST = 0.3, 0.3

#: Head markers whose root mean square distance from one line is less than this (mm) stand together: on one ear, say.
SPREAD_MM = 15.0

#: Skin that no base moves by more than this (mm) may carry the head: the ridge of the nose, the corners of the eyes,
#: the temples.
RIGID_MM = 3.0


def movements(neutral: np.ndarray, sample: np.ndarray) -> np.ndarray:
    """How much each marker moves on the head, which is found from all of them, the stiller ones counting more.

    Parameters
    ----------
    neutral : (M, 3) array
        Where the markers are in the neutral frame; without NaN.
    sample : (S, M, 3) array
        Frames; NaN where a marker is missing.

    Returns
    -------
    (M,) array
        Root mean square distances from the neutral places, mm; inf for markers that half of the frames do not show.

    Examples
    --------
    >>> neutral = np.random.default_rng(0).normal(size=(20, 3)) * 50
    >>> sample = neutral + np.zeros((10, 20, 3))
    >>> sample[5:, 3] += 4.0
    >>> moves = movements(neutral, sample)
    >>> int(moves.argmax()), round(float(np.median(moves)), 1)
    (3, 0.3)
    """
    seen = np.isfinite(sample[..., 0])
    moves, least = np.ones(len(neutral)), 0.0
    for turn in range(TURNS):
        poses = rigid_transforms(neutral, sample, seen / np.maximum(moves, least) ** 2)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # markers that are never seen
            away = np.linalg.norm(apply(inverse(poses), sample) - neutral, axis=2)
            moves = np.sqrt(np.nanmean(away**2, axis=0))
        moves[seen.mean(axis=0) <= 0.5] = np.inf
        if turn == 0:
            known = np.isfinite(moves)
            still = float(np.quantile(moves[known], 0.25)) if known.any() else 0.0
            least = max(STILLEST_MM, STILLEST * still)
    return np.maximum(moves, least)


def carriers_of_head(places: np.ndarray, moves: np.ndarray, candidates: Sequence[int], count: int = COUNT) -> list[int]:
    """The markers from which the motion of the head is told best.

    What a marker tells of a pose grows with its distance from the others and falls with how much it moves on the head.
    Markers are added one by one, each the one that makes the ellipsoid of the pose's uncertainty smallest (greedy
    D-optimal design).

    Parameters
    ----------
    places : (M, 3) array
        Where the markers are in the neutral frame, mm.
    moves : (M,) array
        How much each moves on the head, mm, positive; inf for one that is not to be taken.
    candidates : sequence of int
        Those that may be taken.
    count : int
        How many.

    Returns
    -------
    list of int
        In rising order; fewer than `count` where there are no more candidates.

    Examples
    --------
    >>> places = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [90, 0, 0], [0, 90, 0], [0, 0, 90]])
    >>> carriers_of_head(places, np.ones(6), range(6), count=3)
    [3, 4, 5]
    """
    arms = places - places[list(candidates)].mean(axis=0)
    arms = arms / max(float(np.sqrt((arms**2).sum(axis=1).mean())), 1e-9)  # turns count as they move a typical marker
    turning = np.zeros((len(places), 3, 6))
    turning[:, :, :3] = np.eye(3)
    turning[:, [0, 0, 1, 1, 2, 2], [4, 5, 3, 5, 3, 4]] = arms[:, [2, 1, 2, 0, 1, 0]] * (1, -1, -1, 1, 1, -1)
    told = np.einsum("mki,mkj->mij", turning, turning) / moves[:, None, None] ** 2
    total = 1e-6 * told.max() * np.eye(6)
    left = [index for index in candidates if np.isfinite(moves[index])]
    chosen: list[int] = []
    while left and len(chosen) < count:
        best = left.pop(int(np.argmax(np.linalg.slogdet(total + told[left])[1])))
        chosen.append(best)
        total = total + told[best]
    return sorted(chosen)


def with_head_markers(layout: MarkerLayout, take: Take, neutral_s: float, face: FaceModel) -> MarkerLayout:
    """The layout with head markers that can carry a head.

    Where it has at least three that stand apart, they stay. Else, as with landmarks of a picture, the head markers are
    those that tell most of the head's motion in the take, of the skin that the face's bases hardly move; all others are
    face markers.

    Parameters
    ----------
    layout : MarkerLayout
        Its labels are of the take.
    take : Take
    neutral_s : float
        Time of a neutral frame in seconds.
    face : FaceModel
        The face that the layout is on.

    Examples
    --------
    >>> import signface as sf
    >>> face, take = sf.read_face(), sf.datasets.mini_take()
    >>> layout = sf.read_layout("default-40", face)
    >>> with_head_markers(layout, take, 0.1, face) == layout
    True
    """
    positions = take.select(layout.labels)
    neutral = positions[take.frame_at(neutral_s)]
    seen = np.isfinite(neutral[:, 0])
    head = np.array([role == "head" for role in layout.roles]) & seen
    if flatness(neutral, head[None].astype(float))[0] >= SPREAD_MM:
        return layout
    moved = np.linalg.norm(
        np.einsum("npkd,pk->npd", face.bases[:, layout.corners], layout.barycentric), axis=2
    ).max(axis=0)  # fmt: skip
    candidates = np.flatnonzero((moved <= RIGID_MM) & seen)
    if len(candidates) < 3:
        return layout
    moves = np.full(len(neutral), np.inf)
    moves[seen] = movements(neutral[seen], positions[:, seen])
    chosen = carriers_of_head(np.nan_to_num(neutral), moves, candidates.tolist())
    if flatness(neutral, np.isin(np.arange(len(neutral)), chosen)[None].astype(float))[0] < SPREAD_MM / 2:
        return layout
    return replace(layout, roles=tuple("head" if index in chosen else "face" for index in range(len(neutral))))
