"""Energy curves: the sums of eq. 4.4 and 4.5, at any rate, in any order of the bases."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.segmentation.energy import FINE_RATE, bridged, energies
from tests.fixtures.hand_made import eased, moving_face

RATES = (30, 60, 120, 200)


def one_base(values: np.ndarray, rate: float) -> Descriptors:
    return Descriptors(values[:, None], ("jawOpen",), rate)


@pytest.mark.parametrize("rate", RATES)
def test_velocity_of_a_ramp_is_its_slope(rate):
    time = np.arange(2 * rate) / rate
    curves = energies(one_base(0.7 * time, rate))
    inside = (curves.time > 0.45) & (curves.time < 1.5)
    np.testing.assert_allclose(curves.velocity[inside], 0.7, rtol=1e-9)
    np.testing.assert_allclose(curves.acceleration[inside], 0, atol=1e-9)


@pytest.mark.parametrize("rate", RATES)
def test_acceleration_of_a_parabola_is_constant(rate):
    time = np.arange(2 * rate) / rate
    curves = energies(one_base(0.5 * 0.3 * time**2, rate))
    inside = (curves.time > 0.45) & (curves.time < 1.5)
    np.testing.assert_allclose(curves.acceleration[inside], 0.3, rtol=1e-6)


def test_energies_add_up_over_the_bases_without_cancelling():
    time = np.arange(200) / 100
    curves = energies(Descriptors(np.column_stack([time, -2 * time]), ("up", "down"), 100))
    assert curves.velocity[100] == pytest.approx(3.0)


def test_neither_energy_drowns_the_other_in_a_transition_of_half_a_second():
    time = np.arange(400) / 200
    s = np.clip((time - 0.75) / 0.5, 0, 1)
    curves = energies(one_base(s - np.sin(2 * np.pi * s) / (2 * np.pi), 200))
    ratio = curves.time_constant_s * curves.acceleration.max() / curves.velocity.max()
    assert 0.6 < ratio < 1.2


def test_a_transition_makes_one_hump():
    face = np.array([0.0]), np.array([1.0])
    take, _ = moving_face(face, rate=200, hold=1, duration=0.5)
    activity = energies(take).activity
    high = np.flatnonzero(activity > 0.5 * activity.max())
    assert np.array_equal(high, np.arange(high[0], high[-1] + 1))


@pytest.mark.parametrize("rate", RATES)
def test_energies_of_one_motion_are_the_same_at_every_rate(rate):
    faces = [np.zeros(3), np.array([1, 0.5, 0]), np.array([0, 0.2, 0.8])]
    fine = energies(moving_face(faces, rate=400)[0])
    coarse = energies(moving_face(faces, rate=rate)[0])
    inside = (coarse.time > 0.2) & (coarse.time < 3.4)
    expected = np.interp(coarse.time[inside], fine.time, fine.activity)
    assert np.abs(coarse.activity[inside] - expected).max() < 0.05 * fine.activity.max()


def test_slow_recordings_are_differentiated_on_finer_times():
    curves = energies(one_base(np.sin(np.arange(60) / 30), 30))
    assert 1 / np.diff(curves.time).mean() >= FINE_RATE


@settings(deadline=None, max_examples=25)
@given(scale=st.floats(0.01, 100), shift=st.floats(-50, 50), seed=st.integers(0, 1000))
def test_energies_scale_with_the_weights_and_ignore_their_offset(scale, shift, seed):
    weights = np.random.default_rng(seed).normal(size=(60, 4)).cumsum(axis=0)
    names = ("a", "b", "c", "d")
    one, other = energies(Descriptors(weights, names, 60)), energies(Descriptors(scale * weights + shift, names, 60))
    np.testing.assert_allclose(other.velocity, scale * one.velocity, rtol=1e-6, atol=1e-8 * (1 + abs(shift)))
    np.testing.assert_allclose(other.activity, scale * one.activity, rtol=1e-6, atol=1e-5 * (1 + abs(shift)))


@settings(deadline=None, max_examples=25)
@given(order=st.permutations(range(5)), seed=st.integers(0, 1000))
def test_energies_do_not_depend_on_the_order_of_the_bases(order, seed):
    weights = np.random.default_rng(seed).normal(size=(50, 5))
    names = tuple("abcde")
    one = energies(Descriptors(weights, names, 100))
    other = energies(Descriptors(weights[:, order], tuple(names[i] for i in order), 100))
    np.testing.assert_allclose(one.combined, other.combined)


def test_frames_without_weights_are_bridged_in_a_straight_line():
    values = np.linspace(0, 1, 100)
    holed = values.copy()
    holed[[0, 30, 31, 32, 99]] = np.nan
    weights = bridged(one_base(holed, 100))[:, 0]
    np.testing.assert_allclose(weights[1:99], values[1:99])
    assert weights[0] == values[1]
    assert weights[99] == values[98]


@pytest.mark.parametrize("frames", [3, 4, 5, 10])
def test_short_takes_have_energies(frames):
    curves = energies(one_base(np.linspace(0, 1, frames), 200))
    assert np.isfinite(curves.combined).all()


@pytest.mark.parametrize("frames", [1, 2])
def test_two_frames_are_too_few(frames):
    with pytest.raises(SignfaceError, match="too few"):
        energies(one_base(np.zeros(frames), 200))


def test_a_take_without_weights_is_named():
    with pytest.raises(SignfaceError, match="no frame has weights"):
        energies(one_base(np.full(50, np.nan), 200))


@pytest.mark.parametrize("rate", RATES)
def test_a_blink_leaves_no_energy_and_a_step_keeps_its_own(rate):
    time = np.arange(3 * rate) / rate
    blink = np.exp(-(((time - 1.5) / 0.06) ** 2))
    step = eased(time, 1.3, 0.4)
    assert (
        energies(one_base(blink, rate)).activity.max()
        < 0.02 * energies(one_base(blink, rate), pulse_s=0).activity.max()
    )
    kept, all_of_it = energies(one_base(step, rate)), energies(one_base(step, rate), pulse_s=0)
    np.testing.assert_allclose(kept.activity, all_of_it.activity, atol=0.02)
