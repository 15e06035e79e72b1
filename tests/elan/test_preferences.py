"""What ELAN shows of our tiers and curves, in files that it has opened before and in those of older formats."""

from __future__ import annotations

import pytest
from lxml import etree

from signface.annotation import Annotation
from signface.elan.vocabularies import read_vocabulary
from signface.elan.writing import write_eaf
from signface.errors import SignfaceWarning
from signface.settings.eaf import EafOptions
from tests.elan.test_curves import descriptors
from tests.fixtures.elan_files import assert_valid, labelled

OLD = """<?xml version="1.0" encoding="UTF-8"?>
<ANNOTATION_DOCUMENT xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" AUTHOR="" DATE="2014-05-01T00:00:00+00:00"
    FORMAT="2.7" VERSION="2.7" xsi:noNamespaceSchemaLocation="http://www.mpi.nl/tools/elan/EAFv2.7.xsd">
  <HEADER MEDIA_FILE="" TIME_UNITS="milliseconds"/>
  <TIME_ORDER><TIME_SLOT TIME_SLOT_ID="ts1" TIME_VALUE="200"/><TIME_SLOT TIME_SLOT_ID="ts2" TIME_VALUE="900"/>
    <TIME_SLOT TIME_SLOT_ID="ts3" TIME_VALUE="1100"/></TIME_ORDER>
  <TIER TIER_ID="NMM" LINGUISTIC_TYPE_REF="nmm">
    <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="a1" TIME_SLOT_REF1="ts1" TIME_SLOT_REF2="ts2">
      <ANNOTATION_VALUE>wh</ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>
    <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="a2" TIME_SLOT_REF1="ts2" TIME_SLOT_REF2="ts3">
      <ANNOTATION_VALUE>not in it</ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>
  </TIER>
  <TIER TIER_ID="Sure" LINGUISTIC_TYPE_REF="sure" PARENT_REF="NMM">
    <ANNOTATION><REF_ANNOTATION ANNOTATION_ID="a3" ANNOTATION_REF="a1"><ANNOTATION_VALUE>neg</ANNOTATION_VALUE>
    </REF_ANNOTATION></ANNOTATION>
  </TIER>
  <LINGUISTIC_TYPE LINGUISTIC_TYPE_ID="nmm" TIME_ALIGNABLE="true" CONTROLLED_VOCABULARY_REF="NMM"/>
  <LINGUISTIC_TYPE LINGUISTIC_TYPE_ID="sure" TIME_ALIGNABLE="false" CONSTRAINTS="Symbolic_Association"
    CONTROLLED_VOCABULARY_REF="NMM"/>
  <CONSTRAINT STEREOTYPE="Symbolic_Association" DESCRIPTION="1-1"/>
  <CONTROLLED_VOCABULARY CV_ID="NMM" DESCRIPTION="non-manual"><CV_ENTRY DESCRIPTION="negation">neg</CV_ENTRY>
    <CV_ENTRY DESCRIPTION="question">wh</CV_ENTRY></CONTROLLED_VOCABULARY>
</ANNOTATION_DOCUMENT>
"""
RED = '<pref key="Color"><Object class="java.awt.Color">255,0,0</Object></pref>'
OLD_COLOURS = f"""<preferences version="1.1"><prefGroup key="CV.Prefs"><prefGroup key="NMM"><prefGroup key="neg">{RED}
<pref key="KeyCode"><Int>78</Int></pref></prefGroup><prefGroup key="gone">{RED}</prefGroup></prefGroup></prefGroup>
</preferences>"""
#: What ELAN writes on opening a file without curves.
OPENED = """<preferences version="1.1">
<pref key="LayoutManager.SplitPaneDividerLocation"><Int>2</Int></pref>
<prefGroup key="TierColors"><pref key="Hand"><Object class="java.awt.Color">0,0,160</Object></pref></prefGroup>
<prefList key="MultiTierViewer.TierOrder"><String>Hand</String></prefList>
</preferences>"""


def take(labels: str = "N NJ J JN N") -> Annotation:
    return Annotation(descriptors(), labelled(labels), "forest")


def colours(path, vocabulary: str) -> dict[str, str]:
    groups = etree.parse(path).xpath(f"prefGroup[@key='CV.ML.Prefs']/prefGroup[@key='{vocabulary}']/prefGroup")
    return {group.get("key"): group.findtext("pref[@key='Color']/Object") for group in groups}


