"""Tests on counts: recognised or not, by method, by participant, by pair (thesis table 6.1, test 2).

- `chi_square`: independence in a contingency table, with Yates' correction for 2 × 2.
- `mcnemar`: two paired proportions; `cochran`: more than two.
- `counts_of_proportion`: the counts that a published, rounded proportion allows.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from signface.metrics import classification
from signface.study.statistics.effect_sizes import cramers_v
from signface.study.statistics.test_result import TestResult, untestable

#: Least expected count of the thesis's table 6.1.
LEAST_EXPECTED = 5


def chi_square(counts: ArrayLike) -> TestResult:
    """Pearson's χ² on a contingency table, Yates' correction for 2 × 2; effect size Cramér's V (uncorrected χ²).

    Parameters
    ----------
    counts : array_like (rows, columns)
        Observed counts. Rows and columns without any count are left out. The condition is an expected count of at
        least 5 in every cell.

    Examples
    --------
    >>> round(chi_square([[304, 182], [303, 183], [293, 193]]).statistic, 3)
    0.645
    """
    table = np.asarray(counts, float)
    table = table[table.sum(axis=1) > 0][:, table.sum(axis=0) > 0]
    name, n = "χ²", int(table.sum())
    if min(table.shape) < 2:
        return untestable(name, "χ²", n, "one row or one column of counts", effect_name="cramers_v")
    chi2, p, df, expected = stats.chi2_contingency(table, correction=table.shape == (2, 2))
    plain = stats.chi2_contingency(table, correction=False)[0]
    least = expected.min()
    violated = (f"an expected count of {least:.1f} < {LEAST_EXPECTED}",) if least < LEAST_EXPECTED else ()
    return TestResult(
        name + (" (Yates)" if table.shape == (2, 2) else ""),
        "χ²",
        float(chi2),
        float(p),
        n,
        int(df),
        "cramers_v",
        cramers_v(plain, n, table.shape),
        violated,
    )


def mcnemar(first: ArrayLike, second: ArrayLike) -> TestResult:
    """McNemar's exact test on paired right (1) or wrong (0) answers; effect: difference of the two proportions.

    Parameters
    ----------
    first, second : array_like (n,)
        NaN where missing. The statistic is the number of pairs that only `first` got right, out of `n` pairs that
        differ: exact, so that it has no condition on effectives.
    """
    one, other = np.asarray(first, float), np.asarray(second, float)
    kept = np.isin(one, (0, 1)) & np.isin(other, (0, 1))
    one, other = one[kept] == 1, other[kept] == 1
    counts = classification.mcnemar(one, other)
    n = counts["only_first"] + counts["only_second"]
    if not n:
        return untestable("McNemar", "b", len(one), "no pair differs")
    difference = float(one.mean() - other.mean())
    return TestResult("McNemar", "b", float(counts["only_first"]), counts["p"], n, None, "difference", difference)


def cochran(blocks: ArrayLike) -> TestResult:
    """Cochran's Q: three or more paired proportions.

    Parameters
    ----------
    blocks : array_like (pairs, methods)
        Right (1) or wrong (0); rows with a NaN, or where all methods agree, tell nothing and are left out. The
        condition is 24 informative answers, that is rows that do not agree times methods (Tate and Brown 1970).
    """
    table = np.asarray(blocks, float)
    table = table[~np.isnan(table).any(axis=1)]
    k = table.shape[1] if table.ndim == 2 else 0
    if k < 3:
        return untestable("Cochran", "Q", len(table), "it needs three methods")
    table = table[np.ptp(table, axis=1) > 0] if len(table) else table
    n = len(table)
    if not n:
        return untestable("Cochran", "Q", 0, "all methods agree everywhere")
    columns, rows = table.sum(axis=0), table.sum(axis=1)
    q = (k - 1) * (k * (columns**2).sum() - columns.sum() ** 2) / (k * rows.sum() - (rows**2).sum())
    violated = (f"{n * k} < 24 informative answers",) if n * k < 24 else ()
    return TestResult(
        "Cochran", "Q", float(q), float(stats.chi2.sf(q, k - 1)), n, k - 1, "difference", math.nan, violated
    )


def counts_of_proportion(proportion: float, n: int, *, decimals: int = 3) -> list[int]:
    """The counts out of `n` whose proportion, rounded to `decimals`, is the one published.

    Parameters
    ----------
    proportion : float
        As printed.
    n : int
        The denominator.
    decimals : int
        How many decimals were printed.

    Returns
    -------
    list of int
        Empty where no count gives that proportion: the publication rounds otherwise, or its denominator is another.

    Examples
    --------
    >>> counts_of_proportion(0.626, 486)
    [304]
    >>> counts_of_proportion(0.82, 378, decimals=2)
    [309, 310, 311]
    """
    half = 0.5 * 10**-decimals
    low, high = math.ceil((proportion - half) * n - 1e-9), math.floor((proportion + half) * n + 1e-9)
    return [count for count in range(max(0, low), min(n, high) + 1)]
