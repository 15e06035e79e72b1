"""The whole analysis of a study: every table, section by section.

- `analyse`: from responses to an `Analysis`.
- `Analysis`, `Section`: what reports, CSV and LaTeX files are made of.
"""

from __future__ import annotations

from dataclasses import dataclass

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
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"):  # small matrices: threads that wait for each other cost more than they give
        return _analyse(responses, alpha, resamples, seed)


def _analyse(responses: Responses, alpha: float, resamples: int, seed: int) -> Analysis:
    compare = len(responses.methods) > 1
    influences = influence_results(responses)
    said: tuple[str, ...] = ()
    hypotheses = hypotheses_table(responses)
    sections = [
        Section(
            "methods",
            "Do the methods differ?",
            "Means, then one null hypothesis per question tested between all methods, then every pair of methods.",
            tuple(
                [means_table(responses)]
                + ([hypotheses, pairwise_table(responses), pairwise_matrix(responses)] if compare else [])
            ),
        ),
    ]
    if compare:
        comparisons = {column: compare_methods(responses, column) for column in responses.questions}
        contrasts = contrasts_table(responses, comparisons, resamples=resamples, seed=seed)
        power = power_table(responses, alpha=alpha)
        said = findings(responses, comparisons, hypotheses, contrasts, power, alpha=alpha)
        sections.append(
            Section(
                "models",
                "Do the methods differ when a participant's answers belong together?",
                "The same questions asked of models and tests that know who answered.",
                (models_table(responses, comparisons), contrasts, posthoc_table(responses), power),
            )
        )
    crossed = interactions_table(
        responses,
        [("expression", "method"), ("intensity", "method")],
        key="interactions",
        title="Interaction of the method with what was played (Scheirer-Ray-Hare)",
        reference="6.5",
    )
    others = interactions_table(
        responses,
        [("gender", "method"), ("vision_problem", "method"), ("expression", "intensity")],
        key="interactions_participants",
        title="Interactions with the participants, and of expression with intensity (Scheirer-Ray-Hare)",
        reference="A.4",
    )
    tables = [table for table in (crossed, others) if len(table.frame)]
    if tables:
        sections.append(
            Section(
                "interactions",
                "Does the effect of the method depend on something else?",
                "Two factors at a time and their interaction, on ranks.",
                tuple(tables),
            )
        )
    sections.append(
        Section(
            "expressions",
            "What was recognised, and how did each expression fare?",
            "Confusion matrices by method, and means by played expression.",
            (*confusion_tables(responses), expression_means(responses), expression_means(responses, by_method=True)),
        )
    )
    about = [remarks_table(responses, influences, alpha=alpha), influence_table(responses, influences)]
    about += [influence_details(responses, influences)]
    groups = [habit_table(responses), *(group_table(responses, factor) for factor in ("vision_problem", "gender"))]
    about += [table for table in groups if table is not None]
    if influences:
        sections.append(
            Section(
                "participants",
                "Do the participants, or what was played, explain the answers?",
                "What is significant comes first, with the reasons to doubt it.",
                tuple(about),
            )
        )
    return Analysis(responses, tuple(sections), alpha, seed, resamples, said)
