"""Vocabularies are read from what laboratories have, and come back as they were written."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lxml import etree

from signface.elan.elements import vocabulary_element
from signface.elan.preferences import write_preferences
from signface.elan.tiers import Tier
from signface.elan.vocabularies import read_vocabulary, write_vocabulary
from signface.errors import SignfaceError
from signface.label.vocabulary import AFFECT, INTENSITY, Vocabulary
from tests.label.test_vocabulary import vocabularies

BROWS = Vocabulary(
    "brows",
    ("none", "raised", "lowered"),
    {"raised": "eyebrows raised"},
    {"raised": (1, 2, 3), "lowered": (255, 0, 16)},
    description="What the eyebrows do",
)


def write_document(path, *vocabularies, tiers=(("brows@M1", "brows"),)):
    """An EAF with some vocabularies and empty tiers of them, and the colours beside it."""
    root = etree.Element("ANNOTATION_DOCUMENT", VERSION="3.0")
    etree.SubElement(root, "HEADER", TIME_UNITS="milliseconds")
    etree.SubElement(root, "TIME_ORDER")
    for tier, kind in tiers:
        etree.SubElement(root, "TIER", TIER_ID=tier, LINGUISTIC_TYPE_REF=kind)
    for vocabulary in vocabularies:
        kind = etree.SubElement(root, "LINGUISTIC_TYPE", LINGUISTIC_TYPE_ID=vocabulary.name)
        kind.set("CONTROLLED_VOCABULARY_REF", vocabulary.name)
    etree.SubElement(root, "LINGUISTIC_TYPE", LINGUISTIC_TYPE_ID="free")
    root.extend([vocabulary_element(vocabulary, vocabulary.name) for vocabulary in vocabularies])
    etree.ElementTree(root).write(str(path))
    nothing = np.zeros(0, dtype=np.int64)
    path.with_suffix(".pfsx").unlink(missing_ok=True)
    write_preferences(path.with_suffix(".pfsx"), [Tier("x", "", nothing, nothing, (), v) for v in vocabularies])
    return path


@pytest.mark.parametrize("vocabulary", [AFFECT, INTENSITY, BROWS], ids=lambda vocabulary: vocabulary.name)
def test_a_vocabulary_comes_back_from_an_eaf_and_from_text(tmp_path, vocabulary):
    assert read_vocabulary(write_document(tmp_path / "take.eaf", vocabulary)) == vocabulary
    assert read_vocabulary(write_document(tmp_path / "lab.etf", AFFECT, BROWS), name="brows") == BROWS
    file = tmp_path / f"{vocabulary.name}.txt"
    write_vocabulary(vocabulary, file)
    assert read_vocabulary(file) == vocabulary


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
@given(vocabularies())
def test_any_vocabulary_comes_back(tmp_path, vocabulary):
    read = read_vocabulary(write_document(tmp_path / "take.eaf", vocabulary))
    file = tmp_path / "any.txt"
    write_vocabulary(vocabulary, file)
    for one in (read, read_vocabulary(file)):
        assert set(one.allowed) == set(vocabulary.allowed)
        assert one == vocabulary or one.transitions != vocabulary.transitions


def test_the_vocabulary_of_a_tier_is_found_by_its_type(tmp_path):
    tiers = (("brows@M1", "brows"), ("gloss", "free"))
    file = write_document(tmp_path / "take.eaf", AFFECT, BROWS, tiers=tiers)
    assert read_vocabulary(file, tier="brows@M1") == BROWS
    for options, problem in (
        ({}, "several vocabularies.*affect, brows"),
        ({"tier": "gloss"}, "gloss has no closed vocabulary"),
        ({"tier": "eyes"}, r"no tier eyes.*brows@M1, gloss"),
        ({"name": "eyes"}, "no vocabulary eyes"),
    ):
        with pytest.raises(SignfaceError, match=problem):
            read_vocabulary(file, **options)


def test_an_external_vocabulary_is_read_from_its_own_file(tmp_path):
    root = etree.Element("CV_RESOURCE", VERSION="0.2")
    root.append(vocabulary_element(dataclasses.replace(BROWS, colours={}), "brows"))
    etree.ElementTree(root).write(str(tmp_path / "shared.ecv"))
    assert read_vocabulary(tmp_path / "shared.ecv") == dataclasses.replace(BROWS, colours={})


def test_old_entries_without_languages_are_read(tmp_path):
    (tmp_path / "old.eaf").write_text(
        "<ANNOTATION_DOCUMENT VERSION='2.5'><HEADER/><TIME_ORDER/>"
        "<CONTROLLED_VOCABULARY CV_ID='brows' DESCRIPTION='eyebrows'><CV_ENTRY DESCRIPTION='raised'>br</CV_ENTRY>"
        "<CV_ENTRY>bf</CV_ENTRY></CONTROLLED_VOCABULARY></ANNOTATION_DOCUMENT>"
    )
    assert read_vocabulary(tmp_path / "old.eaf") == Vocabulary(
        "brows", ("br", "bf"), {"br": "raised"}, description="eyebrows"
    )


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "no value"),
        ("a\na\n", "'a' twice"),
        ("a\tb\tred\n", "line 1"),
        ("a\n\tb\n", "line 2"),
        ("a\tb\t#ff0000\tmore\n", "line 1"),
    ],
)
def test_text_that_is_no_vocabulary_is_refused(tmp_path, text, problem):
    (tmp_path / "v.txt").write_text(text)
    with pytest.raises(SignfaceError, match=problem):
        read_vocabulary(tmp_path / "v.txt")
    with pytest.raises(SignfaceError, match="no such file"):
        read_vocabulary(tmp_path / "absent.txt")


@given(st.sampled_from(["a\nb", "#a", "a\tb", "a  b"]))
def test_what_does_not_fit_on_a_line_is_not_written(value):
    with pytest.raises(SignfaceError, match="do not fit"):
        write_vocabulary(Vocabulary("v", (value,)), "never.txt")
