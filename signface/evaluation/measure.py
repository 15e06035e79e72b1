"""Everything that is measured on an annotated corpus.

- `evaluate`: the content of metrics.json, and the annotations that came out.
- `Measured`: the two of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

from signface.evaluation.details import details
from signface.evaluation.protocol import UNCALIBRATED, Evaluation, Fold, evaluate_folds, folds_of
from signface.evaluation.usual import usual_kinds, usual_protocols
from signface.learn.examples import Example
from signface.segmentation.cutting import segment
from signface.segmentation.segments import Segments
from signface.settings.choices import NAMES
from signface.settings.training import TrainingSettings


class Measured(NamedTuple):
    """What was measured on a corpus.

    Parameters
    ----------
    metrics : dict
        The content of metrics.json (docs/files.md).
    segments : mapping
        Protocol, classifier and take to the labelled segments that came out.

    See Also
    --------
    signface.write_report : a page of it.

    Examples
    --------
    >>> import signface as sf
    >>> measured = sf.evaluate(sf.datasets.mini_examples(), classifiers=["knn1"], protocols=["across"])
    >>> list(measured.segments["across"]["knn1"])
    ['M1_EU_11', 'M2_EU_04']
    """

    metrics: dict
    segments: Mapping[str, Mapping[str, Mapping[str, Segments]]]


def evaluate(
    examples: Sequence[Example],
    settings: TrainingSettings = UNCALIBRATED,
    *,
    protocols: Sequence[str] | None = None,
    train_kinds: Sequence[str] | None = None,
    test_kinds: Sequence[str] | None = None,
    classifiers: Sequence[str] = tuple(NAMES),
    curves_of: Sequence[str] | None = None,
    progress: Callable[[Iterable, str], Iterable] = lambda items, what: items,
) -> Measured:
    """Train and test classifiers on an annotated corpus, with learning curves and what the classifiers live on.

    Parameters
    ----------
    examples : sequence of Example
    settings : TrainingSettings
        How every classifier is trained; `classifier` itself is not looked at.
    protocols : sequence of str, optional
        Names of `signface.evaluation.protocol.PROTOCOLS`, the main one first; by default as
        `signface.evaluation.usual.usual_protocols` says: all, or `within` alone where there is one signer.
    train_kinds, test_kinds : sequence of str, optional
        Kinds of takes to train on and to test; by default IE and SE, and EU, or where no take is of these kinds all.
    classifiers : sequence of str
        Names of `NAMES` and `SEQUENCE_NAMES` of `signface.label.labellers`.
    curves_of : sequence of str, optional
        As in `signface.evaluation.details.details`.
    progress : callable, optional
        Wraps each list of steps, with words for what is done.

    Returns
    -------
    Measured
        In the metrics, `classifiers` holds the main protocol; a second one stands under `also`, by its name.

    Raises
    ------
    SignfaceError
        As `signface.evaluation.protocol.folds_of` and `signface.learn.training.train`.

    See Also
    --------
    signface.write_report : a page with figures and tables of it.

    Examples
    --------
    >>> import signface as sf
    >>> examples = sf.datasets.mini_examples()
    >>> measured = sf.evaluate(examples, classifiers=["knn1"], protocols=["across"])
    >>> sorted(measured.metrics["classifiers"]["knn1"])
    ['automatic_segments', 'frames', 'manual_segments']
    """
    train_kinds, test_kinds = usual_kinds([example.kind for example in examples], train_kinds, test_kinds)
    protocols = usual_protocols(examples, protocols, train_kinds=train_kinds, test_kinds=test_kinds)
    segments = {e.take: segment(e.descriptors) for e in examples}
    evaluations: dict[str, Evaluation] = {}
    folds: dict[str, list[Fold]] = {}
    metrics: dict = {}
    for protocol in protocols:
        folds[protocol] = folds_of(examples, protocol=protocol, train_kinds=train_kinds, test_kinds=test_kinds)
        evaluations[protocol] = evaluate_folds(
            folds[protocol],
            settings,
            classifiers=classifiers,
            segments=segments,
            progress=partial(_shown, progress, f"evaluating {protocol}"),
        )
        description = {
            "name": protocol,
            "train_kinds": list(train_kinds),
            "test_kinds": list(test_kinds),
            "seed": settings.seed,
            "training": {key: value for key, value in settings.as_dict().items() if key not in ("classifier", "seed")},
            "folds": _described(folds[protocol], evaluations[protocol]),
        }
        if not metrics:
            metrics = {**evaluations[protocol].metrics, "protocol": description}
        else:
            rest = {key: value for key, value in evaluations[protocol].metrics.items() if key != "segmentation"}
            metrics.setdefault("also", {})[protocol] = {**rest, "protocol": description}
    metrics |= details(evaluations, folds, examples, segments, settings, curves_of=curves_of, progress=progress)
    return Measured(metrics, {protocol: evaluation.found for protocol, evaluation in evaluations.items()})


def _shown(progress: Callable[[Iterable, str], Iterable], what: str, steps: Iterable) -> Iterable:
    return progress(steps, what)


def _described(folds: Sequence[Fold], evaluation: Evaluation) -> list[dict]:
    """What metrics.json says of each fold."""
    return [
        {
            "signer": fold.signer,
            "train_takes": [example.take for example in fold.train],
            "test_takes": [example.take for example in fold.test],
            "trained": trained,
            "classifiers": evaluation.by_signer[fold.signer],
        }
        for fold, trained in zip(folds, evaluation.trained, strict=True)
    ]
