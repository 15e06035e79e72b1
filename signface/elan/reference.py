"""What annotators wrote, as tables.

- `read_reference`: the affect tier of a signer, or another one, as segments; `reference_vocabulary`: of a corpus.
- `rows_table`: annotations as a table of seconds; `annotation_root`: the document of any file of annotations.
- `read_corrections`: a tier as signface wrote it, and as it is now.
"""

from __future__ import annotations

import difflib
import json
import warnings
from collections.abc import Iterable, Sequence
from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd
from lxml import etree

from signface.elan.document import CHANNEL_PREFIX, Row, read_document, recorded, tier_rows
from signface.elan.frame_labels import frame_label_document, is_frame_labels
from signface.elan.links import film_origin
from signface.elan.tiers import clean_name, tier_name
from signface.elan.translation import MappingOrFile, as_mapping, tier_meanings
from signface.elan.vocabularies import vocabulary_of_tier
from signface.errors import SignfaceError, SignfaceWarning
from signface.label.vocabulary import AFFECT, INTENSITY, NONE, UNKNOWN, Vocabulary
from signface.segmentation.segments import Segments


def read_reference(
    eaf: str | PathLike[str],
    signer: str | None = None,
    *,
    tier: str = "affect",
    vocabulary: Vocabulary | None = None,
    mapping: MappingOrFile | None = None,
    video: str | PathLike[str] | None = None,
) -> Segments:
    """Read the reference annotation of one signer.

    Parameters
    ----------
    eaf : path
        An EAF, format 2.5 to 3.0, or labels of single frames (`signface.elan.frame_labels`).
    signer : str, optional
        Whose tier: `TIER@SIGNER`, else `TIER`, else the lab's tier that signface wrote the signer's affect to. When
        not given, `TIER` or the only such tier.
    tier : str
        What was annotated: the name of a tier, or its part before `@`.
    vocabulary : Vocabulary, optional
        The labels allowed. By default those of affect (`signface.label.vocabulary.AFFECT`) on a tier of affect, those
        of its closed vocabulary on another tier, and what it holds where it has none.
    mapping : mapping or path, optional
        Of our channels and labels to the laboratory's tiers and values (`signface.elan.mapping`): `tier` is then ours,
        and so are the labels returned.
    video : path, optional
        The film whose clock the times are of, where the file links several that begin at different times
        (`signface.elan.links.film_origin`).

    Returns
    -------
    Segments
        `start_s, end_s, kind, label` in the clock of the film: annotation time and `TIME_ORIGIN`;
        `intensity` (1, 2, 3 or missing) where a tier `intensity@SIGNER` exists.
        Annotations without a value are left out, and those in which a model abstained (`unknown`). Missing time
        values are those that ELAN gives (`signface.elan.times.annotation_spans`). A lab's
        values are turned back into labels. Where the vocabulary has no transitions, every annotation is a stable
        segment, and two of one label that touch are one segment; the history says how many there were.

    Raises
    ------
    SignfaceError
        The file is no EAF, the tier is missing, annotations overlap or have no time, a label is outside the
        vocabulary, or films begin at different times and none is named.

    See Also
    --------
    signface.read_tiers : every tier, whatever it holds.

    Examples
    --------
    >>> import signface as sf
    >>> file = sf.datasets.mini_file().with_name("reference") / "M2_EU_04.eaf"
    >>> print(sf.read_reference(file).table)
       start_s  end_s        kind label  intensity
    0    0.000  2.846      stable     N       <NA>
    1    2.846  3.031  transition    ND       <NA>
    2    3.031  4.641      stable     D          3
    3    4.641  5.160  transition    DN       <NA>
    4    5.160  5.922      stable     N       <NA>
    """
    file = Path(eaf)
    root = annotation_root(file)
    meanings = _meanings(root, mapping)
    name = _tier_name(root, tier, signer, file, meanings)
    tiers = tier_rows(root)
    meaning = meanings[name][2] if name in meanings else {}
    if vocabulary is None:
        vocabulary = AFFECT if tier == "affect" else _vocabulary_of(root, name, tiers[name], file, meaning)
    rows = _checked_rows(tiers[name], name, meaning, vocabulary, file)
    history = [f"read_reference {file.name} {name}"]
    if not vocabulary.transitions and (merged := _merged(rows)) != rows:
        history.append(f"merged {len(rows)} annotations into {len(merged)}: equal ones touched")
        rows = merged
    table = rows_table(rows, film_origin(root, file, video))
    moving = [vocabulary.is_transition(label) for label in table["label"]]
    table.insert(2, "kind", np.where(np.array(moving, dtype=bool), "transition", "stable").astype(object))
    intensity_name = "intensity" + name.removeprefix("affect")
    if tier == "affect" and intensity_name in tiers:
        table["intensity"] = _intensities(rows, tiers[intensity_name], intensity_name, file)
    return Segments(table, name=file.stem, history=tuple(history))


