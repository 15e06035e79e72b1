"""Labels of segments: means of eq. 4.6, transitions named by their neighbours, confidence for all."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.label.labelling import label_segments
from signface.label.spans import segment_means
from signface.label.vocabulary import AFFECT
from signface.learn.training import train
from signface.segmentation.cutting import segment
from signface.segmentation.segments import Segments
from tests.fixtures.hand_made import BASES, FACES, corpus, example, moving_face
from tests.fixtures.training import quick


@pytest.fixture(scope="module")
def model():
    return train([e for e in corpus() if e.kind == "IE"], quick("knn3"), name="toy")


def labelled(descriptors, model):
    return label_segments(descriptors, segment(descriptors), model).table


def test_stable_segments_are_labelled_and_transitions_named_by_their_neighbours(model):
    take = example(["N", "J", "Sa", "N"], seed=77, rate=200).descriptors
    assert labelled(take, model).label.tolist() == ["N", "NJ", "J", "JSa", "Sa", "SaN", "N"]


def test_the_confidence_of_a_transition_is_the_product_of_its_neighbours(model):
    rows = labelled(example(["N", "J", "Sa", "N"], seed=77).descriptors, model)
    confidence = rows.confidence.to_numpy()
    np.testing.assert_allclose(confidence[1::2], confidence[:-2:2] * confidence[2::2])


def test_a_face_between_two_expressions_lowers_the_confidence(model):
    middle = (FACES["J"] + FACES["A"]) / 2
    take, _ = moving_face([FACES["J"], middle + 0.05, FACES["J"]], rate=100, noise=0.05)
    whole = Segments(pd.DataFrame({"start_s": [0.0], "end_s": [take.duration], "kind": ["stable"]}))
    pure = label_segments(example(["J"], seed=1).descriptors, _whole(1.0), model).table.confidence[0]
    assert label_segments(take, whole, model).table.confidence[0] < pure


def _whole(duration: float) -> Segments:
    return Segments(pd.DataFrame({"start_s": [0.0], "end_s": [duration], "kind": ["stable"]}))


def test_a_blink_is_no_transition_of_the_expression(model):
    faces = [FACES["J"], FACES["J"] * 0.8 + 0.15 * (np.arange(12) == 11), FACES["J"]]
    take, _ = moving_face(faces, rate=200)
    assert len(segment(take)) > 1
    table = labelled(take, model)
    assert table.label.tolist() == ["J"]
    assert table.end_s[0] == pytest.approx(take.duration)


def test_a_take_that_begins_and_ends_in_movement_is_named_by_its_edges(model):
    take, moves = moving_face([FACES["A"], FACES["J"], FACES["N"]], rate=200, duration=0.5)
    first, last = round((moves[0][0] + 0.05) * 200), round((moves[1][1] - 0.05) * 200)
    cut = Descriptors(take.weights[first:last], BASES, 200)
    assert segment(cut).table.kind.tolist() == ["transition", "stable", "transition"]
    table = labelled(cut, model)
    assert table.label.tolist() == ["AJ", "J", "JN"]
    assert table.start_s[0] == 0
    assert table.end_s.iloc[-1] == pytest.approx(cut.duration)


def test_a_take_that_is_all_movement_is_one_transition(model):
    take, moves = moving_face([FACES["A"], FACES["J"]], rate=200, duration=0.5)
    cut = Descriptors(take.weights[round(moves[0][0] * 200) : round(moves[0][1] * 200)], BASES, 200)
    moving = Segments(pd.DataFrame({"start_s": [0.0], "end_s": [cut.duration], "kind": ["transition"]}))
    table = label_segments(cut, moving, model).table
    assert table.label.tolist() == ["AJ"]


@settings(deadline=None, max_examples=25)
@given(
    seed=st.integers(0, 10_000),
    labels=st.lists(st.sampled_from(list(AFFECT.values)), min_size=1, max_size=6),
    cut=st.floats(0, 0.9),
)
def test_labelled_segments_cover_the_take_and_neighbours_differ(model, seed, labels, cut):
    take = example(labels, seed=seed, start=3.0, hold=0.5).descriptors
    take = Descriptors(take.weights[: max(4, round((1 - cut) * take.n_frames))], BASES, take.rate, start=3.0)
    table = labelled(take, model)
    assert table.start_s.iloc[0] == pytest.approx(3.0)
    assert table.end_s.iloc[-1] == pytest.approx(3.0 + take.duration)
    np.testing.assert_allclose(table.start_s[1:], table.end_s[:-1])
    assert table.confidence.between(0, 1).all()
    for kind, label in zip(table.kind, table.label, strict=True):
        assert AFFECT.is_transition(label) if kind == "transition" else label in AFFECT.values
    stable = table.label[table.kind == "stable"].tolist()
    assert all(one != other for one, other in pairwise(stable))


def test_the_mean_descriptor_is_that_of_the_frames_inside():
    take = Descriptors(np.arange(10.0)[:, None], ("a",), 10, start=1.0)
    spans = np.array([[1.0, 1.3], [1.25, 1.45], [1.31, 1.33]])
    np.testing.assert_allclose(segment_means(take, spans)[:, 0], [1.0, 3.5, 3.0])


def test_frames_without_weights_do_not_count():
    weights = np.array([1.0, np.nan, 3.0, np.nan])[:, None]
    means = segment_means(Descriptors(weights, ("a",), 10), np.array([[0.0, 0.3], [0.3, 0.4]]))
    assert means[0, 0] == 2.0
    assert np.isnan(means[1, 0])


def test_a_segment_without_weights_goes_on_as_before_with_no_confidence(model):
    take = example(["J", "A"], hold=1.0, rate=100)
    weights = take.descriptors.weights.copy()
    weights[140:] = np.nan
    blind = Descriptors(weights, BASES, 100)
    rows = label_segments(blind, take.reference, model).table
    assert rows.label.tolist() == ["J"]
    table = take.reference.table.assign(kind=["stable", "transition", "stable"])
    table.loc[2, "start_s"] = 1.5
    table.loc[1, "end_s"] = 1.5
    assert label_segments(blind, Segments(table), model).table.confidence[0] < 0.8


def test_bases_are_found_by_name_and_others_are_left_out(model):
    take = example(["N", "J"], seed=3).descriptors
    order = [*np.random.default_rng(1).permutation(len(BASES))]
    weights = np.column_stack([take.weights[:, order], np.ones(take.n_frames)])
    other = Descriptors(weights, (*(BASES[i] for i in order), "tongueOut"), take.rate)
    cut = segment(take)
    pd.testing.assert_frame_equal(label_segments(take, cut, model).table, label_segments(other, cut, model).table)


def test_a_model_of_other_bases_names_what_differs(model):
    take = Descriptors(np.zeros((50, 2)), ("base1", "smile"), 100)
    with pytest.raises(SignfaceError, match=r"lacks base0, base2, .* and 6 more, and has smile"):
        label_segments(take, segment(take), model)


def test_history_says_which_model_labelled(model):
    take = example(["N", "J"]).descriptors
    assert label_segments(take, segment(take), model).history[-1] == "label toy (knn3)"


def test_no_segments_stay_no_segments(model):
    empty = Segments(pd.DataFrame({"start_s": [], "end_s": [], "kind": []}))
    found = label_segments(example(["N", "J"]).descriptors, empty, model)
    assert len(found) == 0
    assert found.labelled
