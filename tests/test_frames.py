"""Frames in time: cutting a take, and the runs of a mask."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.frames import runs, stretches
from signface.takes.recording import TakeFile
from signface.takes.take import Take

RATES = st.sampled_from([24.0, 29.97, 50.0, 59.94, 120.0, 200.0])
TIMES = st.floats(-2, 12)


def take_of(frames, rate=50.0, start=0.0):
    return Take(np.arange(frames * 6.0).reshape(frames, 2, 3), ("a", "b"), rate, start, "smile", ("read",))


def descriptors_of(frames, rate=50.0, start=0.0):
    weights = np.arange(frames * 2.0).reshape(frames, 2)
    return Descriptors(weights, ("a", "b"), rate, start, weights[:, 0], None, "smile", deviation=weights)


@settings(deadline=None)
@given(frames=st.integers(1, 400), rate=RATES, start=st.floats(-1, 1), begin=TIMES, length=st.floats(0, 9))
def test_frames_between_two_times_are_those_whose_time_lies_there(frames, rate, start, begin, length):
    take, end = descriptors_of(frames, rate, start), begin + length
    inside = (take.time >= begin) & (take.time < end)
    near = np.minimum(abs(take.time - begin), abs(take.time - end)) < 2e-3 / rate
    try:
        part = take.between(begin, end)
    except SignfaceError:
        assert not (inside & ~near).any()
        return
    chosen = np.isin(take.weights[:, 0], part.weights[:, 0])
    assert (chosen == inside)[~near].all()
    np.testing.assert_allclose(part.time, take.time[chosen], rtol=0, atol=1e-9)
    for array in ("weights", "residual", "head", "deviation"):
        np.testing.assert_array_equal(getattr(part, array), getattr(take, array)[chosen])


@settings(deadline=None)
@given(frames=st.integers(2, 400), rate=RATES, start=st.floats(-1, 1), where=st.floats(0, 1))
@example(frames=100, rate=29.97, start=0.0, where=0.5)
@pytest.mark.parametrize("make", [take_of, descriptors_of])
def test_two_halves_joined_are_the_whole(make, frames, rate, start, where):
    whole = make(frames, rate, start)
    middle = whole.time[1] + where * (whole.time[-1] - whole.time[1])
    halves = whole.between(-math.inf, middle), whole.between(middle, math.inf)
    assert halves[0].n_frames + halves[1].n_frames == frames
    array = "positions" if make is take_of else "weights"
    np.testing.assert_array_equal(np.concatenate([getattr(half, array) for half in halves]), getattr(whole, array))
    assert halves[1].between(middle, math.inf) == halves[1]


@settings(deadline=None)
@given(frame=st.integers(1, 98), rate=RATES)
def test_a_time_rounded_for_a_table_cuts_at_its_frame(frame, rate):
    take = take_of(100, rate)
    for rounded in (round(take.time[frame], 6), math.floor(take.time[frame] * 1e6) / 1e6):
        assert take.between(rounded, math.inf).n_frames == 100 - frame
        assert take.between(0, rounded).n_frames == frame


def test_the_history_says_what_was_cut_and_nothing_left_is_an_error():
    take = take_of(100)
    assert take.between(0.5, 1.25).history == ("read", "between 0.5 and 1.25 s")
    for begin, end in ((2.0, 9.0), (1.0, 1.0), (1.5, 1.0), (math.nan, 1.0), (-3.0, 0.0)):
        with pytest.raises(SignfaceError, match=r"smile: no frame lies between.*from 0\.000 to 1\.980 s"):
            take.between(begin, end)


def test_a_recording_on_disk_is_cut_without_being_read():
    take = take_of(100, start=3.0)
    asked = []

    def read(begin, end, step):
        asked.append((begin, end))
        return take.positions[begin:end:step].copy()

    file = TakeFile(take.labels, take.rate, take.n_frames, read, take.start, take.name, take.history)
    part = file.between(3.5, 4.5).between(3.6, 4.4)
    assert asked == []
    assert part.whole() == take.between(3.5, 4.5).between(3.6, 4.4)
    np.testing.assert_array_equal(part.frames(0, 1000, 3), take.positions[30:70:3])
    assert max(end for _, end in asked) == 70


@given(st.lists(st.sampled_from([0, 1, 2]), max_size=40))
def test_stretches_are_the_groups_of_equal_neighbours(values):
    groups = [(value, len(list(group))) for value, group in itertools.groupby(values)]
    array = np.array(values, dtype=int)
    assert [(array[begin], end - begin) for begin, end in stretches(array)] == groups
    assert runs(array == 1).tolist() == [span for span in stretches(array).tolist() if array[span[0]] == 1]
