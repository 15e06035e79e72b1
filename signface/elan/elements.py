"""Elements of an EAF document built from plain tiers.

- `TimeSlots`: the slots of new annotations, put in order among those that are there.
- `tier_elements`, `add_types`, `vocabularies_of`, `vocabulary_element`: tiers, linguistic types and vocabularies.
- `add_media`, `add_link`: links to a video and to curves.
"""

from __future__ import annotations

import mimetypes
from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path

from lxml import etree

from signface.elan.document import link_urls
from signface.elan.tiers import Tier, clean_name
from signface.elan.vocabularies import Vocabulary

LANGUAGE = {
    "LANG_ID": "eng",
    "LANG_DEF": "http://cdb.iso.org/lg/CDB-00138502-001",
    "LANG_LABEL": "English (eng)",
}
#: The four stereotypes, in ELAN's own words.
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


def tier_elements(tier: Tier, slots: TimeSlots, fresh_id: Callable[[str], str]) -> list[etree._Element]:
    """TIER elements of a tier and of those that depend on it."""
    parent = _tier_element(tier.name, tier.type_name, tier.participant)
    known = _entry_ids(tier.vocabulary)
    identifiers = []
    for start, end, value in zip(tier.start_ms, tier.end_ms, tier.values):
        identifiers.append(fresh_id("a"))
        annotation = etree.SubElement(etree.SubElement(parent, "ANNOTATION"), "ALIGNABLE_ANNOTATION")
        annotation.set("ANNOTATION_ID", identifiers[-1])
        if value in known:
            annotation.set("CVE_REF", known[value])
        slots.add(int(start), annotation, "TIME_SLOT_REF1")
        slots.add(int(end), annotation, "TIME_SLOT_REF2")
        etree.SubElement(annotation, "ANNOTATION_VALUE").text = value
    elements = [parent]
    for dependent in tier.dependents:
        child = _tier_element(dependent.name, dependent.type_name, tier.participant)
        child.set("PARENT_REF", tier.name)
        known = _entry_ids(dependent.vocabulary)
        for parent_id, text in zip(identifiers, dependent.values):
            if text is None:
                continue
            annotation = etree.SubElement(etree.SubElement(child, "ANNOTATION"), "REF_ANNOTATION")
            annotation.set("ANNOTATION_ID", fresh_id("a"))
            annotation.set("ANNOTATION_REF", parent_id)
            if text in known:
                annotation.set("CVE_REF", known[text])
            etree.SubElement(annotation, "ANNOTATION_VALUE").text = text
        elements.append(child)
    return elements


def _tier_element(name: str, type_name: str, participant: str) -> etree._Element:
    element = etree.Element("TIER", TIER_ID=name, LINGUISTIC_TYPE_REF=type_name)
    if participant:
        element.set("PARTICIPANT", clean_name(participant))
    element.set("ANNOTATOR", "signface")
    return element


def _entry_ids(vocabulary: Vocabulary | None) -> dict[str, str]:
    return {} if vocabulary is None else {entry.value: entry.identifier for entry in vocabulary.entries}


def add_types(root: etree._Element, tiers: Sequence[Tier]) -> None:
    """One LINGUISTIC_TYPE for each type that the tiers name."""
    done = set()
    for tier in tiers:
        for name, vocabulary, dependent in [
            (tier.type_name, tier.vocabulary, False),
            *((child.type_name, child.vocabulary, True) for child in tier.dependents),
        ]:
            if name in done:
                continue
            done.add(name)
            element = etree.SubElement(root, "LINGUISTIC_TYPE", LINGUISTIC_TYPE_ID=name)
            element.set("TIME_ALIGNABLE", "false" if dependent else "true")
            element.set("GRAPHIC_REFERENCES", "false")
            if dependent:
                element.set("CONSTRAINTS", "Symbolic_Association")
            if vocabulary is not None:
                element.set("CONTROLLED_VOCABULARY_REF", vocabulary.name)


def vocabularies_of(tiers: Sequence[Tier]) -> list[Vocabulary]:
    """The vocabularies that the tiers use, each once, in the order met."""
    found: dict[str, Vocabulary] = {}
    for tier in tiers:
        for vocabulary in (tier.vocabulary, *(child.vocabulary for child in tier.dependents)):
            if vocabulary is not None:
                found.setdefault(vocabulary.name, vocabulary)
    return list(found.values())


def vocabulary_element(vocabulary: Vocabulary) -> etree._Element:
    """CONTROLLED_VOCABULARY with multilingual entries (EAF 2.8 and later)."""
    element = etree.Element("CONTROLLED_VOCABULARY", CV_ID=vocabulary.name)
    etree.SubElement(element, "DESCRIPTION", LANG_REF=LANGUAGE["LANG_ID"]).text = vocabulary.description
    for entry in vocabulary.entries:
        item = etree.SubElement(element, "CV_ENTRY_ML", CVE_ID=entry.identifier)
        value = etree.SubElement(item, "CVE_VALUE", LANG_REF=LANGUAGE["LANG_ID"])
        if entry.description:
            value.set("DESCRIPTION", entry.description)
        value.text = entry.value
    return element


def add_media(header: etree._Element, video: str | PathLike[str], file: Path) -> None:
    """MEDIA_DESCRIPTOR with absolute and relative URL."""
    absolute, relative = link_urls(video, file)
    element = etree.SubElement(header, "MEDIA_DESCRIPTOR", MEDIA_URL=absolute)
    element.set("MIME_TYPE", mimetypes.guess_type(str(video))[0] or "video/mp4")
    if relative is not None:
        element.set("RELATIVE_MEDIA_URL", relative)


def add_link(header: etree._Element, linked: str | PathLike[str], file: Path) -> None:
    """LINKED_FILE_DESCRIPTOR: `.xml` as text/xml, anything else as text/plain."""
    absolute, relative = link_urls(linked, file)
    element = etree.SubElement(header, "LINKED_FILE_DESCRIPTOR", LINK_URL=absolute)
    element.set("MIME_TYPE", "text/xml" if str(linked).lower().endswith(".xml") else "text/plain")
    if relative is not None:
        element.set("RELATIVE_LINK_URL", relative)
