"""A recurrent network that reads a take forwards and backwards, and says where transitions begin and end.

- `RecurrentLabeller`: learns from annotated takes (by PyTorch, the extra `deep`) and annotates others (without it).
- `recurrent_outputs`: the network's forward pass in NumPy.

Gated recurrent units after Cho et al. (2014). Beside what each frame is, the network learns at which frames
transitions begin and end: not one frame, since annotators do not agree on one, but how likely each is, as heat maps of
landmarks are learnt. A boundary is then put where most of its probability lies.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.special import expit, ndtr, softmax

from signface.descriptors import Descriptors
from signface.segmentation.segments import Segments
from signface.sequence.semi_markov import SegmentModel
from signface.sequence.take_labeller import HALVES, TakeLabeller, log_odds, shares, standardised

#: Least probability of a boundary before a frame that counts, and a usual one, against which it is compared.
LEAST_BOUNDARY = 1e-3
USUAL_BOUNDARY = 0.03

#: Deviation over which probabilities of boundaries are summed when one is found, and when it is put in its place (s).
#: The latter sums what lies within a tenth of a second, about as far as annotators agree.
FINDING_S = 0.04
PLACING_S = 0.07

#: Weight of a transition's duration when its boundaries are put in their places.
PLACING_DURATION = 0.3


class RecurrentLabeller(TakeLabeller):
    """Boundaries and labels of takes by recurrent networks and a hidden semi-Markov model.

    Each network reads what `TakeLabeller` sees of the frames, in two layers, forwards and backwards. Its outputs are
    the state of each frame (a label or a half of a transition) and whether a transition begins or ends there. Several
    networks, which differ by the chance of their beginning and of their training, are averaged.

    While training, takes are mirrored at random, bases are made larger or smaller, and features shifted: no signer's
    face is the last word on how large a smile is.

    Parameters
    ----------
    networks : int
        How many are averaged.
    units : int
        Of each layer in each direction.
    effort : float
        Steps of training on as many frames as one step takes; they grow with the square root of the frames, so that
        a small corpus is gone through more often than a large one.
    batch, stretch : int
        Each step takes `batch` stretches of `stretch` frames, or what a small corpus has.
    rate : float
        The highest step size.
    gain, noise : float
        How much bases are scaled (deviation of the logarithm), and how far standardised features are shifted, in each
        stretch.
    boundary_weight, label_weight, mark_weight : float
        Of the evidence for a transition at a frame, for a label, and for a boundary, against durations and orders.
    rarity : float
        See `signface.sequence.hsmm.SequenceLabeller`.
    seed : int

    Attributes
    ----------
    weights_ : dict of arrays
        Of all networks, each with the networks in its first axis; see `recurrent_outputs`.
    mean_, scale_ : (N,) arrays
        Of the features.
    """

    def __init__(
        self,
        *,
        networks: int = 2,
        units: int = 64,
        effort: float = 150.0,
        batch: int = 32,
        stretch: int = 128,
        rate: float = 3e-3,
        gain: float = 0.3,
        noise: float = 0.2,
        boundary_weight: float = 0.5,
        label_weight: float = 0.2,
        mark_weight: float = 1.0,
        rarity: float = 0.6,
        seed: int = 0,
    ) -> None:
        self.networks = networks
        self.units = units
        self.effort = effort
        self.batch = batch
        self.stretch = stretch
        self.rate = rate
        self.gain = gain
        self.noise = noise
        self.boundary_weight = boundary_weight
        self.label_weight = label_weight
        self.mark_weight = mark_weight
        self.rarity = rarity
        self.seed = seed

    def fit(self, takes: Sequence[Descriptors], references: Sequence[Segments]) -> RecurrentLabeller:
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
            There is one label only, or no transition, or PyTorch is not installed.
        """
        from signface.sequence.gru_training import Lesson, train_networks

        states = self.states_of(takes, references)
        order = {state: code for code, state in enumerate((*self.classes_, *HALVES))}
        seen = [self._seen(take).astype(np.float32) for take in takes]
        gathered = np.concatenate(seen)
        self.mean_ = gathered.mean(axis=0, dtype=float)
        self.scale_ = gathered.std(axis=0, dtype=float) + 1e-3
        del gathered
        lessons = [
            Lesson(
                standardised(features, self.mean_, self.scale_),
                np.array([order.get(name, -1) for name in state]),
                boundary_marks(take, reference, len(state)),
            )
            for take, reference, features, state in zip(takes, references, seen, states, strict=True)
        ]
        del seen
        codes = np.concatenate([lesson.codes for lesson in lessons])
        codes = codes[codes >= 0]
        self.n_frames_ = len(codes)
        self.shares_ = np.bincount(codes, minlength=len(order)) / len(codes)
        trained = train_networks(lessons, self, self._mirrored())
        self.weights_ = {name: np.stack([weights[name] for weights in trained]) for name in trained[0]}
        course = SegmentModel.learn(references, self.classes_.tolist(), self._frames.rate)
        self.stable_, self.transition_, self.after_ = course.stable, course.transition, course.after
        return self

    def frame_probabilities(self, take: Descriptors) -> np.ndarray:
        """(K, A + 1) probability of each of `classes_`, and of a transition, at the times of `frame_times`."""
        return self._outputs(take)[0]

    def find(self, take: Descriptors) -> tuple[np.ndarray, list[tuple[int, int, int]]]:
        """See `TakeLabeller`."""
        probability, marks = self._outputs(take)
        held = len(self.classes_)
        among = shares(probability[:, :held])
        moving = log_odds(probability[:, held]) - self.rarity * log_odds(self.shares_[held:].sum())
        label = np.log(among.clip(1e-3)) - 0.5 * np.log(self.shares_[:held] / self.shares_[:held].sum())
        label -= label.max(axis=1, keepdims=True)
        model = SegmentModel(tuple(self.classes_), self._frames.rate, self.stable_, self.transition_, self.after_)
        finding, placing = (
            np.log(_between_frames(gaussian_filter1d(marks, spread * model.rate, axis=0)) + LEAST_BOUNDARY)
            for spread in (FINDING_S, PLACING_S)
        )
        course = model.decode(
            np.column_stack([self.label_weight * label, self.boundary_weight * moving]),
            self.mark_weight * (finding - np.log(USUAL_BOUNDARY)),
        )
        return among, model.place(course, placing, duration_weight=PLACING_DURATION)

    def _outputs(self, take: Descriptors) -> tuple[np.ndarray, np.ndarray]:
        """(K, A + 1) probabilities of labels and transition, (K, 2) of boundaries of each frame: networks' means."""
        features = standardised(self._seen(take), self.mean_, self.scale_)
        outputs = recurrent_outputs(self.weights_, features).astype(float)
        held = len(self.classes_)
        states = softmax(outputs[:, :, : held + 2], axis=2).mean(axis=0)
        marks = expit(outputs[:, :, held + 2 :]).mean(axis=0)
        return np.column_stack([states[:, :held], states[:, held:].sum(axis=1)]), marks

    def strangeness(self, take: Descriptors) -> float:
        """Mean square of a take's features, standardised as those of the training: about 1 for takes like those."""
        return float(np.mean(standardised(self._seen(take), self.mean_, self.scale_).astype(float) ** 2))

    def _mirrored(self) -> np.ndarray:
        """(N,) where each feature stands in the mirror image of a face: left and right change places."""
        swapped = [name.replace("Left", "\0").replace("Right", "Left").replace("\0", "Right") for name in self.bases_]
        places = np.array([self.bases_.index(name) if name in self.bases_ else i for i, name in enumerate(swapped)])
        kinds = self._frames.width(len(self.bases_)) // len(self.bases_)
        by_base = (np.arange(kinds)[:, None] * len(self.bases_) + places).ravel()
        return np.concatenate([by_base, np.arange(len(by_base), len(self.mean_))])


