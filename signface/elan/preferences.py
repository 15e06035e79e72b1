"""ELAN's preferences file (`.pfsx`): colours of vocabulary entries and tiers, and the panels of the timeseries viewer.

EAF itself has no place for colours. ELAN keeps them beside the file, in the preference group `CV.ML.Prefs`:
vocabulary, entry id, `Color` as `r,g,b` (`PreferencesWriter` and `PrefObjectConverter` in ELAN's sources). Which
curves are drawn is kept there too (`TimeSeriesViewer`); without it the viewer opens empty.

ELAN writes this file when it opens an EAF, so that most files have one. What is in it is an annotator's and stays;
what is missing is added.

- `write_preferences`: colours and panels into the file.
- `carry_over`: colours and keys of a file before EAF 2.8, which ELAN would drop.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from itertools import cycle
from os import PathLike
from pathlib import Path

from lxml import etree

from signface.elan.curves import CURVES, panels
from signface.elan.document import XSI, named, parse_xml, write_document
from signface.elan.elements import entry_identifier
from signface.elan.merging import OURS
from signface.elan.tiers import Tier, tier_name
from signface.elan.vocabularies import vocabulary_entries
from signface.errors import SignfaceError, SignfaceWarning
from signface.label.vocabulary import PALETTE, Colour, Vocabulary

PREFERENCES_SCHEMA = "http://www.mpi.nl/tools/elan/Prefs_v1.1.xsd"

#: Height of the panels of curves in pixels: on a screen of 768 lines the tiers still have their place. ELAN's own is
#: too low to read more than one panel; it takes no lower one, so that a lower one is nobody's choice.
CURVES_HEIGHT = 300
ELANS_HEIGHT = 70

#: The order in which channels get their colours, so that one has the same in every file.
CHANNELS = ("affect", "brows", "eyes", "mouth", "head", "nose", "cheeks", "blinks", "gaze", "clause")


def write_preferences(
    path: str | PathLike[str],
    tiers: Sequence[Tier],
    *,
    root: etree._Element | None = None,
    curves: str | PathLike[str] | None = None,
    old: bool = False,
    template: str | PathLike[str] | None = None,
) -> None:
    """Write the colours of the tiers and of their vocabularies, and the panels of the curves, where there are none yet.

    Parameters
    ----------
    path : path
        Beside the EAF, with the same stem.
    tiers : sequence of Tier
    root : element, optional
        The document, which says what our tiers and vocabularies are called in it.
    curves : path, optional
        The curves file linked from the EAF.
    old : bool
        Whether the document was of a format before EAF 2.8 and is not any more.
    template : path, optional
        The template of a new file, whose preferences are taken over, as ELAN does.

    Warns
    -----
    SignfaceWarning
        The preferences that are there cannot be read; they are left as they are.
    """
    file = Path(path)
    try:
        preferences = _read(file) if file.exists() else _new(template)
    except SignfaceError as error:
        warnings.warn(f"{error}; colours and panels of the curves are not written", SignfaceWarning, stacklevel=2)
        return
    before = etree.tostring(preferences)
    if root is not None and old:
        carry_over(root, preferences)
    for name, vocabulary in _vocabularies(tiers, root):
        for entry in vocabulary.entries:
            if entry.colour is not None:
                place = _group(preferences, "CV.ML.Prefs", name, entry_identifier(entry.value))
                _add_colour(place, "Color", entry.colour)
    for name, colour in _tier_colours(tiers, root).items():
        _add_colour(_group(preferences, "TierColors"), name, colour)
    if curves is not None:
        _add_panels(preferences, panels(curves))
    if etree.tostring(preferences) != before or not file.exists():
        write_document(preferences.getroottree(), file)


def carry_over(root: etree._Element, preferences: etree._Element) -> None:
    """Bring colours and keys of vocabularies' entries to where ELAN looks for them from EAF 2.8 on.

    Before, entries were known by their value (`CV.Prefs`); ELAN brings them to their identifiers (`CV.ML.Prefs`) only
    while it loads an old file, and drops them from a newer one.

    Parameters
    ----------
    root : element
        The document as EAF 3.0.
    preferences : element
        Changed in place.
    """
    for group in preferences.iterfind("prefGroup[@key='CV.Prefs']/prefGroup"):
        vocabulary = named(root, "CONTROLLED_VOCABULARY", group.get("key"))
        known: dict[str, str] = {}
        for value, _, identifier in () if vocabulary is None else vocabulary_entries(vocabulary, None):
            known.setdefault(value, identifier)
        for entry in group.iterfind("prefGroup"):
            chosen = known.get(entry.get("key") or "")
            if not chosen:
                continue
            place = _group(preferences, "CV.ML.Prefs", group.get("key") or "", chosen)
            there = {preference.get("key") for preference in place}
            for preference in entry:
                if isinstance(preference.tag, str) and preference.get("key") not in there:
                    place.append(etree.fromstring(etree.tostring(preference)))


def _read(file: Path) -> etree._Element:
    root = parse_xml(file).getroot()
    if root.tag != "preferences":
        raise SignfaceError(f"holds no preferences of ELAN (its root is {root.tag})", file=file)
    return root


def _new(template: str | PathLike[str] | None) -> etree._Element:
    """Preferences of a new file: those of the template it is made from, or empty ones."""
    if template is not None and (beside := Path(template).with_suffix(".pfsx")).is_file():
        return _read(beside)
    root = etree.Element("preferences", nsmap={"xsi": XSI}, version="1.1")
    root.set(f"{{{XSI}}}noNamespaceSchemaLocation", PREFERENCES_SCHEMA)
    etree.SubElement(root, "prefGroup", key="CV.ML.Prefs")
    return root


def _group(parent: etree._Element, *keys: str) -> etree._Element:
    """The group of these keys, one in the other; made where it is not there."""
    for key in keys:
        found = next((group for group in parent.iterfind("prefGroup") if group.get("key") == key), None)
        parent = etree.SubElement(parent, "prefGroup", key=key) if found is None else found
    return parent


def _add_colour(group: etree._Element, key: str, colour: Colour) -> None:
    if any(preference.get("key") == key for preference in group.iterfind("pref")):
        return
    element = etree.SubElement(etree.SubElement(group, "pref", key=key), "Object")
    element.set("class", "java.awt.Color")
    element.text = ",".join(map(str, colour))


def _vocabularies(tiers: Iterable[Tier], root: etree._Element | None) -> Iterator[tuple[str, Vocabulary]]:
    """Our vocabularies, each once, with the names they have in the document; those that it does not hold left out."""
    done = set()
    for tier in tiers:
        for vocabulary in (tier.vocabulary, *(child.vocabulary for child in tier.dependents)):
            if vocabulary is None or vocabulary.name in done:
                continue
            done.add(vocabulary.name)
            ours = {entry_identifier(value) for value in vocabulary.allowed}
            for name in (vocabulary.name, vocabulary.name + OURS):
                element = None if root is None else named(root, "CONTROLLED_VOCABULARY", name)
                held = set() if element is None else {entry.get("CVE_ID") for entry in element.iterfind("CV_ENTRY_ML")}
                if root is None or held >= ours:
                    yield name, vocabulary
                    break


def _tier_colours(tiers: Iterable[Tier], root: etree._Element | None) -> dict[str, Colour]:
    """A colour for each tier of ours and the ones that hang on it; a lab's own tiers keep theirs."""
    colours = {}
    others = cycle(PALETTE)
    for tier in tiers:
        place = CHANNELS.index(tier.channel) if tier.channel in CHANNELS else None
        red, green, blue = next(others) if place is None else PALETTE[place % len(PALETTE)]
        # Names are written in these colours on white: the palette's lighter ones would be hard to read.
        colour = (round(red * 0.7), round(green * 0.7), round(blue * 0.7))
        for name in (tier.name, *(tier_name(child.channel, tier.signer) for child in tier.dependents)):
            element = None if root is None else named(root, "TIER", name)
            if element is not None and element.get("ANNOTATOR") == "signface":
                colours[name] = colour
    return colours


