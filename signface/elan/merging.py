"""`put_tiers`: our tiers into a document that somebody else made, leaving everything else as it is.

First a plan is made and every reason to refuse is found; only then is the tree changed.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from signface.elan.document import (
    CHANNEL_PREFIX,
    WRITTEN_PREFIX,
    Row,
    fresh_ids,
    get_property,
    last_annotation_number,
    named,
    recorded,
    set_property,
    tier_rows,
    written_record,
)
from signface.elan.elements import (
    CONSTRAINTS,
    LANGUAGE,
    TimeSlots,
    aligned_annotations,
    dependent_annotations,
    entry_identifier,
    tier_element,
    type_element,
    vocabulary_element,
)
from signface.elan.mapping import ChannelRule, Mapping, closed_entries, stereotype
from signface.elan.nesting import nested
from signface.elan.tiers import Tier, clean_name, tier_name
from signface.elan.upgrade import insert_in_order
from signface.errors import SignfaceError
from signface.label.vocabulary import AFFECT, Vocabulary

#: Stereotypes of tiers whose annotations have time slots.
WITH_TIMES = (None, "Time_Subdivision", "Included_In")

#: Ending of the names of our types and vocabularies where the lab has others of that name.
OURS = " (signface)"


@dataclass
class _Target:
    """Where one channel goes: the tier (there or to be made) and the values as the lab writes them."""

    channel: str
    tier_id: str
    element: etree._Element | None
    aligned: bool
    values: list[str | None]
    rows: list[Row]
    entries: dict[str, str]
    vocabulary: Vocabulary | None
    labels: dict[str, str]


def put_tiers(
    root: etree._Element, tiers: Sequence[Tier], *, mapping: Mapping | None = None, replace: bool = False, file: Path
) -> bool:
    """Add our tiers to a document, or bring those that are there up to date.

    A tier whose annotations are already those to be written is not touched, identifiers included. A tier that holds
    annotations is overwritten only where signface wrote them and nobody changed them since, or with `replace`.

    Parameters
    ----------
    root : element
        An EAF 3.0 document (`upgrade.upgrade`); changed in place.
    tiers : sequence of Tier
    mapping : mapping of channel to ChannelRule, optional
    replace : bool
        Overwrite what an annotator corrected in our tiers.
    file : Path
        Named in errors.

    Returns
    -------
    bool
        Whether anything changed.

    Raises
    ------
    SignfaceError
        Before anything is changed: the mapping names a tier that is missing or of the wrong kind, a label is not in
        a closed vocabulary, annotations would be lost that are not ours.
    """
    before = tier_rows(root)
    written = recorded(root)
    tiers, mapping = nested(root, tiers, mapping or {}, file)
    groups = [(tier, targets) for tier in tiers if (targets := _plan(root, tier, mapping, file))]
    names = [target.tier_id for _, group in groups for target in group]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise SignfaceError(f"two channels are mapped to the tier {twice[0]}", file=file)
    changed = []
    for tier, group in groups:
        if all(target.element is not None and before[target.tier_id] == target.rows for target in group):
            continue
        for target in group:
            current = before.get(target.tier_id, [])
            if current and not replace and written.get(target.tier_id) != current:
                raise SignfaceError(
                    f"the tier {target.tier_id} holds annotations that signface did not write or that were "
                    "corrected since",
                    file=file,
                    hint="keep them and leave the tier out of the mapping, or overwrite them with --replace",
                )
        _refuse_losses(root, group, set(names), file)
        changed.append((tier, group))
    if not changed:
        return False
    fresh_id = fresh_ids(root)
    slots = TimeSlots(fresh_id)
    for _, group in changed:
        for target in group:
            if target.element is not None:
                _empty(root, target.element)
    for tier, group in changed:
        _write(root, tier, group, slots, fresh_id)
    slots.place(root.find("TIME_ORDER"))
    set_property(root, "lastUsedAnnotationId", str(last_annotation_number(root)))
    after = tier_rows(root)
    for _, group in changed:
        for target in group:
            set_property(root, WRITTEN_PREFIX + target.tier_id, written_record(after[target.tier_id]))
            if target.tier_id.partition("@")[0] != target.channel or target.labels:
                meaning = {"channel": target.channel, "labels": target.labels}
                set_property(root, CHANNEL_PREFIX + target.tier_id, json.dumps(meaning, ensure_ascii=False))
    return True


def _plan(root: etree._Element, tier: Tier, mapping: Mapping, file: Path) -> list[_Target]:
    """Targets of a tier and its dependents, the aligned one first; empty when the mapping leaves it out."""
    parent = _target(root, tier.channel, tier, tier.values, tier.vocabulary, None, mapping, file)
    if parent is None:
        return []
    dependents = (
        _target(root, child.channel, tier, child.values, child.vocabulary, parent, mapping, file)
        for child in tier.dependents
    )
    return [parent, *(target for target in dependents if target is not None)]


def _target(
    root: etree._Element,
    channel: str,
    tier: Tier,
    labels: Sequence[str | None],
    vocabulary: Vocabulary | None,
    parent: _Target | None,
    mapping: Mapping,
    file: Path,
) -> _Target | None:
    rule = mapping.get(channel) or ChannelRule(tier_name(channel, tier.signer))
    if not rule.tier:
        return None
    tier_id = rule.tier.replace("{signer}", clean_name(tier.signer))
    element = named(root, "TIER", tier_id)
    if element is None and channel in mapping:
        names = ", ".join(other.get("TIER_ID") or "" for other in root.iterfind("TIER"))
        raise SignfaceError(
            f"has no tier {tier_id}, to which the mapping sends {channel}", file=file, hint=f"its tiers are {names}"
        )
    if element is not None and channel not in mapping and not _is_ours(root, element):
        named_by = "" if tier.signer else "name the signer (--signer), whose tiers then have names of their own, or "
        raise SignfaceError(
            f"the tier {tier_id} is not signface's, although it has the name of ours",
            file=file,
            hint=f"{named_by}say in a mapping where {channel} goes (signface elan map)",
        )
    aligned = parent is None
    if element is not None:
        kind, above = stereotype(root, element), element.get("PARENT_REF")
        if parent is None:
            fits = kind in (None, "Included_In")  # `nested` has seen to what must lie around them
        else:
            aligned = kind in WITH_TIMES  # the lab keeps this channel on a tier of its own times
            fits = kind is None or above == parent.tier_id
        if not fits:
            raise SignfaceError(
                f"the tier {tier_id} depends on {above} ({kind}), which {channel} cannot",
                file=file,
                hint="map it to a tier without a parent"
                + (", or one included in another" if parent is None else f", or one that depends on {parent.tier_id}"),
            )
    values = [None if label is None else rule.value(label, tier.vocabulary or AFFECT) for label in labels]
    if parent is not None:  # an annotation that is left out takes what hangs on it along
        values = [None if above is None else value for above, value in zip(parent.values, values)]
    entries = None if element is None else closed_entries(root, element)
    if entries is not None:
        outside = sorted({value for value in values if value and value not in entries})
        if outside:
            raise SignfaceError(
                f"{outside[0]!r} ({channel}) is not in the closed vocabulary of the tier {tier_id}",
                file=file,
                hint=f"it holds {', '.join(list(entries)[:12])}; say in the mapping what becomes of it",
            )
    rows: list[Row] = [
        (int(start), int(end), value)
        for start, end, value in zip(tier.start_ms, tier.end_ms, values)
        if value is not None
    ]
    if element is None:
        entries = {value: entry_identifier(value) for value in vocabulary.allowed} if vocabulary else {}
    return _Target(
        channel,
        tier_id,
        element,
        aligned,
        values,
        rows,
        entries or {},
        vocabulary if element is None else None,
        _meaning(labels, values),
    )


def _is_ours(root: etree._Element, tier: etree._Element) -> bool:
    """Whether signface made a tier: it says so, or the header keeps what was written on it."""
    return tier.get("ANNOTATOR") == "signface" or (
        get_property(root, WRITTEN_PREFIX + (tier.get("TIER_ID") or "")) is not None
    )


def _meaning(labels: Sequence[str | None], values: Sequence[str | None]) -> dict[str, str]:
    """Value and our label, for the values that stand for one label and are not the label itself."""
    stands_for: dict[str, set[str]] = {}
    for label, value in zip(labels, values):
        if label is not None and value is not None:
            stands_for.setdefault(value, set()).add(label)
    return {value: next(iter(ours)) for value, ours in stands_for.items() if len(ours) == 1 and ours != {value}}


def _refuse_losses(root: etree._Element, group: list[_Target], written: set[str], file: Path) -> None:
    """Refuse when annotations of others hang on, or link to, those that would be rewritten.

    What is `written` in the same run is not lost.
    """
    names = {target.tier_id for target in group}
    for child in root.iterfind("TIER"):
        if (
            child.get("PARENT_REF") in names
            and child.get("TIER_ID") not in written
            and child.find("ANNOTATION") is not None
        ):
            raise SignfaceError(
                f"the tier {child.get('TIER_ID')} hangs on {child.get('PARENT_REF')} and would lose its annotations",
                file=file,
                hint="move them to a tier of their own first",
            )
    going = {
        annotation.get("ANNOTATION_ID")
        for target in group
        if target.element is not None
        for annotation in target.element.iterfind("ANNOTATION/*")
    }
    for link in root.iterfind("REF_LINK_SET/*"):
        targets = {link.get("REF1"), link.get("REF2"), *(link.get("REFS") or "").split()}
        if targets & going:
            raise SignfaceError(
                f"the link {link.get('REF_LINK_ID')} refers to annotations that would be replaced",
                file=file,
                hint="remove the link first",
            )


def _empty(root: etree._Element, tier: etree._Element) -> None:
    """Take the annotations out of a tier, and the time slots that only they used."""
    slots = set()
    for annotation in tier.findall("ANNOTATION"):
        slots |= {annotation[0].get("TIME_SLOT_REF1"), annotation[0].get("TIME_SLOT_REF2")}
        tier.remove(annotation)
    for annotation in root.iterfind("TIER/ANNOTATION/ALIGNABLE_ANNOTATION"):
        slots -= {annotation.get("TIME_SLOT_REF1"), annotation.get("TIME_SLOT_REF2")}
    order = root.find("TIME_ORDER")
    for slot in order.findall("TIME_SLOT"):
        if slot.get("TIME_SLOT_ID") in slots:
            order.remove(slot)


def _write(
    root: etree._Element, tier: Tier, group: list[_Target], slots: TimeSlots, fresh_id: Callable[[str], str]
) -> None:
    """Make the tiers that are missing, with their types and vocabularies, and fill them all."""
    parent = group[0]
    identifiers: list[str | None] = []
    for target in group:
        if target.element is None:
            target.element = tier_element(
                target.tier_id, _type(root, target), tier.signer, None if target.aligned else parent.tier_id
            )
            insert_in_order(root, target.element)
        if target.aligned:
            made = aligned_annotations(
                target.element, tier.start_ms, tier.end_ms, target.values, target.entries, slots, fresh_id
            )
            identifiers = made if target is parent else identifiers
        else:
            dependent_annotations(target.element, identifiers, target.values, target.entries, fresh_id)


def _type(root: etree._Element, target: _Target) -> str:
    """Name of a linguistic type for a tier of ours; it and its vocabulary are added unless the like is there."""
    wanted = type_element(target.channel, _vocabulary(root, target), dependent=not target.aligned)
    for name in (target.channel, target.channel + OURS):
        kind = named(root, "LINGUISTIC_TYPE", name)
        if kind is None:
            wanted.set("LINGUISTIC_TYPE_ID", name)
            insert_in_order(root, wanted)
            constraint = "Symbolic_Association"
            if not target.aligned and named(root, "CONSTRAINT", constraint) is None:
                description = CONSTRAINTS[constraint]
                insert_in_order(root, etree.Element("CONSTRAINT", STEREOTYPE=constraint, DESCRIPTION=description))
            return name
        if all(kind.get(key) == wanted.get(key) for key in ("CONSTRAINTS", "CONTROLLED_VOCABULARY_REF")):
            return name
    raise SignfaceError(f"has linguistic types named {target.channel} of another kind", hint="rename them in ELAN")


def _vocabulary(root: etree._Element, target: _Target) -> str | None:
    """Name of the vocabulary for a tier of ours; it is added unless one with all its entries is there."""
    vocabulary = target.vocabulary
    if vocabulary is None:
        return None
    for name in (vocabulary.name, vocabulary.name + OURS):
        element = named(root, "CONTROLLED_VOCABULARY", name)
        if element is None:
            if named(root, "LANGUAGE", LANGUAGE["LANG_ID"]) is None:
                insert_in_order(root, etree.Element("LANGUAGE", LANGUAGE))
            insert_in_order(root, vocabulary_element(vocabulary, name))
            return name
        entries = {entry.get("CVE_ID") for entry in element.iterfind("CV_ENTRY_ML")}
        if entries >= {entry_identifier(value) for value in vocabulary.allowed}:
            return name
    raise SignfaceError(f"has vocabularies named {vocabulary.name} of another kind", hint="rename them in ELAN")