def reference_vocabulary(
    files: Sequence[tuple[str | PathLike[str], str | None]], tier: str, *, mapping: MappingOrFile | None = None
) -> Vocabulary:
    """The vocabulary that the references of a corpus share on a tier.

    That of the tier's linguistic type, if all files have the same; else one of all values that are annotated, with a
    `SignfaceWarning` for each that one take alone holds.

    Parameters
    ----------
    files : sequence of (path, str or None)
        Each annotation, and its signer.
    tier : str
    mapping : mapping or path, optional
        As for `read_reference`.

    Raises
    ------
    SignfaceError
        As `read_reference`, or nothing is annotated.
    """
    if tier == "affect":
        return AFFECT
    closed: list[Vocabulary] = []
    labels: dict[str, list[Path]] = {}
    mapping = as_mapping(mapping)
    for eaf, signer in files:
        file = Path(eaf)
        root = annotation_root(file)
        meanings = _meanings(root, mapping)
        name = _tier_name(root, tier, signer, file, meanings)
        meaning = meanings[name][2] if name in meanings else {}
        vocabulary = None if meaning else vocabulary_of_tier(root, name, file)
        closed += [] if vocabulary is None else [vocabulary]
        for label in {meaning.get(value.strip(), value.strip()) for _, _, value in tier_rows(root)[name]} - {""}:
            labels.setdefault(label, []).append(file)
    if len(closed) == len(files) and len({(one.values, one.transitions) for one in closed}) == 1:
        return max(closed, key=lambda one: len(one.colours))  # not every file has its colours beside it
    if not labels:
        raise SignfaceError(f"nothing is annotated on the tier {tier}")
    for label, holders in sorted(labels.items()):
        if len(holders) == 1 < len(files):
            warnings.warn(
                f"{holders[0]}: the label {label!r} on the tier {tier} is in this take only. "
                "Where it is a slip, name the labels that there are: --vocabulary FILE",
                SignfaceWarning,
                stacklevel=2,
            )
    return Vocabulary(tier.partition("@")[0], tuple(sorted(labels)))


def read_corrections(
    eaf: str | PathLike[str],
    signer: str | None = None,
    *,
    tier: str = "affect",
    vocabulary: Vocabulary | None = None,
    mapping: MappingOrFile | None = None,
    video: str | PathLike[str] | None = None,
) -> tuple[pd.DataFrame, pd.DataFrame] | None:
    """A tier as signface wrote it and as it is now: two tables `start_s, end_s, label`.

    None when signface did not write the tier, so that nothing can be said of corrections. Parameters and errors are
    those of `read_reference`.
    """
    file = Path(eaf)
    root = annotation_root(file)
    meanings = _meanings(root, mapping)
    name = _tier_name(root, tier, signer, file, meanings)
    written = recorded(root).get(name)
    if written is None:
        return None
    meaning = meanings[name][2] if name in meanings else {}
    rows = [(start, end, meaning.get(value, value)) for start, end, value in written]
    before = rows_table(rows, film_origin(root, file, video))
    wide = AFFECT if vocabulary is None and tier == "affect" else vocabulary
    wide = None if wide is None else wide.including(UNKNOWN)  # what a model did not know is there to be corrected
    after = read_reference(file, signer, tier=tier, vocabulary=wide, mapping=mapping, video=video).table
    return before, after[["start_s", "end_s", "label"]]


