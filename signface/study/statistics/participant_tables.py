"""The tables of thesis appendix A about the participants and what the actor played.

- `influence_results`: every question against every factor (A.2 and A.5), also with one value per participant.
- `influence_table`, `influence_details`: laid out as in the thesis, and one row per test.
- `remarks_table`: what is significant, in words, with the reasons to doubt it (A.1 and A.7).
- `habit_table`, `group_table`: means by habit of avatars, and by vision problem or gender and intensity (A.1, A.8).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import pandas as pd

from signface.study.responses import FACTORS, PERSONAL, Responses
from signface.study.statistics.contingency import chi_square
from signface.study.statistics.rank_tests import kruskal_wallis, spearman
from signface.study.statistics.tables import StudyTable, write_cell, write_p
from signface.study.statistics.test_result import TestResult, holm
from signface.study.statistics.thesis_tables import RESULT_KINDS, result_cells, right_and_wrong

#: Factors with an order, on which Spearman's correlation is used; the others make groups.
ORDERED = ("age", "avatar_habit", "intensity")


@dataclass(frozen=True)
class Influence:
    """One question against one factor.

    Parameters
    ----------
    question, factor : str
        Columns.
    result : TestResult
        The thesis's test, over answers.
    over_participants : TestResult or None
        The same question asked of the participants' means, for a factor that belongs to the participant: there the
        answers of one person are not independent, and the test over answers finds too much.
    """

    question: str
    factor: str
    result: TestResult
    over_participants: TestResult | None


def influence_results(responses: Responses) -> list[Influence]:
    """Every question against every factor that varies, with the thesis's choice of tests (A.2, A.5).

    Accuracy with age and habit: Spearman on the participants' mean accuracy. Accuracy with other factors: χ².
    Scales with age, habit and played intensity: Spearman. Scales with other factors: Kruskal and Wallis.
    """
    influences = []
    factors = [factor for factor in (*PERSONAL, "intensity", "expression") if factor in responses.factors()]
    for question in responses.questions:
        for factor in factors:
            table = responses.table.dropna(subset=[question, factor])
            over = None
            if factor in PERSONAL and len(table):
                people = table.groupby("participant").agg({question: "mean", factor: "first"})
                if factor in ORDERED:
                    over = spearman(people[factor].astype(float), people[question])
                else:
                    over = kruskal_wallis([group[question] for _, group in people.groupby(factor)])
            if question == "correct":
                result = over if factor in ORDERED and over is not None else chi_square(right_and_wrong(table, factor))
            elif factor in ORDERED:
                persons = table["participant"] if factor in PERSONAL else None
                result = spearman(table[factor].astype(float), table[question], persons=persons)
            else:
                result = kruskal_wallis([group[question] for _, group in table.groupby(factor)])
            influences.append(Influence(question, factor, result, over))
    return influences


def influence_table(responses: Responses, results: list[Influence]) -> StudyTable:
    """Statistic and p of every question and factor (form of tables A.2 and A.5)."""
    rows: list[dict[tuple[str, str], object]] = []
    kinds: dict[str | tuple[str, str], str] = {}
    for question, name in responses.questions.items():
        row: dict[tuple[str, str], object] = {("", "question"): name}
        for influence in results:
            if influence.question == question:
                title, result = FACTORS[influence.factor], influence.result
                marked = question == "correct" and influence.factor in ("age", "avatar_habit")
                row[title, "statistic"] = (
                    "–"
                    if math.isnan(result.statistic)
                    else f"{result.symbol} = {write_cell(result.statistic, 'statistic')}{'*' if marked else ''}"
                )
                row[title, "p"] = result.p
                kinds[title, "statistic"], kinds[title, "p"] = "text", "p"
        rows.append(row)
    return StudyTable(
        "influence",
        "Influence of the participants and of what was played",
        pd.DataFrame(rows),
        kinds,
        "A.2, A.5",
        (
            "ρ: Spearman. χ²: contingency table, Yates' correction for 2 × 2. H: Kruskal-Wallis. "
            "* on the mean accuracy of each participant.",
            "Tests over answers count each answer of a participant as independent, which overstates the influence of "
            "what belongs to the participant; the details give the same tests over participants.",
        ),
    )


def influence_details(responses: Responses, results: list[Influence]) -> StudyTable:
    """One row per test of `influence_table`, with effect sizes, corrections, conditions, and p over participants."""
    corrected = holm([influence.result.p for influence in results])
    rows = [
        {"question": responses.questions[influence.question], "factor": FACTORS[influence.factor]}
        | result_cells(influence.result, float(p))
        | {"p over participants": math.nan if influence.over_participants is None else influence.over_participants.p}
        for influence, p in zip(results, corrected)
    ]
    return StudyTable(
        "influence_details",
        "Influence of the participants and of what was played, in detail",
        pd.DataFrame(rows),
        {**RESULT_KINDS, "p over participants": "p"},
        "A.2, A.5",
        ("p (Holm) is corrected for all tests of this table.",),
    )


def remarks_table(responses: Responses, results: list[Influence], *, alpha: float = 0.05) -> StudyTable:
    """What is significant, in words, and the reasons to doubt it (form of tables A.1 and A.7)."""
    corrected = holm([influence.result.p for influence in results])
    rows = []
    for influence, p in zip(results, corrected):
        if influence.result.p < alpha and influence.factor in (*PERSONAL, "intensity"):
            doubts = _doubts(responses, influence, float(p), alpha)
            rows.append({"remark": _sentence(responses, influence), "doubts": "; ".join(doubts) or "none"})
    frame = pd.DataFrame(rows or [{"remark": f"Nothing is significant at {alpha:g}.", "doubts": "none"}])
    return StudyTable("remarks", "Remarks about the participants and the played intensity", frame, reference="A.1, A.7")


def _sentence(responses: Responses, influence: Influence) -> str:
    name, factor = responses.questions[influence.question], FACTORS[influence.factor]
    table = responses.table.dropna(subset=[influence.question, influence.factor])
    p = write_p(influence.result.p)
    if influence.result.symbol == "ρ":
        way = "rises" if influence.result.effect > 0 else "falls"
        return f"{name.capitalize()} {way} with {factor} (ρ = {write_cell(influence.result.effect, 'effect')}, {p})"
    means = table.groupby(influence.factor)[influence.question].mean().sort_values(ascending=False)
    listed = ", ".join(
        f"{level:g} {mean:.2f}" if isinstance(level, float) else f"{level} {mean:.2f}" for level, mean in means.items()
    )
    return f"{name.capitalize()} differs with {factor} (means: {listed}; {p})"


def _doubts(responses: Responses, influence: Influence, corrected: float, alpha: float) -> list[str]:
    result, doubts = influence.result, []
    if result.p > 0.8 * alpha:
        doubts.append("p is close to the limit")
    if result.symbol == "ρ" and abs(result.effect) < 0.1:
        doubts.append("ρ is small: if there is an influence, it is weak")
    if corrected >= alpha:
        doubts.append(f"not significant with Holm's correction ({write_p(corrected)})")
    if (
        influence.over_participants is not None
        and influence.over_participants is not result
        and not influence.over_participants.p < alpha
    ):
        doubts.append(f"not significant with one value per participant ({write_p(influence.over_participants.p)})")
    if influence.factor in PERSONAL:
        shares = responses.people()[influence.factor].value_counts()
        if influence.factor in ORDERED and shares.iloc[0] > shares.sum() / 2:
            doubts.append(f"{shares.iloc[0]} of {shares.sum()} participants have one value ({shares.index[0]:g})")
        elif influence.factor not in ORDERED and shares.iloc[-1] < 5:
            doubts.append(f"only {shares.iloc[-1]} participants are {shares.index[-1]}")
    return [*doubts, *result.violated]


def habit_table(responses: Responses) -> StudyTable | None:
    """Means of every question by habit of avatars, with the number of participants (form of A.1 (A) and A.8 (A))."""
    if responses.people()["avatar_habit"].notna().sum() == 0:
        return None
    sizes = responses.people()["avatar_habit"].value_counts()
    levels = [float(level) for level in range(1, 8)]
    rows: list[dict[str, object]] = [
        {"habit of avatars": "participants", **{f"{level:g}": f"{sizes.get(level, 0)}" for level in levels}}
    ]
    for column, name in responses.questions.items():
        means = responses.table.groupby("avatar_habit")[column].mean()
        rows.append({"habit of avatars": name} | {f"{level:g}": float(means.get(level, math.nan)) for level in levels})
    kinds: dict[str | tuple[str, str], str] = {f"{level:g}": "mean" for level in levels}
    return StudyTable(
        "habit", "Means by habit of avatars, 1 (very little) to 7 (very much)", pd.DataFrame(rows), kinds, "A.8 (A)"
    )


def group_table(responses: Responses, factor: str) -> StudyTable | None:
    """Means of every question by group of participants and played intensity (forms of A.8 (B) and (C)).

    Parameters
    ----------
    factor : str
        `vision_problem` or `gender`. None is returned where it does not vary.
    """
    people = responses.people()[factor].dropna()
    if people.nunique() < 2:
        return None
    levels = sorted(people.unique())
    rows: list[dict[str, object]] = [
        {
            "question": "participants",
            "played intensity": "",
            **{str(level): f"{(people == level).sum()}" for level in levels},
        }
    ]
    table = responses.table
    for column, name in responses.questions.items():
        shown: list[tuple[str, pd.DataFrame]] = [("all", table)]
        if table["intensity"].nunique() > 1:
            shown += [(f"{value:g}", part) for value, part in table.groupby("intensity")]
        for what, part in shown:
            means = part.groupby(factor)[column].mean()
            rows.append(
                {"question": name, "played intensity": what}
                | {str(level): float(means.get(level, math.nan)) for level in levels}
            )
    kinds: dict[str | tuple[str, str], str] = {str(level): "mean" for level in levels}
    title = f"Means by {PERSONAL[factor]} and played intensity"
    return StudyTable(f"means_by_{factor}", title, pd.DataFrame(rows), kinds, "A.8 (B), (C)")
