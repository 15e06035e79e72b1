"""`annotation_spans`: when every annotation of a document begins and ends, those without times of their own among them.

ELAN gives times to annotations that have none along the chain of their own tier: a time subdivision is spread evenly
between the ends of its chain that have a time, a symbolic subdivision over its parent. What other tiers have between
them in TIME_ORDER says nothing about them.
"""

from __future__ import annotations

from itertools import groupby

from lxml import etree

from signface.elan.document import parent_annotations

#: Start and end in milliseconds; None where a reference dangles or no end of a chain has a time.
Span = tuple[int | None, int | None]


def annotation_spans(root: etree._Element) -> dict[str, Span]:
    """Start and end of each annotation in milliseconds, by its identifier."""
    slots = root.findall("TIME_ORDER/TIME_SLOT")
    order = {slot.get("TIME_SLOT_ID"): number for number, slot in enumerate(slots)}
    times = {slot.get("TIME_SLOT_ID"): int(value) for slot in slots if (value := slot.get("TIME_VALUE")) is not None}
    spans: dict[str, Span] = {}
    for tier in root.iterfind("TIER"):
        spans |= _aligned(tier, order, times)
    shares = _shares(root)
    parents = parent_annotations(root)

    def span(identifier: str | None, seen: frozenset[str | None] = frozenset()) -> Span:
        if identifier in seen or identifier is None:  # a ring of references must not hang the reader
            return (None, None)
        if identifier not in parents:
            return spans.get(identifier, (None, None))
        start, end = span(parents[identifier], seen | {identifier})
        place, count = shares.get(identifier, (0, 1))
        if start is None or end is None:
            return (None, None)
        return (start + (end - start) * place // count, start + (end - start) * (place + 1) // count)

    spans |= {identifier: span(identifier) for identifier in parents if identifier is not None}
    return spans


def _aligned(tier: etree._Element, order: dict[str | None, int], times: dict[str | None, int]) -> dict[str, Span]:
    """Spans of the annotations of a tier that have time slots."""
    chain = sorted(
        tier.iterfind("ANNOTATION/ALIGNABLE_ANNOTATION"),
        key=lambda annotation: order.get(annotation.get("TIME_SLOT_REF1"), len(order)),
    )
    starts = [times.get(annotation.get("TIME_SLOT_REF1")) for annotation in chain]
    ends = [times.get(annotation.get("TIME_SLOT_REF2")) for annotation in chain]
    for number in range(1, len(chain)):  # where one ends and the next begins, either of two slots may have the time
        if ends[number - 1] is None:
            ends[number - 1] = starts[number]
        elif starts[number] is None:
            starts[number] = ends[number - 1]
    first = 0
    while first < len(chain):
        last = first
        while last < len(chain) - 1 and ends[last] is None:
            last += 1
        start, end, count = starts[first], ends[last], last - first + 1
        if start is not None and end is not None:
            for place in range(1, count):
                starts[first + place] = ends[first + place - 1] = start + (end - start) * place // count
        first = last + 1
    return {annotation.get("ANNOTATION_ID") or "": (a, b) for annotation, a, b in zip(chain, starts, ends)}


def _shares(root: etree._Element) -> dict[str | None, tuple[int, int]]:
    """Which part of its parent an annotation of a symbolic subdivision takes: its place and how many there are."""
    subdivided = {
        kind.get("LINGUISTIC_TYPE_ID")
        for kind in root.iterfind("LINGUISTIC_TYPE")
        if kind.get("CONSTRAINTS") == "Symbolic_Subdivision"
    }
    shares: dict[str | None, tuple[int, int]] = {}
    for tier in root.iterfind("TIER"):
        if tier.get("LINGUISTIC_TYPE_REF") not in subdivided:
            continue
        annotations = sorted(
            tier.iterfind("ANNOTATION/REF_ANNOTATION"), key=lambda annotation: annotation.get("ANNOTATION_REF") or ""
        )
        for _, group in groupby(annotations, key=lambda annotation: annotation.get("ANNOTATION_REF")):
            siblings = list(group)
            following = {one.get("PREVIOUS_ANNOTATION"): one.get("ANNOTATION_ID") for one in siblings}
            row: list[str | None] = []
            following_one = following.get(None)
            while following_one is not None and following_one not in row:
                row.append(following_one)
                following_one = following.get(following_one)
            if len(row) != len(siblings):  # a broken chain: as they stand in the file
                row = [one.get("ANNOTATION_ID") for one in siblings]
            shares |= {identifier: (place, len(row)) for place, identifier in enumerate(row)}
    return shares
