"""Markers in a place that is another's: which, in single frames of places on the head.

- `permuted`: markers under one another's names, and markers where a missing one belongs.
- `abrupt`: those of them that begin and end with a jump.
- `doubled`: markers where another one is.
- `ghosts`: markers where none belongs.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from signface.frames import bridge, runs
from signface.takes.usual_places import UsualPlaces

#: A marker can be told from its neighbours where the nearest of them is farther than this many times what both stray,
#: and than this (mm).
APART, APART_MM = 2.5, 5.0
#: It may be in a neighbour's place where it has come this part of the way to the nearest one.
ON_THE_WAY = 0.5
#: An exchange is one where at least this part of what it would explain at best is explained, and where at most this
#: part of the way is left, to the place of each but for what all exchanged ones share.
EXPLAINED, LEFT = 0.6, 0.5
#: A marker is in a missing one's place where this part of the way is left at most. To be told in another's place,
#: missing or not, it must have gone so far (mm): lips close on one another.
LEFT_TO_MISSING, WAY_MM = 0.3, 8.0
#: Two markers are in one place where they are nearer than this (mm), and one of them has come this part of the way.
ONE_PLACE_MM, COME = 0.1, 0.9


def permuted(usual: UsualPlaces, places: np.ndarray, away: np.ndarray) -> Iterator[tuple[int, dict[int, int]]]:
    """Frames in which markers are in one another's places, as `{marker: whose place it is in}` for each.

    Who is where is the assignment of least squares (the Hungarian method) among the markers that are far from their own
    places, and the places of markers that are missing. A chain that ends in the place of a missing marker is no circle:
    then the last of it has none in `values`.

    Parameters
    ----------
    usual : UsualPlaces
    places, away : (F, M, 3) and (F, M) arrays
        As `UsualPlaces.places` gives them.
    """
    from scipy.optimize import linear_sum_assignment

    middle = usual.middle
    near = _nearest(usual)
    with np.errstate(invalid="ignore"):
        far = away > ON_THE_WAY * near
    absent = np.isnan(away) & np.isfinite(near)
    for frame in np.flatnonzero(far.any(axis=1) & (far.sum(axis=1) + absent.sum(axis=1) > 1)).tolist():
        markers = np.flatnonzero(far[frame])
        columns = np.concatenate([markers, np.flatnonzero(absent[frame])])
        squares = ((places[frame, markers, None] - middle[None, columns]) ** 2).sum(axis=2)
        rows, chosen = linear_sum_assignment(squares)
        if (chosen == rows).all():
            continue
        into = {int(markers[row]): int(columns[column]) for row, column in zip(rows, chosen) if row != column}
        for chain in _chains(into):
            if _believed(chain, places[frame], middle):
                yield frame, chain


def abrupt(
    usual: UsualPlaces, places: np.ndarray, chain: dict[int, int], mask: np.ndarray, pause: int, seen: int
) -> np.ndarray:
    """(F,) bool: the frames of an exchange that begins and ends with a jump, beside a gap or where the frames do.

    Names are exchanged from one frame to the next. Lips that roll over one another go there by and by.

    Parameters
    ----------
    usual : UsualPlaces
    places : (F, M, 3) array
    chain : dict of int to int
        Whose place each marker is in.
    mask : (F,) array of bool
        Where.
    pause : int
        Pauses of fewer frames are none, and a jump may be as far from the beginning or the end.
    seen : int
        Frames up to which a beginning or end counts.
    """
    held = bridge(mask, pause)
    markers, owners = list(chain), list(chain.values())
    way = np.linalg.norm(usual.middle[owners] - usual.middle[markers], axis=1)
    steps = np.linalg.norm(np.diff(places[:, markers], axis=0), axis=2)
    with np.errstate(invalid="ignore"):
        jumps = (~(steps < ON_THE_WAY * way)).any(axis=1)  # also where one comes or goes
    for begin, end in runs(held).tolist():
        if begin > 0 and not jumps[max(0, begin - 1 - pause) : begin + pause].any():
            held[begin : min(end, begin + seen)] = False
        if end < len(held) and not jumps[max(0, end - 1 - pause) : end + pause].any():
            held[max(begin, end - seen) : end] = False
    return held


def _nearest(usual: UsualPlaces) -> np.ndarray:
    """(M,) distance of each marker's usual place to the nearest other, mm; inf where the two cannot be told apart."""
    distances = np.linalg.norm(usual.middle[:, None] - usual.middle[None], axis=2)
    np.fill_diagonal(distances, np.inf)
    distances = np.where(np.isfinite(distances), distances, np.inf)
    other = np.argmin(distances, axis=1)
    nearest = distances[np.arange(len(distances)), other]
    strays = usual.stray + usual.stray[other]
    return np.where(nearest > np.maximum(APART_MM, APART * np.nan_to_num(strays)), nearest, np.inf)


