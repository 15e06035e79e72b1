"""Labelled segments as EAF 3.0 files that ELAN and other parsers read."""

from __future__ import annotations

import math
from pathlib import Path, PureWindowsPath

import numpy as np
import pandas as pd
import pympi
import pytest
import xmlschema
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from signface.elan.document import link_urls, read_document
from signface.elan.reference import read_reference
from signface.elan.tiers import milliseconds
from signface.elan.writing import write_eaf
from signface.errors import SignfaceError
from signface.segmentation.segments import Segments
from tests.fixtures.elan_files import SCHEMA, assert_valid, labelled, read_back
from tests.fixtures.third_party import third_party_file


def root_of(path: Path) -> etree._Element:
    return etree.parse(path).getroot()


def correct(path: Path, old: str, new: str) -> None:
    """Do what an annotator does: change the value of an annotation."""
    text = path.read_text("utf-8")
    wrong = f"<ANNOTATION_VALUE>{old}</ANNOTATION_VALUE>"
    assert wrong in text
    path.write_text(text.replace(wrong, f"<ANNOTATION_VALUE>{new}</ANNOTATION_VALUE>", 1), "utf-8")


def test_stereotypes_are_described_in_elans_own_spelling(tmp_path):
    """A document that differs from ELAN's in this would look changed when ELAN saves it."""
    write_eaf(labelled(), tmp_path / "take.eaf")
    constraint = root_of(tmp_path / "take.eaf").find("CONSTRAINT[@STEREOTYPE='Symbolic_Subdivision']")
    assert constraint.get("DESCRIPTION").endswith("Annotations refering to the same parent are ordered")


def test_what_is_written_is_valid_under_two_validators(tmp_path):
    path = tmp_path / "take.eaf"
    write_eaf(labelled(), path, signer="S1", video=tmp_path / "take.mp4", properties={"model": "forest"})
    assert_valid(path)
    xmlschema.XMLSchema(str(third_party_file(SCHEMA))).validate(str(path))


def test_a_second_parser_reads_the_same_annotations(tmp_path):
    path = tmp_path / "take.eaf"
    write_eaf(labelled("N NSa Sa"), path, signer="S1")
    affect = read_back(path, "affect@S1")
    assert [row[:3] for row in affect] == [(0, 500, "N"), (500, 1000, "NSa"), (1000, 1500, "Sa")]
    confidence = read_back(path, "affect-confidence@S1")
    assert [row[:3] for row in confidence] == [(0, 500, "0.90"), (500, 1000, "0.70"), (1000, 1500, "0.50")]
    eaf = pympi.Elan.Eaf(str(path))
    assert eaf.get_parameters_for_tier("affect-confidence@S1")["PARENT_REF"] == "affect@S1"
    assert eaf.linguistic_types["affect-confidence"]["CONSTRAINTS"] == "Symbolic_Association"


def test_header_names_the_tool_its_version_the_model_and_the_take(tmp_path):
    path = tmp_path / "take.eaf"
    write_eaf(labelled(name="IE_joy"), path, signer="S1", properties={"model": "forest", "face": "default"})
    found = {p.get("NAME"): p.text for p in root_of(path).iterfind("HEADER/PROPERTY")}
    assert found["signface:tool"] == "signface"
    assert found["signface:version"]
    assert found["signface:model"] == "forest"
    assert found["signface:take"] == "IE_joy"
    assert found["lastUsedAnnotationId"] == "10"
    assert root_of(path).get("FORMAT") == root_of(path).get("VERSION") == "3.0"


def test_the_vocabulary_is_closed_described_and_referred_to(tmp_path):
    path = tmp_path / "take.eaf"
    write_eaf(labelled(), path, signer="S1")
    root = root_of(path)
    entries = {
        entry.findtext("CVE_VALUE"): entry
        for entry in root.iterfind("CONTROLLED_VOCABULARY[@CV_ID='affect']/CV_ENTRY_ML")
    }
    assert len(entries) == 7 + 42
    assert entries["Su"].find("CVE_VALUE").get("DESCRIPTION") == "surprise"
    assert entries["ASa"].find("CVE_VALUE").get("DESCRIPTION") == "transition from anger to sadness"
    for annotation in root.iterfind("TIER[@TIER_ID='affect@S1']/ANNOTATION/ALIGNABLE_ANNOTATION"):
        assert annotation.get("CVE_REF") == entries[annotation.findtext("ANNOTATION_VALUE")].get("CVE_ID")


def test_elan_finds_a_colour_for_every_entry(tmp_path):
    path = tmp_path / "take.eaf"
    write_eaf(labelled(), path, signer="S1")
    identifiers = {entry.get("CVE_ID") for entry in root_of(path).iterfind("CONTROLLED_VOCABULARY[@CV_ID='affect']/*")}
    identifiers.discard(None)  # the vocabulary's own description
    group = etree.parse(tmp_path / "take.pfsx").find("prefGroup[@key='CV.ML.Prefs']/prefGroup[@key='affect']")
    assert {entry.get("key") for entry in group} == identifiers
    for colour in group.iterfind("prefGroup/pref[@key='Color']/Object[@class='java.awt.Color']"):
        assert all(0 <= int(part) <= 255 for part in colour.text.split(","))


