"""Vocabularies read from what laboratories have: EAFs and their templates, shared `.ecv` files, text files.

- `read_vocabulary`: a `Vocabulary` from any of them.
- `write_vocabulary`: a text file of one, to be changed by hand.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterable, Iterator
from os import PathLike
from pathlib import Path

from lxml import etree

from signface.elan.document import file_of, named, parse_xml, read_document
from signface.elan.links import places_of
from signface.errors import SignfaceError
from signface.files import reading, whole_file
from signface.label.vocabulary import Colour, Entry, Vocabulary

#: Endings of what is read as XML; anything else is text.
XML_ENDINGS = (".eaf", ".etf", ".ecv")


def read_vocabulary(path: str | PathLike[str], *, tier: str | None = None, name: str | None = None) -> Vocabulary:
    """Read a vocabulary.

    - `.eaf`, `.etf`: the closed vocabulary of a tier, of a name, or the only one; its colours are those of the
      preferences (`.pfsx`) beside the file.
    - `.ecv`: the same of ELAN's external vocabularies.
    - Any other ending: text, one value a line; after tabs its description and its colour as `#rrggbb`, both optional.
      Empty lines are passed over, and what stands after a `#` at the beginning of a line describes the vocabulary.

    Values that are two others joined are transitions where all of them are there.

    Parameters
    ----------
    path : path
    tier : str, optional
        Name of a tier whose vocabulary is wanted.
    name : str, optional
        Of the vocabulary.

    Raises
    ------
    SignfaceError
        The file is missing, is none of these, has no such tier or vocabulary, or several; or the tier has none.

    Examples
    --------
    >>> from pathlib import Path
    >>> import signface as sf
    >>> file = Path("brows.txt")
    >>> _ = file.write_text("raised\\teyebrows raised\\nlowered\\n")
    >>> sf.read_vocabulary(file).values
    ('raised', 'lowered')
    """
    file = Path(path)
    try:
        if file.suffix.lower() not in XML_ENDINGS:
            return _from_text(file)
        if file.suffix.lower() == ".ecv":
            root = parse_xml(file).getroot()
        else:
            root = read_document(file).getroot()
        element = _chosen(root, tier, name, file)
        return _from_element(element, _language(root, tier), file)
    except SignfaceError as error:
        raise error.at(file) from error


def write_vocabulary(vocabulary: Vocabulary, path: str | PathLike[str]) -> None:
    """Write a vocabulary as text, which `read_vocabulary` reads; the file's name is the vocabulary's.

    Raises
    ------
    SignfaceError
        A value or description does not fit on a line, or the ending is one of ELAN's.
    """
    file = Path(path)
    if file.suffix.lower() in XML_ENDINGS:
        raise SignfaceError("vocabularies are written as text (.txt)", file=file)
    lines = [f"# {vocabulary.description}"] if vocabulary.description else []
    for entry in vocabulary.entries:
        cells = [entry.value, entry.description, "" if entry.colour is None else "#" + bytes(entry.colour).hex()]
        if entry.value.startswith("#") or any(cell != " ".join(cell.split()) for cell in cells):
            raise SignfaceError(f"{entry.value!r} and its description do not fit on a line of text", file=file)
        lines.append("\t".join(cells).rstrip("\t"))
    with whole_file(file) as temporary:
        temporary.write_text("\n".join(lines) + "\n", "utf-8")


def vocabulary_of_tier(root: etree._Element, tier: str, file: Path) -> Vocabulary | None:
    """The closed vocabulary of a tier of an EAF; None where it has none, or one that is kept elsewhere."""
    element = named(root, "CONTROLLED_VOCABULARY", vocabulary_name(root, named(root, "TIER", tier)))
    if element is not None and element.get("EXT_REF"):
        element = external_vocabulary(root, element)[0]
    if element is None or not any(vocabulary_entries(element, None)):
        return None
    return _from_element(element, _language(root, tier), file)


def external_vocabulary(root: etree._Element, element: etree._Element) -> tuple[etree._Element | None, str]:
    """The vocabulary that a document keeps in another file (`.ecv`), and where that is.

    The file is looked for where the document says, and by its name beside the document, since most documents hold the
    path of another machine. It is not fetched from the web.

    Returns
    -------
    vocabulary : element or None
        None where the file, or the vocabulary in it, is not here.
    where : str
        As the document has it.
    """
    reference = named(root, "EXTERNAL_REF", element.get("EXT_REF"))
    url = "" if reference is None else reference.get("VALUE") or ""
    document = file_of(root)
    if document is None:
        return None, url
    beside = document.with_name(url.replace("\\", "/").rpartition("/")[2] or "none")
    for place in (*places_of(url, document), beside):
        if place.is_file():
            with contextlib.suppress(SignfaceError):  # something else has that name
                found = named(parse_xml(place).getroot(), "CONTROLLED_VOCABULARY", element.get("CV_ID"))
                if found is not None:
                    return found, url
    return None, url


def _language(root: etree._Element, tier: str | None) -> str | None:
    element = named(root, "TIER", tier)
    return None if element is None else element.get("LANG_REF")


def _from_text(file: Path) -> Vocabulary:
    with reading(file):
        lines = file.read_text("utf-8-sig").splitlines()
    entries, comments = [], []
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        if line.startswith("#"):
            comments.append(line[1:].strip())
            continue
        value, description, colour, *more = [*(cell.strip() for cell in line.split("\t")), "", ""]
        if not value or any(more) or not re.fullmatch("(#[0-9a-fA-F]{6})?", colour):
            raise SignfaceError(
                f"line {number} is no value with a description and a colour: {line!r}",
                file=file,
                hint="write VALUE, a tab, DESCRIPTION, a tab, #rrggbb",
            )
        red_green_blue = tuple(bytes.fromhex(colour[1:]))
        entries.append(Entry(value, description, red_green_blue if colour else None))  # type: ignore[arg-type]
    values = [entry.value for entry in entries]
    twice = next((value for value in values if values.count(value) > 1), None)
    if twice is not None or not values:
        raise SignfaceError("holds no value" if twice is None else f"has {twice!r} twice", file=file)
    return Vocabulary.of(entries, file.stem, " ".join(comments))


def _chosen(root: etree._Element, tier: str | None, name: str | None, file: Path) -> etree._Element:
    """The vocabulary's element: that of the tier, of the name, or the only one."""
    elements = {element.get("CV_ID") or "": element for element in root.iterfind("CONTROLLED_VOCABULARY")}
    hint = f"its vocabularies are {', '.join(elements)}" if elements else "it has no vocabulary"
    if tier is not None and root.tag != "CV_RESOURCE":
        tiers = [element.get("TIER_ID") or "" for element in root.iterfind("TIER")]
        if tier not in tiers:
            raise SignfaceError(f"has no tier {tier}", file=file, hint=f"its tiers are {', '.join(tiers) or 'none'}")
        name = vocabulary_name(root, named(root, "TIER", tier))
        if name is None:
            raise SignfaceError(f"its tier {tier} has no closed vocabulary", file=file, hint=hint)
    if name is None and len(elements) != 1:
        raise SignfaceError("has several vocabularies" if elements else "has no vocabulary", file=file, hint=hint)
    element = elements.get(name) if name is not None else next(iter(elements.values()))
    if element is None:
        raise SignfaceError(f"has no vocabulary {name}", file=file, hint=hint)
    return element


