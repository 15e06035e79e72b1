"""Sequence models: boundaries and labels of a take at once, learnt from reference annotations.

- `make_sequence_labeller`: a new, untrained one.
- `SequenceLabeller`: frames judged by what lies around them, decoded by a hidden (semi-)Markov model.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from sklearn.base import clone
from sklearn.exceptions import ConvergenceWarning

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.segmentation.segments import Segments
from signface.sequence.boundary_features import boundary_features
from signface.sequence.semi_markov import SegmentModel
from signface.sequence.take_labeller import HALVES, LEAST, TakeLabeller, log_odds, shares
from signface.settings.choices import SEQUENCE_NAMES


def make_sequence_labeller(name: str, *, seed: int = 0) -> TakeLabeller:
    """A new sequence model, which scikit-learn can clone and search over.

    - `net-hsmm`: three networks with one hidden layer, averaged, and gradient-boosted trees for the boundaries;
      segments last as long as they do in the annotations.
    - `forest-viterbi`: 60 trees; the duration of a segment is geometric, as in every plain hidden Markov model.
    - `hmm`: each state is a Gaussian (one covariance for all), and durations are geometric.
    - `crf`: scores linear in what lies around a frame, learnt for whole courses (`signface.sequence.crf`).
    - `gru`: a recurrent network sees the take forwards and backwards (`signface.sequence.gru`); it trains by PyTorch,
      the extra `deep`, and annotates without it.
    - `boosting`: gradient-boosted trees on frames in their sentence, for tiers where most is `none`
      (`signface.sequence.boosting`).

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
        return SequenceLabeller(nets, boundary_classifier=trees)
    if name == "forest-viterbi":
        from sklearn.ensemble import RandomForestClassifier

        forest = RandomForestClassifier(
            60, min_samples_leaf=5, max_depth=14, max_features=0.03, class_weight="balanced", random_state=seed
        )
        return SequenceLabeller(forest, durations="geometric")
    if name == "crf":
        from signface.sequence.crf import ChainLabeller

        return ChainLabeller()
    if name == "gru":
        from signface.sequence.gru import RecurrentLabeller

        return RecurrentLabeller(seed=seed)
    if name == "boosting":
        from signface.sequence.boosting import BoostingLabeller

        return BoostingLabeller(seed=seed)
    if name == "hmm":
        from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

        gaussians = LinearDiscriminantAnalysis(solver="lsqr", shrinkage=0.1)
        return SequenceLabeller(gaussians, durations="geometric")
    raise SignfaceError(f"there is no sequence model named {name}", hint=f"choose one of {', '.join(SEQUENCE_NAMES)}")


class SequenceLabeller(TakeLabeller):
    """Boundaries and labels of takes, learnt from annotated takes.

    A frame classifier gives each frame (25 a second) the probability of each label and of the two halves of a
    transition, from the weights within 0.6 s of it (`FrameFeatures`) and from movement in the regions of the face
    (`boundary_features`). A hidden semi-Markov model then finds the course that explains them best: stable segments and
    transitions take turns, last about as long as annotated ones, and follow each other as annotated ones do.

    Parameters
    ----------
    frame_classifier : estimator
        Of scikit-learn, with `predict_proba`; it is cloned.
    boundary_classifier : estimator, optional
        A second opinion on whether a frame is a transition, from `boundary_features` alone, which say nothing about the
        expression; the log odds of both are averaged.
    durations : str
        `counted`, those of the annotations, or `geometric`, a constant chance to end at every frame.
    boundary_weight : float
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
        boundary_classifier: Any = None,
        durations: str = "counted",
        boundary_weight: float = 1.0,
        label_weight: float = 0.25,
        rarity: float = 0.6,
        relative: bool = False,
    ) -> None:
        self.frame_classifier = frame_classifier
        self.boundary_classifier = boundary_classifier
        self.durations = durations
        self.boundary_weight = boundary_weight
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
        states = self.states_of(takes, references)
        known = [state != "" for state in states]
        state = np.concatenate([state[k] for state, k in zip(states, known, strict=True)])
        boundaries = [boundary_features(take, self._frames.times(take)) for take in takes]
        gathered = np.concatenate(boundaries)
        self.boundary_mean_, self.boundary_scale_ = gathered.mean(axis=0), gathered.std(axis=0) + 1e-9
        features = [self._features(take)[k] for take, k in zip(takes, known, strict=True)]
        self.n_frames_ = len(state)
        with warnings.catch_warnings():  # a network trains for a fixed time, which is meant
            warnings.simplefilter("ignore", ConvergenceWarning)
            self.frames_ = clone(self.frame_classifier).fit(np.concatenate(features), state)
        for member in getattr(self.frames_, "estimators_", []):
            for left_over in ("_optimizer", "_best_coefs", "_best_intercepts"):  # four fifths of the size of a net
                vars(member).pop(left_over, None)
        self.boundaries_ = None
        if self.boundary_classifier is not None:
            seen = np.concatenate([boundary[k] for boundary, k in zip(boundaries, known, strict=True)])
            self.boundaries_ = clone(self.boundary_classifier).fit(
                seen, np.where(np.isin(state, HALVES), state, "stable")
            )
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
        probability = self.frames_.predict_proba(self._features(take))[:, place]
        held = len(self.classes_)
        return np.concatenate([probability[:, :held], probability[:, held:].sum(axis=1, keepdims=True)], axis=1)

    def find(self, take: Descriptors) -> tuple[np.ndarray, list[tuple[int, int, int]]]:
        """See `TakeLabeller`."""
        probability = self.frame_probabilities(take)
        held = len(self.classes_)
        among = shares(probability[:, :held])
        odds = log_odds(probability[:, held])
        if self.boundaries_ is not None:
            stable = list(self.boundaries_.classes_).index("stable")
            still = self.boundaries_.predict_proba(boundary_features(take, self.frame_times(take)))[:, stable]
            odds = (odds + log_odds(1 - still)) / 2
        likely = odds - self.rarity * log_odds(self.shares_[held:].sum())
        label = np.log(among.clip(LEAST)) - 0.5 * np.log(self.shares_[:held] / self.shares_[:held].sum())
        label -= label.max(axis=1, keepdims=True)
        model = SegmentModel(tuple(self.classes_), self._frames.rate, self.stable_, self.transition_, self.after_)
        course = model.decode(np.column_stack([self.label_weight * label, self.boundary_weight * likely]))
        return among, model.settle(course, self.boundary_weight * odds)

    def _features(self, take: Descriptors) -> np.ndarray:
        """(K, features) of both kinds; the boundaries' scaled to the size of weights."""
        boundaries = (boundary_features(take, self._frames.times(take)) - self.boundary_mean_) / self.boundary_scale_
        return np.concatenate([self._frames.of(take, self.bases_), 0.3 * boundaries.clip(-4, 4)], axis=1)
