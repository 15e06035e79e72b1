"""The tables of thesis chapter 6 and appendix A about the methods, for any study of that form.

- `means_table`: means of every question by method (tables 6.6 and 6.9).
- `hypotheses_table`: one null hypothesis per question (tables 6.2, 6.3 and 6.7).
- `pairwise_table`, `pairwise_matrix`: every pair of methods (tables 6.4 and 6.8).
- `interactions_table`: method with played expression and intensity (table 6.5), and other pairs of factors (A.4).
- `expression_means`: means by played expression (tables A.3 and A.6), also split by method.
- `confusions`: what was answered for what was played, by method (figures 6.3 and 6.6).

The tables about the participants (A.1, A.2, A.5, A.7, A.8) are in `signface.study.statistics.participant_tables`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import combinations

import numpy as np
import pandas as pd

from signface.study.responses import FACTORS, SCALES, Responses, order_expressions
from signface.study.statistics.contingency import chi_square
from signface.study.statistics.rank_tests import kruskal_wallis, scheirer_ray_hare, wilcoxon
from signface.study.statistics.tables import StudyTable
from signface.study.statistics.test_result import TestResult, holm, verdict

#: question: what its null hypothesis says (thesis 6.3.1 and 6.4.1).
HYPOTHESES = {
    "correct": ("H0₁", "The method does not change how well expressions are recognised"),
    "answer_intensity": ("H0₂", "The perceived intensity is the same whatever the method"),
    "answer_difficulty": ("H0₃", "The perceived ease is the same whatever the method"),
    "answer_credibility": ("H0₄", "The perceived credibility is the same whatever the method"),
    "answer_fidelity": ("H0₅", "The perceived fidelity is the same whatever the method"),
}

INDEPENDENCE = (
    "As in the thesis, each answer counts as independent although a participant gives many; "
    "the models with participants as random effects do not assume it."
)


def means_table(responses: Responses) -> StudyTable:
    """Means of every question by method (form of tables 6.6 and 6.9); accuracy is the share recognised."""
    rows = []
    for column, name in responses.questions.items():
        means = responses.table.groupby("method")[column].mean()
        rows.append(
            {"question": name, "scale": SCALES.get(column, "share of expressions recognised")}
            | {method: float(means.get(method, math.nan)) for method in responses.methods}
        )
    return StudyTable("means_by_method", "Means by method", pd.DataFrame(rows), reference="6.6, 6.9")


def test_methods(responses: Responses, column: str) -> TestResult:
    """The thesis's test of one question between all methods: χ² for accuracy, Kruskal and Wallis for scales."""
    table = responses.table
    if column == "correct":
        return chi_square(right_and_wrong(table, "method"))
    return kruskal_wallis([table.loc[table["method"] == method, column] for method in responses.methods])


test_methods.__test__ = False  # type: ignore[attr-defined]  # pytest: not a test of ours


def right_and_wrong(table: pd.DataFrame, factor: str) -> np.ndarray:
    """Counts of right and wrong answers by level of a factor, (levels, 2)."""
    answered = table.dropna(subset=["correct", factor])
    right = answered.groupby(factor)["correct"].agg(["sum", "size"])
    return np.column_stack([right["sum"], right["size"] - right["sum"]])


def hypotheses_table(responses: Responses) -> StudyTable:
    """One row per question: its null hypothesis tested between all methods (form of tables 6.2, 6.3, 6.7)."""
    columns = list(responses.questions)
    results = [test_methods(responses, column) for column in columns]
    corrected = holm([result.p for result in results])
    rows = [
        {"hypothesis": HYPOTHESES[column][0], "statement": HYPOTHESES[column][1]} | result_cells(result, p)
        for column, result, p in zip(columns, results, corrected)
    ]
    return StudyTable(
        "hypotheses",
        "Null hypotheses about the methods",
        pd.DataFrame(rows),
        RESULT_KINDS,
        "6.2, 6.3, 6.7",
        (INDEPENDENCE, "p (Holm) is corrected for the hypotheses of this table."),
    )


