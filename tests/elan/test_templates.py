"""Our tiers in the files of a lab: templates, mappings, and files in which annotators have worked."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from lxml import etree

from signface.annotation import Annotation
from signface.channels.events import ChannelEvents
from signface.elan.document import read_document, tier_rows
from signface.elan.mapping import ChannelRule, read_mapping
from signface.elan.mapping_draft import suggest_mapping
from signface.elan.tiers import Tier
from signface.elan.vocabularies import read_vocabulary
from signface.elan.writing import prepare, write_eaf
from signface.errors import SignfaceError, SignfaceWarning
from signface.label.vocabulary import AFFECT
from signface.settings.eaf import EafOptions
from signface.signer import Signer
from tests.elan.test_curves import descriptors
from tests.fixtures.elan_files import assert_valid, labelled, mapped, read_back

LAB = """<?xml version="1.0" encoding="UTF-8"?>
<!-- the lab's own template -->
<ANNOTATION_DOCUMENT xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" AUTHOR="lab" DATE="2024-02-01T10:00:00+01:00"
    FORMAT="3.0" VERSION="3.0" xsi:noNamespaceSchemaLocation="http://www.mpi.nl/tools/elan/EAFv3.0.xsd">
  <LICENSE LICENSE_URL="https://example.org/licence">for research</LICENSE>
  <HEADER MEDIA_FILE="" TIME_UNITS="milliseconds">
    <MEDIA_DESCRIPTOR MEDIA_URL="file:///films/a.mp4" MIME_TYPE="video/mp4" TIME_ORIGIN="40"/>
    <LINKED_FILE_DESCRIPTOR LINK_URL="file:///films/glove.csv" MIME_TYPE="text/plain"/>
    <PROPERTY NAME="project">corpus of ours</PROPERTY>
    <PROPERTY NAME="lastUsedAnnotationId">17</PROPERTY>
  </HEADER>
  <TIME_ORDER>
    <TIME_SLOT TIME_SLOT_ID="ts1" TIME_VALUE="0"/>
    <TIME_SLOT TIME_SLOT_ID="ts7" TIME_VALUE="600"/>
    <TIME_SLOT TIME_SLOT_ID="ts3"/>
    <TIME_SLOT TIME_SLOT_ID="ts4" TIME_VALUE="900"/>
  </TIME_ORDER>
  <TIER TIER_ID="Gloss" LINGUISTIC_TYPE_REF="gloss" PARTICIPANT="S1" ANNOTATOR="eva" LANG_REF="deu">
    <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="a5" TIME_SLOT_REF1="ts1" TIME_SLOT_REF2="ts7">
      <ANNOTATION_VALUE> HAUS  ü </ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>
    <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="a6" TIME_SLOT_REF1="ts7" TIME_SLOT_REF2="ts4" EXT_REF="er1">
      <ANNOTATION_VALUE/></ALIGNABLE_ANNOTATION></ANNOTATION>
  </TIER>
  <TIER TIER_ID="Comment" LINGUISTIC_TYPE_REF="note" PARENT_REF="Gloss">
    <ANNOTATION><REF_ANNOTATION ANNOTATION_ID="a9" ANNOTATION_REF="a5">
      <ANNOTATION_VALUE>look again</ANNOTATION_VALUE></REF_ANNOTATION></ANNOTATION>
  </TIER>
  <TIER TIER_ID="Emotion_S1" LINGUISTIC_TYPE_REF="emotion" PARTICIPANT="S1" LANG_REF="deu"/>
  <TIER TIER_ID="Certainty_S1" LINGUISTIC_TYPE_REF="certainty" PARENT_REF="Emotion_S1"/>
  <LINGUISTIC_TYPE LINGUISTIC_TYPE_ID="gloss" TIME_ALIGNABLE="true" GRAPHIC_REFERENCES="false"/>
  <LINGUISTIC_TYPE LINGUISTIC_TYPE_ID="note" TIME_ALIGNABLE="false" CONSTRAINTS="Symbolic_Association"/>
  <LINGUISTIC_TYPE LINGUISTIC_TYPE_ID="certainty" TIME_ALIGNABLE="false" CONSTRAINTS="Symbolic_Association"/>
  <LINGUISTIC_TYPE LINGUISTIC_TYPE_ID="emotion" TIME_ALIGNABLE="true" CONTROLLED_VOCABULARY_REF="Emotionen"/>
  <LOCALE LANGUAGE_CODE="de" COUNTRY_CODE="DE"/>
  <LANGUAGE LANG_ID="deu" LANG_DEF="http://cdb.iso.org/lg/CDB-00138502-001" LANG_LABEL="German"/>
  <LANGUAGE LANG_ID="eng" LANG_LABEL="English"/>
  <CONSTRAINT STEREOTYPE="Symbolic_Association" DESCRIPTION="1-1 association with a parent annotation"/>
  <CONTROLLED_VOCABULARY CV_ID="Emotionen">
    <DESCRIPTION LANG_REF="deu">Gefühle</DESCRIPTION>
    <CV_ENTRY_ML CVE_ID="e0"><CVE_VALUE LANG_REF="eng">neutral</CVE_VALUE><CVE_VALUE LANG_REF="deu">neutral</CVE_VALUE>
    </CV_ENTRY_ML>
    <CV_ENTRY_ML CVE_ID="e1"><CVE_VALUE LANG_REF="eng">joy</CVE_VALUE><CVE_VALUE LANG_REF="deu">Freude</CVE_VALUE>
    </CV_ENTRY_ML>
  </CONTROLLED_VOCABULARY>
  <LEXICON_REF LEX_REF_ID="lr1" NAME="lexicon" TYPE="x" URL="https://example.org" LEXICON_ID="1" LEXICON_NAME="l"/>
  <REF_LINK_SET LINK_SET_ID="rls1"><CROSS_REF_LINK REF_LINK_ID="rl1" REF1="a5" REF2="a6"/></REF_LINK_SET>
  <EXTERNAL_REF EXT_REF_ID="er1" TYPE="resource_url" VALUE="https://example.org/sign/1"/>
