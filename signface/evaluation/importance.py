"""Which bases a classifier lives on: what it loses when one of them says something about another segment.

- `permutation_importance`: accuracy lost when a base's weights are dealt out anew among the test segments.
- `mirrored_groups`: bases of the left and the right of the face, which are judged together.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from signface.label.model import TrainedModel
from signface.label.spans import segment_means
from signface.learn.examples import signer_levels
from signface.metrics.classification import accuracy_interval
from signface.settings.choices import BY_SIGNER

if TYPE_CHECKING:
    from signface.evaluation.protocol import Fold

#: How a base of one side of the face ends.
SIDE = re.compile(r"(?<=[a-z])[._]?(?:Left|Right|_left|_right|_L|_R|\.L|\.R)$")


#: What a column that was made of a base is called: `slope(jawOpen)` (`signface.label.variants`).
MADE_OF = re.compile(r"^\w+\((.+)\)$")


def mirrored_groups(names: Sequence[str]) -> dict[str, list[int]]:
    """Columns of the bases, left and right together, under the name without its side, in order of appearance.

    A base whose other side is not there stays alone, under its own name. Columns made of a base, such as its slope,
    belong to it.

    Examples
    --------
    >>> mirrored_groups(["jawOpen", "mouthSmileLeft", "mouthSmileRight", "browDownLeft"])
    {'jawOpen': [0], 'mouthSmile': [1, 2], 'browDownLeft': [3]}
    """
    columns: dict[str, list[int]] = {}
    bases = [MADE_OF.sub(r"\1", name) for name in names]
    for column, base in enumerate(bases):
        columns.setdefault(SIDE.sub("", base), []).append(column)
    return {
        (stem if len({bases[column] for column in own}) > 1 else bases[own[0]]): own for stem, own in columns.items()
    }


def can_be_judged(model: TrainedModel) -> bool:
    """Whether a model labels a segment by its mean descriptor, which is what is dealt out anew."""
    return not model.sequential and model.card.aggregate == "mean"


def permutation_importance(
    folds: Sequence[Fold], models: Sequence[TrainedModel], *, repeats: int = 10, seed: int = 0
) -> pd.DataFrame:
    """Accuracy that a classifier loses when it is told wrong about a base (Breiman 2001, section 10).

    The mean weights of a base are dealt out anew among the reference's stable segments of one signer's test takes, and
    what the classifier then gets right is compared with what it got right before. Nothing that was trained on is
    looked at. The left and the right of the face move together, so that either alone would seem to be of no use: they
    are dealt out together. A base that another base can stand in for still looks less useful than it is.

    Parameters
    ----------
    folds : sequence of Fold
    models : sequence of TrainedModel
        The model of each fold; `can_be_judged` is true of each.
    repeats : int
        How often each group of bases is dealt out.
    seed : int
        Of the dealing and of the bootstrap.

    Returns
    -------
    DataFrame
        A row for each group of bases, the most useful first: `group`, `bases` (joined by spaces), `accuracy_lost` with
        its 95 % interval over takes (`low`, `high`, NaN with one take), and, for each label of the reference, the
        share of its segments that are lost (`lost_N`, ...).

    Raises
    ------
    ValueError
        A model does not label segments by their means.
    """
    if not all(map(can_be_judged, models)):
        raise ValueError("only what labels segments by their means can be judged")
    rng = np.random.default_rng(seed)
    lost: dict[str, list[np.ndarray]] = {}
    truths, takes, bases = [], [], {}
    for fold, model in zip(folds, models, strict=True):
        estimator: Any = model.estimator
        means, names, truth, take = _segments_of(fold, model)
        if not len(truth):
            continue
        truths.append(truth)
        takes.append(take)
        right = (estimator.predict(means) == truth).astype(float)
        orders = np.stack([rng.permutation(len(truth)) for _ in range(repeats)])
        for group, columns in mirrored_groups(names).items():
            bases[group] = " ".join(dict.fromkeys(MADE_OF.sub(r"\1", names[column]) for column in columns))
            dealt = np.tile(means, (repeats, 1))
            dealt[:, columns] = means[orders.ravel()][:, columns]
            still = (estimator.predict(dealt).reshape(repeats, -1) == truth).mean(axis=0)
            lost.setdefault(group, []).append(right - still)
    if not truths:
        return pd.DataFrame(columns=["group", "bases", "accuracy_lost", "low", "high"])
    truth, take = np.concatenate(truths), np.concatenate(takes)
    labels = folds[0].test[0].vocabulary.values
    rows = []
    for group, parts in lost.items():
        own = np.concatenate(parts)
        low, high = accuracy_interval(own.tolist(), take.tolist(), seed=seed) or (np.nan, np.nan)
        row = {"group": group, "bases": bases[group], "accuracy_lost": own.mean(), "low": low, "high": high}
        rows.append(row | {f"lost_{label}": own[truth == label].mean() for label in labels if label in truth})
    return pd.DataFrame(rows).sort_values("accuracy_lost", ascending=False, kind="stable", ignore_index=True)


def _segments_of(fold: Fold, model: TrainedModel) -> tuple[np.ndarray, tuple[str, ...], np.ndarray, np.ndarray]:
    """Mean descriptors, names of their columns, label and take of the reference's stable segments of the test takes."""
    levels = signer_levels(fold.test) if model.card.normalise in BY_SIGNER else {}
    means, truth, take = [], [], []
    names: tuple[str, ...] = ()
    for example in fold.test:
        seen = model.seen(example.descriptors, levels.get(example.signer))
        own, names = segment_means(seen, example.stable[["start_s", "end_s"]].to_numpy(float)), seen.names
        known = np.isfinite(own).all(axis=1)
        means.append(own[known])
        truth += example.stable["label"].to_numpy(object)[known].tolist()
        take += [example.take] * int(known.sum())
    return np.concatenate(means), names, np.array(truth, dtype=str), np.array(take, dtype=str)
