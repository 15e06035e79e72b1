"""The rank tests of thesis table 6.1, with ties corrected, effect sizes and their conditions checked.

- `spearman`: does an answer rise or fall with an ordered factor?
- `kruskal_wallis`: is an answer distributed alike in all groups?
- `scheirer_ray_hare`: the same with two factors and their interaction.
- `wilcoxon`: do paired answers differ?
- `friedman`: do more than two paired answers differ? (over participants' means)
- `dunn`: which groups differ, after Kruskal and Wallis.

Answers that are NaN, or whose factor is missing, are left out. A test that cannot be made says why in `violated`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from signface.study.statistics.effect_sizes import epsilon_squared, rank_biserial
from signface.study.statistics.test_result import TestResult, untestable

#: Least effectives of the thesis's table 6.1.
LEAST_IN_GROUP = 5
LEAST_PAIRS = 20

#: Below this share of the variation between levels that a monotone curve explains, Spearman's condition is doubted.
LEAST_MONOTONE_SHARE = 0.5


def spearman(factor: ArrayLike, answers: ArrayLike, *, persons: ArrayLike | None = None) -> TestResult:
    """Spearman's rank correlation of an answer with an ordered factor (table 6.1, test 1).

    Parameters
    ----------
    factor, answers : array_like (n,)
        NaN where missing.
    persons : array_like (n,), optional
        Who answered, for a factor that belongs to persons: the condition is then checked on one mean per person, since
        the persons of a level differ from those of another by more than the factor.

    Returns
    -------
    TestResult
        The statistic and the effect size are ρ. Its condition, a monotone relation, is doubted when the means of
        ranks by level of the factor differ, and less than half of what differs follows a monotone curve.

    Examples
    --------
    >>> spearman([1, 2, 3, 4], [2, 4, 5, 9]).statistic
    1.0
    """
    x, y = np.asarray(factor, float), np.asarray(answers, float)
    kept = ~(np.isnan(x) | np.isnan(y))
    x, y = x[kept], y[kept]
    name, n = "Spearman", len(x)
    if n < 3 or np.ptp(x) == 0 or np.ptp(y) == 0:
        why = "fewer than 3 answers" if n < 3 else "constant answers" if np.ptp(x) else "constant factor"
        return untestable(name, "ρ", n, why, effect_name="rho")
    rho, p = stats.spearmanr(x, y)
    if persons is not None:
        who = np.unique(np.asarray(persons).astype(str)[kept], return_inverse=True)[1]
        sizes = np.bincount(who)
        x, y = np.bincount(who, x) / sizes, np.bincount(who, y) / sizes
    share = monotone_share(x, y)
    violated: tuple[str, ...] = ()
    if share < LEAST_MONOTONE_SHARE:
        violated = (f"not monotone: a monotone curve explains {share:.0%} of what differs between levels",)
    return TestResult(name, "ρ", float(rho), float(p), n, n - 2, "rho", float(rho), violated)


def monotone_share(factor: ArrayLike, answers: ArrayLike) -> float:
    """Share of the differences of mean ranks between levels of a factor that a monotone curve explains, 0 to 1.

    1 where there is nothing to explain: fewer than three levels, or levels that Kruskal and Wallis' test does not
    tell apart at 5 %, since a share of noise says nothing.

    Parameters
    ----------
    factor, answers : array_like (n,)
        Without NaN.
    """
    from scipy.stats import rankdata
    from sklearn.isotonic import isotonic_regression

    x, ranks = np.asarray(factor, float), rankdata(answers)
    levels, place = np.unique(x, return_inverse=True)
    sizes = np.bincount(place).astype(float)
    if len(levels) < 3 or len(levels) == len(x):
        return 1.0
    if not kruskal_wallis([ranks[place == level] for level in range(len(levels))]).p < 0.05:
        return 1.0
    means = np.bincount(place, ranks) / sizes
    centred = means - ranks.mean()
    between = (sizes * centred**2).sum()
    left = min(
        (sizes * (means - isotonic_regression(means, sample_weight=sizes, increasing=rising)) ** 2).sum()
        for rising in (True, False)
    )
    return float(1 - left / between)


def kruskal_wallis(groups: Sequence[ArrayLike]) -> TestResult:
    """Kruskal and Wallis' test with ties corrected (table 6.1, test 3); effect size ε².

    Parameters
    ----------
    groups : sequence of array_like
        The answers of each level of the factor. The condition is at least 5 answers in each.
    """
    name = "Kruskal-Wallis"
    arrays = [values[~np.isnan(values)] for values in (np.asarray(group, float) for group in groups)]
    arrays = [values for values in arrays if len(values)]
    n = sum(map(len, arrays))
    if len(arrays) < 2:
        return untestable(name, "H", n, "fewer than two groups", effect_name="epsilon_squared")
    if np.ptp(np.concatenate(arrays)) == 0:
        return untestable(name, "H", n, "constant answers", effect_name="epsilon_squared")
    h, p = stats.kruskal(*arrays)
    least = min(map(len, arrays))
    violated = (f"a group of {least} < {LEAST_IN_GROUP} answers",) if least < LEAST_IN_GROUP else ()
    return TestResult(
        name, "H", float(h), float(p), n, len(arrays) - 1, "epsilon_squared", epsilon_squared(h, n), violated
    )


def scheirer_ray_hare(
    answers: ArrayLike, first: ArrayLike, second: ArrayLike
) -> tuple[TestResult, TestResult, TestResult]:
    """Scheirer, Ray and Hare's test: two factors and their interaction on ranks (table 6.1, test 4).

    The answers are ranked together (ties share their mean rank), the sums of squares of a two-way analysis of
    variance of the ranks are divided by the total mean square of the ranks, and each quotient H is referred to χ².
    The total mean square is computed from the ranks themselves, which corrects for ties: it equals
    N(N+1)/12 · D with D = 1 − Σ(t³−t)/(N³−N). Where cells differ in size, the sums of squares are of type II, each
    factor adjusted for the other, so that the order of the factors does not matter.

    Parameters
    ----------
    answers : array_like (n,)
    first, second : array_like (n,)
        Levels of the two factors, any labels; None or NaN where missing.

    Returns
    -------
    three TestResult
        First factor, second factor, interaction; effect sizes ε². The condition is 5 answers in each cell; with an
        empty cell the test is not made.

    Notes
    -----
    Scheirer, Ray and Hare, "The analysis of ranked data derived from completely randomized factorial designs",
    *Biometrics* 32 (1976) 429-434; Sokal and Rohlf, *Biometry*, 3rd edition (1995), section 13.12.
    """
    data = pd.DataFrame({"y": np.asarray(answers, float), "a": np.asarray(first), "b": np.asarray(second)}).dropna()
    name, n = "Scheirer-Ray-Hare", len(data)

    def none(why: str) -> tuple[TestResult, TestResult, TestResult]:
        nothing = untestable(name, "H", n, why, effect_name="epsilon_squared")
        return nothing, nothing, nothing

    if n == 0 or data["a"].nunique() < 2 or data["b"].nunique() < 2:
        return none("a factor with one level")
    if np.ptp(data["y"]) == 0:
        return none("constant answers")
    cells = pd.crosstab(data["a"], data["b"])
    if cells.to_numpy().min() == 0:
        return none("an empty cell")

    ranks = stats.rankdata(data["y"])
    a, b = _dummies(data["a"]), _dummies(data["b"])
    crossed = (a[:, :, None] * b[:, None, :]).reshape(n, -1)
    mean_square = ranks.var(ddof=1)
    both = _residual(np.hstack([a, b]), ranks)
    squares = (_residual(b, ranks) - both, _residual(a, ranks) - both, both - _residual(crossed, ranks))
    levels_a, levels_b = cells.shape
    freedom = (levels_a - 1, levels_b - 1, (levels_a - 1) * (levels_b - 1))
    least = int(cells.to_numpy().min())
    violated = (f"a cell of {least} < {LEAST_IN_GROUP} answers",) if least < LEAST_IN_GROUP else ()
    results = []
    for square, df in zip(squares, freedom):
        h = max(0.0, float(square / mean_square))
        p = float(stats.chi2.sf(h, df))
        results.append(TestResult(name, "H", h, p, n, df, "epsilon_squared", epsilon_squared(h, n), violated))
    return results[0], results[1], results[2]


def _dummies(labels: Sequence[object]) -> NDArray[np.float64]:
    """One column per level, (n, levels)."""
    place = np.unique(np.asarray(labels).astype(str), return_inverse=True)[1]
    return np.eye(place.max() + 1)[place]


def _residual(design: NDArray[np.float64], values: NDArray[np.float64]) -> float:
    """Sum of squares that a linear model leaves."""
    coefficients = np.linalg.lstsq(design, values, rcond=None)[0]
    return float(((values - design @ coefficients) ** 2).sum())


def wilcoxon(first: ArrayLike, second: ArrayLike) -> TestResult:
    """Wilcoxon's signed-rank test on pairs (table 6.1, test 5); effect size: matched-pairs rank-biserial.

    Parameters
    ----------
    first, second : array_like (n,)
        The two answers of each pair; pairs with a NaN are left out, pairs without difference too (Wilcoxon's own
        rule). The condition is at least 20 pairs that differ. The distribution is exact for up to 50 pairs without
        ties, normal otherwise, with ties corrected.

    Returns
    -------
    TestResult
        The statistic W is the smaller sum of ranks; `n` counts the pairs that differ; the effect is positive where
        `first` is larger.
    """
    differences = np.asarray(first, float) - np.asarray(second, float)
    differences = differences[~np.isnan(differences)]
    name, differing = "Wilcoxon", int((differences != 0).sum())
    if not len(differences):
        return untestable(name, "W", 0, "no pair", effect_name="rank_biserial")
    if not differing:
        return untestable(name, "W", 0, "no pair differs", effect_name="rank_biserial")
    differences = differences[differences != 0]
    w, p = stats.wilcoxon(np.round(differences, 10))  # rounded: means of 1 to 7 that tie must tie as floats too
    violated = (f"{differing} < {LEAST_PAIRS} pairs that differ",) if differing < LEAST_PAIRS else ()
    return TestResult(
        name,
        "W",
        float(w),
        float(p),
        differing,
        None,
        "rank_biserial",
        rank_biserial(np.round(differences, 10)),
        violated,
    )


def friedman(blocks: ArrayLike) -> TestResult:
    """Friedman's test: complete blocks, ties corrected; effect size Kendall's W.

    Parameters
    ----------
    blocks : array_like (participants, methods)
        A participant's mean answer by method. Rows with a NaN are left out. With two columns it is a sign test,
        weaker than Wilcoxon's.
    """
    table = np.asarray(blocks, float)
    table = np.round(table[~np.isnan(table).any(axis=1)], 10)
    name, (n, k) = "Friedman", table.shape
    if k < 3 or n < 2:
        return untestable(name, "χ²", n, "it needs three methods and two participants", effect_name="kendalls_w")
    if (np.ptp(table, axis=1) == 0).all():
        return untestable(name, "χ²", n, "constant answers", effect_name="kendalls_w")
    statistic, p = stats.friedmanchisquare(*table.T)
    violated = (f"{n} < 10 participants",) if n < 10 else ()
    return TestResult(
        name, "χ²", float(statistic), float(p), n, k - 1, "kendalls_w", float(statistic / (n * (k - 1))), violated
    )


def dunn(groups: Sequence[ArrayLike]) -> dict[tuple[int, int], TestResult]:
    """Dunn's comparisons of all pairs of groups after Kruskal and Wallis, ties corrected, p uncorrected.

    Parameters
    ----------
    groups : sequence of array_like
        As for `kruskal_wallis`, without empty groups.

    Returns
    -------
    dict of (i, j) to TestResult
        The statistic is z, positive where group i has the larger mean rank; the effect is the rank-biserial
        correlation of the two groups, 2 P(i > j) + P(i = j) − 1.

    Notes
    -----
    Dunn, "Multiple comparisons using rank sums", *Technometrics* 6 (1964) 241-252. With two groups z² is exactly
    the H of Kruskal and Wallis. Correct with `signface.study.statistics.test_result.holm`.
    """
    arrays = [values[~np.isnan(values)] for values in (np.asarray(group, float) for group in groups)]
    together = np.concatenate(arrays)
    variance = stats.rankdata(together).var(ddof=1) if len(together) > 1 else 0.0
    ranks = np.split(stats.rankdata(together), np.cumsum([len(values) for values in arrays])[:-1])
    results = {}
    for i, j in combinations(range(len(arrays)), 2):
        n = len(arrays[i]) + len(arrays[j])
        if variance == 0 or not len(arrays[i]) or not len(arrays[j]):
            results[i, j] = untestable("Dunn", "z", n, "constant answers", effect_name="rank_biserial")
            continue
        z = (ranks[i].mean() - ranks[j].mean()) / math.sqrt(variance * (1 / len(arrays[i]) + 1 / len(arrays[j])))
        above = stats.mannwhitneyu(arrays[i], arrays[j]).statistic / (len(arrays[i]) * len(arrays[j]))
        results[i, j] = TestResult(
            "Dunn", "z", float(z), float(2 * stats.norm.sf(abs(z))), n, None, "rank_biserial", float(2 * above - 1)
        )
    return results
