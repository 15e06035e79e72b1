"""Learning from corrections: what a model did before, and what one trained on the corrections does, on takes held out.

- `learn_corrections`: a model trained on corrected takes, and how it compares with the one before.
- `held_out_labels`: the labels that both give to the stable segments of takes that neither has seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from signface.errors import SignfaceError
from signface.label.labelling import label_spans
from signface.label.model import TrainedModel
from signface.learn.examples import Example, in_order, signer_levels
from signface.learn.training import train
from signface.settings.solve import SolveSettings
from signface.settings.training import TrainingSettings


class Relearnt(NamedTuple):
    """A model trained on corrections.

    Parameters
    ----------
    model : TrainedModel
    labels : DataFrame or None
        What `held_out_labels` gives; None with one take, which cannot be held out.
    words : list of str
        How the model compares with the one before, in lines for people.
    """

    model: TrainedModel
    labels: pd.DataFrame | None
    words: list[str]


def learn_corrections(
    corrected: Sequence[Example],
    before: TrainedModel,
    settings: TrainingSettings = TrainingSettings(),
    *,
    others: Sequence[Example] = (),
    solve: SolveSettings | None = None,
    corpus: str = "unknown",
    name: str = "model",
) -> Relearnt:
    """Train on corrected takes and others, after comparing with the model before on takes held out.

    Parameters
    ----------
    corrected, before, settings, others :
        As in `held_out_labels`. Others that are named like a corrected take are left out: a take that is held out must
        not be learnt from by another road.
    solve, corpus, name : optional
        As in `signface.learn.training.train`.

    Raises
    ------
    SignfaceError
        As `signface.learn.training.train`.
    """
    words = []
    names = {_bare(example) for example in corrected}
    apart = [example for example in others if _bare(example) not in names]
    if len(apart) < len(others):
        words.append(f"{len(others) - len(apart)} takes of the same name in --with are left out")
    labels, scores = None, {}
    if len(corrected) > 1:
        labels = held_out_labels(corrected, before, settings, others=apart)
        right_before, right = (labels[column] == labels["label"] for column in ("before", "after"))
        better, worse = (right & ~right_before).sum(), (right_before & ~right).sum()
        scores = {"accuracy on corrected takes held out": float(right.mean())}
        words += [
            f"stable segments of takes held out: {len(labels)} in {labels['take'].nunique()} takes",
            f"  before ({before.name}): {right_before.mean():.2f} right",
            f"  after: {right.mean():.2f} right ({better} better, {worse} worse)",
        ]
        if right.mean() < right_before.mean():
            words.append(f"the new classifier does worse: stay with {before.name}, or learn from more takes (--with)")
        known = {example.take for example in corrected} & set(before.card.takes)
        if known:
            words.append(f"{before.name} was trained on {len(known)} of these takes: its accuracy flatters it")
    else:
        words.append("one take cannot be held out of itself: no comparison")
    model = train([*corrected, *apart], settings, solve=solve, corpus=corpus, scores=scores, name=name)
    return Relearnt(model, labels, words)


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
        after = train([*kept, *others], settings.changed(calibrate=False))
        levels = signer_levels(ordered)
        for example in ordered[fold::folds]:
            spans = example.stable[["start_s", "end_s"]].to_numpy(float)
            if not len(spans):
                continue
            table = example.stable[["start_s", "end_s", "label"]].copy()
            table.insert(0, "take", example.take)
            for column, model in (("before", before), ("after", after)):
                table[column] = np.array(
                    label_spans(example.descriptors, spans, model, level=levels.get(example.signer))[0], dtype=object
                )
            tables.append(table)
    if not tables:
        raise SignfaceError("the takes hold no stable segment", hint="look at their annotations")
    return pd.concat(tables, ignore_index=True)


def _bare(example: Example) -> str:
    """A take's name without the folders that it lies in."""
    return example.take.rpartition("/")[2]