def panels(path) -> list[list[str]]:
    root = etree.parse(path).getroot()
    count = int(root.findtext("pref[@key='TimeSeriesViewer.NumberOfPanels']/Int"))
    lists = [root.find(f"prefList[@key='TimeSeriesViewer.Panel-{number}']") for number in range(1, count + 1)]
    return [[text.text for text in tracks] for tracks in lists]


@pytest.mark.parametrize("version", ["2.5", "2.6", "2.7"])
def test_annotations_of_old_files_stay_tied_to_their_vocabulary(tmp_path, version):
    file = tmp_path / "old.eaf"
    file.write_text(OLD.replace("2.7", version))
    write_eaf(labelled(), into=file, signer="S1")
    assert_valid(file)
    root = etree.parse(file).getroot()
    ids = {entry.findtext("CVE_VALUE"): entry.get("CVE_ID") for entry in root.iterfind("CONTROLLED_VOCABULARY/*")}
    references = {one.get("ANNOTATION_ID"): one.get("CVE_REF") for one in root.xpath("TIER/ANNOTATION/*")}
    assert references["a1"] == ids["wh"] == "cveid1"
    assert references["a3"] == ids["neg"] == "cveid0"
    assert references["a2"] is None


def test_annotations_of_old_files_stay_tied_to_a_vocabulary_in_another_file(tmp_path):
    file = tmp_path / "old.eaf"
    kept = OLD.index("  <CONTROLLED_VOCABULARY")
    file.write_text(
        OLD[:kept] + '<CONTROLLED_VOCABULARY CV_ID="NMM" EXT_REF="er1"/>'
        '<EXTERNAL_REF EXT_REF_ID="er1" TYPE="ecv" VALUE="file:///gone/lab.ecv"/></ANNOTATION_DOCUMENT>'
    )
    entry = '<CV_ENTRY_ML CVE_ID="x7"><CVE_VALUE LANG_REF="und">wh</CVE_VALUE></CV_ENTRY_ML>'
    (tmp_path / "lab.ecv").write_text(
        f'<CV_RESOURCE><CONTROLLED_VOCABULARY CV_ID="NMM">{entry}</CONTROLLED_VOCABULARY></CV_RESOURCE>'
    )
    write_eaf(labelled(), into=file, signer="S1")
    references = {one.get("ANNOTATION_ID"): one.get("CVE_REF") for one in etree.parse(file).xpath("//ANNOTATION/*")}
    assert (references["a1"], references["a2"]) == ("x7", None)


def test_references_that_a_newer_file_lacks_are_its_own_affair(tmp_path):
    file = tmp_path / "old.eaf"
    file.write_text(OLD)
    write_eaf(labelled(), into=file, signer="S1")
    file.write_text(file.read_text("utf-8").replace(' CVE_REF="cveid1"', ""), "utf-8")
    write_eaf(labelled("N NA A"), into=file, signer="S2")
    assert etree.parse(file).xpath("TIER[@TIER_ID='NMM']//ALIGNABLE_ANNOTATION")[0].get("CVE_REF") is None


def test_an_annotators_colours_and_keys_survive_the_upgrade(tmp_path):
    file = tmp_path / "old.eaf"
    file.write_text(OLD)
    (tmp_path / "old.pfsx").write_text(OLD_COLOURS)
    write_eaf(labelled(), into=file, signer="S1")
    assert colours(tmp_path / "old.pfsx", "NMM") == {"cveid0": "255,0,0"}
    group = etree.parse(tmp_path / "old.pfsx").find("prefGroup[@key='CV.ML.Prefs']/prefGroup[@key='NMM']/prefGroup")
    assert group.findtext("pref[@key='KeyCode']/Int") == "78"
    assert len(colours(tmp_path / "old.pfsx", "affect")) == 49


def test_a_templates_colours_come_along(tmp_path):
    (tmp_path / "lab.etf").write_text(OLD)
    (tmp_path / "lab.pfsx").write_text(OLD_COLOURS)
    write_eaf(labelled(), tmp_path / "take.eaf", signer="S1", options=EafOptions(template=str(tmp_path / "lab.etf")))
    assert colours(tmp_path / "take.pfsx", "NMM") == {"cveid0": "255,0,0"}
    assert len(colours(tmp_path / "take.pfsx", "affect")) == 49


