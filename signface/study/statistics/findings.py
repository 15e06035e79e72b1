"""What the answers say, one careful sentence or two per question.

- `findings`: from the tests of the thesis and the models beside them.

A difference is called shown when the mixed model shows it with Holm's correction for the questions, and then for the
pairs of methods; where the thesis's test disagrees, the
sentence says so. What is not shown is never called equal: the smallest difference that would have been found is given.
"""

from __future__ import annotations

import math
from itertools import combinations

from signface.study.responses import Responses
from signface.study.statistics.model_tables import MethodComparison
from signface.study.statistics.tables import StudyTable, write_p
from signface.study.statistics.test_result import holm


def findings(
    responses: Responses,
    comparisons: dict[str, MethodComparison],
    hypotheses: StudyTable,
    contrasts: StudyTable,
    power: StudyTable,
    *,
    alpha: float = 0.05,
) -> tuple[str, ...]:
    """One entry per question.

    Parameters
    ----------
    responses : Responses
    comparisons : dict
        Question to its comparison.
    hypotheses, contrasts, power : StudyTable
        As made by their modules.
    alpha : float
    """
    sentences = []
    corrected = holm([comparison.likelihood_ratio.p for comparison in comparisons.values()])
    for row, (column, comparison) in enumerate(comparisons.items()):
        name = responses.questions[column]
        thesis = hypotheses.frame.iloc[row]
        model_p = float(corrected[row])
        if math.isnan(thesis["p"]):
            sentences.append(f"{name.capitalize()}: nothing can be tested ({thesis['conditions not met']}).")
            continue
        test = f"{thesis['test']}: {write_p(thesis['p (Holm)'])}, {thesis['effect']}, {thesis['size']}"
        if math.isnan(model_p):
            significant = thesis["p (Holm)"] < alpha
            verb = "the methods differ" if significant else "no difference between the methods is shown"
            sentences.append(f"{name.capitalize()}: {verb} ({test}); there are too few participants for a model.")
            continue
        of_question = contrasts.frame[contrasts.frame[("", "question")] == name]
        pairs = list(combinations(comparison.methods, 2))
        differing = [
            _difference(pair, contrast)
            for pair, (_, contrast) in zip(pairs, of_question.iterrows())
            if contrast["mixed model", "p (Holm)"] < alpha
        ]
        model = f"mixed model: {write_p(model_p)}"
        if model_p < alpha and differing:
            sentence = f"{name.capitalize()}: {'; '.join(differing)} ({test}; {model})."
        elif model_p < alpha:
            sentence = f"{name.capitalize()}: the methods differ, but no pair alone does ({test}; {model})."
        else:
            least = power.frame.loc[power.frame["question"] == name, "found with 80 %"].max()
            missed = "" if math.isnan(least) else f" A difference below {least:.2f} would likely be missed."
            sentence = f"{name.capitalize()}: no difference between the methods is shown ({test}; {model}).{missed}"
        if (thesis["p (Holm)"] < alpha) != (model_p < alpha):
            sentence += " The two disagree: the test takes a participant's answers as independent, the model does not."
        sentences.append(sentence)
    return tuple(sentences)


def _difference(pair: tuple[str, str], contrast) -> str:  # type: ignore[no-untyped-def]  # a row of a data frame
    value, low, high = (contrast["difference of means", part] for part in ("first − second", "low", "high"))
    if value < 0:
        pair, value, low, high = pair[::-1], -value, -high, -low
    interval = f"{low:.2f} to {high:.2f}".replace("-", "−")
    return f"{pair[0]} is higher than {pair[1]} by {value:.2f} (95 % interval {interval})"
