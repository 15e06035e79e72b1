"""Training a classifier on annotated takes (thesis 4.4.3).

- `Example`: a solved take with its reference annotation.
- `training_frames`: the frames a classifier learns from.
- `train_model`: a trained `TrainedModel`.
- `score_by_take`: how well it does on takes it has not seen, within the training takes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
import pandas as pd

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.label.labellers import SEQUENCE_NAMES, make_labeller
from signface.label.labelling import label_spans
from signface.label.model import Card, TrainedModel, on_bases
from signface.label.vocabulary import AFFECTS
from signface.segment.segments import Segments

#: Frames per second kept for training: a held face hardly changes in a tenth of a second.
TRAINING_RATE = 10.0


@dataclass(frozen=True)
class Example:
    """A solved take with its reference annotation.

    Parameters
    ----------
    take : str
        Name of the take, unique in its corpus.
    signer, kind : str
        As in the corpus (`IE`, `SE`, `EU` or any other word).
    descriptors : Descriptors
    reference : Segments
        With the column `label`: labels of stable segments, names of transitions.
    """

    take: str
    signer: str
    kind: str
    descriptors: Descriptors
    reference: Segments

    def __post_init__(self) -> None:
        if not self.reference.labelled:
            raise SignfaceError(f"{self.take}: its reference annotation has no labels")
        unknown = sorted({str(label) for label in self.stable["label"]} - set(AFFECTS))
        if unknown:
            raise SignfaceError(
                f"{self.take}: its reference annotation has the unknown label {', '.join(unknown)}",
                hint=f"the labels of stable segments are {' '.join(AFFECTS)}",
            )

    @property
    def stable(self) -> pd.DataFrame:
        """The rows of the reference's stable segments."""
        return self.reference.table[self.reference.table["kind"] == "stable"]


def training_frames(
    example: Example, bases: Sequence[str], *, rate: float = TRAINING_RATE
) -> tuple[np.ndarray, np.ndarray]:
    """Weights and labels of evenly spaced frames of the reference's stable segments.

    Neighbouring frames at 200 Hz are nearly equal: `rate` frames per second are kept (at least the middle one of
    each segment), which costs no accuracy worth the name and makes the support vector machines train in seconds.
    Frames without weights are left out.

    Parameters
    ----------
    example : Example
    bases : sequence of str
        The columns wanted, in this order.
    rate : float
        Frames kept per second of stable segment (Hz).

    Returns
    -------
    (K, len(bases)) weights and (K,) labels.
    """
    descriptors = example.descriptors
    columns = [descriptors.names.index(name) for name in bases]
    known = np.isfinite(descriptors.weights).all(axis=1)
    time = descriptors.time
    frames, labels = [], []
    for start, end, label in example.stable[["start_s", "end_s", "label"]].itertuples(index=False):
        inside = np.flatnonzero((time >= start) & (time < end) & known)
        if len(inside) == 0:
            continue
        count = max(1, round(len(inside) / descriptors.rate * rate))
        picked = inside[((np.arange(count) + 0.5) * len(inside) / count).astype(int)]
        frames.append(descriptors.weights[np.ix_(picked, columns)])
        labels += [label] * count
    if not frames:
        return np.zeros((0, len(bases))), np.zeros(0, dtype=str)
    return np.concatenate(frames), np.array(labels, dtype=str)


def common_bases(examples: Sequence[Example]) -> tuple[str, ...]:
    """The bases of the examples.

    Raises
    ------
    SignfaceError
        Two takes have other bases; the message names them.
    """
    first = examples[0]
    for other in examples[1:]:
        if set(other.descriptors.names) != set(first.descriptors.names):
            differ = sorted(set(other.descriptors.names) ^ set(first.descriptors.names))
            raise SignfaceError(
                f"the takes {first.take} and {other.take} were solved with other bases ({', '.join(differ[:5])})",
                hint="train on takes of one face",
            )
    return first.descriptors.names


