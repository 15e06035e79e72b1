"""`broken_constraints`: what an EAF holds that ELAN opens and does not take as it stands, each with what ELAN does."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from signface.elan.document import NAMES
from signface.elan.mapping import closed_entries
from signface.elan.times import annotation_spans
from signface.elan.upgrade import ORDER


def broken_constraints(root: etree._Element) -> Iterator[str]:
    """Faults of hierarchy, vocabularies, references, order and unit, each as a short clause.

    Parameters
    ----------
    root : element
        What `document.read_document` returns.
    """
    yield from _hierarchy(root)
    yield from _references(root)
    unit = root.find("HEADER").get("TIME_UNITS")
    if unit not in (None, "milliseconds"):
        yield f"TIME_UNITS is {unit} (ELAN reads all times as milliseconds)"
    ranks = [ORDER.index(child.tag) for child in root if child.tag in ORDER]
    late = next((child.tag for child, a, b in zip(
        [child for child in root if child.tag in ORDER][1:], ranks, ranks[1:]) if b < a), None)  # fmt: skip
    if late is not None:
        yield f"a {late} stands behind what the schema puts after it (ELAN's validator refuses the file)"


def _hierarchy(root: etree._Element) -> Iterator[str]:
    kinds = {kind.get("LINGUISTIC_TYPE_ID"): kind.get("CONSTRAINTS") for kind in root.iterfind("LINGUISTIC_TYPE")}
    tier_of = {
        one.get("ANNOTATION_ID"): tier.get("TIER_ID")
        for tier in root.iterfind("TIER")
        for one in tier.iterfind("ANNOTATION/*")
    }
    spans = annotation_spans(root)
    parents: dict[str | None, list[tuple[int, int]]] = {}
    for identifier, (start, end) in spans.items():
        if start is not None and end is not None:
            parents.setdefault(tier_of.get(identifier), []).append((start, end))
    for tier in root.iterfind("TIER"):
        name, parent = tier.get("TIER_ID"), tier.get("PARENT_REF")
        constraint = kinds.get(tier.get("LINGUISTIC_TYPE_REF"))
        if constraint is not None and parent is None:
            yield f"the tier {name} has no parent, its type wants one ({constraint}) (ELAN shows it as independent)"
        if constraint is None and parent is not None:
            yield f"the tier {name} depends on {parent}, its type has no constraint (ELAN treats it as independent)"
        symbolic = (constraint or "").startswith("Symbolic")
        entries = closed_entries(root, tier)
        for one in tier.iterfind("ANNOTATION/*"):
            identifier, refers = one.get("ANNOTATION_ID"), one.tag == "REF_ANNOTATION"
            start, end = spans.get(identifier, (None, None))
            if refers and not symbolic:
                yield f"the annotation {identifier} on tier {name} has no times of its own (ELAN may lose it)"
            elif refers and parent is not None and tier_of.get(one.get("ANNOTATION_REF"), parent) != parent:
                other = tier_of[one.get("ANNOTATION_REF")]
                yield f"the annotation {identifier} on tier {name} hangs on {other}, not {parent} (ELAN may lose it)"
            elif not refers and symbolic:
                yield f"the annotation {identifier} on tier {name} has times and no parent (ELAN may lose it)"
            elif not refers and parent is not None and start is not None and end is not None:
                inside = any(first <= start and end <= last for first, last in parents.get(parent, []))
                if not inside:
                    yield f"the annotation {identifier} on tier {name} lies in none of {parent} (ELAN may cut it)"
            value = (one.findtext("ANNOTATION_VALUE") or "").strip()
            if entries and value and value not in entries:
                yield f"the value {value!r} on tier {name} is not in its vocabulary (ELAN shows it)"


def _references(root: etree._Element) -> Iterator[str]:
    there = {one.get("EXT_REF_ID") for one in root.iterfind("EXTERNAL_REF")}
    for element in root.iter():
        for reference in (element.get("EXT_REF") or "").split():
            if reference not in there:
                yield f"{element.tag} has the reference {reference}, which is missing (ELAN ignores it)"
    entries = {entry.get("CVE_ID") for entry in root.iterfind("CONTROLLED_VOCABULARY/CV_ENTRY_ML")}
    external = {kind.get("CV_ID") for kind in root.iterfind("CONTROLLED_VOCABULARY") if kind.get("EXT_REF")}
    annotations = set()
    for one in root.iterfind("TIER/ANNOTATION/*"):
        annotations.add(one.get("ANNOTATION_ID"))
        entry, name = one.get("CVE_REF"), one.get("ANNOTATION_ID")
        if entry and entry not in entries and not external:
            yield f"the annotation {name} refers to the entry {entry}, which is missing (ELAN ignores it)"
    links = {link.get("REF_LINK_ID") for link in root.iterfind("REF_LINK_SET/*")}
    for link in root.iterfind("REF_LINK_SET/*"):
        for target in [link.get("REF1"), link.get("REF2"), *(link.get("REFS") or "").split()]:
            if target is not None and target not in annotations | links:
                yield f"the link {link.get('REF_LINK_ID')} refers to {target}, which is not there (ELAN drops the link)"
    for tag, attribute in (("LOCALE", "DEFAULT_LOCALE"), ("LANGUAGE", "LANG_REF")):
        known = {one.get(NAMES[tag]) for one in root.iterfind(tag)}
        for tier in root.iterfind("TIER"):
            if tier.get(attribute) is not None and tier.get(attribute) not in known:
                name = tier.get("TIER_ID")
                yield f"the tier {name} has the {tag} {tier.get(attribute)}, which is missing (ELAN ignores it)"
