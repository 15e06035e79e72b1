"""What is chosen, and what is known of a classifier, from takes left out within the training takes.

- `GRIDS`: the parameters that a search goes through.
- `search_parameters`: the best of them.
- `cross_validate`: labels and confidences of segments of takes that were left out.

Neither sees a test take: whoever tests gives them the training takes only, and so nests the one in the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from sklearn.model_selection import ParameterGrid

from signface.errors import SignfaceError
from signface.label.labelling import label_spans
from signface.learn.examples import Example, signer_levels
from signface.learn.fitting import fit_model
from signface.learn.folds import groups_of, inner_folds
from signface.settings.choices import BY_SIGNER
from signface.settings.training import TrainingSettings

#: classifier: what a search tries, parameter by parameter.
GRIDS: dict[str, dict[str, list[Any]]] = {
    "knn1": {"weights": ["uniform"], "metric": ["euclidean", "manhattan", "cosine"]},
    "knn3": {"weights": ["uniform", "distance"], "metric": ["euclidean", "manhattan", "cosine"]},
    "svm-linear": {"C": [0.1, 1.0, 10.0]},
    "svm-rbf": {"C": [0.1, 1.0, 10.0], "gamma": [0.1, 0.3, 1.0, 3.0]},
    "forest": {"min_samples_leaf": [1, 3, 10], "max_features": [0.05, "sqrt", 0.4]},
    "extra-trees": {"min_samples_leaf": [1, 3, 10], "max_features": [0.05, "sqrt", 0.4]},
    "boosting": {"balance": [0.0, 0.5, 1.0]},
    "crf": {"penalty": [3e-4, 1e-3, 3e-3]},
    # A sequence model is decoded anew with each of these; its frame classifier is trained once a fold.
    "sequence": {"boundary_weight": [0.7, 1.0, 1.4], "rarity": [0.4, 0.6, 0.8]},
}

#: Training takes, and takes left out of them (`signface.learn.folds.inner_folds`).
Folds = Sequence[tuple[list[Example], list[Example]]]


def search_parameters(examples: Sequence[Example], settings: TrainingSettings) -> tuple[dict[str, Any], float]:
    """The parameters that do best on training takes left out, and how well they do there.

    Classifiers of segments are scored by balanced accuracy on the left-out takes' stable segments, sequence models by
    the share of their frames that get the right label or are rightly called a transition. The first of equals wins.

    Parameters
    ----------
    examples : sequence of Example
        The training takes.
    settings : TrainingSettings
        Parameters that it sets stay, unless they are searched over.

    Returns
    -------
    (parameters, score)

    Raises
    ------
    SignfaceError
        There are too few takes to leave any out.
    """
    pairs = inner_folds(examples, folds=settings.folds)
    if not pairs:
        raise SignfaceError(
            "there are too few training takes to search over", hint="train on two takes or more, or without --search"
        )
    sequential = settings.classifier not in GRIDS
    grid = list(ParameterGrid(GRIDS["sequence" if sequential else settings.classifier]))
    if sequential:
        scores = _sequence_scores(pairs, grid, settings)
    else:
        scores = [
            balanced_accuracy(cross_validate(pairs, settings.changed(parameters={**settings.parameters, **one})))
            for one in grid
        ]
    best = int(np.argmax(np.round(scores, 6)))
    return dict(grid[best]), float(scores[best])


def cross_validate(pairs: Folds, settings: TrainingSettings) -> pd.DataFrame:
    """Labels of the stable segments of takes left out, by what was trained on the others.

    Parameters
    ----------
    pairs : sequence of pairs of lists of Example
        What `signface.learn.folds.inner_folds` returns.
    settings : TrainingSettings
        Its parameters are used as they are; nothing is searched or calibrated.

    Returns
    -------
    DataFrame
        `signer, take, group, truth, found, confidence`, a row for each segment.
    """
    tables = []
    for kept, left_out in pairs:
        model = fit_model(kept, settings)
        levels = signer_levels(left_out) if settings.normalise in BY_SIGNER else {}
        groups = groups_of(left_out, by_signer=len({e.signer for e in (*kept, *left_out)}) > 1)
        for example, group in zip(left_out, groups, strict=True):
            spans = example.stable[["start_s", "end_s"]].to_numpy(float)
            labels, confidences = label_spans(example.descriptors, spans, model, level=levels.get(example.signer))
            table = pd.DataFrame({"truth": example.stable["label"].to_numpy(object), "found": labels})
            tables.append(table.assign(confidence=confidences, signer=example.signer, take=example.take, group=group))
    return pd.concat(tables, ignore_index=True)


def balanced_accuracy(table: pd.DataFrame) -> float:
    """Share of right segments of each label of the reference, averaged."""
    return float((table["truth"] == table["found"]).groupby(table["truth"]).mean().mean())


def _sequence_scores(pairs: Folds, grid: Sequence[Mapping[str, Any]], settings: TrainingSettings) -> list[float]:
    """Score of each set of parameters: the share of frames rightly labelled, over all left-out takes."""
    totals = np.zeros(len(grid))
    for kept, left_out in pairs:
        model = fit_model(kept, settings)
        levels = signer_levels(left_out) if settings.normalise in BY_SIGNER else {}
        takes = [model.seen(e.descriptors, levels.get(e.signer)) for e in left_out]
        estimator: Any = model.estimator
        for number, parameters in enumerate(grid):
            estimator.set_params(**parameters)
            totals[number] += len(left_out) * estimator.score(takes, [e.moving for e in left_out])
    return (totals / sum(len(left_out) for _, left_out in pairs)).tolist()
