"""Links of an EAF to its film and its curves: each once, and found again where a file or a folder has moved.

- `find_media`: which of the films of a document a file is; `places_of`: where a URL leads on this machine.
- `film_origin`, `media_origins`: where the annotations' time 0 lies in a film (`TIME_ORIGIN`).
- `link_media`: a film; `link_curves`: the curves and their description.
- `curve_files`: which files the curves of an EAF go to; `warn_of_curves`: where ELAN will not show them.

An EAF names a file twice: by the absolute path of the machine that wrote it, and by the way to it from the EAF's own
folder. Most shared files hold absolute paths of other machines. ELAN tries both, then looks for the name in the EAF's
folder; so does signface before it takes a file for one that is not linked.
"""

from __future__ import annotations

import mimetypes
import os
import re
import unicodedata
import warnings
from collections.abc import Sequence
from os import PathLike, fspath
from pathlib import Path
from urllib.parse import unquote

from lxml import etree

from signface.elan.document import link_urls
from signface.errors import SignfaceError, SignfaceWarning

#: What ELAN knows a description of curves by, and what ours describes.
TSCONF = "_tsconf.xml"
CURVES_ENDING = ".curves.csv"

#: Absolute and relative URL of an element.
MEDIA = ("MEDIA_URL", "RELATIVE_MEDIA_URL")
LINK = ("LINK_URL", "RELATIVE_LINK_URL")


def find_media(header: etree._Element, video: str | PathLike[str], file: Path) -> etree._Element | None:
    """The MEDIA_DESCRIPTOR of a film; None where the document at `file` does not link it.

    It is found by its absolute path, by the way to it from the document, or, where neither leads to a file, by its
    name if no other film has it.
    """
    return _find(header.findall("MEDIA_DESCRIPTOR"), MEDIA, video, file)


def link_media(header: etree._Element, video: str | PathLike[str], file: Path) -> bool:
    """Link a film unless the document does; whether anything changed. Where it moved, its descriptor is mended."""
    element = find_media(header, video, file)
    made = element is None
    if element is None:
        element = etree.Element("MEDIA_DESCRIPTOR")
        header.insert(len(header.findall("MEDIA_DESCRIPTOR")), element)
    elif _leads(element, MEDIA, video, file):
        return False
    before = element.get("MEDIA_URL")
    _set(element, MEDIA, *link_urls(video, file))
    for other in header if before else ():  # sound or curves that were taken from this film name it by its URL
        for attribute in ("EXTRACTED_FROM", "ASSOCIATED_WITH"):
            if other.get(attribute) == before:
                other.set(attribute, element.get("MEDIA_URL"))
    if made:
        element.set("MIME_TYPE", mimetypes.guess_type(str(video))[0] or "video/mp4")
    return True


def curve_files(root: etree._Element, file: Path) -> tuple[tuple[Path, ...], str | None]:
    """The curves' csv and its description; without the latter where the document links one of others.

    Returns
    -------
    files : tuple of Path
    hidden_by : str or None
        The description of others: ELAN reads only one, so that it hides our curves.
    """
    curves, description = file.with_suffix(CURVES_ENDING), file.with_name(file.stem + TSCONF)
    header = root.find("HEADER")
    ours = _ours(header)
    for link in header.iterfind("LINKED_FILE_DESCRIPTOR"):
        name = _name(link)
        if name.lower().endswith(TSCONF) and name != description.name and link not in ours:
            return (curves,), name
    return (curves, description), None


def link_curves(header: etree._Element, files: Sequence[Path], file: Path, *, origin_ms: int = 0) -> bool:
    """Link the curves and their description, in place of those that we linked under another name or in another folder.

    `.xml` is linked as text/xml, anything else as text/plain. `origin_ms` is where the annotations' time 0 lies in the
    curves, which are in the film's clock.

    Returns
    -------
    bool
        Whether anything changed.
    """
    wanted = [(*_curve_urls(linked, file), _mime(linked)) for linked in files]
    ours = _ours(header)
    names = {_plain_name(linked.name) for linked in files}
    ours += [
        link
        for link in header.iterfind("LINKED_FILE_DESCRIPTOR")
        if link not in ours and _plain_name(_name(link)) in names
    ]
    # What the document says of time (TIME_ORIGIN, ASSOCIATED_WITH) stays with the link
    kept: list[etree._Element] = []
    changed = False
    for absolute, relative, mime in wanted:
        ending = TSCONF if mime == "text/xml" else CURVES_ENDING
        same = [link for link in ours if _name(link).lower().endswith(ending)]
        if same:
            element = same[0]
        else:
            element = etree.Element("LINKED_FILE_DESCRIPTOR")
            place = len(header.findall("MEDIA_DESCRIPTOR")) + len(header.findall("LINKED_FILE_DESCRIPTOR"))
            header.insert(place, element)
        before = dict(element.attrib)
        _set(element, LINK, absolute, relative)
        element.set("MIME_TYPE", mime)
        if origin_ms and ending != TSCONF and element.get("TIME_ORIGIN") is None:
            element.set("TIME_ORIGIN", str(origin_ms))
        changed |= before != dict(element.attrib)
        kept.append(element)
    for link in ours:
        if link not in kept:
            header.remove(link)
            changed = True
    return changed


