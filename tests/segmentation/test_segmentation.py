"""Segments: where the face moves, the same at every rate, covering the take."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.segmentation.cutting import segment
from signface.segmentation.segments import Segments
from tests.fixtures.hand_made import eased, moving_face

FACE = np.array([0.8, 0.5, 0.0, 0.3, 0.0, 0.6])
OTHER = np.array([0.0, 0.7, 0.9, 0.0, 0.4, 0.0])
REST = np.zeros(6)


def moves_of(segments: Segments) -> np.ndarray:
    table = segments.table
    return table.loc[table.kind == "transition", ["start_s", "end_s"]].to_numpy()


def assert_covers(segments: Segments, take: Descriptors) -> None:
    table = segments.table
    assert table.start_s.iloc[0] == pytest.approx(take.start)
    assert table.end_s.iloc[-1] == pytest.approx(take.start + take.duration)
    np.testing.assert_array_equal(table.start_s[1:], table.end_s[:-1])
    kinds = table.kind.to_numpy()
    assert (kinds[1:] != kinds[:-1]).all()


@pytest.mark.parametrize("duration", [0.25, 0.4, 0.6, 0.8])
@pytest.mark.parametrize("noise", [0.0, 0.005])
def test_transitions_are_found_where_the_face_moves(duration, noise):
    take, moves = moving_face([REST, FACE, OTHER, REST], rate=200, duration=duration, noise=noise)
    found = moves_of(segment(take))
    assert found.shape == (3, 2)
    np.testing.assert_allclose(found.mean(axis=1), np.mean(moves, axis=1), atol=0.03)
    assert (found[:, 0] > np.array(moves)[:, 0] - 0.03).all()
    assert (np.diff(found) > 0.6 * duration).all()  # the first and last hundredths of the way are left out


@settings(deadline=None, max_examples=30)
@given(
    seed=st.integers(0, 10_000),
    duration=st.floats(0.25, 0.8),
    hold=st.floats(0.6, 1.5),
    start=st.floats(-5, 100),
)
def test_one_motion_has_the_same_segments_at_every_rate(seed, duration, hold, start):
    rng = np.random.default_rng(seed)
    faces = [REST, *(rng.uniform(0.3, 1, 6) * rng.permutation([0, 1, 0, 1, 1, 1]) for _ in range(3)), REST]
    tables = [
        segment(moving_face(faces, rate=rate, duration=duration, hold=hold, start=start)[0]).table
        for rate in (30, 60, 120, 200)
    ]
    for table in tables[:-1]:
        assert list(table.kind) == list(tables[-1].kind)
        np.testing.assert_allclose(table.start_s, tables[-1].start_s, atol=1 / 30)
        np.testing.assert_allclose(table.end_s, tables[-1].end_s, atol=1 / 30 + 1e-9)


@settings(deadline=None, max_examples=40)
@given(
    seed=st.integers(0, 10_000),
    frames=st.integers(1, 300),
    rate=st.sampled_from([25.0, 30.0, 59.94, 100.0, 200.0]),
    smooth=st.integers(1, 40),
    missing=st.floats(0, 0.5),
)
def test_segments_alternate_and_cover_any_take(seed, frames, rate, smooth, missing):
    rng = np.random.default_rng(seed)
    weights = rng.normal(size=(frames + smooth, 3)).cumsum(axis=0)
    weights = np.stack(
        [np.convolve(column, np.ones(smooth) / smooth, mode="valid")[:frames] for column in weights.T], 1
    )
    weights[rng.random(frames) < missing] = np.nan
    weights[0] = 0
    take = Descriptors(weights, ("a", "b", "c"), rate, start=2.5)
    assert_covers(segment(take), take)


@pytest.mark.parametrize("frames", [1, 2, 3, 20])
def test_a_take_too_short_to_hold_a_transition_is_one_stable_segment(frames):
    weights = np.linspace(0, 1, frames)[:, None] if frames > 1 else np.zeros((1, 1))
    take = Descriptors(weights, ("jawOpen",), 200)
    table = segment(take).table
    assert table.kind.tolist() == ["stable"]
    assert table.end_s[0] == pytest.approx(frames / 200)


@pytest.mark.parametrize("rate", [30, 60, 200])
def test_a_take_without_motion_is_one_stable_segment(rate):
    assert len(segment(Descriptors(np.full((5 * rate, 6), 0.4), tuple("abcdef"), rate))) == 1


def test_jitter_without_motion_is_hardly_cut():
    rng = np.random.default_rng(3)
    counts = [len(segment(Descriptors(rng.normal(0, 0.01, (2000, 40)), range(40), 200))) for _ in range(5)]
    assert np.mean(counts) < 3


def test_a_movement_that_stands_out_of_jitter_is_found():
    take, moves = moving_face([REST, FACE, REST], rate=200, noise=0.02)
    np.testing.assert_allclose(moves_of(segment(take)), moves, atol=0.1)


@pytest.mark.parametrize("rate", [30, 60, 200])
@pytest.mark.parametrize(("hold", "kinds"), [(0.0, 1), (0.6, 5)])
def test_what_is_back_at_once_is_a_blink_and_what_stays_is_an_expression(rate, hold, kinds):
    """There and back within 0.3 s is a blink; the same held for a while is cut."""
    time = np.arange(3 * rate) / rate
    lids = eased(time, 1.0, 0.15) - eased(time, 1.15 + hold, 0.15)
    assert len(segment(Descriptors(np.column_stack([lids, lids]), ("left", "right"), rate))) == kinds


def test_a_movement_that_the_recording_cuts_off_reaches_its_end():
    take, (move,) = moving_face([REST, FACE], rate=200, duration=0.5)
    cut = Descriptors(take.weights[: round((move[0] + 0.25) * 200)], take.names, 200)
    assert segment(cut).table.kind.tolist() == ["stable", "transition"]


def test_missing_frames_while_the_face_is_held_cut_nothing():
    take, _ = moving_face([REST, FACE, REST], rate=200)
    weights = take.weights.copy()
    weights[320:360] = np.nan
    assert len(segment(Descriptors(weights, take.names, 200))) == 5


def test_a_recording_in_half_scale_has_the_same_segments():
    take, _ = moving_face([REST, FACE, OTHER, REST], rate=100)
    half = Descriptors(take.weights / 2, take.names, 100)
    np.testing.assert_allclose(moves_of(segment(take)), moves_of(segment(half)))


def test_history_says_how_the_take_was_cut():
    take, _ = moving_face([REST, FACE], rate=100)
    assert "segment prominence=0.15" in segment(take).history[-1]


@pytest.mark.parametrize(
    "options", [{"prominence": 0}, {"extent": 1.2}, {"least_stable_s": -1}, {"window_s": 0}, {"time_constant_s": -1}]
)
def test_parameters_out_of_range_are_refused(options):
    take, _ = moving_face([REST, FACE], rate=100)
    with pytest.raises(SignfaceError):
        segment(take, **options)


@pytest.mark.parametrize("frames", [0, 1, 50])
def test_a_take_without_weights_is_refused(frames):
    with pytest.raises(SignfaceError):
        segment(Descriptors(np.full((frames, 2), np.nan), ("a", "b"), 100))
