"""Simulated answers: their form, their effects, and what the analysis makes of answers without any effect."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import signface
from signface.errors import SignfaceError
from signface.study.reading import validate
from signface.study.statistics.model_tables import compare_methods
from signface.study.statistics.rank_tests import kruskal_wallis
from signface.study.statistics.simulation import DESIGNS, Effects, crossed_design, simulate, thesis_design
from signface.study.statistics.thesis_tables import confusions, pairwise_results, test_methods


def test_the_groups_of_the_thesis_have_its_numbers_of_participants_and_films():
    sizes = {name: len(simulate(thesis_design(name))) for name in DESIGNS}
    assert sizes == {"group-1": 27 * 54, "group-2a": 21 * 54, "group-2b": 20 * 36}
    fidelity = simulate(thesis_design("group-2b"))
    assert fidelity["answer_expression"].isna().all()
    assert fidelity["answer_fidelity"].between(1, 7).all()


def test_every_row_says_that_it_is_simulated_and_the_seed_gives_the_same_bytes():
    design = crossed_design("x", ["A", "B"], ["correct", "answer_intensity"], 4)
    first, again, other = simulate(design, seed=1), simulate(design, seed=1), simulate(design, seed=2)
    assert (first["simulated"] == "yes").all()
    assert first.to_csv() == again.to_csv() != other.to_csv()


def test_each_participant_sees_each_film_once_in_an_order_of_their_own():
    table = simulate(thesis_design("group-1"), participants=5)
    assert (table.groupby(["participant", "stimulus"]).size() == 1).all()
    orders = table.groupby("participant")["stimulus"].agg(tuple)
    assert orders.nunique() == 5


def test_a_studys_folder_is_simulated_as_it_would_be_shown():
    from signface.study.design import read_study
    from signface.study.statistics.simulation import study_design

    folder = Path(signface.__file__).parent / "study" / "examples" / "group-2a"
    study, design = read_study(folder, films=False), study_design(str(folder))
    shown = [stimulus.name for block in study.blocks for stimulus in block.stimuli]
    table = simulate(design, participants=3, seed=1)
    assert sorted(table["stimulus"].unique()) == sorted(shown)
    assert len(validate(table).table) == 3 * len(shown)


def test_a_stimulus_is_asked_the_questions_of_its_block_alone():
    whole = crossed_design("x", ["A", "video"], ["correct", "answer_intensity"], 5)
    videos = whole.stimuli.loc[whole.stimuli["method"] == "video", "stimulus"]
    design = replace(whole, asked=dict.fromkeys(videos, frozenset(["correct"])))
    table = simulate(design, seed=1)
    of_video = table["method"] == "video"
    assert table.loc[of_video, "answer_intensity"].isna().all()
    assert table.loc[~of_video, "answer_intensity"].notna().all()
    assert table["answer_expression"].notna().all()
    responses = validate(table)
    assert compare_methods(responses, "answer_intensity").methods == ["A"]


def test_errors_fall_where_the_thesis_saw_them():
    table = validate(simulate(thesis_design("group-1"), participants=60, seed=1))
    counts = sum(confusions(table).values())
    for played, answered in (("A", "D"), ("D", "A"), ("F", "Su")):
        wrong = counts.loc[played].drop(played)
        assert wrong.idxmax() == answered


def test_a_planted_effect_moves_its_own_question_and_no_other():
    design = crossed_design("x", ["A", "B"], ["answer_intensity", "answer_difficulty", "correct"], 40)
    effects = Effects({("B", "answer_intensity"): 0.5})
    responses = validate(simulate(design, effects, seed=3))
    means = responses.table.groupby("method")[["answer_intensity", "answer_difficulty"]].mean()
    assert means.loc["B", "answer_intensity"] - means.loc["A", "answer_intensity"] > 0.3
    assert abs(means.loc["B", "answer_difficulty"] - means.loc["A", "answer_difficulty"]) < 0.2
    assert test_methods(responses, "answer_intensity").p < 1e-4
    assert test_methods(responses, "correct").p > 0.01
    easier = validate(simulate(design, Effects({("B", "correct"): 1.0}), seed=3))
    shares = easier.table.groupby("method")["correct"].mean()
    assert shares["B"] - shares["A"] > 0.1
    assert test_methods(easier, "correct").p < 1e-4


def test_wrong_effects_and_designs_are_refused():
    design = crossed_design("x", ["A", "B"], ["correct"], 4)
    with pytest.raises(SignfaceError, match="no method 'C'"):
        simulate(design, Effects({("C", "*"): 1}))
    with pytest.raises(SignfaceError, match="is not asked"):
        simulate(design, Effects({("A", "answer_fidelity"): 1}))
    with pytest.raises(SignfaceError, match="needs participants"):
        simulate(design, participants=0)
    with pytest.raises(SignfaceError, match="group-1, group-2a, group-2b"):
        thesis_design("group-3")


def rejections(effects: Effects, studies: int = 16, participants: int = 12) -> dict[str, float]:
    """Share of studies without any mean difference in which each test finds one at 5 %."""
    whole = crossed_design("null", ["A", "B"], ["answer_difficulty"], participants)
    design = replace(whole, stimuli=whole.stimuli[whole.stimuli["expression"].isin(["A", "J", "Sa"])])
    found: dict[str, list[bool]] = {"kruskal": [], "pairs": [], "mixed": [], "averaged": [], "people": []}
    for seed in range(studies):
        responses = validate(simulate(design, effects, seed=seed))
        models = compare_methods(responses, "answer_difficulty")
        pair = pairwise_results(responses, "answer_difficulty")["A", "B"]
        found["kruskal"].append(test_methods(responses, "answer_difficulty").p < 0.05)
        found["pairs"].append(pair.p < 0.05)
        found["mixed"].append(models.likelihood_ratio.p < 0.05)
        found["averaged"].append(models.averaged.p < 0.05)
        found["people"].append(models.over_participants.p < 0.05)
    return {name: float(np.mean(values)) for name, values in found.items()}


@pytest.mark.slow
def test_without_an_effect_every_test_finds_one_in_about_a_twentieth_of_studies():
    found = rejections(Effects(participants=0.5))
    assert all(share <= 0.2 for share in found.values()), found  # of 16 studies, more than 3 have a chance of 1 in 140


@pytest.mark.slow
def test_when_participants_react_differently_only_tests_that_know_participants_keep_their_level():
    found = rejections(Effects(participants=0.5, reactions=0.8))
    assert found["kruskal"] > 0.3
    assert found["pairs"] > 0.3
    assert all(found[name] <= 0.2 for name in ("mixed", "averaged", "people")), found


@pytest.mark.slow
def test_what_belongs_to_participants_is_found_too_often_over_answers_and_not_over_participants():
    design = crossed_design("null", ["A"], ["answer_difficulty"], 20)
    over_answers, over_people = [], []
    for seed in range(25):
        table = simulate(design, Effects(participants=0.6), seed=seed)
        half = table["participant"] <= "S10"
        means = table.groupby("participant")["answer_difficulty"].mean()
        over_answers.append(
            kruskal_wallis([table.loc[half, "answer_difficulty"], table.loc[~half, "answer_difficulty"]]).p < 0.05
        )
        over_people.append(kruskal_wallis([means[means.index <= "S10"], means[means.index > "S10"]]).p < 0.05)
    assert np.mean(over_answers) > 0.3
    assert np.mean(over_people) <= 0.2


def test_the_csv_comes_back_as_it_was_written(tmp_path):
    table = simulate(crossed_design("x", ["A", "B"], ["correct", "answer_intensity"], 4))
    table.to_csv(tmp_path / "answers.csv", index=False)
    again = pd.read_csv(tmp_path / "answers.csv")
    pd.testing.assert_frame_equal(
        validate(again).table, validate(table.astype(object).where(table.notna(), "")).table, check_dtype=False
    )
