"""The classifiers of the thesis (4.4.3) as scikit-learn estimators, and the names of all there are.

- `make_labeller`: a new, untrained one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from signface.errors import SignfaceError
from signface.settings.choices import NAMES, SEQUENCE_NAMES

if TYPE_CHECKING:
    from sklearn.base import BaseEstimator


def make_labeller(
    name: str, *, seed: int = 0, balanced: bool = False, parameters: Mapping[str, Any] | None = None
) -> BaseEstimator:
    """A new estimator with `fit`, `predict` and `predict_proba`, which scikit-learn can clone and search over.

    - `knn1`, `knn3`: Euclidean distance between the weights.
    - `svm-linear`, `svm-rbf`: C = 1. Their probabilities are Platt's, fitted on three folds of consecutive training
      frames (neighbouring frames are nearly equal, so that shuffled folds would tell the machine about its own test
      frames).
    - `forest`: 150 trees of at most 12 levels, with at least 3 frames in a leaf, which keeps a saved model small.

    All take the weights as they are. They have one unit (0 at rest, 1 fully active), and a base that hardly moves in
    the training takes must not weigh as much as one that moves much: scaled to unit variance, its noise would drown
    the rest as soon as somebody else signs.

    Parameters
    ----------
    name : str
        One of `NAMES`.
    seed : int
        Seed of the forest; the others draw nothing.
    balanced : bool
        Let every label weigh the same, however often it occurs. Nearest neighbours have no weights:
        `signface.learn.training` gives them equally many frames of each.
    parameters : mapping, optional
        Parameters of the classifier (of the machine itself, for those with calibrated probabilities) to set.

    Raises
    ------
    SignfaceError
        There is no classifier of that name, or it has no such parameter.

    See Also
    --------
    signface.frame_table : what it is fitted to.

    Examples
    --------
    >>> import signface as sf
    >>> X, y, _, _ = sf.frame_table(sf.datasets.mini_examples())
    >>> sf.make_labeller("knn3").fit(X, y).predict(X[:1]).tolist()
    ['N']
    """
    weight = "balanced" if balanced else None
    estimator: Any
    if name in ("knn1", "knn3"):
        from sklearn.neighbors import KNeighborsClassifier

        estimator = KNeighborsClassifier(n_neighbors=int(name[-1]), algorithm="brute")
    elif name in ("svm-linear", "svm-rbf"):
        from sklearn.svm import SVC

        estimator = SVC(kernel=name.removeprefix("svm-"), C=1.0, class_weight=weight)
    elif name == "forest":
        from sklearn.ensemble import RandomForestClassifier

        estimator = RandomForestClassifier(
            n_estimators=150, max_depth=12, min_samples_leaf=3, class_weight=weight, random_state=seed
        )
    elif name == "extra-trees":
        from sklearn.ensemble import ExtraTreesClassifier

        estimator = ExtraTreesClassifier(n_estimators=500, class_weight=weight, random_state=seed)
    else:
        raise SignfaceError(
            f"there is no classifier named {name}", hint=f"choose one of {', '.join(NAMES | SEQUENCE_NAMES)}"
        )
    unknown = sorted(set(parameters or {}) - set(estimator.get_params()))
    if unknown:
        raise SignfaceError(
            f"{name} has no parameter named {unknown[0]}", hint=f"it has {', '.join(estimator.get_params())}"
        )
    estimator.set_params(**(parameters or {}))
    if not name.startswith("svm-"):
        return estimator
    from sklearn.calibration import CalibratedClassifierCV
    from sklearn.model_selection import StratifiedKFold

    return CalibratedClassifierCV(estimator, ensemble=False, cv=StratifiedKFold(3, shuffle=False))
