"""The most likely course of a take when segments have durations: a hidden semi-Markov model.

- `SegmentModel`: how long expressions and transitions last and which expression follows which, learnt from
  annotations; `decode`, the best course given what each frame looks like.

Stable segments and transitions take turns, so that every change of expression crosses a transition. Durations are
counted from annotations, not geometric as in a plain hidden Markov model, whose most likely segment is one frame
long (Rabiner 1989, section IV.D; Murphy 2002, Hidden semi-Markov models).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from signface.content import Content
from signface.segmentation.segments import Segments

#: Longest durations that are counted (s). A longer expression pays by the frame; a longer transition does not occur.
LONGEST_STABLE_S = 8.0
LONGEST_TRANSITION_S = 2.0

#: Width of the Gaussian over which counts of durations are spread (s).
SPREAD_STABLE_S = 0.25
SPREAD_TRANSITION_S = 0.06

#: How far a boundary may move when it is settled (s).
SETTLING_S = 0.32

#: What everything possible is counted for that was not seen.
UNSEEN = 0.5


@dataclass(frozen=True, eq=False)
class SegmentModel(Content):
    """Durations and order of segments.

    Parameters
    ----------
    labels : tuple of str
        The A labels of stable segments.
    rate : float
        Frames per second.
    stable, transition : (D + 1,) arrays
        Log probability of each duration in frames, 0 to D.
    after : (A, A) array
        Log probability of the label of the column after that of the row; -inf on the diagonal.
    """

    labels: tuple[str, ...]
    rate: float
    stable: np.ndarray
    transition: np.ndarray
    after: np.ndarray

    @classmethod
    def learn(cls, references: Sequence[Segments], labels: Sequence[str], rate: float) -> SegmentModel:
        """Count durations and orders in annotations.

        The first and last stable segments of a take are cut by the recording; their durations are not counted.
        """
        place = {label: number for number, label in enumerate(labels)}
        after = np.full((len(labels), len(labels)), UNSEEN)
        lengths: dict[str, list[float]] = {"stable": [], "transition": []}
        for reference in references:
            table = reference.table
            for number, row in enumerate(table.itertuples(index=False)):
                cut = number in (0, len(table) - 1)
                if not (row.kind == "stable" and cut):
                    lengths[row.kind].append((row.end_s - row.start_s) * rate)
            held = [place[label] for label in table.loc[table["kind"] == "stable", "label"]]
            np.add.at(after, (held[:-1], held[1:]), 1)
        np.fill_diagonal(after, 0)
        with np.errstate(divide="ignore"):
            after = np.log(after / after.sum(axis=1, keepdims=True))
        stable = _durations(lengths["stable"], LONGEST_STABLE_S * rate, SPREAD_STABLE_S * rate)
        transition = _durations(lengths["transition"], LONGEST_TRANSITION_S * rate, SPREAD_TRANSITION_S * rate)
        return cls(tuple(labels), rate, stable, transition, after)

    def geometric(self) -> SegmentModel:
        """The same with durations of the same means that end with one chance at every frame (Viterbi's usual case)."""
        durations = []
        for counted in (self.stable, self.transition):
            frames = np.arange(len(counted))
            chance = 1 / max(float(np.exp(counted) @ frames), 1.5)
            with np.errstate(divide="ignore"):
                durations.append(np.where(frames > 0, np.log(chance) + (frames - 1) * np.log(1 - chance), -np.inf))
        return SegmentModel(self.labels, self.rate, durations[0], durations[1], self.after)

    def settle(self, course: list[tuple[int, int, int]], odds: np.ndarray) -> list[tuple[int, int, int]]:
        """The same course with each transition where the log odds of a transition, (K,), say that it begins and ends.

        Each boundary moves by at most `SETTLING_S`, and keeps two frames to the next transition and at least one of the
        transition found.
        """
        total = np.concatenate([[0.0], np.cumsum(odds)])

        def score(start: int, last_start: int, first_end: int, end: int) -> np.ndarray:
            return total[first_end : end + 1][None, :] - total[start:last_start][:, None]

        return self._moved(course, score, 1.0)

    def _moved(
        self, course: list[tuple[int, int, int]], score: Callable[[int, int, int, int], np.ndarray], weight: float
    ) -> list[tuple[int, int, int]]:
        """The course with the boundaries of each transition where `score` and its duration together are highest.

        `score` is given the first beginning and the frame after the last, the first end and the last.
        """
        reach = round(SETTLING_S * self.rate)
        moved = [list(segment) for segment in course]
        for before, moving, after in zip(moved[:-2:2], moved[1::2], moved[2::2]):
            start, end = moving[:2]
            earliest = min(max(before[0] + 2, start - reach), start)
            latest = max(min(after[1] - 2, end + reach), end)
            length = np.arange(start + 1, latest + 1)[None, :] - np.arange(earliest, end)[:, None]
            known = self.transition[length.clip(1, len(self.transition) - 1)]
            scores = np.where(length >= 2, score(earliest, end, start + 1, latest) + weight * known, -np.inf)
            if np.isfinite(scores).any():
                first, last = np.unravel_index(int(scores.argmax()), scores.shape)
                moving[0], moving[1] = earliest + int(first), start + 1 + int(last)
                before[1], after[0] = moving[0], moving[1]
        return [(first, last, code) for first, last, code in moved]

    def place(
        self, course: list[tuple[int, int, int]], likely: np.ndarray, *, duration_weight: float = 1.0
    ) -> list[tuple[int, int, int]]:
        """The same course with each boundary where it most likely is.

        Each boundary moves within the limits of `settle`.

        Parameters
        ----------
        course : list of (int, int, int)
            As `decode` returns it.
        likely : (K + 1, 2) array
            Log probability, up to a constant, that a transition begins, and that one ends, before each frame.
        duration_weight : float
            Weight of the log probability of the transition's duration.
        """

        def score(start: int, last_start: int, first_end: int, end: int) -> np.ndarray:
            return likely[start:last_start, 0][:, None] + likely[first_end : end + 1, 1][None, :]

        return self._moved(course, score, duration_weight)

    def decode(self, evidence: np.ndarray, boundaries: np.ndarray | None = None) -> list[tuple[int, int, int]]:
        """The course with the highest score.

        Parameters
        ----------
        evidence : (K, A + 1) array
            Log likelihood (up to a constant in each frame) of each label, and of a transition in the last column.
        boundaries : (K + 1, 2) array, optional
            What is scored further for a transition that begins, and that ends, before each frame.

        Returns
        -------
        list of (int, int, int)
            First frame, frame after the last, and label (-1 for a transition) of each segment, in order. The first
            and the last are stable; how long they were before and after the take is unknown and costs nothing.
        """
        frames, held = len(evidence), len(self.labels)
        begins, ends = np.zeros((2, frames + 1)) if boundaries is None else boundaries.T
        total = np.concatenate([np.zeros((1, held + 1)), np.cumsum(evidence, axis=0)])
        label_total, moving_total = total[:, :held], total[:, held]
        longest, widest = len(self.stable) - 1, len(self.transition) - 1
        slope = max((self.stable[longest // 2] - self.stable[longest]) / (longest - longest // 2), 0.0)
        # left[k]: best score of a course whose stable segment ends at k; entered[k]: whose transition ends at k, both
        # less what the segment's label would have collected until k, so that one subtraction serves all durations.
        entered = np.full((frames + 1, held), -np.inf)
        entered[0] = 0.0
        left = np.full((frames + 1, held), -np.inf)
        began = np.zeros((frames + 1, held), dtype=int)
        source = np.zeros((frames + 1, held), dtype=int)
        moved = np.zeros((frames + 1, held), dtype=int)
        old, old_at = np.full(held, -np.inf), np.zeros(held, dtype=int)
        every = np.arange(held)
        for k in range(1, frames + 1):
            last = k == frames  # the take's last segment, whose end is not seen
            first = 1 if last else max(k - longest, 1)
            score = entered[first:k] + (0.0 if last else self.stable[k - first : 0 : -1, None])
            best, at = np.full(held, -np.inf), np.zeros(held, dtype=int)
            if first < k:
                at = score.argmax(axis=0)
                best, at = score[at, every], at + first
            if k > longest + 1 and not last:  # what began longer ago than durations are counted
                gone = k - longest - 1
                better = entered[gone] + slope * gone > old
                old, old_at = np.where(better, entered[gone] + slope * gone, old), np.where(better, gone, old_at)
                score = old + self.stable[longest] - slope * (k - longest)
                best, at = np.where(score > best, score, best), np.where(score > best, old_at, at)
            whole = entered[0] > best  # in the take's first segment, whose beginning is not seen
            best, at = np.where(whole, entered[0], best), np.where(whole, 0, at)
            left[k], began[k] = best + label_total[k], at
            first = max(k - widest, 1)
            if first < k and not last:
                lasting = self.transition[k - first : 0 : -1] - moving_total[first:k] + begins[first:k]
                score = left[first:k] + lasting[:, None]
                leave = score.argmax(axis=0)
                change = score[leave, every][:, None] + self.after
                source[k] = change.argmax(axis=0)
                moved[k] = leave[source[k]] + first
                entered[k] = change.max(axis=0) + moving_total[k] - label_total[k] + ends[k]
        course, end, label = [], frames, int(left[frames].argmax())
        while True:
            begin = int(began[end, label])
            course.append((begin, end, label))
            if begin == 0:
                return course[::-1]
            end, label_before = int(moved[begin, label]), int(source[begin, label])
            course.append((end, begin, -1))
            label = label_before


def _durations(lengths: Sequence[float], longest: float, spread: float) -> np.ndarray:
    """Log probability of durations of 0 to `longest` frames, from counts that are spread to their neighbours."""
    counts = np.zeros(round(longest) + 1)
    np.add.at(counts, np.clip(np.round(np.asarray(lengths, float)).astype(int), 1, len(counts) - 1), 1)
    counts = gaussian_filter1d(counts, spread, mode="constant") + UNSEEN * 1e-2
    counts[0] = 0
    with np.errstate(divide="ignore"):
        return np.log(counts / counts.sum())
