"""Training intensities, 1 to 3, on annotations: an ordinal classification beside the label.

- `train_intensity`: an `IntensityClassifier` trained on annotated takes, where their intensity is annotated.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from signface.label.intensity import IntensityClassifier
from signface.learn.examples import Example, common_bases
from signface.learn.ordinal import OrdinalClassifier
from signface.segmentation.segments import Segments

if TYPE_CHECKING:
    from sklearn.linear_model import LogisticRegression
    from sklearn.preprocessing import StandardScaler

#: Segments that it takes to train on, in all and of each of two intensities.
LEAST_SEGMENTS = 12
LEAST_EACH = 3


def train_intensity(examples: Sequence[Example]) -> IntensityClassifier | None:
    """A classifier of intensities trained on annotated takes; segments without an intensity are left out.

    None where there is too little to learn from: fewer than `LEAST_SEGMENTS` segments with an intensity, or fewer than
    `LEAST_EACH` of a second intensity.
    """
    known = [e for e in examples if len(_with_intensity(e.reference, e.vocabulary.rest))]
    if not known:
        return None
    counts = pd.concat([_with_intensity(e.reference, e.vocabulary.rest)["intensity"] for e in known]).value_counts()
    if counts.sum() < LEAST_SEGMENTS or len(counts) < 2 or counts.iloc[1] < LEAST_EACH:
        return None
    return _fitted(known, common_bases(known))


def _fitted(examples: Sequence[Example], bases: tuple[str, ...]) -> IntensityClassifier:
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    rows, levels = [], []
    model = IntensityClassifier()
    model.bases_ = bases
    if examples[0].vocabulary.rest != model.rest_:
        model.rest_ = examples[0].vocabulary.rest
    for example in examples:
        table = _with_intensity(example.reference, model.rest_)
        strength = model.strength(example.descriptors, table)
        seen = np.isfinite(strength)
        rows.append(strength[seen, None])
        levels.append(table["intensity"].to_numpy(int)[seen])
    model.n_segments_ = sum(map(len, levels))
    steps = OrdinalClassifier(make_pipeline(StandardScaler(), LogisticRegression(max_iter=500)))
    steps.fit(np.concatenate(rows), np.concatenate(levels))
    model.levels_ = steps.classes_
    model.lines_ = np.array([_line(*step) for step in steps.steps_])
    return model


def _with_intensity(reference: Segments, rest: str) -> pd.DataFrame:
    """The stable segments of a reference that have an intensity."""
    table = reference.table
    if "intensity" not in table or "label" not in table:
        return pd.DataFrame(columns=["start_s", "end_s", "label", "intensity"])
    kept = (table["kind"] == "stable") & table["intensity"].notna() & (table["label"] != rest)
    return table.loc[kept, ["start_s", "end_s", "label", "intensity"]]


def _line(scaler: StandardScaler, logistic: LogisticRegression) -> tuple[float, float]:
    """Slope and offset of the log odds over what the scaler is given."""
    slope = float(logistic.coef_[0, 0] / scaler.scale_[0])
    return slope, float(logistic.intercept_[0] - slope * scaler.mean_[0])