#: Kinds of the columns that `result_cells` fills.
RESULT_KINDS: dict[str | tuple[str, str], str] = {
    "statistic": "statistic",
    "df": "count",
    "n": "count",
    "p": "p",
    "p (Holm)": "p",
    "effect": "text",
    "size": "text",
}


def result_cells(result: TestResult, corrected: float) -> dict[str, object]:
    """The cells that every table of tests has, from a test and its corrected p; their kinds are `RESULT_KINDS`."""
    effect = "–" if math.isnan(result.effect) else f"{result.effect_symbol} = {result.effect:.3f}".replace("-", "−")
    return {
        "test": result.test,
        "statistic": result.statistic,
        "df": math.nan if result.df is None else result.df,
        "n": result.n,
        "p": result.p,
        "p (Holm)": float(corrected),
        "effect": effect,
        "size": verdict(result.effect_name, result.effect),
        "conditions not met": "; ".join(result.violated) or "none",
    }


def paired(responses: Responses, column: str) -> pd.DataFrame:
    """Answers by participant and item (rows) and method (columns): the pairs of Wilcoxon's test.

    A participant who saw an item twice with a method counts once, with the mean.
    """
    table = responses.table.assign(item=responses.item())
    return table.pivot_table(
        index=["participant", "item"], columns="method", values=column, aggfunc="mean", observed=True
    )


def pairwise_results(responses: Responses, column: str) -> dict[tuple[str, str], TestResult]:
    """The thesis's test of every pair of methods: χ² with Yates for accuracy, Wilcoxon on pairs for scales."""
    table, results = responses.table, {}
    pairs = paired(responses, column)
    for first, second in combinations(responses.methods, 2):
        if column == "correct":
            results[first, second] = chi_square(right_and_wrong(table[table["method"].isin([first, second])], "method"))
        else:
            nothing = pairs.iloc[:0].reindex(columns=[first, second]) if not {first, second} <= set(pairs) else pairs
            results[first, second] = wilcoxon(nothing[first], nothing[second])
    return results


def pairwise_table(responses: Responses) -> StudyTable:
    """Every pair of methods, every question, with Holm's correction within a question (forms of 6.4 and 6.8)."""
    rows = []
    for column, name in responses.questions.items():
        results = pairwise_results(responses, column)
        corrected = holm([result.p for result in results.values()])
        for ((first, second), result), p in zip(results.items(), corrected):
            rows.append({"question": name, "pair": f"{first} – {second}"} | result_cells(result, float(p)))
    return StudyTable(
        "pairwise",
        "Pairs of methods",
        pd.DataFrame(rows),
        RESULT_KINDS,
        "6.4, 6.8",
        (
            "Accuracy: χ² with Yates' correction. Scales: Wilcoxon's signed ranks on the answers of one participant to "
            "one expression and intensity; n counts the pairs that differ; r > 0 where the first method is higher.",
            "p (Holm) is corrected for the pairs of one question.",
        ),
    )


def pairwise_matrix(responses: Responses) -> StudyTable:
    """The uncorrected p-values of `pairwise_table` laid out as in tables 6.4 and 6.8."""
    methods, rows = responses.methods, []
    for column, name in responses.questions.items():
        results = pairwise_results(responses, column)
        for first in methods[:-1]:
            row: dict[str, object] = {"question": name, "p-values": first}
            for second in methods[1:]:
                row[second] = results[first, second].p if (first, second) in results else ""
            rows.append(row)
    kinds: dict[str | tuple[str, str], str] = dict.fromkeys(methods[1:], "p")
    return StudyTable(
        "pairwise_matrix", "P-values between pairs of methods, uncorrected", pd.DataFrame(rows), kinds, "6.4, 6.8"
    )


