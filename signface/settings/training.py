"""How a classifier is trained, as one object that every door knows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from signface.errors import SignfaceError
from signface.settings.base import Settings, option
from signface.settings.choices import AGGREGATES, FEATURES, NAMES, NORMALISATIONS, SEQUENCE_NAMES


@dataclass(frozen=True)
class TrainingSettings(Settings):
    """What is trained, on what of the takes, and how (thesis 4.4.3); validated when it is made.

    The fields say in their metadata what they decide.

    Raises
    ------
    SignfaceError
        A value is not of its kind, there is no such classifier or feature, or a sequence model is given features:
        it makes its own of the weights.

    See Also
    --------
    signface.learn.training.train : which is told of it.

    Examples
    --------
    >>> import signface as sf
    >>> sf.TrainingSettings(classifier="knn3", normalise="signer").chosen
    {'classifier': 'knn3', 'normalise': 'signer'}
    """

    TABLE = "train"

    classifier: str = option("forest", help="what to train", choices=(*NAMES, *SEQUENCE_NAMES))
    features: tuple[str, ...] = option(
        ("weights",),
        help="what classifiers see: weights, head, and for those of segments derivatives, windows, or several of them",
        kind=tuple,
        metavar="NAMES",
    )
    normalise: str = option(
        "none",
        help="signer: weights less the signer's mean, over their spread, from all takes of the signer at hand; range: "
        "less the low end of the signer's range, over half of it; middle: less the median, over the middle two thirds",
        choices=tuple(NORMALISATIONS),
    )
    aggregate: str = option(
        "mean",
        help="label a segment by its mean descriptor (as in the thesis), by all of its frames, or by its course",
        choices=tuple(AGGREGATES),
    )
    balanced: bool = option(False, help="let every label weigh the same in training", kind=bool)
    search: bool = option(False, help="look for the best parameters, by folds of the training takes", kind=bool)
    calibrate: bool = option(
        True, help="train on parts of the takes too, to score the rest and to calibrate confidences", kind=bool
    )
    folds: int = option(5, help="how many parts, at most as many as there are takes or signers", kind=int)
    rate: float = option(10.0, help="frames of a second of stable segment that are trained on", kind=float)
    parameters: Mapping[str, Any] = option(
        help="parameters of the classifier to set: NAME=VALUE,...",
        kind=Mapping,
        metavar="NAME=VALUE,...",
        default_factory=dict,
    )
    seed: int = option(0, help="two trainings with one seed give the same model", kind=int)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.folds < 2 or not 0 < self.rate < float("inf"):
            raise SignfaceError(f"folds are two or more, and the rate is positive: {self.folds}, {self.rate:g}")
        unknown = [name for name in self.features if name not in FEATURES]
        if unknown or not self.features:
            problem = f"there are no features named {unknown[0]}" if unknown else "no features are named"
            raise SignfaceError(problem, hint=f"choose among {', '.join(FEATURES)}")
        if len(set(self.features)) < len(self.features):
            raise SignfaceError(f"features are named twice: {', '.join(self.features)}")
        if self.aggregate == "course" and self.search:
            raise SignfaceError("parameters are searched on frames, and courses are of whole segments", hint="set them")
        if self.classifier in SEQUENCE_NAMES and not set(self.features) <= {"weights", "head"}:
            raise SignfaceError(
                f"{self.classifier} makes its own features of the weights",
                hint="its features are weights, or weights,head",
            )

    def for_classifier(self, name: str) -> TrainingSettings:
        """The settings for another classifier; a sequence model makes its own features.

        Examples
        --------
        >>> import signface as sf
        >>> sf.TrainingSettings(features=("windows",)).for_classifier("hmm").features
        ('weights',)
        """
        features = self.features
        if name in SEQUENCE_NAMES:
            features = tuple(feature for feature in features if feature in ("weights", "head")) or ("weights",)
        return self.changed(classifier=name, features=features)
