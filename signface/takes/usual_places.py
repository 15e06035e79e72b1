"""Where each marker of a face usually is on the head, and how far it strays from there.

- `usual_places`: learnt from frames of a recording.
- `UsualPlaces`: any frame of it brought onto the head, so that markers are held against where they usually are.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from signface.content import Content
from signface.takes.rigid import apply, flatness, inverse, rigid_transforms

#: Fewer markers do not tell which of them is wrong.
LEAST_MARKERS = 5

#: A marker this far (mm) from its usual place, or this many times what is usual among all, counts half in the pose.
HALF_MM, HALF = 4.0, 3.0
#: Poses are found again, with far markers counting less, in frames where one is farther than this (mm, times usual).
BUSY_MM, BUSY = 15.0, 6.0
#: So many times at most, and until no marker moves by more than this (mm).
TURNS, SETTLED_MM = 8, 0.1

#: A marker farther from its usual place than this (mm), and than this many times what is usual for it, is no part of
#: the face: a jaw opens by 50 mm.
FAR_MM, FAR = 60.0, 12.0

#: No marker counts as stiller than this (mm): a few that hardly move would otherwise draw the poses to themselves.
STILLEST_MM = 1.0


@dataclass(frozen=True, eq=False)
class UsualPlaces(Content):
    """Where markers usually are on the head.

    Parameters
    ----------
    middle : (M, 3) array
        Median places, mm; NaN for a marker that is never seen.
    stray : (M,) array
        Median distance of each marker from there, mm.
    """

    middle: np.ndarray
    stray: np.ndarray

    @property
    def usual(self) -> float:
        """What is usual of `stray` among the markers, mm."""
        return float(np.nanmedian(self.stray))

    def places(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Frames brought onto the head by a pose that far markers hardly count in.

        Parameters
        ----------
        positions : (F, M, 3) array
            Millimetres, NaN where missing.

        Returns
        -------
        (F, M, 3) and (F, M) arrays
            Places on the head and their distances from the usual ones, mm; NaN also where no pose is known.
        """
        seen = np.isfinite(positions[..., 0]) & np.isfinite(self.middle[:, 0])
        weights = seen / np.maximum(np.nan_to_num(self.stray, nan=1.0), STILLEST_MM)
        poses = rigid_transforms(self.middle, positions, weights)
        blind = seen.sum(axis=1) < LEAST_MARKERS - 1
        places = apply(inverse(poses), positions)
        away = np.linalg.norm(places - self.middle, axis=2)
        known = np.where(seen, away, 0.0)
        half = max(HALF_MM, HALF * self.usual)
        busy = np.flatnonzero((known > np.maximum(BUSY_MM, BUSY * np.nan_to_num(self.stray))).any(axis=1) & ~blind)
        for _ in range(TURNS):
            if len(busy) == 0:
                break
            trust = weights[busy] / (1 + (known[busy] / half) ** 2)
            inward = inverse(rigid_transforms(self.middle, positions[busy], trust))
            places[busy] = apply(inward, positions[busy])
            before = known[busy]
            away[busy] = np.linalg.norm(places[busy] - self.middle, axis=2)
            known[busy] = np.where(seen[busy], away[busy], 0.0)
            busy = busy[(np.abs(known[busy] - before) > SETTLED_MM).any(axis=1)]
        places[blind] = away[blind] = np.nan
        away[~seen] = np.nan
        return places, away

    def too_far(self, away: np.ndarray) -> np.ndarray:
        """(F, M) bool: markers that are farther away (F, M; mm) than any part of a face goes."""
        with np.errstate(invalid="ignore"):
            return away > np.maximum(FAR_MM, FAR * self.stray)

    def renamed(self, owners: Mapping[int, int]) -> UsualPlaces:
        """The same with the places of `{marker: whose place it has}` set right."""
        order = np.arange(len(self.middle))
        order[list(owners)] = list(owners.values())
        return UsualPlaces(self.middle[order], self.stray[order])

    def fitted(self, points: np.ndarray) -> np.ndarray | None:
        """(M, 3) points of another face turned, moved and scaled onto the usual places; None where few are known."""
        both = np.isfinite(points[:, 0]) & np.isfinite(self.middle[:, 0])
        if both.sum() < LEAST_MARKERS:
            return None

        def radius(places: np.ndarray) -> float:
            centre = np.median(places[both], axis=0)
            return float(np.median(np.linalg.norm(places[both] - centre, axis=1)))

        scaled = points * (radius(self.middle) / radius(points))
        return self.places(scaled[None])[0][0]


def usual_places(sample: np.ndarray) -> UsualPlaces | None:
    """Learn from (S, M, 3) frames of a recording, mm, NaN where missing; None where too few markers tell.

    A marker that is wrong in less than half of the frames in which it is seen does not move its median.
    """
    seen = np.isfinite(sample[..., 0])
    count = seen.sum(axis=1)
    if len(sample) == 0 or count.max() < LEAST_MARKERS:
        return None
    first = sample[int(np.argmax(count))]
    if flatness(np.nan_to_num(first), np.isfinite(first[None, :, 0]).astype(float))[0] < BUSY_MM:
        return None  # all on one line, or in one place: no head
    usual = UsualPlaces(first, np.ones(len(first)))
    for _ in range(3):
        places, _ = usual.places(sample)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # markers that are never seen
            middle = np.nanmedian(places, axis=0)
            stray = np.nanmedian(np.linalg.norm(places - middle, axis=2), axis=0)
        usual = UsualPlaces(middle, stray)
    if np.isfinite(usual.middle[:, 0]).sum() < LEAST_MARKERS:
        return None
    return usual