def interactions_table(
    responses: Responses, pairs: Iterable[tuple[str, str]], *, key: str, title: str, reference: str
) -> StudyTable:
    """Scheirer, Ray and Hare's test of every scale for each pair of factors (forms of tables 6.5 and A.4).

    Parameters
    ----------
    responses : Responses
    pairs : iterable of (column, column)
        Factors; a pair with a factor that does not vary is left out.
    key, title, reference : str
        Of the table.
    """
    varying, rows, violated = responses.factors(), [], []
    for first, second in pairs:
        if first not in varying or second not in varying:
            continue
        for column, name in responses.scales.items():
            table = responses.table.dropna(subset=[column, first, second])
            results = scheirer_ray_hare(table[column], table[first], table[second])
            row: dict[tuple[str, str], object] = {
                ("", "factor 1"): FACTORS[first],
                ("", "factor 2"): FACTORS[second],
                ("", "question"): name,
            }
            for part, result in zip(("factor 1", "factor 2", "interaction"), results):
                row |= {(part, "H"): result.statistic, (part, "p"): result.p, (part, "ε²"): result.effect}
            rows.append(row)
            violated += [f"{FACTORS[first]} × {FACTORS[second]}, {name}: {what}" for what in results[0].violated]
    frame = pd.DataFrame(rows)
    kinds: dict[str | tuple[str, str], str] = {}
    for part in ("factor 1", "factor 2", "interaction"):
        kinds |= {(part, "H"): "statistic", (part, "p"): "p", (part, "ε²"): "effect"}
    notes = tuple(f"Condition not met: {what}." for what in violated)
    return StudyTable(key, title, frame, kinds, reference, (INDEPENDENCE, *notes))


def expression_means(responses: Responses, *, by_method: bool = False) -> StudyTable:
    """Means of every question by played expression (form of A.3 and A.6), or by method and expression."""
    groups = ["method", "expression"] if by_method else ["expression"]
    rows = []
    for column, name in responses.questions.items():
        means = responses.table.groupby(groups)[column].mean()
        for method in responses.methods if by_method else [None]:
            of_method = means.get(method, pd.Series(dtype=float)) if by_method else means
            row = {"question": name} | ({"method": method} if by_method else {})
            rows.append(row | {name: float(of_method.get(name, math.nan)) for name in responses.expressions})
    if by_method:
        return StudyTable("means_by_method_and_expression", "Means by method and played expression", pd.DataFrame(rows))
    return StudyTable("means_by_expression", "Means by played expression", pd.DataFrame(rows), reference="A.3, A.6")


def confusions(responses: Responses) -> dict[str, pd.DataFrame]:
    """Method to counts of answers: rows are what was played, columns what was answered (figures 6.3 and 6.6)."""
    answered = responses.table.dropna(subset=["answer_expression"])
    labels = order_expressions(sorted({*answered["expression"], *answered["answer_expression"]}))
    played = [label for label in labels if label in set(answered["expression"])]
    matrices = {}
    for method in sorted(answered["method"].unique()):
        of_method = answered[answered["method"] == method]
        matrices[method] = pd.crosstab(of_method["expression"], of_method["answer_expression"]).reindex(
            index=played, columns=labels, fill_value=0
        )
    return matrices


def confusion_tables(responses: Responses) -> list[StudyTable]:
    """The confusion matrix of each method as a table of counts."""
    tables = []
    for method, counts in confusions(responses).items():
        frame = counts.rename_axis(None, axis=1).rename_axis("played").reset_index()
        kinds: dict[str | tuple[str, str], str] = dict.fromkeys(counts.columns, "count")
        tables.append(
            StudyTable(f"confusion_{method}", f"Confusion matrix, {method}", frame, kinds, "figures 6.3, 6.6")
        )
    return tables


def participant_means(responses: Responses, column: str) -> pd.DataFrame:
    """A participant's mean answer by method: rows participants, columns methods."""
    return responses.table.pivot_table(
        index="participant", columns="method", values=column, aggfunc="mean", observed=True
    )