</ANNOTATION_DOCUMENT>
"""
MAPPING = """
[affect]
tier = "Emotion_{signer}"
transitions = ""
[affect.labels]
N = "neutral"
J = "Freude"
[affect-confidence]
tier = "Certainty_{signer}"
"""


@pytest.fixture
def lab(tmp_path):
    path = tmp_path / "lab.eaf"
    path.write_text(LAB, "utf-8")
    return path


@pytest.fixture
def mapping(tmp_path):
    path = tmp_path / "mapping.toml"
    path.write_text(MAPPING, "utf-8")
    return EafOptions(mapping=str(path))


def elements(path, own=()) -> list[tuple]:
    """Every element of a document in order, without what belongs to the tiers `own` or to our record of them."""
    root = read_document(path).getroot()
    gone = set()
    for tier in root.iterfind("TIER"):
        if tier.get("TIER_ID") in own:
            gone |= set(tier.iter())
            for annotation in tier.iterfind("ANNOTATION/ALIGNABLE_ANNOTATION"):
                slots = {annotation.get("TIME_SLOT_REF1"), annotation.get("TIME_SLOT_REF2")}
                gone |= {slot for slot in root.iterfind("TIME_ORDER/*") if slot.get("TIME_SLOT_ID") in slots}
    for name in {tier.partition("@")[0] for tier in own}:
        gone |= set(root.xpath(f"LINGUISTIC_TYPE[starts-with(@LINGUISTIC_TYPE_ID, '{name}')]"))
        for vocabulary in root.xpath(f"CONTROLLED_VOCABULARY[starts-with(@CV_ID, '{name}')]"):
            gone |= set(vocabulary.iter())
    for item in root.iterfind("HEADER/PROPERTY"):
        if (item.get("NAME") or "").startswith("signface:") or item.get("NAME") == "lastUsedAnnotationId":
            gone.add(item)
    kept = []
    for element in root.iter():
        if element in gone:
            continue
        attributes = dict(element.attrib) if isinstance(element.tag, str) else {}
        if element is root:
            attributes.pop("DATE")
        text = element.text if len(element) == 0 else (element.text or "").strip()
        kept.append((str(element.tag), attributes, text))
    return kept


def written_into(lab, segments, **options) -> bool:
    """Write into a file and say whether it changed."""
    prepared = prepare(segments, into=lab, signer="S1", **options)
    prepared.store()
    return prepared.changed


def test_everything_of_others_survives_element_by_element(lab):
    before = elements(lab)
    assert written_into(lab, labelled())
    assert_valid(lab)
    assert elements(lab, own=("affect@S1", "affect-confidence@S1")) == before
    assert [row[2] for row in read_back(lab, "affect@S1")] == ["N", "NJ", "J", "JN", "N"]
    assert (lab.parent / "lab.eaf.bak").read_text("utf-8") == LAB


def test_the_comment_before_the_root_survives(lab):
    write_eaf(labelled(), into=lab, signer="S1")
    assert "<!-- the lab's own template -->" in lab.read_text("utf-8")


def test_identifiers_go_on_after_those_ever_used(lab):
    write_eaf(labelled("N"), into=lab, signer="S1")
    root = etree.parse(lab).getroot()
    own = root.find("TIER[@TIER_ID='affect@S1']/ANNOTATION/ALIGNABLE_ANNOTATION")
    assert own.get("ANNOTATION_ID") == "a18"  # 17 was remembered in the header
    slots = [slot.get("TIME_SLOT_ID") for slot in root.iterfind("TIME_ORDER/TIME_SLOT")]
    assert len(set(slots)) == len(slots)
    times = [int(slot.get("TIME_VALUE")) for slot in root.iterfind("TIME_ORDER/TIME_SLOT") if slot.get("TIME_VALUE")]
    assert times == sorted(times)


def test_writing_the_same_twice_changes_nothing(lab):
    write_eaf(labelled(), into=lab, signer="S1")
    once = lab.read_bytes()
    assert not written_into(lab, labelled())
    assert lab.read_bytes() == once
    assert len(list(lab.parent.glob("*.bak*"))) == 1


def test_our_own_uncorrected_tiers_are_brought_up_to_date(lab):
    write_eaf(labelled(), into=lab, signer="S1")
    once = elements(lab, own=("affect@S1", "affect-confidence@S1"))
    assert written_into(lab, labelled("A AN N"))
    assert_valid(lab)
    assert elements(lab, own=("affect@S1", "affect-confidence@S1")) == once
    assert [row[2] for row in read_back(lab, "affect@S1")] == ["A", "AN", "N"]
    slots = etree.parse(lab).getroot().findall("TIME_ORDER/TIME_SLOT")
    assert len(slots) == 4 + 2 * 3  # the old annotations' slots are gone


def test_a_corrected_tier_is_kept_unless_asked_otherwise(lab):
    write_eaf(labelled(), into=lab, signer="S1")
    corrected = lab.read_text("utf-8").replace(
        "<ANNOTATION_VALUE>J</ANNOTATION_VALUE>", "<ANNOTATION_VALUE>Su</ANNOTATION_VALUE>"
    )
    lab.write_text(corrected, "utf-8")
    with pytest.raises(SignfaceError, match=r"affect@S1 holds annotations .* corrected since.*--replace"):
        write_eaf(labelled("A AN N"), into=lab, signer="S1")
    assert lab.read_text("utf-8") == corrected
    assert written_into(lab, labelled("A AN N"), replace=True)
    assert corrected in [backup.read_text("utf-8") for backup in lab.parent.glob("*.bak*")]


def test_a_moved_boundary_is_a_correction_too(lab):
    write_eaf(labelled(), into=lab, signer="S1")
    moved = lab.read_text("utf-8").replace('TIME_VALUE="2460"', 'TIME_VALUE="2400"')
    lab.write_text(moved, "utf-8")
    with pytest.raises(SignfaceError, match="corrected since"):
        write_eaf(labelled("A AN N"), into=lab, signer="S1")


def test_other_signers_tiers_are_others(lab):
    write_eaf(labelled(), into=lab, signer="S1")
    write_eaf(labelled("A AN N"), into=lab, signer="S2")
    assert_valid(lab)
    assert [row[2] for row in read_back(lab, "affect@S1")] == ["N", "NJ", "J", "JN", "N"]
    assert [row[2] for row in read_back(lab, "affect@S2")] == ["A", "AN", "N"]
    root = etree.parse(lab).getroot()
    assert len(root.findall("CONTROLLED_VOCABULARY[@CV_ID='affect']")) == 1


def test_a_tier_that_hangs_on_ours_is_never_lost(lab):
    write_eaf(labelled(), into=lab, signer="S1")
    root = etree.parse(lab).getroot()
    own = root.find("TIER[@TIER_ID='affect@S1']/ANNOTATION/ALIGNABLE_ANNOTATION").get("ANNOTATION_ID")
    note = etree.fromstring(
        '<TIER TIER_ID="note" LINGUISTIC_TYPE_REF="note" PARENT_REF="affect@S1"><ANNOTATION><REF_ANNOTATION '
        f'ANNOTATION_ID="a99" ANNOTATION_REF="{own}"><ANNOTATION_VALUE>!</ANNOTATION_VALUE></REF_ANNOTATION>'
        "</ANNOTATION></TIER>"
    )
    root.findall("TIER")[-1].addnext(note)
    etree.ElementTree(root).write(lab)
    before = lab.read_bytes()
    with pytest.raises(SignfaceError, match="the tier note hangs on affect@S1"):
        write_eaf(labelled("A AN N"), into=lab, signer="S1", replace=True)
    assert lab.read_bytes() == before


def test_a_vocabulary_of_the_same_name_is_not_touched(lab):
    lab.write_text(LAB.replace("Emotionen", "affect"), "utf-8")
    before = elements(lab)
    write_eaf(labelled(), into=lab, signer="S1")
    assert_valid(lab)
    root = etree.parse(lab).getroot()
    assert (
        root.find("LINGUISTIC_TYPE[@LINGUISTIC_TYPE_ID='affect']").get("CONTROLLED_VOCABULARY_REF")
        == "affect (signface)"
    )
    kept = root.find("CONTROLLED_VOCABULARY[@CV_ID='affect']")
    assert [entry.get("CVE_ID") for entry in kept.iterfind("CV_ENTRY_ML")] == ["e0", "e1"]
    assert len(before) < len(elements(lab))


def test_labels_become_the_labs_values_on_the_labs_tiers(lab, mapping):
    before = elements(lab, own=("Emotion_S1", "Certainty_S1"))
    write_eaf(labelled(), into=lab, signer="S1", options=mapping)
    assert_valid(lab)
    assert [row[:3] for row in read_back(lab, "Emotion_S1")] == [
        (0, 460, "neutral"),  # the film is 40 ms ahead of the annotations
        (960, 1460, "Freude"),
        (1960, 2460, "neutral"),
    ]
    assert [row[2] for row in read_back(lab, "Certainty_S1")] == ["0.90", "0.70", "0.50"]
    annotation = etree.parse(lab).getroot().find("TIER[@TIER_ID='Emotion_S1']/ANNOTATION[2]/ALIGNABLE_ANNOTATION")
    assert annotation.get("CVE_REF") == "e1"
    assert elements(lab, own=("Emotion_S1", "Certainty_S1")) == before


def test_a_template_gives_its_structure_and_none_of_its_annotations(lab, mapping, tmp_path):
    out = tmp_path / "take.eaf"
    template = tmp_path / "lab.etf"
    template.write_text(LAB, "utf-8")
    write_eaf(labelled(), out, signer="S1", options=mapping.changed(template=str(template)))
    assert_valid(out)
    root = etree.parse(out).getroot()
    assert [tier.get("TIER_ID") for tier in root.iterfind("TIER")] == ["Gloss", "Comment", "Emotion_S1", "Certainty_S1"]
    assert tier_rows(root)["Gloss"] == []
    assert root.find("LICENSE").text == "for research"
    assert [language.get("LANG_ID") for language in root.iterfind("LANGUAGE")] == ["deu", "eng"]
    assert root.find("HEADER/MEDIA_DESCRIPTOR") is None
    assert template.read_text("utf-8") == LAB
    write_eaf(
        labelled("N NJ J"), out, signer="S1", options=mapping.changed(template=str(template))
    )  # our own output: written over


def test_a_label_outside_the_labs_vocabulary_is_refused_before_anything_is_written(lab, mapping, tmp_path):
    with pytest.raises(
        SignfaceError, match=r"'A' \(affect\) is not in the closed vocabulary of the tier Emotion_S1.*neutral"
    ):
        write_eaf(labelled("N NA A"), into=lab, signer="S1", options=mapping)
    assert lab.read_text("utf-8") == LAB
    with pytest.raises(SignfaceError, match="not in the closed vocabulary"):
        write_eaf(labelled("N NA A"), tmp_path / "new.eaf", signer="S1", options=mapping.changed(template=str(lab)))
    assert not (tmp_path / "new.eaf").exists()


def test_a_mapping_to_a_missing_tier_names_those_there_are(lab, tmp_path):
    with pytest.raises(SignfaceError, match=r"no tier Mood.*Gloss, Comment, Emotion_S1"):
        write_eaf(labelled(), into=lab, signer="S1", options=mapped(tmp_path, {"affect": ChannelRule("Mood")}))


def test_a_mapping_to_a_dependent_tier_is_refused(lab, tmp_path):
    with pytest.raises(SignfaceError, match=r"the tier Comment depends on Gloss \(Symbolic_Association\)"):
        write_eaf(labelled(), into=lab, signer="S1", options=mapped(tmp_path, {"affect": ChannelRule("Comment")}))


def test_two_channels_do_not_share_a_tier(lab, tmp_path):
    rules = {"affect": ChannelRule("Emotion_S1", {"N": "neutral"}), "affect-doubtful": ChannelRule("Emotion_S1")}
    rules["affect-doubtful"] = ChannelRule("Emotion_S1", {"N": "neutral"})
    with pytest.raises(SignfaceError, match="two channels are mapped to the tier Emotion_S1"):
        write_eaf(labelled("N"), into=lab, signer="S1", options=mapped(tmp_path, rules, doubtful=1.0))


def test_a_channel_can_be_left_out(lab, tmp_path):
    write_eaf(labelled(), into=lab, signer="S1", options=mapped(tmp_path, {"affect-confidence": ChannelRule("")}))
    names = [tier.get("TIER_ID") for tier in etree.parse(lab).getroot().iterfind("TIER")]
    assert "affect@S1" in names
    assert "affect-confidence@S1" not in names


def test_doubtful_segments_stand_on_a_tier_of_their_own(tmp_path):
    path = tmp_path / "take.eaf"
    segments = labelled("N NJ J JN N")  # confidences 0.9 to 0.5
    write_eaf(segments, path, signer="S1", options=EafOptions(doubtful=0.65))
    assert_valid(path)
    assert [row[:3] for row in read_back(path, "affect-doubtful@S1")] == [(1500, 2000, "JN"), (2000, 2500, "N")]


OLD_VOCABULARY = """  <CONTROLLED_VOCABULARY CV_ID="Emotionen" DESCRIPTION="Gefühle">
    <CV_ENTRY DESCRIPTION="nichts">neutral</CV_ENTRY><CV_ENTRY EXT_REF="er1">Freude</CV_ENTRY>
  </CONTROLLED_VOCABULARY>
