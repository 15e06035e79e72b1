"""The answers of a perceptual study: one row per answer, read once and validated.

- `read_responses`: read the csv; everything that must be mended is said in one error, the rest becomes a warning.
- `combine`: several groups of participants as one study.
- `Responses`: the table with the derived column `correct`, its questions, methods, participants and warnings.
- `QUESTIONS`, `FACTORS`: the columns that answer something and those that may explain it.

The columns are those of the thesis's questionnaires (section 6.3.2): `participant`, `stimulus`, `expression` and
`method` are required, with at least one column of answers. A column that is absent or empty was not asked.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import pandas as pd

from signface.content import Content
from signface.errors import SignfaceError

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

_YES = {"yes", "oui", "y", "o", "true", "vrai", "1"}
_NO = {"no", "non", "n", "false", "faux", "0"}

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


def read_responses(path: str | PathLike[str]) -> Responses:
    """Read and validate the answers of a study.

    Parameters
    ----------
    path : path
        A csv with a header, UTF-8, separated by commas or semicolons.

    Returns
    -------
    Responses

    Raises
    ------
    SignfaceError
        The file cannot be read; a required column is missing; an answer is out of its range; a row names no
        participant, stimulus, expression or method; a participant answered one stimulus twice and differently, or
        has two ages, genders, habits or visions. All of it is said at once.
    """
    try:
        raw = pd.read_csv(path, dtype=str, keep_default_na=False, sep=None, engine="python", encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise SignfaceError(
            "no such file", file=path, hint="name the csv that `signface study export` wrote"
        ) from error
    except (OSError, UnicodeDecodeError, pd.errors.ParserError, pd.errors.EmptyDataError, ValueError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise SignfaceError(f"cannot be read as a csv ({reason})", file=path, hint="save it as UTF-8 csv") from error
    except Exception as error:
        if type(error).__module__ == "_csv":  # the sniffer of separators gives up: one column, or not a table
            raise SignfaceError("is no table", file=path, hint="save it as csv with a header") from error
        raise
    return validate(raw, name=str(path))


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


def validate(raw: pd.DataFrame, *, name: str = "responses") -> Responses:
    """Turn a table of text into `Responses`; see `read_responses` for what is refused.

    Parameters
    ----------
    raw : pandas.DataFrame
        Text or numbers; the row numbers in messages count the header as row 1.
    name : str
        Opens the messages.
    """
    table = raw.copy()
    table.columns = [str(column).strip() for column in table.columns]
    table = table.reset_index(drop=True)
    missing = [column for column in REQUIRED if column not in table]
    answers = [column for column in ("answer_expression", *SCALES) if column in table]
    if missing or not answers:
        what = [f"column{'s' if len(missing) > 1 else ''} {_listed(missing)} missing"] if missing else []
        what += [] if answers else ["no column of answers"]
        raise SignfaceError(
            "; ".join(what), file=name, hint=f"the columns are {', '.join((*REQUIRED, 'answer_expression', *SCALES))}"
        )
    if table.empty:
        raise SignfaceError("holds no answer", file=name, hint="export it again once participants have answered")
    warnings: list[str] = []
    problems: list[str] = []
    for column in (*PERSONAL, "intensity"):
        if column not in table:
            warnings.append(f"column {column!r} is missing: its influence is not analysed")
            table[column] = ""
    for column in ("answer_expression", *SCALES):
        if column not in table:
            table[column] = ""
    for column in table.columns:
        table[column] = table[column].map(_text)

    for column in REQUIRED:
        _refuse(problems, table[column] == "", f"no {column}")
    for column in SCALES:
        table[column] = _numbers(
            problems, table[column], column, lambda value: value.between(*LIKERT) & (value % 1 == 0)
        )
    table["avatar_habit"] = _numbers(
        problems, table["avatar_habit"], "avatar_habit", lambda value: value.between(*LIKERT) & (value % 1 == 0)
    )
    table["age"] = _numbers(problems, table["age"], "age", lambda value: value.between(5, 120))
    table["intensity"] = _numbers(problems, table["intensity"], "intensity", lambda value: value >= 0)
    vision = table["vision_problem"].str.lower()
    _refuse(problems, ~vision.isin({"", *_YES, *_NO}), "vision_problem is neither yes nor no", table["vision_problem"])
    table["vision_problem"] = vision.map(lambda word: "yes" if word in _YES else "no" if word in _NO else "")
    for column in ("gender", "vision_problem", "answer_expression"):
        table[column] = table[column].where(table[column] != "", None).astype(object)

    simulated = bool("simulated" in table and table["simulated"].str.lower().isin(_YES).any())
    asked = ["answer_expression", *SCALES]
    blank = table[asked].isna().all(axis=1)
    if blank.all():
        problems.append("no row holds an answer")
    elif blank.any():
        warnings.append(f"{int(blank.sum())} rows without any answer left out")
        table = table[~blank]
    table = _once(table, warnings, problems)
    for column, title in PERSONAL.items():
        several = table.groupby("participant")[column].nunique()
        several = several[several > 1]
        if len(several):
            who = several.index[0]
            values = ", ".join(
                str(value) for value in sorted(table.loc[table["participant"] == who, column].dropna().unique())
            )
            problems.append(
                f"participant {who} has more than one {title} ({values})"
                + (f", and so have {len(several) - 1} others" if len(several) > 1 else "")
            )
    if problems:
        raise SignfaceError("; ".join(problems), file=name, hint="mend these rows and run the analysis again")

    table = table.reset_index(drop=True)
    right = (table["answer_expression"] == table["expression"]).astype(float)
    table["correct"] = right.where(table["answer_expression"].notna())
    kept = [*REQUIRED, *PERSONAL, "intensity", "answer_expression", *SCALES, "correct"]
    responses = Responses(table[kept], (), simulated, name)
    return Responses(responses.table, (*warnings, *_doubts(responses)), simulated, name)


def _text(value: object) -> str:
    if value is None or (isinstance(value, float) and value != value):
        return ""
    return str(value).strip()


def _numbers(problems: list[str], words: pd.Series, column: str, valid: Callable[[pd.Series], pd.Series]) -> pd.Series:
    """The words of a column as numbers, NaN where empty; what is no number or out of range is a problem."""
    values = pd.to_numeric(words.where(words != ""), errors="coerce").astype(float)
    wrong = (words != "") & ~(values.notna() & valid(values))
    _refuse(problems, wrong, f"{column} out of range", words)
    return values.where(~wrong)


def _refuse(problems: list[str], wrong: pd.Series, what: str, words: pd.Series | None = None) -> None:
    """Add one problem that names the first rows where `wrong` holds."""
    rows = list(wrong.index[wrong])
    if not rows:
        return
    named = ", ".join(f"{row + 2}" + (f" ({words[row]!r})" if words is not None else "") for row in rows[:SPELT_OUT])
    more = f" and {len(rows) - SPELT_OUT} more" if len(rows) > SPELT_OUT else ""
    problems.append(f"{what} in row{'s' if len(rows) > 1 else ''} {named}{more}")


def _once(table: pd.DataFrame, warnings: list[str], problems: list[str]) -> pd.DataFrame:
    """Keep one row for each participant, stimulus and method; rows that say the same are no harm."""
    key = ["participant", "stimulus", "method", "expression", "intensity"]
    answers = ["answer_expression", *SCALES]
    again = table.duplicated(key, keep="first")
    if not again.any():
        return table
    same = table.duplicated([*key, *answers], keep="first")
    differing = table.index[again & ~same]
    if len(differing):
        first = table.loc[differing[0]]
        problems.append(
            f"participant {first['participant']} answered stimulus {first['stimulus']} twice and differently "
            f"(row {differing[0] + 2})" + (f", and {len(differing) - 1} more such rows" if len(differing) > 1 else "")
        )
    if int(same.sum()):
        warnings.append(f"{int(same.sum())} repeated rows left out (same participant, stimulus and answers)")
    return table[~again]


def _doubts(responses: Responses) -> list[str]:
    """What is no error but changes what can be concluded."""
    table, warnings = responses.table, []
    if responses.simulated:
        warnings.append("SIMULATED ANSWERS: no participant was asked; nothing can be concluded from them")
    if len(responses.methods) == 1:
        warnings.append(
            f"one method only ({responses.methods[0]}): nothing to compare, the tests between methods are left out"
        )
    if len(responses.participants) < 5:
        warnings.append(
            f"{len(responses.participants)} participants: too few for intervals over participants to mean much"
        )
    answer_counts = table.groupby(["expression", "method"]).size().unstack(fill_value=0)
    empty = [
        f"{row} × {column}"
        for row in answer_counts.index
        for column in answer_counts.columns
        if answer_counts.loc[row, column] == 0
    ]
    if empty:
        warnings.append(f"no answer for {_listed(empty)}: the tests over expression and method are left out")
    elif answer_counts.to_numpy().min() != answer_counts.to_numpy().max():
        warnings.append(
            "not every expression was shown equally often with every method: means by method mix unequal shares"
        )
    counts = table.groupby("participant").size()
    if counts.nunique() > 1:
        fewer = counts[counts < counts.max()]
        warnings.append(
            f"{len(fewer)} of {len(counts)} participants gave fewer than {counts.max()} answers "
            f"(the fewest: {counts.idxmin()} with {counts.min()}): pairs are made of the answers that exist"
        )
    strange = sorted(set(table["answer_expression"].dropna()) - set(table["expression"]))
    if strange:
        warnings.append(f"answers name expressions that were never played: {_listed(strange)}")
    for column, title in responses.questions.items():
        if table[column].nunique() == 1 and column != "correct":
            warnings.append(f"every answer about {title} is {table[column].dropna().iloc[0]:g}: nothing to test")
        elif column in SCALES:
            each = table.dropna(subset=[column]).groupby("participant")[column].agg(["nunique", "size"])
            flat = each[(each["nunique"] == 1) & (each["size"] > 5)]
            if len(flat):
                warnings.append(f"always the same answer about {title}: {_listed(list(flat.index))}")
    if "correct" in responses.questions and table["correct"].nunique() == 1:
        warnings.append("every expression was recognised, or none: nothing to test about accuracy")
    for column, title in PERSONAL.items():
        people = responses.people()[column]
        if people.notna().any() and people.isna().any():
            warnings.append(f"{int(people.isna().sum())} participants did not give their {title}")
        if people.nunique() == 1 and len(people) > 1:
            warnings.append(
                f"all participants have the same {title} ({people.dropna().iloc[0]}): its influence is not analysed"
            )
    return warnings


def _listed(names: Sequence[str]) -> str:
    head = ", ".join(str(name) for name in names[:SPELT_OUT])
    return head + (f" and {len(names) - SPELT_OUT} more" if len(names) > SPELT_OUT else "")
