"""Boosting on whole sentences: what it finds, that its path is the likeliest, and that it is kept."""

from __future__ import annotations

import io
import zipfile
from itertools import pairwise, product

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.ensemble import HistGradientBoostingClassifier

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.label.plain_archive import plain_entries, read_plain
from signface.segmentation.segments import Segments
from signface.sequence.boosting import BoostingLabeller, likeliest_path
from signface.sequence.course_features import course_features, width
from signface.sequence.tree_arrays import tree_arrays, tree_probabilities


def sentence(seed: int, seconds: float = 6.0) -> tuple[Descriptors, Segments]:
    """A take in which one base is up while `q` is annotated, among noise."""
    rng = np.random.default_rng(seed)
    frames = round(seconds * 25)
    begin, end = np.sort(rng.uniform(1.0, seconds - 1.0, 2)) + np.array([-0.4, 0.4])
    time = np.arange(frames) / 25
    weights = rng.normal(0, 0.05, (frames, 3))
    weights[(time >= begin) & (time < end), 1] += 0.8
    rows = [(0.0, begin, "none"), (begin, end, "q"), (end, seconds, "none")]
    table = pd.DataFrame(
        [(a, b, "stable", label) for a, b, label in rows], columns=["start_s", "end_s", "kind", "label"]
    )
    return Descriptors(weights, ("a", "b", "c"), 25.0, name=f"take{seed}"), Segments(table)


@pytest.fixture(scope="module")
def model() -> BoostingLabeller:
    takes, references = zip(*(sentence(seed) for seed in range(12)), strict=True)
    return BoostingLabeller(iterations=30).fit(takes, references)


@pytest.mark.slow
def test_what_is_annotated_is_found_in_other_takes(model):
    for seed in range(50, 54):
        take, reference = sentence(seed)
        found = model.annotate(take).table
        assert found["label"].tolist() == ["none", "q", "none"]
        np.testing.assert_allclose(found["start_s"], reference.table["start_s"], atol=0.12)
        assert found["confidence"].between(0.5, 1).all()


@pytest.mark.slow
def test_two_trainings_give_the_same(model):
    takes, references = zip(*(sentence(seed) for seed in range(12)), strict=True)
    again = BoostingLabeller(iterations=30).fit(takes, references)
    take, _ = sentence(60)
    np.testing.assert_array_equal(again.frame_probabilities(take), model.frame_probabilities(take))


def test_one_label_is_no_training():
    take, reference = sentence(1)
    alone = Segments(reference.table.assign(label="none"))
    with pytest.raises(SignfaceError, match="two or more"):
        BoostingLabeller().fit([take], [alone])


@given(
    scores=st.lists(st.tuples(*[st.floats(-4, 0)] * 3), min_size=1, max_size=6),
    stay=st.floats(0.05, 0.99),
)
@settings(max_examples=60, deadline=None)
def test_the_path_is_the_likeliest_of_all(scores, stay):
    table = np.array(scores)
    change = np.log((1 - stay) / 2)

    def score(path):
        steps = sum(np.log(stay) if a == b else change for a, b in pairwise(path))
        return sum(table[row, state] for row, state in enumerate(path)) + steps

    best = max(map(score, product(range(3), repeat=len(table))))
    assert score(likeliest_path(table, stay)) == pytest.approx(best)


def test_features_do_not_know_when_a_take_begins_on_the_clock():
    take, _ = sentence(3)
    later = Descriptors(take.weights, take.names, take.rate, start=100.0)
    times = np.array([0.5, 2.0, 5.9])
    features = course_features(take, times)
    assert features.shape == (3, width(3))
    np.testing.assert_allclose(course_features(later, times + 100), features, atol=1e-5)


def test_a_constant_has_no_slope_swing_or_range():
    still = Descriptors(np.full((50, 1), 0.3), ("a",), 25.0)
    features = course_features(still, np.array([1.0]))[0]
    np.testing.assert_allclose(features[:6], 0.3, atol=1e-6)
    np.testing.assert_allclose(features[6:11], 0.0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("labels", [2, 3])
def test_trees_as_arrays_are_those_of_scikit_learn(labels):
    rng = np.random.default_rng(labels)
    features = rng.normal(size=(400, 6)).astype(np.float32)
    truth = np.digitize(features[:, 1] + features[:, 4] ** 2, [0.5, 2.0][: labels - 1])
    trees = HistGradientBoostingClassifier(max_iter=20, max_leaf_nodes=8, random_state=0).fit(features, truth)
    again = tree_probabilities(tree_arrays(trees), features)
    np.testing.assert_allclose(again, trees.predict_proba(features), atol=1e-12)


@pytest.mark.slow
def test_a_model_is_kept_as_plain_arrays(model):
    with zipfile.ZipFile(io.BytesIO(), "w") as archive:
        for name, content in plain_entries({"labels": model}).items():
            archive.writestr(name, content)
        again = read_plain(archive)["labels"]
    take, _ = sentence(61)
    np.testing.assert_array_equal(again.frame_probabilities(take), model.frame_probabilities(take))
    assert again.annotate(take) == model.annotate(take)
