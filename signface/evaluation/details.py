"""What an evaluation says beyond its main numbers: by kind of take, by number of takes, by base.

- `details`: all of it, as it is added to metrics.json.
- `segmentation_by_kind`: every method on every kind of take.
- `reliability`: whether confidences mean what they say.
- `favourite`: the classifier that is looked at more closely.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import pandas as pd

from signface.evaluation.importance import can_be_judged, permutation_importance
from signface.evaluation.learning_curve import learning_curve, remembering
from signface.evaluation.protocol import UNCALIBRATED, Evaluation, Fold
from signface.learn.examples import Example
from signface.learn.training import train
from signface.metrics.segmentation import segmentation_metrics
from signface.segmentation.segments import Segments
from signface.settings.choices import NAMES
from signface.settings.training import TrainingSettings

#: How the segmentation that learns nothing is called among the methods (thesis, 4.4.2).
ENERGIES = "energies"

#: Bins of a reliability curve.
BINS = 10


def segmentation_by_kind(
    examples: Sequence[Example],
    segments: Mapping[str, Segments],
    found: Mapping[str, Mapping[str, Mapping[str, Segments]]],
) -> dict[str, dict[str, dict[str, dict]]]:
    """How well every method segments every kind of take.

    Parameters
    ----------
    examples : sequence of Example
    segments : mapping of str to Segments
        What the energies find, by take, of any takes: they learn nothing, so that training takes can be judged too.
    found : mapping
        Protocol, classifier and take to the annotation that comes out: neighbours with equal labels are one segment.

    Returns
    -------
    dict
        Protocol (empty for the energies), method and kind to what `segmentation_metrics` gives.
    """
    methods: dict[tuple[str, str], Mapping[str, Segments]] = {("", ENERGIES): segments}
    methods |= {(protocol, name): takes for protocol, names in found.items() for name, takes in names.items()}
    scores: dict[str, dict[str, dict[str, dict]]] = {}
    for (protocol, method), takes in methods.items():
        kinds = sorted({example.kind for example in examples if example.take in takes})
        for kind in kinds:
            pairs = [(e.reference.table, takes[e.take].table) for e in examples if e.kind == kind and e.take in takes]
            scores.setdefault(protocol, {}).setdefault(method, {})[kind] = segmentation_metrics(pairs)
    return scores


def favourite(classifiers: Mapping[str, Mapping[str, Mapping]]) -> str:
    """The classifier that is right most of the time (on frames, which are the same for all); the first of equals."""
    return max(classifiers, key=lambda name: classifiers[name]["frames"]["accuracy"] or 0.0)


def details(
    evaluations: Mapping[str, Evaluation],
    folds: Mapping[str, Sequence[Fold]],
    examples: Sequence[Example],
    segments: Mapping[str, Segments],
    settings: TrainingSettings = UNCALIBRATED,
    *,
    curves_of: Sequence[str] | None = None,
    progress: Callable[[Iterable, str], Iterable] = lambda items, what: items,
) -> dict[str, Any]:
    """Segmentation by kind, learning curves, the importance of bases and reliability, as plain values.

    Parameters
    ----------
    evaluations, folds : mappings
        By protocol, the main one first.
    examples : sequence of Example
    segments : mapping of str to Segments
        What the energies find.
    settings : TrainingSettings
        Those of the evaluation. Nothing is searched again: importance is asked of the parameters that were chosen,
        learning curves are drawn with the settings' own.
    curves_of : sequence of str, optional
        Classifiers with a learning curve; those of the thesis by default, since sequence models train for minutes.
    progress : callable, optional
        Wraps the steps of each protocol's curve, with words for what is done.

    Returns
    -------
    dict
        - `segmentation_by_kind`: see there;
        - `learning_curve`: protocol to a list of points;
        - `importance`: classifier to a list of groups of bases, for the main protocol;
        - `reliability`: protocol and classifier to share right by confidence.
    """
    plain = settings.changed(search=False, calibrate=False)
    remembered = remembering()
    found = {protocol: evaluation.found for protocol, evaluation in evaluations.items()}
    result: dict[str, Any] = {"segmentation_by_kind": segmentation_by_kind(examples, segments, found)}
    curves: dict[str, list] = {}
    importance: dict[str, list] = {}
    for protocol, evaluation in evaluations.items():
        scores = evaluation.metrics["classifiers"]
        drawn = [name for name in scores if (name in NAMES if curves_of is None else name in curves_of)]
        if drawn:
            signers = max(len({example.signer for example in fold.train}) for fold in folds[protocol])
            curve = learning_curve(
                folds[protocol],
                plain,
                classifiers=drawn,
                by="signers" if signers > 1 else "takes",
                whole={} if settings.search else {name: scores[name]["manual_segments"]["accuracy"] for name in drawn},
                train=remembered,
                progress=lambda steps, protocol=protocol: progress(steps, f"learning curve {protocol}"),  # type: ignore[misc]
            )
            curves[protocol] = _records(curve)
        if importance or protocol != next(iter(evaluations)):
            continue
        for name in [name for name in scores if name in NAMES]:
            models = [
                train(fold.train, plain.for_classifier(name).changed(parameters=trained[name]["parameters"]), name=name)
                for fold, trained in zip(folds[protocol], evaluation.trained, strict=True)
            ]
            if all(map(can_be_judged, models)):
                importance[name] = _records(permutation_importance(folds[protocol], models, seed=settings.seed))
    reliable = {protocol: reliability(evaluation.tables) for protocol, evaluation in evaluations.items()}
    return result | {"learning_curve": curves, "importance": importance, "reliability": reliable}


def reliability(tables: Mapping[str, Mapping[str, pd.DataFrame]]) -> dict[str, list[dict[str, float]]]:
    """Share right against confidence on automatic segments, in `BINS` bins of equal width.

    Parameters
    ----------
    tables : mapping
        `Evaluation.tables`.

    Returns
    -------
    dict
        Classifier to its bins that hold segments: mean `confidence`, `accuracy` and `n`.
    """
    curves = {}
    for name, sections in tables.items():
        judged = sections["automatic_segments"]
        judged = judged[judged["truth"] != ""]
        bins = (judged["confidence"].astype(float) * BINS).clip(0, BINS - 1).astype(int)
        curves[name] = [
            {
                "confidence": float(rows["confidence"].mean()),
                "accuracy": float((rows["truth"] == rows["found"]).mean()),
                "n": len(rows),
            }
            for _, rows in judged.groupby(bins)
        ]
    return curves


def _records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """The rows of a table as JSON has them: numbers of Python's own, None for NaN."""
    rows = table.astype(object).where(table.notna(), None).to_dict("records")
    return [{str(key): value.item() if hasattr(value, "item") else value for key, value in row.items()} for row in rows]