def warn_of_curves(description: Path, file: Path, hidden_by: str | None) -> None:
    """Warn where ELAN will not show the curves, or not for ever: what `curve_files` found hides them, or their path."""
    if hidden_by is not None:
        warnings.warn(
            f"{file}: links {hidden_by}, and ELAN reads one description of curves: ours are written beside it and "
            "linked, and not shown; take that link out in ELAN (Edit > Linked Files), or add our csv to it there",
            SignfaceWarning,
            stacklevel=3,
        )
    elif _beyond_ascii(description):
        warnings.warn(
            f"{file}: its path has letters outside ASCII, with which ELAN does not open curves by itself; they are "
            "linked so that it does, until the file is saved in ELAN and then moved (annotate into it again there)",
            SignfaceWarning,
            stacklevel=3,
        )


def _beyond_ascii(file: Path) -> bool:
    """Whether the path of a file holds letters outside ASCII, with which ELAN cannot open a description of curves."""
    return not os.path.abspath(file).isascii()


def _curve_urls(linked: Path, file: Path) -> tuple[str, str | None]:
    """URLs of a file of curves.

    ELAN (5.3 to 7.0) gives the description's URL to its XML parser, which refuses letters outside ASCII after `file:`
    and takes `FILE:` for what it is.
    """
    absolute, relative = link_urls(linked, file)
    if linked.name.endswith(TSCONF) and _beyond_ascii(linked):
        absolute = "FILE:" + absolute.removeprefix("file:")
    return absolute, relative


def _ours(header: etree._Element) -> list[etree._Element]:
    """The links to curves that signface wrote for a file of whatever name: the csv and the description of one stem."""
    links = header.findall("LINKED_FILE_DESCRIPTOR")
    stems = {name.removesuffix(CURVES_ENDING) for link in links if (name := _name(link)).endswith(CURVES_ENDING)}
    return [
        link
        for link in links
        if (name := _name(link)).endswith(CURVES_ENDING)
        or (name.endswith(TSCONF) and name.removesuffix(TSCONF) in stems)
    ]


def _find(
    elements: Sequence[etree._Element], attributes: tuple[str, str], target: str | PathLike[str], file: Path
) -> etree._Element | None:
    for element in elements:
        if _leads(element, attributes, target, file):
            return element
    if _is_url(target):
        return None
    name = _plain_name(Path(target).name)
    alike = [element for element in elements if _plain_name(_name(element, attributes)) == name]
    if len(alike) == 1 and not any(place.exists() for place in _places(alike[0], attributes, file)):
        return alike[0]
    return None


def _leads(element: etree._Element, attributes: tuple[str, str], target: str | PathLike[str], file: Path) -> bool:
    """Whether one of an element's URLs leads to the target from the EAF at `file`."""
    if element.get(attributes[0]) == link_urls(target, file)[0]:
        return True
    if _is_url(target):
        return False
    wanted = Path(os.path.abspath(target))
    for place in _places(element, attributes, file):
        if _plain(place) == _plain(wanted):
            return True
        if place.exists() and wanted.exists() and place.samefile(wanted):
            return True
    return False


def _places(element: etree._Element, attributes: tuple[str, str], file: Path) -> list[Path]:
    """Where an element's URLs lead on this machine, as they stand and percent-decoded."""
    return [place for attribute in attributes for place in places_of(element.get(attribute) or "", file)]


