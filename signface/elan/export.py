"""`write_eaf`: labelled segments as an EAF 3.0 file of its own."""

from __future__ import annotations

import datetime
import mimetypes
import uuid
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from os import PathLike
from pathlib import Path

from lxml import etree

from signface.elan.document import (
    PROPERTY_PREFIX,
    SCHEMA_URL,
    WRITTEN_PREFIX,
    XSI,
    back_up,
    is_unmodified_output,
    link_urls,
    read_document,
    recorded,
    set_property,
    tier_rows,
    write_document,
    written_record,
)
from signface.elan.tiers import Tier, affect_tier
from signface.elan.vocabularies import AFFECT, Vocabulary
from signface.errors import SignfaceError
from signface.segment.segments import Segments

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


def write_eaf(
    path: str | PathLike[str],
    segments: Segments,
    *,
    signer: str = "",
    video: str | PathLike[str] | None = None,
    properties: Mapping[str, str] | None = None,
    vocabulary: Vocabulary = AFFECT,
    tiers: Sequence[Tier] = (),
    linked_files: Sequence[str | PathLike[str]] = (),
    date: datetime.datetime | str | None = None,
    author: str = "signface",
    replace: bool = False,
) -> None:
    """Write labelled segments as an EAF 3.0 file, with ELAN's colours beside it (`preferences.write_preferences`).

    The tiers are `affect@SIGNER` with a closed vocabulary and, dependent on it by symbolic association,
    `affect-confidence@SIGNER` and `intensity@SIGNER` where the segments have those columns.

    Parameters
    ----------
    path : path
        The `.eaf` to write.
    segments : Segments
        Labelled; times in seconds from the beginning of the video (a take's `start` is already in them).
    signer : str
        Names the tiers and is their participant. Empty for tiers without `@`.
    video : path or URL, optional
        The media file that the annotations belong to.
    properties : mapping, optional
        What the header says besides the tool and its version: `take`, `model`, `face`, ... Each is written as
        `signface:NAME`.
    vocabulary : Vocabulary
        The labels allowed on the affect tier.
    tiers : sequence of Tier
        Further tiers (`signface.label.channels`).
    linked_files : sequence of path
        Curves and their description, linked as secondary files (`.csv` as text/plain, `.xml` as text/xml).
    date : datetime or str, optional
        The document's date (ISO 8601); now when not given. With a date, the same input gives the same bytes.
    author : str
    replace : bool
        Overwrite a file that holds more than signface's own unmodified output. The previous file is then kept
        beside it as `.bak`.

    Raises
    ------
    SignfaceError
        The segments carry no label or one outside the vocabulary; the file exists and someone has worked in it; it
        cannot be written.
    """
    file = Path(path)
    all_tiers = (affect_tier(segments, signer, vocabulary=vocabulary), *tiers)
    details = {"take": segments.name, **(properties or {})}
    if segments.history and "history" not in details:
        details["history"] = "; ".join(segments.history)
    root = build_document(
        all_tiers, file, video=video, properties=details, linked_files=linked_files, date=date, author=author
    )
    guard(file, root, replace=replace)
    write_document(etree.ElementTree(root), file)
    from signface.elan.preferences import write_preferences

    write_preferences(file.with_suffix(".pfsx"), all_tiers)


def guard(file: Path, root: etree._Element, *, replace: bool) -> None:
    """Refuse to overwrite what an annotator made, and keep what is overwritten.

    Our own output that nobody touched is overwritten; a backup is kept where its annotations differ from the new
    ones.

    Raises
    ------
    SignfaceError
        The file exists, is not our own unmodified output, and `replace` is False.
    """
    if not file.exists():
        return
    try:
        previous = read_document(file).getroot()
    except SignfaceError:
        previous = None  # not an EAF of ours, whatever it is
    if previous is None or not is_unmodified_output(previous):
        if not replace:
            raise SignfaceError(
                "exists and holds annotations that signface did not write or that were corrected since",
                file=file,
                hint="write to another file, or ask for it to be replaced (--replace); it is then kept as a backup",
            )
        back_up(file)
    elif recorded(previous) != tier_rows(root):
        back_up(file)


def build_document(
    tiers: Sequence[Tier],
    file: Path,
    *,
    video: str | PathLike[str] | None,
    properties: Mapping[str, str],
    linked_files: Sequence[str | PathLike[str]],
    date: datetime.datetime | str | None,
    author: str,
) -> etree._Element:
    """The document's root element, complete and valid; nothing is written."""
    root = etree.Element("ANNOTATION_DOCUMENT", nsmap={"xsi": XSI})
    root.set("AUTHOR", author)
    root.set("DATE", iso_date(date))
    root.set("FORMAT", "3.0")
    root.set("VERSION", "3.0")
    root.set(f"{{{XSI}}}noNamespaceSchemaLocation", SCHEMA_URL)

    header = etree.SubElement(root, "HEADER", MEDIA_FILE="", TIME_UNITS="milliseconds")
    if video is not None:
        add_media(header, video, file)
    for linked in linked_files:
        add_link(header, linked, file)

    slots = TimeSlots()
    tier_elements: list[etree._Element] = []
    count = 0
    for tier in tiers:
        built, count = tier_as_elements(tier, slots, count)
        tier_elements.extend(built)
    root.append(slots.element())
    root.extend(tier_elements)
    add_types(root, tiers)
    etree.SubElement(root, "LOCALE", COUNTRY_CODE="US", LANGUAGE_CODE="en")
    etree.SubElement(root, "LANGUAGE", LANGUAGE)
    for stereotype, description in CONSTRAINTS.items():
        etree.SubElement(root, "CONSTRAINT", STEREOTYPE=stereotype, DESCRIPTION=description)
    for vocabulary in vocabularies_of(tiers):
        root.append(vocabulary_element(vocabulary))

    records = tier_rows(root)
    content = "\n".join([root.get("DATE") or "", *(f"{name} {written_record(rows)}" for name, rows in records.items())])
    set_property(root, "URN", f"urn:nl-mpi-tools-elan-eaf:{uuid.uuid5(uuid.NAMESPACE_URL, content)}")
    set_property(root, "lastUsedAnnotationId", str(count))
    add_own_properties(root, properties)
    for name, rows in records.items():
        set_property(root, WRITTEN_PREFIX + name, written_record(rows))
    return root


