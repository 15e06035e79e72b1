"""`write_eaf`: labelled segments as an EAF 3.0 file of its own."""

from __future__ import annotations

import datetime
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
    fresh_ids,
    is_unmodified_output,
    iso_date,
    last_annotation_number,
    read_document,
    recorded,
    set_property,
    tier_rows,
    write_document,
    written_record,
)
from signface.elan.elements import (
    CONSTRAINTS,
    LANGUAGE,
    TimeSlots,
    add_link,
    add_media,
    add_types,
    tier_elements,
    vocabularies_of,
    vocabulary_element,
)
from signface.elan.preferences import write_preferences
from signface.elan.tiers import Tier, affect_tier, xml_text
from signface.elan.vocabularies import AFFECT, Vocabulary
from signface.errors import SignfaceError
from signface.segment.segments import Segments


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
    check_writable(file, replace=replace)
    all_tiers = (affect_tier(segments, signer, vocabulary=vocabulary), *tiers)
    details = {"take": segments.name, **(properties or {})}
    if segments.history and "history" not in details:
        details["history"] = "; ".join(segments.history)
    root = build_document(
        all_tiers, file, video=video, properties=details, linked_files=linked_files, date=date, author=author
    )
    _keep_previous(file, root)
    write_document(etree.ElementTree(root), file)
    curves = next((linked for linked in linked_files if str(linked).endswith(".csv")), None)
    write_preferences(file.with_suffix(".pfsx"), all_tiers, curves=curves)


def check_writable(path: str | PathLike[str], *, replace: bool = False) -> None:
    """Refuse, before anything is written, to overwrite what an annotator made.

    Raises
    ------
    SignfaceError
        The file exists, is not our own unmodified output, and `replace` is False.
    """
    file = Path(path)
    if not replace and file.exists() and not _untouched(file):
        raise SignfaceError(
            "exists and holds annotations that signface did not write or that were corrected since",
            file=file,
            hint="write to another file, or ask for it to be replaced (--replace); it is then kept as a backup",
        )


def _untouched(file: Path) -> bool:
    """Whether a file that is there is our own output which nobody has changed."""
    try:
        return is_unmodified_output(read_document(file).getroot())
    except SignfaceError:
        return False  # not an EAF of ours, whatever it is


def _keep_previous(file: Path, root: etree._Element) -> None:
    """Keep the file that is about to be overwritten, unless it is our own output with the same annotations."""
    if file.is_file() and not (_untouched(file) and recorded(read_document(file).getroot()) == tier_rows(root)):
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

    fresh_id = fresh_ids(root)
    slots = TimeSlots(fresh_id)
    order = etree.SubElement(root, "TIME_ORDER")
    for tier in tiers:
        root.extend(tier_elements(tier, slots, fresh_id))
    slots.place(order)
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
    set_property(root, "lastUsedAnnotationId", str(last_annotation_number(root)))
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
