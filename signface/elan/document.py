"""EAF as XML: safe reading, whole writing, links to media, and the record of what signface wrote.

- `named`: an element by its name.
- `read_document`: the tree of an EAF 2.5 to 3.0, or one clear error; `parse_xml`: of any of ELAN's files.
- `file_of`: the file that a document was read from.
- `write_document`: indented UTF-8, whole or not at all.
- `link_urls`: absolute and relative URL of a linked file, as ELAN resolves them.
- `written_record`, `recorded`: what signface wrote on a tier, kept in the header so that corrections can be told.
"""

from __future__ import annotations

import datetime
import json
import os
import re
import shutil
from collections.abc import Callable
from itertools import takewhile
from os import PathLike
from pathlib import Path, PurePath, PureWindowsPath

from lxml import etree

from signface.elan.times import annotation_spans
from signface.errors import SignfaceError
from signface.files import reading, whole_file

XSI = "http://www.w3.org/2001/XMLSchema-instance"
SCHEMA_URL = "http://www.mpi.nl/tools/elan/EAFv3.0.xsd"

#: Prefix of our own header properties.
PROPERTY_PREFIX = "signface:"
WRITTEN_PREFIX = f"{PROPERTY_PREFIX}written:"
CHANNEL_PREFIX = f"{PROPERTY_PREFIX}channel:"

#: Attribute that identifies an element, for those whose identifiers must be unique among their like.
NAMES = {
    "TIER": "TIER_ID",
    "LINGUISTIC_TYPE": "LINGUISTIC_TYPE_ID",
    "CONTROLLED_VOCABULARY": "CV_ID",
    "LANGUAGE": "LANG_ID",
    "EXTERNAL_REF": "EXT_REF_ID",
    "LEXICON_REF": "LEX_REF_ID",
    "LOCALE": "LANGUAGE_CODE",
    "CONSTRAINT": "STEREOTYPE",
}

#: Start and end in milliseconds (None where the file leaves them open) and value of an annotation.
Row = tuple[int | None, int | None, str]


def named(root: etree._Element, tag: str, name: str | None) -> etree._Element | None:
    """The first element of a tag (one of `NAMES`) that has this name."""
    return next((element for element in root.iterfind(tag) if element.get(NAMES[tag]) == name), None)


def read_document(path: str | PathLike[str]) -> etree._ElementTree:
    """Parse an EAF (or its template, .etf) without resolving entities or touching the network.

    Raises
    ------
    SignfaceError
        The file is missing, is not XML, declares entities of its own, is not an EAF, or has times that are no numbers.
    """
    file = Path(path)
    tree = parse_xml(file)
    root = tree.getroot()
    if root.tag != "ANNOTATION_DOCUMENT":
        raise SignfaceError(f"is XML but no EAF (its root is {root.tag})", file=file)
    for tag in ("HEADER", "TIME_ORDER"):
        if root.find(tag) is None:
            raise SignfaceError(f"is no complete EAF (no {tag})", file=file)
    for slot in root.iterfind("TIME_ORDER/TIME_SLOT"):
        value = slot.get("TIME_VALUE")
        if value is not None and not value.strip().isdecimal():
            raise SignfaceError(
                f"time slot {slot.get('TIME_SLOT_ID')} has the time {value!r}, which is no count of milliseconds",
                file=file,
            )
    return tree


def parse_xml(path: str | PathLike[str]) -> etree._ElementTree:
    """Parse any of ELAN's files without resolving entities or touching the network.

    Raises
    ------
    SignfaceError
        The file is missing, is not XML, or declares entities of its own.
    """
    file = Path(path)
    if file.is_dir():
        raise SignfaceError("is a folder, not an EAF", file=file)
    # Entities are refused, not resolved: an EAF has no use for them, and a nested one can fill the memory.
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=True)
    try:
        with reading(file), file.open("rb") as stream:
            tree = etree.parse(stream, parser)
    except etree.XMLSyntaxError as error:
        if "entity amplification" in (error.msg or ""):
            raise SignfaceError("holds XML entities that swell without end", file=file) from error
        reason = (error.msg or "nothing in it").splitlines()[0]
        raise SignfaceError(
            f"is not well-formed XML ({reason})", file=file, hint="open it in ELAN, or go back to a backup of it"
        ) from error
    if tree.docinfo.internalDTD is not None:
        raise SignfaceError("declares a document type or entities of its own, which no EAF does", file=file)
    tree.docinfo.URL = str(file)  # what it links relatively is looked for beside it
    return tree


