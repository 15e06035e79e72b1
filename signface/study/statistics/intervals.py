"""Bootstrap intervals over participants: how a mean would move with other participants.

- `participant_interval`: of one mean.
- `difference_intervals`: of the differences between methods.

Participants are drawn with replacement, each with all their answers (`signface.metrics.bootstrap`).
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pandas as pd

from signface.metrics.bootstrap import cluster_draws, mean_interval


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
    interval = mean_interval(each["sum"], each["size"], seed=seed, draws=resamples, level=level)
    return float(each["sum"].sum() / each["size"].sum()), *interval


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
    weights = cluster_draws(len(people), resamples, seed=seed)
    means, whole = {}, {}
    for method in methods:
        each = (
            kept[kept["method"] == method].groupby("participant")[column].agg(["sum", "size"]).reindex(people).fillna(0)
        )
        with np.errstate(invalid="ignore", divide="ignore"):
            means[method] = (weights @ each["sum"].to_numpy()) / (weights @ each["size"].to_numpy())
            whole[method] = np.float64(each["sum"].sum()) / np.float64(each["size"].sum())
    tail, intervals = 50 * (1 - level), {}
    for first, second in combinations(methods, 2):
        differences = means[first] - means[second]
        differences = differences[np.isfinite(differences)]
        low, high = np.percentile(differences, [tail, 100 - tail]) if len(differences) else (np.nan, np.nan)
        intervals[first, second] = (float(whole[first] - whole[second]), float(low), float(high))
    return intervals
