"""Intensity of an expression, 1 to 3, learnt from annotations: an ordinal classification beside the label.

- `OrdinalClassifier`: ordered classes by any classifier of scikit-learn that gives probabilities.
- `IntensityClassifier`: the intensity of stable segments, from how far the face is from rest.
- `train_intensity`: one trained on annotated takes, where their intensity is annotated.
- `ordinal_metrics`: how well intensities agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, ClassifierMixin, clone

from signface.descriptors import Descriptors
from signface.label.examples import Example, common_bases
from signface.label.labelling import segment_means
from signface.label.vocabulary import AFFECTS
from signface.segment.segments import Segments

#: The intensities there are.
INTENSITIES = (1, 2, 3)

#: The labels that have an intensity.
EXPRESSED = tuple(label for label in AFFECTS if label != "N")

#: Segments that it takes to train on, in all and of each of two intensities.
LEAST_SEGMENTS = 12
LEAST_EACH = 3


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
        above = np.minimum.accumulate(above, axis=1)
        whole = np.column_stack([np.ones(len(above)), above, np.zeros(len(above))])
        return whole[:, :-1] - whole[:, 1:]

    def predict(self, X: np.ndarray) -> np.ndarray:
        """(K,) the most probable class of each row."""
        return self.classes_[self.predict_proba(X).argmax(axis=1)]


class IntensityClassifier(BaseEstimator):
    """The intensity of stable segments with a label.

    It sees how far a segment's mean descriptor lies from rest: the norm of its weights. On synthetic signers who were
    not trained on, the weights themselves do worse, and a line for each label does no better.

    Parameters
    ----------
    classifier : OrdinalClassifier
        It is cloned.

    Attributes
    ----------
    bases_ : tuple of str
    n_segments_ : int
    """

    def __init__(self, classifier: Any) -> None:
        self.classifier = classifier

    def fit(self, takes: Sequence[Descriptors], references: Sequence[Segments]) -> IntensityClassifier:
        """Learn from takes and annotations with `label` and `intensity`; segments without one are left out."""
        self.bases_ = tuple(takes[0].names)
        rows, levels = [], []
        for take, reference in zip(takes, references, strict=True):
            table = _with_intensity(reference)
            strength = self._strength(take, table)
            seen = np.isfinite(strength)
            rows.append(strength[seen, None])
            levels.append(table["intensity"].to_numpy(int)[seen])
        self.n_segments_ = sum(map(len, levels))
        self.classifier_ = clone(self.classifier).fit(np.concatenate(rows), np.concatenate(levels))
        return self

    def predict(self, take: Descriptors, spans: np.ndarray, labels: Sequence[str]) -> list[int | None]:
        """Intensity of each (S, 2) span of a take with its label; None for neutral and where nothing was seen."""
        table = pd.DataFrame({"start_s": spans[:, 0], "end_s": spans[:, 1], "label": list(labels)})
        strength = self._strength(take, table)
        judged = np.isfinite(strength) & table["label"].isin(EXPRESSED).to_numpy()
        levels: list[int | None] = [None] * len(table)
        if judged.any():
            found = self.classifier_.predict(strength[judged, None])
            for row, level in zip(np.flatnonzero(judged), found, strict=True):
                levels[row] = int(level)
        return levels

    def annotate(self, take: Descriptors, segments: Segments) -> Segments:
        """Labelled segments with a column `intensity`, missing for transitions and neutral."""
        table = segments.table.copy()
        stable = (table["kind"] == "stable").to_numpy()
        levels: list[int | None] = [None] * len(table)
        spans = table.loc[stable, ["start_s", "end_s"]].to_numpy(float)
        for row, level in zip(
            np.flatnonzero(stable), self.predict(take, spans, table.loc[stable, "label"].tolist()), strict=True
        ):
            levels[row] = level
        table["intensity"] = pd.array(levels, dtype="Int64")
        return segments.changed("intensity", table)

    def _strength(self, take: Descriptors, table: pd.DataFrame) -> np.ndarray:
        """(S,) norm of the mean weights of each segment; NaN where there are none."""
        columns = [take.names.index(name) for name in self.bases_]
        means = segment_means(take, table[["start_s", "end_s"]].to_numpy(float))
        return np.linalg.norm(means[:, columns], axis=1)


def train_intensity(examples: Sequence[Example]) -> IntensityClassifier | None:
    """A classifier of intensities trained on annotated takes.

    None where there is too little to learn from: fewer than `LEAST_SEGMENTS` segments with an intensity, or fewer than
    `LEAST_EACH` of a second intensity.
    """
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    known = [e for e in examples if len(_with_intensity(e.reference))]
    if not known:
        return None
    counts = pd.concat([_with_intensity(e.reference)["intensity"] for e in known]).value_counts()
    if counts.sum() < LEAST_SEGMENTS or len(counts) < 2 or counts.iloc[1] < LEAST_EACH:
        return None
    common_bases(known)
    steps = OrdinalClassifier(make_pipeline(StandardScaler(), LogisticRegression(max_iter=500)))
    return IntensityClassifier(steps).fit([e.descriptors for e in known], [e.reference for e in known])


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
    if not len(truth):
        return {"n": 0, "exact": None, "within_one": None, "mean_absolute_error": None, "quadratic_kappa": None}
    one, other = np.asarray(truth, int), np.asarray(found, int)
    distance = np.abs(one - other)
    chance = float(np.mean((one[:, None] - other[None, :]) ** 2))
    return {
        "n": len(one),
        "exact": float(np.mean(distance == 0)),
        "within_one": float(np.mean(distance <= 1)),
        "mean_absolute_error": float(distance.mean()),
        "quadratic_kappa": None if chance == 0 else float(1 - np.mean(distance**2) / chance),
    }


def _with_intensity(reference: Segments) -> pd.DataFrame:
    """The stable segments of a reference that have an intensity."""
    table = reference.table
    if "intensity" not in table or "label" not in table:
        return pd.DataFrame(columns=["start_s", "end_s", "label", "intensity"])
    kept = (table["kind"] == "stable") & table["intensity"].notna() & table["label"].isin(EXPRESSED)
    return table.loc[kept, ["start_s", "end_s", "label", "intensity"]]
