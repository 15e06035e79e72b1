"""`nested`: our channels on a lab's tiers whose annotations must lie within those of another tier (`Included_In`)."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from lxml import etree

from signface.elan.document import named, recorded, tier_rows
from signface.elan.mapping import ChannelRule, Mapping, stereotype
from signface.elan.tiers import Tier, clean_name
from signface.elan.times import annotation_spans
from signface.errors import SignfaceWarning
from signface.label.vocabulary import AFFECT


def nested(
    root: etree._Element, tiers: Sequence[Tier], mapping: Mapping, file: Path
) -> tuple[list[Tier], dict[str, ChannelRule]]:
    """Tiers and mapping with which every annotation has one of its parent tier around it.

    Where the parent tier is empty, it gets one annotation without a value over the whole time that was annotated. Where
    it has annotations, of the lab or of a channel that goes there, ours end at their edges, and what lies outside them
    is left out.

    Parameters
    ----------
    root : element
    tiers : sequence of Tier
    mapping : mapping of channel to ChannelRule
    file : Path
        Named in warnings.

    Warns
    -----
    SignfaceWarning
        Annotations were cut or left out.
    """
    there, ours = tier_rows(root), recorded(root)
    start = min((int(tier.start_ms[0]) for tier in tiers if len(tier.values)), default=0)
    end = max((int(tier.end_ms[-1]) for tier in tiers if len(tier.values)), default=0)
    spans_of = annotation_spans(root)
    goes = {_place(tier, mapping): tier for tier in tiers}
    around: list[Tier] = []
    rules = dict(mapping)

    def within(tier: Tier) -> Tier:
        element = named(root, "TIER", _place(tier, rules))
        if element is None or stereotype(root, element) != "Included_In" or not len(tier.values):
            return tier
        parent = element.get("PARENT_REF") or ""
        above_it = named(root, "TIER", parent)
        if above_it is None:
            return tier  # a fault of the file, which `signface elan check` names
        if parent in goes:
            above = within(goes[parent])
            spans = [(int(a), int(b)) for a, b, label in zip(above.start_ms, above.end_ms, above.values)
                     if rules[above.channel].value(label, above.vocabulary or AFFECT)]  # fmt: skip
        elif there.get(parent) and ours.get(parent) != there[parent]:
            found = [spans_of[one.get("ANNOTATION_ID") or ""] for one in above_it.iterfind("ANNOTATION/*")]
            spans = [(a, b) for a, b in found if a is not None and b is not None]
        else:
            spans = [(start, end)]
            if parent not in rules:
                rules[parent] = ChannelRule(parent)
                around.append(within(Tier(parent, tier.signer, np.array([start]), np.array([end]), ("",))))
        return _cut(tier, spans, parent, file)

    inside = [within(tier) for tier in tiers]
    return [*around, *inside], rules


def _place(tier: Tier, mapping: Mapping) -> str:
    """The lab's tier that a channel goes to; nothing where it goes to one of ours."""
    rule = mapping.get(tier.channel)
    return "" if rule is None else rule.tier.replace("{signer}", clean_name(tier.signer))


def _cut(tier: Tier, spans: Sequence[tuple[int, int]], parent: str, file: Path) -> Tier:
    """A tier whose annotations end at the edges of the spans they lie in."""
    rows = [
        (number, max(int(start), low), min(int(end), high))
        for number, (start, end) in enumerate(zip(tier.start_ms, tier.end_ms))
        for low, high in sorted(spans)
        if min(int(end), high) > max(int(start), low)
    ]
    whole = list(zip(range(len(tier.values)), tier.start_ms.tolist(), tier.end_ms.tolist()))
    if rows == whole:
        return tier
    left_out = len(whole) - len({number for number, _, _ in rows})
    cut = len({number for number, _, _ in set(rows) - set(whole)})
    warnings.warn(
        f"{file}: of {len(whole)} annotations of {tier.channel} {cut} end at the edges of annotations on the tier "
        f"{parent}, in which they must lie, and {left_out} lie outside all of them and are left out",
        SignfaceWarning,
        stacklevel=2,
    )
    kept = [number for number, _, _ in rows]
    return replace(
        tier,
        start_ms=np.array([start for _, start, _ in rows], dtype=np.int64),
        end_ms=np.array([end for _, _, end in rows], dtype=np.int64),
        values=tuple(tier.values[number] for number in kept),
        dependents=tuple(
            replace(child, values=tuple(child.values[number] for number in kept)) for child in tier.dependents
        ),
    )