def corpus_corrections(
    files: Sequence[tuple[str | PathLike[str], str | None, str | PathLike[str] | None]],
    *,
    tier: str = "affect",
    vocabulary: Vocabulary | None = None,
    mapping: MappingOrFile | None = None,
) -> list[tuple[pd.DataFrame, pd.DataFrame] | None]:
    """`read_corrections` of each annotation of a corpus, with its signer and its film."""
    rules = None if mapping is None else as_mapping(mapping)
    return [
        read_corrections(file, signer, tier=tier, vocabulary=vocabulary, mapping=rules, video=video)
        for file, signer, video in files
    ]


def channel_labels(root: etree._Element) -> dict[str, tuple[str, dict[str, str]]]:
    """For each of a lab's tiers that signface wrote to: the channel, and our label for each of the lab's values."""
    labels_of = {}
    for element in root.iterfind("HEADER/PROPERTY"):
        name = element.get("NAME") or ""
        if not name.startswith(CHANNEL_PREFIX):
            continue
        try:
            content = json.loads(element.text or "")
            labels = {str(value): str(label) for value, label in content["labels"].items()}
            labels_of[name[len(CHANNEL_PREFIX) :]] = (str(content["channel"]), labels)
        except (ValueError, KeyError, TypeError, AttributeError):
            continue  # edited by someone: the tier is then read as any other
    return labels_of


def _meanings(root: etree._Element, mapping: MappingOrFile | None) -> dict[str, tuple[str, str, dict[str, str]]]:
    """Of a laboratory's tiers the channel, the signer and our labels: what we wrote to, and what a mapping names."""
    tiers = {tier.get("TIER_ID") or "": tier for tier in root.iterfind("TIER")}
    written = {
        name: (channel, tiers[name].get("PARTICIPANT") or "", labels)
        for name, (channel, labels) in channel_labels(root).items()
        if name in tiers
    }
    return written | tier_meanings(as_mapping(mapping), tiers)


def annotation_root(file: Path) -> etree._Element:
    """The document of an annotation, whichever file holds it."""
    return frame_label_document(file) if is_frame_labels(file) else read_document(file).getroot()


def rows_table(rows: Iterable[Row], origin: int) -> pd.DataFrame:
    """Rows as a table in seconds of the film, without those whose time is unknown; `origin` in milliseconds."""
    known = [
        ((start + origin) / 1000, (end + origin) / 1000, label)
        for start, end, label in rows
        if start is not None and end is not None
    ]
    table = pd.DataFrame(known, columns=["start_s", "end_s", "label"])
    return table.astype({"start_s": float, "end_s": float, "label": object})


def _checked_rows(
    annotations: list[Row], name: str, meaning: dict[str, str], vocabulary: Vocabulary, file: Path
) -> list[tuple[int, int, str]]:
    """The annotations with a value, as labels; each with a time, in the vocabulary, none overlapping another."""
    rows: list[tuple[int, int, str]] = []
    allowed = set(vocabulary.allowed)
    for start, end, value in annotations:
        label = meaning.get(value, meaning.get(value.strip(), value.strip()))
        if not label or vocabulary.abstains(label):  # nobody said what it is
            continue
        if start is None or end is None or start >= end:
            raise SignfaceError(f"the annotation {label!r} on tier {name} has no duration or no time", file=file)
        if label not in allowed:
            raise SignfaceError(
                f"label {label!r} on tier {name} at {start / 1000:.3f} s is not in the vocabulary",
                file=file,
                hint=f"stable labels are {', '.join(vocabulary.values)}"
                + ("; transitions join two of them, as NA" if vocabulary == AFFECT else ""),
            )
        if rows and start < rows[-1][1]:
            raise SignfaceError(f"annotations on tier {name} overlap at {start / 1000:.3f} s", file=file)
        rows.append((start, end, label))
    return rows


