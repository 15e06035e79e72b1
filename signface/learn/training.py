"""Training a classifier on annotated takes (thesis 4.4.3).

- `train_model`: a trained `TrainedModel`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from typing import Any

import numpy as np

from signface.errors import SignfaceError
from signface.label.calibration import fit_calibration
from signface.label.labellers import SEQUENCE_NAMES, make_labeller
from signface.label.model import AGGREGATES, Card, TrainedModel
from signface.label.variants import DescriptorVariant
from signface.label.vocabulary import AFFECTS
from signface.learn.examples import TRAINING_RATE, Example, common_bases, frame_table, signer_levels
from signface.learn.folds import inner_folds
from signface.learn.intensity import train_intensity
from signface.learn.tuning import balanced_accuracy, judge_left_out, search_parameters


def train_model(
    examples: Sequence[Example],
    *,
    classifier: str = "forest",
    seed: int = 0,
    features: Sequence[str] = ("weights",),
    normalise: str = "none",
    aggregate: str = "mean",
    balanced: bool = False,
    parameters: Mapping[str, Any] | None = None,
    search: bool = False,
    calibrate: bool = False,
    folds: int = 5,
    face: str = "unknown",
    layout: str = "unknown",
    corpus: str = "unknown",
    scores: Mapping[str, float] | None = None,
    rate: float = TRAINING_RATE,
    name: str = "model",
) -> TrainedModel:
    """Train a classifier on annotated takes.

    Those of `NAMES` of `signface.label.labellers` learn from the frames of the stable segments; the sequence models of
    `SEQUENCE_NAMES` from whole takes, transitions included. Where the takes are annotated with intensities, those are
    learnt beside the labels (`signface.label.intensity`).

    Parameters
    ----------
    examples : sequence of Example
        The training takes, and no others. Their order does not matter.
    classifier : str
        A name of one of them.
    seed : int
        Two trainings with one seed on the same takes give the same model.
    features, normalise : optional
        Descriptor variant (`signface.label.variants`). Sequence models make their own features of the weights.
    aggregate : str
        How a segment gets its label: a name of `signface.label.model.AGGREGATES`.
    balanced : bool
        Let every label weigh the same. Sequence models weigh rare frames by themselves.
    parameters : mapping, optional
        Parameters of the classifier to set.
    search : bool
        Look for the best parameters among those of `signface.learn.tuning.GRIDS`, by takes (with several signers, by
        signers) left out of the training takes.
    calibrate : bool
        Make confidences mean the share of right labels, as found on takes left out of the training takes in the same
        way; kept where that helps on takes that the calibration itself has not seen. The card then also says how many
        labels of left-out takes were right. This trains `folds` times more.
    folds : int
        Number of folds of both, at most the number of takes (of signers, where there are several).
    face, layout, corpus, scores : optional
        For the model's card.
    rate : float
        See `signface.learn.examples.training_frames`.
    name : str
        Name of the model.

    Raises
    ------
    SignfaceError
        There is no training frame, only one label, a take has other bases, or an option is unknown.
    """
    if not examples:
        raise SignfaceError("there is no annotated take to train on", hint="name other kinds or another signer")
    if aggregate not in AGGREGATES:
        raise SignfaceError(f"there is no way to aggregate named {aggregate}", hint=f"choose {' or '.join(AGGREGATES)}")
    variant = DescriptorVariant(tuple(features), normalise).check()
    if classifier in SEQUENCE_NAMES and variant.features != ("weights",):
        raise SignfaceError(
            f"{classifier} makes its own features of the weights", hint="leave out the features, or normalise signers"
        )
    ordered = sorted(examples, key=lambda example: (example.signer, example.kind, example.take))
    blank = Card(
        classifier=classifier,
        bases=common_bases(ordered),
        labels=(),
        face=face,
        layout=layout,
        corpus=corpus,
        seed=seed,
        scores=dict(scores or {}),
        features=tuple(features),
        normalise=normalise,
        aggregate=aggregate,
        balanced=balanced,
        version=version("signface"),
    )

    def fit(takes: Sequence[Example], chosen: Mapping[str, Any]) -> TrainedModel:
        return _fit(takes, replace(blank, parameters=dict(chosen)), rate=rate, name=name)

    chosen = dict(parameters or {})
    if search:
        found, _ = search_parameters(ordered, classifier, fit, folds=folds)
        chosen |= found
    model = fit(ordered, chosen)
    if calibrate:
        model = _calibrated(model, ordered, fit, folds)
    return replace(model, intensity=train_intensity(ordered))


def _fit(examples: Sequence[Example], card: Card, *, rate: float, name: str) -> TrainedModel:
    """A model with its labels, uncalibrated, and what the card says of the takes."""
    fit = _fit_sequence if card.classifier in SEQUENCE_NAMES else _fit_frames
    labeller, frames = fit(examples, card, rate)
    card = replace(
        card,
        labels=tuple(str(label) for label in labeller.classes_),
        kinds=tuple(sorted({example.kind for example in examples})),
        signers=tuple(sorted({example.signer for example in examples})),
        takes=tuple(sorted(example.take for example in examples)),
        frames=frames,
    )
    return TrainedModel(labeller, card, name=name)


def _calibrated(model: TrainedModel, examples: Sequence[Example], fit: Any, folds: int) -> TrainedModel:
    """The model with its calibration and its scores on left-out takes, where there are enough to leave any out."""
    try:
        pairs = inner_folds(examples, folds=folds)
        table = judge_left_out(pairs, fit, model.card.parameters) if pairs else None
    except SignfaceError:  # what is left shows one expression only: nothing can be said
        table = None
    if table is None:
        return model
    hits = (table["truth"] == table["found"]).to_numpy()
    what = "signers" if len(model.card.signers) > 1 else "takes"
    card = replace(
        model.card,
        calibration=fit_calibration(table["confidence"].to_numpy(float), hits, table["group"].tolist()),
        scores={
            **model.card.scores,
            f"accuracy on reference segments of left-out training {what}": float(hits.mean()),
            f"balanced accuracy on reference segments of left-out training {what}": balanced_accuracy(table),
        },
    )
    return replace(model, card=card)


def _fit_frames(examples: Sequence[Example], card: Card, rate: float) -> tuple[Any, int]:
    """A classifier trained on frames of stable segments, and how many there were."""
    labeller = make_labeller(card.classifier, seed=card.seed, balanced=card.balanced, parameters=card.parameters)
    frames, labels, *_ = frame_table(examples, features=card.features, normalise=card.normalise, rate=rate)
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
    if card.balanced and card.classifier.startswith("knn"):
        kept = _equally_many(labels)
        frames, labels = frames[kept], labels[kept]
    return labeller.fit(frames, labels), len(labels)


def _equally_many(labels: np.ndarray) -> np.ndarray:
    """Rows, evenly spaced among those of each label, as many of each as of the rarest."""
    rows = [np.flatnonzero(labels == label) for label in np.unique(labels)]
    count = min(map(len, rows))
    return np.sort(np.concatenate([own[((np.arange(count) + 0.5) * len(own) / count).astype(int)] for own in rows]))


def _fit_sequence(examples: Sequence[Example], card: Card, rate: float) -> tuple[Any, int]:
    """A sequence model trained on whole takes, and how many frames it saw."""
    from signface.sequence.hsmm import make_sequence_labeller

    labeller = make_sequence_labeller(card.classifier, seed=card.seed)
    unknown = sorted(set(card.parameters) - set(labeller.get_params()))
    if unknown:
        raise SignfaceError(
            f"{card.classifier} has no parameter named {unknown[0]}", hint=f"it has {', '.join(labeller.get_params())}"
        )
    labeller.set_params(**card.parameters)
    levels = signer_levels(examples) if card.normalise == "signer" else {}
    variant = DescriptorVariant(normalise=card.normalise)
    takes = [variant.of(e.descriptors.on(card.bases), levels.get(e.signer)) for e in examples]
    labeller.fit(takes, [e.reference for e in examples])
    return labeller, labeller.n_frames_