"""


@pytest.mark.parametrize("version", ["2.5", "2.6", "2.7"])
def test_files_of_before_28_become_30_with_all_they_hold(tmp_path, version, mapping):
    import re

    text = re.sub(r"  <CONTROLLED_VOCABULARY.*?</CONTROLLED_VOCABULARY>\n", OLD_VOCABULARY, LAB, flags=re.DOTALL)
    for gone in (
        r"  <LANGUAGE [^>]*/>\n",
        r"  <LICENSE.*?</LICENSE>\n",
        r"  <REF_LINK_SET.*?</REF_LINK_SET>\n",
        ' LANG_REF="deu"',
    ):
        text = re.sub(gone, "", text)
    text = text.replace('"3.0"', f'"{version}"').replace("EAFv3.0", f"EAFv{version}")
    old = tmp_path / "old.eaf"
    old.write_text(text, "utf-8")
    write_eaf(labelled(), into=old, signer="S1", options=mapping)
    assert_valid(old)
    root = etree.parse(old).getroot()
    values = root.findall("CONTROLLED_VOCABULARY[@CV_ID='Emotionen']/CV_ENTRY_ML/CVE_VALUE")
    assert [(value.text, value.get("DESCRIPTION")) for value in values] == [("neutral", "nichts"), ("Freude", None)]
    assert root.find("CONTROLLED_VOCABULARY/CV_ENTRY_ML[@EXT_REF='er1']") is not None
    assert root.findtext("CONTROLLED_VOCABULARY/DESCRIPTION") == "Gefühle"
    assert [row[2] for row in read_back(old, "Gloss")] == [" HAUS  ü ", ""]


@pytest.mark.slow
def test_five_thousand_annotations_stay_when_others_go_in(tmp_path):
    big = tmp_path / "big.eaf"
    write_eaf(labelled(" ".join(["N", "NJ", "J", "JN"] * 1250), step=0.25), big, signer="S1")
    write_eaf(labelled("N NA A"), into=big, signer="S2")
    assert len(read_back(big, "affect@S2")) == 3
    assert len(read_back(big, "affect@S1")) == 5000


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('REF1="ts1" TIME_SLOT_REF2="ts7"', 'REF1="ts1" TIME_SLOT_REF2="ts70"', "time slot ts70, which is not there"),
        ('ANNOTATION_REF="a5"', 'ANNOTATION_REF="a50"', "refers to a50"),
        ('ANNOTATION_ID="a6"', 'ANNOTATION_ID="a5"', "identifier a5 is used 2 times"),
        ('TIER_ID="Comment"', 'TIER_ID="Gloss"', "2 elements TIER have the name Gloss"),
        ('LINGUISTIC_TYPE_REF="note"', 'LINGUISTIC_TYPE_REF="notes"', "type notes, which is not there"),
        ('PARENT_REF="Gloss"', 'PARENT_REF="Comment"', "depends on itself"),
        ('ANNOTATION_REF="a5"', 'ANNOTATION_REF="a9"', "a9 depends on itself"),
        ("<ANNOTATION><REF_ANNOTATION", "<ANNOTATION/><ANNOTATION><REF_ANNOTATION", "on tier Comment is empty"),
        ("</TIME_ORDER>", "", "not well-formed"),
    ],
)
def test_broken_files_are_refused_and_never_altered(lab, old, new, message):
    assert old in LAB
    broken = LAB.replace(old, new, 1)
    lab.write_text(broken, "utf-8")
    with pytest.raises(SignfaceError, match=message) as caught:
        write_eaf(labelled(), into=lab, signer="S1", replace=True)
    assert "\n" not in str(caught.value)
    assert lab.read_text("utf-8") == broken
    assert [path.name for path in lab.parent.iterdir()] == ["lab.eaf"]


@pytest.mark.parametrize(("slots", "message"), [(("ts1", "ts4"), "overlap at"), (("ts4", "ts7"), "does not end after")])
def test_times_that_elan_opens_all_the_same_are_said_and_kept(lab, slots, message):
    old, new = (f'TIME_SLOT_REF1="{a}" TIME_SLOT_REF2="{b}"' for a, b in (("ts7", "ts4"), slots))
    assert old in LAB
    lab.write_text(LAB.replace(old, new, 1), "utf-8")
    before = etree.parse(str(lab)).getroot()
    with pytest.warns(SignfaceWarning, match=message):
        write_eaf(labelled(), into=lab, signer="S9")
    after = etree.parse(str(lab)).getroot()
    assert "affect@S9" in [tier.get("TIER_ID") for tier in after.iter("TIER")]
    texts = [{t.get("TIER_ID"): "".join(t.itertext()).split() for t in r.iter("TIER")} for r in (before, after)]
    assert texts[0].items() <= texts[1].items()


def test_a_first_mapping_is_suggested_and_can_be_read(lab, tmp_path):
    text = suggest_mapping(read_document(lab).getroot(), {"affect": AFFECT, "affect-confidence": None, "brows": None})
    path = tmp_path / "mapping.toml"
    path.write_text(text, "utf-8")
    rules = read_mapping(path)
    assert rules["affect"].tier == "Emotion_{signer}"  # its participant is S1
    assert rules["affect"].value("N") == "neutral"
    assert rules["affect"].value("J") == "Freude"  # by its English name, joy
    assert rules["affect"].value("NJ") is None
    assert rules["affect-confidence"].tier == "Certainty_S1"
    assert "brows" not in rules


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("affect = 1", "affect is no table"),
        ("[affect]", "names no tier"),
        ('[affect]\ntier = "x"\ncolour = "red"', "unknown key colour"),
        ('[affect]\ntier = "x"\n[affect.labels]\nN = 1', "each label a text"),
        ("[affect", "is no TOML"),
    ],
)
def test_a_broken_mapping_is_explained(tmp_path, text, message):
    path = tmp_path / "mapping.toml"
    path.write_text(text)
    with pytest.raises(SignfaceError, match=message):
        read_mapping(path)


def test_a_tier_refuses_annotations_that_overlap():
    with pytest.raises(SignfaceError, match="overlap"):
        Tier("brows", "S1", np.array([0, 5]), np.array([10, 20]), ("raised", "raised"))


OWN_NAMES = LAB.replace(
    '  <LINGUISTIC_TYPE LINGUISTIC_TYPE_ID="gloss"',
    "".join(f'  <TIER TIER_ID="{name}" LINGUISTIC_TYPE_REF="gloss"/>\n' for name in ("affect", "brows@S1", "intensity"))
    + '  <LINGUISTIC_TYPE LINGUISTIC_TYPE_ID="gloss"',
    1,
)


def test_a_labs_tier_that_has_the_name_of_ours_is_not_ours(tmp_path):
    path = tmp_path / "lab.eaf"
    path.write_text(OWN_NAMES, "utf-8")
    with pytest.raises(SignfaceError, match=r"tier affect is not signface's.*Name the signer"):
        write_eaf(labelled(), into=path)
    assert path.read_text("utf-8") == OWN_NAMES
    assert not list(tmp_path.glob("*.bak*"))
    write_eaf(labelled(), into=path, signer="S1")
    assert read_back(path, "affect") == []
    rows = pd.DataFrame({"start_s": [0.5], "end_s": [1.0], "value": ["raised"]})
    brows = ChannelEvents("brows", "", {"raised": "brows raised"}, rows)
    found = Annotation(descriptors(), labelled(), "forest", signer=Signer("S1"), channels={"brows": brows})
    with pytest.raises(SignfaceError, match="tier brows@S1 is not signface's") as refused:
        write_eaf(found, into=path)
    assert "--signer" not in str(refused.value)
    rules = {"brows": ChannelRule("brows@{signer}")}
    write_eaf(found, into=path, options=mapped(tmp_path, rules, curves=False))
    assert [row[:3] for row in read_back(path, "brows@S1")] == [(460, 960, "raised")]


def test_a_tier_of_ours_stays_ours_after_others_have_written_the_file(tmp_path):
    path = tmp_path / "take.eaf"
    write_eaf(labelled(), path)
    text = path.read_text("utf-8")
    for gone in (' ANNOTATOR="signface"', "signface:tiers"):  # either is enough
        path.write_text(text.replace(gone, "", 1) if gone[0] == " " else text.replace(gone, "other"), "utf-8")
        write_eaf(labelled("N NA A"), into=path, replace=True)
        assert [row[2] for row in read_back(path, "affect")] == ["N", "NA", "A"]


SHARED = """<CV_RESOURCE VERSION="0.2"><LANGUAGE LANG_ID="deu" LANG_LABEL="German"/>
<CONTROLLED_VOCABULARY CV_ID="Emotionen"><DESCRIPTION LANG_REF="deu">shared</DESCRIPTION>
<CV_ENTRY_ML CVE_ID="x0"><CVE_VALUE LANG_REF="deu">neutral</CVE_VALUE></CV_ENTRY_ML>
<CV_ENTRY_ML CVE_ID="x1"><CVE_VALUE LANG_REF="deu">Freude</CVE_VALUE></CV_ENTRY_ML>
</CONTROLLED_VOCABULARY></CV_RESOURCE>
"""


def with_external_vocabulary(url: str) -> str:
    import re

    kept = '<CONTROLLED_VOCABULARY CV_ID="Emotionen" EXT_REF="er2"/>'
    text = re.sub("<CONTROLLED_VOCABULARY.*</CONTROLLED_VOCABULARY>", kept, LAB, flags=re.DOTALL)
    return text.replace("</ANNOTATION_D", f'<EXTERNAL_REF EXT_REF_ID="er2" TYPE="ecv" VALUE="{url}"/></ANNOTATION_D')


@pytest.mark.parametrize("url", ["file:///C:/lab/our values.ecv", "file:HERE/our%20values.ecv", "./our values.ecv",
                                 "https://example.org/our values.ecv"])  # fmt: skip
def test_values_of_a_vocabulary_in_another_file_are_checked_and_referred_to(tmp_path, mapping, url):
    path = tmp_path / "lab.eaf"
    path.write_text(with_external_vocabulary(url.replace("HERE", str(tmp_path))), "utf-8")
    (tmp_path / "our values.ecv").write_text(SHARED, "utf-8")
    write_eaf(labelled(), into=path, signer="S1", options=mapping)
    annotations = read_document(path).getroot().findall("TIER[@TIER_ID='Emotion_S1']/ANNOTATION/*")
    assert [one.get("CVE_REF") for one in annotations] == ["x0", "x1", "x0"]
    assert read_vocabulary(path, tier="Emotion_S1").values == ("neutral", "Freude")
    (tmp_path / "our values.ecv").write_text(SHARED.replace("Freude", "Glück"), "utf-8")
    with pytest.raises(SignfaceError, match=r"'Freude' \(affect\) is not in the closed vocabulary.*neutral, Glück"):
        write_eaf(labelled("N NJ J"), into=path, signer="S1", options=mapping)


def test_values_that_cannot_be_checked_are_said(tmp_path, mapping):
    path = tmp_path / "lab.eaf"
    path.write_text(with_external_vocabulary("https://example.org/values.ecv"), "utf-8")
    with pytest.warns(SignfaceWarning, match=r"Emotion_S1 is kept in https://example.org/values.ecv.*not checked"):
        write_eaf(labelled(), into=path, signer="S1", options=mapping)
    with pytest.raises(SignfaceError, match=r"kept in https://example.org/values.ecv, which is not here"):
        read_vocabulary(path, tier="Emotion_S1")
