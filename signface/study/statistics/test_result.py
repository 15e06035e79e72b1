"""What a statistical test found, with its effect size and the conditions it did not meet.

- `TestResult`: one test.
- `untestable`: a test that could not be made, and why.
- `verdict`: an effect size in words.
- `holm`: p-values of several tests at once, corrected.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from signface.extras import needed

#: name: symbol and the bounds of a small, a medium and a large effect (Cohen 1988; Tomczak and Tomczak 2014).
EFFECTS = {
    "rho": ("ρ", (0.1, 0.3, 0.5)),
    "cramers_v": ("V", (0.1, 0.3, 0.5)),
    "epsilon_squared": ("ε²", (0.01, 0.06, 0.14)),
    "rank_biserial": ("r", (0.1, 0.3, 0.5)),
    "kendalls_w": ("W", (0.1, 0.3, 0.5)),
    "difference": ("Δ", None),
}


@dataclass(frozen=True)
class TestResult:
    """One statistical test.

    Parameters
    ----------
    test : str
        Its name.
    symbol : str
        Letter of its statistic.
    statistic, p : float
        NaN where the test cannot be made.
    n : int
        Answers, pairs or participants that entered it.
    df : int or None
        Degrees of freedom.
    effect_name : str
        Key of `EFFECTS`.
    effect : float
        The effect size, NaN where it cannot be computed.
    violated : tuple of str
        Conditions of validity (thesis table 6.1) that do not hold, in words.
    """

    __test__ = False  # pytest: this is no test of ours

    test: str
    symbol: str
    statistic: float
    p: float
    n: int
    df: int | None = None
    effect_name: str = "difference"
    effect: float = math.nan
    violated: tuple[str, ...] = ()

    @property
    def effect_symbol(self) -> str:
        """The letter of the effect size."""
        return EFFECTS[self.effect_name][0]


def untestable(test: str, symbol: str, n: int, why: str, *, effect_name: str = "difference") -> TestResult:
    """A test that could not be made: statistic and p are NaN, the reason is the violated condition."""
    return TestResult(test, symbol, math.nan, math.nan, n, None, effect_name, math.nan, (f"not made: {why}",))


def verdict(effect_name: str, effect: float) -> str:
    """`negligible`, `small`, `medium` or `large`, by the usual bounds; empty where there are none.

    >>> verdict("rank_biserial", -0.35)
    'medium'
    """
    bounds = EFFECTS[effect_name][1]
    if bounds is None or math.isnan(effect):
        return ""
    return ("negligible", "small", "medium", "large")[sum(abs(effect) >= bound for bound in bounds)]


def holm(p_values: ArrayLike) -> NDArray[np.float64]:
    """P-values corrected by Holm's step-down rule (Holm 1979), in the order given.

    Parameters
    ----------
    p_values : array_like (m,)
        NaN for tests that were not made: they stay NaN and are not counted.

    Returns
    -------
    ndarray (m,)

    Raises
    ------
    SignfaceError
        The extra `study` is not installed.

    Examples
    --------
    >>> holm([0.01, 0.04, 0.03, float("nan")]).round(6).tolist()
    [0.03, 0.06, 0.06, nan]
    """
    corrected = np.array(p_values, float)
    made = ~np.isnan(corrected)
    if made.any():
        corrected[made] = needed("statsmodels.stats.multitest", "study").multipletests(corrected[made], method="holm")[
            1
        ]
    return corrected
