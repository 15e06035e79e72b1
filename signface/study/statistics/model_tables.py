"""What a reviewer asks beside the thesis's tests: models and tests in which a participant's answers belong together.

- `compare_methods`: for one question, the mixed model, the population-averaged model and the test over participants.
- `models_table`: those three for every question.
- `contrasts_table`: every pair of methods: difference with its interval, odds ratio, p-values with Holm's correction.
- `posthoc_table`: Dunn's and McNemar's comparisons with Holm's correction.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pandas as pd
from scipy import stats
from threadpoolctl import threadpool_limits

from signface.extras import needed
from signface.study.responses import Responses
from signface.study.statistics.contingency import cochran, mcnemar
from signface.study.statistics.intervals import difference_intervals
from signface.study.statistics.mixed_models import OrdinalFit, OrdinalMixedModel
from signface.study.statistics.rank_tests import dunn, friedman, wilcoxon
from signface.study.statistics.tables import StudyTable
from signface.study.statistics.test_result import TestResult, holm
from signface.study.statistics.thesis_tables import RESULT_KINDS, paired, participant_means, result_cells

#: Fewer levels than this give no idea of a variance.
LEAST_LEVELS = 5

#: Fewer participants than this make the sandwich estimator of the population-averaged model too small.
LEAST_CLUSTERS = 10


@dataclass(frozen=True)
class MethodComparison:
    """One question compared between all methods with participants taken into account.

    Parameters
    ----------
    methods : list of str
        Those that were answered.
    mixed : OrdinalFit or None
        Cumulative logit mixed model; its coefficients are the methods but the first. None where it cannot be made.
    likelihood_ratio : TestResult
        Of the methods in the mixed model.
    spreads : dict
        Name of a grouping to its standard deviation, in logits.
    averaged : TestResult
        Wald test of the methods in the population-averaged model (GEE).
    over_participants : TestResult
        Friedman's test, or Wilcoxon's with two methods, on the participants' means.
    """

    methods: list[str]
    mixed: OrdinalFit | None
    likelihood_ratio: TestResult
    spreads: dict[str, float]
    averaged: TestResult
    over_participants: TestResult


@threadpool_limits.wrap(limits=1, user_api="blas")
def compare_methods(responses: Responses, column: str) -> MethodComparison:
    """Compare the methods on one question, taking a participant's answers as belonging together.

    Parameters
    ----------
    responses : Responses
    column : str
        A key of `responses.questions`.

    Returns
    -------
    MethodComparison
        The mixed model has random intercepts for participants, for participants × methods (a person's own reaction to a
        method, without which its p-values are too small) and for what was played.
    """
    table = responses.table.assign(item=responses.item()).dropna(subset=[column])
    methods = sorted(table["method"].unique())
    mixed, ratio, spreads = _mixed(table, column, methods)
    averaged = _averaged(table, column, methods)
    means = participant_means(responses, column).reindex(columns=methods)
    over = (
        friedman(means.to_numpy())
        if len(methods) > 2
        else wilcoxon(means[methods[0]], means[methods[-1]])
        if len(methods) == 2
        else _none("one method")
    )
    return MethodComparison(methods, mixed, ratio, spreads, averaged, over)


def freedom(participants: int, methods: int) -> int:
    """Denominator degrees of freedom of the mixed model's tests: participants × methods, less one of each.

    Referred to χ², with a few dozen participants, the tests find somewhat too much.
    """
    return (participants - 1) * (methods - 1)


def _none(why: str) -> TestResult:
    return TestResult("–", "χ²", math.nan, math.nan, 0, violated=(f"not made: {why}",))


def _mixed(
    table: pd.DataFrame, column: str, methods: list[str]
) -> tuple[OrdinalFit | None, TestResult, dict[str, float]]:

    people = table["participant"].nunique()
    if len(methods) < 2 or people < LEAST_LEVELS or table[column].nunique() < 2:
        why = (
            "one method"
            if len(methods) < 2
            else "constant answers"
            if people >= LEAST_LEVELS
            else f"{people} participants"
        )
        return None, _none(why), {}
    groupings = {"participants": table["participant"]}
    if table.groupby(["participant", "method"]).size().max() > 1:
        groupings["reactions"] = table["participant"] + "\0" + table["method"]
    if table["item"].nunique() >= LEAST_LEVELS:
        groupings["stimuli"] = table["item"]
    dummies = np.column_stack([(table["method"] == method).to_numpy(float) for method in methods[1:]])
    levels = list(groupings.values())
    full = OrdinalMixedModel(table[column], dummies, levels).fit()
    null = OrdinalMixedModel(table[column], dummies[:, :0], levels).fit()
    statistic = max(0.0, 2 * (full.log_likelihood - null.log_likelihood))
    df = len(methods) - 1
    violated = () if full.converged and null.converged else ("the model did not converge",)
    p = float(stats.f.sf(statistic / df, df, freedom(people, len(methods))))
    ratio = TestResult("Mixed model", "χ²", statistic, p, len(table), df, violated=violated)
    return full, ratio, dict(zip(groupings, map(float, full.spreads)))


def _averaged(table: pd.DataFrame, column: str, methods: list[str]) -> TestResult:
    """Wald test of the methods by generalised estimating equations, participants as clusters.

    Working independence, sandwich covariance with Mancl and DeRouen's correction for few clusters, F with the number of
    participants less one as denominator. It describes the population's answers, where the mixed model describes a
    person's; it wants no distribution of the random effects, and many participants.
    """
    people = table["participant"].nunique()
    if len(methods) < 2 or table[column].nunique() < 2:
        return _none("one method" if len(methods) < 2 else "constant answers")
    if people < LEAST_CLUSTERS:
        return _none(f"{people} < {LEAST_CLUSTERS} participants")
    equations = needed("statsmodels.genmod.generalized_estimating_equations", "study")
    family = needed("statsmodels.genmod.families", "study").Binomial()
    independence = needed("statsmodels.genmod.cov_struct", "study").Independence()
    table = table.sort_values("participant", kind="stable")
    design = pd.DataFrame({method: (table["method"] == method).astype(float) for method in methods[1:]})
    answers = table[column].reset_index(drop=True)
    groups = table["participant"].reset_index(drop=True)
    design = design.reset_index(drop=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            if answers.nunique() == 2:
                constant = design.assign(constant=1.0)
                binary = (answers == answers.max()).astype(float)
                model = equations.GEE(binary, constant, groups, family=family, cov_struct=independence)
            else:
                model = equations.OrdinalGEE(answers, design, groups, cov_struct=independence)
            fit = model.fit(cov_type="bias_reduced")
        except (ValueError, np.linalg.LinAlgError):
            return _none("the equations have no solution")
    names = list(fit.model.exog_names)
    at = [names.index(method) for method in methods[1:]]
    coefficients = np.asarray(fit.params)[at]
    covariance = np.asarray(fit.cov_params())[np.ix_(at, at)]
    if not np.isfinite(covariance).all() or np.linalg.eigvalsh(covariance).min() <= 0:
        return _none("the equations have no solution")
    df = len(at)
    wald = float(coefficients @ np.linalg.solve(covariance, coefficients))
    p = float(
        stats.f.sf(wald / df * (people - df) / (people - 1), df, people - df)
    )  # Hotelling's, for few participants
    return TestResult("GEE", "Wald", wald, p, len(table), df)


def models_table(responses: Responses, comparisons: dict[str, MethodComparison]) -> StudyTable:
    """The three comparisons of every question, with the spread of the random effects."""
    mixed = holm([comparison.likelihood_ratio.p for comparison in comparisons.values()])
    rows: list[dict[tuple[str, str], object]] = []
    notes: list[str] = []
    for (column, comparison), corrected in zip(comparisons.items(), mixed):
        name = responses.questions[column]
        over = comparison.over_participants
        rows.append(
            {
                ("", "question"): name,
                ("mixed model", "χ²"): comparison.likelihood_ratio.statistic,
                ("mixed model", "df"): _or_nan(comparison.likelihood_ratio.df),
                ("mixed model", "p"): comparison.likelihood_ratio.p,
                ("mixed model", "p (Holm)"): float(corrected),
                ("spread, logits", "participants"): comparison.spreads.get("participants", math.nan),
                ("spread, logits", "reactions"): comparison.spreads.get("reactions", math.nan),
                ("spread, logits", "stimuli"): comparison.spreads.get("stimuli", math.nan),
                ("population-averaged", "Wald"): comparison.averaged.statistic,
                ("population-averaged", "p"): comparison.averaged.p,
                ("over participants", "test"): over.test,
                ("over participants", "statistic"): over.statistic,
                ("over participants", "p"): over.p,
            }
        )
        for what, result in (
            ("mixed model", comparison.likelihood_ratio),
            ("GEE", comparison.averaged),
            (over.test, over),
        ):
            notes += [f"{name}, {what}: {reason}." for reason in result.violated]
    kinds: dict[str | tuple[str, str], str] = {
        ("mixed model", "χ²"): "statistic",
        ("mixed model", "df"): "count",
        ("mixed model", "p"): "p",
        ("mixed model", "p (Holm)"): "p",
        ("population-averaged", "Wald"): "statistic",
        ("population-averaged", "p"): "p",
        ("over participants", "test"): "text",
        ("over participants", "statistic"): "statistic",
        ("over participants", "p"): "p",
    }
    kinds |= {("spread, logits", part): "mean" for part in ("participants", "reactions", "stimuli")}
    return StudyTable(
        "models",
        "Methods compared with participants as random effects",
        pd.DataFrame(rows),
        kinds,
        notes=(
            "Mixed model: cumulative logit (logistic for accuracy) with random intercepts for participants, for "
            "participants × methods (reactions) and for what was played (stimuli); likelihood-ratio test of the "
            "methods, referred to F with (participants − 1)(methods − 1) degrees of freedom. Population-averaged: "
            "generalised estimating equations, participants as clusters. Over participants: Friedman (Wilcoxon for two "
            "methods) on one mean per participant and method.",
            *notes,
        ),
    )


def _or_nan(number: int | None) -> float:
    return math.nan if number is None else float(number)


def contrasts_table(
    responses: Responses, comparisons: dict[str, MethodComparison], *, resamples: int, seed: int
) -> StudyTable:
    """Every pair of methods: difference of means with its interval, odds ratio, p with Holm's correction."""
    rows = []
    for column, comparison in comparisons.items():
        intervals = difference_intervals(responses.table, column, comparison.methods, resamples=resamples, seed=seed)
        means = participant_means(responses, column)
        pairs = list(combinations(comparison.methods, 2))
        odds = [_odds(comparison, first, second, len(means)) for first, second in pairs]
        people = [wilcoxon(means[first], means[second]) for first, second in pairs]
        corrected, corrected_people = holm([p for _, p in odds]), holm([result.p for result in people])
        rows += [
            {
                ("", "question"): responses.questions[column],
                ("", "pair"): " – ".join(pair),
                ("difference of means", "first − second"): intervals[pair][0],
                ("difference of means", "low"): intervals[pair][1],
                ("difference of means", "high"): intervals[pair][2],
                ("mixed model", "odds ratio, 95 %"): odds[row][0],
                ("mixed model", "p"): odds[row][1],
                ("mixed model", "p (Holm)"): float(corrected[row]),
                ("over participants", "r"): people[row].effect,
                ("over participants", "p"): people[row].p,
                ("over participants", "p (Holm)"): float(corrected_people[row]),
            }
            for row, pair in enumerate(pairs)
        ]
    kinds: dict[str | tuple[str, str], str] = {
        (part, name): "p" for part in ("mixed model", "over participants") for name in ("p", "p (Holm)")
    }
    return StudyTable(
        "contrasts",
        "Pairs of methods with participants as random effects",
        pd.DataFrame(rows),
        kinds,
        notes=(
            "Low and high: 95 % interval of the difference, a bootstrap over "
            "participants. Odds ratio and p: mixed model; above 1 where the first method is answered higher. r and p "
            "over participants: Wilcoxon on one mean per participant and method. Holm's correction within a question.",
        ),
    )


