"""What more training takes, and more signers, bring.

- `learning_curve`: accuracy against the number of training takes, or of training signers.
- `remembering`: a training that is done once for the same takes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any
from zlib import crc32

import numpy as np
import pandas as pd
from sklearn.utils.parallel import Parallel, delayed

from signface.errors import SignfaceError
from signface.evaluation.importance import can_be_judged
from signface.evaluation.protocol import UNCALIBRATED, Fold
from signface.label.labelling import label_spans
from signface.label.model import TrainedModel
from signface.label.spans import segment_means
from signface.learn.examples import Example, in_order, signer_levels
from signface.learn.training import train
from signface.segmentation.segments import Segments
from signface.settings.choices import BY_SIGNER
from signface.settings.training import TrainingSettings

#: Training takes that one classifier may be trained on in all, over the whole curve: what bounds its time.
MOST_TAKES = 400

#: Trainings at the same time.
WORKERS = 2

#: Points of a curve at most.
POINTS = 6


def learning_curve(
    folds: Sequence[Fold],
    settings: TrainingSettings = UNCALIBRATED,
    *,
    classifiers: Sequence[str],
    by: str = "takes",
    whole: Mapping[str, float] | None = None,
    draws: int = 3,
    most_takes: int = MOST_TAKES,
    train: Callable[..., TrainedModel] = train,
    progress: Callable[[Iterable], Iterable] = iter,
) -> pd.DataFrame:
    """Accuracy on the reference's stable segments of the test takes, for growing parts of the training takes.

    The training takes (or signers) of each fold are put in a random order and the first k of it are trained on. That
    is drawn several times; all classifiers get the same draws. What a part of the takes does not show, a classifier
    trained on it cannot name, and that counts against it: it is what having fewer takes means.

    Parameters
    ----------
    folds : sequence of Fold
    settings : TrainingSettings
        How every classifier is trained, but that nothing is searched or calibrated. Its seed is that of the orders too.
    classifiers : sequence of str
    by : str
        `takes` or `signers`: what grows. With `signers`, a signer comes with all their takes.
    whole : mapping of str to float, optional
        Accuracy of classifiers trained on everything, where it is known: the last point of their curves.
    draws : int
        Orders drawn at most.
    most_takes : int
        Takes that one classifier may be trained on over the whole curve; fewer orders are drawn, at least one, so that
        this is kept. With very many takes, points are left out.
    train : callable, optional
        Trains a model, as `train` does, from examples, settings and `name`.
    progress : callable, optional
        Wraps the list of steps, to show how far it is.

    Returns
    -------
    DataFrame
        `classifier, by, size, draw, accuracy, n` (segments). The fold's own numbers are pooled; a size that a fold
        does not reach stands for all that it has. Sizes at which nothing can be trained (one expression only)
        are left out.
    """
    if by not in ("takes", "signers"):
        raise ValueError(f"what grows is takes or signers, not {by}")
    most = max(len(_units(fold, by)) for fold in folds)
    orders = [_orders(fold, by, draws, settings.seed) for fold in folds]
    sizes, drawn = _plan(folds, by, _sizes(most), draws, most_takes)
    n = sum(len(example.stable) for fold in folds for example in fold.test)
    known = whole or {}
    plain = settings.changed(search=False, calibrate=False)
    steps = [
        (name, size, draw)
        for name in classifiers
        for size in sizes
        for draw in range(1 if size == most else drawn)  # all there is can be drawn in one way only
    ]

    def judged(name: str, size: int, draw: int) -> float | None:
        if size == most and name in known:
            return known[name]
        parts = [[example for unit in order[draw][:size] for example in unit] for order in orders]
        try:
            models = [train(part, plain.for_classifier(name), name=name) for part in parts]
        except SignfaceError:  # they show one expression only
            return None
        return sum(_hits(fold, model) for fold, model in zip(folds, models, strict=True)) / n if n else float("nan")

    # Threads: most of the time is spent in compiled code, which lets go of Python's lock.
    accuracies = Parallel(n_jobs=WORKERS, prefer="threads", return_as="generator")(
        delayed(judged)(*step) for step in steps
    )
    shares = zip(progress(steps), accuracies)
    rows = [(*step[:1], by, *step[1:], share, n) for step, share in shares if share is not None]
    return pd.DataFrame(rows, columns=["classifier", "by", "size", "draw", "accuracy", "n"])


def _units(fold: Fold, by: str) -> list[list[Example]]:
    """What is drawn: each training take, or all training takes of each signer."""
    ordered = [replace(example, reference=_without_intensity(example.reference)) for example in in_order(fold.train)]
    if by == "takes":
        return [[example] for example in ordered]
    signers = sorted({example.signer for example in ordered})
    return [[example for example in ordered if example.signer == signer] for signer in signers]


def _without_intensity(reference: Segments) -> Segments:
    """The reference without intensities: they are not asked for here, and would be learnt every time."""
    return replace(reference, table=reference.table.drop(columns="intensity", errors="ignore"))


def _orders(fold: Fold, by: str, draws: int, seed: int) -> list[list[list[Example]]]:
    """The units of a fold in `draws` random orders, the same for the same takes whoever is tested."""
    units = _units(fold, by)
    names = " ".join(example.take for unit in units for example in unit)
    rng = np.random.default_rng([seed, crc32(names.encode())])
    return [[units[index] for index in rng.permutation(len(units))] for _ in range(draws)]


def _sizes(most: int) -> list[int]:
    """At most `POINTS` sizes from 1 to all, closer together where they are small."""
    if most <= POINTS:
        return list(range(1, most + 1))
    steps = np.linspace(0, 1, POINTS) ** 1.5
    return sorted({1, *(round(1 + (most - 1) * step) for step in steps)})


def _plan(folds: Sequence[Fold], by: str, sizes: list[int], draws: int, most_takes: int) -> tuple[list[int], int]:
    """Sizes and number of orders whose trainings stay within `most_takes`, all of them beside the whole."""
    units = [np.mean([len(unit) for unit in _units(fold, by)]) for fold in folds]

    def cost(some: Sequence[int]) -> float:
        return float(sum(size * unit for size in some[:-1] for unit in units))

    kept = list(sizes)
    while len(kept) > 3 and cost(kept) > most_takes:
        kept.pop(-2)
    return kept, int(np.clip(most_takes // max(cost(kept), 1), 1, draws))


def _hits(fold: Fold, model: TrainedModel) -> int:
    """How many stable segments of the reference of the test takes get their label."""
    levels = signer_levels(fold.test) if model.card.normalise in BY_SIGNER else {}
    right, means, truths = 0, [], []
    for example in fold.test:
        level = levels.get(example.signer)
        spans = example.stable[["start_s", "end_s"]].to_numpy(float)
        truth = example.stable["label"].to_numpy(object)
        of_take = segment_means(model.seen(example.descriptors, level), spans) if can_be_judged(model) else None
        if (
            of_take is not None and np.isfinite(of_take).all()
        ):  # the confidence, which takes the longest, is not wanted here
            means.append(of_take)
            truths.append(truth)
        elif len(spans):
            labels = np.array(label_spans(example.descriptors, spans, model, level=level)[0], dtype=object)
            right += int((labels == truth).sum())
    if sum(map(len, means)):
        estimator: Any = model.estimator
        right += int((estimator.predict(np.concatenate(means)) == np.concatenate(truths)).sum())
    return right


def remembering(train: Callable[..., TrainedModel] = train) -> Callable[..., TrainedModel]:
    """The same training, but what was trained on the same takes before is not trained again.

    With two signers, classifiers for a signer never met are those of the other signer.
    """
    trained: dict[tuple, TrainedModel] = {}

    def remembered(examples: Sequence[Example], settings: TrainingSettings, **names: str) -> TrainedModel:
        key = (frozenset(example.take for example in examples), settings.digest)
        if key not in trained:
            trained[key] = train(examples, settings, **names)
        return trained[key]

    return remembered
