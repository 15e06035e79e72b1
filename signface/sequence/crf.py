"""A linear-chain conditional random field: boundaries and labels of a take from one course through all its frames.

- `ChainLabeller`: learns from annotated takes and annotates others.
- `log_likelihood`: of courses, with its gradient, by the forward and backward recursions.

After Lafferty, McCallum and Pereira (2001). Each frame has a state (a label, or a half of a transition), each state a
linear score of what lies around the frame, each pair of states a score of its own; all are learnt at once so that the
annotated courses are likely among all courses. The libraries for it take each frame as a dictionary of named
attributes, which seven hundred numbers a frame are not, so that the recursions stand here.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from signface.descriptors import Descriptors
from signface.frames import runs, stretches
from signface.segmentation.segments import Segments
from signface.sequence.take_labeller import HALVES, TakeLabeller, shares, standardised


class ChainLabeller(TakeLabeller):
    """Boundaries and labels of takes by a linear-chain conditional random field.

    Parameters
    ----------
    penalty : float
        Weight of the squared coefficients against the mean log likelihood of a frame.
    iterations : int
        At most so many steps of L-BFGS.
    relative : bool
        See `signface.sequence.frame_features.FrameFeatures`.

    Attributes
    ----------
    coefficients_ : (N + 1, A + 2) array
        Of each feature, and the constant, for each label and the two halves of a transition.
    following_ : (A + 2, A + 2) array
        Score of the state of the column after that of the row.
    mean_, scale_ : (N,) arrays
        Of the features.
    """

    def __init__(self, *, penalty: float = 1e-3, iterations: int = 80, relative: bool = False) -> None:
        self.penalty = penalty
        self.iterations = iterations
        self.relative = relative

    def fit(self, takes: Sequence[Descriptors], references: Sequence[Segments]) -> ChainLabeller:
        """Learn from annotated takes.

        Parameters
        ----------
        takes : sequence of Descriptors
            All with the bases of the first.
        references : sequence of Segments
            Their annotations, with labels. Stretches that are not annotated are left out.

        Raises
        ------
        SignfaceError
            There is one label only, or no transition.
        """
        from scipy.optimize import minimize

        states = self.states_of(takes, references)
        order = {state: code for code, state in enumerate((*self.classes_, *HALVES))}
        seen = [self._seen(take) for take in takes]
        gathered = np.concatenate(seen)
        self.mean_, self.scale_ = gathered.mean(axis=0), gathered.std(axis=0) + 1e-6
        del gathered
        rows, codes, lengths = [], [], []
        for features, state in zip(seen, states, strict=True):
            for first, last in runs(state != ""):
                rows.append(standardised(features[first:last], self.mean_, self.scale_))
                codes.append(np.array([order[name] for name in state[first:last]]))
                lengths.append(last - first)
        self.n_frames_ = int(sum(lengths))
        all_rows, all_codes = np.concatenate(rows), np.concatenate(codes)
        del rows, seen
        wide, held = all_rows.shape[1] + 1, len(order)

        def loss(values: np.ndarray) -> tuple[float, np.ndarray]:
            weights, after = values[: wide * held].reshape(wide, held), values[wide * held :].reshape(held, held)
            scores = (all_rows @ weights[:-1].astype(np.float32)).astype(float) + weights[-1]
            likely, by_score, by_pair = log_likelihood(scores, after, all_codes, lengths)
            by_weight = np.vstack([all_rows.T @ by_score.astype(np.float32), by_score.sum(axis=0)])
            gradient = -np.concatenate([by_weight.ravel(), by_pair.ravel()]) / self.n_frames_
            cost = self.penalty * values**2
            cost[(wide - 1) * held : wide * held] = 0  # the constants are free
            slope = 2 * self.penalty * values
            slope[(wide - 1) * held : wide * held] = 0
            return -likely / self.n_frames_ + float(cost.sum()), gradient + slope

        solution = minimize(
            loss, np.zeros((wide + held) * held), jac=True, method="L-BFGS-B", options={"maxiter": self.iterations}
        ).x
        self.coefficients_ = solution[: wide * held].reshape(wide, held).astype(np.float32)
        self.following_ = solution[wide * held :].reshape(held, held)
        return self

    def frame_probabilities(self, take: Descriptors) -> np.ndarray:
        """(K, A + 1) probability of each of `classes_`, and of a transition, at each frame, over all courses."""
        scores = self._scores(take)
        probability, _, _ = _expected(scores, self.following_, [len(scores)])
        held = len(self.classes_)
        return np.concatenate([probability[:, :held], probability[:, held:].sum(axis=1, keepdims=True)], axis=1)

    def find(self, take: Descriptors) -> tuple[np.ndarray, list[tuple[int, int, int]]]:
        """See `TakeLabeller`; of the courses, the likeliest in which a transition leads to another label."""
        return shares(self.frame_probabilities(take)[:, : len(self.classes_)]), self._likeliest(self._scores(take))

    def _scores(self, take: Descriptors) -> np.ndarray:
        """(K, A + 2) score of each state at each frame."""
        rows = standardised(self._seen(take), self.mean_, self.scale_)
        return rows.astype(float) @ self.coefficients_[:-1] + self.coefficients_[-1]

    def _likeliest(self, scores: np.ndarray) -> list[tuple[int, int, int]]:
        """Viterbi's course, in which the first half of a transition remembers its label, and the second knows its own.

        The states are: each label, leaving each label, arriving at each label.
        """
        held = len(self.classes_)
        kind = np.repeat([0, held, held + 1], held)  # column of the scores, for labels from 0 on
        kind[:held] = np.arange(held)
        label = np.tile(np.arange(held), 3)
        part = np.repeat([0, 1, 2], held)
        same = label[:, None] == label[None, :]
        onward = (part[:, None] != 1) | (part[None, :] != 2)
        allowed = np.where(onward, same, ~same) & np.isin(3 * part[:, None] + part[None, :], (0, 1, 4, 5, 8, 6))
        after = np.where(allowed, self.following_[np.ix_(kind, kind)], -np.inf)
        best = np.where(part == 0, scores[0, kind], -np.inf)
        came = np.zeros((len(scores), len(kind)), dtype=int)
        for frame in range(1, len(scores)):
            reached = best[:, None] + after
            came[frame] = reached.argmax(axis=0)
            best = reached.max(axis=0) + scores[frame, kind]
        states = np.zeros(len(scores), dtype=int)
        states[-1] = int(np.where(part == 0, best, -np.inf).argmax())
        for frame in range(len(scores) - 1, 0, -1):
            states[frame - 1] = came[frame, states[frame]]
        codes = np.where(part[states] == 0, label[states], -1)
        return [(first, last, int(codes[first])) for first, last in stretches(codes).tolist()]


def log_likelihood(
    scores: np.ndarray, after: np.ndarray, codes: np.ndarray, lengths: Sequence[int]
) -> tuple[float, np.ndarray, np.ndarray]:
    """Log likelihood of courses among all courses, and its gradient.

    Parameters
    ----------
    scores : (K, S) array
        Score of each state at each frame, of all courses one after the other.
    after : (S, S) array
        Score of the state of the column after that of the row.
    codes : (K,) array of int
        The state of each frame.
    lengths : sequence of int
        Frames of each course; together K.

    Returns
    -------
    float, (K, S) array, (S, S) array
        The sum over the courses, and its derivative by `scores` and by `after`.
    """
    expected, pairs, total = _expected(scores, after, lengths)
    ends = np.cumsum(lengths)
    inside = np.ones(len(codes), dtype=bool)
    inside[ends[:-1]] = False  # the first frame of a course comes after none
    first, second = codes[:-1][inside[1:]], codes[1:][inside[1:]]
    score = scores[np.arange(len(codes)), codes].sum() + after[first, second].sum()
    by_score = -expected
    by_score[np.arange(len(codes)), codes] += 1
    by_pair = -pairs
    np.add.at(by_pair, (first, second), 1)
    return float(score - total), by_score, by_pair


def _expected(scores: np.ndarray, after: np.ndarray, lengths: Sequence[int]) -> tuple[np.ndarray, np.ndarray, float]:
    """(K, S) probability of each state, (S, S) expected number of each pair, and the log sum of all courses' scores.

    All courses are walked through at once, the longest first, so that those still going on are always the first ones.
    """
    frames = np.asarray(lengths)
    starts = np.cumsum(frames) - frames
    order = np.argsort(-frames, kind="stable")
    going = [int((frames > number).sum()) for number in range(int(frames.max()))]
    place = [starts[order[:count]] + frame for frame, count in enumerate(going)]
    highest = scores.max(axis=1)
    likely = np.exp(scores - highest[:, None])
    pair = np.exp(after)
    forward, scale = np.zeros_like(scores), np.zeros(len(scores))
    for frame, rows in enumerate(place):
        reached = likely[rows]
        if frame:
            reached = reached * (forward[rows - 1] @ pair)
        scale[rows] = reached.sum(axis=1)
        forward[rows] = reached / scale[rows][:, None]
    backward = np.ones_like(scores)
    pairs = np.zeros_like(pair)
    for rows in place[:0:-1]:
        coming = likely[rows] * backward[rows] / scale[rows][:, None]
        pairs += forward[rows - 1].T @ coming
        backward[rows - 1] = coming @ pair.T
    return forward * backward, pairs * pair, float((np.log(scale) + highest).sum())
