"""`TrainedModel`: a trained classifier together with what it was trained on."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from signface.content import Summary
from signface.descriptors import Descriptors
from signface.errors import SignfaceError, SignfaceWarning
from signface.label.calibration import calibrated
from signface.label.variants import DescriptorVariant
from signface.label.vocabulary import AFFECT, Vocabulary
from signface.settings.choices import BY_SIGNER, SEQUENCE_NAMES
from signface.signer_level import SignerLevel

if TYPE_CHECKING:
    from sklearn.base import ClassifierMixin

    from signface.label.intensity import IntensityClassifier


@dataclass(frozen=True)
class Card:
    """What a model is and where it comes from; it can be read without loading the estimator.

    Parameters
    ----------
    classifier : str
        A name of `signface.label.labellers`.
    bases : tuple of str
        Names of the bases whose weights it was trained on, in their order.
    labels : tuple of str
        The labels it can give.
    face, layout, corpus : str
        Names of the face, the marker layout(s) and the corpus of the training takes.
    kinds, signers, takes : tuple of str
        What of the corpus it was trained on.
    frames : int
        Number of training frames, after thinning.
    seed : int
        Seed of the training.
    scores : mapping of str to float
        Measured accuracies, each under a name that says on what.
    features, normalise :
        Descriptor variant that it sees (`signface.label.variants.DescriptorVariant`).
    aggregate : str
        How a segment gets its label: a name of `signface.settings.choices.AGGREGATES`.
    balanced : bool
        Whether every label weighed the same in training.
    parameters : mapping
        What of the classifier differs from `signface.label.labellers.make_labeller`: what a search chose.
    calibration : mapping of str to float
        `slope` and `offset` of the confidence (`signface.label.calibration`), and how it was measured; empty when it
        is not calibrated.
    version : str
        Version of signface that trained it.
    familiarity : mapping
        What tells whether a take is like the training (`signface.label.familiarity`); empty where nothing does.
    vocabulary : Vocabulary
        What the labels stand for, and which of them there could be.
    tier : str
        The tier that it was trained on.
    training, solve : mapping
        Settings it was trained with, and its takes were solved with, as plain values
        (`signface.settings.training.TrainingSettings`, `signface.settings.solve.SolveSettings`); empty in the cards of
        old versions.
    """

    classifier: str
    bases: tuple[str, ...]
    labels: tuple[str, ...]
    face: str = "unknown"
    layout: str = "unknown"
    corpus: str = "unknown"
    kinds: tuple[str, ...] = ()
    signers: tuple[str, ...] = ()
    takes: tuple[str, ...] = ()
    frames: int = 0
    seed: int = 0
    scores: Mapping[str, float] = field(default_factory=dict)
    features: tuple[str, ...] = ("weights",)
    normalise: str = "none"
    aggregate: str = "mean"
    balanced: bool = False
    parameters: Mapping[str, Any] = field(default_factory=dict)
    calibration: Mapping[str, float] = field(default_factory=dict)
    version: str = ""
    training: Mapping[str, Any] = field(default_factory=dict)
    solve: Mapping[str, Any] = field(default_factory=dict)
    vocabulary: Vocabulary = AFFECT
    tier: str = "affect"
    familiarity: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


@dataclass(frozen=True, repr=False)
class TrainedModel(Summary):
    """A trained classifier and its card.

    Parameters
    ----------
    estimator : classifier of scikit-learn, or SequenceLabeller
    card : Card
    name : str
    intensity : IntensityClassifier, optional
        What gives stable segments their intensity, where it was trained.

    See Also
    --------
    signface.load_model, signface.train : where models come from.

    Examples
    --------
    >>> import signface as sf
    >>> model = sf.load_model()
    >>> model.name, model.card.corpus
    ('default', 'synthetic (signface synth)')
    """

    estimator: ClassifierMixin
    card: Card
    name: str = "model"
    intensity: IntensityClassifier | None = None

    def _sizes(self) -> str:
        return f"{self.card.classifier} of {len(self.card.bases)} bases, for {self.card.tier}"

    @property
    def sequential(self) -> bool:
        """Whether it is a sequence model, which finds segments and labels at once."""
        return self.card.classifier in SEQUENCE_NAMES

    def columns(self, descriptors: Descriptors) -> np.ndarray:
        """(bases,) which columns of the weights are the model's bases, in the model's order.

        Bases that the model does not know are left out.

        Raises
        ------
        SignfaceError
            The take lacks some of the model's bases; the message names what differs.
        """
        place = {name: column for column, name in enumerate(descriptors.names)}
        missing = [name for name in self.card.bases if name not in place]
        if missing:
            extra = [name for name in descriptors.names if name not in self.card.bases]
            also = f", and has {_few(extra)} instead" if extra else ""
            raise SignfaceError(
                f"{self.name}: the classifier was trained on other bases than {descriptors.name} has: "
                f"the take lacks {_few(missing)}{also}",
                hint=f"solve the take with the face it was trained on ({self.card.face}), or train a classifier "
                "on this face: signface train",
            )
        return np.array([place[name] for name in self.card.bases], dtype=int)

    def seen(self, descriptors: Descriptors, level: SignerLevel | None = None) -> Descriptors:
        """The columns that the classifier sees of a take: its bases, in the variant it was trained on.

        Parameters
        ----------
        descriptors : Descriptors
        level : SignerLevel, optional
            What a model that normalises signers normalises by; the level of this take alone when not given.

        Raises
        ------
        SignfaceError
            As `columns`.
        """
        self.columns(descriptors)
        normalises = self.card.normalise in BY_SIGNER
        if level is not None and not set(self.card.bases) <= set(level.names):
            level = None  # of other columns: weights do not say how measures lie
        if normalises and level is None:
            warnings.warn(
                f"{self.name} normalises signers, and of this signer only {descriptors.name} is known: "
                "name what signface corpus signers learnt of all takes (--signer-file)",
                SignfaceWarning,
                stacklevel=2,
            )
        others = {f"{self.name} was trained on takes": self.card.solve}
        if normalises and level is not None:
            others["the signer's level is of takes"] = level.solve
        for what, solve in others.items():
            differences = [] if descriptors.settings is None or not solve else descriptors.settings.differences(solve)
            if differences:
                said = f"{what} solved otherwise than {descriptors.name}: {', '.join(differences)}"
                warnings.warn(said, SignfaceWarning, stacklevel=2)
        take = descriptors.on(self.card.bases)
        variant = DescriptorVariant(self.card.features, self.card.normalise)
        return take if variant.plain else variant.of(take, level)

    def confidence(self, raw: np.ndarray) -> np.ndarray:
        """The chance of labels to be right, from the mean probabilities that the classifier gives them."""
        return calibrated(np.asarray(raw, dtype=float), self.card.calibration)

    def probabilities(self, weights: np.ndarray) -> np.ndarray:
        """(K, labels) probability of each of `card.labels` for (K, columns) frames of `seen`, without NaN.

        A sequence model judges no frame alone: see `SequenceLabeller.frame_probabilities`.
        """
        if len(weights) == 0:
            return np.zeros((0, len(self.card.labels)))
        return self.estimator.predict_proba(weights)


def _few(names: list[str], most: int = 5) -> str:
    """`a, b, c` or `a, b, c, d, e and 7 more`."""
    listed = ", ".join(names[:most])
    return listed if len(names) <= most else f"{listed} and {len(names) - most} more"