def _chains(into: dict[int, int]) -> list[dict[int, int]]:
    """The circles and chains of an assignment, each by itself."""
    left, found = dict(into), []
    starts = [marker for marker in into if marker not in into.values()] + list(into)
    for start in starts:
        chain = {}
        while start in left:
            chain[start] = left.pop(start)
            start = chain[start]
        if chain:
            found.append(chain)
    return found


def _believed(chain: dict[int, int], places: np.ndarray, middle: np.ndarray) -> bool:
    """Whether a circle or chain explains where its markers are much better than each under its own name."""
    markers, owners = list(chain), list(chain.values())
    way = middle[owners] - middle[markers]
    own, other = places[markers] - middle[markers], places[markers] - middle[owners]
    if set(markers) != set(owners):
        lengths = np.linalg.norm(way, axis=1)
        return bool((np.linalg.norm(other, axis=1) < LEFT_TO_MISSING * lengths).all() and lengths.min() > WAY_MM)
    rest = other - other.mean(axis=0)
    explained = (own**2).sum() - (other**2).sum()
    return bool(
        explained > EXPLAINED * (way**2).sum()
        and (np.linalg.norm(rest, axis=1) < LEFT * np.linalg.norm(way, axis=1)).all()
    )


def doubled(usual: UsualPlaces, places: np.ndarray, away: np.ndarray) -> np.ndarray:
    """(F, M) bool: markers that are where another one is, whose place it is."""
    found = np.zeros(away.shape, dtype=bool)
    near = _nearest(usual)
    with np.errstate(invalid="ignore"):
        far = away > COME * near
    distances = np.linalg.norm(usual.middle[:, None] - usual.middle[None], axis=2)
    for marker in np.flatnonzero(far.any(axis=0)).tolist():
        frames = np.flatnonzero(far[:, marker])
        with np.errstate(invalid="ignore"):
            gap = np.linalg.norm(places[frames] - places[frames, marker, None], axis=2)
            on = (gap < ONE_PLACE_MM) & (away[frames] < COME * away[frames, marker, None])
        on &= distances[marker] > WAY_MM
        on[:, marker] = False
        found[frames, marker] = on.any(axis=1)
    return found


def ghosts(places: np.ndarray, away: np.ndarray, jump: np.ndarray, with_all: float, longest: int) -> np.ndarray:
    """(F, M) bool: markers that jump to where they stay only for a moment.

    A trajectory is cut at its gaps and jumps. A piece of at most `longest` frames that is farther from the usual place
    than what lies beyond its jumps is a ghost; so is the beginning or end of a trajectory, beside a gap.

    Parameters
    ----------
    places, away : (F, M, 3) and (F, M) arrays
    jump : (M,) array
        From one frame to the next a marker goes no farther than this, mm; nor than `with_all` times the median step of
        all markers in that frame.
    with_all : float
    longest : int
    """
    found = np.zeros(away.shape, dtype=bool)
    steps = np.linalg.norm(np.diff(places, axis=0), axis=2)
    with np.errstate(invalid="ignore"):
        jumped = steps > jump
    some = np.flatnonzero(jumped.any(axis=1))
    if len(some):
        usual = np.nanmedian(np.where(np.isfinite(steps[some]).any(axis=1)[:, None], steps[some], 0.0), axis=1)
        jumped[some] &= steps[some] > with_all * usual[:, None]
    for marker in np.flatnonzero(jumped.any(axis=0)).tolist():
        far, at = away[:, marker], jumped[:, marker]
        for begin, end in runs(np.isfinite(far)).tolist():
            cuts = [begin, *(np.flatnonzero(at[begin : end - 1]) + begin + 1).tolist(), end]
            for first, last in pairwise(cuts):
                beside = [far[edge] for edge in (first - 1, last) if begin <= edge < end]
                short = last - first <= (longest if len(beside) == 2 else max(2, longest // 4))
                if beside and short and np.median(far[first:last]) > max(beside):
                    found[first:last, marker] = True
    return found
