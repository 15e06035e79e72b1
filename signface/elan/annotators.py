"""What several annotators wrote, as tables that can be compared.

- `read_tiers`: the tiers of a file.
- `read_annotators`: those of several files, or of one that holds several annotators, under short names.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import pandas as pd
from lxml import etree

from signface.elan.document import Row, tier_rows
from signface.elan.links import film_origin, media_origins
from signface.elan.reference import annotation_root, rows_table
from signface.elan.translation import MappingOrFile, translated
from signface.errors import SignfaceError, SignfaceWarning

#: How tiers of annotators can be called: alike, or with the annotator before, behind or as participant.
MATCHING = ("name", "prefix", "suffix", "participant")


def read_tiers(
    eaf: str | PathLike[str], *, tiers: Sequence[str] = (), video: str | PathLike[str] | None = None
) -> dict[str, pd.DataFrame]:
    """Every tier that hangs on no other, as a table `start_s, end_s, label`; annotations without a value left out.

    Times are in the clock of the film (`signface.elan.links.film_origin`), labels without blanks at their ends. A tier
    whose annotations overlap or have no time is left out with a `SignfaceWarning`, unless it is asked for.

    Parameters
    ----------
    eaf : path
    tiers : sequence of str
        Tiers that are wanted besides, such as dependent ones; names that the file does not have are passed over.
    video : path, optional
        As for `signface.read_reference`.

    Raises
    ------
    SignfaceError
        The file is no EAF, a tier asked for is broken, or films begin at different times and none is named.

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
    root = annotation_root(file)
    return _tables(root, file, film_origin(root, file, video), tiers)


def read_annotators(
    files: Sequence[str | PathLike[str]],
    *,
    mapping: MappingOrFile | None = None,
    tiers: Sequence[str] = (),
    match: str = "name",
    separator: str = "_",
    video: str | PathLike[str] | None = None,
) -> dict[str, dict[str, pd.DataFrame]]:
    """The tiers of several annotators of one take, in the clock of the film that all files link.

    Parameters
    ----------
    files : sequence of path
        One for each annotator, or one that holds all.
    mapping : mapping or path, optional
        Of our names to the laboratory's (`signface.elan.translation.translated`).
    tiers : sequence of str
        Tiers that are wanted besides the independent ones. Two or more of one file are an annotator each.
    match : str
        `name`: tiers of one name are compared, an annotator is a file. `prefix`, `suffix`: the annotator stands before
        the first, or behind the last, `separator` of the name. `participant`: it is the tier's participant, and the
        rest of the name, or the linguistic type where the participant is not in the name, says what is compared.
    separator : str
    video : path, optional
        As for `signface.read_reference`.

    Returns
    -------
    dict of str to dict of str to DataFrame
        Annotators' files under their stems (their paths, where stems are equal), and their tiers.

    Raises
    ------
    SignfaceError
        As `read_tiers`; a file is named twice, or one file holds one annotator only.

    Examples
    --------
    >>> import signface as sf
    >>> folder = sf.datasets.mini_file().with_name("reference")
    >>> {name: list(tiers) for name, tiers in read_annotators([folder / "M2_EU_04.eaf"] , match="suffix",
    ...                                                       separator="@").items()}
    {'M2': ['affect']}
    """
    paths = [Path(file) for file in files]
    resolved = [path.resolve() for path in paths]
    twice = next((path for path in paths if resolved.count(path.resolve()) > 1), None)
    if twice is not None:
        raise SignfaceError(
            "is named twice",
            file=twice,
            hint="name each file once; tiers of one file: --tier, --match",
        )
    if match not in MATCHING:
        raise SignfaceError(f"tiers are matched by {', '.join(MATCHING)}, not by {match}")
    roots = [annotation_root(path) for path in paths]
    origins = _origins(roots, paths, video)
    stems = [path.stem for path in paths]
    names = stems if len(set(stems)) == len(stems) else [str(path) for path in paths]
    wanted = list(tiers)
    if match != "name":  # dependent tiers of an annotator can be named by what they are of
        wanted = [
            tier
            for root in roots
            for tier, (_, what) in _parties(root, match, separator).items()
            if what in tiers or tier in tiers
        ]
    annotators = {
        name: _tables(root, path, origin, wanted)
        for name, root, path, origin in zip(names, roots, paths, origins, strict=True)
    }
    if mapping is not None:
        annotators = translated(annotators, mapping)
    if match != "name":
        return _by_party(annotators, roots, match, separator)
    if len(annotators) == 1 and len(tiers) > 1:
        (held,) = annotators.values()
        missing = [tier for tier in tiers if tier not in held]
        if missing:
            raise SignfaceError(f"no tier {missing[0]}", file=paths[0], hint=f"its tiers are {', '.join(held)}")
        what = " / ".join(tiers)
        return {tier: {what: held[tier]} for tier in tiers}
    return annotators