def _add_panels(preferences: etree._Element, drawn: dict[int, list[str]]) -> None:
    """The panels of the curves, where the viewer shows none; and the height that lets them be read."""
    renamed = {column: curve.name for column, curve in CURVES.items()}
    shown = [
        text
        for tracks in preferences.iterfind("prefList")
        if (tracks.get("key") or "").startswith("TimeSeriesViewer.Panel-")
        for text in tracks.iterfind("String")
    ]
    for text in shown:  # files of before curves had names of their own
        text.text = renamed.get(text.text or "", text.text or "")
    if any((text.text or "").strip() for text in shown):
        return
    for old in [*preferences.iterfind("prefList"), *preferences.iterfind("pref")]:
        if (old.get("key") or "").startswith(("TimeSeriesViewer.Panel-", "TimeSeriesViewer.NumberOfPanels")):
            preferences.remove(old)
    count = etree.SubElement(preferences, "pref", key="TimeSeriesViewer.NumberOfPanels")
    etree.SubElement(count, "Int").text = str(len(drawn))
    for number, names in enumerate(drawn.values(), start=1):
        tracks = etree.SubElement(preferences, "prefList", key=f"TimeSeriesViewer.Panel-{number}")
        for name in names:
            etree.SubElement(tracks, "String").text = name
    key = "LayoutManager.SplitPaneDividerLocation"
    height = next((preference for preference in preferences.iterfind("pref") if preference.get("key") == key), None)
    if height is None:
        height = etree.SubElement(preferences, "pref", key=key)
    number = height.find("Int")
    if number is None:
        number = etree.SubElement(height, "Int")
    if not (number.text or "").strip().isdecimal() or int(number.text or 0) <= ELANS_HEIGHT:
        number.text = str(CURVES_HEIGHT)
