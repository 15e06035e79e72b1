"""The answers of a perceptual study: one row per answer (`signface.study.reading` reads them).

- `combine`: several groups of participants as one study.
- `Responses`: the table with the derived column `correct`, its questions, methods, participants and warnings.
- `QUESTIONS`, `FACTORS`: the columns that answer something and those that may explain it.

The columns are those of the thesis's questionnaires (section 6.3.2): `participant`, `stimulus`, `expression` and
`method` are required, with at least one column of answers. A column that is absent or empty was not asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from signface.content import Content

REQUIRED = ("participant", "stimulus", "expression", "method")

#: column: what it is called in tables. `correct` is derived from `answer_expression`.
QUESTIONS = {
    "correct": "accuracy",
    "answer_intensity": "intensity",
    "answer_difficulty": "ease",
    "answer_credibility": "credibility",
    "answer_fidelity": "fidelity",
}

#: The Likert questions and their ends, as the participants read them.
SCALES = {
    "answer_intensity": "1 (very weak) to 7 (very strong)",
    "answer_difficulty": "1 (very difficult) to 7 (very easy)",
    "answer_credibility": "1 (not credible at all) to 7 (very credible)",
    "answer_fidelity": "1 (not faithful at all) to 7 (very faithful)",
}
LIKERT = (1, 7)

#: Columns about the participant: one value for all of a participant's rows.
PERSONAL = {"age": "age", "gender": "gender", "avatar_habit": "habit of avatars", "vision_problem": "vision problem"}

#: Names of the columns that may explain an answer.
FACTORS = {
    **PERSONAL,
    "intensity": "played intensity",
    "expression": "played expression",
    "method": "method",
}

#: The columns of a study's csv, in its order.
COLUMNS = (
    *("participant", *PERSONAL, "stimulus", "expression", "intensity", "method"),
    *("answer_expression", *SCALES),
)

#: The order of expressions in tables, whatever language or case names them; others follow in alphabetical order.
_ORDER = (
    ("a", "anger", "colère", "colere", "c"),
    ("d", "disgust", "dégoût", "dégout", "degout"),
    ("f", "fear", "peur", "p"),
    ("j", "joy", "joie", "happiness"),
    ("sa", "sadness", "tristesse", "t"),
    ("su", "surprise"),
    ("n", "neutral", "neutre"),
)

#: How many rows or names one message spells out; the rest are counted.
SPELT_OUT = 5


@dataclass(frozen=True, eq=False)
class Responses(Content):
    """The answers of one study.

    Parameters
    ----------
    table : pandas.DataFrame
        One row per answer with the columns of the csv and `correct` (1.0, 0.0 or NaN). Likert answers are float with
        NaN where a question was not asked; labels are str; `vision_problem` is `yes` or `no`.
    warnings : tuple of str
        What a reader of the results must know, one line each.
    simulated : bool
        Whether the answers come from `signface study simulate` and from nobody.
    name : str
        Where they were read from.
    """

    table: pd.DataFrame
    warnings: tuple[str, ...] = ()
    simulated: bool = False
    name: str = "responses"

    @property
    def methods(self) -> list[str]:
        """The methods in alphabetical order, so that the order of rows does not matter."""
        return sorted(self.table["method"].unique())

    @property
    def expressions(self) -> list[str]:
        """The played expressions, anger first as in the thesis."""
        return order_expressions(self.table["expression"].unique())

    @property
    def participants(self) -> list[str]:
        """The participants' pseudonyms, sorted."""
        return sorted(self.table["participant"].unique())

    @property
    def questions(self) -> dict[str, str]:
        """Column and name of every question that was answered at least once."""
        return {column: name for column, name in QUESTIONS.items() if self.table[column].notna().any()}

    @property
    def scales(self) -> dict[str, str]:
        """As `questions`, the Likert ones alone."""
        return {column: name for column, name in self.questions.items() if column in SCALES}

    def factors(self) -> dict[str, str]:
        """Column and name of every factor that has at least two values."""
        return {column: name for column, name in FACTORS.items() if self.table[column].nunique() > 1}

    def people(self) -> pd.DataFrame:
        """One row per participant, with the personal columns; indexed by participant, sorted."""
        return self.table.groupby("participant")[list(PERSONAL)].first().sort_index()

    def item(self) -> pd.Series:
        """What was shown, whatever the method: the key on which answers are paired.

        The stimulus itself where participants saw one stimulus with several methods; otherwise expression and
        played intensity, as in the thesis, where each film has its own number.
        """
        shared = self.table.groupby(["participant", "stimulus"])["method"].nunique().max() > 1
        if shared:
            return self.table["stimulus"]
        return self.table["expression"] + " " + self.table["intensity"].map(lambda value: f"{value:g}")


def order_expressions(labels: Sequence[str]) -> list[str]:
    """Labels of expressions in the order of the thesis's tables (anger, disgust, fear, joy, sadness, surprise)."""
    place = {word: rank for rank, words in enumerate(_ORDER) for word in words}
    return sorted(labels, key=lambda label: (place.get(str(label).strip().lower(), len(_ORDER)), str(label)))


def combine(studies: Sequence[Responses]) -> Responses:
    """The answers of several groups as one study: groups 2a and 2b of the thesis make tables 6.8 and 6.9 together.

    Parameters
    ----------
    studies : sequence of Responses
        Participants of different studies are different people, whatever their pseudonyms.

    Returns
    -------
    Responses
        Simulated if any part is; each warning names its study. One study comes back as it is.
    """
    if len(studies) == 1:
        return studies[0]
    names = [Path(study.name).name for study in studies]
    if len(set(names)) < len(names):
        names = [f"{name} ({place})" for place, name in enumerate(names, start=1)]
    tables = [
        study.table.assign(participant=f"{name}: " + study.table["participant"]) for name, study in zip(names, studies)
    ]
    warnings = [f"{name}: {warning}" for name, study in zip(names, studies) for warning in study.warnings]
    simulated = any(study.simulated for study in studies)
    return Responses(pd.concat(tables, ignore_index=True), tuple(warnings), simulated, " + ".join(names))
