"""Gradient-boosted trees on whole sentences: boundaries and labels of a take where most of it is `none`.

- `BoostingLabeller`: learns from annotated takes and annotates others.

For tiers on which what is annotated lies far apart and begins and ends at once: raised brows, questions, negation.
Frames are judged by trees (Friedman 2001) that see the second around each of them and the whole take; the likeliest
course through them is found by Viterbi's algorithm, with one chance to stay for all labels.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.frames import stretches
from signface.segmentation.segments import Segments
from signface.sequence.course_features import course_features
from signface.sequence.frame_features import TRANSITION, frame_states
from signface.sequence.take_labeller import TakeLabeller
from signface.sequence.tree_arrays import tree_arrays, tree_probabilities


class BoostingLabeller(TakeLabeller):
    """Boundaries and labels of takes by gradient-boosted trees and Viterbi's algorithm.

    Parameters
    ----------
    iterations : int
        Turns of boosting.
    rate : float
        What a turn counts.
    leaves, smallest : int
        At most so many leaves a tree, with at least so many frames each.
    penalty : float
        Weight of the squared values of leaves.
    columns : float
        Share of the features that a split looks at.
    every : int
        Train on every so many frames: neighbours are nearly equal.
    balance : float
        How far rare labels count more in training: 0 as often as they are, 1 all the same.
    stay : float
        Chance that the label stays from one frame (1/25 s) to the next.
    seed : int

    Attributes
    ----------
    classes_ : (A,) array of str
    trees_ : dict of str to array
        See `signface.sequence.tree_arrays`.
    n_frames_ : int
        Frames it was trained on.
    """

    abrupt = True

    def __init__(
        self,
        *,
        iterations: int = 150,
        rate: float = 0.05,
        leaves: int = 12,
        smallest: int = 20,
        penalty: float = 5.0,
        columns: float = 0.2,
        every: int = 2,
        balance: float = 0.0,
        stay: float = 0.9,
        seed: int = 0,
    ) -> None:
        self.iterations = iterations
        self.rate = rate
        self.leaves = leaves
        self.smallest = smallest
        self.penalty = penalty
        self.columns = columns
        self.every = every
        self.balance = balance
        self.stay = stay
        self.seed = seed

    def fit(self, takes: Sequence[Descriptors], references: Sequence[Segments]) -> BoostingLabeller:
        """Learn from annotated takes.

        Parameters
        ----------
        takes : sequence of Descriptors
            All with the bases of the first.
        references : sequence of Segments
            Their annotations. Frames that are not annotated, and those of transitions, are not learnt from.

        Raises
        ------
        SignfaceError
            There is one label only.
        """
        from sklearn.ensemble import HistGradientBoostingClassifier

        if not 0 < self.stay < 1:
            raise SignfaceError(f"the chance to stay lies between 0 and 1, and is not {self.stay:g}")
        self.bases_ = tuple(takes[0].names)
        self.n_features_in_ = len(self.bases_)
        states, features = [], []
        for take, reference in zip(takes, references, strict=True):
            times = self._frames.times(take)
            state = frame_states(reference, times)
            known = (state != "") & (state != TRANSITION)
            states.append(state[known][:: self.every])
            features.append(course_features(take.on(self.bases_), times)[known][:: self.every])
        state = np.concatenate(states)
        self.classes_, counts = np.unique(state, return_counts=True)
        if len(self.classes_) < 2:
            raise SignfaceError(
                f"the training takes show {len(self.classes_)} label, a sequence model needs two or more",
                hint="train on more takes, or look at their annotations",
            )
        worth: dict[str, float] = dict(
            zip(self.classes_, (len(state) / counts / len(counts)) ** self.balance, strict=True)
        )
        trees = HistGradientBoostingClassifier(
            max_iter=self.iterations,
            learning_rate=self.rate,
            max_leaf_nodes=self.leaves,
            min_samples_leaf=self.smallest,
            l2_regularization=self.penalty,
            max_features=self.columns,
            early_stopping=False,
            random_state=self.seed,
        ).fit(np.concatenate(features), state, sample_weight=np.array([worth[label] for label in state]))
        self.trees_ = tree_arrays(trees)
        self.n_frames_ = len(state)
        return self

    def frame_probabilities(self, take: Descriptors) -> np.ndarray:
        """(K, A + 1) probability of each of `classes_`, and of a transition, which there is none."""
        features = course_features(take.on(self.bases_), self.frame_times(take))
        probability = tree_probabilities(self.trees_, features)
        return np.column_stack([probability, np.zeros(len(probability))])

    def find(self, take: Descriptors) -> tuple[np.ndarray, list[tuple[int, int, int]]]:
        """See `TakeLabeller`; the segments follow each other without transitions."""
        among = self.label_probabilities(take)
        path = likeliest_path(np.log(among.clip(1e-6)), self.stay)
        return among, [(start, end, int(path[start])) for start, end in stretches(path).tolist()]

    def annotate(self, take: Descriptors) -> Segments:
        """The segments of a take with `label` and `confidence`, one after the other."""
        import pandas as pd

        among, course = self.find(take)
        step = take.duration / len(among)
        rows = [
            (take.start + first * step, take.start + last * step, "stable", str(self.classes_[code]))
            for first, last, code in course
        ]
        table = pd.DataFrame(rows, columns=["start_s", "end_s", "kind", "label"])
        table["confidence"] = [float(among[first:last, code].mean()) for first, last, code in course]
        return Segments(table, name=take.name, history=take.history)


def likeliest_path(scores: np.ndarray, stay: float) -> np.ndarray:
    """(K,) the likeliest state of each frame by Viterbi's algorithm; all changes are as likely as each other.

    Parameters
    ----------
    scores : (K, A) array
        Log probability of each state at each frame.
    stay : float
        Chance of the state of one frame to be that of the next.

    Examples
    --------
    >>> likeliest_path(np.log([[0.9, 0.1], [0.4, 0.6], [0.9, 0.1]]), stay=0.9).tolist()
    [0, 0, 0]
    """
    frames, states = scores.shape
    step = np.full((states, states), np.log((1 - stay) / max(states - 1, 1)))
    np.fill_diagonal(step, np.log(stay))
    best = scores[0].copy()
    came = np.zeros((frames, states), dtype=np.int64)
    for frame in range(1, frames):
        ways = best[:, None] + step
        came[frame] = ways.argmax(axis=0)
        best = ways.max(axis=0) + scores[frame]
    path = np.empty(frames, dtype=np.int64)
    path[-1] = best.argmax()
    for frame in range(frames - 1, 0, -1):
        path[frame - 1] = came[frame, path[frame]]
    return path