def _odds(comparison: MethodComparison, first: str, second: str, people: int) -> tuple[str, float]:
    """Odds ratio of a pair of methods with its 95 % interval, and p, both by the mixed model."""
    if comparison.mixed is None:
        return "–", math.nan
    weights = [float(method == first) - float(method == second) for method in comparison.methods[1:]]
    value, error = comparison.mixed.contrast(weights)
    if not (error > 0 and np.isfinite(error)):
        return "–", math.nan
    around = stats.t(freedom(people, len(comparison.methods)))
    low, high = np.exp(value + around.ppf([0.025, 0.975]) * error)
    return f"{np.exp(value):.2f} [{low:.2f}, {high:.2f}]", float(2 * around.sf(abs(value / error)))


def posthoc_table(responses: Responses) -> StudyTable:
    """Dunn's comparisons after Kruskal-Wallis, McNemar's after Cochran's Q, with Holm's correction in a question."""
    methods, rows = responses.methods, []
    for column, name in responses.questions.items():
        groups = [responses.table.loc[responses.table["method"] == method, column].dropna() for method in methods]
        asked = [(method, group) for method, group in zip(methods, groups) if len(group)]
        names = [method for method, _ in asked]
        if len(names) < 2:
            continue
        if column == "correct":
            pairs = paired(responses, column)
            tests = {(first, second): mcnemar(pairs[first], pairs[second]) for first, second in combinations(names, 2)}
            whole = cochran(pairs[names].to_numpy())
            if len(names) > 2:
                rows.append({"question": name, "pair": "all methods"} | result_cells(whole, math.nan))
        else:
            results = dunn([group for _, group in asked])
            tests = {(names[i], names[j]): result for (i, j), result in results.items()}
        for ((first, second), result), p in zip(tests.items(), holm([result.p for result in tests.values()])):
            rows.append({"question": name, "pair": f"{first} – {second}"} | result_cells(result, float(p)))
    return StudyTable(
        "posthoc",
        "Post-hoc comparisons of pairs",
        pd.DataFrame(rows),
        RESULT_KINDS,
        notes=(
            "Accuracy: Cochran's Q and McNemar's exact test on the pairs of a participant and what was played; b "
            "counts what only the first method got right, Δ is the difference of the shares. Scales: Dunn's z after "
            "Kruskal-Wallis; r is the rank-biserial correlation of the two groups of answers.",
        ),
    )
