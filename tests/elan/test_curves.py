"""Curves as ELAN's timeseries viewer reads them."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from lxml import etree

from signface.annotation import Annotation
from signface.descriptors import Descriptors
from signface.elan.curves import CURVES, panels, write_curves, write_tsconf
from signface.elan.writing import write_eaf
from signface.errors import SignfaceError, SignfaceWarning
from signface.segmentation.curves import curves_table
from tests.fixtures.elan_files import assert_valid, labelled


def descriptors(rate=200.0, *, start=0.0, seconds=2.5, names=("browInnerUp", "eyeBlinkLeft", "jawOpen")) -> Descriptors:
    time = np.arange(round(seconds * rate)) / rate
    weights = np.column_stack([np.sin(time * (2 + k)) ** 2 for k in range(len(names))])
    return Descriptors(weights, names, rate, start=start, residual=0.5 + 0.1 * np.sin(time), name="take")


def as_elan_reads(path) -> tuple[float, list[list[float]]]:
    """Rate and rows as ELAN's CSVReader finds them: `#` lines skipped, the rate from twenty rows, times in whole ms."""
    rows = [line.split(",") for line in path.read_text().splitlines() if line and not line.startswith("#")]
    first = [round(float(row[0]) * 1000) for row in rows[:20]]
    rate = round(1000 / ((first[-1] - first[0]) / (len(first) - 1)))
    return rate, [[float(cell) for cell in row] for row in rows]


@pytest.mark.parametrize("rate", [25.0, 29.97, 60.0, 120.0, 200.0, 240.0])
def test_elan_finds_the_true_rate_whatever_that_of_the_take(tmp_path, rate):
    path = tmp_path / "take.curves.csv"
    write_curves(curves_table(descriptors(rate), labelled()), path)
    found, rows = as_elan_reads(path)
    for index, row in enumerate(rows):
        assert abs(index / found - row[0]) < 1e-9


def test_curves_are_the_takes_own(tmp_path):
    take = descriptors(200.0)
    table = curves_table(take, labelled())
    every_second = slice(0, None, 2)
    np.testing.assert_allclose(table["jaw_open"], take.weight("jawOpen")[every_second], atol=1e-12)
    np.testing.assert_allclose(table["residual_mm"], take.residual[every_second], atol=1e-12)
    assert table["confidence"].iloc[0] == 0.9
    assert table.loc[table["time_s"] == 0.5, "confidence"].iloc[0] == pytest.approx(0.8)


def test_energies_rise_where_the_face_moves():
    time = np.arange(400) / 200
    weights = (1 / (1 + np.exp(-(time - 1) / 0.05)))[:, None]
    table = curves_table(Descriptors(weights, ("jawOpen",), 200.0, name="take"), labelled())
    peak = table["time_s"][table["velocity_energy"].idxmax()]
    assert abs(peak - 1.0) < 0.02


def test_a_missing_value_is_no_zero(tmp_path):
    path = tmp_path / "take.curves.csv"
    take = descriptors()
    weights = take.weights.copy()
    weights[100:120] = np.nan
    gappy = take.changed("gap", weights=weights, residual=np.full(take.n_frames, np.nan))
    write_curves(curves_table(gappy, labelled()), path)
    row = next(line for line in path.read_text().splitlines() if line.startswith("0.5500,"))
    assert row.split(",")[4:] == ["NaN", "NaN", "NaN", "NaN"]


def test_a_take_that_starts_late_or_early_keeps_its_times():
    assert curves_table(descriptors(start=1.2344), labelled())["time_s"].iloc[0] == pytest.approx(1.24)
    assert curves_table(descriptors(start=-0.5), labelled())["time_s"].iloc[0] == 0.0
    with pytest.raises(SignfaceError, match="before time 0"):
        curves_table(descriptors(start=-10.0), labelled())


def test_a_face_with_other_bases_shows_those_that_move_most():
    take = descriptors(names=("AU1", "AU2"))
    assert {"AU1", "AU2"} <= set(curves_table(take, labelled()).columns)


