"""Jitter of a tracker: found as it was put in, at any rate and in any unit, and told from motion."""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from signface.cli.main import main
from signface.descriptors import Descriptors
from signface.errors import SignfaceError, SignfaceWarning
from signface.metrics.segmentation import boundary_f1
from signface.segmentation.cutting import segment
from signface.segmentation.energy import energies
from signface.segmentation.noise import jitter, warn_of_jitter
from signface.settings.solve import SolveSettings
from signface.takes.filtering import lowpass
from signface.takes.take import Take
from tests.fixtures.hand_made import BASES, moving_face

RATES = (23, 30, 50, 60, 100, 200)
UNFILTERED = SolveSettings(read_as="aus")


def faces(seed: int = 0, number: int = 8) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    some = [rng.uniform(0.3, 1, len(BASES)) * (rng.random(len(BASES)) < 0.4) for _ in range(number)]
    return [np.zeros(len(BASES)), *some, np.zeros(len(BASES))]


def filtered(values: np.ndarray, rate: float, **options) -> np.ndarray:
    """Columns through the filter of the solve, as if they were markers."""
    positions = np.repeat(values[:, :, None], 3, axis=2)
    labels = tuple(map(str, range(values.shape[1])))
    return lowpass(Take(positions, labels, rate), **options).positions[..., 0]


def shaken(take: Descriptors, deviation: float, seed: int = 1, **options) -> tuple[Descriptors, np.ndarray]:
    """The take with jitter that went through the filter of the solve, and that jitter."""
    noise = filtered(np.random.default_rng(seed).normal(0, deviation, take.weights.shape), take.rate, **options)
    return Descriptors(take.weights + noise, take.names, take.rate), noise


def still(rate: float, seconds: float = 10.0) -> Descriptors:
    return Descriptors(np.full((round(seconds * rate), len(BASES)), 0.2), BASES, rate)


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("deviation", [0.02, 0.05])
def test_jitter_is_found_as_it_was_put_in_and_so_are_its_energies(rate, moving, deviation):
    clean = moving_face(faces(), rate=rate, hold=0.5)[0] if moving else still(rate)
    take, noise = shaken(clean, deviation)
    found, true = jitter(take), energies(Descriptors(noise, take.names, rate))
    assert np.sqrt(np.mean(found.deviation**2)) == pytest.approx(noise.std(), rel=0.15)
    assert found.velocity == pytest.approx(true.velocity.mean(), rel=0.2)
    assert found.acceleration == pytest.approx(true.acceleration.mean(), rel=0.2)
    assert found.activity == pytest.approx(true.activity.mean(), rel=0.2)


@pytest.mark.parametrize("rate", RATES)
def test_what_is_smooth_has_no_jitter(rate):
    take, _ = moving_face(faces(), rate=rate, hold=0.5)
    assert np.sqrt(np.mean(jitter(take).deviation ** 2)) < 1e-3
    assert jitter(take).share < 0.01
    assert jitter(still(rate)).share == 0


@pytest.mark.parametrize("rate", [30, 60, 200])
def test_blinks_are_not_taken_for_jitter(rate):
    time = np.arange(10 * rate) / rate
    blinks = sum(np.exp(-(((time - at) / 0.06) ** 2)) for at in np.arange(0.7, 10, 2.5))
    clean = Descriptors(np.column_stack([blinks, blinks]), ("left", "right"), rate)
    assert jitter(clean).deviation.max() < 2e-3
    take, noise = shaken(clean, 0.02)
    assert noise.std() < np.sqrt(np.mean(jitter(take).deviation ** 2)) < 1.35 * noise.std()


@settings(deadline=None, max_examples=20)
@given(scale=st.floats(0.01, 100), shift=st.floats(-5, 5), seed=st.integers(0, 100))
def test_jitter_has_the_unit_of_the_weights_and_its_share_has_none(scale, shift, seed):
    take, _ = shaken(still(30, 4), 0.05, seed)
    one, other = jitter(take), jitter(Descriptors(scale * take.weights + shift, take.names, 30))
    for name in ("deviation", "velocities", "accelerations", "velocity", "acceleration", "activity", "highest"):
        np.testing.assert_allclose(getattr(other, name), scale * getattr(one, name), rtol=1e-5)
    assert other.share == pytest.approx(one.share, rel=1e-5)


@pytest.mark.parametrize("rate", [30, 200])
def test_steps_of_rounding_count_as_jitter_and_hide_none(rate):
    """Rounded to steps as large as the jitter's deviation, the take has both: the jitter and that of the rounding."""
    step = 0.02
    raw = 0.5 + np.random.default_rng(2).normal(0, step, (20 * rate, 8))
    found = jitter(Descriptors(filtered(np.round(raw / step) * step, rate), range(8), rate))
    expected = np.sqrt(step**2 + step**2 / 12) * filtered(raw, rate).std() / step
    assert np.sqrt(np.mean(found.deviation**2)) == pytest.approx(expected, rel=0.15)


