"""Markers that are where they cannot be: ghosts, swapped, misnamed and frozen ones, found before anything is solved.

- `check_markers`: a take mended, and what was found; `MarkerCheck`: the same as a stage, for any recording.
- `Finding`: what is wrong with which markers, when, and what was done about it.

Everything is judged on the head: a robust rigid pose of each frame takes the head's motion away, and what is left is
held against where each marker usually is (its median) and how far it usually strays from there. Landmarks of a film,
all of which are off by millimetres, are so held against themselves: of 647 takes of real signers (KRSL, LSE,
BUHMAP, GFE) two have findings, a point of the jaw that jumps and three points that are 60 mm off.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from signface.descriptors import CHECKED, NOTHING_WRONG, TOO_FEW
from signface.frames import runs
from signface.takes.misplaced import abrupt, doubled, ghosts, permuted
from signface.takes.stages import Block, Stage, View, run
from signface.takes.take import Take
from signface.takes.usual_places import UsualPlaces, usual_places

#: Frames, evenly spaced, from which it is learnt where markers usually are; and stretches of neighbouring frames, from
#: which it is learnt how far they go from one to the next: so many of so many frames.
SAMPLE_FRAMES, STRETCHES, STRETCH_FRAMES = 800, 12, 40

#: Skin does not go faster than this on the head (m/s; lids and lips reach some 0.4), and a marker's place is not known
#: better than this (mm): who goes farther in a frame has jumped.
FASTEST, SLACK_MM = 0.5, 2.0
#: Nor has who goes no farther than this many times what is usual for the marker, and for all markers in that frame.
UNUSUAL, WITH_ALL = 8.0, 4.0
#: What lies between a jump and a jump (or a gap) for at most this long is a ghost (s).
GHOST_S = 0.25
#: A marker that does not move at all for so long (s, and frames), while most others do, is frozen.
FROZEN_S, FROZEN_FRAMES = 0.1, 5
#: In coarse recordings (whole pixels) markers stand still by chance: only what is so improbable counts, and only what
#: is so many times as long as most markers stand still.
BY_CHANCE, STILL = 1e-6, 3.0
#: Recordings in which only longer stillness would say something (s) are not looked at for it.
LONGEST_FROZEN_S = 5.0
#: Exchanges with pauses shorter than this are one; each begins and ends with a jump, up to so far beside a frame (s).
PAUSE_S, EDGE_S = 0.1, 1.0
#: So many frozen markers at once count only where they are farther than this (mm, times usual) from their usual places.
SEVERAL, OFF_MM, FAR_OFF = 3, 10.0, 3.0
#: Where more than this part of the markers would be left out, the frame is left as it is, and named.
MOST_LEFT_OUT = 1 / 3
#: Moments of one kind nearer than this (s) are told as one.
CLOSE_S = 0.1

#: What is said of markers of a kind of finding; and what is done, by default.
KINDS = {
    "ghost": "a ghost",
    "swapped": "swapped",
    "misnamed": "where a missing neighbour belongs",
    "doubled": "where a neighbour is",
    "frozen": "frozen",
}
LEFT_OUT, SWAPPED_BACK, LEFT = "left out", "swapped back", "left as they are"


@dataclass(frozen=True)
class Finding:
    """Something wrong with markers.

    Parameters
    ----------
    kind : str
        `ghost` (where it cannot be), `swapped` (two or more under one another's names), `misnamed` (where a missing
        neighbour belongs), `doubled` (where a neighbour is), `frozen` (does not move while the others do), `unclear`
        (too many markers are wrong at once to tell which).
    markers : tuple of str
        Empty for `unclear`.
    start_s, end_s : float
        When, on the recording's own clock; the end is that of the last frame.
    done : str
        `swapped back`, `left out` or `left as they are`.

    Examples
    --------
    >>> print(Finding("swapped", ("LBROI", "LBROM"), 2.0, 3.5, "swapped back"))
    LBROI and LBROM swapped 2.000 to 3.500 s (swapped back)
    """

    kind: str
    markers: tuple[str, ...]
    start_s: float
    end_s: float
    done: str

    def __str__(self) -> str:
        names = " and ".join(filter(None, [", ".join(self.markers[:-1]), *self.markers[-1:]]))
        what = f"{names} {KINDS[self.kind]}" if self.markers else "many markers wrong"
        return f"{what} {_when(self.start_s, self.end_s)} ({self.done})"


def _when(start_s: float, end_s: float) -> str:
    return f"at {start_s:.3f} s" if end_s - start_s < 1e-9 else f"{start_s:.3f} to {end_s:.3f} s"


def check_markers(take: Take, known: Mapping[str, np.ndarray] | None = None) -> tuple[Take, list[Finding]]:
    """The take with its markers mended where that is certain, and what was found.

    Swapped markers are swapped back; ghosts, misnamed, doubled and frozen markers become gaps, for `fill_gaps`.

    Parameters
    ----------
    take : Take
        As it was read; of one face, with at least five markers.
    known : mapping of str to (3,) array, optional
        See `MarkerCheck`.

    Returns
    -------
    (Take, list of Finding)
        The findings in the order of time.

    See Also
    --------
    signface.takes.gaps.fill_gaps : the next step.

    Examples
    --------
    >>> import signface as sf
    >>> take = sf.datasets.mini_take()
    >>> positions = take.positions.copy()
    >>> positions[500, 7] += (300, 200, 100)
    >>> mended, found = check_markers(take.changed("a reflection", positions=positions))
    >>> print(*found)
    RFORE a ghost at 2.500 s (left out)
    >>> bool(np.isnan(mended.positions[500, 7]).all())
    True
    """
    stage = MarkerCheck(known)
    return run(take, stage), stage.findings


class MarkerCheck(Stage):
    """Finds markers that are where they cannot be, and mends what is certain; see `check_markers`.

    Parameters
    ----------
    known : mapping of str to (3,) array, optional
        By label, where the markers stand on a face, mm: tells which of two is under the wrong name where they are
        swapped for most of the recording. Otherwise most of it is taken to be right.
    """

    alone = False

    def __init__(self, known: Mapping[str, np.ndarray] | None = None) -> None:
        self._known = {} if known is None else known
        self._found: dict[tuple[str, tuple[str, ...], str], list[tuple[int, int]]] = {}

    def learn(self, view: View) -> None:
        """Where markers usually are, how far they stray, and how far they go from a frame to the next."""
        recording = view.recording
        self._labels, self._rate, self._start = recording.labels, recording.rate, recording.start
        self._usual = usual_places(view.spread(SAMPLE_FRAMES).positions)
        self._longest = max(1, int(GHOST_S * self._rate))
        self.reach = int((EDGE_S + 3 * PAUSE_S + GHOST_S) * self._rate) + 4
        if self._usual is None:
            return
        self._usual = self._usual.renamed(self._wrong_names(self._usual))
        steps, equal = [], []
        for begin in np.unique(np.linspace(0, max(0, recording.n_frames - STRETCH_FRAMES), STRETCHES).astype(int)):
            near = recording.frames(int(begin), int(begin) + STRETCH_FRAMES)
            steps.append(np.linalg.norm(np.diff(self._usual.places(near)[0], axis=0), axis=2))
            equal.append(_equal(near))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # markers that are never seen
            usual = np.nan_to_num(np.nanmedian(np.concatenate(steps), axis=0))
        self._jump = np.maximum(SLACK_MM + 1000 * FASTEST / self._rate, UNUSUAL * usual)
        share = np.concatenate(equal)
        still = float(np.median(share.mean(axis=0))) if len(share) else 1.0
        chance = np.log(BY_CHANCE) / np.log(still) if 0 < still < 1 else np.inf * still
        longest = [[max((end - begin for begin, end in runs(one)), default=0) for one in part.T] for part in equal]
        usual_run = STILL * float(np.quantile(np.max(longest, axis=0), 0.9)) if longest else 0.0
        self._frozen = max(FROZEN_FRAMES, FROZEN_S * self._rate, chance, usual_run)
        if self._frozen < LONGEST_FROZEN_S * self._rate:
            self.reach = max(self.reach, int(self._frozen) + 2)

    def _wrong_names(self, usual: UsualPlaces) -> dict[int, int]:
        """Markers that are under one another's names for most of the recording, by where they stand on a known face."""
        places = np.array([self._known.get(label, np.full(3, np.nan)) for label in self._labels])
        fitted = usual.fitted(places)
        if fitted is None:
            return {}
        away = np.linalg.norm(fitted - usual.middle, axis=1)
        mirrored = usual.fitted(places * (-1, 1, 1))
        assert mirrored is not None
        if np.nanmedian(np.linalg.norm(mirrored - usual.middle, axis=1)) < np.nanmedian(away):
            return {}  # a mirrored face has them all wrong, and is another matter
        circles = [circle for _, circle in permuted(usual, fitted[None], away[None])]
        wrong = {
            marker: owner
            for circle in circles
            if set(circle) == set(circle.values())
            for marker, owner in circle.items()
        }
        return wrong if len(wrong) <= MOST_LEFT_OUT * np.isfinite(away).sum() else {}

    def apply(self, block: Block) -> Block:
        """The block with its markers mended."""
        if self._usual is None or len(block.frames) < 2:
            return block
        positions = block.positions
        places, away = self._usual.places(positions)
        misnamed = np.zeros(away.shape, dtype=bool)
        back = np.zeros(len(away), dtype=bool)
        for chain, mask in self._exchanged(places, away):
            markers, owners = np.array(list(chain)), np.array(list(chain.values()))
            frames = np.flatnonzero(mask)
            if set(chain) != set(chain.values()):
                misnamed[np.ix_(frames, markers)] = True
                continue
            positions = positions.copy() if positions is block.positions else positions
            positions[np.ix_(frames, owners)] = block.positions[np.ix_(frames, markers)]
            back[frames] = True
            self._count(block, mask, "swapped", tuple(self._labels[marker] for marker in sorted(chain)), SWAPPED_BACK)
        if back.any():
            places[back], away[back] = self._usual.places(positions[back])
        found = {
            "frozen": self._still(block.positions, away),
            "misnamed": misnamed,
            "doubled": doubled(self._usual, places, away),
            "ghost": self._usual.too_far(away) | ghosts(places, away, self._jump, WITH_ALL, self._longest),
        }
        wrong = np.any(list(found.values()), axis=0)
        if not wrong.any():
            return block if positions is block.positions else block.changed(positions)
        many = wrong.sum(axis=1) > np.maximum(MOST_LEFT_OUT * np.isfinite(away).sum(axis=1), 1)
        wrong[many] = False
        self._count(block, many, "unclear", (), LEFT)
        taken = ~wrong
        for kind, mask in found.items():
            mask = mask & ~taken
            taken |= mask
            for marker in np.flatnonzero(mask.any(axis=0)).tolist():
                self._count(block, mask[:, marker], kind, (self._labels[marker],), LEFT_OUT)
        positions = positions.copy() if positions is block.positions else positions
        positions[wrong] = np.nan
        return block.changed(positions)

    def _exchanged(self, places: np.ndarray, away: np.ndarray) -> list[tuple[dict[int, int], np.ndarray]]:
        """Exchanges of markers, and (F,) bool where each of them holds."""
        assert self._usual is not None
        masks: dict[tuple[tuple[int, int], ...], np.ndarray] = {}
        for frame, chain in permuted(self._usual, places, away):
            masks.setdefault(tuple(sorted(chain.items())), np.zeros(len(places), dtype=bool))[frame] = True
        pause, seen = round(PAUSE_S * self._rate), round(EDGE_S * self._rate)
        return [
            (dict(chain), abrupt(self._usual, places, dict(chain), mask, pause, seen)) for chain, mask in masks.items()
        ]

    def _still(self, positions: np.ndarray, away: np.ndarray) -> np.ndarray:
        """(F, M) bool: markers that do not move at all while most of the others do.

        Several at once may be of a head that is held still, or already taken out: those count where they are off.
        """
        found = np.zeros(positions.shape[:2], dtype=bool)
        if self._frozen >= LONGEST_FROZEN_S * self._rate or len(positions) < 2:
            return found
        equal = _equal(positions)
        seen = np.isfinite(positions[..., 0])
        moving = equal.sum(axis=1) < 0.5 * (seen[1:] & seen[:-1]).sum(axis=1)
        equal &= moving[:, None]
        for marker in np.flatnonzero(equal.sum(axis=0) >= self._frozen - 1).tolist():
            for begin, end in runs(equal[:, marker]).tolist():
                if end - begin + 1 >= self._frozen:
                    found[begin : end + 1, marker] = True
        several = found.sum(axis=1) >= SEVERAL
        assert self._usual is not None
        with np.errstate(invalid="ignore"):
            found[several] &= away[several] > np.maximum(OFF_MM, FAR_OFF * self._usual.stray)
        return found

    def _count(self, block: Block, mask: np.ndarray, kind: str, markers: tuple[str, ...], done: str) -> None:
        inner, first = block.inner, (block.wanted or block.frames).start
        for begin, end in runs(mask[inner]).tolist():
            self._found.setdefault((kind, markers, done), []).append((first + begin, first + end))

    @property
    def findings(self) -> list[Finding]:
        """What was found until now, in the order of time; moments of one kind that lie close together are one."""
        close = CLOSE_S * self._rate
        found = []
        for (kind, markers, done), spans in self._found.items():
            joined: list[list[int]] = []
            for begin, end in sorted(set(spans)):
                if joined and begin - joined[-1][1] <= close:
                    joined[-1][1] = max(joined[-1][1], end)
                else:
                    joined.append([begin, end])
            for begin, end in joined:
                times = (self._start + begin / self._rate, self._start + (end - 1) / self._rate)
                found.append(Finding(kind, markers, *times, done))
        return sorted(found, key=lambda one: (one.start_s, one.markers))

    @property
    def note(self) -> str:
        """What was found until now."""
        if self._usual is None:
            return CHECKED + TOO_FEW
        return CHECKED + (summary(self.findings) or NOTHING_WRONG)


def summary(findings: Sequence[Finding], most: int = 6) -> str:
    """Findings in one line, the longest-lasting first where there are many; empty where there are none."""
    if len(findings) <= most:
        return "; ".join(map(str, findings))
    longest = sorted(findings, key=lambda one: one.start_s - one.end_s)[:most]
    told = sorted(longest, key=lambda one: (one.start_s, one.markers))
    return "; ".join([*map(str, told), f"and {len(findings) - most} more"])


def _equal(positions: np.ndarray) -> np.ndarray:
    """(F - 1, M) bool: markers that are exactly where they were in the frame before."""
    return (positions[1:] == positions[:-1]).all(axis=2)