def add_own_properties(root: etree._Element, properties: Mapping[str, str]) -> None:
    """Header properties that say what wrote the file and from what."""
    set_property(root, f"{PROPERTY_PREFIX}tool", "signface")
    set_property(root, f"{PROPERTY_PREFIX}version", version("signface"))
    for name, value in properties.items():
        set_property(root, PROPERTY_PREFIX + name, xml_text(str(value)))


class TimeSlots:
    """Time slots, numbered in the order of time when all are known."""

    def __init__(self) -> None:
        self._slots: list[tuple[int, etree._Element, str]] = []

    def add(self, value: int, annotation: etree._Element, attribute: str) -> None:
        """Ask for a slot at `value` ms; its id is set on the annotation's attribute by `element`."""
        self._slots.append((value, annotation, attribute))

    def element(self) -> etree._Element:
        """TIME_ORDER with the slots in order; sets the references to them."""
        order = etree.Element("TIME_ORDER")
        for number, (value, annotation, attribute) in enumerate(sorted(self._slots, key=lambda slot: slot[0]), start=1):
            identifier = f"ts{number}"
            etree.SubElement(order, "TIME_SLOT", TIME_SLOT_ID=identifier, TIME_VALUE=str(value))
            annotation.set(attribute, identifier)
        return order


def tier_as_elements(tier: Tier, slots: TimeSlots, count: int) -> tuple[list[etree._Element], int]:
    """TIER elements of a tier and its dependents; annotation ids go on from `count`, whose new value is returned."""
    parent = etree.Element("TIER", TIER_ID=tier.name, LINGUISTIC_TYPE_REF=tier.type_name)
    if tier.participant:
        parent.set("PARTICIPANT", tier_text(tier.participant))
    parent.set("ANNOTATOR", "signface")
    entries = {} if tier.vocabulary is None else {entry.value: entry.identifier for entry in tier.vocabulary.entries}
    identifiers = []
    for start, end, value in zip(tier.start_ms, tier.end_ms, tier.values):
        count += 1
        identifiers.append(f"a{count}")
        annotation = etree.SubElement(etree.SubElement(parent, "ANNOTATION"), "ALIGNABLE_ANNOTATION")
        annotation.set("ANNOTATION_ID", identifiers[-1])
        if value in entries:
            annotation.set("CVE_REF", entries[value])
        slots.add(int(start), annotation, "TIME_SLOT_REF1")
        slots.add(int(end), annotation, "TIME_SLOT_REF2")
        etree.SubElement(annotation, "ANNOTATION_VALUE").text = value
    elements = [parent]
    for dependent in tier.dependents:
        child = etree.Element(
            "TIER", TIER_ID=dependent.name, LINGUISTIC_TYPE_REF=dependent.type_name, PARENT_REF=tier.name
        )
        if tier.participant:
            child.set("PARTICIPANT", tier_text(tier.participant))
        child.set("ANNOTATOR", "signface")
        known = {entry.value: entry.identifier for entry in dependent.vocabulary.entries} if dependent.vocabulary else {}
        for identifier, value in zip(identifiers, dependent.values):
            if value is None:
                continue
            count += 1
            annotation = etree.SubElement(etree.SubElement(child, "ANNOTATION"), "REF_ANNOTATION")
            annotation.set("ANNOTATION_ID", f"a{count}")
            annotation.set("ANNOTATION_REF", identifier)
            if value in known:
                annotation.set("CVE_REF", known[value])
            etree.SubElement(annotation, "ANNOTATION_VALUE").text = value
        elements.append(child)
    return elements, count


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


def iso_date(date: datetime.datetime | str | None) -> str:
    """A date as `xsd:dateTime` with its zone; now when None.

    Raises
    ------
    SignfaceError
        The text is no ISO 8601 date.
    """
    if isinstance(date, str):
        try:
            date = datetime.datetime.fromisoformat(date)
        except ValueError as error:
            raise SignfaceError(f"{date} is no date", hint="write it as 2026-01-31T12:00:00+00:00") from error
    moment = datetime.datetime.now().astimezone() if date is None else date
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=datetime.UTC)
    return moment.isoformat(timespec="seconds")


def xml_text(text: str) -> str:
    """Text without the control characters that XML cannot hold."""
    return "".join(c if c in "\t\n" or c.isprintable() else " " for c in text)


def tier_text(text: str) -> str:
    """A name as it stands in an attribute: printable, single spaces."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