def _merged(rows: list[tuple[int, int, str]]) -> list[tuple[int, int, str]]:
    """The rows with those of one label made one that follow each other without a gap."""
    merged = rows[:1]
    for start, end, label in rows[1:]:
        if label == merged[-1][2] and start - merged[-1][1] <= 1:  # whole milliseconds may lie between
            merged[-1] = (merged[-1][0], end, label)
        else:
            merged.append((start, end, label))
    return merged


def _vocabulary_of(root: etree._Element, name: str, rows: list[Row], file: Path, meaning: dict[str, str]) -> Vocabulary:
    """The closed vocabulary of a tier, or one of what it holds; `none` alone where nothing happened in the take."""
    closed = None if meaning else vocabulary_of_tier(root, name, file)
    labels = sorted({meaning.get(value.strip(), value.strip()) for _, _, value in rows} - {""})
    return closed or Vocabulary(name.partition("@")[0], tuple(labels or [NONE]))


def _tier_name(
    root: etree._Element,
    wanted: str,
    signer: str | None,
    file: Path,
    meanings: dict[str, tuple[str, str, dict[str, str]]],
) -> str:
    """The tier of a channel, of a signer where one is named."""
    tiers = {tier.get("TIER_ID") or "": tier for tier in root.iterfind("TIER")}
    labs = [name for name, (channel, _, _) in meanings.items() if channel == wanted]
    ours = [name for name in tiers if name == wanted or name.startswith(f"{wanted}@")]
    hint = _tier_hint(wanted, list(tiers))
    if signer:
        of_signer = [name for name in labs if meanings[name][1] == clean_name(signer)]
        for name in (tier_name(wanted, signer), wanted):
            if name in ours:
                return name
        if len(of_signer) == 1 or len(labs) == 1:
            return (of_signer or labs)[0]
        raise SignfaceError(f"no tier {wanted}@{signer} or {wanted}", file=file, hint=hint)
    if wanted in ours:
        return wanted
    candidates = ours or labs
    if len(candidates) == 1:
        return candidates[0]
    if candidates:
        raise SignfaceError(f"has several {wanted} tiers: {', '.join(candidates)}", file=file, hint="name the signer")
    raise SignfaceError(f"no tier {wanted} or {wanted}@SIGNER", file=file, hint=hint)


def _tier_hint(wanted: str, tiers: list[str]) -> str:
    """What to do about a tier that is not there, of those that are."""
    base = wanted.partition("@")[0]
    if base != wanted:
        return f"name the tier without @SIGNER: {base}"
    hint = f"its tiers are {', '.join(tiers[:12]) or 'none'}"
    close = difflib.get_close_matches(wanted, {tier.partition("@")[0] for tier in tiers}, n=1)
    if close:
        return f"did you mean {close[0]}? {hint[0].upper()}{hint[1:]}"
    return f"{hint}; another tier: --tier NAME" if wanted == "affect" else hint


def _intensities(rows: list[tuple[int, int, str]], annotated: list[Row], name: str, file: Path) -> pd.Series:
    """Intensity of each segment: that of the annotation with its times (1, 2, 3), missing where there is none."""
    by_time = {(start, end): value.strip() for start, end, value in annotated if value.strip()}
    for value in by_time.values():
        if value not in INTENSITY.values:
            raise SignfaceError(f"intensity {value!r} on tier {name} is not 1, 2 or 3", file=file)
    levels = (by_time.get((start, end)) for start, end, _ in rows)
    return pd.Series([None if level is None else int(level) for level in levels], dtype="Int64")
