"""Descriptors: what they must be made of, their tables, and their history."""

import sys

import numpy as np
import pandas as pd
import pytest

from signface.descriptors import Descriptors
from signface.descriptors_files import read_weights, write_weights
from signface.errors import SignfaceError


def descriptors(weights, rate=200.0, start=0.0, **fields):
    names = tuple(f"base{i}" for i in range(np.shape(weights)[1]))
    return Descriptors(np.asarray(weights), names, rate, start, **fields)


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


def test_a_table_of_pandas_is_a_weights_file(tmp_path, nodding):
    nodding.to_frame().to_csv(tmp_path / "w.csv")
    back = read_weights(tmp_path / "w.csv")
    assert back.names == nodding.names
    np.testing.assert_allclose(back.weights, nodding.weights, rtol=0, atol=1e-12)
    np.testing.assert_allclose(back.head, nodding.head, rtol=0, atol=1e-9)


def test_the_table_of_pandas_is_indexed_by_time(nodding):
    table = nodding.to_frame()
    assert table.index.name == "time_s"
    np.testing.assert_array_equal(table.index, nodding.time)
    np.testing.assert_array_equal(table["jawOpen"], nodding.weight("jawOpen"))
    seen = np.isfinite(nodding.residual)
    np.testing.assert_allclose(table["head_rx_deg"][seen], 20 * np.sin(nodding.time[seen]), atol=1e-9)
    assert table["head_rx_deg"][~seen].isna().all()
    np.testing.assert_array_equal(table["head_y_mm"], nodding.head[:, 1, 3])


def test_xarray_has_labelled_axes_and_the_history(nodding):
    data = nodding.changed("solved", deviation=nodding.weights / 10).to_xarray()
    np.testing.assert_array_equal(data["weights"].sel(base="jawOpen"), nodding.weight("jawOpen"))
    late = data.sel(time=slice(1.0, None))
    np.testing.assert_array_equal(late["deviation"], nodding.weights[nodding.time >= 1] / 10)
    assert data["head"].dims == ("time", "row", "column")
    assert (data["residual"].attrs["units"], data.attrs["rate"], data.attrs["history"]) == ("mm", 50.0, "made\nsolved")


def test_without_xarray_the_extra_is_named(nodding, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(SignfaceError, match=r"xarray is not installed.*signface\[xarray\]"):
        nodding.to_xarray()


def test_poses_that_are_no_rigid_motions_fit_into_no_csv(tmp_path, nodding):
    stretched = nodding.changed("stretched", head=nodding.head * 2)
    with pytest.raises(SignfaceError, match="no rigid motions"):
        write_weights(stretched, tmp_path / "w.csv")
    assert list(tmp_path.iterdir()) == []
    write_weights(stretched, tmp_path / "w.parquet")
    assert read_weights(tmp_path / "w.parquet") == stretched
    assert isinstance(nodding.to_frame(), pd.DataFrame)
