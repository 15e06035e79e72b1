"""Learning from corrections: what a model did before, and what one trained on the corrections does, on takes held out.

- `held_out_labels`: the labels that both give to the stable segments of takes that neither has seen.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from signface.errors import SignfaceError
from signface.label.labelling import label_spans
from signface.label.model import TrainedModel
from signface.learn.examples import Example, in_order
from signface.learn.training import train_model
from signface.settings.training import TrainingSettings


def held_out_labels(
    corrected: Sequence[Example],
    before: TrainedModel,
    settings: TrainingSettings = TrainingSettings(),
    *,
    others: Sequence[Example] = (),
) -> pd.DataFrame:
    """Labels of the corrected takes' stable segments, by the model before and by one trained without the take.

    The takes are dealt into folds; each fold in turn is held out, and a model is trained on the others.

    Parameters
    ----------
    corrected : sequence of Example
        Takes with the annotators' corrections, at least two.
    before : TrainedModel
        The model in use so far. If it was trained on some of these takes, it knows them; its card says on which.
    settings : TrainingSettings
        What is trained, and the number of folds, at most as many as there are takes. Labels need no calibration.
    others : sequence of Example
        Takes that are always trained on and never held out.

    Returns
    -------
    DataFrame
        `take, start_s, end_s, label` (the annotator's), `before`, `after`.

    Raises
    ------
    SignfaceError
        There are fewer than two takes, or what is left to train on does not suffice.
    """
    if len(corrected) < 2:
        raise SignfaceError("one take cannot be held out of itself", hint="correct two takes or more")
    ordered = in_order(corrected)
    folds = min(settings.folds, len(ordered))
    tables = []
    for fold in range(folds):
        kept = [example for number, example in enumerate(ordered) if number % folds != fold]
        after = train_model([*kept, *others], settings.changed(calibrate=False))
        for example in ordered[fold::folds]:
            spans = example.stable[["start_s", "end_s"]].to_numpy(float)
            if not len(spans):
                continue
            table = example.stable[["start_s", "end_s", "label"]].copy()
            table.insert(0, "take", example.take)
            for column, model in (("before", before), ("after", after)):
                table[column] = np.array(label_spans(example.descriptors, spans, model)[0], dtype=object)
            tables.append(table)
    if not tables:
        raise SignfaceError("the takes hold no stable segment", hint="look at their annotations")
    return pd.concat(tables, ignore_index=True)
