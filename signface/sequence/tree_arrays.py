"""Boosted trees as plain arrays: what scikit-learn learnt, judged and kept without it.

- `tree_arrays`: the arrays of a fitted `HistGradientBoostingClassifier`.
- `tree_probabilities`: its probabilities, from them.
"""

from __future__ import annotations

from typing import Any

import numpy as np


def tree_arrays(trees: Any) -> dict[str, np.ndarray]:
    """The trees of a fitted `HistGradientBoostingClassifier` of numbers without NaN.

    Returns
    -------
    dict
        `feature` (T, N) int32, -1 at leaves; `threshold` (T, N) float64, what is not above goes left; `left` and
        `right` (T, N) int32; `value` (T, N) float64; `baseline` (K,) float64 of the K classes that trees take turns
        for (one where there are two labels).
    """
    every = [tree.nodes for turn in trees._predictors for tree in turn]
    most = max(map(len, every))
    arrays: dict[str, np.ndarray] = {
        "feature": np.full((len(every), most), -1, dtype=np.int32),
        "threshold": np.zeros((len(every), most)),
        "left": np.zeros((len(every), most), dtype=np.int32),
        "right": np.zeros((len(every), most), dtype=np.int32),
        "value": np.zeros((len(every), most)),
    }
    for row, nodes in enumerate(every):
        inner = nodes["is_leaf"] == 0
        arrays["feature"][row, : len(nodes)] = np.where(inner, nodes["feature_idx"], -1)
        arrays["threshold"][row, : len(nodes)] = np.where(inner, nodes["num_threshold"], 0.0)
        for name in ("left", "right", "value"):
            arrays[name][row, : len(nodes)] = nodes[name]
    return {**arrays, "baseline": np.asarray(trees._baseline_prediction, dtype=np.float64).ravel()}


def tree_probabilities(arrays: dict[str, np.ndarray], features: np.ndarray) -> np.ndarray:
    """(K, A) probabilities of the A labels for (K, N) features."""
    feature, threshold, value = arrays["feature"], arrays["threshold"], arrays["value"]
    rows = np.arange(len(features))
    turns = len(arrays["baseline"])
    raw = np.tile(arrays["baseline"], (len(features), 1))
    for tree in range(len(feature)):
        node = np.zeros(len(features), dtype=np.int32)
        while True:
            chosen = feature[tree, node]
            inner = chosen >= 0
            if not inner.any():
                break
            goes_left = features[rows, np.maximum(chosen, 0)] <= threshold[tree, node]
            further = np.where(goes_left, arrays["left"][tree, node], arrays["right"][tree, node])
            node = np.where(inner, further, node)
        raw[:, tree % turns] += value[tree, node]
    if turns == 1:
        sure = 1 / (1 + np.exp(-raw[:, 0]))
        return np.column_stack([1 - sure, sure])
    raw -= raw.max(axis=1, keepdims=True)
    odds = np.exp(raw)
    return odds / odds.sum(axis=1, keepdims=True)
