"""What is wrong with an EAF.

- `check_file`: what a file holds and every problem of it.
- `find_problems`: the problems of a document that was read.
- `check_document`: refuses a document with problems.

The schema tells whether a document is well formed as an EAF; these are the faults that it cannot see or that are worth
saying in plain words.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from os import PathLike
from pathlib import Path

from lxml import etree

from signface.elan.constraints import broken_constraints
from signface.elan.document import NAMES, read_document
from signface.elan.times import parent_annotations
from signface.errors import SignfaceError, SignfaceWarning

#: The attributes that tie an annotation to its times.
ENDS = ("TIME_SLOT_REF1", "TIME_SLOT_REF2")


@dataclass(frozen=True)
class FileCheck:
    """What an EAF holds and what is wrong with it; `print` says it for a person.

    Parameters
    ----------
    file : Path
    version : str
        Of the format.
    tiers, annotations : int
        How many there are.
    problems : tuple of str
        Each as a short clause.
    """

    file: Path
    version: str
    tiers: int
    annotations: int
    problems: tuple[str, ...]

    def __str__(self) -> str:
        count = len(self.problems)
        state = f"{count} problem{'s' * (count != 1)}" if count else "no problem"
        line = f"{self.file}: EAF {self.version}, {self.tiers} tiers, {self.annotations} annotations, {state}"
        return "\n  ".join([line, *self.problems])


def check_file(path: str | PathLike[str], *, media_s: float | None = None) -> FileCheck:
    """What an EAF holds and every problem of it.

    Parameters
    ----------
    path : path
    media_s : float, optional
        Length of the film in seconds; annotations that end after it are named.

    Raises
    ------
    SignfaceError
        The file cannot be read as an EAF.

    Examples
    --------
    >>> import signface as sf
    >>> check_file(sf.datasets.mini_file().with_name("reference") / "M1_IE_J.eaf").problems
    ()
    """
    root = read_document(path).getroot()
    found = find_problems(root, media_ms=None if media_s is None else 1000 * media_s)
    problems = (*found, *broken_constraints(root))
    tiers, annotations = root.findall("TIER"), root.findall("TIER/ANNOTATION")
    return FileCheck(Path(path), root.get("VERSION") or "", len(tiers), len(annotations), problems)


def check_document(root: etree._Element, file: Path) -> None:
    """Refuse a document with problems.

    Raises
    ------
    SignfaceError
        The first problem and the number of others, in one line.
    """
    if problems := list(_of_references(root)):
        hint = "see them all with signface elan check, and mend them in ELAN"
        raise SignfaceError(_first(problems), file=file, hint=hint)
    if harmless := list(_of_times(root, None)):  # ELAN opens such a file, and nothing of it is touched
        warnings.warn(f"{file}: {_first(harmless)}; it stays as it is", SignfaceWarning, stacklevel=3)


def _first(problems: list[str]) -> str:
    return f"{problems[0]} (and {len(problems) - 1} more)" if len(problems) > 1 else problems[0]


def find_problems(root: etree._Element, *, media_ms: float | None = None) -> Iterator[str]:
    """Problems of a document, each as a short clause.

    Duplicate identifiers, dangling references, rings of dependent annotations, annotations that do not end after
    they start or that overlap on their tier.

    Parameters
    ----------
    root : element
        What `document.read_document` returns.
    media_ms : float, optional
        Length of the media in milliseconds; annotations that end after it are named.
    """
    yield from _of_references(root)
    yield from _of_times(root, media_ms)


def _of_references(root: etree._Element) -> Iterator[str]:
    """What nothing can be written into: identifiers, names and references."""
    yield from _duplicates(root)
    yield from _dangling_names(root)
    yield from _annotations(root)


def _duplicates(root: etree._Element) -> Iterator[str]:
    for tag, attribute in NAMES.items():
        for name, count in Counter(element.get(attribute) for element in root.iterfind(tag)).items():
            if name is None:
                yield f"a {tag} has no {attribute}"
            elif count > 1:
                yield f"{count} elements {tag} have the name {name}"
    identifiers = Counter(slot.get("TIME_SLOT_ID") for slot in root.iterfind("TIME_ORDER/TIME_SLOT"))
    identifiers.update(annotation.get("ANNOTATION_ID") for annotation in root.iterfind("TIER/ANNOTATION/*"))
    for name, count in identifiers.items():
        if name is None:
            yield "an annotation or time slot has no identifier"
        elif count > 1:
            yield f"the identifier {name} is used {count} times"


def _dangling_names(root: etree._Element) -> Iterator[str]:
    def named(tag: str) -> set[str | None]:
        return {element.get(NAMES[tag]) for element in root.iterfind(tag)}

    types, vocabularies, tiers, languages = (
        named(tag) for tag in ("LINGUISTIC_TYPE", "CONTROLLED_VOCABULARY", "TIER", "LANGUAGE")
    )
    for tier in root.iterfind("TIER"):
        name = tier.get("TIER_ID")
        if tier.get("LINGUISTIC_TYPE_REF") not in types:
            yield f"the tier {name} has the type {tier.get('LINGUISTIC_TYPE_REF')}, which is not there"
        parent = tier.get("PARENT_REF")
        if parent is not None and parent not in tiers:
            yield f"the tier {name} depends on the tier {parent}, which is not there"
    parents = {tier.get("TIER_ID"): tier.get("PARENT_REF") for tier in root.iterfind("TIER")}
    for name in parents:
        if _in_a_ring(name, parents):
            yield f"the tier {name} depends on itself"
    for kind in root.iterfind("LINGUISTIC_TYPE"):
        vocabulary = kind.get("CONTROLLED_VOCABULARY_REF")
        if vocabulary is not None and vocabulary not in vocabularies:
            yield f"the type {kind.get('LINGUISTIC_TYPE_ID')} has the vocabulary {vocabulary}, which is not there"
    for value in root.iterfind("CONTROLLED_VOCABULARY/CV_ENTRY_ML/CVE_VALUE"):
        if value.get("LANG_REF") not in languages:
            yield f"the vocabulary value {value.text} is in the language {value.get('LANG_REF')}, which is not there"


def _annotations(root: etree._Element) -> Iterator[str]:
    slots = {slot.get("TIME_SLOT_ID") for slot in root.iterfind("TIME_ORDER/TIME_SLOT")}
    parents = parent_annotations(root)
    known = {annotation.get("ANNOTATION_ID") for annotation in root.iterfind("TIER/ANNOTATION/*")}
    for tier in root.iterfind("TIER"):
        name = tier.get("TIER_ID")
        if any(len(annotation) == 0 for annotation in tier.iterfind("ANNOTATION")):
            yield f"an annotation on tier {name} is empty: it has neither times nor a parent"
        for annotation in tier.iterfind("ANNOTATION/*"):
            identifier = annotation.get("ANNOTATION_ID")
            if annotation.tag == "REF_ANNOTATION":
                for attribute in ("ANNOTATION_REF", "PREVIOUS_ANNOTATION"):
                    target = annotation.get(attribute)
                    if target not in known and (target is not None or attribute == "ANNOTATION_REF"):
                        yield f"the annotation {identifier} refers to {target}, which is not there"
                if _in_a_ring(identifier, parents):
                    yield f"the annotation {identifier} depends on itself"
                continue
            missing = [slot for end in ENDS if (slot := annotation.get(end)) not in slots]
            if missing:
                yield f"the annotation {identifier} refers to the time slot {missing[0]}, which is not there"


def _of_times(root: etree._Element, media_ms: float | None) -> Iterator[str]:
    """Annotations that overlap, do not end after they start, or end after the media."""
    slots = {slot.get("TIME_SLOT_ID"): slot.get("TIME_VALUE") for slot in root.iterfind("TIME_ORDER/TIME_SLOT")}
    for tier in root.iterfind("TIER"):
        name, spans = tier.get("TIER_ID"), []
        for annotation in tier.iterfind("ANNOTATION/ALIGNABLE_ANNOTATION"):
            identifier = annotation.get("ANNOTATION_ID")
            start, end = (slots.get(annotation.get(place)) for place in ENDS)
            if start is None or end is None:
                continue
            if int(start) >= int(end):
                yield f"the annotation {identifier} on tier {name} does not end after it starts ({start} ms)"
                continue
            if media_ms is not None and int(end) > media_ms:
                yield f"the annotation {identifier} on tier {name} ends at {end} ms, the media at {media_ms:.0f} ms"
            spans.append((int(start), int(end), identifier))
        spans.sort()
        for (_, end, first), (start, _, second) in pairwise(spans):
            if start < end:
                yield f"the annotations {first} and {second} on tier {name} overlap at {start} ms"


def _in_a_ring(identifier: str | None, parents: dict[str | None, str | None]) -> bool:
    """Whether following the parents of an annotation, or a tier, leads back to it."""
    seen, above = {identifier}, parents.get(identifier)
    while above is not None and above not in seen:
        seen.add(above)
        above = parents.get(above)
    return above is not None and above == identifier
