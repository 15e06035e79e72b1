"""The whole analysis of a study: every table, section by section.

- `analyse`: from responses to an `Analysis`.
- `Analysis`, `Section`: what reports, CSV and LaTeX files are made of.
"""

from __future__ import annotations

from dataclasses import dataclass

from threadpoolctl import threadpool_limits

from signface.study.responses import Responses
from signface.study.statistics.findings import findings
from signface.study.statistics.model_tables import compare_methods, contrasts_table, models_table, posthoc_table
from signface.study.statistics.participant_tables import (
    group_table,
    habit_table,
    influence_details,
    influence_results,
    influence_table,
    remarks_table,
)
from signface.study.statistics.power import power_table
from signface.study.statistics.tables import StudyTable
from signface.study.statistics.thesis_tables import (
    confusion_tables,
    expression_means,
    hypotheses_table,
    interactions_table,
    means_table,
    pairwise_matrix,
    pairwise_table,
)


@dataclass(frozen=True)
class Section:
    """One part of a report.

    Parameters
    ----------
    key : str
        `methods`, `models`, `interactions`, `expressions` or `participants`.
    title, intro : str
        A heading and what the part answers, in a sentence or two.
    tables : tuple of StudyTable
    """

    key: str
    title: str
    intro: str
    tables: tuple[StudyTable, ...]


@dataclass(frozen=True)
class Analysis:
    """Everything that was computed from the answers of one study.

    Parameters
    ----------
    responses : Responses
    sections : tuple of Section
    alpha : float
        The level below which a p-value is called significant.
    seed, resamples : int
        Of the bootstrap.
    findings : tuple of str
        What the answers say, a sentence per question.
    """

    responses: Responses
    sections: tuple[Section, ...]
    alpha: float
    seed: int
    resamples: int
    findings: tuple[str, ...] = ()

    @property
    def tables(self) -> list[StudyTable]:
        """All tables, in order."""
        return [table for section in self.sections for table in section.tables]

    def table(self, key: str) -> StudyTable | None:
        """The table of that key, None where the study does not allow it."""
        return next((table for table in self.tables if table.key == key), None)


#: Sections in order: title and what each answers.
SECTIONS = {
    "methods": (
        "Do the methods differ?",
        "Means, then one null hypothesis per question tested between all methods, then every pair of methods.",
    ),
    "models": (
        "Do the methods differ when a participant's answers belong together?",
        "The same questions asked of models and tests that know who answered.",
    ),
    "interactions": (
        "Does the effect of the method depend on something else?",
        "Two factors at a time and their interaction, on ranks.",
    ),
    "expressions": (
        "What was recognised, and how did each expression fare?",
        "Confusion matrices by method, and means by played expression.",
    ),
    "participants": (
        "Do the participants, or what was played, explain the answers?",
        "What is significant comes first, with the reasons to doubt it.",
    ),
}

#: Tables of interactions: key, pairs of factors, title and the thesis's table of that form.
INTERACTIONS = (
    (
        "interactions",
        (("expression", "method"), ("intensity", "method")),
        "Interaction of the method with what was played (Scheirer-Ray-Hare)",
        "6.5",
    ),
    (
        "interactions_participants",
        (("gender", "method"), ("vision_problem", "method"), ("expression", "intensity")),
        "Interactions with the participants, and of expression with intensity (Scheirer-Ray-Hare)",
        "A.4",
    ),
)


@threadpool_limits.wrap(limits=1, user_api="blas")  # small matrices: threads that wait for each other cost tenfold
def analyse(responses: Responses, *, alpha: float = 0.05, resamples: int = 2000, seed: int = 0) -> Analysis:
    """Make every table that a study allows.

    Parameters
    ----------
    responses : Responses
    alpha : float
        Significance level of remarks and sentences.
    resamples : int
        Bootstrap samples of participants.
    seed : int
        Of the bootstrap.
    """
    tables: dict[str, list[StudyTable]] = {"methods": [means_table(responses)]}
    sentences: tuple[str, ...] = ()
    if len(responses.methods) > 1:
        hypotheses = hypotheses_table(responses)
        tables["methods"] += [hypotheses, pairwise_table(responses), pairwise_matrix(responses)]
        comparisons = {column: compare_methods(responses, column) for column in responses.questions}
        contrasts = contrasts_table(responses, comparisons, resamples=resamples, seed=seed)
        power = power_table(responses, alpha=alpha)
        sentences = findings(responses, comparisons, hypotheses, contrasts, power, alpha=alpha)
        tables["models"] = [models_table(responses, comparisons), contrasts, posthoc_table(responses), power]
    crossed = [
        interactions_table(responses, pairs, key=key, title=title, reference=reference)
        for key, pairs, title, reference in INTERACTIONS
    ]
    tables["interactions"] = [table for table in crossed if len(table.frame)]
    means = (expression_means(responses), expression_means(responses, by_method=True))
    tables["expressions"] = [*confusion_tables(responses), *means]
    influences = influence_results(responses)
    if influences:
        groups = [habit_table(responses), *(group_table(responses, factor) for factor in ("vision_problem", "gender"))]
        tables["participants"] = [
            remarks_table(responses, influences, alpha=alpha),
            influence_table(responses, influences),
            influence_details(responses, influences),
            *(table for table in groups if table is not None),
        ]
    sections = [Section(key, *words, tuple(tables[key])) for key, words in SECTIONS.items() if tables.get(key)]
    return Analysis(responses, tuple(sections), alpha, seed, resamples, sentences)
