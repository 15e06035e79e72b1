"""Intensity of an expression, 1 to 3, learnt from annotations: an ordinal classification beside the label.

- `IntensityClassifier`: the intensity of stable segments, from how far the face is from rest.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from signface.descriptors import Descriptors
from signface.label.spans import segment_means
from signface.label.vocabulary import AFFECT, UNKNOWN
from signface.segmentation.segments import Segments

#: The intensities there are.
INTENSITIES = (1, 2, 3)


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
    rest_ : str
        The label that has no intensity.
    """

    bases_: tuple[str, ...]
    levels_: np.ndarray
    lines_: np.ndarray
    n_segments_: int
    rest_: str = AFFECT.rest

    def predict(self, take: Descriptors, spans: np.ndarray, labels: Sequence[str]) -> list[int | None]:
        """Intensity of each (S, 2) span of a take with its label; None at rest, where nothing was seen, and
        of what is unknown."""
        table = pd.DataFrame({"start_s": spans[:, 0], "end_s": spans[:, 1], "label": list(labels)})
        strength = self.strength(take, table)
        judged = np.isfinite(strength) & ~table["label"].isin([self.rest_, UNKNOWN]).to_numpy()
        levels: list[int | None] = [None] * len(table)
        if judged.any():
            odds = strength[judged, None] * self.lines_[:, 0] + self.lines_[:, 1]
            judged_levels = self.levels_[between_steps(1.0 / (1.0 + np.exp(-odds))).argmax(axis=1)]
            for row, level in zip(np.flatnonzero(judged), judged_levels, strict=True):
                levels[row] = int(level)
        return levels

    def annotate(self, take: Descriptors, segments: Segments) -> Segments:
        """Labelled segments with a column `intensity`, missing for transitions and faces at rest."""
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

    def strength(self, take: Descriptors, table: pd.DataFrame) -> np.ndarray:
        """(S,) norm of the mean weights of each segment; NaN where there are none."""
        columns = [take.names.index(name) for name in self.bases_]
        means = segment_means(take, table[["start_s", "end_s"]].to_numpy(float))
        return np.linalg.norm(means[:, columns], axis=1)


def between_steps(above: np.ndarray) -> np.ndarray:
    """(K, C) probabilities of ordered classes from the (K, C - 1) ones of lying above each but the last.

    Where those of two neighbours cross, the lower one holds.
    """
    above = np.minimum.accumulate(above, axis=1)
    whole = np.column_stack([np.ones(len(above)), above, np.zeros(len(above))])
    return whole[:, :-1] - whole[:, 1:]