def test_a_file_that_elan_has_opened_gets_colours_and_curves(tmp_path):
    file, preferences = tmp_path / "lab.eaf", tmp_path / "lab.pfsx"
    file.write_text(OLD)
    preferences.write_text(OPENED)
    write_eaf(take(), into=file, signer="S1")
    assert len(colours(preferences, "affect")) == 49
    tracks = {track.get("name") for track in etree.parse(tmp_path / "lab_tsconf.xml").iterfind("tracksource/track")}
    assert {name for panel in panels(preferences) for name in panel} == tracks
    root = etree.parse(preferences).getroot()
    assert int(root.findtext("pref[@key='LayoutManager.SplitPaneDividerLocation']/Int")) > 70
    assert root.findtext("prefList[@key='MultiTierViewer.TierOrder']/String") == "Hand"
    tiers = {one.get("key"): one.findtext("Object") for one in root.iterfind("prefGroup[@key='TierColors']/pref")}
    assert tiers["Hand"] == "0,0,160"
    assert tiers["affect@S1"] == tiers["affect-confidence@S1"]
    assert "NMM" not in tiers


def test_what_an_annotator_chose_is_hers(tmp_path):
    file, preferences = tmp_path / "take.eaf", tmp_path / "take.pfsx"
    write_eaf(take(), file, signer="S1")
    text = preferences.read_text("utf-8").replace(colours(preferences, "affect")["cveid_J"], "1,2,3")
    text = text.replace("<Int>300</Int>", "<Int>444</Int>").replace("<String>velocity</String>", "")
    preferences.write_text(text, "utf-8")
    chosen = preferences.read_bytes()
    write_eaf(take("N NA A AN N"), file, signer="S1")
    assert preferences.read_bytes() == chosen


def test_colours_that_are_missing_are_added_when_nothing_else_changes(tmp_path):
    """The lab has another vocabulary `affect`, so that ours has a longer name, by which ELAN looks for its colours."""
    file, preferences = tmp_path / "lab.eaf", tmp_path / "lab.pfsx"
    text = OLD.replace('CV_ID="NMM"', 'CV_ID="affect"').replace('VOCABULARY_REF="NMM"', 'VOCABULARY_REF="affect"')
    file.write_text(text)
    write_eaf(take(), into=file, signer="S1")
    assert len(colours(preferences, "affect (signface)")) == 49
    preferences.write_text(OPENED)
    before = file.read_bytes()
    write_eaf(take(), into=file, signer="S1")
    assert file.read_bytes() == before
    assert len(colours(preferences, "affect (signface)")) == 49
    assert len(panels(preferences)) == 5


def test_panels_of_before_curves_had_names_show_the_same_curves(tmp_path):
    file, preferences = tmp_path / "take.eaf", tmp_path / "take.pfsx"
    write_eaf(take(), file, signer="S1")
    text = preferences.read_text("utf-8").replace(">jaw open<", ">jaw_open<").replace(">velocity<", ">velocity_energy<")
    preferences.write_text(text, "utf-8")
    write_eaf(take("N NA A AN N"), file, signer="S1")
    assert panels(preferences) == [["velocity"], ["acceleration"], ["confidence", "brows up", "lids closed"],
                                   ["jaw open"], ["residual"]]  # fmt: skip


@pytest.mark.parametrize("broken", ["<preferences>", "no XML", "<other/>"])
def test_preferences_that_cannot_be_read_stay_as_they_are(tmp_path, broken):
    (tmp_path / "take.pfsx").write_text(broken)
    with pytest.warns(SignfaceWarning, match="take.pfsx.*not written"):
        write_eaf(labelled(), tmp_path / "take.eaf", signer="S1")
    assert (tmp_path / "take.pfsx").read_text() == broken


def test_colours_of_an_old_file_are_those_of_its_vocabulary(tmp_path):
    (tmp_path / "old.eaf").write_text(OLD)
    (tmp_path / "old.pfsx").write_text(OLD_COLOURS)
    assert read_vocabulary(tmp_path / "old.eaf").colours == {"neg": (255, 0, 0)}
