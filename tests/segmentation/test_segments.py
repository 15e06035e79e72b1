"""Tables of segments: cut in time."""

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from signface.errors import SignfaceError
from signface.segmentation.segments import Segments, value_at

SEGMENTS = Segments(
    pd.DataFrame(
        {
            "start_s": [0.5, 1.0, 1.4, 3.0],
            "end_s": [1.0, 1.4, 2.5, 4.0],
            "kind": ["stable", "transition", "stable", "stable"],
            "label": ["N", "NJ", "J", "A"],
        }
    ),
    "laugh",
    ("cut",),
)


@settings(deadline=None)
@given(begin=st.floats(-1, 4), length=st.floats(0.01, 4))
def test_a_stretch_says_what_the_whole_says_there(begin, length):
    times = begin + length * np.linspace(0.001, 0.999, 50)
    said = value_at(SEGMENTS.table, "label", times)
    try:
        part = SEGMENTS.between(begin, begin + length)
    except SignfaceError:
        assert (said == "").all()
        return
    np.testing.assert_array_equal(value_at(part.table, "label", times), said)
    assert part.table["start_s"].min() >= begin
    assert part.table["end_s"].max() <= begin + length


def test_segments_cut_in_time_say_so():
    assert SEGMENTS.between(-math.inf, math.inf) == SEGMENTS
    assert SEGMENTS.between(1.2, 3.0).history == ("cut", "between 1.2 and 3 s")
    with pytest.raises(SignfaceError, match=r"laugh: no segment lies between 2\.5 and 3 s"):
        SEGMENTS.between(2.5, 3)


def test_the_table_handed_out_is_free_to_be_changed():
    table = SEGMENTS.to_frame()
    table["label"] = "Su"
    assert SEGMENTS.table["label"].tolist() == ["N", "NJ", "J", "A"]
