"""Documents of EAF 2.5 to 2.8 as EAF 3.0, and where a new element belongs in a document.

What changed on the way (comments of the schemas): 2.8 moved the entries of controlled vocabularies from `CV_ENTRY` to
the multilingual `CV_ENTRY_ML` and their description from an attribute to an element; everything else was added.
"""

from __future__ import annotations

from lxml import etree

from signface.elan.document import SCHEMA_URL, XSI, named

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


def upgrade(root: etree._Element) -> None:
    """Make a document EAF 3.0, keeping everything it holds."""
    for vocabulary in root.iterfind("CONTROLLED_VOCABULARY"):
        _upgrade_vocabulary(root, vocabulary)
    root.set("VERSION", "3.0")
    root.set("FORMAT", "3.0")
    root.set(f"{{{XSI}}}noNamespaceSchemaLocation", SCHEMA_URL)


def _upgrade_vocabulary(root: etree._Element, vocabulary: etree._Element) -> None:
    description = vocabulary.attrib.pop("DESCRIPTION", None)
    if description:
        vocabulary.insert(0, etree.Element("DESCRIPTION", LANG_REF=_undetermined(root)))
        vocabulary[0].text = description
    used = {entry.get("CVE_ID") for entry in vocabulary.iterfind("CV_ENTRY_ML")}
    number = 0
    for entry in vocabulary.findall("CV_ENTRY"):
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


def _undetermined(root: etree._Element) -> str:
    """Identifier of the undetermined language, which is added to the document when it is not there."""
    if named(root, "LANGUAGE", UNDETERMINED["LANG_ID"]) is None:
        insert_in_order(root, etree.Element("LANGUAGE", UNDETERMINED))
    return UNDETERMINED["LANG_ID"]
