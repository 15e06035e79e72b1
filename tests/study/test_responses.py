"""Reading the answers of a study: what is refused in one line, what becomes a warning, what is derived."""

from __future__ import annotations

import pandas as pd
import pytest

from signface.errors import SignfaceError
from signface.study.reading import read_responses, validate
from signface.study.responses import combine, order_expressions
from signface.study.statistics.analysis import analyse
from signface.study.statistics.simulation import Effects, crossed_design, simulate

FOUR = ("correct", "answer_intensity", "answer_difficulty", "answer_credibility")


def answers(participants: int = 6, methods: tuple[str, ...] = ("A", "B")) -> pd.DataFrame:
    """Simulated answers without their mark, to be damaged."""
    return simulate(crossed_design("small", methods, FOUR, participants), seed=2).drop(columns="simulated")


def refusal(table: pd.DataFrame) -> str:
    with pytest.raises(SignfaceError) as found:
        validate(table, name="answers.csv")
    message = str(found.value)
    assert message.startswith("answers.csv: ")
    assert "\n" not in message
    return message


def warned(table: pd.DataFrame, *words: str) -> bool:
    return any(all(word in warning for word in words) for warning in validate(table).warnings)


def test_correct_is_the_answer_that_names_what_was_played():
    responses = validate(answers())
    right = responses.table["answer_expression"] == responses.table["expression"]
    assert (responses.table["correct"] == right).all()
    assert list(responses.questions.values()) == ["accuracy", "intensity", "ease", "credibility"]
    assert not responses.warnings
    assert not responses.simulated


def test_expressions_come_in_the_order_of_the_thesis_in_either_language():
    assert order_expressions(["Su", "J", "A", "Sa", "D", "F"]) == ["A", "D", "F", "J", "Sa", "Su"]
    assert order_expressions(["Surprise", "Joie", "Colère"]) == ["Colère", "Joie", "Surprise"]
    assert order_expressions(["zest", "joy", "awe"]) == ["joy", "awe", "zest"]


@pytest.mark.parametrize("separator", [",", ";"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_a_spreadsheets_csv_is_read(tmp_path, separator, encoding):
    file = tmp_path / "answers.csv"
    answers().to_csv(file, index=False, sep=separator, encoding=encoding)
    assert len(read_responses(file).table) == 6 * 36


def test_files_that_are_no_table_are_refused(tmp_path):
    for name, content in {"empty.csv": b"", "bytes.csv": b"\xff\xfe\x00\x81", "word.csv": b"hello\n"}.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(SignfaceError, match=name):
            read_responses(tmp_path / name)
    with pytest.raises(SignfaceError, match="no such file"):
        read_responses(tmp_path / "absent.csv")


def test_missing_columns_are_named():
    message = refusal(answers().drop(columns=["method", "stimulus"]))
    assert "columns stimulus, method missing" in message
    assert "no column of answers" in refusal(
        answers().drop(
            columns=["answer_expression", *[column for column in answers() if column.startswith("answer_")][1:]]
        )
    )
    assert warned(answers().drop(columns="age"), "'age' is missing")
    assert "holds no answer" in refusal(answers().iloc[:0])


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("answer_intensity", 0, "answer_intensity out of range in row 5"),
        ("answer_intensity", 8, "answer_intensity out of range"),
        ("answer_credibility", 3.5, "'3.5'"),
        ("answer_difficulty", "high", "'high'"),
        ("avatar_habit", 9, "avatar_habit out of range"),
        ("age", 400, "age out of range"),
        ("intensity", -1, "intensity out of range"),
        ("vision_problem", "perhaps", "neither yes nor no"),
        ("participant", "", "no participant in row 5"),
        ("method", " ", "no method in row 5"),
        ("expression", "", "no expression in row 5"),
    ],
)
def test_an_answer_out_of_its_range_is_refused_with_its_row(column, value, words):
    table = answers().astype(object)
    table.loc[3, column] = value
    assert words in refusal(table)


def test_everything_wrong_is_said_at_once():
    table = answers().astype(object)
    table.loc[0, "answer_intensity"] = 9
    table.loc[1, "method"] = ""
    table.loc[2, "age"] = "old"
    message = refusal(table)
    assert all(word in message for word in ("answer_intensity", "no method", "age"))


def test_who_answers_twice_and_differently_is_refused_and_a_copied_row_is_left_out():
    table = answers()
    copied = pd.concat([table, table.iloc[[4]]])
    assert warned(copied, "1 repeated row")
    assert len(validate(copied).table) == len(table)
    changed = table.iloc[[4]].assign(answer_intensity=8 - table.loc[4, "answer_intensity"], answer_difficulty=1)
    message = refusal(pd.concat([table, changed], ignore_index=True))
    assert f"participant {table.loc[4, 'participant']} answered stimulus {table.loc[4, 'stimulus']} twice" in message
    assert f"row {len(table) + 2}" in message


def test_a_participant_has_one_age():
    table = answers()
    table.loc[7, "age"] += 1
    assert "more than one age" in refusal(table)


