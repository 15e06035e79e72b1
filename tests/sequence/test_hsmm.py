"""Sequence models: boundaries and labels at once, from takes whose motion is known."""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.base import clone

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.label.labelling import find_segments, label_spans
from signface.label.persistence import load_model, save_model
from signface.learn.training import train
from signface.metrics.segmentation import boundary_f1
from signface.sequence.hsmm import make_sequence_labeller
from signface.sequence.semi_markov import SegmentModel
from signface.settings.choices import SEQUENCE_NAMES
from tests.fixtures.hand_made import corpus, example
from tests.fixtures.training import quick

#: What all of them share takes long to make.
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def takes():
    return corpus()


#: `boosting` knows no transitions, and has a file of its own.
THROUGH_TRANSITIONS = [name for name in SEQUENCE_NAMES if name != "boosting"]


@pytest.fixture(scope="module", params=THROUGH_TRANSITIONS)
def model(request, takes):
    fewer = {"gru": {"networks": 1, "effort": 90.0}}
    return train([e for e in takes if e.signer == "S1"], quick(request.param, parameters=fewer.get(request.param, {})))


@pytest.mark.slow
def test_boundaries_and_labels_of_another_signer_are_found(model, takes):
    unseen = [e for e in takes if e.signer == "S2"]
    scores = []
    for one in unseen:
        found = find_segments(one.descriptors, model).table
        scores.append(boundary_f1(one.reference.table, found, tolerance_s=0.1))
        if list(found["label"]) != list(one.reference.table["label"]):
            scores.append(0)
    assert np.mean(scores) > 0.9


def test_segments_cover_the_take_alternate_and_say_how_sure_they_are(model, takes):
    one = takes[3]
    table = find_segments(one.descriptors, model).table
    assert table["start_s"].iloc[0] == one.descriptors.start
    assert table["end_s"].iloc[-1] == pytest.approx(one.descriptors.start + one.descriptors.duration)
    assert np.allclose(table["start_s"][1:], table["end_s"][:-1])
    assert (table["kind"] == np.resize(["stable", "transition"], len(table))).all()
    labels = table.loc[table["kind"] == "stable", "label"]
    assert all(before != after for before, after in itertools.pairwise(labels))
    assert table["confidence"].between(0, 1).all()


def test_given_spans_are_labelled_by_the_same_model(model, takes):
    one = takes[5]
    labels, confidences = label_spans(one.descriptors, one.stable[["start_s", "end_s"]].to_numpy(float), model)
    assert labels == one.stable["label"].tolist()
    assert min(confidences) > 0.3


def test_a_loaded_model_finds_what_the_saved_one_found(model, takes, tmp_path):
    file = tmp_path / "sequence.skops"
    save_model(model, file)
    loaded = load_model(file)
    assert loaded.card == model.card
    one = takes[2].descriptors
    assert find_segments(one, loaded).table.equals(find_segments(one, model).table)


def test_later_time_and_other_rates_change_nothing_but_the_times(model):
    early = example(["N", "J", "N"], rate=100.0)
    late = example(["N", "J", "N"], rate=100.0, start=7.0)
    first, second = (find_segments(e.descriptors, model).table for e in (early, late))
    assert np.allclose(second["start_s"] - 7.0, first["start_s"])
    for rate in (30.0, 50.0, 60.0, 200.0):
        other = find_segments(example(["N", "J", "N"], rate=rate).descriptors, model).table
        assert list(other["label"]) == list(first["label"])
        assert np.abs(other["start_s"] - first["start_s"]).max() <= 0.0801


def test_bases_are_found_by_name(model, takes):
    one = takes[1].descriptors
    turned = Descriptors(one.weights[:, ::-1], one.names[::-1], one.rate, name=one.name)
    pd.testing.assert_frame_equal(find_segments(turned, model).table, find_segments(one, model).table)
    with pytest.raises(SignfaceError, match="other bases"):
        find_segments(Descriptors(one.weights[:, 1:], one.names[1:], one.rate), model)


def test_frames_without_weights_do_no_harm(model, takes):
    one = takes[1].descriptors
    weights = one.weights.copy()
    weights[10:14] = np.nan
    gap = Descriptors(weights, one.names, one.rate, name=one.name)
    assert list(find_segments(gap, model).table["label"]) == list(find_segments(one, model).table["label"])


@pytest.mark.parametrize("name", SEQUENCE_NAMES)
def test_sequence_models_are_estimators_that_clone(name):
    one = make_sequence_labeller(name, seed=3)
    assert repr(clone(one)) == repr(one)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["net-hsmm", "crf"])
