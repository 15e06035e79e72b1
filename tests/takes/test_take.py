"""Takes: their tables for pandas and xarray."""

import numpy as np

from signface.takes.reading import read_take
from signface.takes.take import Take


def smile():
    positions = np.random.default_rng(0).normal(0, 60, (50, 3, 3))
    positions[4, 1] = np.nan
    return Take(positions, ("CHIN", "LBRO", "RBRO"), 25.0, 2.0, "smile", ("read", "cleaned"))


def test_the_table_written_as_csv_is_a_recording(tmp_path):
    take = smile()
    take.to_frame().to_csv(tmp_path / "smile.csv")
    back = read_take(tmp_path / "smile.csv", unit="mm")
    assert (back.labels, back.rate, back.start, back.name) == (take.labels, take.rate, take.start, take.name)
    np.testing.assert_allclose(back.positions, take.positions, rtol=0, atol=1e-9)


def test_the_table_of_pandas_is_indexed_by_time_and_free_to_be_changed():
    take = smile()
    table = take.to_frame()
    np.testing.assert_array_equal(table.index, take.time)
    np.testing.assert_array_equal(table[["LBRO_x", "LBRO_y", "LBRO_z"]], take.positions[:, 1])
    table["LBRO_x"] = 0.0
    assert (take.positions[5:, 1, 0] != 0).all()


def test_xarray_has_labelled_axes_units_and_the_history():
    take = smile()
    data = take.to_xarray()
    np.testing.assert_array_equal(data.sel(marker="RBRO", axis="y"), take.positions[:, 2, 1])
    assert data.sel(time=slice(3.0, None)).sizes == {"time": 25, "marker": 3, "axis": 3}
    assert data.attrs == {"units": "mm", "rate": 25.0, "history": "read\ncleaned"}
    assert (data.name, data["time"].attrs["units"]) == ("smile", "s")
