"""When annotations are: times that a file leaves open, and the clock of the film.

- `annotation_spans`: start and end of every annotation, those without times of their own as ELAN draws them.
- `parent_annotations`: which annotation each dependent one hangs on.

ELAN spreads the time slots that have no time over the chain of one tier, between the ends of the chain that have one
(`TimeOrderImpl.proposeTimeFor` in its sources), whatever slots of other tiers stand between them in TIME_ORDER; and
annotations of a symbolic subdivision over their parent's time (`RefAnnotation.getBeginTimeBoundary`).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from itertools import pairwise

from lxml import etree

#: Start and end of an annotation in milliseconds; None where nothing says when it is.
Span = tuple[int | None, int | None]


def annotation_spans(root: etree._Element) -> dict[str | None, Span]:
    """Start and end of every annotation in milliseconds, by its identifier.

    The chain of a time subdivision begins and ends with the annotation of the parent tier in which it stands. A
    symbolic subdivision divides its parent evenly; any other dependent annotation has its parent's times.

    Parameters
    ----------
    root : element
        What `document.read_document` returns.
    """
    order = [slot.get("TIME_SLOT_ID") for slot in root.iterfind("TIME_ORDER/TIME_SLOT")]
    place = {slot: position for position, slot in enumerate(order)}
    times: dict[str | None, int] = {
        slot.get("TIME_SLOT_ID"): int(slot.get("TIME_VALUE"))
        for slot in root.iterfind("TIME_ORDER/TIME_SLOT")
        if slot.get("TIME_VALUE") is not None
    }
    constraints = {kind.get("LINGUISTIC_TYPE_ID"): kind.get("CONSTRAINTS") for kind in root.iterfind("LINGUISTIC_TYPE")}
    aligned: dict[str | None, list[tuple[str | None, str | None]]] = {}
    spans: dict[str | None, Span] = {}
    for tier in _parents_first(root):
        name, parent = tier.get("TIER_ID"), tier.get("PARENT_REF")
        annotations = tier.findall("ANNOTATION/ALIGNABLE_ANNOTATION")
        pairs = [(one.get("TIME_SLOT_REF1"), one.get("TIME_SLOT_REF2")) for one in annotations]
        pairs = [pair for pair in pairs if pair[0] in place and pair[1] in place]
        aligned.setdefault(name, pairs)
        if any(slot not in times for pair in pairs for slot in pair):
            _spread(pairs, aligned.get(parent, []), place, times)
        for one in annotations:
            ends = times.get(one.get("TIME_SLOT_REF1")), times.get(one.get("TIME_SLOT_REF2"))
            spans[one.get("ANNOTATION_ID")] = ends
    _add_dependent(root, constraints, spans)
    return spans


def _parents_first(root: etree._Element) -> Iterator[etree._Element]:
    """The tiers, each behind the one it depends on; those of a ring, or of a parent that is not there, last."""
    left = root.findall("TIER")
    names, done = {tier.get("TIER_ID") for tier in left}, set()
    while left:
        ready = [tier for tier in left if tier.get("PARENT_REF") not in names or tier.get("PARENT_REF") in done]
        for tier in ready or left:
            yield tier
            done.add(tier.get("TIER_ID"))
        left = [tier for tier in left if tier.get("TIER_ID") not in done]


def _chains(pairs: list[tuple[str | None, str | None]], place: dict[str | None, int]) -> list[list[str | None]]:
    """The slots of annotations that follow each other by sharing one, in order; the chains in order of TIME_ORDER."""
    following = dict(pairs)
    begun = {end for _, end in pairs}
    chains = []
    for start in sorted((one for one in following if one not in begun), key=lambda slot: place[slot]):
        chain, slot = [start], start
        while slot in following and following[slot] not in chain:
            slot = following[slot]
            chain.append(slot)
        chains.append(chain)
    return chains


def _spread(
    pairs: list[tuple[str | None, str | None]],
    parents: list[tuple[str | None, str | None]],
    place: dict[str | None, int],
    times: dict[str | None, int],
) -> None:
    """Give times to the slots of a tier that have none; what is found is added to `times`."""
    groups: dict[int, list[list[str | None]]] = defaultdict(list)
    for chain in _chains(pairs, place):
        groups[_parent_of(chain, parents, place)].append(chain)
    for number, chains in groups.items():
        points: list[list[str | None]] = []  # slots of one moment
        for chain in chains:
            rest = chain
            if points and not (points[-1][-1] in times and chain[0] in times):
                points[-1].append(chain[0])  # converters write two slots where one annotation ends and the next begins
                rest = chain[1:]
            points += [[slot] for slot in rest]
        known = [next((times[slot] for slot in point if slot in times), None) for point in points]
        if number >= 0:
            start, end = (times.get(slot) for slot in parents[number])
            known[0] = start if known[0] is None else known[0]
            known[-1] = end if known[-1] is None else known[-1]
        fixed = [index for index, time in enumerate(known) if time is not None]
        for before, after in pairwise(fixed):
            start, end = known[before], known[after]
            assert start is not None
            assert end is not None
            for index in range(before + 1, after):
                known[index] = start + (end - start) * (index - before) // (after - before)
        for point, time in zip(points, known, strict=True):
            for slot in point:
                if time is not None:
                    times.setdefault(slot, time)


def _parent_of(
    chain: list[str | None], parents: list[tuple[str | None, str | None]], place: dict[str | None, int]
) -> int:
    """Number of the parent's annotation that a chain stands in, by TIME_ORDER as ELAN finds it; -1 without one."""
    for number, (start, end) in enumerate(parents):
        if place[start] < place[chain[-1]] and place[chain[0]] < place[end]:
            return number
    return -1