def test_same_input_and_date_give_the_same_bytes(tmp_path):
    written = []
    for name in ("a", "b"):
        folder = tmp_path / name
        write_eaf(labelled(), folder / "take.eaf", signer="S1", date="2026-01-01T00:00:00+00:00")
        written.append((folder / "take.eaf").read_bytes())
    assert written[0] == written[1]


@pytest.mark.parametrize("signer", ["S1", 'Zoë & <Ana> "B"', "李 小龙", "a@b", "tab\there", "", "نیم‌فاصله"])
def test_signers_of_any_name(tmp_path, signer):
    path = tmp_path / "take.eaf"
    write_eaf(labelled(), path, signer=signer)
    assert_valid(path)
    assert list(read_reference(path, signer or None).table["label"]) == ["N", "NJ", "J", "JN", "N"]


def test_intensity_hangs_on_the_affect_and_comes_back(tmp_path):
    path = tmp_path / "take.eaf"
    segments = labelled("N NJ J JN N")
    table = segments.table.assign(intensity=[np.nan, np.nan, 3, np.nan, np.nan])
    write_eaf(Segments(table, name="take"), path, signer="S1")
    assert_valid(path)
    back = read_reference(path, "S1").table
    assert back["intensity"].isna().tolist() == [True, True, False, True, True]
    assert back["intensity"][2] == 3


@settings(deadline=None, max_examples=60)
@given(
    st.lists(st.tuples(st.floats(1e-4, 3), st.sampled_from([0.0, 0.0, 1e-12, 0.0004, 0.2])), min_size=1, max_size=30),
    st.floats(0, 100),
)
def test_rounding_makes_no_gap_no_overlap_and_nothing_empty(spans, origin):
    start, end, now = [], [], origin
    for duration, gap in spans:
        start.append(now + gap)
        end.append(now + gap + duration)
        now = end[-1]
    start_ms, end_ms = milliseconds(np.array(start), np.array(end))
    assert (end_ms > start_ms).all()
    assert (start_ms[1:] >= end_ms[:-1]).all()
    touching = np.abs(np.array(start[1:]) - np.array(end[:-1])) < 5e-4 - 1e-9
    assert (start_ms[1:] == end_ms[:-1])[touching].all()
    if min(duration for duration, _ in spans) >= 0.002:  # nothing had to be pushed
        assert np.abs(start_ms - 1000 * np.array(start)).max() <= 1.0 + 1e-6
        assert np.abs(end_ms - 1000 * np.array(end)).max() <= 0.5 + 1e-6


@settings(deadline=None, max_examples=25)
@given(st.lists(st.sampled_from(["N", "A", "D", "F", "J", "Sa", "Su"]), min_size=2, max_size=12), st.integers(1, 5000))
def test_what_is_written_is_read_back(tmp_path_factory, labels, step_ms):
    path = tmp_path_factory.mktemp("eaf") / "take.eaf"
    segments = labelled(" ".join(labels), step=step_ms / 1000)
    write_eaf(segments, path, signer="S1")
    back = read_reference(path, "S1").table
    assert list(back["label"]) == labels
    np.testing.assert_allclose(back["start_s"], segments.table["start_s"], atol=6e-4)
    np.testing.assert_allclose(back["end_s"], segments.table["end_s"], atol=6e-4)


def test_a_take_that_began_before_its_video_is_cut_at_time_0(tmp_path):
    path = tmp_path / "take.eaf"
    write_eaf(labelled("N NJ J", start=-0.7), path, signer="S1")
    assert_valid(path)
    assert [row[:3] for row in read_back(path, "affect@S1")] == [(0, 300, "NJ"), (300, 800, "J")]


def test_a_label_outside_the_vocabulary_is_refused_before_anything_is_written(tmp_path):
    segments = labelled()
    odd = Segments(segments.table.assign(label="happy"), name="take")
    with pytest.raises(SignfaceError, match="'happy' not in the closed vocabulary affect"):
        write_eaf(odd, tmp_path / "take.eaf", signer="S1")
    assert list(tmp_path.iterdir()) == []


def test_segments_without_labels_are_refused(tmp_path):
    bare = Segments(pd.DataFrame({"start_s": [0.0], "end_s": [1.0], "kind": ["stable"]}), name="take")
    with pytest.raises(SignfaceError, match="no labels"):
        write_eaf(bare, tmp_path / "take.eaf")


def test_our_own_untouched_output_is_written_over(tmp_path):
    path = tmp_path / "take.eaf"
    write_eaf(labelled(), path, signer="S1", date="2026-01-01")
    write_eaf(labelled(), path, signer="S1", date="2026-01-02")
    assert root_of(path).get("DATE").startswith("2026-01-02")
    assert not (tmp_path / "take.eaf.bak").exists()
    write_eaf(labelled("N NA A"), path, signer="S1")
    assert [row[2] for row in read_back(tmp_path / "take.eaf.bak", "affect@S1")] == ["N", "NJ", "J", "JN", "N"]