def file_of(root: etree._Element) -> Path | None:
    """The file that a document was read from; None for one that was made here."""
    url = root.getroottree().docinfo.URL
    return None if url is None else Path(url)


def write_document(tree: etree._ElementTree, path: str | PathLike[str]) -> None:
    """Write the tree as indented UTF-8, whole or not at all."""
    etree.indent(tree, space="    ")
    with whole_file(path) as temporary, temporary.open("wb") as stream:  # given a path, lxml takes a % in it for a URL
        tree.write(stream, xml_declaration=True, encoding="UTF-8")


def back_up(path: str | PathLike[str]) -> Path:
    """Copy a file beside itself as NAME.bak, .bak1, .bak2, ...: an earlier backup is never overwritten.

    Returns
    -------
    Path
        The backup; an existing one when it holds the same bytes already.
    """
    file = Path(path)
    content = file.read_bytes()
    number = 0
    while True:
        backup = file.with_name(f"{file.name}.bak{number or ''}")
        if not backup.exists():
            shutil.copy2(file, backup)
            return backup
        if backup.read_bytes() == content:
            return backup
        number += 1


def link_urls(file: str | PathLike[str], beside: str | PathLike[str]) -> tuple[str, str | None]:
    """Absolute and relative URL of a linked file.

    ELAN turns a `file:` URL into a path by cutting off its scheme, without decoding (`FileUtility.urlToAbsPath` in
    its sources), and writes spaces and accents as they are. So do we; only what is no URI at all under the schema
    (`%`, `#`, square brackets) is percent-encoded. A URL (`http://...`) is kept as it is.

    Parameters
    ----------
    file : path or URL
        The linked file; it need not exist.
    beside : path
        The EAF that will hold the link.

    Returns
    -------
    absolute : str
        `file:///...`
    relative : str or None
        `./...` or `../...`; None where there is no way from one to the other (two Windows drives, a URL).
    """
    text = os.fspath(file)
    if re.match(r"^[a-zA-Z][a-zA-Z0-9+.-]+://", text):
        return text, None
    target: PurePath
    folder: PurePath
    if isinstance(file, PureWindowsPath):  # a path of another machine: it cannot be made absolute here
        target, folder = file, PureWindowsPath(beside).parent
    else:
        target, folder = PurePath(os.path.abspath(text)), PurePath(os.path.abspath(Path(beside).parent))
    absolute = target.as_posix()
    if absolute.startswith("//"):  # a Windows share: two slashes belong to its name
        return "file:" + _escape(absolute), _relative(target, folder)
    return "file:///" + _escape(absolute.lstrip("/")), _relative(target, folder)


def _relative(target: PurePath, folder: PurePath) -> str | None:
    if target.anchor != folder.anchor:
        return None
    common = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(target.parts, folder.parts)))
    steps = [".."] * (len(folder.parts) - common) or ["."]
    return _escape("/".join([*steps, *target.parts[common:]]))


def _escape(text: str) -> str:
    return "".join(f"%{ord(c):02X}" if c in "%#[]" else c for c in text)


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


def set_property(root: etree._Element, name: str, value: str) -> None:
    """Set a header property, keeping the place of one that is there."""
    element = _property(root, name)
    if element is None:
        element = etree.SubElement(root.find("HEADER"), "PROPERTY", NAME=name)
    element.text = value


def get_property(root: etree._Element, name: str) -> str | None:
    """Text of a header property, or None."""
    element = _property(root, name)
    return None if element is None else element.text or ""


def _property(root: etree._Element, name: str) -> etree._Element | None:
    return next((element for element in root.iterfind("HEADER/PROPERTY") if element.get("NAME") == name), None)


