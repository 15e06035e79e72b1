"""The answers of a study, read once and validated.

- `read_responses`: read the csv; everything that must be mended is said in one error, the rest becomes a warning.
- `validate`: the same of a table.
"""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike

import pandas as pd

from signface.errors import SignfaceError
from signface.study.doubts import doubts, listed
from signface.study.missing import is_missing
from signface.study.responses import COLUMNS, LIKERT, PERSONAL, REQUIRED, SCALES, SPELT_OUT, Responses
from signface.study.text_table import ROW, read_table

_YES = {"yes", "oui", "y", "o", "true", "vrai", "1"}
_NO = {"no", "non", "n", "false", "faux", "0"}

#: Columns of numbers, where no word is an answer.
_NUMBERS = {*SCALES, "age", "avatar_habit", "intensity"}


def read_responses(path: str | PathLike[str]) -> Responses:
    """Read and validate the answers of a study.

    Parameters
    ----------
    path : path
        A csv with a header, UTF-8, separated by commas, semicolons or tabs.

    Returns
    -------
    Responses
        Cells that say that nothing was answered (`signface.study.missing`) are as empty ones; blank rows are left out.

    Raises
    ------
    SignfaceError
        The file cannot be read; a required column is missing or named twice; an answer is out of its range; a row names
        no participant, stimulus, expression or method; a participant answered one stimulus twice and differently, or
        has two ages, genders, habits or visions. All of it is said at once.
    """
    return validate(read_table(path, hint="name the UTF-8 csv that `signface study export` wrote"), name=str(path))


def validate(raw: pd.DataFrame, *, name: str = "responses") -> Responses:
    """Turn a table of text into `Responses`; see `read_responses` for what is refused.

    Parameters
    ----------
    raw : pandas.DataFrame
        Text or numbers. Messages count the header as row 1; a table of `read_table` has its rows' numbers as its index.
    name : str
        Opens the messages.
    """
    table = raw.copy()
    table.columns = [str(column).strip() for column in table.columns]
    if table.index.name != ROW:
        table.index = pd.RangeIndex(2, len(table) + 2)
    missing = [column for column in REQUIRED if column not in table]
    answers = [column for column in ("answer_expression", *SCALES) if column in table]
    if missing or not answers:
        what = [f"column{'s' if len(missing) > 1 else ''} {listed(missing)} missing"] if missing else []
        what += [] if answers else ["no column of answers"]
        raise SignfaceError(
            "; ".join(what), file=name, hint=f"the columns are {', '.join((*REQUIRED, 'answer_expression', *SCALES))}"
        )
    warnings: list[str] = []
    problems: list[str] = []
    for column in (*PERSONAL, "intensity"):
        if column not in table:
            warnings.append(f"column {column!r} is missing: its influence is not analysed")
            table[column] = ""
    for column in ("answer_expression", *SCALES):
        if column not in table:
            table[column] = ""
    table = table.map(_text)
    written, table = table, table.copy()
    for column in COLUMNS:
        number = column in _NUMBERS
        table[column] = [("" if is_missing(word, number=number) else word) for word in table[column]]
    table = table[(table[list(COLUMNS)] != "").any(axis=1)]  # spreadsheets leave rows of empty cells at the end
    if table.empty:
        raise SignfaceError("holds no answer", file=name, hint="export it again once participants have answered")
    table, written = table.copy(), written.loc[table.index]
    warnings += _read_as_missing(written, table)

    for column in REQUIRED:
        _refuse(problems, table[column] == "", f"no {column}", written[column] if written[column].any() else None)
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
        raise SignfaceError(
            "; ".join(problems),
            file=name,
            hint="mend these rows, leaving cells empty where nothing was answered, and run it again",
        )

    for column in PERSONAL:  # known of a participant once, known in all of their rows
        table[column] = table.groupby("participant")[column].transform("first")
    table = table.reset_index(drop=True)
    right = (table["answer_expression"] == table["expression"]).astype(float)
    table["correct"] = right.where(table["answer_expression"].notna())
    kept = [*REQUIRED, *PERSONAL, "intensity", "answer_expression", *SCALES, "correct"]
    responses = Responses(table[kept], (), simulated, name)
    return Responses(responses.table, (*warnings, *doubts(responses)), simulated, name)


def _read_as_missing(written: pd.DataFrame, table: pd.DataFrame) -> list[str]:
    """Which words were read as missing, and where: whoever wrote them must be able to disagree."""
    lines = []
    for column in COLUMNS:
        words = written.loc[(written[column] != "") & (table[column] == ""), column]
        if len(words) and column not in REQUIRED:
            lines.append(f"{column}: {len(words)} cells read as missing ({listed(sorted(set(words)))})")
    return lines


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
    named = ", ".join(f"{row}" + (f" ({words[row]!r})" if words is not None else "") for row in rows[:SPELT_OUT])
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
            f"(row {differing[0]})" + (f", and {len(differing) - 1} more such rows" if len(differing) > 1 else "")
        )
    if int(same.sum()):
        warnings.append(f"{int(same.sum())} repeated rows left out (same participant, stimulus and answers)")
    return table[~again]
