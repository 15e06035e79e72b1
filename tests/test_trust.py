"""Where the solved face lies far from the markers is told, and marked in the EAF."""

import numpy as np
import pytest

from signface.annotation import annotate
from signface.datasets import mini_take
from signface.elan.document import read_document, tier_rows
from signface.elan.writing import write_eaf
from signface.label.persistence import load_model
from signface.settings.eaf import EafOptions
from signface.settings.solve import SolveSettings
from signface.solver.solving import solve
from signface.trust import residual_words, untrusted, worst


@pytest.fixture(scope="module")
def take():
    return mini_take("M2_EU_04")


@pytest.fixture(scope="module")
def swapped(take):
    positions = take.positions.copy()
    columns = [take.labels.index("HEADL"), take.labels.index("HEADR")]
    positions[400:700, columns] = positions[400:700, columns[::-1]]
    return take.changed("swapped", positions=positions)


@pytest.fixture(scope="module")
def unchecked(swapped):
    return annotate(swapped, load_model("default"), settings=SolveSettings(check_markers=False))


def test_each_take_is_held_against_its_own_noise():
    noise = np.abs(np.random.default_rng(0).normal(4.0, 1.5, 2000))
    assert untrusted(noise, 30.0) == []
    noise[600:700] = 18.0
    (stretch,) = untrusted(noise, 30.0, start=10.0)
    assert (stretch.start_s, stretch.end_s) == pytest.approx((30.0, 10 + 700 / 30), abs=0.1)


def test_a_take_that_is_wrong_throughout_is_not_trusted():
    assert [(one.start_s, one.end_s) for one in untrusted(np.full(400, 60.0), 200.0)] == [(0.0, 2.0)]


def test_a_face_that_was_lost_for_a_while_is_not_trusted():
    residual = np.full(400, 0.3)
    residual[100:110] = residual[200:300] = np.nan
    assert [str(one) for one in untrusted(residual, 200.0)] == ["no face at 1.000 to 1.500 s"]


def test_weights_that_were_not_solved_say_nothing():
    residual = np.full(100, np.nan)
    assert untrusted(residual, 60.0) == []
    assert worst(residual, 60.0) is None
    assert residual_words(residual, 60.0) == "median residual unknown"


def test_of_a_good_take_the_worst_half_second_is_told():
    residual = np.full(1000, 0.2)
    residual[600:700] = 0.9
    assert residual_words(residual, 200.0, 1.0) == "median residual 0.20 mm, worst 0.90 mm at 4.000 to 4.500 s"


def test_swapped_head_markers_nobody_looked_for_are_told_and_doubtful_in_the_eaf(unchecked, tmp_path):
    (stretch,) = unchecked.untrusted
    assert (stretch.start_s, stretch.end_s) == pytest.approx((2.0, 3.5), abs=0.05)
    assert stretch.residual_mm > 100
    assert "do not trust 2.0" in str(unchecked)
    write_eaf(unchecked, tmp_path / "take.eaf")
    rows = tier_rows(read_document(tmp_path / "take.eaf").getroot())
    table = unchecked.segments.table
    reached = table[(table["start_s"] < stretch.end_s) & (table["end_s"] > stretch.start_s)]
    assert len(rows["affect-doubtful"]) == len(reached) < len(table)
    assert "220" in unchecked.facts["untrusted"]


def test_segments_of_low_confidence_stay_beside_them(unchecked, tmp_path):
    write_eaf(unchecked, tmp_path / "few.eaf", options=EafOptions(doubtful=0.0))
    write_eaf(unchecked, tmp_path / "all.eaf", options=EafOptions(doubtful=1.0))
    few, every = (
        tier_rows(read_document(tmp_path / name).getroot())["affect-doubtful"] for name in ("few.eaf", "all.eaf")
    )
    assert 0 < len(few) < len(every)


def test_mended_they_change_nothing(take, swapped, tmp_path):
    model = load_model("default")
    plain, mended = annotate(take, model), annotate(swapped, model)
    np.testing.assert_allclose(mended.descriptors.weights, plain.descriptors.weights, rtol=0, atol=1e-6)
    assert mended.untrusted == plain.untrusted == ()
    assert mended.facts["markers"] == "HEADL and HEADR swapped 2.000 to 3.495 s (swapped back)"
    assert mended.facts["markers"] in str(mended)
    assert "markers" not in plain.facts
    write_eaf(plain, tmp_path / "take.eaf")
    assert "affect-doubtful" not in tier_rows(read_document(tmp_path / "take.eaf").getroot())


def test_a_ghost_in_one_frame_changes_no_label(take):
    model = load_model("default")
    positions = take.positions.copy()
    positions[500, take.labels.index("LIPUM")] += (300, 200, 100)
    plain, ghost = annotate(take, model), annotate(take.changed("ghost", positions=positions), model)
    assert ghost.segments.table["label"].tolist() == plain.segments.table["label"].tolist()
    assert np.abs(ghost.descriptors.weights - plain.descriptors.weights).max() < 0.02


def test_the_check_in_pieces_is_the_check_in_memory(swapped):
    whole, pieces = solve(swapped), solve(swapped, piece=200)
    np.testing.assert_allclose(pieces.weights, whole.weights, rtol=0, atol=1e-6)
    assert pieces.history == whole.history
    assert pieces.wrong_markers == whole.wrong_markers != ""