def train_model(
    examples: Sequence[Example],
    *,
    classifier: str = "forest",
    seed: int = 0,
    face: str = "unknown",
    layout: str = "unknown",
    corpus: str = "unknown",
    scores: Mapping[str, float] | None = None,
    rate: float = TRAINING_RATE,
    name: str = "model",
) -> TrainedModel:
    """Train a classifier on annotated takes.

    Those of `NAMES` of `signface.label.labellers` learn from the frames of the stable segments; the sequence models of
    `SEQUENCE_NAMES` from whole takes, transitions included.

    Parameters
    ----------
    examples : sequence of Example
        The training takes, and no others. Their order does not matter.
    classifier : str
        A name of one of them.
    seed : int
        Two trainings with one seed on the same takes give the same model.
    face, layout, corpus, scores : optional
        For the model's card.
    rate : float
        See `training_frames`.
    name : str
        Name of the model.

    Raises
    ------
    SignfaceError
        There is no training frame, only one label, or a take has other bases.
    """
    if not examples:
        raise SignfaceError("there is no annotated take to train on", hint="name other kinds or another signer")
    ordered = sorted(examples, key=lambda example: (example.signer, example.kind, example.take))
    bases = common_bases(ordered)
    fit = _fit_sequence if classifier in SEQUENCE_NAMES else _fit_frames
    labeller, frames = fit(ordered, bases, classifier, seed, rate)
    card = Card(
        classifier=classifier,
        bases=bases,
        labels=tuple(str(label) for label in labeller.classes_),
        face=face,
        layout=layout,
        corpus=corpus,
        kinds=tuple(sorted({example.kind for example in ordered})),
        signers=tuple(sorted({example.signer for example in ordered})),
        takes=tuple(sorted(example.take for example in ordered)),
        frames=frames,
        seed=seed,
        scores=dict(scores or {}),
        version=version("signface"),
    )
    return TrainedModel(labeller, card, name=name)


def _fit_frames(
    examples: Sequence[Example], bases: Sequence[str], classifier: str, seed: int, rate: float
) -> tuple[Any, int]:
    """A classifier trained on frames of stable segments, and how many there were."""
    labeller = make_labeller(classifier, seed=seed)
    pairs = [training_frames(example, bases, rate=rate) for example in examples]
    weights = np.concatenate([pair[0] for pair in pairs])
    labels = np.concatenate([pair[1] for pair in pairs])
    found = [label for label in AFFECTS if label in set(labels)]
    if len(found) < 2:
        raise SignfaceError(
            f"the training takes show {len(found)} expression{'s' * (len(found) != 1)}, a classifier needs two or more",
            hint="train on more takes, or look at their annotations",
        )
    rarest = min(found, key=lambda label: int((labels == label).sum()))
    if (labels == rarest).sum() < 3:
        raise SignfaceError(
            f"the training takes hold less than half a second of {AFFECTS[rarest]} ({rarest})",
            hint="train on more takes of it, or on takes without it",
        )
    return labeller.fit(weights, labels), len(labels)


def _fit_sequence(
    examples: Sequence[Example], bases: Sequence[str], classifier: str, seed: int, rate: float
) -> tuple[Any, int]:
    """A sequence model trained on whole takes, and how many frames it saw."""
    from signface.label.sequence import make_sequence_labeller

    labeller = make_sequence_labeller(classifier, seed=seed)
    labeller.fit([on_bases(e.descriptors, bases) for e in examples], [e.reference for e in examples])
    return labeller, labeller.n_frames_


def score_by_take(
    examples: Sequence[Example], *, classifier: str = "forest", seed: int = 0, folds: int = 5
) -> dict[str, float]:
    """Accuracy on takes left out of the training, among the training takes themselves.

    The takes are dealt into folds, kind by kind and signer by signer; each fold in turn is left out, and the stable
    segments of its reference are labelled by what was trained on the others. It says how well the classifier learns
    this material, not how well it does on other material or other signers: `signface evaluate` measures that.

    Parameters
    ----------
    examples : sequence of Example
    classifier, seed : optional
        See `train_model`.
    folds : int
        Number of folds, at most the number of takes.

    Returns
    -------
    dict
        One accuracy under a name that says on what; empty when there are too few takes to leave any out.
    """
    ordered = sorted(examples, key=lambda example: (example.signer, example.kind, example.take))
    folds = min(folds, len(ordered))
    right = total = 0
    for fold in range(folds):
        kept = [example for number, example in enumerate(ordered) if number % folds != fold]
        try:
            model = train_model(kept, classifier=classifier, seed=seed)
        except SignfaceError:  # what is left shows one expression only: nothing can be said
            return {}
        for example in ordered[fold::folds]:
            spans = example.stable[["start_s", "end_s"]].to_numpy(float)
            labels, _ = label_spans(example.descriptors, spans, model)
            right += int((np.array(labels) == example.stable["label"].to_numpy(object)).sum())
            total += len(labels)
    return {"accuracy on reference segments of left-out training takes": right / total} if total else {}