def vocabulary_name(root: etree._Element, tier: etree._Element | None) -> str | None:
    """Name of the vocabulary of a tier's linguistic type."""
    kind = None if tier is None else named(root, "LINGUISTIC_TYPE", tier.get("LINGUISTIC_TYPE_REF"))
    return None if kind is None else kind.get("CONTROLLED_VOCABULARY_REF")


def vocabulary_entries(element: etree._Element, language: str | None) -> Iterator[tuple[str, str, str]]:
    """Value, description and identifier (`CVE_ID`) of each entry, in a language where the entry has it."""
    for entry in element.iterfind("CV_ENTRY_ML"):
        values = entry.findall("CVE_VALUE")
        chosen = next((value for value in values if value.get("LANG_REF") == language), values[0] if values else None)
        if chosen is not None:
            yield chosen.text or "", chosen.get("DESCRIPTION") or "", entry.get("CVE_ID") or ""
    for entry in element.iterfind("CV_ENTRY"):  # EAF 2.7 and before
        yield entry.text or "", entry.get("DESCRIPTION") or "", ""


def _from_element(element: etree._Element, language: str | None, file: Path) -> Vocabulary:
    name = element.get("CV_ID") or file.stem
    if element.get("EXT_REF"):
        found, where = external_vocabulary(element.getroottree().getroot(), element)
        if found is None:
            words = f"the vocabulary {name} is kept in {where or 'another file'}, which is not here"
            raise SignfaceError(words, file=file, hint="put the .ecv beside it, or read that")
        element = found
    colours = _colours(file.with_suffix(".pfsx"), name)
    rows = {value.strip(): rest for value, *rest in vocabulary_entries(element, language) if value.strip()}
    if not rows:
        raise SignfaceError(f"the vocabulary {name} has no value", file=file)
    described = element.find("DESCRIPTION")
    description = (described.text or "") if described is not None else element.get("DESCRIPTION") or ""
    entries = [Entry(value, words, colours.get(key or value)) for value, (words, key) in rows.items()]
    return Vocabulary.of(entries, name, description)


def _colours(preferences: Path, name: str) -> dict[str, Colour]:
    """Colour of each entry of a vocabulary in the preferences beside an EAF; none where they cannot be read.

    Entries are known by their identifier, and before EAF 2.8 by their value.
    """
    try:
        root = parse_xml(preferences).getroot()
    except SignfaceError:  # an annotator's preferences are not what was asked for
        return {}
    groups: Iterable[etree._Element] = (
        group for key in ("CV.Prefs", "CV.ML.Prefs") for group in root.iterfind(f"prefGroup[@key='{key}']/prefGroup")
    )
    colours: dict[str, Colour] = {}
    for group in groups:
        for entry in group.iterfind("prefGroup") if group.get("key") == name else ():
            match = re.fullmatch(r"(\d{1,3}),(\d{1,3}),(\d{1,3})", (entry.findtext("pref/Object") or "").strip())
            if match is not None and all(int(level) < 256 for level in match.groups()):
                red, green, blue = map(int, match.groups())
                colours[entry.get("key") or ""] = (red, green, blue)
    return colours
