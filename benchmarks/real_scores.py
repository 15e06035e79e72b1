"""How close what was found is to what is annotated, with intervals over signers; for `benchmarks.real`.

- `best_of_others`: which of several ways agrees best with the annotators of the signers who are not judged.
- `judged_sentences`: what was found in whole takes. `judged_labels`: labels of given segments.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from signface.label.vocabulary import NONE
from signface.learn.examples import Example
from signface.metrics.agreement import match_annotations
from signface.metrics.bootstrap import cluster_draws

FRAME_S, DRAWS = 0.04, 2000

#: A fold: who is trained on, and who is judged.
Fold = tuple[list[Example], list[Example]]


def frame_counts(example: Example, table: pd.DataFrame, order: list[str]) -> np.ndarray:
    """(L, L) frames of a take by what is annotated and what was found; frames that nothing is said of are left out."""
    take = example.descriptors
    times = np.arange(take.start + FRAME_S / 2, take.start + take.duration, FRAME_S)
    truth, said = (value_codes(t, times, order) for t in (example.reference.table, table))
    counts = np.zeros((len(order), len(order)))
    np.add.at(counts, (truth[truth >= 0], np.maximum(said, 0)[truth >= 0]), 1)
    return counts


def best_of_others(folds: list[Fold], tried: list[dict[str, pd.DataFrame]], label: str) -> list[int]:
    """For each fold the number of the way that agrees best (kappa of frames) with the annotators of its first side.

    `tried` holds for each way what it finds in each take, by name.
    """
    everyone = list({e.take: e for fold in folds for side in fold for e in side}.values())
    counts = np.array([[frame_counts(e, found[e.take], [NONE, label]) for e in everyone] for found in tried])
    rows = {e.take: row for row, e in enumerate(everyone)}
    return [int(np.nanargmax(kappas(counts[:, [rows[e.take] for e in train]].sum(axis=1)))) for train, _ in folds]


def judged_sentences(
    found: list[tuple[Example, pd.DataFrame]], labels: Sequence[str]
) -> dict[str, tuple[float, float, float]]:
    """Kappa and F1 of frames, F1 of segments, false alarms in takes without any, with intervals over signers."""
    order = [NONE, *labels]
    signers = sorted({example.signer for example, _ in found})
    counts = np.zeros((len(signers), len(order), len(order)))
    segments, alarms = np.zeros((len(signers), 3)), np.zeros((len(signers), 2))
    for example, table in found:
        row = signers.index(example.signer)
        counts[row] += frame_counts(example, table, order)
        true, hit = (t[t["label"].isin(labels)] for t in (example.reference.table, table))
        for label in labels:
            a, b = (t[t["label"] == label].reset_index(drop=True) for t in (true, hit))
            segments[row] += (len(match_annotations(a, b, overlap=0.5)), len(a), len(b))
        if not len(true):
            alarms[row] += (len(hit) > 0, 1)
    times = np.concatenate([np.ones((1, len(signers))), cluster_draws(len(signers), DRAWS)])
    drawn = np.einsum("ds,sij->dij", times, counts)
    parts, alarm = times @ segments, times @ alarms
    with np.errstate(invalid="ignore", divide="ignore"):
        values = {
            "kappa": kappas(drawn),
            "F1 frames": macro_f1(drawn),
            "F1 segments": 2 * parts[:, 0] / (parts[:, 1] + parts[:, 2]),
            "false alarms": alarm[:, 0] / alarm[:, 1],
        }
    return {name: interval(value) for name, value in values.items() if np.isfinite(value[0])}


def value_codes(table: pd.DataFrame, times: np.ndarray, order: list[str]) -> np.ndarray:
    """(K,) place in `order` of what a table says at each time; -1 where it says nothing."""
    codes = np.full(len(times), -1)
    for start, end, label in table[["start_s", "end_s", "label"]].itertuples(index=False):
        codes[(times >= start) & (times < end)] = order.index(label) if label in order else 0
    return codes


def kappas(counts: np.ndarray) -> np.ndarray:
    """(D,) Cohen's kappa of (D, L, L) counts."""
    total = counts.sum(axis=(1, 2))
    agreed = np.trace(counts, axis1=1, axis2=2) / total
    chance = (counts.sum(axis=1) * counts.sum(axis=2)).sum(axis=1) / total**2
    return (agreed - chance) / (1 - chance)


def macro_f1(counts: np.ndarray) -> np.ndarray:
    """(D,) mean F1 over all labels but the first."""
    hit = np.diagonal(counts, axis1=1, axis2=2)[:, 1:]
    return (2 * hit / (counts.sum(axis=1) + counts.sum(axis=2))[:, 1:]).mean(axis=1)


def judged_labels(rows: list[tuple[str, str, str]]) -> dict:
    """Share of right labels, with its interval over signers."""
    signers = sorted({signer for signer, *_ in rows})
    right = np.array([sum(s == name and t == f for s, t, f in rows) for name in signers])
    total = np.array([sum(s == name for s, *_ in rows) for name in signers])
    times = np.concatenate([np.ones((1, len(signers))), cluster_draws(len(signers), DRAWS)])
    return {"right": interval((times @ right) / (times @ total)), "of": (float(total.sum()),) * 3}


def interval(values: np.ndarray) -> tuple[float, float, float]:
    """The value, and the ends of the middle 95 % of those drawn."""
    low, high = np.nanquantile(values[1:], [0.025, 0.975])
    return float(values[0]), float(low), float(high)