def parent_annotations(root: etree._Element) -> dict[str | None, str | None]:
    """The annotation that each dependent one hangs on, by their identifiers."""
    dependents = root.iterfind("TIER/ANNOTATION/REF_ANNOTATION")
    return {annotation.get("ANNOTATION_ID"): annotation.get("ANNOTATION_REF") for annotation in dependents}


def _add_dependent(
    root: etree._Element, constraints: dict[str | None, str | None], spans: dict[str | None, Span]
) -> None:
    """Add the times of the annotations that hang on others by reference."""
    parents = parent_annotations(root)
    shares: dict[str | None, tuple[int, int]] = {}  # which part of how many of its parent an annotation is
    for tier in root.iterfind("TIER"):
        if constraints.get(tier.get("LINGUISTIC_TYPE_REF")) != "Symbolic_Subdivision":
            continue
        siblings: dict[str | None, list[etree._Element]] = defaultdict(list)
        for one in tier.iterfind("ANNOTATION/REF_ANNOTATION"):
            siblings[one.get("ANNOTATION_REF")].append(one)
        for same in siblings.values():
            for number, identifier in enumerate(_in_order(same)):
                shares[identifier] = (number, len(same))

    for identifier in parents:
        path = [identifier]
        while path[-1] not in spans and path[-1] in parents and parents[path[-1]] not in path:
            path.append(parents[path[-1]])
        span = spans.get(path[-1], (None, None))
        for one in reversed(path):
            if one not in spans and None not in span and one in shares:
                (start, end), (number, count) = span, shares[one]
                assert start is not None
                assert end is not None
                span = (start + (end - start) * number // count, start + (end - start) * (number + 1) // count)
            if one in parents:  # what refers to nothing gets no times of its own
                span = spans.setdefault(one, span)


def _in_order(siblings: list[etree._Element]) -> list[str | None]:
    """Annotations of one parent in the order that PREVIOUS_ANNOTATION says; in the file's where it says none."""
    there = [one.get("ANNOTATION_ID") for one in siblings]
    following = {one.get("PREVIOUS_ANNOTATION"): one.get("ANNOTATION_ID") for one in siblings}
    ordered: list[str | None] = []
    for first in (one.get("ANNOTATION_ID") for one in siblings if one.get("PREVIOUS_ANNOTATION") not in there):
        current = first
        while current is not None and current not in ordered:
            ordered.append(current)
            current = following.get(current)
    return ordered + [one for one in there if one not in ordered]
