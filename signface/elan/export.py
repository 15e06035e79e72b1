"""Labelled segments as EAF 3.0.

- `write_eaf`: a file of its own, from nothing or from a lab's template.
- `write_into`: into a file that is there, touching nothing but our own tiers.
- `prepare_eaf`, `prepare_into`: the same up to the writing, so that every reason to refuse comes before any file.
- `check_writable`: whether a file may be overwritten.
"""

from __future__ import annotations

import datetime
import json
import uuid
from collections.abc import Iterable, Sequence
from collections.abc import Mapping as MappingABC
from dataclasses import dataclass
from importlib.metadata import version
from os import PathLike
from pathlib import Path

from lxml import etree

from signface.elan.checking import check_document
from signface.elan.document import (
    PROPERTY_PREFIX,
    SCHEMA_URL,
    XSI,
    back_up,
    is_unmodified_output,
    iso_date,
    read_document,
    recorded,
    set_property,
    tier_rows,
    write_document,
)
from signface.elan.elements import CONSTRAINTS, add_link, add_media
from signface.elan.mapping import Mapping
from signface.elan.merging import put_tiers
from signface.elan.preferences import write_preferences
from signface.elan.tiers import Tier, affect_tier, xml_text
from signface.elan.upgrade import upgrade
from signface.elan.vocabularies import AFFECT, Vocabulary
from signface.errors import SignfaceError
from signface.segmentation.segments import Segments


