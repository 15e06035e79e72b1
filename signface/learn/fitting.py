"""Fitting a classifier to annotated takes, with settings as they are.

- `fit_model`: a `TrainedModel`, nothing searched or calibrated (`signface.learn.training` does that around it).
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from signface.errors import SignfaceError
from signface.label.labellers import SEQUENCE_NAMES, make_labeller
from signface.label.model import Card, TrainedModel
from signface.label.variants import DescriptorVariant
from signface.learn.examples import Example, common_bases, common_vocabulary, frame_table, signer_levels
from signface.settings.training import TrainingSettings


def fit_model(examples: Sequence[Example], settings: TrainingSettings, *, name: str = "model") -> TrainedModel:
    """A classifier fitted to annotated takes, and a card that says what of.

    Parameters
    ----------
    examples : sequence of Example
        At least one; their order matters to the last bit.
    settings : TrainingSettings
        `search` and `calibrate` do nothing here.
    name : str

    Raises
    ------
    SignfaceError
        There is no training frame, only one label, a take has other bases, or the classifier has no such parameter.
    """
    bases, vocabulary = common_bases(examples), common_vocabulary(examples)
    fit = _fit_sequence if settings.classifier in SEQUENCE_NAMES else _fit_frames
    labeller, frames = fit(examples, settings, bases)
    card = Card(
        classifier=settings.classifier,
        bases=bases,
        labels=tuple(str(label) for label in labeller.classes_),
        kinds=tuple(sorted({example.kind for example in examples})),
        signers=tuple(sorted({example.signer for example in examples})),
        takes=tuple(sorted(example.take for example in examples)),
        frames=frames,
        seed=settings.seed,
        features=settings.features,
        normalise=settings.normalise,
        aggregate=settings.aggregate,
        balanced=settings.balanced,
        parameters=dict(settings.parameters),
        version=version("signface"),
        training=settings.as_dict(),
        vocabulary=vocabulary,
        tier=examples[0].tier,
    )
    return TrainedModel(labeller, card, name=name)


def _fit_frames(examples: Sequence[Example], settings: TrainingSettings, bases: tuple[str, ...]) -> tuple[Any, int]:
    """A classifier trained on frames of stable segments, and how many there were."""
    labeller = make_labeller(
        settings.classifier, seed=settings.seed, balanced=settings.balanced, parameters=settings.parameters
    )
    frames, labels, *_ = frame_table(
        examples,
        features=settings.features,
        normalise=settings.normalise,
        rate=settings.rate,
        courses=settings.aggregate == "course",
    )
    vocabulary = examples[0].vocabulary
    taught = [label for label in vocabulary.values if label in set(labels)]
    if len(taught) < 2:
        raise SignfaceError(
            f"the training takes show {len(taught)} label{'s' * (len(taught) != 1)}, a classifier needs two or more",
            hint="train on more takes, or look at their annotations",
        )
    rarest = min(taught, key=lambda label: int((labels == label).sum()))
    if (labels == rarest).sum() < 3:
        raise SignfaceError(
            f"the training takes hold too little of {vocabulary.spelt(rarest)}: fewer than three segments"
            if settings.aggregate == "course"
            else f"the training takes hold less than half a second of {vocabulary.spelt(rarest)}",
            hint="train on more takes of it, or on takes without it",
        )
    if settings.balanced and settings.classifier.startswith("knn"):
        kept = _equally_many(labels)
        frames, labels = frames[kept], labels[kept]
    return labeller.fit(frames, labels), len(labels)


def _equally_many(labels: np.ndarray) -> np.ndarray:
    """Rows, evenly spaced among those of each label, as many of each as of the rarest."""
    rows = [np.flatnonzero(labels == label) for label in np.unique(labels)]
    count = min(map(len, rows))
    return np.sort(
        np.concatenate([of_one[((np.arange(count) + 0.5) * len(of_one) / count).astype(int)] for of_one in rows])
    )


def _fit_sequence(examples: Sequence[Example], settings: TrainingSettings, bases: tuple[str, ...]) -> tuple[Any, int]:
    """A sequence model trained on whole takes, and how many frames it saw."""
    from signface.sequence.hsmm import make_sequence_labeller

    labeller = make_sequence_labeller(settings.classifier, seed=settings.seed)
    unknown = sorted(set(settings.parameters) - set(labeller.get_params()))
    if unknown:
        raise SignfaceError(
            f"{settings.classifier} has no parameter named {unknown[0]}",
            hint=f"it has {', '.join(labeller.get_params())}",
        )
    if settings.balanced and "balance" in labeller.get_params():
        labeller.set_params(balance=1.0)
    labeller.set_params(**settings.parameters)
    variant = DescriptorVariant(settings.features, settings.normalise)
    levels = signer_levels(examples) if variant.by_signer else {}
    takes = [variant.of(e.descriptors.on(bases), levels.get(e.signer)) for e in examples]
    labeller.fit(takes, [e.reference if labeller.abrupt else e.moving for e in examples])
    return labeller, labeller.n_frames_
