"""What a study of this size could have found, and how many participants the next one needs.

- `power_table`: for every question and pair of methods.
- `smallest_difference`, `participants_needed`: the two computations.

They speak of the comparison of two methods over participants' means. The spread of the differences is the study's own;
the study's own difference plays no part, since the power to find what was found says nothing that p does not.
"""

from __future__ import annotations

import math
from itertools import combinations

import pandas as pd

from signface.extras import needed
from signface.study.responses import Responses
from signface.study.statistics.tables import StudyTable
from signface.study.statistics.thesis_tables import participant_means

#: The chance to find a difference that the table asks for.
POWER = 0.8

#: Wilcoxon's efficiency against Student's test on normal differences, 3/π (Hodges and Lehmann 1956).
EFFICIENCY = 3 / math.pi

#: Differences whose number of participants is given: points of the scale, and shares recognised.
POINTS = (0.25, 0.5)
SHARES = (0.05, 0.10)


def smallest_difference(spread: float, participants: int, *, alpha: float = 0.05, power: float = POWER) -> float:
    """The difference of means that Wilcoxon's test over participants finds with the given power.

    Parameters
    ----------
    spread : float
        Standard deviation of the participants' differences.
    participants : int
    alpha, power : float

    Returns
    -------
    float
        In the unit of `spread`; NaN with fewer than three participants or no spread.
    """
    if participants < 3 or not spread > 0:
        return math.nan
    solver = needed("statsmodels.stats.power", "study").TTestPower()
    effect = solver.solve_power(effect_size=None, nobs=participants * EFFICIENCY, alpha=alpha, power=power)
    return float(effect) * spread


def participants_needed(difference: float, spread: float, *, alpha: float = 0.05, power: float = POWER) -> int | None:
    """How many participants find a difference with the given power; None where there is no spread to go by.

    Parameters
    ----------
    difference, spread : float
        Difference of means, and standard deviation of the participants' differences.
    alpha, power : float
    """
    if not spread > 0 or not difference > 0:
        return None
    solver = needed("statsmodels.stats.power", "study").TTestPower()
    effect = difference / spread
    if effect > 3:  # the solver has no root there; three participants with differences that large are enough
        return 3
    pairs_needed = solver.solve_power(effect_size=effect, nobs=None, alpha=alpha, power=power)
    return max(3, math.ceil(float(pairs_needed) / EFFICIENCY))


def power_table(responses: Responses, *, alpha: float = 0.05) -> StudyTable:
    """What could have been found, and the participants needed for a small and a middling difference."""
    rows = []
    for column, name in responses.questions.items():
        means = participant_means(responses, column)
        wanted = SHARES if column == "correct" else POINTS
        for first, second in combinations(list(means), 2):
            differences = (means[first] - means[second]).dropna()
            spread = float(differences.std(ddof=1)) if len(differences) > 1 else math.nan
            needs = [participants_needed(difference, spread, alpha=alpha) for difference in wanted]
            rows.append(
                {
                    "question": name,
                    "pair": f"{first} – {second}",
                    "participants": len(differences),
                    "spread of differences": spread,
                    "found with 80 %": smallest_difference(spread, len(differences), alpha=alpha),
                    "participants for a small difference": _wanted(needs[0], wanted[0]),
                    "participants for twice that": _wanted(needs[1], wanted[1]),
                }
            )
    return StudyTable(
        "power",
        "Smallest difference that would be found, and participants needed",
        pd.DataFrame(rows),
        {"participants": "count"},
        notes=(
            f"Wilcoxon's test over participants' means at the level {alpha:g} with a power of {POWER:.0%}, uncorrected "
            "for several pairs; the spread is this study's own, its difference plays no part.",
        ),
    )


def _wanted(participants: int | None, difference: float) -> str:
    return "–" if participants is None else f"{participants} (for {difference:g})"
