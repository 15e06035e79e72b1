"""Descriptors and the weights file."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from signface.descriptors import Descriptors, read_weights, write_weights
from signface.errors import SignfaceError

WEIGHTS = arrays(np.float64, st.tuples(st.integers(2, 8), st.integers(1, 4)), elements=st.floats(-1, 2))


def descriptors(weights, rate=200.0, start=0.0, **fields):
    names = tuple(f"base{i}" for i in range(np.shape(weights)[1]))
    return Descriptors(np.asarray(weights), names, rate, start, **fields)


@settings(deadline=None, max_examples=25)
@given(WEIGHTS, st.sampled_from([24.0, 29.97, 30.0, 60.0, 120.0, 200.0]), st.floats(0, 4000))
@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_a_weights_file_gives_back_what_was_written(tmp_path_factory, ending, weights, rate, start):
    file = tmp_path_factory.mktemp("weights") / f"take{ending}"
    written = descriptors(weights, rate, start, residual=np.arange(len(weights), dtype=float))
    write_weights(written, file)
    back = read_weights(file)
    assert back.names == written.names
    np.testing.assert_allclose(back.weights, written.weights, atol=1e-6)
    np.testing.assert_allclose(back.residual, written.residual)
    assert abs(back.start - start) < 1e-6
    assert back.rate == pytest.approx(rate, abs=2e-3)


def test_frames_that_could_not_be_solved_stay_unknown(tmp_path):
    weights = np.array([[0.0, 1.0], [np.nan, np.nan], [0.5, 0.5]])
    write_weights(descriptors(weights), tmp_path / "w.csv")
    np.testing.assert_array_equal(np.isnan(read_weights(tmp_path / "w.csv").weights), np.isnan(weights))


def test_a_weights_file_has_the_columns_of_the_contract(tmp_path):
    write_weights(descriptors(np.zeros((3, 2))), tmp_path / "w.csv")
    assert (tmp_path / "w.csv").read_text().splitlines()[0] == "time_s,base0,base1,residual_mm"


@pytest.mark.parametrize(
    ("content", "wrong"),
    [
        ("", "cannot be read"),
        ("a,b,c\n1,2,3\n", "is not a weights file"),
        ("time_s,jawOpen,residual_mm\n0,0,0\n", "fewer than two frames"),
        ("time_s,jawOpen,residual_mm\n0,0,0\n0,0,0\n", "do not rise evenly"),
        ("time_s,jawOpen,residual_mm\n0,0,0\n1,x,0\n", "not numbers"),
        ("time_s,jawOpen,residual_mm\n0,0,0\n0.1,0,0\n9,0,0\n", "do not rise evenly"),
    ],
)
def test_a_bad_weights_file_is_one_clear_line(tmp_path, content, wrong):
    file = tmp_path / "w.csv"
    file.write_text(content)
    with pytest.raises(SignfaceError, match=wrong) as error:
        read_weights(file)
    assert str(file) in str(error.value)
    assert "\n" not in str(error.value)


def test_other_endings_are_refused(tmp_path):
    with pytest.raises(SignfaceError, match=r"\.csv or \.parquet"):
        write_weights(descriptors(np.zeros((2, 1))), tmp_path / "w.xlsx")


@pytest.mark.parametrize(
    "fields",
    [
        {"names": ("a",)},
        {"names": ("a", "a")},
        {"rate": 0.0},
        {"rate": float("nan")},
        {"residual": np.zeros(2)},
        {"head": np.zeros((3, 3, 3))},
    ],
)
def test_shapes_are_checked_at_the_door(fields):
    good = {"weights": np.zeros((3, 2)), "names": ("a", "b"), "rate": 30.0}
    with pytest.raises(SignfaceError):
        Descriptors(**{**good, **fields})


def test_history_grows_and_nothing_can_be_changed_in_place():
    before = descriptors(np.zeros((2, 1)))
    after = before.changed("scaled", weights=np.ones((2, 1)))
    assert after.history == ("scaled",)
    assert before.history == ()
    with pytest.raises(ValueError, match="read-only"):
        after.weights[0, 0] = 3
