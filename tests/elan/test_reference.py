"""Reading what annotators wrote, in files of several versions and in broken ones."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from signface.elan.reference import read_reference
from signface.elan.writing import write_eaf
from signface.errors import SignfaceError
from signface.label.vocabulary import AFFECT
from tests.fixtures.elan_files import labelled

OLD = """<?xml version="1.0" encoding="UTF-8"?>
<ANNOTATION_DOCUMENT AUTHOR="" DATE="2008-05-01T10:00:00+01:00" FORMAT="{version}" VERSION="{version}"
    xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
    xsi:noNamespaceSchemaLocation="http://www.mpi.nl/tools/elan/EAFv{version}.xsd">
  <HEADER MEDIA_FILE="" TIME_UNITS="milliseconds">
    <MEDIA_DESCRIPTOR MEDIA_URL="file:///films/a.mpg" MIME_TYPE="video/mpeg"/>
  </HEADER>
  <TIME_ORDER>
    <TIME_SLOT TIME_SLOT_ID="ts1" TIME_VALUE="100"/>
    <TIME_SLOT TIME_SLOT_ID="ts2"/>
    <TIME_SLOT TIME_SLOT_ID="ts3"/>
    <TIME_SLOT TIME_SLOT_ID="ts4" TIME_VALUE="1000"/>
  </TIME_ORDER>
  <TIER TIER_ID="{tier}" LINGUISTIC_TYPE_REF="default-lt">
    <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="a1" TIME_SLOT_REF1="ts1" TIME_SLOT_REF2="ts2">
      <ANNOTATION_VALUE>N</ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>
    <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="a2" TIME_SLOT_REF1="ts2" TIME_SLOT_REF2="ts3">
      <ANNOTATION_VALUE>{second}</ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>
    <ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="a3" TIME_SLOT_REF1="ts3" TIME_SLOT_REF2="ts4">
      <ANNOTATION_VALUE> J </ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>
  </TIER>
  <TIER TIER_ID="{intensity}" LINGUISTIC_TYPE_REF="assoc" PARENT_REF="{tier}">
    <ANNOTATION><REF_ANNOTATION ANNOTATION_ID="a4" ANNOTATION_REF="a3">
      <ANNOTATION_VALUE>2</ANNOTATION_VALUE></REF_ANNOTATION></ANNOTATION>
  </TIER>
  <LINGUISTIC_TYPE LINGUISTIC_TYPE_ID="default-lt" TIME_ALIGNABLE="true" GRAPHIC_REFERENCES="false"/>
  <LINGUISTIC_TYPE LINGUISTIC_TYPE_ID="assoc" TIME_ALIGNABLE="false" CONSTRAINTS="Symbolic_Association"/>
  <CONSTRAINT STEREOTYPE="Symbolic_Association" DESCRIPTION="1-1 association with a parent annotation"/>