def fresh_ids(root: etree._Element) -> Callable[[str], str]:
    """A function that gives unused identifiers (`fresh("a")`, `fresh("ts")`), numbered after those in use."""
    used = {
        element.get(attribute)
        for element in root.iter("TIME_SLOT", "ALIGNABLE_ANNOTATION", "REF_ANNOTATION", *OTHER_IDENTIFIERS)
        for attribute in ("TIME_SLOT_ID", "ANNOTATION_ID", *OTHER_IDENTIFIERS.values())
    }
    last = {"a": _last_number(root), "ts": 0}
    for identifier in used:
        match = re.fullmatch(r"(a|ts)(\d+)", identifier or "")
        if match:
            last[match[1]] = max(last[match[1]], int(match[2]))

    def fresh(prefix: str) -> str:
        last[prefix] += 1
        while f"{prefix}{last[prefix]}" in used:
            last[prefix] += 1
        return f"{prefix}{last[prefix]}"

    return fresh


#: Elements whose identifiers share one space with those of annotations and time slots (xsd:ID).
OTHER_IDENTIFIERS = {
    "LOCALE": "LANGUAGE_CODE",
    "LANGUAGE": "LANG_ID",
    "CONSTRAINT": "STEREOTYPE",
    "EXTERNAL_REF": "EXT_REF_ID",
    "LEXICON_REF": "LEX_REF_ID",
    "REF_LINK_SET": "LINK_SET_ID",
    "CROSS_REF_LINK": "REF_LINK_ID",
    "GROUP_REF_LINK": "REF_LINK_ID",
}


def _last_number(root: etree._Element) -> int:
    """The number that ELAN remembers as last used, so that identifiers of deleted annotations do not come back."""
    remembered = (get_property(root, "lastUsedAnnotationId") or "").strip()
    return int(remembered) if remembered.isdigit() else 0


def last_annotation_number(root: etree._Element) -> int:
    """The highest number of an annotation `aNUMBER`, or the one remembered in the header when that is higher."""
    numbers = [
        int(match[1])
        for annotation in root.iterfind("TIER/ANNOTATION/*")
        if (match := re.fullmatch(r"a(\d+)", annotation.get("ANNOTATION_ID") or ""))
    ]
    return max([*numbers, _last_number(root)])


def written_record(rows: list[Row]) -> str:
    """What is kept of a tier in the header: its annotations as compact JSON `[[start, end, value], ...]`."""
    return json.dumps([list(row) for row in rows], ensure_ascii=False, separators=(",", ":"))


def recorded(root: etree._Element) -> dict[str, list[Row]]:
    """Tier names and the annotations that signface wrote on them, as kept in the header.

    A record that cannot be read (someone edited it) is left out, so that its tier counts as the annotator's.
    """
    records = {}
    for element in root.findall("HEADER/PROPERTY"):
        name = element.get("NAME") or ""
        if not name.startswith(WRITTEN_PREFIX):
            continue
        try:
            rows = [(row[0], row[1], str(row[2])) for row in json.loads(element.text or "")]
        except (ValueError, TypeError, IndexError, KeyError):
            continue
        records[name[len(WRITTEN_PREFIX) :]] = rows
    return records


def tier_rows(root: etree._Element) -> dict[str, list[Row]]:
    """Every tier's annotations as (start, end, value), milliseconds, in the order of time.

    Times that the file leaves open are those that ELAN gives them (`times.annotation_spans`).
    Annotations whose references dangle have no times; `checking.check_document` names them.
    """
    spans = annotation_spans(root)
    rows: dict[str, list[Row]] = {}
    for tier in root.iterfind("TIER"):
        annotations = [
            (*spans.get(annotation.get("ANNOTATION_ID"), (None, None)), annotation.findtext("ANNOTATION_VALUE") or "")
            for annotation in tier.iterfind("ANNOTATION/*")
        ]
        annotations.sort(key=lambda row: (row[0] is None, row[0] or 0, row[1] or 0))
        rows[tier.get("TIER_ID") or ""] = annotations
    return rows


def is_unmodified_output(root: etree._Element) -> bool:
    """Whether signface wrote the whole document and nobody has changed an annotation or a tier since."""
    try:
        names = json.loads(get_property(root, f"{PROPERTY_PREFIX}tiers") or "")
    except ValueError:
        return False
    rows = tier_rows(root)
    filled = {name: held for name, held in rows.items() if held}
    return list(rows) == names and filled == {name: held for name, held in recorded(root).items() if held}