def boundary_marks(take: Descriptors, reference: Segments, frames: int, *, spread: float = 1.0) -> np.ndarray:
    """(K, 2) how much of the beginning, and of the end, of a transition lies in each frame.

    Each boundary is spread as a Gaussian with a deviation of `spread` frames, so that a boundary weighs 1 in all.
    """
    moving = reference.table[reference.table["kind"] == "transition"]
    edge = np.arange(frames + 1)
    marks = np.zeros((frames, 2))
    for column, name in enumerate(("start_s", "end_s")):
        at = (moving[name].to_numpy(float) - take.start) / take.duration * frames
        marks[:, column] = np.diff(ndtr((edge[:, None] - at[None, :]) / spread), axis=0).sum(axis=1)
    return marks.clip(0, 1).astype(np.float32)


def recurrent_outputs(weights: dict[str, np.ndarray], features: np.ndarray) -> np.ndarray:
    """(M, K, outputs) what M networks say of each frame, before any softmax.

    Parameters
    ----------
    weights : dict of arrays
        `in_weight` (M, N, P) and `in_bias` (M, P) of the layer that makes the input smaller; for each recurrent layer
        `l`, `input_l` (M, 2, P, 3 H), `state_l` (M, 2, H, 3 H), `input_bias_l` and `state_bias_l` (M, 2, 3 H), for
        both directions, gates in the order reset, update, new; `out_weight` (M, 2 H, outputs), `out_bias`.
    features : (K, N) array
        Standardised.
    """
    hidden = np.tanh(features @ weights["in_weight"] + weights["in_bias"][:, None])
    layer = 0
    while f"input_{layer}" in weights:
        given, kept = weights[f"input_{layer}"], weights[f"state_{layer}"]
        both = np.stack([hidden, hidden[:, ::-1]], axis=1)  # (M, 2, K, P): time runs backwards in the second
        drive = np.moveaxis(both @ given + weights[f"input_bias_{layer}"][:, :, None], 2, 0)[:, :, :, None]
        bias = weights[f"state_bias_{layer}"][:, :, None]
        width = kept.shape[2]
        state = np.zeros((*kept.shape[:2], 1, width), dtype=features.dtype)
        states = np.empty((len(features), *state.shape), dtype=features.dtype)
        for frame, now in enumerate(drive):
            past = state @ kept + bias
            gates = 0.5 + 0.5 * np.tanh(0.5 * (now[..., : 2 * width] + past[..., : 2 * width]))
            new = np.tanh(now[..., 2 * width :] + gates[..., :width] * past[..., 2 * width :])
            state = new + gates[..., width:] * (state - new)
            states[frame] = state
        ahead, back = np.moveaxis(states[:, :, :, 0], 0, 2).transpose(1, 0, 2, 3)
        hidden = np.concatenate([ahead, back[:, ::-1]], axis=2)
        layer += 1
    return hidden @ weights["out_weight"] + weights["out_bias"][:, None]


def _between_frames(values: np.ndarray) -> np.ndarray:
    """(K + 1, C) values before each frame and after the last, from those of the (K, C) frames."""
    return np.concatenate([values[:1], (values[1:] + values[:-1]) / 2, values[-1:]])