def places_of(url: str, file: Path) -> list[Path]:
    """Where a URL in the document at `file` may lead on this machine: as it stands and percent-decoded.

    None for an empty one and for one of the web.
    """
    folder = Path(os.path.abspath(file)).parent
    text, places = url.replace("\\", "/"), []
    if text and (not _is_url(text) or text.lower().startswith("file:")):
        for path in dict.fromkeys((text, unquote(text))):
            path = re.sub(r"^(?i:file):(//(?=/))?", "", path)
            path = re.sub(r"^/(?=[A-Za-z]:/|\.\.?/)", "", path)  # /C:/..., and ELAN's own file:/./...
            places.append(Path(os.path.abspath(folder / path)))
    return places


def _is_url(target: str | PathLike[str]) -> bool:
    return re.match(r"^[a-zA-Z][a-zA-Z0-9+.-]+://", os.fspath(target)) is not None


def _plain(path: Path) -> str:
    """A path in the form by which two are compared: macOS writes accents apart from their letters."""
    return unicodedata.normalize("NFC", os.path.normcase(path))


def _plain_name(name: str) -> str:
    return unicodedata.normalize("NFC", unquote(name))


def _name(element: etree._Element, attributes: tuple[str, str] = LINK) -> str:
    """Name of the file that an element links."""
    url = element.get(attributes[0]) or element.get(attributes[1]) or ""
    return url.replace("\\", "/").rpartition("/")[2]


def _mime(linked: Path) -> str:
    return "text/xml" if linked.suffix.lower() == ".xml" else "text/plain"


def _set(element: etree._Element, attributes: tuple[str, str], absolute: str, relative: str | None) -> None:
    element.set(attributes[0], absolute)
    if relative is not None:
        element.set(attributes[1], relative)
    else:
        element.attrib.pop(attributes[1], None)


def film_origin(root: etree._Element, file: Path, video: str | PathLike[str] | None = None) -> int:
    """Milliseconds of the film at the annotations' time 0: film time = annotation time + origin, as ELAN plays it.

    Parameters
    ----------
    root : element
    file : Path
        Named in errors.
    video : path, optional
        The film whose clock counts, known as `find_media` knows it, or by its name. One that the document does not
        link begins with the annotations.
        Without it, all films have to have one origin; sound counts only where no film is linked.

    Raises
    ------
    SignfaceError
        Several films have different origins, or one has an origin that is no number.
    """
    everything = media_origins(root, file, sound=True)
    linked = None if video is None else find_media(root.find("HEADER"), video, file)
    if linked is not None:
        return int((linked.get("TIME_ORIGIN") or "0").strip())
    if video is not None and _media_name(fspath(video)) in everything:
        return everything[_media_name(fspath(video))]
    origins = media_origins(root, file)
    if video is not None:
        if any(origins.values()):
            said = ", ".join(f"{name} {origin} ms" for name, origin in origins.items())
            warnings.warn(
                f"{file}: {Path(video).name} is not linked in it and is taken to begin with its annotations; "
                f"the films linked do not (TIME_ORIGIN: {said})",
                SignfaceWarning,
                stacklevel=3,
            )
        return 0
    if len(set(origins.values())) > 1:
        said = ", ".join(f"{name} {origin} ms" for name, origin in origins.items())
        raise SignfaceError(
            f"its films begin at different times (TIME_ORIGIN: {said})",
            file=file,
            hint="say by which film the take's times are: --video FILE, or the column video in takes.csv",
        )
    return next(iter(origins.values()), 0)


def media_origins(root: etree._Element, file: Path, *, sound: bool = False) -> dict[str, int]:
    """Name of each film that a document links, and its `TIME_ORIGIN` in milliseconds; of sound too, or without films.

    Raises
    ------
    SignfaceError
        One has an origin that is no number.
    """
    origins: dict[str, int] = {}
    sounds: dict[str, int] = {}
    for media in root.iterfind("HEADER/MEDIA_DESCRIPTOR"):
        name = _media_name(media.get("MEDIA_URL") or media.get("RELATIVE_MEDIA_URL") or "")
        text = (media.get("TIME_ORIGIN") or "0").strip()
        if not text.lstrip("+-").isdecimal():
            raise SignfaceError(f"TIME_ORIGIN of {name} is {text!r}, which is no count of milliseconds", file=file)
        of_sound = (media.get("MIME_TYPE") or "").startswith("audio/") or media.get("EXTRACTED_FROM") is not None
        (sounds if of_sound else origins)[name] = int(text)
    return sounds | origins if sound or not origins else origins


def _media_name(url: str) -> str:
    """File name of a link or a path, as far as its folder may have moved."""
    return unquote(url).replace("\\", "/").rpartition("/")[2].casefold()
