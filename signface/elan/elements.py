"""Elements of an EAF document built from plain tiers.

- `TimeSlots`: the slots of new annotations, put in order among those that are there.
- `tier_element`, `aligned_annotations`, `dependent_annotations`: tiers and what stands on them.
- `type_element`, `vocabulary_element`: linguistic types and controlled vocabularies.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from lxml import etree

from signface.elan.tiers import clean_name
from signface.label.vocabulary import Vocabulary

LANGUAGE = {"LANG_ID": "eng", "LANG_DEF": "http://cdb.iso.org/lg/CDB-00138502-001", "LANG_LABEL": "English (eng)"}
#: The four stereotypes, in ELAN's own words and spelling.
CONSTRAINTS = {
    "Time_Subdivision": "Time subdivision of parent annotation's time interval, "
    "no time gaps allowed within this interval",
    "Symbolic_Subdivision": "Symbolic subdivision of a parent annotation. "
    "Annotations refering to the same parent are ordered",
    "Symbolic_Association": "1-1 association with a parent annotation",
    "Included_In": "Time alignable annotations within the parent annotation's time interval, gaps are allowed",
}


class TimeSlots:
    """Time slots asked for by new annotations, and TIME_ORDER with them in their places.

    Parameters
    ----------
    fresh_id : callable
        Gives an unused identifier for a prefix: `fresh_id("ts")`.
    """

    def __init__(self, fresh_id: Callable[[str], str]) -> None:
        self._fresh_id = fresh_id
        self._asked: list[tuple[int, etree._Element, str]] = []

    def add(self, value: int, annotation: etree._Element, attribute: str) -> None:
        """Ask for a slot at `value` ms; `place` sets its identifier on the annotation's attribute."""
        self._asked.append((value, annotation, attribute))

    def place(self, order: etree._Element) -> None:
        """Add the slots to TIME_ORDER in the order of time. Slots that are there keep their order and identifiers.

        A slot without a value stays behind the slot it follows.
        """
        asked = sorted(self._asked, key=lambda slot: slot[0])
        existing = list(order)
        merged: list[etree._Element] = []
        position = 0
        for value, annotation, attribute in asked:
            while position < len(existing) and _not_after(existing[position], value):
                merged.append(existing[position])
                position += 1
            identifier = self._fresh_id("ts")
            merged.append(etree.Element("TIME_SLOT", TIME_SLOT_ID=identifier, TIME_VALUE=str(value)))
            annotation.set(attribute, identifier)
        merged.extend(existing[position:])
        order[:] = merged
        self._asked = []


def _not_after(slot: etree._Element, value: int) -> bool:
    """Whether an existing slot stands before a new one at `value` ms; a slot without a value, or a comment, does."""
    time = slot.get("TIME_VALUE") if slot.tag == "TIME_SLOT" else None
    return time is None or int(time) <= value


def tier_element(name: str, type_name: str, signer: str, parent: str | None = None) -> etree._Element:
    """An empty TIER."""
    element = etree.Element("TIER", TIER_ID=name, LINGUISTIC_TYPE_REF=type_name)
    if parent is not None:
        element.set("PARENT_REF", parent)
    if signer:
        element.set("PARTICIPANT", clean_name(signer))
    element.set("ANNOTATOR", "signface")
    return element


def aligned_annotations(
    tier: etree._Element,
    start_ms: np.ndarray,
    end_ms: np.ndarray,
    values: Sequence[str | None],
    entries: Mapping[str, str],
    slots: TimeSlots,
    fresh_id: Callable[[str], str],
) -> list[str | None]:
    """Fill a tier with time-aligned annotations, and give their identifiers; None among the values leaves one out.

    `entries` has the entry id (`CVE_ID`) of each value of the tier's vocabulary.
    """
    identifiers: list[str | None] = []
    for start, end, value in zip(start_ms, end_ms, values):
        if value is None:
            identifiers.append(None)
            continue
        identifier = fresh_id("a")
        annotation = etree.SubElement(etree.SubElement(tier, "ANNOTATION"), "ALIGNABLE_ANNOTATION")
        annotation.set("ANNOTATION_ID", identifier)
        if entries.get(value):
            annotation.set("CVE_REF", entries[value])
        slots.add(int(start), annotation, "TIME_SLOT_REF1")
        slots.add(int(end), annotation, "TIME_SLOT_REF2")
        etree.SubElement(annotation, "ANNOTATION_VALUE").text = value
        identifiers.append(identifier)
    return identifiers


def dependent_annotations(
    tier: etree._Element,
    parents: Sequence[str | None],
    values: Sequence[str | None],
    entries: Mapping[str, str],
    fresh_id: Callable[[str], str],
) -> None:
    """Fill a tier with annotations that hang on those of its parent; None among the values leaves one out."""
    for parent, value in zip(parents, values):
        if value is None or parent is None:
            continue
        annotation = etree.SubElement(etree.SubElement(tier, "ANNOTATION"), "REF_ANNOTATION")
        annotation.set("ANNOTATION_ID", fresh_id("a"))
        annotation.set("ANNOTATION_REF", parent)
        if entries.get(value):
            annotation.set("CVE_REF", entries[value])
        etree.SubElement(annotation, "ANNOTATION_VALUE").text = value


def type_element(name: str, vocabulary: str | None, *, dependent: bool) -> etree._Element:
    """LINGUISTIC_TYPE of an independent tier, or of one that hangs on another by symbolic association."""
    element = etree.Element("LINGUISTIC_TYPE", LINGUISTIC_TYPE_ID=name)
    element.set("TIME_ALIGNABLE", "false" if dependent else "true")
    element.set("GRAPHIC_REFERENCES", "false")
    if dependent:
        element.set("CONSTRAINTS", "Symbolic_Association")
    if vocabulary is not None:
        element.set("CONTROLLED_VOCABULARY_REF", vocabulary)
    return element


def entry_identifier(value: str) -> str:
    """The `CVE_ID` of a value; it depends on the value only, so that two runs write the same file."""
    return "cveid_" + "".join(c if c.isascii() and c.isalnum() else f"_{ord(c):x}_" for c in value)


def vocabulary_element(vocabulary: Vocabulary, name: str) -> etree._Element:
    """CONTROLLED_VOCABULARY of a name, with multilingual entries (EAF 2.8 and later)."""
    element = etree.Element("CONTROLLED_VOCABULARY", CV_ID=name)
    etree.SubElement(element, "DESCRIPTION", LANG_REF=LANGUAGE["LANG_ID"]).text = vocabulary.description
    for entry in vocabulary.entries:
        item = etree.SubElement(element, "CV_ENTRY_ML", CVE_ID=entry_identifier(entry.value))
        value = etree.SubElement(item, "CVE_VALUE", LANG_REF=LANGUAGE["LANG_ID"])
        if entry.description:
            value.set("DESCRIPTION", entry.description)
        value.text = entry.value
    return element
