"""What all models have in common that find the segments of a take by its frames.

- `TakeLabeller`: the base class; a model adds how frames are judged and how a course is found.
- `HALVES`: the states that a transition is made of.
- `standardised`: features of mean 0 and deviation 1, none far away.
- `shares`, `log_odds`: probabilities of the labels among each other, and odds that stay finite.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
from sklearn.base import BaseEstimator

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.frames import runs
from signface.segmentation.segments import Segments
from signface.sequence.boundary_features import boundary_features
from signface.sequence.frame_features import TRANSITION, FrameFeatures, frame_states

#: The two halves of a transition, which a frame classifier tells apart better than one state that begins as one
#: expression and ends as another.
HALVES = ("leaving", "arriving")

#: Share of a probability that no frame classifier is trusted to tell from zero.
LEAST = 1e-3

#: Features further than this from their mean (in deviations) count as so far.
FURTHEST = 6.0


class TakeLabeller(BaseEstimator, ABC):
    """Base class of the models that find boundaries and labels of a take at once, learnt from annotated takes.

    A model gives `fit` (which calls `states_of`), `frame_probabilities` and `find`; from these come the annotation
    of a take and the label of any stretch of it.

    Attributes
    ----------
    classes_ : (A,) array of str
    bases_ : tuple of str
    n_features_in_ : int
        Number of bases.
    """

    relative: bool = False
    #: Whether it learns segments that follow each other at once, rather than through transitions.
    abrupt: bool = False
    classes_: np.ndarray
    bases_: tuple[str, ...]
    n_features_in_: int

    def states_of(self, takes: Sequence[Descriptors], references: Sequence[Segments]) -> list[np.ndarray]:
        """The reference's state of each frame of each take: a label, one of `HALVES`, or empty.

        It also learns which bases and labels there are.

        Raises
        ------
        SignfaceError
            There is one label only, or no transition.
        """
        self.bases_ = tuple(takes[0].names)
        self.n_features_in_ = len(self.bases_)
        held = {str(label) for reference in references for label in reference.table.query("kind == 'stable'")["label"]}
        self.classes_ = np.array(sorted(held))
        states = [_halved(frame_states(r, self._frames.times(d))) for d, r in zip(takes, references, strict=True)]
        seen = {state for of_take in states for state in of_take} - {""}
        if len(self.classes_) < 2 or not set(HALVES) <= seen:
            raise SignfaceError(
                "a sequence model needs two expressions or more and the transitions between them",
                hint="train on more takes, or look at their annotations",
            )
        missing = sorted(held - seen)
        if missing:
            raise SignfaceError(
                f"the training takes hold too little of {', '.join(missing)}",
                hint="train on more takes of it, or on takes without it",
            )
        return states

    @abstractmethod
    def frame_probabilities(self, take: Descriptors) -> np.ndarray:
        """(K, A + 1) probability of each of `classes_`, and of a transition, at the times of `frame_times`."""

    @abstractmethod
    def find(self, take: Descriptors) -> tuple[np.ndarray, list[tuple[int, int, int]]]:
        """What `label_probabilities` gives, and the course of the take.

        The course holds the first frame, the frame after the last, and the code of the label (-1 for a transition) of
        each segment in turn; the first and the last are stable.
        """

    def label_probabilities(self, take: Descriptors) -> np.ndarray:
        """(K, A) probability of each of `classes_` at each frame, if it is no transition."""
        return shares(self.frame_probabilities(take)[:, : len(self.classes_)])

    def frame_times(self, take: Descriptors) -> np.ndarray:
        """(K,) times at which the frames of a take are judged, seconds."""
        return self._frames.times(take)

    def annotate(self, take: Descriptors) -> Segments:
        """The segments of a take with `label` and `confidence`.

        The confidence of a stable segment is the mean probability of its label among the labels over its frames, that
        of a transition the product of its neighbours'.
        """
        import pandas as pd

        among, course = self.find(take)
        step = take.duration / len(among)
        kept = [(first, last, code, float(among[first:last, code].mean())) for first, last, code in course[::2]]
        rows: list[tuple[float, float, str, str, float]] = []
        for number, (first, last, code, sure) in enumerate(kept):
            if number:
                _, before, from_code, from_sure = kept[number - 1]
                name = f"{self.classes_[from_code]}{self.classes_[code]}"
                rows.append((before, first, "transition", name, from_sure * sure))
            rows.append((first, last, "stable", str(self.classes_[code]), sure))
        table = pd.DataFrame(rows, columns=["start_s", "end_s", "kind", "label", "confidence"])
        table[["start_s", "end_s"]] = take.start + table[["start_s", "end_s"]] * step
        return Segments(table, name=take.name, history=take.history)

    def predict(self, takes: Sequence[Descriptors]) -> list[Segments]:
        """The segments of each take; see `annotate`."""
        return [self.annotate(take) for take in takes]

    def score(self, takes: Sequence[Descriptors], references: Sequence[Segments]) -> float:
        """Share of frames that get the reference's label, all transitions counted as one label."""
        right = total = 0
        for segments, reference, take in zip(self.predict(takes), references, takes, strict=True):
            times = self.frame_times(take)
            truth, states = frame_states(reference, times), frame_states(segments, times)
            right += int((truth == states)[truth != ""].sum())
            total += int((truth != "").sum())
        return right / total if total else float("nan")

    @property
    def _frames(self) -> FrameFeatures:
        return FrameFeatures(relative=self.relative)

    def _seen(self, take: Descriptors) -> np.ndarray:
        """(K, features) of both kinds, as they are."""
        times = self._frames.times(take)
        return np.concatenate([self._frames.of(take, self.bases_), boundary_features(take, times)], axis=1)


def standardised(features: np.ndarray, mean: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """(K, N) float32 features less their mean, by their scale, at most `FURTHEST` either way."""
    return ((features - mean) / scale).clip(-FURTHEST, FURTHEST).astype(np.float32)


def shares(probability: np.ndarray) -> np.ndarray:
    """Probabilities of the labels, given that it is one of them."""
    return probability / probability.sum(axis=1, keepdims=True).clip(1e-12)


def log_odds(probability: np.ndarray | float) -> np.ndarray:
    """Log odds of probabilities, none of them nearer to 0 or 1 than `LEAST`."""
    bounded = np.clip(probability, LEAST, 1 - LEAST)
    return np.log(bounded / (1 - bounded))


def _halved(states: np.ndarray) -> np.ndarray:
    """States with each transition called `HALVES`, the first and the second half of its frames."""
    halved = states.astype(object)
    for start, end in runs(states == TRANSITION):
        middle = (start + end + 1) // 2
        halved[start:middle], halved[middle:end] = HALVES
    return halved.astype(str)