def write_eaf(
    path: str | PathLike[str],
    segments: Segments,
    *,
    signer: str = "",
    video: str | PathLike[str] | None = None,
    properties: MappingABC[str, str] | None = None,
    vocabulary: Vocabulary = AFFECT,
    tiers: Sequence[Tier] = (),
    linked_files: Sequence[str | PathLike[str]] = (),
    template: str | PathLike[str] | None = None,
    mapping: Mapping | None = None,
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
        Further tiers (`tiers.doubtful_tier`, `signface.channels.rules`).
    linked_files : sequence of path
        Curves and their description, linked as secondary files (`.csv` as text/plain, `.xml` as text/xml).
    template : path, optional
        A lab's `.etf` or `.eaf`, whose tiers, types, vocabularies, languages and participants are taken over; of an
        `.eaf`, annotations and media are left behind.
    mapping : mapping of channel to ChannelRule, optional
        Which channel goes to which tier of the template (`mapping.read_mapping`).
    date : datetime or str, optional
        The document's date (ISO 8601); now when not given. With a date, the same input gives the same bytes.
    author : str
    replace : bool
        Overwrite a file that holds more than signface's own unmodified output. The previous file is then kept
        beside it as `.bak`.

    Raises
    ------
    SignfaceError
        The segments carry no label or one outside the vocabulary; the template or the mapping does not fit; the file
        exists and someone has worked in it; it cannot be written.
    """
    prepare_eaf(
        path,
        segments,
        signer=signer,
        video=video,
        properties=properties,
        vocabulary=vocabulary,
        tiers=tiers,
        linked_files=linked_files,
        template=template,
        mapping=mapping,
        date=date,
        author=author,
        replace=replace,
    ).store()


def write_into(
    eaf: str | PathLike[str],
    segments: Segments,
    *,
    signer: str = "",
    video: str | PathLike[str] | None = None,
    properties: MappingABC[str, str] | None = None,
    vocabulary: Vocabulary = AFFECT,
    tiers: Sequence[Tier] = (),
    linked_files: Sequence[str | PathLike[str]] = (),
    mapping: Mapping | None = None,
    date: datetime.datetime | str | None = None,
    replace: bool = False,
) -> bool:
    """Write labelled segments into an EAF that is there.

    Only our own tiers are added or replaced: every other tier, annotation, identifier, time slot, comment, property,
    licence, link, locale, lexicon and external reference stays as it is. Files of EAF 2.5 to 2.8 become 3.0. The
    previous file is kept as a backup; when nothing would change, nothing is written.

    Parameters
    ----------
    eaf : path
        Changed in place.
    segments, signer, video, properties, vocabulary, tiers, linked_files, mapping, date :
        As in `write_eaf`.
    replace : bool
        Overwrite what an annotator corrected in our tiers.

    Returns
    -------
    bool
        Whether the file was changed.

    Raises
    ------
    SignfaceError
        As `write_eaf`; or the file is broken (`checking.check_document`), a tier of ours was corrected, or
        annotations of others would be lost. The file is then as it was.
    """
    prepared = prepare_into(
        eaf,
        segments,
        signer=signer,
        video=video,
        properties=properties,
        vocabulary=vocabulary,
        tiers=tiers,
        linked_files=linked_files,
        mapping=mapping,
        date=date,
        replace=replace,
    )
    prepared.store()
    return prepared.changed


@dataclass(frozen=True)
class PreparedDocument:
    """A document that is complete and allowed to be written, and has not been yet.

    Parameters
    ----------
    file : Path
        Where it goes.
    tree : ElementTree
    tiers : tuple of Tier
        What is new in it, for the colours.
    linked_files : tuple of path
    keep_previous : bool
        Whether the file that is there is kept as a backup.
    changed : bool
        Whether there is anything to write.
    """

    file: Path
    tree: etree._ElementTree
    tiers: tuple[Tier, ...]
    linked_files: tuple[str | PathLike[str], ...]
    keep_previous: bool
    changed: bool = True

    def store(self) -> None:
        """Write the document, its colours, and the backup of what was there."""
        if not self.changed:
            return
        if self.keep_previous:
            back_up(self.file)
        write_document(self.tree, self.file)
        curves = next((linked for linked in self.linked_files if str(linked).endswith(".csv")), None)
        write_preferences(self.file.with_suffix(".pfsx"), self.tiers, curves=curves)


def prepare_eaf(
    path: str | PathLike[str],
    segments: Segments,
    *,
    signer: str,
    video: str | PathLike[str] | None,
    properties: MappingABC[str, str] | None,
    vocabulary: Vocabulary,
    tiers: Sequence[Tier],
    linked_files: Sequence[str | PathLike[str]],
    template: str | PathLike[str] | None,
    mapping: Mapping | None,
    date: datetime.datetime | str | None,
    author: str,
    replace: bool,
) -> PreparedDocument:
    """What `write_eaf` writes, before anything is written. Parameters and errors are those of `write_eaf`."""
    file = Path(path)
    check_writable(file, replace=replace)
    all_tiers = (affect_tier(segments, signer, vocabulary=vocabulary), *tiers)
    root = _new_document() if template is None else _read_template(template)
    root.set("AUTHOR", xml_text(author))
    root.set("DATE", iso_date(date))
    put_tiers(root, all_tiers, mapping=mapping, file=file if template is None else Path(template))
    _fill_header(root, file, segments, video, properties, linked_files)
    rows = tier_rows(root)
    content = json.dumps([root.get("DATE"), segments.name, rows], ensure_ascii=False)
    set_property(root, "URN", f"urn:nl-mpi-tools-elan-eaf:{uuid.uuid5(uuid.NAMESPACE_URL, content)}")
    set_property(root, f"{PROPERTY_PREFIX}tiers", json.dumps(list(rows), ensure_ascii=False))
    same = _untouched(file) and recorded(read_document(file).getroot()) == recorded(root)
    return PreparedDocument(
        file, etree.ElementTree(root), all_tiers, tuple(linked_files), keep_previous=file.is_file() and not same
    )


def prepare_into(
    eaf: str | PathLike[str],
    segments: Segments,
    *,
    signer: str,
    video: str | PathLike[str] | None,
    properties: MappingABC[str, str] | None,
    vocabulary: Vocabulary,
    tiers: Sequence[Tier],
    linked_files: Sequence[str | PathLike[str]],
    mapping: Mapping | None,
    date: datetime.datetime | str | None,
    replace: bool,
) -> PreparedDocument:
    """What `write_into` writes, before anything is written. Parameters and errors are those of `write_into`."""
    file = Path(eaf)
    tree = read_document(file)
    root = tree.getroot()
    check_document(root, file)
    all_tiers = (affect_tier(segments, signer, vocabulary=vocabulary), *tiers)
    upgrade(root)
    changed = put_tiers(root, all_tiers, mapping=mapping, replace=replace, file=file)
    if changed:
        _fill_header(root, file, segments, video, properties, linked_files)
        root.set("DATE", iso_date(date))
    return PreparedDocument(file, tree, all_tiers, tuple(linked_files), keep_previous=True, changed=changed)


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


def _new_document() -> etree._Element:
    """The root of a document without tiers."""
    root = etree.Element("ANNOTATION_DOCUMENT", nsmap={"xsi": XSI})
    root.set("FORMAT", "3.0")
    root.set("VERSION", "3.0")
    root.set(f"{{{XSI}}}noNamespaceSchemaLocation", SCHEMA_URL)
    etree.SubElement(root, "HEADER", MEDIA_FILE="", TIME_UNITS="milliseconds")
    etree.SubElement(root, "TIME_ORDER")
    etree.SubElement(root, "LOCALE", COUNTRY_CODE="US", LANGUAGE_CODE="en")
    for stereotype, description in CONSTRAINTS.items():
        etree.SubElement(root, "CONSTRAINT", STEREOTYPE=stereotype, DESCRIPTION=description)
    return root


def _read_template(template: str | PathLike[str]) -> etree._Element:
    """The root of a template as EAF 3.0, without annotations, time slots, links between annotations and media."""
    root = read_document(template).getroot()
    check_document(root, Path(template))
    upgrade(root)
    for annotation in root.findall("TIER/ANNOTATION"):
        annotation.getparent().remove(annotation)
    for element in [
        *root.findall("REF_LINK_SET"),
        *root.findall("TIME_ORDER/*"),
        *root.findall("HEADER/MEDIA_DESCRIPTOR"),
        *root.findall("HEADER/LINKED_FILE_DESCRIPTOR"),
        *root.findall("HEADER/PROPERTY"),
    ]:
        element.getparent().remove(element)
    return root


def _fill_header(
    root: etree._Element,
    file: Path,
    segments: Segments,
    video: str | PathLike[str] | None,
    properties: MappingABC[str, str] | None,
    linked_files: Iterable[str | PathLike[str]],
) -> None:
    """Media, links, and the properties that say what wrote the tiers and from what."""
    header = root.find("HEADER")
    if video is not None:
        add_media(header, video, file)
    for linked in linked_files:
        add_link(header, linked, file)
    details = {"tool": "signface", "version": version("signface"), "take": segments.name, **(properties or {})}
    if segments.history:
        details.setdefault("history", "; ".join(segments.history))
    for name, value in details.items():
        set_property(root, PROPERTY_PREFIX + name, xml_text(str(value)))
