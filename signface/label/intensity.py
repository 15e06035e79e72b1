"""Intensity of an expression, 1 to 3, learnt from annotations: an ordinal classification beside the label.

- `IntensityClassifier`: the intensity of stable segments, from how far the face is from rest.
- `train_intensity`: one trained on annotated takes, where their intensity is annotated.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from signface.descriptors import Descriptors
from signface.label.examples import Example, common_bases
from signface.label.labelling import segment_means
from signface.label.vocabulary import AFFECTS
from signface.segment.segments import Segments

if TYPE_CHECKING:
    from sklearn.linear_model import LogisticRegression
    from sklearn.preprocessing import StandardScaler

#: The intensities there are.
INTENSITIES = (1, 2, 3)

#: The labels that have an intensity.
EXPRESSED = tuple(label for label in AFFECTS if label != "N")

#: Segments that it takes to train on, in all and of each of two intensities.
LEAST_SEGMENTS = 12
LEAST_EACH = 3


class IntensityClassifier:
    """The intensity of stable segments with a label.

    It sees how far a segment's mean descriptor lies from rest: the norm of its weights. On synthetic signers who were
    not trained on, the weights themselves do worse, and a line for each label does no better.

    Attributes
    ----------
    bases_ : tuple of str
    levels_ : (C,) int array
        The intensities that it gives, ascending.
    lines_ : (C - 1, 2) array
        Slope over the strength, and offset, of the log odds of lying above each level but the last. Plain numbers, so
        that a saved model is read without scikit-learn.
    n_segments_ : int
    """

    def fit(self, takes: Sequence[Descriptors], references: Sequence[Segments]) -> IntensityClassifier:
        """Learn from takes and annotations with `label` and `intensity`; segments without one are left out."""
        from sklearn.linear_model import LogisticRegression
        from sklearn.pipeline import make_pipeline
        from sklearn.preprocessing import StandardScaler

        from signface.label.ordinal import OrdinalClassifier

        self.bases_ = tuple(takes[0].names)
        rows, levels = [], []
        for take, reference in zip(takes, references, strict=True):
            table = _with_intensity(reference)
            strength = self._strength(take, table)
            seen = np.isfinite(strength)
            rows.append(strength[seen, None])
            levels.append(table["intensity"].to_numpy(int)[seen])
        self.n_segments_ = sum(map(len, levels))
        steps = OrdinalClassifier(make_pipeline(StandardScaler(), LogisticRegression(max_iter=500)))
        steps.fit(np.concatenate(rows), np.concatenate(levels))
        self.levels_ = steps.classes_
        self.lines_ = np.array([_line(*step) for step in steps.steps_])
        return self

    def predict(self, take: Descriptors, spans: np.ndarray, labels: Sequence[str]) -> list[int | None]:
        """Intensity of each (S, 2) span of a take with its label; None for neutral and where nothing was seen."""
        table = pd.DataFrame({"start_s": spans[:, 0], "end_s": spans[:, 1], "label": list(labels)})
        strength = self._strength(take, table)
        judged = np.isfinite(strength) & table["label"].isin(EXPRESSED).to_numpy()
        levels: list[int | None] = [None] * len(table)
        if judged.any():
            odds = strength[judged, None] * self.lines_[:, 0] + self.lines_[:, 1]
            found = self.levels_[between_steps(1.0 / (1.0 + np.exp(-odds))).argmax(axis=1)]
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
    known = [e for e in examples if len(_with_intensity(e.reference))]
    if not known:
        return None
    counts = pd.concat([_with_intensity(e.reference)["intensity"] for e in known]).value_counts()
    if counts.sum() < LEAST_SEGMENTS or len(counts) < 2 or counts.iloc[1] < LEAST_EACH:
        return None
    common_bases(known)
    return IntensityClassifier().fit([e.descriptors for e in known], [e.reference for e in known])


def _with_intensity(reference: Segments) -> pd.DataFrame:
    """The stable segments of a reference that have an intensity."""
    table = reference.table
    if "intensity" not in table or "label" not in table:
        return pd.DataFrame(columns=["start_s", "end_s", "label", "intensity"])
    kept = (table["kind"] == "stable") & table["intensity"].notna() & table["label"].isin(EXPRESSED)
    return table.loc[kept, ["start_s", "end_s", "label", "intensity"]]


def between_steps(above: np.ndarray) -> np.ndarray:
    """(K, C) probabilities of ordered classes from the (K, C - 1) ones of lying above each but the last.

    Where those of two neighbours cross, the lower one holds.
    """
    above = np.minimum.accumulate(above, axis=1)
    whole = np.column_stack([np.ones(len(above)), above, np.zeros(len(above))])
    return whole[:, :-1] - whole[:, 1:]


def _line(scaler: StandardScaler, logistic: LogisticRegression) -> tuple[float, float]:
    """Slope and offset of the log odds over what the scaler is given."""
    slope = float(logistic.coef_[0, 0] / scaler.scale_[0])
    return slope, float(logistic.intercept_[0] - slope * scaler.mean_[0])