def test_an_annotators_correction_is_never_overwritten_unasked(tmp_path):
    path = tmp_path / "take.eaf"
    write_eaf(labelled(), path, signer="S1")
    correct(path, "J", "Su")
    corrected = path.read_bytes()
    with pytest.raises(SignfaceError, match="corrected since"):
        write_eaf(labelled("N NA A"), path, signer="S1")
    assert path.read_bytes() == corrected
    write_eaf(labelled("N NA A"), path, signer="S1", replace=True)
    assert (tmp_path / "take.eaf.bak").read_bytes() == corrected
    assert [row[2] for row in read_back(path, "affect@S1")] == ["N", "NA", "A"]


def test_an_earlier_backup_survives_a_later_one(tmp_path):
    path = tmp_path / "take.eaf"
    kept = []
    for label in ("Su", "Sa"):
        write_eaf(labelled(), path, signer="S1", replace=True)
        correct(path, "J", label)
        kept.append(path.read_bytes())
        write_eaf(labelled(), path, signer="S1", replace=True)
    backups = {backup.read_bytes() for backup in tmp_path.glob("take.eaf.bak*")}
    assert set(kept) <= backups


@pytest.mark.parametrize("content", [b"", b"not xml", b"<ANNOTATION_DOCUMENT/>"])
def test_a_file_that_is_none_of_ours_is_not_overwritten(tmp_path, content):
    path = tmp_path / "take.eaf"
    path.write_bytes(content)
    with pytest.raises(SignfaceError, match="did not write"):
        write_eaf(labelled(), path, signer="S1")
    assert path.read_bytes() == content


def test_an_added_tier_makes_the_file_the_annotators(tmp_path):
    path = tmp_path / "take.eaf"
    write_eaf(labelled(), path, signer="S1")
    eaf = pympi.Elan.Eaf(str(path))
    eaf.add_tier("gloss")
    eaf.to_file(str(path))
    with pytest.raises(SignfaceError, match="did not write"):
        write_eaf(labelled(), path, signer="S1")


def test_media_are_linked_absolutely_and_relatively_as_elan_resolves_them(tmp_path):
    folder = tmp_path / "my films"
    folder.mkdir()
    video = folder / "vidéo 1.mp4"
    video.write_bytes(b"")
    path = tmp_path / "eaf" / "take.eaf"
    write_eaf(labelled(), path, signer="S1", video=video)
    assert_valid(path)
    media = root_of(path).find("HEADER/MEDIA_DESCRIPTOR")
    # ELAN cuts off "file:" and takes the rest as a path, without decoding
    assert Path(media.get("MEDIA_URL").removeprefix("file:")).is_file()
    assert (path.parent / media.get("RELATIVE_MEDIA_URL")).is_file()
    assert media.get("MIME_TYPE") == "video/mp4"


@pytest.mark.parametrize("name", ["100% joy.mp4", "a#b#c.mp4", "a[1].mp4", "a{b}|^`.mp4", "日本.mov", "a&b<c>.mp4"])
def test_media_of_any_name_leave_the_file_valid(tmp_path, name):
    path = tmp_path / "take.eaf"
    write_eaf(labelled(), path, signer="S1", video=tmp_path / name)
    assert_valid(path)


def test_windows_paths_and_addresses_are_linked_too():
    video = PureWindowsPath(r"D:\corpus\films\a b.mp4")
    assert link_urls(video, PureWindowsPath(r"D:\corpus\eaf\a.eaf")) == (
        "file:///D:/corpus/films/a b.mp4",
        "../films/a b.mp4",
    )
    assert link_urls(video, PureWindowsPath(r"C:\eaf\a.eaf"))[1] is None
    share = PureWindowsPath(r"\\server\corpus\a.mp4")
    assert link_urls(share, PureWindowsPath(r"\\server\corpus\a.eaf")) == ("file://server/corpus/a.mp4", "./a.mp4")
    assert link_urls("https://example.org/a.mp4", "a.eaf") == ("https://example.org/a.mp4", None)


@pytest.mark.slow
def test_a_long_take_comes_back_whole(tmp_path):

    path = tmp_path / "take.eaf"
    long = labelled(" ".join(["N", "NJ", "J", "JN"] * 1250), step=0.25)
    write_eaf(long, path, signer="S1")
    assert len(read_reference(path, "S1")) == 5000
    assert math.isclose(read_reference(path, "S1").table["end_s"].iloc[-1], 1250.0)


def test_time_slots_stand_in_the_order_of_time_and_identifiers_are_unique(tmp_path):
    path = tmp_path / "take.eaf"
    write_eaf(labelled(), path, signer="S1")
    root = read_document(path).getroot()
    times = [int(slot.get("TIME_VALUE")) for slot in root.iterfind("TIME_ORDER/TIME_SLOT")]
    assert times == sorted(times)
    identifiers = [element.get("ANNOTATION_ID") for element in root.iterfind("TIER/ANNOTATION/*")]
    assert len(set(identifiers)) == len(identifiers) == 10
