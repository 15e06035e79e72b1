"""Every annotation of many files as a row, with the values of the annotations that it hangs on.

- `annotation_table`: the table.
- `write_table`: as a file; `check_table_file`: whether one of that name can be written.
"""

from __future__ import annotations

import bisect
import warnings
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import pandas as pd
from lxml import etree

from signface.elan.checking import find_problems
from signface.elan.document import read_document
from signface.elan.times import Span, annotation_spans, parent_annotations
from signface.errors import SignfaceError, SignfaceWarning
from signface.files import whole_file
from signface.progress import progress

COLUMNS = ("file", "tier", "participant", "annotator", "type", "annotation", "start_s", "end_s", "value")


def annotation_table(files: Sequence[str | PathLike[str]], *, tiers: Sequence[str] = ()) -> pd.DataFrame:
    """Every annotation of every tier.

    Parameters
    ----------
    files : sequence of path
        EAFs.
    tiers : sequence of str
        Only these: names, or their parts before `@`. All by default.

    Returns
    -------
    DataFrame
        A row an annotation, in the order of files, tiers and time: `file, tier, participant, annotator, type`
        (linguistic type), `annotation` (its identifier), `start_s, end_s, value`; then `parent_tier, parent_value` of
        the annotation it hangs on, or in which it lies, `parent_tier_2, parent_value_2` of that one's, and so on as
        deep as the files go. Times are ELAN's, seconds from its own zero; annotations without times have those that
        ELAN shows (`signface.elan.times`), and missing ones where the file leaves them open.

    Raises
    ------
    SignfaceError
        A file cannot be read, or none has a tier that was asked for.

    Warns
    -----
    SignfaceWarning
        A file has problems (`checking.find_problems`).

    Examples
    --------
    >>> import signface as sf
    >>> file = sf.datasets.mini_file().with_name("reference") / "M2_EU_04.eaf"
    >>> table = annotation_table([file])
    >>> table.loc[table["tier"] == "intensity@M2", ["value", "parent_tier", "parent_value"]].values.tolist()
    [['3', 'affect@M2', 'D']]
    """
    rows: list[dict[str, object]] = []
    seen: set[str] = set()
    for file in progress(list(files), "reading"):
        root = read_document(file).getroot()
        problems = list(find_problems(root))
        if problems:
            warnings.warn(
                f"{file}: {problems[0]}{' and more' if len(problems) > 1 else ''}; rows that this concerns may lack "
                "times or parents (signface elan check names all problems)",
                SignfaceWarning,
                stacklevel=2,
            )
        seen |= {tier.get("TIER_ID") or "" for tier in root.iterfind("TIER")}
        rows += _rows(root, str(file), tiers)
    absent = [name for name in tiers if not any(name in _names(tier) for tier in seen)]
    if absent:
        raise SignfaceError(
            f"no file has a tier {absent[0]}", hint=f"the tiers are {', '.join(sorted(seen)) or 'none'}"
        )
    depth = max((len(row) - len(COLUMNS) for row in rows), default=0) // 2
    columns = [*COLUMNS, *(name for level in range(max(depth, 1)) for name in _parent_columns(level))]
    table = pd.DataFrame(rows, columns=columns)
    texts = [name for name in columns if name not in ("start_s", "end_s")]
    return table.astype({"start_s": float, "end_s": float}).fillna(dict.fromkeys(texts, ""))


def _rows(root: etree._Element, file: str, wanted: Sequence[str]) -> list[dict[str, object]]:
    spans = annotation_spans(root)
    tier_of = {
        annotation.get("ANNOTATION_ID") or "": tier
        for tier in root.iterfind("TIER")
        for annotation in _annotations(tier)
    }
    value_of = {
        annotation.get("ANNOTATION_ID") or "": annotation.findtext("ANNOTATION_VALUE") or ""
        for annotation in root.iterfind("TIER/ANNOTATION/*")
    }
    parents = _parents(root, spans)
    rows = []
    for tier in root.iterfind("TIER"):
        if wanted and not any(name in _names(tier.get("TIER_ID") or "") for name in wanted):
            continue
        identifiers = [annotation.get("ANNOTATION_ID") or "" for annotation in _annotations(tier)]
        identifiers.sort(key=lambda identifier: _order(spans.get(identifier, (None, None))))
        for identifier in identifiers:
            start, end = spans.get(identifier, (None, None))
            row: dict[str, object] = {
                "file": file,
                "tier": tier.get("TIER_ID") or "",
                "participant": tier.get("PARTICIPANT") or "",
                "annotator": tier.get("ANNOTATOR") or "",
                "type": tier.get("LINGUISTIC_TYPE_REF") or "",
                "annotation": identifier,
                "start_s": None if start is None else start / 1000,
                "end_s": None if end is None else end / 1000,
                "value": value_of[identifier],
            }
            above, level, passed = parents.get(identifier), 0, {identifier}
            while above is not None and above in tier_of and above not in passed:
                passed.add(above)
                values = (tier_of[above].get("TIER_ID") or "", value_of[above])
                row |= dict(zip(_parent_columns(level), values, strict=True))
                above, level = parents.get(above), level + 1
            rows.append(row)
    return rows


def _parents(root: etree._Element, spans: dict[str | None, Span]) -> dict[str | None, str | None]:
    """What each annotation hangs on; for those with times of their own the one of the parent tier in which they lie."""
    parents = parent_annotations(root)
    tiers = {tier.get("TIER_ID"): tier for tier in root.iterfind("TIER")}
    for tier in tiers.values():
        above = tiers.get(tier.get("PARENT_REF"))
        if above is None:
            continue
        there = sorted(
            (start, end, identifier)
            for identifier in (annotation.get("ANNOTATION_ID") or "" for annotation in _annotations(above))
            for start, end in [spans.get(identifier, (None, None))]
            if start is not None and end is not None
        )
        for annotation in tier.iterfind("ANNOTATION/ALIGNABLE_ANNOTATION"):
            identifier = annotation.get("ANNOTATION_ID")
            start, end = spans.get(identifier or "", (None, None))
            if start is None or end is None:
                continue
            middle = (start + end) / 2
            place = bisect.bisect_right([one[0] for one in there], middle) - 1
            if place >= 0 and middle < there[place][1]:
                parents[identifier] = there[place][2]
    return parents


def _annotations(tier: etree._Element) -> list[etree._Element]:
    return tier.findall("ANNOTATION/*")


def _order(span: Span) -> tuple[bool, int, int]:
    return (span[0] is None, span[0] or 0, span[1] or 0)


def _names(tier: str) -> tuple[str, str]:
    """What a tier may be asked for by."""
    return tier, tier.partition("@")[0]


def _parent_columns(level: int) -> tuple[str, str]:
    suffix = f"_{level + 1}" if level else ""
    return f"parent_tier{suffix}", f"parent_value{suffix}"


def check_table_file(path: str | PathLike[str]) -> None:
    """Refuse a file that is neither `.csv` nor `.parquet`, before anything is read."""
    if Path(path).suffix.lower() not in (".csv", ".parquet"):
        raise SignfaceError("is no table that can be written", file=path, hint="name a .csv or .parquet file")


def write_table(table: pd.DataFrame, path: str | PathLike[str]) -> None:
    """Write a table as `.csv` (UTF-8) or `.parquet`, whole or not at all.

    Raises
    ------
    SignfaceError
        Another ending, or the folder cannot be written.
    """
    file = Path(path)
    check_table_file(file)
    with whole_file(file) as temporary:
        if file.suffix.lower() == ".csv":
            table.to_csv(temporary, index=False)
        else:
            table.to_parquet(temporary, index=False)