@pytest.mark.slow
def test_two_groups_make_one_study_of_different_people():
    first = validate(answers(), name="2a.csv")
    second = validate(
        simulate(crossed_design("b", ["A", "B"], ["answer_fidelity"], 6), seed=4).drop(columns="simulated"),
        name="2b.csv",
    )
    both = combine([first, second])
    assert len(both.participants) == 12
    assert list(both.questions.values()) == ["accuracy", "intensity", "ease", "credibility", "fidelity"]
    alone, together = analyse(first, resamples=100), analyse(both, resamples=100)
    for key in ("hypotheses", "pairwise"):
        one, two = alone.table(key), together.table(key)
        assert one is not None
        assert two is not None
        assert two.frame["p"].iloc[: len(one.frame)].tolist() == pytest.approx(one.frame["p"].tolist())
        assert len(two.frame) == len(one.frame) + 1
    assert combine([first]) is first


def test_what_weakens_a_study_is_a_warning():
    table = answers()
    assert warned(answers(methods=("A",)), "one method only")
    assert warned(table[(table["expression"] != "J") | (table["method"] != "B")], "no answer for J × B")
    assert warned(table.assign(answer_credibility=4), "every answer about credibility is 4")
    first = table["participant"] == table["participant"].iloc[0]
    assert warned(table.assign(answer_difficulty=table["answer_difficulty"].mask(first, 5)), "always the same answer")
    assert warned(table.iloc[3:], "gave fewer than 36 answers")
    assert warned(table.assign(gender="F"), "same gender")
    assert warned(table.replace({"answer_expression": {"J": "pain"}}), "never played: pain")
    assert warned(answers(3), "3 participants")


def test_answers_of_nobody_are_recognised():
    table = simulate(crossed_design("small", ["A", "B"], FOUR, 5), seed=1)
    responses = validate(table)
    assert responses.simulated
    assert responses.warnings[0].startswith("SIMULATED")
    mixed = pd.concat([answers(), table.assign(participant=table["participant"] + "x")])
    assert validate(mixed).simulated


@pytest.mark.slow
@pytest.mark.parametrize(
    "damage",
    [
        lambda table: table[table["method"] == "A"],
        lambda table: table[(table["expression"] != "J") | (table["method"] != "B")],
        lambda table: table.assign(answer_credibility=4, answer_intensity=7),
        lambda table: table.assign(answer_expression=table["expression"]),
        lambda table: table.assign(answer_expression="", answer_intensity="", answer_difficulty=""),
        lambda table: table.drop(columns=["age", "gender", "avatar_habit", "vision_problem", "intensity"]),
        lambda table: table[table["participant"].isin(["S1", "S2"])],
        lambda table: table[table["participant"] == "S1"],
        lambda table: table.sample(30, random_state=0),
        lambda table: table.iloc[:1],
        lambda table: table[(table["participant"] < "S4") == (table["method"] == "A")],
    ],
    ids=[
        "one-method",
        "empty-cell",
        "constant",
        "all-right",
        "one-question",
        "nobody-known",
        "two-people",
        "one-person",
        "few",
        "one",
        "between",
    ],
)
def test_a_poor_study_is_analysed_as_far_as_it_goes(damage):
    analysis = analyse(validate(damage(answers())), resamples=100)
    for table in analysis.tables:
        assert len(table.cells()) == len(table.frame)
        for column in table.frame.columns:
            if table.kind(column) == "p":
                values = pd.to_numeric(table.frame[column], errors="coerce").dropna()
                assert values.between(0, 1).all()


def test_stimuli_shared_by_methods_pair_by_stimulus_and_films_by_what_was_played():
    by_film = validate(answers())
    assert by_film.item().nunique() == 18
    shared = answers()
    shared["stimulus"] = shared["stimulus"].str.removesuffix("_A").str.removesuffix("_B")
    responses = validate(shared)
    assert set(responses.item()) == set(shared["stimulus"])


@pytest.mark.slow
def test_the_analysis_does_not_depend_on_the_order_of_rows_nor_on_names():
    table = simulate(crossed_design("two", ["A", "B"], FOUR, 6), Effects({("B", "*"): 0.4}), seed=5)
    shuffled = table.sample(frac=1, random_state=1)
    renamed = table.assign(participant="Z" + table["participant"], gender=table["gender"].map({"F": "f", "M": "m"}))
    plain = analyse(validate(table), resamples=100)
    for other in (analyse(validate(shuffled), resamples=100), analyse(validate(renamed), resamples=100)):
        for before, after in zip(plain.tables, other.tables):
            for column in before.frame.columns:
                if before.kind(column) in ("p", "statistic", "effect"):
                    pd.testing.assert_series_equal(
                        pd.to_numeric(before.frame[column], errors="coerce"),
                        pd.to_numeric(after.frame[column], errors="coerce"),
                        check_names=False,
                        rtol=1e-3,
                        atol=1e-4,
                    )