def test_the_description_points_at_the_columns_it_names(tmp_path):
    curves, tsconf = tmp_path / "take.curves.csv", tmp_path / "take_tsconf.xml"
    write_curves(curves_table(descriptors(), labelled()), curves)
    write_tsconf(curves, tsconf, date="2026-01-01")
    root = etree.parse(tsconf).getroot()
    assert (root.tag, root.get("version")) == ("timeseries", "1.0")
    source = root.find("tracksource")
    assert source.get("sample-type") == "Continuous Rate"
    assert source.find("property").get("value") == "mpi.eudico.client.annotator.timeseries.csv.CSVServiceProvider"
    table = pd.read_csv(curves)
    assert table.columns[int(source.get("time-column"))] == "#time_s"
    for track in source.iterfind("track"):
        name, column = track.get("name"), int(track.find("sample-position/pos").get("col"))
        assert CURVES[table.columns[column]].name == name
        low, high = float(track.find("range").get("min")), float(track.find("range").get("max"))
        assert low <= table.iloc[:, column].min()
        assert table.iloc[:, column].max() <= high
        assert [child.tag for child in track] == [
            "property", "sample-position", "description", "units", "range", "color"
        ]  # fmt: skip
        assert len(track.findtext("color").split(",")) == 3
    names = [track.get("name") for track in source.iterfind("track")]
    assert names == ["velocity", "acceleration", "confidence", "brows up", "lids closed", "jaw open", "residual"]


def test_the_eaf_links_both_files_and_elan_shows_the_curves(tmp_path):
    eaf, curves, tsconf = tmp_path / "take.eaf", tmp_path / "take.curves.csv", tmp_path / "take_tsconf.xml"
    assert write_eaf(Annotation(descriptors(), labelled(), "forest"), eaf, signer="S1") == [eaf, curves, tsconf]
    assert_valid(eaf)
    links = etree.parse(eaf).getroot().findall("HEADER/LINKED_FILE_DESCRIPTOR")
    assert [(link.get("MIME_TYPE"), link.get("RELATIVE_LINK_URL")) for link in links] == [
        ("text/plain", "./take.curves.csv"),
        ("text/xml", "./take_tsconf.xml"),
    ]
    # ELAN maps the source to the linked file by this very URL
    assert etree.parse(tsconf).find("tracksource").get("source-url") == links[0].get("LINK_URL")
    preferences = etree.parse(tmp_path / "take.pfsx").getroot()
    shown = {text.text for text in preferences.iterfind("prefList/String")}
    assert shown == {track.get("name") for track in etree.parse(tsconf).iterfind("tracksource/track")}
    assert preferences.findtext("pref[@key='TimeSeriesViewer.NumberOfPanels']/Int") == "5"


@pytest.mark.parametrize(
    "bases", [("AU01_r",), tuple(f"mouthShapeLeft{k}" for k in range(9)), ("browInnerUp", "jawOpen")]
)
def test_no_panel_holds_more_curves_than_can_be_read(tmp_path, bases):
    write_curves(curves_table(descriptors(names=bases), labelled()), tmp_path / "take.curves.csv")
    drawn = panels(tmp_path / "take.curves.csv")
    assert max(map(len, drawn.values())) <= 5
    names = [name for panel in drawn.values() for name in panel]
    assert len(set(names)) == len(names) == len(pd.read_csv(tmp_path / "take.curves.csv").columns) - 1


def test_tracks_and_colours_of_others_stay_in_the_description(tmp_path):
    """ELAN keeps the tracks that an annotator adds in a file of this very name."""
    eaf, tsconf = tmp_path / "take.eaf", tmp_path / "take_tsconf.xml"
    tsconf.write_text(
        '<timeseries version="1.0"><tracksource source-url="file:///glove.csv"><track name="bend"/></tracksource>'
        "</timeseries>"
    )
    write_eaf(Annotation(descriptors(), labelled(), "forest"), eaf, signer="S1")
    text = tsconf.read_text("utf-8")
    tsconf.write_text(text.replace("<color>0,158,115<", "<color>1,2,3<", 1), "utf-8")
    write_eaf(Annotation(descriptors(), labelled("N NA A AN N"), "forest"), eaf, signer="S1")
    sources = etree.parse(tsconf).findall("tracksource")
    assert [source.get("source-url").rpartition("/")[2] for source in sources] == ["take.curves.csv", "glove.csv"]
    assert sources[0].find("track").get("name") == "velocity"
    assert sources[0].findtext("track/color") == "1,2,3"


@pytest.mark.parametrize("other", ["<other/>", "no XML"])
def test_a_file_that_is_no_description_is_left_as_it_is(tmp_path, other):
    (tmp_path / "take_tsconf.xml").write_text(other)
    with pytest.warns(SignfaceWarning, match="is no description of curves"):
        write_eaf(Annotation(descriptors(), labelled(), "forest"), tmp_path / "take.eaf", signer="S1")
    assert (tmp_path / "take_tsconf.xml").read_text() == other
