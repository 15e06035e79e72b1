"""Documents of EAF 2.5 to 2.8 as EAF 3.0, and where a new element belongs in a document.

- `upgrade`: the document; `is_before_28`: whether its annotations refer to their vocabulary by value alone.
- `insert_in_order`: a child of the root where the schema wants it.

What changed on the way (comments of the schemas): 2.8 moved the entries of controlled vocabularies from `CV_ENTRY` to
the multilingual `CV_ENTRY_ML` and their description from an attribute to an element; everything else was added. An
annotation now belongs to its entry by `CVE_REF`. ELAN finds the entry by the value only while it loads a file before
2.8, so that annotations without it would be cut from their vocabulary.
"""

from __future__ import annotations

import re

from lxml import etree

from signface.elan.document import SCHEMA_URL, XSI, named
from signface.elan.vocabularies import external_vocabulary

#: The language of values that were written before languages were known, as ELAN names it.
UNDETERMINED = {
    "LANG_ID": "und",
    "LANG_DEF": "http://cdb.iso.org/lg/CDB-00130975-001",
    "LANG_LABEL": "undetermined (und)",
}

#: Children of the root in the order that the schema asks for.
ORDER = (
    "LICENSE",
    "HEADER",
    "TIME_ORDER",
    "TIER",
    "LINGUISTIC_TYPE",
    "LOCALE",
    "LANGUAGE",
    "CONSTRAINT",
    "CONTROLLED_VOCABULARY",
    "LEXICON_REF",
    "REF_LINK_SET",
    "EXTERNAL_REF",
)


def insert_in_order(root: etree._Element, element: etree._Element) -> None:
    """Put a child of the root behind its like, or where the schema wants the first of its kind."""
    rank = ORDER.index(element.tag)
    position = 0
    for index, child in enumerate(root):
        if child.tag in ORDER and ORDER.index(child.tag) <= rank:
            position = index + 1
    root.insert(position, element)


def is_before_28(root: etree._Element) -> bool:
    """Whether a document is of a format before EAF 2.8, as ELAN tells it (`FORMAT`, else `VERSION`)."""
    match = re.match(r"(\d+)\.(\d+)", (root.get("FORMAT") or root.get("VERSION") or "").strip())
    return match is not None and (int(match[1]), int(match[2])) < (2, 8)


def upgrade(root: etree._Element) -> None:
    """Make a document EAF 3.0 with all it holds; its annotations then refer to the entries of their vocabulary."""
    every = is_before_28(root)
    entries = {}
    for vocabulary in root.iterfind("CONTROLLED_VOCABULARY"):
        if _upgrade_vocabulary(root, vocabulary) or every:
            kept = external_vocabulary(root, vocabulary)[0] if vocabulary.get("EXT_REF") else vocabulary
            entries[vocabulary.get("CV_ID")] = {} if kept is None else _identifiers(kept)
    _refer_to_entries(root, entries)
    root.set("VERSION", "3.0")
    root.set("FORMAT", "3.0")
    root.set(f"{{{XSI}}}noNamespaceSchemaLocation", SCHEMA_URL)


def _identifiers(vocabulary: etree._Element) -> dict[str, str]:
    """Value and identifier of each entry; of two with one value the first, as ELAN has it."""
    identifiers: dict[str, str] = {}
    for entry in vocabulary.iterfind("CV_ENTRY_ML"):
        for value in entry.iterfind("CVE_VALUE"):
            identifiers.setdefault(value.text or "", entry.get("CVE_ID") or "")
    return identifiers


def _refer_to_entries(root: etree._Element, entries: dict[str | None, dict[str, str]]) -> None:
    """Give annotations of these vocabularies the `CVE_REF` of the entry with their value, where they have none."""
    types = {kind.get("LINGUISTIC_TYPE_ID"): kind for kind in root.iterfind("LINGUISTIC_TYPE")}
    for tier in root.iterfind("TIER"):
        kind = types.get(tier.get("LINGUISTIC_TYPE_REF"))
        known = {} if kind is None else entries.get(kind.get("CONTROLLED_VOCABULARY_REF"), {})
        for annotation in tier.iterfind("ANNOTATION/*") if known else ():
            value = annotation.findtext("ANNOTATION_VALUE") or ""
            if not annotation.get("CVE_REF") and known.get(value):
                annotation.set("CVE_REF", known[value])


def _upgrade_vocabulary(root: etree._Element, vocabulary: etree._Element) -> bool:
    """Give a vocabulary multilingual entries; whether it had others."""
    description = vocabulary.attrib.pop("DESCRIPTION", None)
    if description:
        vocabulary.insert(0, etree.Element("DESCRIPTION", LANG_REF=_undetermined(root)))
        vocabulary[0].text = description
    used = {entry.get("CVE_ID") for entry in vocabulary.iterfind("CV_ENTRY_ML")}
    number = 0
    old = vocabulary.findall("CV_ENTRY")
    for entry in old:
        while f"cveid{number}" in used:
            number += 1
        used.add(f"cveid{number}")
        new = etree.Element("CV_ENTRY_ML", CVE_ID=f"cveid{number}")
        if entry.get("EXT_REF"):
            new.set("EXT_REF", entry.get("EXT_REF"))
        value = etree.SubElement(new, "CVE_VALUE", LANG_REF=_undetermined(root))
        if entry.get("DESCRIPTION"):
            value.set("DESCRIPTION", entry.get("DESCRIPTION"))
        value.text = entry.text
        new.tail = entry.tail
        vocabulary.replace(entry, new)
    return bool(old)


def _undetermined(root: etree._Element) -> str:
    """Identifier of the undetermined language, which is added to the document when it is not there."""
    if named(root, "LANGUAGE", UNDETERMINED["LANG_ID"]) is None:
        insert_in_order(root, etree.Element("LANGUAGE", UNDETERMINED))
    return UNDETERMINED["LANG_ID"]
