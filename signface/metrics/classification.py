"""How well labels agree with a reference.

- `classification_metrics`: accuracy, macro F1 and confusion, beside chance and the majority class.
- `accuracy_interval`: how far the accuracy would move with other takes.
- `mcnemar`: whether two classifiers differ on the same items.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from signface.metrics.bootstrap import mean_interval


def classification_metrics(truth: Sequence[str], found: Sequence[str], labels: Sequence[str]) -> dict:
    """Accuracy and its company.

    Parameters
    ----------
    truth, found : (K,) sequences of str
        The reference's label of each item, and the label found.
    labels : sequence of str
        The vocabulary. It orders the confusion matrix.

    Returns
    -------
    dict
        - `accuracy`: share of items with the reference's label.
        - `balanced_accuracy`: share of right items of each label that the reference holds, averaged.
        - `macro_f1`: F1 of each label that the reference or the labels found hold, averaged.
        - `n`, `labels`, `confusion`: number of items, and `confusion[i][j]` items of label i that were called j.
        - `chance`: what a guess among the vocabulary gets, one over its size.
        - `majority`, `majority_label`: what calling everything the reference's most frequent label gets. It is
          a baseline that knows the test set, and so a hard one.

        The shares are None when there is no item.

    Raises
    ------
    ValueError
        The lengths differ, or an item is not of the vocabulary.

    Examples
    --------
    >>> scores = classification_metrics(["N", "N", "J"], ["N", "J", "J"], ["N", "J"])
    >>> round(scores["accuracy"], 3), scores["confusion"], scores["majority_label"]
    (0.667, [[1, 1], [0, 1]], 'N')
    """
    place = {label: index for index, label in enumerate(labels)}
    unknown = {str(item) for item in (*truth, *found)} - set(place)
    if len(truth) != len(found) or unknown:
        raise ValueError(f"labels do not match: {len(truth)} against {len(found)}, unknown {sorted(unknown)}")
    confusion = np.zeros((len(labels), len(labels)), dtype=int)
    np.add.at(confusion, ([place[item] for item in truth], [place[item] for item in found]), 1)
    total = int(confusion.sum())
    result: dict = {
        "accuracy": None,
        "balanced_accuracy": None,
        "macro_f1": None,
        "n": total,
        "labels": list(labels),
        "confusion": confusion.tolist(),
        "chance": 1 / len(labels),
        "majority": None,
        "majority_label": None,
    }
    if total:
        hits, called, there = np.diag(confusion), confusion.sum(axis=0), confusion.sum(axis=1)
        present = called + there > 0
        most = int(there.argmax())
        result |= {
            "accuracy": float(hits.sum() / total),
            "balanced_accuracy": float((hits[there > 0] / there[there > 0]).mean()),
            "macro_f1": float((2 * hits[present] / (called + there)[present]).mean()),
            "majority": float(there[most] / total),
            "majority_label": labels[most],
        }
    return result


def accuracy_interval(
    hits: Sequence[bool], takes: Sequence[str], *, seed: int = 0, draws: int = 1000, level: float = 0.95
) -> tuple[float, float] | None:
    """Interval of the accuracy when whole takes are drawn again with replacement (a cluster bootstrap).

    Parameters
    ----------
    hits : (K,) sequence of bool
        Whether each item was labelled right.
    takes : (K,) sequence of str
        The take of each item.
    seed, draws, level : optional
        Seed and number of draws; share of them inside the interval.

    Returns
    -------
    (low, high), or None with fewer than two takes.

    See Also
    --------
    signface.metrics.bootstrap.mean_interval : the same for any mean.
    """
    names, index = np.unique(np.asarray(takes, dtype=str), return_inverse=True)
    if len(names) < 2:
        return None
    right = np.bincount(index, weights=np.asarray(hits, dtype=float), minlength=len(names))
    count = np.bincount(index, minlength=len(names))
    return mean_interval(right, count, seed=seed, draws=draws, level=level)


def mcnemar(first: Sequence[bool], second: Sequence[bool]) -> dict:
    """McNemar's exact test of two classifiers on the same items (McNemar 1947; binomial, two-sided).

    Only the items that one gets right and the other wrong count. Items of one take are alike, so that the p value is
    smaller than it should be; it is to be read beside the intervals over takes.

    Parameters
    ----------
    first, second : (K,) sequences of bool
        Whether each item was labelled right by the one and the other.

    Returns
    -------
    dict
        `only_first`, `only_second` (counts) and `p`.

    Raises
    ------
    ValueError
        The lengths differ.

    Examples
    --------
    >>> mcnemar([True] * 6 + [False], [False] * 6 + [False])
    {'only_first': 6, 'only_second': 0, 'p': 0.03125}
    """
    from scipy.stats import binomtest

    if len(first) != len(second):
        raise ValueError(f"{len(first)} items against {len(second)}")
    one, other = np.asarray(first, bool), np.asarray(second, bool)
    only_first, only_second = int((one & ~other).sum()), int((other & ~one).sum())
    count = only_first + only_second
    p = float(binomtest(only_first, count).pvalue) if count else 1.0
    return {"only_first": only_first, "only_second": only_second, "p": p}
