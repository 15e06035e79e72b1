"""Sequence models: borders and labels of a take at once, learnt from reference annotations.

- `make_sequence_labeller`: a new, untrained one.
- `SequenceLabeller`: frames judged by what lies around them, decoded by a hidden (semi-)Markov model.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, clone
from sklearn.exceptions import ConvergenceWarning

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.label.border_features import border_features
from signface.label.frame_features import TRANSITION, FrameFeatures, frame_states
from signface.label.labellers import SEQUENCE_NAMES
from signface.label.semi_markov import SegmentModel
from signface.label.vocabulary import join
from signface.segment.segments import Segments

#: The two halves of a transition, which a frame classifier tells apart better than one state that begins as one
#: expression and ends as another.
HALVES = ("leaving", "arriving")

#: Share of a probability that no frame classifier is trusted to tell from zero.
LEAST = 1e-3


def make_sequence_labeller(name: str, *, seed: int = 0) -> SequenceLabeller:
    """A new sequence model, which scikit-learn can clone and search over.

    - `net-hsmm`: three networks with one hidden layer, averaged, and gradient-boosted trees for the borders; segments
      last as long as they do in the annotations.
    - `forest-viterbi`: 60 trees; the duration of a segment is geometric, as in every plain hidden Markov model.
    - `hmm`: each state is a Gaussian (one covariance for all), and durations are geometric.

    Parameters
    ----------
    name : str
        One of `signface.label.labellers.SEQUENCE_NAMES`.
    seed : int

    Raises
    ------
    SignfaceError
        There is no sequence model of that name.
    """
    if name == "net-hsmm":
        from sklearn.ensemble import BaggingClassifier, HistGradientBoostingClassifier
        from sklearn.neural_network import MLPClassifier

        net = MLPClassifier((96,), alpha=0.3, batch_size=256, max_iter=14)
        # Each sees all frames: what is averaged out is the chance of the beginning, not of a draw.
        nets = BaggingClassifier(net, n_estimators=3, bootstrap=False, random_state=seed)
        trees = HistGradientBoostingClassifier(
            max_iter=80, max_leaf_nodes=15, l2_regularization=1.0, early_stopping=False, random_state=seed
        )
        return SequenceLabeller(nets, border_classifier=trees)
    if name == "forest-viterbi":
        from sklearn.ensemble import RandomForestClassifier

        forest = RandomForestClassifier(
            60, min_samples_leaf=5, max_depth=14, max_features=0.03, class_weight="balanced", random_state=seed
        )
        return SequenceLabeller(forest, durations="geometric")
    if name == "hmm":
        from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

        gaussians = LinearDiscriminantAnalysis(solver="lsqr", shrinkage=0.1)
        return SequenceLabeller(gaussians, durations="geometric")
    raise SignfaceError(f"there is no sequence model named {name}", hint=f"choose one of {', '.join(SEQUENCE_NAMES)}")


class SequenceLabeller(BaseEstimator):
    """Borders and labels of takes, learnt from annotated takes.

    A frame classifier gives each frame (25 a second) the probability of each label and of the two halves of a
    transition, from the weights within 0.6 s of it (`FrameFeatures`) and from movement in the regions of the face
    (`border_features`). A hidden semi-Markov model then finds the course that explains them best: stable segments and
    transitions take turns, last about as long as annotated ones, and follow each other as annotated ones do.

    Parameters
    ----------
    frame_classifier : estimator
        Of scikit-learn, with `predict_proba`; it is cloned.
    border_classifier : estimator, optional
        A second opinion on whether a frame is a transition, from `border_features` alone, which say nothing about the
        expression; the log odds of both are averaged.
    durations : str
        `counted`, those of the annotations, or `geometric`, a constant chance to end at every frame.
    border_weight : float
        Weight of the log odds of a transition against the durations. Neighbouring frames are nearly equal, so that
        their probabilities must not simply be multiplied; 1 suits 25 frames a second.
    label_weight : float
        The same for the labels among each other.
    rarity : float
        How far the odds of a transition are corrected for how rare transitions are, 0 (not) to 1 (wholly). Without it
        short transitions are passed over. Where a transition begins and ends is settled without it afterwards, or
        every one would be found too long.
    relative : bool
        See `FrameFeatures`.

    Attributes
    ----------
    classes_ : (A,) array of str
    bases_ : tuple of str
    n_features_in_ : int
        Number of bases.
    """

    def __init__(
        self,
        frame_classifier: Any,
        *,
        border_classifier: Any = None,
        durations: str = "counted",
        border_weight: float = 1.0,
        label_weight: float = 0.25,
        rarity: float = 0.6,
        relative: bool = False,
    ) -> None:
        self.frame_classifier = frame_classifier
        self.border_classifier = border_classifier
        self.durations = durations
        self.border_weight = border_weight
        self.label_weight = label_weight
        self.rarity = rarity
        self.relative = relative

    def fit(self, takes: Sequence[Descriptors], references: Sequence[Segments]) -> SequenceLabeller:
        """Learn from annotated takes.

        Parameters
        ----------
        takes : sequence of Descriptors
            All with the bases of the first.
        references : sequence of Segments
            Their annotations, with labels. Frames that are not annotated are not learnt from.

        Raises
        ------
        SignfaceError
            There is one label only, or no transition.
        """
        if self.durations not in ("counted", "geometric"):
            raise SignfaceError(f"durations are counted or geometric, not {self.durations}")
        self.bases_ = tuple(takes[0].names)
        self.n_features_in_ = len(self.bases_)
        held = {str(label) for reference in references for label in reference.table.query("kind == 'stable'")["label"]}
        self.classes_ = np.array(sorted(held))
        states = [_halved(frame_states(r, self._frames.times(d))) for d, r in zip(takes, references, strict=True)]
        known = [state != "" for state in states]
        state = np.concatenate([state[k] for state, k in zip(states, known, strict=True)])
        if len(self.classes_) < 2 or not set(HALVES) <= set(state):
            raise SignfaceError(
                "a sequence model needs two expressions or more and the transitions between them",
                hint="train on more takes, or look at their annotations",
            )
        missing = sorted(set(self.classes_) - set(state))
        if missing:
            raise SignfaceError(
                f"the training takes hold too little of {', '.join(missing)}",
                hint="train on more takes of it, or on takes without it",
            )
        borders = [border_features(take, self._frames.times(take)) for take in takes]
        gathered = np.concatenate(borders)
        self.border_mean_, self.border_scale_ = gathered.mean(axis=0), gathered.std(axis=0) + 1e-9
        features = [self._features(take)[k] for take, k in zip(takes, known, strict=True)]
        self.n_frames_ = len(state)
        with warnings.catch_warnings():  # a network trains for a fixed time, which is meant
            warnings.simplefilter("ignore", ConvergenceWarning)
            self.frames_ = clone(self.frame_classifier).fit(np.concatenate(features), state)
        for member in getattr(self.frames_, "estimators_", []):
            for left_over in ("_optimizer", "_best_coefs", "_best_intercepts"):  # four fifths of the size of a net
                vars(member).pop(left_over, None)
        self.borders_ = None
        if self.border_classifier is not None:
            seen = np.concatenate([border[k] for border, k in zip(borders, known, strict=True)])
            self.borders_ = clone(self.border_classifier).fit(seen, np.where(np.isin(state, HALVES), state, "stable"))
        order = [*self.classes_, *HALVES]
        self.shares_ = np.array([float(np.mean(state == name)) for name in order])
        course = SegmentModel.learn(references, self.classes_.tolist(), self._frames.rate)
        if self.durations == "geometric":
            course = course.geometric()
        self.stable_, self.transition_, self.after_ = course.stable, course.transition, course.after
        return self

    def frame_probabilities(self, take: Descriptors) -> np.ndarray:
        """(K, A + 1) probability of each of `classes_`, and of a transition, at the times of `frame_times`."""
        place = [list(self.frames_.classes_).index(name) for name in (*self.classes_, *HALVES)]
        found = self.frames_.predict_proba(self._features(take))[:, place]
        held = len(self.classes_)
        return np.concatenate([found[:, :held], found[:, held:].sum(axis=1, keepdims=True)], axis=1)

    def label_probabilities(self, take: Descriptors) -> np.ndarray:
        """(K, A) probability of each of `classes_` at each frame, if it is no transition."""
        return _shares(self.frame_probabilities(take)[:, : len(self.classes_)])

    def frame_times(self, take: Descriptors) -> np.ndarray:
        """(K,) times at which the frames of a take are judged, seconds."""
        return self._frames.times(take)

    def annotate(self, take: Descriptors) -> Segments:
        """The segments of a take with `label` and `confidence`.

        The confidence of a stable segment is the mean probability of its label among the labels over its frames, that
        of a transition the product of its neighbours'.
        """
        probability = self.frame_probabilities(take)
        held = len(self.classes_)
        among = _shares(probability[:, :held])
        odds = _log_odds(probability[:, held])
        if self.borders_ is not None:
            stable = list(self.borders_.classes_).index("stable")
            still = self.borders_.predict_proba(border_features(take, self.frame_times(take)))[:, stable]
            odds = (odds + _log_odds(1 - still)) / 2
        likely = odds - self.rarity * _log_odds(self.shares_[held:].sum())
        label = np.log(among.clip(LEAST)) - 0.5 * np.log(self.shares_[:held] / self.shares_[:held].sum())
        label -= label.max(axis=1, keepdims=True)
        model = SegmentModel(tuple(self.classes_), self._frames.rate, self.stable_, self.transition_, self.after_)
        course = model.decode(np.column_stack([self.label_weight * label, self.border_weight * likely]))
        course = model.settle(course, self.border_weight * odds)
        step = take.duration / len(probability)
        kept = [(first, last, code, float(among[first:last, code].mean())) for first, last, code in course[::2]]
        rows: list[tuple[float, float, str, str, float]] = []
        for number, (first, last, code, sure) in enumerate(kept):
            if number:
                _, before, from_code, from_sure = kept[number - 1]
                name = join(self.classes_[from_code], self.classes_[code])
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
        for found, reference, take in zip(self.predict(takes), references, takes, strict=True):
            times = self.frame_times(take)
            truth, said = frame_states(reference, times), frame_states(found, times)
            right += int((truth == said)[truth != ""].sum())
            total += int((truth != "").sum())
        return right / total if total else float("nan")

    @property
    def _frames(self) -> FrameFeatures:
        return FrameFeatures(relative=self.relative)

    def _features(self, take: Descriptors) -> np.ndarray:
        """(K, features) of both kinds; the borders' scaled to the size of weights, so that a network weighs them so."""
        borders = (border_features(take, self._frames.times(take)) - self.border_mean_) / self.border_scale_
        return np.concatenate([self._frames.of(take, self.bases_), 0.3 * borders.clip(-4, 4)], axis=1)


def _halved(states: np.ndarray) -> np.ndarray:
    """States with each transition called `HALVES`, the first and the second half of its frames."""
    halved = states.astype(object)
    edges = np.flatnonzero(np.diff((states == TRANSITION).astype(np.int8), prepend=0, append=0))
    for start, end in edges.reshape(-1, 2):
        middle = (start + end + 1) // 2
        halved[start:middle], halved[middle:end] = HALVES
    return halved.astype(str)


def _log_odds(probability: np.ndarray | float) -> np.ndarray:
    """Log odds of probabilities, none of them nearer to 0 or 1 than `LEAST`."""
    bounded = np.clip(probability, LEAST, 1 - LEAST)
    return np.log(bounded / (1 - bounded))


def _shares(probability: np.ndarray) -> np.ndarray:
    """Probabilities of the labels, given that it is one of them."""
    return probability / probability.sum(axis=1, keepdims=True).clip(1e-12)
