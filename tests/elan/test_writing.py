"""A take in ELAN: tiers, further channels, doubtful segments and curves, written together or not at all."""

from __future__ import annotations

import numpy as np
import pytest
from lxml import etree

from signface.annotation import Annotation
from signface.channels.rules import find_channels, find_intensities
from signface.elan.channels import channel_tiers
from signface.elan.mapping import ChannelRule
from signface.elan.reference import read_reference
from signface.elan.writing import write_eaf
from signface.errors import SignfaceError, SignfaceWarning
from signface.segmentation.segments import Segments
from signface.settings.eaf import EafOptions
from signface.signer import Signer
from tests.channels.test_rules import BROWS_UP, moving, pulse, turning
from tests.elan.test_templates import LAB
from tests.fixtures.elan_files import assert_valid, labelled, mapped, read_back


def nodding():
    """Raised brows for a second, and two nods."""
    nod = pulse(1.0, 2.0, lambda t: 5 * (1 - np.cos(2 * np.pi * t / 0.5)))
    return moving(**BROWS_UP, head=turning(100, 4, pitch=nod))


def with_channels(segments: Segments) -> Annotation:
    """Segments of that take with its channels and intensities."""
    take = nodding()
    channels = {events.channel: events for events in find_channels(take)}
    return Annotation(take, find_intensities(take, segments), "forest", channels, Signer("S1"))


def test_all_that_was_asked_for_lies_in_one_valid_file(tmp_path):
    path = tmp_path / "take.eaf"
    written = write_eaf(with_channels(labelled("N NJ J JN N")), path, options=EafOptions(doubtful=0.65))
    assert [file.name for file in written] == ["take.eaf", "take.curves.csv", "take_tsconf.xml"]
    assert all(file.is_file() for file in written)
    assert_valid(path)
    assert [row[:3] for row in read_back(path, "brows@S1")] == [(1000, 2000, "raised")]
    assert [row[2] for row in read_back(path, "head@S1")] == ["nod"]
    assert [row[2] for row in read_back(path, "head-cycles@S1")] == ["2.0"]
    assert [row[2] for row in read_back(path, "head-amplitude@S1")] == ["10"]
    assert len(read_back(path, "affect-doubtful@S1")) == 2
    assert read_reference(path, "S1").table["intensity"].notna().tolist() == [False, False, True, False, False]


def test_an_empty_channel_is_an_empty_tier_with_its_vocabulary(tmp_path):
    path = tmp_path / "take.eaf"
    write_eaf(with_channels(labelled()), path)
    root = etree.parse(path).getroot()
    assert root.find("TIER[@TIER_ID='cheeks@S1']") is not None
    assert root.find("CONTROLLED_VOCABULARY[@CV_ID='cheeks']/CV_ENTRY_ML") is not None


def test_events_are_clipped_to_the_time_of_the_film():
    take = moving(start=-1.5, **BROWS_UP)
    tier = next(tier for tier in channel_tiers(find_channels(take), "S1") if tier.channel == "brows")
    assert (tier.start_ms[0], tier.end_ms[0]) == (0, 500)


def test_nothing_is_written_when_the_file_was_worked_in(tmp_path):
    path = tmp_path / "take.eaf"
    write_eaf(labelled(), path, signer="S1")
    path.write_text(path.read_text("utf-8").replace("<ANNOTATION_VALUE>J<", "<ANNOTATION_VALUE>Su<"), "utf-8")
    there = sorted(tmp_path.iterdir())
    with pytest.raises(SignfaceError, match="corrected since"):
        write_eaf(Annotation(nodding(), labelled(), "forest"), path, signer="S1")
    assert sorted(tmp_path.iterdir()) == there


def test_nothing_is_written_when_the_mapping_does_not_fit(tmp_path):
    lab = tmp_path / "lab.eaf"
    lab.write_text(LAB, "utf-8")
    rules = {"affect": ChannelRule("Emotion_S1")}
    options, annotation = mapped(tmp_path, rules), with_channels(labelled())
    with pytest.raises(SignfaceError, match="closed vocabulary of the tier Emotion_S1"):
        write_eaf(annotation, tmp_path / "new.eaf", options=options.changed(template=str(lab)))
    with pytest.raises(SignfaceError, match="closed vocabulary of the tier Emotion_S1"):
        write_eaf(annotation, into=lab, options=options)
    assert [file.name for file in tmp_path.iterdir()] == ["lab.eaf"]


def test_into_a_file_that_has_curves_of_its_own(tmp_path):
    lab = tmp_path / "lab.eaf"
    own = '<LINKED_FILE_DESCRIPTOR LINK_URL="file:///films/theirs_tsconf.xml" MIME_TYPE="text/xml"/>\n    <PROPERTY'
    lab.write_text(LAB.replace("<PROPERTY", own, 1), "utf-8")
    with pytest.warns(SignfaceWarning, match="links theirs_tsconf.xml"):
        written = write_eaf(Annotation(nodding(), labelled(), "forest"), into=lab, signer="S1")
    assert [file.name for file in written] == ["lab.eaf", "lab.curves.csv"]
    assert_valid(lab)
    links = [link.get("LINK_URL") for link in etree.parse(lab).getroot().iterfind("HEADER/LINKED_FILE_DESCRIPTOR")]
    assert sum(link.endswith("_tsconf.xml") for link in links) == 1


def test_the_same_take_again_changes_nothing_but_the_date(tmp_path):
    lab = tmp_path / "lab.eaf"
    lab.write_text(LAB, "utf-8")
    for _ in range(2):
        write_eaf(with_channels(labelled()), into=lab, date="2026-01-01")
    assert len(list(tmp_path.glob("*.bak*"))) == 1
    assert [row[2] for row in read_back(lab, "Gloss")] == [" HAUS  ü ", ""]