def _tables(root: etree._Element, file: Path, origin: int, wanted: Sequence[str]) -> dict[str, pd.DataFrame]:
    """The independent tiers and those wanted, as tables; broken ones left out or refused."""
    rows, tables = tier_rows(root), {}
    for tier in root.iterfind("TIER"):
        name = tier.get("TIER_ID") or ""
        if tier.get("PARENT_REF") is not None and name not in wanted:
            continue
        filled = [(start, end, value.strip()) for start, end, value in rows[name] if value.strip()]
        fault = _fault(filled)
        if fault and name in wanted:
            raise SignfaceError(f"{fault} on the tier {name}", file=file, hint="mend it in ELAN")
        if fault:
            note = f"{file}: {fault} on the tier {name}, which is left out"
            warnings.warn(note, SignfaceWarning, stacklevel=3)
        else:
            tables[name] = rows_table(filled, origin)
    return tables


def _fault(rows: Sequence[Row]) -> str | None:
    """Why rows in order of time are no table to compare; None when they are."""
    last = None
    for start, end, value in rows:
        if start is None or end is None:
            return f"the annotation {value!r} has no time"
        if start >= end:
            return f"the annotation {value!r} does not end after it starts ({start} ms)"
        if last is not None and start < last:
            return f"annotations overlap at {start} ms"
        last = end
    return None


def _origins(roots: Sequence[etree._Element], files: Sequence[Path], video: str | PathLike[str] | None) -> list[int]:
    """Of each file the time of the film at its time 0, in milliseconds; the film is one that all files link."""
    if video is None and len(roots) > 1:
        held = [media_origins(root, file) for root, file in zip(roots, files, strict=True)]
        shared = [name for name in held[0] if all(name in theirs for theirs in held)]
        apart = {tuple(theirs[name] - held[0][name] for theirs in held) for name in shared}
        if len(apart) == 1:
            return [theirs[shared[0]] for theirs in held]
    if len(roots) == 1 and video is None:
        return [next(iter(media_origins(roots[0], files[0]).values()), 0)]  # one file has one clock
    return [film_origin(root, file, video) for root, file in zip(roots, files, strict=True)]


def _parties(root: etree._Element, match: str, separator: str) -> dict[str, tuple[str, str]]:
    """Of each tier that names an annotator: the annotator, and what is compared."""
    parties = {}
    for tier in root.iterfind("TIER"):
        name, participant = tier.get("TIER_ID") or "", (tier.get("PARTICIPANT") or "").strip()
        if match == "participant":
            if participant:
                rest = name.replace(participant, "", 1).strip(f" {separator}_-@.") if participant in name else ""
                parties[name] = (participant, rest or tier.get("LINGUISTIC_TYPE_REF") or "")
            continue
        before, _, behind = name.partition(separator) if match == "prefix" else name.rpartition(separator)
        if before and behind:
            parties[name] = (before, behind) if match == "prefix" else (behind, before)
    return parties


def _by_party(
    annotators: dict[str, dict[str, pd.DataFrame]], roots: Sequence[etree._Element], match: str, separator: str
) -> dict[str, dict[str, pd.DataFrame]]:
    """The tables under who made them, over all files."""
    result: dict[str, dict[str, pd.DataFrame]] = {}
    for held, root in zip(annotators.values(), roots, strict=True):
        for name, (who, what) in _parties(root, match, separator).items():
            if name not in held:
                continue
            if what in result.setdefault(who, {}):
                raise SignfaceError(f"{who} would have two tiers {what}", hint="match the tiers otherwise (--match)")
            result[who][what] = held[name]
    if not result:
        there = sorted({name for held in annotators.values() for name in held})
        raise SignfaceError(f"no tier names its annotator by {match}", hint=f"the tiers are {', '.join(there)}")
    return result
