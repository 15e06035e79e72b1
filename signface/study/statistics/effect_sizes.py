"""Effect sizes of the non-parametric tests of thesis table 6.1.

- `cramers_v`: association in a contingency table.
- `epsilon_squared`: share of the variance of ranks that groups explain.
- `rank_biserial`: balance of positive and negative signed ranks.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def cramers_v(chi2: float, n: int, shape: tuple[int, int]) -> float:
    """Cramér's V, 0 to 1: √(χ² / (n (min(rows, columns) − 1))).

    Parameters
    ----------
    chi2 : float
        Pearson's statistic without Yates' correction.
    n : int
        Observations.
    shape : tuple of int
        Rows and columns of the table (Cramér, *Mathematical Methods of Statistics*, 1946, section 21.9).
    """
    return float(np.sqrt(chi2 / (n * (min(shape) - 1))))


def epsilon_squared(h: float, n: int) -> float:
    """ε² = H / (n − 1), 0 to 1 (Tomczak and Tomczak 2014), for Kruskal and Wallis and each line of Scheirer-Ray-Hare.

    With H corrected for ties it is exactly the share of the sum of squares of ranks that the groups explain.
    """
    return float(h / (n - 1))


def rank_biserial(differences: ArrayLike) -> float:
    """Matched-pairs rank-biserial correlation, −1 to 1 (Kerby 2014): (W₊ − W₋) / (W₊ + W₋).

    Parameters
    ----------
    differences : array_like (n,)
        First minus second of each pair; zeros are dropped. NaN when none is left.
    """
    from scipy.stats import rankdata

    values = np.asarray(differences, float)
    values = values[values != 0]
    if not len(values):
        return float("nan")
    ranks = rankdata(np.abs(values))
    return float((ranks * np.sign(values)).sum() / ranks.sum())
