"""Channels on tiers of a lab that depend on others: each annotation lies within one of its parent tier."""

from __future__ import annotations

import warnings
from pathlib import Path

import pandas as pd
import pytest
from lxml import etree

from signface.annotation import Annotation
from signface.channels.events import ChannelEvents
from signface.elan.mapping import ChannelRule
from signface.elan.table import annotation_table
from signface.elan.writing import write_eaf
from signface.errors import SignfaceError, SignfaceWarning
from signface.signer import Signer
from tests.elan.test_curves import descriptors
from tests.fixtures.elan_files import assert_valid, labelled, mapped

TIERS = {
    "Utt": (None, None), "Clause": ("Utt", "Included_In"), "Emotion": ("Clause", "Included_In"),
    "Brows": ("Emotion", "Included_In"), "Gloss": ("Utt", "Included_In"), "Note": ("Emotion", "Symbolic_Subdivision"),
    "Sure": ("Emotion", "Time_Subdivision"), "Part": ("Utt", "Time_Subdivision"),
    "Word": ("Utt", "Symbolic_Association"),
}  # fmt: skip


def lab(path: Path, *utterances: tuple[int, int]) -> Path:
    """A lab's file with these tiers, and utterances where there are any."""
    root = etree.Element(
        "ANNOTATION_DOCUMENT", AUTHOR="lab", DATE="2024-02-01T10:00:00+01:00", FORMAT="3.0", VERSION="3.0"
    )
    etree.SubElement(root, "HEADER", TIME_UNITS="milliseconds")
    order = etree.SubElement(root, "TIME_ORDER")
    elements = {}
    for name, (parent, stereotype) in TIERS.items():
        elements[name] = etree.SubElement(root, "TIER", TIER_ID=name, LINGUISTIC_TYPE_REF=stereotype or "root")
        if parent is not None:
            elements[name].set("PARENT_REF", parent)
    for number, span in enumerate(utterances):
        held = etree.SubElement(etree.SubElement(elements["Utt"], "ANNOTATION"), "ALIGNABLE_ANNOTATION")
        held.set("ANNOTATION_ID", f"a{number + 1}")
        for end, time in enumerate(span, start=1):
            slot = f"ts{2 * number + end}"
            etree.SubElement(order, "TIME_SLOT", TIME_SLOT_ID=slot, TIME_VALUE=str(time))
            held.set(f"TIME_SLOT_REF{end}", slot)
        etree.SubElement(held, "ANNOTATION_VALUE").text = f"u{number}"
    for stereotype in ("root", *sorted({kind for _, kind in TIERS.values() if kind})):
        kind = etree.SubElement(root, "LINGUISTIC_TYPE", LINGUISTIC_TYPE_ID=stereotype)
        kind.set("TIME_ALIGNABLE", "false" if stereotype.startswith("Symbolic") else "true")
        if stereotype != "root":
            kind.set("CONSTRAINTS", stereotype)
    for stereotype in sorted({kind for _, kind in TIERS.values() if kind}):
        etree.SubElement(root, "CONSTRAINT", STEREOTYPE=stereotype, DESCRIPTION="")
    etree.ElementTree(root).write(path)
    return path


def found(labels: str = "N NJ J JN N") -> Annotation:
    rows = pd.DataFrame({"start_s": [0.1, 0.9], "end_s": [0.4, 1.2], "value": ["raised", "raised"]})
    channels = {"brows": ChannelEvents("brows", "", {"raised": ""}, rows)}
    return Annotation(descriptors(), labelled(labels), "forest", signer=Signer("S1"), channels=channels)


def rows(path: Path, tier: str) -> list[tuple]:
    table = annotation_table([path], tiers=[tier])
    return list(zip(table["start_s"], table["end_s"], table["value"], table["parent_tier"]))


def test_an_empty_template_gets_what_must_lie_around(tmp_path):
    rules = {"affect": ChannelRule("Emotion", {}, ""), "brows": ChannelRule("Gloss"),
             "affect-confidence": ChannelRule("Note")}  # fmt: skip
    options = mapped(tmp_path, rules, template=str(lab(tmp_path / "lab.etf")), curves=False)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        write_eaf(found(), tmp_path / "take.eaf", options=options)
        write_eaf(found("N NA A AN N"), tmp_path / "take.eaf", options=options)
    path = tmp_path / "take.eaf"
    assert_valid(path)
    assert rows(path, "Emotion") == [(0, 0.5, "N", "Clause"), (1, 1.5, "A", "Clause"), (2, 2.5, "N", "Clause")]
    assert rows(path, "Utt") == [(0, 2.5, "", "")]
    assert rows(path, "Clause") == [(0, 2.5, "", "Utt")]
    assert rows(path, "Gloss") == [(0.1, 0.4, "raised", "Utt"), (0.9, 1.2, "raised", "Utt")]
    assert [row[2:] for row in rows(path, "Note")] == [("0.90", "Emotion"), ("0.70", "Emotion"), ("0.50", "Emotion")]
    into = mapped(tmp_path, rules, curves=False)
    before = path.read_bytes()
    write_eaf(found("N NA A AN N"), into=path, options=into)
    assert path.read_bytes() == before


def test_what_the_lab_has_around_bounds_ours(tmp_path):
    path = lab(tmp_path / "lab.eaf", (200, 1000), (1100, 1400))
    rules = {"affect": ChannelRule("Gloss"), "affect-confidence": ChannelRule("")}
    with pytest.warns(SignfaceWarning, match=r"of 5 annotations of affect 2 end at the edges .* Utt, .* and 2 lie"):
        write_eaf(labelled(), into=path, signer="S1", options=mapped(tmp_path, rules))
    assert_valid(path)
    assert rows(path, "Gloss") == [(0.2, 0.5, "N", "Utt"), (0.5, 1.0, "NJ", "Utt"), (1.1, 1.4, "J", "Utt")]
    assert [row[:3] for row in rows(path, "Utt")] == [(0.2, 1.0, "u0"), (1.1, 1.4, "u1")]


def test_one_channel_may_lie_within_another(tmp_path):
    path = lab(tmp_path / "lab.eaf")
    rules = {"affect": ChannelRule("Emotion", {}, ""), "brows": ChannelRule("Brows"),
             "affect-confidence": ChannelRule("Sure")}  # fmt: skip
    with pytest.warns(SignfaceWarning, match="of 2 annotations of brows 1 end"):
        write_eaf(found(), into=path, options=mapped(tmp_path, rules, curves=False))
    assert_valid(path)
    assert rows(path, "Brows") == [(0.1, 0.4, "raised", "Emotion"), (1.0, 1.2, "raised", "Emotion")]
    assert [row[0] for row in rows(path, "Sure")] == [row[0] for row in rows(path, "Emotion")]


@pytest.mark.parametrize("tier", ["Part", "Word"])
def test_tiers_that_allow_no_times_of_their_own_or_no_gaps_are_refused(tmp_path, tier):
    path = lab(tmp_path / "lab.eaf")
    before = path.read_bytes()
    with pytest.raises(SignfaceError, match=f"tier {tier} depends on Utt.*which affect cannot"):
        write_eaf(labelled(), into=path, signer="S1", options=mapped(tmp_path, {"affect": ChannelRule(tier)}))
    assert path.read_bytes() == before
