"""Agreement of segmentations: the laws that every measure obeys, and values worked out by hand."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from signface.metrics.segmentation import (
    boundary_f1,
    edit_score,
    frame_agreement,
    mean_iou,
    over_segmentation,
    segmentation_metrics,
    under_segmentation,
    value_at,
)

MEASURES = (boundary_f1, mean_iou, frame_agreement)


def table(marks, kinds=None) -> pd.DataFrame:
    """Segments between the marks, stable and transition in turn."""
    marks = np.asarray(marks, float)
    kinds = kinds or ["transition" if i % 2 else "stable" for i in range(len(marks) - 1)]
    return pd.DataFrame({"start_s": marks[:-1], "end_s": marks[1:], "kind": kinds})


@st.composite
def segmentations(draw, start=0.0):
    steps = draw(st.lists(st.floats(0.05, 3), min_size=1, max_size=12))
    return table(start + np.concatenate([[0], np.cumsum(steps)]))


@pytest.mark.slow
@settings(deadline=None)
@given(one=segmentations())
def test_a_segmentation_agrees_with_itself(one):
    for measure in MEASURES:
        assert measure(one, one) == pytest.approx(1)


@pytest.mark.slow
@settings(deadline=None)
@given(one=segmentations(), other=segmentations())
def test_measures_are_symmetric_and_lie_between_0_and_1(one, other):
    for measure in MEASURES:
        value = measure(one, other)
        assert 0 <= value <= 1
        assert value == pytest.approx(measure(other, one))


@pytest.mark.slow
@settings(deadline=None)
@given(one=segmentations(), other=segmentations(), tolerances=st.lists(st.floats(0, 2), min_size=2, max_size=4))
def test_boundaries_agree_no_less_when_more_is_tolerated(one, other, tolerances):
    values = [boundary_f1(one, other, tolerance_s=tolerance) for tolerance in sorted(tolerances)]
    assert values == sorted(values)


@pytest.mark.slow
@settings(deadline=None)
@given(one=segmentations(), other=segmentations(), shift=st.floats(-100, 100))
def test_measures_do_not_depend_on_where_time_begins(one, other, shift):
    def moved(segments):
        return segments.assign(start_s=segments.start_s + shift, end_s=segments.end_s + shift)

    for measure in (mean_iou, frame_agreement):
        assert measure(one, other) == pytest.approx(measure(moved(one), moved(other)), abs=1e-5)  # microseconds


def test_values_worked_out_by_hand():
    reference, found = table([0, 1, 2, 4]), table([0, 1.2, 2, 4])
    assert boundary_f1(reference, found, tolerance_s=0.1) == pytest.approx(0.5)
    assert boundary_f1(reference, found, tolerance_s=0.2) == pytest.approx(1.0)
    assert frame_agreement(reference, found) == pytest.approx(3.8 / 4)
    assert mean_iou(reference, found) == pytest.approx(np.mean([1 / 1.2, 0.8, 1.0]))


def test_one_boundary_is_not_counted_for_two():
    reference, found = table([0, 1, 4]), table([0, 0.95, 1.05, 4])
    assert boundary_f1(reference, found, tolerance_s=0.1) == pytest.approx(2 / 3)


def test_only_the_time_that_both_cover_is_compared():
    reference, found = table([1, 2, 3]), table([0, 0.3, 0.6, 2, 3, 5, 9])
    assert boundary_f1(reference, found) == 1
    assert frame_agreement(reference, found) == pytest.approx(1)  # both stable to 2 s, then both in transition


def test_opposite_kinds_do_not_agree():
    reference, found = table([0, 2], ["stable"]), table([0, 2], ["transition"])
    assert frame_agreement(reference, found) == 0
    assert mean_iou(reference, found) == 0


def test_time_that_an_annotator_left_out_is_no_agreement():
    holed = table([0, 1, 2, 3]).drop(index=1)
    assert frame_agreement(holed, table([0, 1, 2, 3])) == pytest.approx(2 / 3)


def test_takes_are_pooled():
    good, bad = (table([0, 1, 2]), table([0, 1, 2])), (table([0, 1, 2, 3]), table([0, 0.5, 1.5, 3]))
    scores = segmentation_metrics([good, bad])
    assert scores["boundary_f1"]["0.10"] == pytest.approx(2 / 6)
    assert (scores["n_reference"], scores["n_found"]) == (5, 5)
    assert segmentation_metrics([])["mean_iou"] == 1


def test_values_at_times_are_those_of_the_segments_there():
    segments = table([0, 1, 2]).assign(label=["N", "J"])
    assert value_at(segments, "label", np.array([-0.1, 0, 0.99, 1, 2])).tolist() == ["", "N", "N", "J", ""]


def stable_and_moving(*marks, labels=None):
    kinds = ["stable" if i % 2 == 0 else "transition" for i in range(len(marks) - 1)]
    table = pd.DataFrame({"start_s": marks[:-1], "end_s": marks[1:], "kind": kinds})
    return table if labels is None else table.assign(label=labels)


def test_a_segment_cut_in_two_is_counted_as_cut_and_not_the_other_way():
    whole, cut = stable_and_moving(0, 10, 11, 20), stable_and_moving(0, 4, 5, 10, 11, 20)
    assert over_segmentation(whole, cut) == 0.5
    assert under_segmentation(whole, cut) == 0
    assert under_segmentation(cut, whole) == 0.5
    assert over_segmentation(whole, whole) == under_segmentation(whole, whole) == 0


def test_the_edit_score_asks_for_the_order_and_not_for_the_times():
    one = stable_and_moving(0, 1, 2, 3, labels=["N", "NJ", "J"])
    assert edit_score(one, stable_and_moving(0, 2, 4, 9, labels=["N", "NJ", "J"])) == 1
    assert edit_score(one, stable_and_moving(0, 1, 2, 3, labels=["N", "NA", "A"])) == pytest.approx(1 / 3)
