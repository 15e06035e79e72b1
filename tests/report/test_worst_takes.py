"""What goes wrong in a take is said in words that are true."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from signface.descriptors import Descriptors
from signface.report.evaluation.worst_takes import agreeing_stretches, judge_take
from signface.segmentation.segments import Segments


def segments(*rows: tuple[float, float, str], confidence: float = 0.9) -> Segments:
    """Stable segments by start, end and label; what lies between two of them is a transition."""
    table = []
    for number, (start, end, label) in enumerate(rows):
        if number and rows[number - 1][1] < start:
            table.append((rows[number - 1][1], start, "transition", rows[number - 1][2] + label))
        table.append((start, end, "stable", label))
    frame = pd.DataFrame(table, columns=["start_s", "end_s", "kind", "label"])
    return Segments(frame.assign(confidence=confidence))


REFERENCE = segments((0, 2.1, "N"), (2.4, 3.0, "F"), (3.3, 6.0, "N"), (6.4, 8.0, "Su"), (8.3, 10.0, "N"))


def weights(frames: int = 1000, *, residual: float = 0.4, blind: slice = slice(0)) -> Descriptors:
    values = np.zeros((frames, 2))
    values[blind] = np.nan
    return Descriptors(values, ("a", "b"), 100.0, residual=np.full(frames, residual))


def test_what_is_right_has_no_reason():
    verdict = judge_take(REFERENCE, REFERENCE, weights(), usual_residual=0.4)
    assert verdict.agreement == pytest.approx(1.0)
    assert (verdict.missed, verdict.superfluous, verdict.reasons) == (0, 0, ())


def test_boundaries_that_are_missed_are_counted_and_placed():
    found = segments((0, 6.0, "N"), (6.4, 8.0, "Su"), (8.3, 10.0, "N"))
    verdict = judge_take(REFERENCE, found)
    assert (verdict.missed, verdict.superfluous) == (4, 0)
    assert "4 boundaries missed between 2.1 and 3.3 s" in verdict.reasons
    assert "fear taken for neutral during 0.6 of its 0.6 s (2.4 to 3.0 s)" in verdict.reasons
    assert any("cut too seldom: 3 stable segments found for 5" in reason for reason in verdict.reasons)


def test_boundaries_too_many_are_told_as_such():
    found = segments(
        (0, 2.1, "N"), (2.4, 3.0, "F"), (3.3, 4.0, "N"), (4.2, 4.6, "Su"), (4.8, 5.2, "J"), (5.4, 6.0, "N"),
        (6.4, 8.0, "Su"), (8.3, 10.0, "N"),
    )  # fmt: skip
    verdict = judge_take(REFERENCE, found)
    assert (verdict.missed, verdict.superfluous) == (0, 6)
    assert "6 boundaries found where there is none between 4.0 and 5.4 s" in verdict.reasons
    assert any("cut too often: 8 stable segments found for 5" in reason for reason in verdict.reasons)


def test_an_expression_taken_for_another_is_named_with_its_seconds():
    found = segments((0, 2.1, "N"), (2.4, 3.0, "F"), (3.3, 6.0, "N"), (6.4, 8.0, "F"), (8.3, 10.0, "N"))
    verdict = judge_take(REFERENCE, found)
    assert verdict.reasons == ("surprise taken for fear during 1.6 of its 1.6 s (6.4 to 8.0 s)",)
    assert verdict.agreement == pytest.approx(0.84)


def test_boundaries_that_all_come_late_are_said_to():
    late = segments(
        (0, 2.25, "N"), (2.55, 3.15, "F"), (3.45, 6.15, "N"), (6.55, 8.15, "Su"), (8.45, 10.0, "N")
    )  # fmt: skip
    assert "boundaries come 0.15 s too late" in judge_take(REFERENCE, late).reasons


def test_the_recording_is_blamed_where_it_is_bad():
    found = segments((0, 10.0, "N"), confidence=0.3)
    verdict = judge_take(REFERENCE, found, weights(residual=1.2, blind=slice(400, 450)), usual_residual=0.4)
    assert "the solved face lies 1.20 mm from the markers, in the middle take 0.40 mm" in verdict.reasons
    assert "5 % of the frames have no weights, the longest stretch from 4.0 to 4.5 s" in verdict.reasons
    assert "the classifier was unsure (mean confidence 0.30)" in verdict.reasons
    assert "8 boundaries missed between 2.1 and 8.3 s" in verdict.reasons


def test_a_take_in_which_nothing_was_found_is_told():
    nothing = Segments(REFERENCE.table.iloc[:0])
    verdict = judge_take(REFERENCE, nothing)
    assert verdict.agreement == 0.0
    assert verdict.reasons[0] == "no stable segment found for 5 in the reference"


def test_only_annotated_time_is_judged():
    parts = agreeing_stretches(segments((1.0, 2.0, "N")), segments((0.0, 1.5, "N"), (1.5, 3.0, "J")))
    assert parts.to_dict("list") == {
        "start_s": [1.0, 1.5],
        "end_s": [1.5, 2.0],
        "truth": ["N", "N"],
        "said": ["N", "J"],
    }