</ANNOTATION_DOCUMENT>
"""


def write_old(path, *, version="2.5", tier="affect", intensity="intensity", second="NJ", change=None):
    text = OLD.format(version=version, tier=tier, intensity=intensity, second=second)
    path.write_text(change(text) if change else text, "utf-8")
    return path


@pytest.mark.parametrize("version", ["2.5", "2.6", "2.7", "2.8", "3.0"])
def test_files_of_elan_4_to_7_are_read(tmp_path, version):
    table = read_reference(write_old(tmp_path / "old.eaf", version=version)).table
    assert list(table["label"]) == ["N", "NJ", "J"]
    assert list(table["kind"]) == ["stable", "transition", "stable"]
    assert table["intensity"].tolist()[2] == 2


def test_missing_times_are_spread_between_the_known_ones(tmp_path):
    table = read_reference(write_old(tmp_path / "old.eaf")).table
    assert list(table["start_s"]) == [0.1, 0.4, 0.7]
    assert list(table["end_s"]) == [0.4, 0.7, 1.0]


def test_the_signers_own_tier_is_preferred_to_the_shared_one(tmp_path):
    path = write_old(tmp_path / "old.eaf", tier="affect@S2", intensity="intensity@S2")
    assert len(read_reference(path, "S2")) == 3
    assert len(read_reference(path)) == 3
    with pytest.raises(SignfaceError, match=r"no tier affect@S1 or affect.*affect@S2"):
        read_reference(path, "S1")


def test_a_missing_tier_is_named_with_those_there_are(tmp_path):
    path = write_old(tmp_path / "old.eaf", tier="gloss")
    with pytest.raises(SignfaceError, match=r"old\.eaf: no tier affect.*gloss, intensity"):
        read_reference(path)


def test_a_label_outside_the_vocabulary_is_named_with_its_place(tmp_path):
    path = write_old(tmp_path / "old.eaf", second="happy")
    with pytest.raises(SignfaceError, match=r"'happy' on tier affect at 0\.400 s"):
        read_reference(path)
    assert list(read_reference(path, vocabulary=AFFECT.including("happy")).table["kind"]) == ["stable"] * 3


def test_annotations_without_a_value_are_left_out(tmp_path):
    assert len(read_reference(write_old(tmp_path / "old.eaf", second=""))) == 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: "", "not well-formed"),
        (lambda text: text[: len(text) // 2], "not well-formed"),
        (lambda text: "time,label\n0,N\n", "not well-formed"),
        (lambda text: "<html><body/></html>", "no EAF"),
        (lambda text: text.replace("TIME_ORDER", "TIMES"), "no TIME_ORDER"),
        (lambda text: text.replace('TIME_VALUE="1000"', 'TIME_VALUE="soon"'), "time"),
        (lambda text: text.replace('"ts3" TIME_SLOT_REF2="ts4"', '"ts9" TIME_SLOT_REF2="ts4"'), "no time"),
        (lambda text: text.replace('"ts3" TIME_SLOT_REF2="ts4"', '"ts1" TIME_SLOT_REF2="ts4"'), "no time"),
        (lambda text: text.replace(">2<", ">7<"), "not 1, 2 or 3"),
    ],
)
def test_broken_files_get_one_clear_error_and_are_not_altered(tmp_path, change, message):
    path = write_old(tmp_path / "old.eaf", change=change)
    before = path.read_bytes()
    with pytest.raises(SignfaceError, match=message) as caught:
        read_reference(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    assert path.read_bytes() == before


def test_an_entity_bomb_is_refused(tmp_path):
    entities = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 12))
    bomb = f'<!DOCTYPE x [<!ENTITY e0 "boom">{entities}]>\n<ANNOTATION_DOCUMENT>'

    path = write_old(
        tmp_path / "bomb.eaf",
        change=lambda text: text.replace("<ANNOTATION_DOCUMENT", bomb[:-1], 1).replace(">N<", ">&e11;<"),
    )
    with pytest.raises(SignfaceError, match="entities"):
        read_reference(path)


def test_an_entity_does_not_pull_in_another_file(tmp_path):
    (tmp_path / "secret.txt").write_text("N")
    doctype = '<!DOCTYPE x [<!ENTITY s SYSTEM "secret.txt">]>\n<ANNOTATION_DOCUMENT'
    path = write_old(
        tmp_path / "x.eaf", change=lambda text: text.replace("<ANNOTATION_DOCUMENT", doctype, 1).replace(">N<", ">&s;<")
    )
    with pytest.raises(SignfaceError, match="entities"):
        read_reference(path)


def test_a_missing_file_and_a_folder_are_said_to_be_so(tmp_path):
    with pytest.raises(SignfaceError, match="no such file"):
        read_reference(tmp_path / "none.eaf")
    with pytest.raises(SignfaceError, match="is a folder"):
        read_reference(tmp_path)


def test_several_signers_ask_for_one(tmp_path):
    path = write_old(tmp_path / "old.eaf", tier="affect@S1", intensity="affect@S2")
    with pytest.raises(SignfaceError, match="several affect tiers: affect@S1, affect@S2"):
        read_reference(path)


def test_our_own_files_are_read_without_naming_the_signer(tmp_path):
    write_eaf(labelled(), tmp_path / "take.eaf", signer="S1")
    assert len(read_reference(tmp_path / "take.eaf")) == 5


@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_damaged_files_are_read_or_refused_in_one_line(tmp_path, data):
    whole = OLD.format(version="3.0", tier="affect", intensity="intensity", second="NJ").encode()
    cut = data.draw(st.integers(0, len(whole)))
    junk = data.draw(st.binary(max_size=8))
    path = tmp_path / "damaged.eaf"
    damaged = whole[:cut] + junk + whole[cut + data.draw(st.integers(0, 40)) :]
    path.write_bytes(damaged)
    for attempt in (lambda: read_reference(path), lambda: write_eaf(labelled(), into=path, signer="S9")):
        refused = None
        try:
            attempt()
        except SignfaceError as error:
            refused = str(error)
        if refused is not None:
            assert "\n" not in refused
            assert path.read_bytes() == damaged


def test_reading_does_not_change_a_file(tmp_path):
    path = write_old(tmp_path / "old.eaf")
    before = path.read_bytes()
    read_reference(path)
    assert path.read_bytes() == before
