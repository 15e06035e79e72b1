"""Whether a take is like what a model of labels was trained on.

- `measures`: what of a take tells it, as plain numbers.
- `fit_familiarity`: what is learnt from takes that are like the training, and from takes that are not.
- `familiarity`: the chance that a take is like it.
- `abstained`: segments in which a model does not name what it cannot know.

No one measure does. How far the solved face lies from the markers tells a tracker's landmarks from markers, and is
blind to people who only sign otherwise; of these the model is unsure. So both go into one logistic regression, with how
far the frames lie from those of the training and how much of the motion is jitter. What is learnt are a dozen numbers
in the card of the model (`Card.familiarity`); a model without them abstains from nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from signface.descriptors import Descriptors
from signface.label.vocabulary import UNKNOWN
from signface.segmentation.noise import jitter
from signface.segmentation.segments import Segments

if TYPE_CHECKING:
    from signface.label.model import TrainedModel

#: Names of the measures, in order.
NAMES = ("confidence", "residual", "jitter", "distance")
#: A residual below this (mm) says nothing: weights of a phone, or of no solve, have none.
NO_RESIDUAL_MM = 1e-6
#: How the step of the history begins that says so.
UNLIKE = "unlike what"
#: Share of the known takes whose familiarity may lie below the limit.
LOST = 0.03
#: Strength of the ridge, in takes: a few dozen of them teach four slopes.
RIDGE = 1.0


def measures(descriptors: Descriptors, segments: Segments, model: TrainedModel) -> dict[str, float]:
    """What tells whether a take is like the training; NaN for what cannot be measured in it.

    - `confidence`: log odds of the mean confidence of its stable segments, over time.
    - `residual`: logarithm of the median residual (mm).
    - `jitter`: share of the motion that is jitter of the tracker (`signface.segmentation.noise.jitter`).
    - `distance`: logarithm of the mean square of its features, standardised as those of the training (recurrent
      networks only).

    Parameters
    ----------
    descriptors : Descriptors
    segments : Segments
        What the model found in them, with confidence.
    model : TrainedModel
    """
    stable = segments.table[segments.table["kind"] == "stable"]
    length = (stable["end_s"] - stable["start_s"]).to_numpy(float)
    told = dict.fromkeys(NAMES, float("nan"))
    if length.sum() > 0:
        sure = float(np.clip((stable["confidence"].to_numpy(float) * length).sum() / length.sum(), 0.02, 0.98))
        told["confidence"] = float(np.log(sure / (1.0 - sure)))
    residual = None if descriptors.residual is None else descriptors.residual[np.isfinite(descriptors.residual)]
    if residual is not None and len(residual) and np.median(residual) > NO_RESIDUAL_MM:
        told["residual"] = float(np.log(np.median(residual)))
    if descriptors.n_frames >= 3:
        told["jitter"] = float(jitter(descriptors).share)
    squares = getattr(model.estimator, "strangeness", None)
    if squares is not None:
        told["distance"] = float(np.log(squares(model.seen(descriptors))))
    return told


def fit_familiarity(known: Sequence[Mapping[str, float]], strange: Sequence[Mapping[str, float]]) -> dict[str, dict]:
    """What `familiarity` needs, from the measures of takes that are like the training and of takes that are not.

    A logistic regression with a ridge on standardised measures, both groups weighing the same; a measure that is not
    known of a take counts as the mean. The limit is the familiarity below which `LOST` of the known takes lie.

    Parameters
    ----------
    known, strange : sequences of what `measures` gives
        None of them of takes that the model was trained on: it is sure of those.

    Returns
    -------
    dict
        By measure `mean`, `scale` and `slope`; under `limit`, `offset` and the limit itself, `least`.
    """
    table = np.array([[row.get(name, np.nan) for name in NAMES] for row in [*known, *strange]], dtype=float)
    like = np.repeat([1.0, 0.0], [len(known), len(strange)])
    weight = np.where(like == 1, 0.5 / max(len(known), 1), 0.5 / max(len(strange), 1)) * len(like)
    seen = np.isfinite(table)
    count = np.maximum((seen * weight[:, None]).sum(axis=0), 1e-9)
    mean = (np.where(seen, table, 0.0) * weight[:, None]).sum(axis=0) / count
    away = np.where(seen, table - mean, 0.0)
    scale = np.sqrt((away**2 * weight[:, None]).sum(axis=0) / count) + 1e-6
    rows = np.column_stack([away / scale, np.ones(len(like))])
    slopes = np.zeros(rows.shape[1])
    ridge = RIDGE * np.diag([*np.ones(len(NAMES)), 0.0])
    for _ in range(50):  # Newton's steps
        chance = 1.0 / (1.0 + np.exp(-rows @ slopes))
        gradient = rows.T @ (weight * (like - chance)) - ridge @ slopes
        curvature = (rows * (weight * chance * (1.0 - chance))[:, None]).T @ rows + ridge + 1e-9 * np.eye(len(slopes))
        step = np.linalg.solve(curvature, gradient)
        slopes += step
        if np.abs(step).max() < 1e-10:
            break
    of_known = 1.0 / (1.0 + np.exp(-rows[like == 1] @ slopes))
    learnt: dict[str, dict] = {
        name: {"mean": float(mean[i]), "scale": float(scale[i]), "slope": float(slopes[i])}
        for i, name in enumerate(NAMES)
    }
    learnt["limit"] = {"offset": float(slopes[-1]), "least": float(min(np.quantile(of_known, LOST), 0.5))}
    return learnt


def familiarity(told: Mapping[str, float], learnt: Mapping[str, Mapping[str, float]]) -> float:
    """The chance (0 to 1) that a take is like the training, from its measures and what `fit_familiarity` learnt.

    Examples
    --------
    >>> learnt = fit_familiarity([{"residual": 0.1}, {"residual": 0.2}], [{"residual": 1.1}, {"residual": 1.3}])
    >>> familiarity({"residual": 0.1}, learnt) > 0.7 > 0.3 > familiarity({"residual": 1.3}, learnt)
    True
    """
    score = learnt["limit"]["offset"]
    for name in NAMES:
        value = told.get(name, float("nan"))
        if name in learnt and np.isfinite(value):
            of = learnt[name]
            score += of["slope"] * (value - of["mean"]) / of["scale"]
    return float(1.0 / (1.0 + np.exp(-score)))


def abstained(descriptors: Descriptors, segments: Segments, model: TrainedModel) -> Segments:
    """The segments with what is not the vocabulary's rest called `UNKNOWN`, where the take is unlike the training.

    Neighbouring unknown segments, and the transitions between them, are one. The history says how familiar the take is.

    Parameters
    ----------
    descriptors : Descriptors
    segments : Segments
        Labelled, with confidence.
    model : TrainedModel
        One without `card.familiarity` abstains from nothing.
    """
    learnt = model.card.familiarity
    if not learnt:
        return segments
    like = familiarity(measures(descriptors, segments, model), learnt)
    if like >= learnt["limit"]["least"]:
        return segments
    rest = model.card.vocabulary.rest
    stable = segments.table[segments.table["kind"] == "stable"]
    kept: list[dict] = []
    for row in stable.to_dict("records"):
        row["label"] = row["label"] if row["label"] == rest else UNKNOWN
        if kept and kept[-1]["label"] == row["label"]:
            last, length = kept[-1], [one["end_s"] - one["start_s"] for one in (kept[-1], row)]
            last["confidence"] = float(np.average([last["confidence"], row["confidence"]], weights=length))
            last["end_s"] = row["end_s"]
        else:
            kept.append(row)
    rows = kept[:1]
    for before, after in pairwise(kept):
        if model.card.vocabulary.transitions and after["start_s"] > before["end_s"]:
            moving = {"start_s": before["end_s"], "end_s": after["start_s"], "kind": "transition"}
            sure = before["confidence"] * after["confidence"]
            rows.append({**moving, "label": before["label"] + after["label"], "confidence": sure})
        rows.append(after)
    table = pd.DataFrame(rows, columns=["start_s", "end_s", "kind", "label", "confidence"])
    return segments.changed(
        f"{UNLIKE} {model.name} knows (familiarity {like:.0%}): {UNKNOWN} for what it would name", table
    )
