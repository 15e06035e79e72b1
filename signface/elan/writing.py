"""What was found in a take as EAF 3.0, with its colours and curves: written together or not at all.

- `write_eaf`: a new file, one from a lab's template, or our tiers into a file that is there.
- `prepare`: the same up to the writing, so that every reason to refuse comes before any file.
- `to_pympi`: the same as an object of pympi-ling, for scripts.
- `check_writable`: whether a file may be overwritten.
"""

from __future__ import annotations

import datetime
import json
import tempfile
import uuid
from collections.abc import Mapping as MappingABC
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd
from lxml import etree

from signface.content import Content
from signface.elan.checking import check_document
from signface.elan.contents import Results, contents_of
from signface.elan.curves import write_curves, write_tsconf
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
from signface.elan.elements import CONSTRAINTS
from signface.elan.links import curve_files, film_origin, link_curves, link_media, warn_of_curves
from signface.elan.mapping import read_mapping
from signface.elan.merging import put_tiers
from signface.elan.preferences import write_preferences
from signface.elan.tiers import Tier, in_annotation_time, xml_text
from signface.elan.upgrade import is_before_28, upgrade
from signface.errors import SignfaceError
from signface.label.vocabulary import Vocabulary
from signface.segmentation.segments import Segments
from signface.settings.eaf import EafOptions

if TYPE_CHECKING:
    from pympi.Elan import Eaf


def write_eaf(
    annotation: Results | Segments | Sequence[Results],
    path: str | PathLike[str] | None = None,
    *,
    into: str | PathLike[str] | None = None,
    options: EafOptions | None = None,
    signer: str | None = None,
    video: str | PathLike[str] | None = None,
    tier: str | None = None,
    vocabulary: Vocabulary | None = None,
    properties: MappingABC[str, str] | None = None,
    date: datetime.datetime | str | None = None,
    replace: bool = False,
) -> list[Path]:
    """Write what was found in a take: `TAKE.eaf`, ELAN's colours and the curves of its timeseries viewer beside it.

    The tiers are `affect@SIGNER` with a closed vocabulary and, dependent on it by symbolic association,
    `affect-confidence@SIGNER` and `intensity@SIGNER` where the segments have those columns; and one for each channel.

    Into a file that is there, only our own tiers are added or replaced: every other tier, annotation, identifier, time
    slot, comment, property, licence, link, locale, lexicon and external reference stays as it is. Files of EAF 2.5 to
    2.8 become 3.0. The file before is kept as a backup; when nothing would change in it, it is not written.

    Parameters
    ----------
    annotation : Annotation, Segments or sequence of Annotation
        Several are those of the signers of one take, each with tiers and curves of their own. Times in seconds from the
        beginning of the video (a take's `start` is already in them). Segments alone have
        neither channels nor curves.
    path : path, optional
        The `.eaf` to write: this or `into`.
    into : path, optional
        An `.eaf` that is there, changed in place. It has tiers of its own: a template is not used.
    options : EafOptions, optional
        Template, mapping, doubtful segments, curves, author.
    signer : str, optional
        Names the tiers and is their participant; the annotation's own signer when not given. Empty for tiers without
        `@`.
    video : path or URL, optional
        The media file that the annotations belong to, whose `TIME_ORIGIN` in the document counts.
    tier : str, optional
        What the segments are of: the part of the tier's name before `@`. The annotation's own when not given, and
        `affect` for segments alone.
    vocabulary : Vocabulary, optional
        The labels allowed on that tier; the annotation's own when not given, and those of affect for segments alone.
    properties : mapping, optional
        What the header says besides the tool, its version and the annotation's facts. Each is written as
        `signface:NAME`.
    date : datetime or str, optional
        The document's date (ISO 8601); now when not given. With a date, the same input gives the same bytes.
    replace : bool
        Overwrite a file that holds more than signface's own unmodified output, or what an annotator corrected in our
        tiers. The file before is then kept beside it as `.bak`.

    Returns
    -------
    list of Path
        What belongs to the take, the `.eaf` first: the curves, and their description unless the file has one of its
        own. ELAN's colours, `TAKE.pfsx`, are written beside them and not listed: ELAN replaces that file when it likes.

    Raises
    ------
    SignfaceError
        The segments carry no label or one outside the vocabulary; the template or the mapping does not fit; the file
        exists and someone has worked in it, or is broken (`checking.check_document`); annotations of others would be
        lost; the take ends before time 0; the folder cannot be written. Files are then as they were.

    Warns
    -----
    SignfaceWarning
        ELAN will not show the curves, or not for ever; preferences, or a vocabulary in another file, cannot be read;
        annotations end at the edges of those of a lab's parent tier.

    Examples
    --------
    >>> import signface as sf
    >>> [file.name for file in sf.write_eaf(sf.datasets.mini_reference(), "take.eaf", signer="Eva")]
    ['take.eaf']
    """
    return prepare(
        annotation,
        path,
        into=into,
        options=options,
        signer=signer,
        video=video,
        tier=tier,
        vocabulary=vocabulary,
        properties=properties,
        date=date,
        replace=replace,
    ).store()


