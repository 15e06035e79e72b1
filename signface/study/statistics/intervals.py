"""Bootstrap intervals over participants: how a mean would move with other participants.

- `participant_interval`: of one mean.
- `difference_intervals`: of the differences between methods.

Participants are drawn with replacement, each with all their answers, so that the answers of one person stay together.
The intervals are percentiles at 95 %; with fewer than some 20 participants they are a little too short.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd


def participant_interval(
    table: pd.DataFrame, column: str, *, resamples: int = 2000, seed: int = 0, level: float = 0.95
) -> tuple[float, float, float]:
    """Mean of a column and its interval over participants.

    Parameters
    ----------
    table : pandas.DataFrame
        With `participant` and `column`; NaN are left out.
    column : str
    resamples, seed : int
    level : float
        Coverage.

    Returns
    -------
    mean, low, high : float
        All NaN where there is no answer.
    """
    each = table.dropna(subset=[column]).groupby("participant")[column].agg(["sum", "size"]).sort_index()
    if each.empty:
        return float("nan"), float("nan"), float("nan")
    weights = _draws(len(each), resamples, seed)
    means = (weights @ each["sum"].to_numpy()) / (weights @ each["size"].to_numpy())
    tail = 50 * (1 - level)
    low, high = np.percentile(means, [tail, 100 - tail])
    return float(each["sum"].sum() / each["size"].sum()), float(low), float(high)


def difference_intervals(
    table: pd.DataFrame, column: str, methods: list[str], *, resamples: int = 2000, seed: int = 0, level: float = 0.95
) -> dict[tuple[str, str], tuple[float, float, float]]:
    """Difference of means of every pair of methods (first minus second) and its interval over participants.

    Parameters
    ----------
    table : pandas.DataFrame
        With `participant`, `method` and `column`.
    column : str
    methods : list of str
    resamples, seed : int
    level : float

    Returns
    -------
    dict of (first, second) to (difference, low, high)
        A resample without any answer to a method is left out.
    """
    kept = table.dropna(subset=[column])
    people = sorted(kept["participant"].unique())
    weights = _draws(len(people), resamples, seed)
    means, whole = {}, {}
    for method in methods:
        each = (
            kept[kept["method"] == method].groupby("participant")[column].agg(["sum", "size"]).reindex(people).fillna(0)
        )
        with np.errstate(invalid="ignore", divide="ignore"):
            means[method] = (weights @ each["sum"].to_numpy()) / (weights @ each["size"].to_numpy())
            whole[method] = np.float64(each["sum"].sum()) / np.float64(each["size"].sum())
    tail, found = 50 * (1 - level), {}
    for first, second in combinations(methods, 2):
        differences = means[first] - means[second]
        differences = differences[np.isfinite(differences)]
        low, high = np.percentile(differences, [tail, 100 - tail]) if len(differences) else (np.nan, np.nan)
        found[first, second] = (float(whole[first] - whole[second]), float(low), float(high))
    return found


def _draws(people: int, resamples: int, seed: int) -> np.ndarray:
    """How often each participant is drawn in each resample, (resamples, people)."""
    return np.random.default_rng(seed).multinomial(people, np.full(people, 1 / people), size=resamples).astype(float)
