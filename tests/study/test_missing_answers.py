"""What programs write where nothing was answered is a missing answer, never a wrong one."""

from __future__ import annotations

import pandas as pd
import pytest

from signface.errors import SignfaceError
from signface.study.reading import read_responses, validate
from tests.study.test_responses import answers, refusal

WORDS = (
    "NA",
    "NaN",
    "nan",
    "null",
    "NULL",
    "n/a",
    "N/A",
    ".",
    " NA ",
    "#N/A",
    "<NA>",
    "None",
    "#NULL!",
    ".a",
    "-",
    "\\N",
)


def shares(table: pd.DataFrame) -> list[float]:
    return validate(table).table.groupby("method")["correct"].mean().tolist()


@pytest.mark.parametrize("word", WORDS)
def test_a_word_for_missing_counts_as_an_empty_cell(word):
    table = answers().astype(object)
    some = table.index % 5 == 0
    columns = ["answer_expression", "answer_intensity", "answer_difficulty"]
    empty, marked = table.copy(), table.copy()
    empty.loc[some, columns] = ""
    marked.loc[some, columns] = word
    pd.testing.assert_frame_equal(validate(marked).table, validate(empty).table)
    assert shares(marked) == shares(empty)
    assert any("answer_expression" in line and "read as missing" in line for line in validate(marked).warnings)
    assert not any("never played" in line for line in validate(marked).warnings)


@pytest.mark.parametrize("column", ["age", "gender", "avatar_habit", "vision_problem", "intensity"])
@pytest.mark.parametrize("word", ["NA", "n/a", "."])
def test_what_is_not_known_of_a_participant_was_not_asked(column, word):
    table = answers().astype(object)
    table[column] = word
    assert validate(table).table[column].isna().all()


@pytest.mark.parametrize("code", ["-99", "-9", "-99.0", -999])
def test_codes_for_missing_are_missing_in_numbers_and_refused_nowhere(code):
    table = answers().astype(object)
    table.loc[3, "answer_intensity"] = code
    assert pd.isna(validate(table).table.loc[3, "answer_intensity"])


def test_none_of_these_is_an_answer():
    table = answers().astype(object)
    table.loc[3, "answer_expression"] = "none"
    assert validate(table).table.loc[3, "correct"] == 0.0


def test_a_row_without_its_participant_is_refused_with_the_word_that_stands_there():
    table = answers().astype(object)
    table.loc[3, "participant"] = "NA"
    assert "no participant in row 5 ('NA')" in refusal(table)


def test_an_age_given_once_is_known_in_all_rows_of_a_participant():
    table = answers().astype(object)
    first = ~table.duplicated("participant")
    sparse = table.assign(age=table["age"].where(first, "NA"))
    assert validate(sparse).table["age"].tolist() == validate(table).table["age"].tolist()


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_blank_rows_are_left_out_wherever_they_stand_and_rows_keep_their_numbers(tmp_path, separator, encoding):
    text = answers().to_csv(index=False, sep=separator, lineterminator="\n")
    lines = text.splitlines()
    blank = separator * lines[0].count(separator)
    spread = ["", blank, lines[0] + separator * 2, *lines[1:4], "", blank, *lines[4:], blank, blank, "   ", ""]
    file = tmp_path / "spread.csv"
    file.write_text("\n".join(spread), encoding=encoding)
    pd.testing.assert_frame_equal(read_responses(file).table, validate(answers()).table)
    cells = spread[8].split(separator)
    cells[lines[0].split(separator).index("answer_intensity")] = "9"
    file.write_text("\n".join([*spread[:8], separator.join(cells), *spread[9:]]), encoding=encoding)
    with pytest.raises(SignfaceError, match=r"answer_intensity out of range in row 9 \('9'\)"):
        read_responses(file)


def test_a_column_named_twice_and_a_cell_too_many_are_refused(tmp_path):
    lines = answers().to_csv(index=False).splitlines()
    (tmp_path / "twice.csv").write_text("\n".join([f"{lines[0]},method", *(f"{line},A" for line in lines[1:])]))
    (tmp_path / "long.csv").write_text("\n".join([*lines[:3], f"{lines[3]},5", *lines[4:]]))
    with pytest.raises(SignfaceError, match="two columns are named method"):
        read_responses(tmp_path / "twice.csv")
    with pytest.raises(SignfaceError, match="row 4 holds more cells"):
        read_responses(tmp_path / "long.csv")
