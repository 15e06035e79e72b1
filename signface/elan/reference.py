"""What annotators wrote, as tables.

- `read_reference`: the affect tier of a signer, as segments.
- `read_tiers`: every independent tier; `read_annotators`: those of several files, under short names.
- `read_corrections`: the affect tier as signface wrote it, and as it is now.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from itertools import pairwise
from os import PathLike
from pathlib import Path

import pandas as pd
from lxml import etree

from signface.elan.checking import check_document
from signface.elan.document import CHANNEL_PREFIX, Row, read_document, recorded, tier_rows
from signface.elan.tiers import clean_name, tier_name
from signface.elan.vocabularies import AFFECT, INTENSITY
from signface.errors import SignfaceError
from signface.label.vocabulary import AFFECTS
from signface.segmentation.segments import Segments


def read_reference(
    eaf: str | PathLike[str], signer: str | None = None, *, labels: Iterable[str] | None = None
) -> Segments:
    """Read the reference annotation of one signer.

    Parameters
    ----------
    eaf : path
        An EAF, format 2.5 to 3.0.
    signer : str, optional
        Whose tier: `affect@SIGNER`, else `affect`, else the lab's tier that signface wrote the signer's affect to.
        When not given, `affect` or the only such tier.
    labels : iterable of str, optional
        The labels allowed; by default `N A D F J Sa Su` and their transitions.

    Returns
    -------
    Segments
        `start_s, end_s, kind, label`; `intensity` (1, 2, 3 or missing) where a tier `intensity@SIGNER` exists.
        Annotations without a value are left out. Missing time values, which ELAN allows within a chain of
        annotations, are spread evenly between the known ones. A lab's values are turned back into labels.

    Raises
    ------
    SignfaceError
        The file is no EAF, the tier is missing, annotations overlap or have no time, or a label is outside the
        vocabulary.

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
    root = read_document(file).getroot()
    name = _affect_tier_name(root, signer, file)
    _fill_times(root)
    tiers = tier_rows(root)
    allowed = set(AFFECT.values if labels is None else labels)
    rows = _checked_rows(tiers[name], name, channel_labels(root).get(name, ("", {}))[1], allowed, file)
    stable = set(AFFECTS) if labels is None else {label for label in allowed if not _is_transition(label, allowed)}
    table = _table(rows)
    table.insert(2, "kind", ["stable" if label in stable else "transition" for label in table["label"]])
    intensity_name = "intensity" + name.removeprefix("affect")
    if intensity_name in tiers:
        table["intensity"] = _intensities(rows, tiers[intensity_name], intensity_name, file)
    return Segments(table, name=file.stem, history=(f"read_reference {file.name} {name}",))


def read_tiers(eaf: str | PathLike[str]) -> dict[str, pd.DataFrame]:
    """Every tier that hangs on no other, as a table `start_s, end_s, label`; annotations without a value left out.

    Raises
    ------
    SignfaceError
        The file is no EAF, or is broken (`checking.check_document`).

    See Also
    --------
    signface.read_reference : the affect tier, checked.

    Examples
    --------
    >>> import signface as sf
    >>> file = sf.datasets.mini_file().with_name("reference") / "M2_EU_04.eaf"
    >>> for name, table in sf.read_tiers(file).items():
    ...     print(name, len(table))
    affect@M2 5
    """
    file = Path(eaf)
    root = read_document(file).getroot()
    check_document(root, file)
    _fill_times(root)
    rows = tier_rows(root)
    independent = [tier.get("TIER_ID") or "" for tier in root.iterfind("TIER") if tier.get("PARENT_REF") is None]
    return {name: _table([row for row in rows[name] if row[2].strip()]) for name in independent}


def read_annotators(files: Sequence[str | PathLike[str]]) -> dict[str, dict[str, pd.DataFrame]]:
    """The tiers (`read_tiers`) of several annotators' files of one take.

    Each stands under the stem of its file, or under its path where two stems are equal.

    Raises
    ------
    SignfaceError
        As `read_tiers`.
    """
    stems = [Path(file).stem for file in files]
    names = stems if len(set(stems)) == len(stems) else [str(file) for file in files]
    return {name: read_tiers(file) for name, file in zip(names, files, strict=True)}