def prepare(
    annotation: Results | Segments | Sequence[Results],
    path: str | PathLike[str] | None = None,
    *,
    into: str | PathLike[str] | None = None,
    options: EafOptions | None = None,
    signer: str | None = None,
    video: str | PathLike[str] | None = None,
    tier: str | None = None,
    vocabulary: Vocabulary | None = None,
    properties: MappingABC[str, str] | None = None,
    date: datetime.datetime | str | None = None,
    replace: bool = False,
) -> PreparedDocument:
    """What `write_eaf` writes, before anything is written. Parameters and errors are those of `write_eaf`."""
    if (path is None) == (into is None):
        raise SignfaceError("an annotation goes to a path or into a file that is there, one of them")
    options = EafOptions() if options is None else options
    file = Path(path if into is None else into)  # type: ignore[arg-type]
    if into is None:
        check_writable(file, replace=replace)
        root, old = (_new_document(), False) if options.template is None else _read_template(options.template)
        root.set("AUTHOR", xml_text(options.author))
    else:
        root, old = _read_upgraded(file)
    origin = film_origin(root, file, video)
    all_tiers, curves, facts, segments = contents_of(
        annotation, options, signer=signer, tier=tier, vocabulary=vocabulary
    )
    facts |= properties or {}
    all_tiers = tuple(in_annotation_time(one, origin) for one in all_tiers)
    rules = {} if options.mapping is None else read_mapping(options.mapping)
    links: tuple[Path, ...] = ()
    if curves is not None:
        links, hidden_by = curve_files(root, file)
        warn_of_curves(links[-1], file, hidden_by)
    source = file if into is not None or options.template is None else Path(options.template)
    changed = put_tiers(root, all_tiers, mapping=rules, replace=replace, file=source)
    header = root.find("HEADER")
    if video is not None:
        changed |= link_media(header, video, file)
    if links:
        changed |= link_curves(header, links, file, origin_ms=origin)
    if changed or into is None:
        root.set("DATE", iso_date(date))
        _say_what_wrote(root, segments, facts)
    keep_previous = True
    if into is None:
        rows = tier_rows(root)
        content = json.dumps([root.get("DATE"), segments.name, rows], ensure_ascii=False)
        set_property(root, "URN", f"urn:nl-mpi-tools-elan-eaf:{uuid.uuid5(uuid.NAMESPACE_URL, content)}")
        set_property(root, f"{PROPERTY_PREFIX}tiers", json.dumps(list(rows), ensure_ascii=False))
        same = _untouched(file) and recorded(read_document(file).getroot()) == recorded(root)
        keep_previous, changed = file.is_file() and not same, True
    template = options.template if into is None else None
    return PreparedDocument(
        file, root.getroottree(), all_tiers, links, curves, keep_previous, changed, date, old, template
    )


