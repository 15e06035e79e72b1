"""Confidences that mean what they say: of the labels given with 0.8, eight in ten should be right.

- `fit_calibration`: a slope and an offset that make them so, from labels of takes that were left out.
- `calibrated`: confidences by these.
- `expected_calibration_error`, `brier_score`: how far they are from it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

#: No confidence is nearer to 0 or 1 than this before it is calibrated: a vote of five frames is no certainty.
LEAST = 0.01

#: How many bins of equal size the expected calibration error is counted in.
BINS = 10


def calibrated(raw: np.ndarray, calibration: Mapping[str, float]) -> np.ndarray:
    """(S,) confidences: a line through the log odds of the raw ones (Platt 2000); the raw ones without a calibration.

    Parameters
    ----------
    raw : (S,) array
        Mean probability that the classifier gives to the label it chose.
    calibration : mapping
        `slope` and `offset`, or nothing.
    """
    if not calibration:
        return raw.copy()
    return 1 / (1 + np.exp(-(calibration["slope"] * _log_odds(raw) + calibration["offset"])))


def fit_calibration(raw: np.ndarray, hits: np.ndarray, groups: Sequence[str]) -> dict[str, float]:
    """Slope and offset of the log odds, if they help.

    They are judged on groups that they were not fitted on: each group in turn is calibrated by the others.

    Parameters
    ----------
    raw : (S,) array
        Mean probability of the label chosen, for segments of takes that the classifier was not trained on.
    hits : (S,) array of bool
        Whether the label was right.
    groups : (S,) sequence of str
        The take, or the signer, of each.

    Returns
    -------
    dict
        `slope`, `offset`, and the expected calibration error and Brier score of groups left out, `ece_before`,
        `ece_after`, `brier_before`, `brier_after`. Empty where the error does not become smaller, or where there is
        nothing to learn from: fewer than two groups, or all right, or all wrong.
    """
    raw, hits, who = np.asarray(raw, float), np.asarray(hits, bool), np.asarray(groups, dtype=str)
    names = np.unique(who)
    if len(names) < 2:
        return {}
    after = np.full(len(raw), np.nan)
    for part in np.array_split(names, min(5, len(names))):
        left = np.isin(who, part)
        if len(set(hits[~left])) < 2:
            return {}
        after[left] = calibrated(raw[left], _fit(raw[~left], hits[~left]))
    measured = {
        "ece_before": expected_calibration_error(raw, hits),
        "ece_after": expected_calibration_error(after, hits),
        "brier_before": brier_score(raw, hits),
        "brier_after": brier_score(after, hits),
    }
    if measured["ece_after"] >= measured["ece_before"]:
        return {}
    return {**_fit(raw, hits), **measured}


def _fit(raw: np.ndarray, hits: np.ndarray) -> dict[str, float]:
    from sklearn.linear_model import LogisticRegression

    # A little shrinkage keeps the line from becoming a step where takes are few.
    line = LogisticRegression(C=10.0).fit(_log_odds(raw)[:, None], hits)
    # Surer must not come out as less sure, whatever a few segments say.
    slope = max(float(line.coef_[0, 0]), 0.05)
    return {"slope": slope, "offset": float(line.intercept_[0])}


def _log_odds(raw: np.ndarray) -> np.ndarray:
    bounded = np.clip(raw, LEAST, 1 - LEAST)
    return np.log(bounded / (1 - bounded))


def expected_calibration_error(confidence: np.ndarray, hits: np.ndarray, *, bins: int = BINS) -> float:
    """Mean distance between confidence and share of right labels, over bins of equally many segments.

    Naeini et al. (2015), with bins of equal size: of equal width, most of them would hold next to nothing.
    NaN without segments.

    Examples
    --------
    >>> expected_calibration_error(np.array([0.5, 0.5, 0.5, 0.5]), np.array([True, False, True, False]))
    0.0
    """
    confidence, hits = np.asarray(confidence, float), np.asarray(hits, float)
    if not len(hits):
        return float("nan")
    limits = np.quantile(confidence, np.linspace(0, 1, bins + 1)[1:-1])
    code = np.searchsorted(limits, confidence)  # equal confidences share a bin
    distance = [np.abs((confidence - hits)[code == part].sum()) for part in np.unique(code)]
    return float(np.sum(distance) / len(hits))


def brier_score(confidence: np.ndarray, hits: np.ndarray) -> float:
    """Mean squared distance between the confidence in a label and its being right (1) or wrong (0); NaN without any.

    Examples
    --------
    >>> brier_score(np.array([1.0, 0.5]), np.array([True, False]))
    0.125
    """
    if not len(hits):
        return float("nan")
    return float(np.mean((np.asarray(confidence, float) - np.asarray(hits, float)) ** 2))
