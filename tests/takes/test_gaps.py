"""Gaps are filled where that can be done well, and only there."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from signface.errors import SignfaceError
from signface.takes.gaps import fill_gaps, gap_runs
from signface.takes.rigid import apply
from signface.takes.take import Take
from tests.fixtures.takes_files import moving_face, with_gaps


def worst(filled, truth, marker, begin, end):
    return np.linalg.norm(filled.positions - truth.positions, axis=2)[begin:end, marker].max()


@pytest.mark.parametrize("rate", [30.0, 60.0, 120.0, 200.0])
def test_a_short_gap_is_bridged_within_half_a_millimetre_at_any_rate(rate):
    truth, _ = moving_face(2.0, rate, seed=2)
    begin = round(rate)
    end = begin + int(0.05 * rate)
    filled = fill_gaps(with_gaps(truth, {3: (begin, end)}))
    assert "1 splined" in filled.history[-1]
    assert worst(filled, truth, 3, begin, end) < 0.5


@pytest.mark.parametrize("length_s", [0.15, 0.3, 0.5])
def test_a_longer_gap_follows_the_neighbours_through_expression_and_head_motion(length_s):
    truth, _ = moving_face(20.0, 100.0, jitter=0.1, seed=4)
    begin, end = 700, 700 + round(length_s * 100)
    filled = fill_gaps(with_gaps(truth, {5: (begin, end)}))
    assert "1 from neighbours" in filled.history[-1]
    part = np.linspace(0, 1, end - begin + 2)[1:-1, None]
    straight = truth.positions[:, 5].copy()
    straight[begin:end] = (1 - part) * straight[begin - 1] + part * straight[end]
    off = np.linalg.norm(straight - truth.positions[:, 5], axis=1).max()
    assert worst(filled, truth, 5, begin, end) < max(0.8, off / 3)


def test_a_marker_that_only_follows_the_head_is_carried_exactly():
    truth, _ = moving_face(4.0, 100.0, expression=0.0)
    filled = fill_gaps(with_gaps(truth, {2: (100, 150), 9: (120, 160)}))
    np.testing.assert_allclose(filled.positions, truth.positions, atol=1e-3)


def test_a_filled_path_joins_its_ends_without_a_step():
    truth, _ = moving_face(10.0, 200.0, jitter=0.15, seed=8)
    for begin, end in ((500, 508), (900, 990)):
        filled = fill_gaps(with_gaps(truth, {1: (begin, end)})).positions[:, 1]
        steps = np.linalg.norm(np.diff(filled, axis=0), axis=1)
        assert steps[[begin - 1, end - 1]].max() < 1.5 * steps[begin - 100 : begin - 1].max()


def test_a_marker_that_slips_while_unseen_is_led_from_its_old_place_to_its_new_one():
    truth, _ = moving_face(10.0, 200.0, seed=8)
    positions = truth.positions.copy()
    begin, end = 900, 980
    positions[end:, 1] += (6.0, 0.0, 0.0)
    filled = fill_gaps(with_gaps(truth.changed("slip", positions=positions), {1: (begin, end)})).positions[:, 1]
    assert np.linalg.norm(filled[begin] - positions[begin, 1]) < 0.5
    assert np.linalg.norm(filled[end - 1] - positions[end - 1, 1] - (6.0, 0.0, 0.0)) < 0.5


def test_gaps_that_are_too_long_or_at_the_ends_stay():
    truth, _ = moving_face(4.0, 100.0)
    filled = fill_gaps(with_gaps(truth, {0: (0, 10), 1: (100, 170), 2: (390, 400), 3: (100, 120)}))
    assert np.isnan(filled.positions[0:10, 0]).all()
    assert np.isnan(filled.positions[100:170, 1]).all()
    assert np.isnan(filled.positions[390:400, 2]).all()
    assert np.isfinite(filled.positions[:, 3:]).all()
    assert "3 left" in filled.history[-1]


def test_the_limits_are_parameters():
    truth, _ = moving_face(4.0, 100.0)
    gappy = with_gaps(truth, {1: (100, 170), 3: (100, 104)})
    assert np.isfinite(fill_gaps(gappy, long_s=1.0).positions).all()
    untouched = fill_gaps(gappy, short_s=0.0, long_s=0.0)
    np.testing.assert_array_equal(untouched.positions, gappy.positions)
    with pytest.raises(SignfaceError, match="0 or more"):
        fill_gaps(gappy, short_s=-1)


def test_a_marker_that_is_never_seen_stays_missing_and_hinders_nobody():
    truth, _ = moving_face(4.0, 100.0)
    gappy = with_gaps(truth, {0: (0, 400), 4: (200, 230)})
    filled = fill_gaps(gappy)
    assert np.isnan(filled.positions[:, 0]).all()
    assert worst(filled, truth, 4, 200, 230) < 1.0


def test_a_long_gap_without_three_neighbours_stays():
    truth, _ = moving_face(4.0, 100.0)
    three = Take(truth.positions[:, :3], truth.labels[:3], truth.rate)
    filled = fill_gaps(with_gaps(three, {0: (100, 120)}))
    assert np.isnan(filled.positions[100:120, 0]).all()


@given(seed=st.integers(0, 2**31), gaps=st.integers(0, 12))
@settings(max_examples=20, deadline=None)
def test_what_was_seen_is_never_changed_and_no_gap_grows(seed, gaps):
    random = np.random.default_rng(seed)
    truth, _ = moving_face(1.0, 60.0, face_markers=8, seed=seed)
    positions = truth.positions.copy()
    for _ in range(gaps):
        begin = random.integers(0, 60)
        positions[begin : begin + random.integers(1, 30), random.integers(0, positions.shape[1])] = np.nan
    gappy = Take(positions, truth.labels, 60.0)
    filled = fill_gaps(gappy)
    seen = np.isfinite(gappy.positions)
    np.testing.assert_array_equal(filled.positions[seen], gappy.positions[seen])
    assert filled.history[: len(gappy.history)] == gappy.history


def test_filling_does_not_depend_on_where_the_recording_stands():
    truth, _ = moving_face(4.0, 100.0, jitter=0.1)
    gappy = with_gaps(truth, {2: (100, 150), 9: (120, 124)})
    angle = 0.8
    pose = np.eye(4)
    pose[:3, :3] = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    pose[:3, 3] = (300, -200, 1000)
    elsewhere = gappy.changed("moved", positions=apply(pose, gappy.positions))
    np.testing.assert_allclose(fill_gaps(elsewhere).positions, apply(pose, fill_gaps(gappy).positions), atol=1e-6)


def test_gap_runs_lists_the_gaps_of_each_marker():
    truth, _ = moving_face(1.0, 100.0)
    found = gap_runs(with_gaps(truth, {0: (10, 20), 3: (95, 100)}))
    assert found["M00"].tolist() == [[10, 20]]
    assert found["M03"].tolist() == [[95, 100]]
    assert found["HEAD1"].tolist() == []
