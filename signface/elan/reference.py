"""`read_reference`: what an annotator wrote on the affect tier, as segments."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from os import PathLike
from pathlib import Path

import pandas as pd
from lxml import etree

from signface.elan.document import read_document, tier_rows
from signface.elan.vocabularies import AFFECT, INTENSITY
from signface.errors import SignfaceError
from signface.label.vocabulary import AFFECTS
from signface.segment.segments import Segments

Row = tuple[int | None, int | None, str]


def read_reference(
    eaf: str | PathLike[str], signer: str | None = None, *, labels: Iterable[str] | None = None
) -> Segments:
    """Read the reference annotation of one signer.

    Parameters
    ----------
    eaf : path
        An EAF, format 2.5 to 3.0.
    signer : str, optional
        Whose tier: `affect@SIGNER`, else `affect`. When not given, `affect` or the only tier `affect@...`.
    labels : iterable of str, optional
        The labels allowed; by default `N A D F J Sa Su` and their transitions.

    Returns
    -------
    Segments
        `start_s, end_s, kind, label`; `intensity` (1, 2, 3 or missing) where a tier `intensity@SIGNER` exists.
        Annotations without a value are left out. Missing time values, which ELAN allows within a chain of
        annotations, are spread evenly between the known ones.

    Raises
    ------
    SignfaceError
        The file is no EAF, the tier is missing, annotations overlap or have no time, or a label is outside the
        vocabulary.
    """
    file = Path(eaf)
    root = read_document(file).getroot()
    name = _affect_tier_name(root, signer, file)
    _fill_times(root)
    tiers = tier_rows(root)
    allowed = set(AFFECT.values if labels is None else labels)
    rows: list[tuple[int, int, str]] = []
    for start, end, value in tiers[name]:
        label = value.strip()
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
    stable = set(AFFECTS) if labels is None else {label for label in allowed if not _is_transition(label, allowed)}
    table = pd.DataFrame(
        {
            "start_s": [start / 1000 for start, _, _ in rows],
            "end_s": [end / 1000 for _, end, _ in rows],
            "kind": ["stable" if label in stable else "transition" for _, _, label in rows],
            "label": [label for _, _, label in rows],
        }
    )
    intensity_name = "intensity" + name.removeprefix("affect")
    if intensity_name in tiers:
        table["intensity"] = _intensities(rows, tiers[intensity_name], intensity_name, file)
    return Segments(table, name=file.stem, history=(f"read_reference {file.name} {name}",))


def _is_transition(label: str, labels: set[str]) -> bool:
    """Whether a label joins two others of the set."""
    return any(label[:cut] in labels and label[cut:] in labels for cut in range(1, len(label)))


def _affect_tier_name(root: etree._Element, signer: str | None, file: Path) -> str:
    names = [tier.get("TIER_ID") or "" for tier in root.iterfind("TIER")]
    affect = [name for name in names if name == "affect" or name.startswith("affect@")]
    if signer:
        from signface.elan.tiers import tier_name

        for wanted in (tier_name("affect", signer), "affect"):
            if wanted in affect:
                return wanted
        raise SignfaceError(
            f"no tier affect@{signer} or affect",
            file=file,
            hint=f"its tiers are {', '.join(names[:12]) or 'none'}",
        )
    if "affect" in affect:
        return "affect"
    if len(affect) == 1:
        return affect[0]
    if affect:
        raise SignfaceError(f"has several affect tiers: {', '.join(affect)}", file=file, hint="name the signer")
    raise SignfaceError(
        "no tier affect or affect@SIGNER", file=file, hint=f"its tiers are {', '.join(names[:12]) or 'none'}"
    )


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
