"""Takes acted and recorded otherwise: as much as is asked for, and the same each time."""

from __future__ import annotations

import numpy as np
import pytest

from signface.synth.corpus import TakeRequest, make_take
from signface.synth.variety import Acting, Recorded, draw_acting, draw_recorded, recorded_as, varied_take

REQUEST = TakeRequest(77, 0, "EU", 4)


@pytest.fixture(scope="module")
def made():
    return make_take(REQUEST)


def test_a_film_has_its_own_rate_and_the_same_duration(made):
    filmed = recorded_as(made.take, Recorded(rate=30.0), np.random.default_rng(0))
    assert filmed.rate == 30.0
    assert filmed.duration == pytest.approx(made.take.duration, abs=0.04)
    at = np.round(filmed.time * 200).astype(int)
    apart = np.abs(filmed.positions - made.take.positions[at])
    assert np.nanmax(apart) < 3.0  # what a head moves in half a frame at most


@pytest.mark.parametrize("how", [Recorded(jitter_mm=2.0), Recorded(wander_mm=2.0, wander_hz=1.0)])
def test_jitter_is_as_large_in_space_as_it_says(made, how):
    noise = recorded_as(made.take, how, np.random.default_rng(1)).positions - made.take.positions
    assert np.sqrt(np.nanmean((noise**2).sum(axis=2))) == pytest.approx(2.0, rel=0.05)
    next_frame = np.nanmean(noise[1:] * noise[:-1]) / np.nanmean(noise**2)
    assert next_frame == pytest.approx(0.0 if how.jitter_mm else 1.0, abs=0.05)


def test_absent_markers_are_of_the_face(made):
    kept = recorded_as(made.take, Recorded(absent=0.2), np.random.default_rng(2)).labels
    assert len(made.take.labels) - len(kept) == 8
    assert kept[-6:] == made.take.labels[-6:]


def test_half_the_gain_is_half_the_weight(made):
    half = make_take(REQUEST, change=Acting(gain=0.5))
    np.testing.assert_allclose(half.weights.weights, 0.5 * made.weights.weights, atol=0.0011)
    assert half.reference == made.reference


def test_movement_without_affect_is_of_the_clauses_and_stays_within_bounds(made):
    more = make_take(REQUEST, change=Acting(mouthing=1.0, grammar=1.0, seed=3))
    added = np.abs(more.weights.weights - made.weights.weights).max(axis=1)
    first = made.boundaries.table["end_s"].iloc[0]
    assert added[made.weights.time < first - 0.8].max() < 0.02
    assert added.max() > 0.3
    assert more.weights.weights.max() <= 1.0


def test_a_variation_is_the_same_each_time_and_no_two_are_alike():
    first, again, other = (varied_take(REQUEST, copy) for copy in (0, 0, 1))
    np.testing.assert_array_equal(first.take.positions, again.take.positions)
    assert (first.take.rate, first.take.n_frames) != (other.take.rate, other.take.n_frames)


def test_what_is_drawn_lies_within_the_ranges_of_devices():
    drawn = [draw_recorded(np.random.default_rng(seed)) for seed in range(200)]
    assert all(25.0 <= how.rate <= 200.0 and how.jitter_mm <= 2.2 and how.absent <= 0.25 for how in drawn)
    assert 0.4 < np.mean([how.rate < 60.0 for how in drawn]) < 0.8
    gains = [draw_acting(np.random.default_rng(seed)).gain for seed in range(200)]
    assert min(gains) < 0.55
    assert max(gains) > 1.1
