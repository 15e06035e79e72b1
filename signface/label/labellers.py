"""The classifiers of the thesis (4.4.3) as scikit-learn estimators, and the names of all there are.

- `NAMES`: those of the thesis; `SEQUENCE_NAMES`: the models that know time (`signface.label.sequence`).
- `make_labeller`: a new, untrained one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from signface.errors import SignfaceError

if TYPE_CHECKING:
    from sklearn.base import BaseEstimator

#: name: what it is.
NAMES = {
    "knn1": "the nearest training frame",
    "knn3": "the three nearest training frames",
    "svm-linear": "support vector machine, linear kernel",
    "svm-rbf": "support vector machine, Gaussian kernel",
    "forest": "random forest",
}

#: Sequence models, which find borders and labels at once. name: what it is.
SEQUENCE_NAMES = {
    "net-hsmm": "neural network on frames, decoded by a hidden semi-Markov model",
    "forest-viterbi": "random forest on frames, decoded by Viterbi's algorithm through a transition state",
    "hmm": "hidden Markov model with Gaussian frames",
}


def make_labeller(name: str, *, seed: int = 0) -> BaseEstimator:
    """A new estimator with `fit`, `predict` and `predict_proba`, which scikit-learn can clone and search over.

    - `knn1`, `knn3`: Euclidean distance between the weights as they are: a base that hardly moves in the corpus
      should not weigh as much as one that moves much.
    - `svm-linear`, `svm-rbf`: C = 1 on weights scaled to unit variance. Their probabilities are Platt's, fitted on
      three folds of consecutive training frames (neighbouring frames are nearly equal, so that shuffled folds would
      tell the machine about its own test frames).
    - `forest`: 150 trees of at most 12 levels, with at least 3 frames in a leaf, which keeps a saved model small.

    Parameters
    ----------
    name : str
        One of `NAMES`.
    seed : int
        Seed of the forest; the others draw nothing.

    Raises
    ------
    SignfaceError
        There is no classifier of that name.
    """
    if name in ("knn1", "knn3"):
        from sklearn.neighbors import KNeighborsClassifier

        return KNeighborsClassifier(n_neighbors=int(name[-1]), algorithm="brute")
    if name in ("svm-linear", "svm-rbf"):
        from sklearn.calibration import CalibratedClassifierCV
        from sklearn.model_selection import StratifiedKFold
        from sklearn.pipeline import make_pipeline
        from sklearn.preprocessing import StandardScaler
        from sklearn.svm import SVC

        machine = SVC(kernel=name.removeprefix("svm-"), C=1.0)
        return make_pipeline(
            StandardScaler(), CalibratedClassifierCV(machine, ensemble=False, cv=StratifiedKFold(3, shuffle=False))
        )
    if name == "forest":
        from sklearn.ensemble import RandomForestClassifier

        return RandomForestClassifier(n_estimators=150, max_depth=12, min_samples_leaf=3, random_state=seed)
    raise SignfaceError(
        f"there is no classifier named {name}", hint=f"choose one of {', '.join(NAMES | SEQUENCE_NAMES)}"
    )
