"""Filters take noise away, keep blinks, and neither shift nor leak."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from signface.errors import SignfaceError
from signface.takes.filtering import lowpass, raised_sine_response
from signface.takes.take import Take
from tests.fixtures.takes_files import moving_face, with_gaps

METHODS = ["butterworth", "raised-sine"]


def wave(frequency, rate=200.0, seconds=6.0):
    time = np.arange(round(seconds * rate)) / rate
    return Take(np.sin(2 * np.pi * frequency * time)[:, None, None] * np.ones(3), ["A"], rate)


def gain(frequency, rate=200.0, **options):
    before, after = wave(frequency, rate), lowpass(wave(frequency, rate), **options)
    middle = slice(before.n_frames // 4, 3 * before.n_frames // 4)
    return np.std(after.positions[middle]) / np.std(before.positions[middle])


@pytest.mark.parametrize("rate", [60.0, 120.0, 200.0])
def test_butterworth_passes_half_the_power_at_its_cutoff_after_both_passes(rate):
    assert gain(10.0, rate, cutoff_hz=10.0) == pytest.approx(np.sqrt(0.5), abs=0.01)
    assert gain(1.0, rate, cutoff_hz=10.0) == pytest.approx(1.0, abs=0.005)
    assert gain(25.0, rate, cutoff_hz=10.0) < 0.05


def test_the_raised_sine_window_is_equation_7_1():
    frequencies = np.array([0.0, 8.99, 10.5, 12.0, 13.5, 15.01, 80.0])
    expected = [1.0, 1.0, (np.sin(np.pi / 4) + 1) / 2, 0.5, (np.sin(-np.pi / 4) + 1) / 2, 0.0, 0.0]
    np.testing.assert_allclose(raised_sine_response(frequencies, 12.0, 6.0), expected, atol=1e-12)
    assert gain(12.0, cutoff_hz=12.0, method="raised-sine") == pytest.approx(0.5, abs=0.02)
    assert gain(8.0, cutoff_hz=12.0, method="raised-sine") == pytest.approx(1.0, abs=0.01)
    assert gain(16.0, cutoff_hz=12.0, method="raised-sine") < 0.01


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("rate", [60.0, 100.0, 200.0])
def test_the_default_cutoff_keeps_a_blink(method, rate):
    time = np.arange(-1.0, 1.0, 1 / rate)
    closing, opening = 0.12, 0.2
    lid = np.where(
        time < 0, np.cos(np.pi * np.clip(-time / closing, 0, 1)), np.cos(np.pi * np.clip(time / opening, 0, 1))
    )
    lid = 10 * (lid + 1) / 2
    filtered = lowpass(Take(lid[:, None, None] * np.ones(3), ["LID"], rate), method=method).positions[:, 0, 1]
    assert filtered.max() > 0.95 * lid.max()
    assert abs(time[filtered.argmax()]) < 1.01 / rate


@pytest.mark.parametrize("method", METHODS)
def test_jitter_is_reduced_to_less_than_half(method):
    clean, _ = moving_face(5.0, 200.0)
    noisy, _ = moving_face(5.0, 200.0, jitter=0.2)
    error = np.std(lowpass(noisy, method=method).positions - clean.positions)
    assert error < 0.5 * np.std(noisy.positions - clean.positions)


@pytest.mark.parametrize("method", METHODS)
def test_nothing_is_shifted_in_time(method):
    take, _ = moving_face(5.0, 100.0)
    backwards = take.changed("turned", positions=take.positions[::-1])
    np.testing.assert_allclose(
        lowpass(backwards, method=method).positions[::-1], lowpass(take, method=method).positions, atol=0.05
    )


@pytest.mark.parametrize("method", METHODS)
@given(slope=st.floats(-50, 50), level=st.floats(-1000, 1000), frames=st.integers(4, 90))
@settings(max_examples=20, deadline=None)
def test_a_straight_motion_passes_unchanged_up_to_its_ends(method, slope, level, frames):
    line = (level + slope * np.arange(frames) / 60.0)[:, None, None] * np.ones(3)
    np.testing.assert_allclose(lowpass(Take(line, ["A"], 60.0), method=method).positions, line, atol=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_each_stretch_between_gaps_is_filtered_by_itself(method):
    take, _ = moving_face(3.0, 100.0, jitter=0.2)
    gappy = with_gaps(take, {0: (100, 130), 4: (50, 60), 7: (0, 300)})
    filtered = lowpass(gappy, method=method)
    np.testing.assert_array_equal(np.isnan(filtered.positions), np.isnan(gappy.positions))
    alone = lowpass(Take(take.positions[130:, :1], ["M00"], 100.0), method=method)
    np.testing.assert_allclose(filtered.positions[130:, 0], alone.positions[:, 0], atol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_a_rate_too_low_for_the_cutoff_leaves_the_take_and_says_so(method):
    take, _ = moving_face(3.0, 25.0, jitter=0.2)
    filtered = lowpass(take, method=method)
    np.testing.assert_array_equal(filtered.positions, take.positions)
    assert "skipped" in filtered.history[-1]


@pytest.mark.parametrize("frames", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("method", METHODS)
def test_the_shortest_takes_survive(method, frames):
    take, _ = moving_face(1.0, 200.0)
    short = Take(take.positions[:frames], take.labels, 200.0)
    assert np.isfinite(lowpass(short, method=method).positions).all()


def test_senseless_requests_are_refused():
    take, _ = moving_face(1.0, 60.0)
    with pytest.raises(SignfaceError, match="no filter named median"):
        lowpass(take, method="median")
    for cutoff in (0.0, -3.0, float("nan")):
        with pytest.raises(SignfaceError, match="must be positive"):
            lowpass(take, cutoff_hz=cutoff)