def read_corrections(eaf: str | PathLike[str], signer: str | None = None) -> tuple[pd.DataFrame, pd.DataFrame] | None:
    """The affect tier as signface wrote it and as it is now: two tables `start_s, end_s, label`.

    None when signface did not write the tier, so that nothing can be said of corrections.

    Raises
    ------
    SignfaceError
        As `read_reference`.
    """
    file = Path(eaf)
    root = read_document(file).getroot()
    name = _affect_tier_name(root, signer, file)
    written = recorded(root).get(name)
    if written is None:
        return None
    meaning = channel_labels(root).get(name, ("", {}))[1]
    before = _table([(start, end, meaning.get(value, value)) for start, end, value in written])
    after = read_reference(file, signer).table[["start_s", "end_s", "label"]]
    return before, after


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


def _table(rows: Iterable[Row]) -> pd.DataFrame:
    """Rows as a table in seconds, without those whose time is unknown."""
    known = [(start / 1000, end / 1000, label) for start, end, label in rows if start is not None and end is not None]
    table = pd.DataFrame(known, columns=["start_s", "end_s", "label"])
    return table.astype({"start_s": float, "end_s": float, "label": object})


def _checked_rows(
    annotations: list[Row], name: str, meaning: dict[str, str], allowed: set[str], file: Path
) -> list[tuple[int, int, str]]:
    """The annotations with a value, as labels; each with a time, in the vocabulary, none overlapping another."""
    rows: list[tuple[int, int, str]] = []
    for start, end, value in annotations:
        label = meaning.get(value, value.strip())
        if not label:
            continue
        if start is None or end is None or start >= end:
            raise SignfaceError(f"the annotation {label!r} on tier {name} has no duration or no time", file=file)
        if label not in allowed:
            raise SignfaceError(
                f"label {label!r} on tier {name} at {start / 1000:.3f} s is not in the vocabulary",
                file=file,
                hint=f"stable labels are {', '.join(AFFECTS)}; transitions join two of them, as NA",
            )
        if rows and start < rows[-1][1]:
            raise SignfaceError(f"annotations on tier {name} overlap at {start / 1000:.3f} s", file=file)
        rows.append((start, end, label))
    return rows


def _is_transition(label: str, labels: set[str]) -> bool:
    """Whether a label joins two others of the set."""
    return any(label[:cut] in labels and label[cut:] in labels for cut in range(1, len(label)))


def _affect_tier_name(root: etree._Element, signer: str | None, file: Path) -> str:
    tiers = {tier.get("TIER_ID") or "": tier for tier in root.iterfind("TIER")}
    labs = [name for name, (channel, _) in channel_labels(root).items() if channel == "affect" and name in tiers]
    affect = [name for name in tiers if name == "affect" or name.startswith("affect@")]
    there = f"its tiers are {', '.join(list(tiers)[:12]) or 'none'}"
    if signer:
        theirs = [name for name in labs if tiers[name].get("PARTICIPANT") == clean_name(signer)]
        for wanted in (tier_name("affect", signer), "affect"):
            if wanted in affect:
                return wanted
        if len(theirs) == 1 or len(labs) == 1:
            return (theirs or labs)[0]
        raise SignfaceError(f"no tier affect@{signer} or affect", file=file, hint=there)
    if "affect" in affect:
        return "affect"
    candidates = affect or labs
    if len(candidates) == 1:
        return candidates[0]
    if candidates:
        raise SignfaceError(f"has several affect tiers: {', '.join(candidates)}", file=file, hint="name the signer")
    raise SignfaceError("no tier affect or affect@SIGNER", file=file, hint=there)


def _fill_times(root: etree._Element) -> None:
    """Spread time slots without a value evenly between their neighbours, as ELAN draws them.

    TIME_ORDER lists the slots in the order of time, so the neighbours in the file bound an unknown one. Only the
    tree in memory changes.
    """
    slots = root.findall("TIME_ORDER/TIME_SLOT")
    known = [i for i, slot in enumerate(slots) if slot.get("TIME_VALUE") is not None]
    for before, after in pairwise(known):
        start, end = int(slots[before].get("TIME_VALUE")), int(slots[after].get("TIME_VALUE"))
        for i in range(before + 1, after):
            slots[i].set("TIME_VALUE", str(start + (end - start) * (i - before) // (after - before)))


def _intensities(
    rows: list[tuple[int, int, str]], annotated: list[Row], name: str, file: Path
) -> list[int | None] | pd.Series:
    """Intensity of each segment: that of the annotation with its times (1, 2, 3), missing where there is none."""
    by_time = {}
    for start, end, value in annotated:
        text = value.strip()
        if not text:
            continue
        if text not in INTENSITY.values:
            raise SignfaceError(f"intensity {text!r} on tier {name} is not 1, 2 or 3", file=file)
        by_time[(start, end)] = int(text)
    return pd.Series([by_time.get((start, end)) for start, end, _ in rows], dtype="Int64")
