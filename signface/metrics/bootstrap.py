"""Intervals that hold what belongs together together: the cluster bootstrap.

- `cluster_draws`: how often each cluster is drawn in each resample.
- `mean_interval`: interval of a mean over items, with whole clusters drawn again.

Items of one cluster (the segments of a take, the answers of a participant) are alike, so that the usual interval of a
mean would be far too narrow. The intervals are percentiles; with fewer than some 20 clusters they are a little too
short (Davison and Hinkley, Bootstrap Methods and their Application, 1997, section 3.8).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def cluster_draws(clusters: int, draws: int, *, seed: int = 0) -> np.ndarray:
    """(draws, clusters) how often each cluster is drawn when as many as there are are drawn with replacement.

    Parameters
    ----------
    clusters, draws : int
    seed : int
        The same seed, the same draws.
    """
    drawn = np.random.default_rng(seed).integers(clusters, size=(draws, clusters))
    offsets = clusters * np.arange(draws)[:, None]
    return np.bincount((drawn + offsets).ravel(), minlength=draws * clusters).reshape(draws, clusters).astype(float)


def mean_interval(
    sums: ArrayLike, counts: ArrayLike, *, seed: int = 0, draws: int = 1000, level: float = 0.95
) -> tuple[float, float]:
    """Interval of a mean over items.

    Parameters
    ----------
    sums, counts : (C,) array_like
        Sum of the items of each cluster, and their number (at least one).
    seed, draws, level : optional
        Seed and number of draws; share of them inside the interval.

    Returns
    -------
    low, high : float

    Examples
    --------
    >>> mean_interval([3, 3, 3], [6, 6, 6])
    (0.5, 0.5)
    """
    times = cluster_draws(len(np.asarray(sums)), draws, seed=seed)
    means = (times @ np.asarray(sums, float)) / (times @ np.asarray(counts, float))
    low, high = np.quantile(means, [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)