def test_correlated_jitter_of_all_bases_is_no_larger_on_average():
    rate, rng = 30, np.random.default_rng(4)
    common = filtered(rng.normal(0, 0.05, (600, 1)), rate)
    take = Descriptors(np.repeat(common, len(BASES), axis=1) + 0.3, BASES, rate)
    assert jitter(take).activity == pytest.approx(energies(take).activity.mean(), rel=0.2)
    assert jitter(take).highest > 1.4 * jitter(shaken(still(rate, 20), 0.05)[0]).highest  # together they reach further


@pytest.mark.parametrize("cutoff", [4.0, 8.0])
def test_the_filter_of_the_solve_is_known(cutoff):
    take, noise = shaken(still(60), 0.05, cutoff_hz=cutoff)
    known = Descriptors(take.weights, take.names, 60, settings=SolveSettings(cutoff_hz=cutoff))
    assert np.sqrt(np.mean(jitter(known).deviation ** 2)) == pytest.approx(noise.std(), rel=0.15)


def test_action_units_are_not_filtered():
    noise = np.random.default_rng(5).normal(0, 0.05, (600, 8))
    take = Descriptors(noise, range(8), 30, settings=UNFILTERED)
    assert np.sqrt(np.mean(jitter(take).deviation ** 2)) == pytest.approx(0.05, rel=0.15)


def test_frames_without_weights_are_not_looked_at():
    take, noise = shaken(still(60), 0.05)
    holed = take.weights.copy()
    holed[::40] = np.nan
    found = jitter(Descriptors(holed, take.names, 60))
    assert np.sqrt(np.mean(found.deviation**2)) == pytest.approx(noise.std(), rel=0.2)


@pytest.mark.parametrize("frames", [3, 10])
def test_a_take_too_short_to_say_anything_has_none(frames):
    take = Descriptors(np.random.default_rng(6).normal(size=(frames, 4)), range(4), 30)
    assert jitter(take).share == jitter(take).highest == 0
    assert not jitter(take).deviation.any()


def test_a_take_without_weights_is_refused():
    with pytest.raises(SignfaceError, match="no frame has weights"):
        jitter(Descriptors(np.full((50, 2), np.nan), ("a", "b"), 30))


def test_most_of_a_still_take_is_jitter_and_is_warned_of():
    with pytest.warns(SignfaceWarning, match="jitter of the tracker.*--cutoff"):
        warn_of_jitter(shaken(still(30), 0.05)[0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_jitter(moving_face(faces(), rate=30)[0])
        warn_of_jitter(shaken(still(30), 0.001)[0])  # nothing moves, and nothing would be cut
        warn_of_jitter(Descriptors(np.zeros((2, 1)), ("a",), 30))


@pytest.mark.parametrize("rate", [30, 60, 200])
def test_jitter_alone_is_hardly_cut_at_any_rate(rate):
    counts = [len(segment(shaken(still(rate), 0.05, seed)[0])) for seed in range(5)]
    assert np.mean(counts) < 2


def test_movements_are_found_in_jitter_that_counts_as_motion_otherwise():
    clean, moves = moving_face(faces(), rate=30, hold=0.7, duration=0.5)
    marks = [0.0, *(mark for move in moves for mark in move), clean.duration]
    reference = pd.DataFrame({"start_s": marks[:-1], "end_s": marks[1:]})
    scores = []
    for seed in range(4):
        take, _ = shaken(clean, 0.25, seed)
        tables = [segment(take, jitter_factor=factor).table for factor in (0.0, 3.0)]
        scores.append([boundary_f1(reference, table, tolerance_s=0.2) for table in tables])
    without, beyond = np.mean(scores, axis=0)
    assert beyond > without + 0.3
    assert beyond > 0.85


def test_a_take_without_jitter_is_cut_as_if_nobody_looked_for_any():
    for rate in (30, 200):
        take, _ = moving_face(faces(), rate=rate)
        one, other = (segment(take, jitter_factor=factor).table for factor in (0.0, 3.0))
        assert one["kind"].tolist() == other["kind"].tolist()
        np.testing.assert_allclose(one["start_s"], other["start_s"], atol=0.005)


def test_the_command_says_the_share_and_warns_of_most(tmp_path, capsys):
    for name, deviation, warned in (("steady", 0.0005, False), ("shaken", 0.1, True)):
        take, _ = shaken(moving_face(faces(number=3), rate=30, hold=1.5)[0], deviation)
        table = take.to_frame().assign(residual_mm=0.0)
        table.insert(0, "time_s", take.time)
        table.to_csv(tmp_path / f"{name}.csv", index=False)
        assert main(["segment", str(tmp_path / f"{name}.csv"), "-o", str(tmp_path / "segments.csv")]) in (None, 0)
        said = capsys.readouterr()
        assert "% of the motion" in said.out
        assert ("boundaries of segments are doubtful" in said.err) == warned