def test_neither_a_second_training_nor_the_order_of_takes_changes_anything(name, takes):
    first, second = (train(order, quick(name, seed=1)) for order in (takes[:6], takes[5::-1]))
    one = takes[8].descriptors
    assert find_segments(one, first).table.equals(find_segments(one, second).table)


def test_a_corpus_of_one_expression_is_refused():
    with pytest.raises(SignfaceError, match="two expressions"):
        train([example(["N"])], quick("hmm"))
    with pytest.raises(SignfaceError, match="no sequence model"):
        make_sequence_labeller("hsmm")


def course_score(
    model: SegmentModel, evidence: np.ndarray, course: list[tuple[int, int, int]], boundaries: np.ndarray
) -> float:
    """The score that `decode` maximises, added up segment by segment."""
    score = 0.0
    for number, (first, last, code) in enumerate(course):
        score += evidence[first:last, code].sum()
        if code < 0:
            score += boundaries[first, 0] + boundaries[last, 1]
            score += model.transition[last - first] + model.after[course[number - 1][2], course[number + 1][2]]
        elif 0 < number < len(course) - 1:
            score += model.stable[last - first]
    return score


def every_course(frames: int, labels: int):
    """All courses of a few frames."""
    for count in range(1, frames + 1, 2):
        for cuts in itertools.combinations(range(1, frames), count - 1):
            marks = [0, *cuts, frames]
            for held in itertools.product(range(labels), repeat=count // 2 + 1):
                if all(a != b for a, b in itertools.pairwise(held)):
                    yield [(marks[i], marks[i + 1], -1 if i % 2 else held[i // 2]) for i in range(count)]


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000), frames=st.integers(1, 7), marked=st.booleans())
def test_the_decoded_course_is_the_best_of_all(seed, frames, marked):
    rng = np.random.default_rng(seed)
    after = np.log(rng.dirichlet(np.ones(3), 3))
    np.fill_diagonal(after, -np.inf)
    durations = [np.concatenate([[-np.inf], np.log(rng.dirichlet(np.ones(9)))]) for _ in range(2)]
    model = SegmentModel(("N", "J", "A"), 25.0, durations[0], durations[1], after)
    evidence = rng.normal(0, 2, (frames, 4))
    boundaries = rng.normal(0, 2, (frames + 1, 2)) * marked
    found = model.decode(evidence, boundaries if marked else None)
    best = max(course_score(model, evidence, course, boundaries) for course in every_course(frames, 3))
    assert course_score(model, evidence, found, boundaries) == pytest.approx(best)


def test_an_expression_may_last_longer_than_any_that_was_annotated():
    references = [example(["N", "J", "N", "A", "N"]).reference]
    model = SegmentModel.learn(references, ["N", "J", "A"], 25.0)
    frames = 3000
    evidence = np.full((frames, 4), -1.0)
    evidence[:100, 0] = evidence[110:2890, 1] = evidence[2900:, 0] = evidence[100:110, 3] = evidence[2890:2900, 3] = 0
    assert model.decode(evidence) == [(0, 100, 0), (100, 110, -1), (110, 2890, 1), (2890, 2900, -1), (2900, 3000, 0)]


def test_boundaries_settle_where_the_odds_change_and_nothing_else_moves():
    references = [example(["N", "J", "N", "A", "N"]).reference]
    model = SegmentModel.learn(references, ["N", "J", "A"], 25.0)
    odds = np.full(100, -5.0)
    odds[40:50] = 5.0
    assert model.settle([(0, 37, 0), (37, 55, -1), (55, 100, 1)], odds) == [(0, 40, 0), (40, 50, -1), (50, 100, 1)]
    assert model.settle([(0, 100, 0)], odds) == [(0, 100, 0)]


def test_boundaries_are_placed_where_they_most_likely_are():
    model = SegmentModel.learn([example(["N", "J", "N", "A", "N"]).reference], ["N", "J", "A"], 25.0)
    likely = np.full((101, 2), -6.0)
    likely[41, 0] = likely[52, 1] = 0.0
    assert model.place([(0, 37, 0), (37, 55, -1), (55, 100, 1)], likely) == [(0, 41, 0), (41, 52, -1), (52, 100, 1)]
    far = np.full((101, 2), -6.0)
    far[10, 0] = 0.0  # further than a boundary may move
    assert model.place([(0, 37, 0), (37, 55, -1), (55, 100, 1)], far)[1][0] > 28