def to_pympi(annotation: Results | Segments, *, options: EafOptions | None = None, signer: str | None = None) -> Eaf:
    """What `write_eaf` writes, without curves, as pympi-ling's object for scripts; errors are those of `write_eaf`.

    What pympi writes again has no colours, and links between annotations are lost: files for annotators come from
    `write_eaf`.

    Examples
    --------
    >>> import signface as sf
    >>> to_pympi(sf.datasets.mini_reference(), signer="Eva").get_annotation_data_for_tier("affect@Eva")[:3]
    [(0, 2846, 'N'), (2846, 3031, 'ND'), (3031, 4641, 'D')]
    """
    from pympi.Elan import Eaf

    options = (EafOptions() if options is None else options).changed(curves=False)
    with tempfile.TemporaryDirectory() as folder:  # pympi reads from a path only
        file = Path(folder) / "take.eaf"
        write_document(prepare(annotation, file, options=options, signer=signer).tree, file)
        return Eaf(str(file))


@dataclass(frozen=True, eq=False)
class PreparedDocument(Content):
    """A document that is complete and allowed to be written, and has not been yet.

    Parameters
    ----------
    file : Path
        Where it goes.
    tree : ElementTree
    tiers : tuple of Tier
        What was put into it, for the colours.
    links : tuple of Path
        The curves' csv and, where they get one, their description; empty without curves.
    curves : DataFrame, optional
    keep_previous : bool
        Whether the file that is there is kept as a backup.
    changed : bool
        Whether the document has to be written.
    date : datetime or str, optional
        The date in the description of the curves.
    old : bool
        Whether the file that is there, or the template, is of a format before EAF 2.8.
    template : path, optional
        What the document was made from, whose preferences are taken over.
    """

    file: Path
    tree: etree._ElementTree
    tiers: tuple[Tier, ...]
    links: tuple[Path, ...] = ()
    curves: pd.DataFrame | None = None
    keep_previous: bool = False
    changed: bool = True
    date: datetime.datetime | str | None = None
    old: bool = False
    template: str | None = None

    def store(self) -> list[Path]:
        """Write the curves, the document, its colours, and the backup of what was there.

        Returns
        -------
        list of Path
            What belongs to the take, the `.eaf` first.
        """
        if self.curves is not None:
            write_curves(self.curves, self.links[0])
            for description in self.links[1:]:
                write_tsconf(self.links[0], description, date=self.date)
        if self.changed:
            if self.keep_previous:
                back_up(self.file)
            write_document(self.tree, self.file)
        write_preferences(
            self.file.with_suffix(".pfsx"),
            self.tiers,
            root=self.tree.getroot(),
            curves=self.links[0] if len(self.links) > 1 else None,
            old=self.old and self.changed,
            template=self.template,
        )
        return [self.file, *self.links]


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


def _read_upgraded(path: str | PathLike[str]) -> tuple[etree._Element, bool]:
    """The root of a document without problems as EAF 3.0, and whether it was of a format before EAF 2.8."""
    root = read_document(path).getroot()
    check_document(root, Path(path))
    old = is_before_28(root)
    upgrade(root)
    return root, old


def _read_template(template: str | PathLike[str]) -> tuple[etree._Element, bool]:
    """As `_read_upgraded`, without annotations, time slots, links between annotations and media."""
    root, old = _read_upgraded(template)
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
    return root, old


def _say_what_wrote(root: etree._Element, segments: Segments, facts: MappingABC[str, str]) -> None:
    """The properties that say what wrote the tiers and from what."""
    details = {"tool": "signface", "version": version("signface"), "take": segments.name, **facts}
    if segments.history:
        details.setdefault("history", "; ".join(segments.history))
    for name, value in details.items():
        set_property(root, PROPERTY_PREFIX + name, xml_text(str(value)))
