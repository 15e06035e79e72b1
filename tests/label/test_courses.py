"""Segments as one row, and scales by the signer: laws, and a classifier that needs the course."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import signface as sf
from signface.descriptors import Descriptors
from signface.head import HEAD_COLUMNS, with_head
from signface.label.courses import courses_width, segment_courses
from signface.label.persistence import load_model
from signface.label.variants import DescriptorVariant
from signface.learn.examples import Example
from signface.segmentation.segments import Segments
from signface.signer_level import signer_level, signer_middle, signer_range


def wave(hertz: float, seed: int, seconds: float = 2.0) -> Descriptors:
    """One column that swings about the same mean with the same amplitude, only faster or slower."""
    time = np.arange(round(seconds * 50)) / 50
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi)
    return Descriptors(0.5 * np.sin(2 * np.pi * hertz * time + phase)[:, None], ("a",), 50.0, name=f"{hertz}-{seed}")


def example(hertz: float, seed: int) -> Example:
    take = wave(hertz, seed)
    table = pd.DataFrame([(0.0, 2.0, "stable", f"{hertz:g}")], columns=["start_s", "end_s", "kind", "label"])
    words = sf.Vocabulary("waves", ("1", "4"))
    return Example(take.name, f"S{seed % 3}", "clip", take, Segments(table), vocabulary=words, tier="wave")


@pytest.mark.slow
def test_a_slow_and_a_fast_swing_are_told_apart_by_their_course(tmp_path):
    """Their means are the same, so that a classifier of means cannot."""
    examples = [example(hertz, seed) for hertz in (1.0, 4.0) for seed in range(9)]
    settings_ = sf.TrainingSettings(classifier="extra-trees", aggregate="course", normalise="middle")
    model = sf.train(examples, settings_)
    sf.save_model(model, tmp_path / "waves.skops")
    again = load_model(tmp_path / "waves.skops", quickly=True)
    from signface.label.labelling import label_spans

    for hertz in (1.0, 4.0):
        labels, _ = label_spans(wave(hertz, 77), np.array([[0.0, 2.0]]), again, level=signer_level([wave(1.0, 5)]))
        assert labels == [f"{hertz:g}"]


@given(shift=st.floats(-50, 50), scale=st.floats(0.1, 10), offset=st.floats(-5, 5))
@settings(max_examples=30, deadline=None)
def test_a_course_scales_with_the_weights_and_not_with_the_clock(shift, scale, offset):
    take = wave(1.5, 1)
    row = segment_courses(take, np.array([[0.2, 1.8]]))[0]
    assert row.shape == (courses_width(1),)
    other = Descriptors(scale * take.weights + offset, take.names, take.rate, start=shift)
    moved = segment_courses(other, np.array([[0.2 + shift, 1.8 + shift]]))[0]
    means, spreads, rest = [0, 2, 3, 4, 5, 6, 7], [1, 8], [9, 10]
    np.testing.assert_allclose(moved[means], scale * row[means] + offset, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(moved[spreads], scale * row[spreads], rtol=1e-6)
    np.testing.assert_allclose(moved[rest], row[rest], rtol=1e-6)


@given(scale=st.floats(0.5, 20), offset=st.floats(-3, 3), name=st.sampled_from(["range", "middle"]))
@settings(max_examples=30, deadline=None)
def test_signers_who_differ_in_strength_and_rest_look_alike(scale, offset, name):
    one = wave(1.0, 4)
    other = Descriptors(scale * one.weights + offset, one.names, one.rate)
    variant = DescriptorVariant(("weights",), name)
    np.testing.assert_allclose(variant.of(other).weights, variant.of(one).weights, atol=5e-3)


def test_the_head_is_like_bases_with_the_feature_head():
    take = sf.datasets.mini_weights()
    variant = DescriptorVariant(("weights", "head", "windows"))
    seen = variant.of(take)
    assert seen.names == variant.names(take.names)
    np.testing.assert_array_equal(seen.on(HEAD_COLUMNS).weights, with_head(take).on(HEAD_COLUMNS).weights)


def test_ranges_are_those_of_percentiles():
    values = np.random.default_rng(0).normal(3.0, 2.0, 200_000)
    low, half = signer_range(values)
    middle, third = signer_middle(values)
    assert (low, half) == (pytest.approx(3 - 1.645 * 2, abs=0.03), pytest.approx(1.645 * 2, abs=0.03))
    assert (middle, third) == (pytest.approx(3, abs=0.02), pytest.approx(2 * 0.9945, abs=0.02))
