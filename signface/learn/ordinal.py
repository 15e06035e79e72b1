"""Classes in an order: learning them, and how well they agree.

- `OrdinalClassifier`: ordered classes by any classifier of scikit-learn that gives probabilities.
- `between_steps`: probabilities of classes from those of lying above each step between them.
- `ordinal_metrics`: how well ordered values agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from sklearn.base import BaseEstimator, ClassifierMixin, clone

from signface.label.intensity import between_steps


class OrdinalClassifier(ClassifierMixin, BaseEstimator):
    """Ordered classes, by one classifier for each step between them (Frank and Hall 2001).

    Each learns whether an item lies above its step. The probability of a class is the difference of two neighbours,
    after their order has been restored where they cross. (mord, the package for this, has had no release since 2023.)

    Parameters
    ----------
    estimator : classifier of scikit-learn
        With `predict_proba`; it is cloned.

    Attributes
    ----------
    classes_ : (C,) array
        Ascending.
    steps_ : list of C - 1 estimators
    """

    def __init__(self, estimator: Any) -> None:
        self.estimator = estimator

    def fit(self, X: np.ndarray, y: np.ndarray) -> OrdinalClassifier:
        """Learn from (K, D) rows and (K,) values that can be ordered; there must be two or more."""
        self.classes_ = np.unique(y)
        if len(self.classes_) < 2:
            raise ValueError("ordered classes need two or more")
        self.n_features_in_ = np.shape(X)[1]
        self.steps_ = [clone(self.estimator).fit(X, y > below) for below in self.classes_[:-1]]
        return self

    def predict_proba(self, X: np.ndarray) -> np.ndarray:
        """(K, C) probability of each of `classes_`."""
        above = np.column_stack([step.predict_proba(X)[:, 1] for step in self.steps_])
        return between_steps(above)

    def predict(self, X: np.ndarray) -> np.ndarray:
        """(K,) the most probable class of each row."""
        return self.classes_[self.predict_proba(X).argmax(axis=1)]


def ordinal_metrics(truth: Sequence[int], found: Sequence[int]) -> dict:
    """How well ordered values agree.

    Returns
    -------
    dict
        `n`, and None where there is nothing: `exact` and `within_one`, shares of items; `mean_absolute_error`, steps;
        `quadratic_kappa`, Cohen's kappa with quadratic weights (Cohen 1968), also None where it is undefined.

    Examples
    --------
    >>> scores = ordinal_metrics([1, 2, 3, 3], [1, 2, 2, 1])
    >>> scores["exact"], scores["within_one"], scores["mean_absolute_error"]
    (0.5, 0.75, 0.75)
    """
    from sklearn.metrics import cohen_kappa_score

    if not len(truth):
        return {"n": 0, "exact": None, "within_one": None, "mean_absolute_error": None, "quadratic_kappa": None}
    one, other = np.asarray(truth, int), np.asarray(found, int)
    distance = np.abs(one - other)
    steps = range(min(one.min(), other.min()), max(one.max(), other.max()) + 1)
    return {
        "n": len(one),
        "exact": float(np.mean(distance == 0)),
        "within_one": float(np.mean(distance <= 1)),
        "mean_absolute_error": float(distance.mean()),
        "quadratic_kappa": float(cohen_kappa_score(one, other, weights="quadratic", labels=list(steps)))
        if len(steps) > 1
        else None,
    }
