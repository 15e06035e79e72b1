"""What is wrong with a corpus, all of it at once, before anybody waits for a run.

- `check_corpus`: every problem of a corpus, and a line that sums the corpus up.
- `check_take`: those of one take: its recording, its markers, its reference annotation.
- `grouped`: equal problems of many takes as one.

Each problem is a line that names the file, what is wrong and what to do.
"""

from __future__ import annotations

import os
import re
from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from signface.corpus.cluster import WorkerDied, on_cores
from signface.corpus.describing import face_for, layout_for, read_entry, recipe_of
from signface.corpus.manifest import TakeEntry, find_manifest, read_rows
from signface.corpus.origin import Recipe, content_digest, make_recipe, take_name
from signface.descriptors import Descriptors
from signface.elan.translation import MappingOrFile, as_mapping, translated
from signface.errors import SignfaceError, counted
from signface.settings.solve import SolveSettings

if TYPE_CHECKING:
    from signface.label.vocabulary import Vocabulary
    from signface.takes.take import Take

#: An annotation may reach this far beyond its take (s): annotators place boundaries by the video, a few frames off.
BEYOND_S = 0.2

#: An annotation that covers less than this part of its take is that of another one, or is not finished.
LEAST_COVERED = 0.5

#: Fewest head markers that carry the motion of the head (`signface.takes.stabilisation`).
HEAD_MARKERS = 3


@dataclass(frozen=True)
class CheckedCorpus:
    """What a check found.

    Parameters
    ----------
    problems : tuple of str
        One line each; empty when there is none.
    summary : str
        Takes, signers, annotated takes and duration.
    """

    problems: tuple[str, ...]
    summary: str


@dataclass(frozen=True)
class TakeCheck:
    """One take to look at, and all signers of its corpus."""

    number: int
    entry: TakeEntry
    recipe: Recipe
    signers: frozenset[str]
    tier: str = "affect"
    vocabulary: Vocabulary | None = None
    sparse: bool = False
    mapping: MappingOrFile | None = None


@dataclass(frozen=True)
class CheckedTake:
    """Problems of one take, its duration in seconds and the SHA-256 of its recording (empty where unreadable)."""

    problems: tuple[str, ...]
    duration: float
    digest: str


def check_corpus(
    path: str | PathLike[str],
    *,
    settings: SolveSettings | None = None,
    tier: str = "affect",
    vocabulary: Vocabulary | None = None,
    sparse: bool = False,
    mapping: MappingOrFile | None = None,
    workers: int | None = None,
    progress: Callable[[Iterable, int], Iterable] = lambda items, total: items,
) -> CheckedCorpus:
    """Find every problem of a corpus.

    - rows: missing columns and cells, files that are not there, takes listed twice;
    - recordings: unreadable, markers that no layout knows, too few head markers, a neutral time outside the take,
      the same content under two names (it would be trained on and tested);
    - signers: names that differ in their case only, tiers of signers whom `takes.csv` does not know;
    - annotations: no EAF, no reference tier, labels outside the vocabulary, overlaps, an annotation that reaches beyond
      its take, one annotation for two takes; where transitions are annotated, as in affect, also an empty tier and one
      that covers less than half of its take.

    Parameters
    ----------
    path : path
        The folder of the corpus or its `takes.csv`.
    settings : SolveSettings, optional
        As in `signface.corpus.running.run_corpus`.
    tier, vocabulary, sparse, mapping : optional
        As in `signface.corpus.examples.solve_corpus`.
    workers : int, optional
        Takes looked at at the same time; one for each core by default.
    progress : callable, optional
        Wraps the iterator of takes, given their number too.

    Raises
    ------
    SignfaceError
        There is no corpus, its manifest cannot be read as a table, or there is no such face or layout.

    Examples
    --------
    >>> import signface as sf
    >>> checked = check_corpus(sf.datasets.mini_file().parent)
    >>> len(checked.problems)
    0
    """
    file = find_manifest(path)
    recipe = make_recipe(settings)
    entries, rows = read_rows(file)
    problems = [f"{file}: {problem}" for problem in rows]
    problems += _problems_of_names(file, entries)
    signers = frozenset(entry.signer for entry in entries)
    rules = None if mapping is None else as_mapping(mapping)
    known: dict[tuple[str | None, ...], Recipe] = {}
    checks = []
    for number, entry in enumerate(entries):
        try:
            solved_as = recipe_of(entry, recipe, known)
        except SignfaceError as error:
            problems.append(f"{entry.path}: {error}")
            solved_as = recipe
        checks.append(TakeCheck(number, entry, solved_as, signers, tier, vocabulary, sparse, rules))
    looked_at: dict[int, CheckedTake] = {}
    results = on_cores(check_take, checks, workers=min(workers or os.cpu_count() or 1, max(1, len(checks))))
    for check, result in progress(results, len(checks)):
        if isinstance(result, WorkerDied):
            result = CheckedTake((f"{check.entry.path}: {result}",), 0.0, "")
        looked_at[check.number] = result
    same = defaultdict(list)
    for number, entry in enumerate(entries):
        problems += looked_at[number].problems
        if looked_at[number].digest:
            same[looked_at[number].digest].append(entry)
    for copies in same.values():
        if len(copies) > 1:
            others = ", ".join(str(entry.path) for entry in copies[1:])
            problems.append(f"{copies[0].path}: holds the same recording as {others}. Leave all but one out")
    seconds = sum(take.duration for take in looked_at.values())
    annotated = sum(entry.annotation is not None for entry in entries)
    summary = (
        f"{file.parent}: {counted(len(entries), 'take')} of {counted(len(signers), 'signer')}, "
        f"{annotated} annotated, {seconds:.0f} s"
    )
    # An annotation that two takes share is looked at twice.
    return CheckedCorpus(tuple(dict.fromkeys(problems)), summary)


def grouped(problems: Iterable[str], fewest: int = 3) -> list[str]:
    """Problems with those that are equal but for the file and the numbers in them told once, with their number.

    Parameters
    ----------
    problems : iterable of str
        Lines that open with the path of a file.
    fewest : int
        So many equal problems are told as one.

    Examples
    --------
    >>> grouped([f"lab/{name}.csv: has 2 of the 6 head markers, 3 are needed" for name in ("a", "b", "c")])
    ['in 3 files, first lab/a.csv: has 2 of the 6 head markers, 3 are needed']
    """
    alike: dict[str, list[str]] = defaultdict(list)
    for problem in problems:
        path, _, what = problem.partition(": ")
        alike[re.sub(r"\d+", "0", re.sub(rf"\b{re.escape(Path(path).stem)}\b", "", what))].append(problem)
    lines = []
    for same in alike.values():
        lines += same if len(same) < fewest else [f"in {len(same)} files, first {same[0]}"]
    return lines


def _problems_of_names(file: Path, entries: list[TakeEntry]) -> list[str]:
    """What the rows say that cannot be right together."""
    problems = []
    spellings = defaultdict(set)
    names, annotations = defaultdict(list), defaultdict(list)
    for entry in entries:
        spellings[entry.signer.casefold()].add(entry.signer)
        names[take_name(entry, file.parent)].append(entry)
        if entry.annotation is not None:
            annotations[entry.annotation.resolve(), entry.signer, entry.start_s].append(entry)
    for variants in spellings.values():
        if len(variants) > 1:
            problems.append(f"{file}: the signers {' and '.join(sorted(variants))} differ in their case only")
    for name, same in names.items():
        if len(same) > 1:
            files = ", ".join(entry.path.name for entry in same)
            problems.append(f"{file}: {files} would share the name {name}. Rename one of them")
    for (annotation, signer, _), same in annotations.items():
        if len(same) > 1:
            files = ", ".join(entry.path.name for entry in same)
            problems.append(f"{annotation}: is the annotation of several takes of {signer} ({files})")
    return problems


def check_take(check: TakeCheck) -> CheckedTake:
    """Problems of one take; one that cannot be looked at at all is a problem too."""
    entry = check.entry
    problems: list[str] = []
    span, digest = None, ""
    if entry.path.is_file():  # a missing one is told with the row
        try:
            recording = read_entry(entry, check.recipe)
            span, digest = (recording.start, recording.start + recording.duration), content_digest(entry.path)
            if not isinstance(recording, Descriptors):
                problems += _problems_of_markers(entry, check.recipe, recording)
                if entry.neutral_s is not None and not span[0] <= entry.neutral_s <= span[1]:
                    problems.append(
                        f"{entry.path}: its neutral_s of {entry.neutral_s:g} s is outside the take, "
                        f"{span[0]:.3f} to {span[1]:.3f} s"
                    )
        except SignfaceError as error:
            problems.append(str(error) if error.file else f"{entry.path}: {error}")
        except Exception as error:
            problems.append(f"{entry.path}: a defect of signface, {type(error).__name__}: {error}")
    if entry.annotation is not None and entry.annotation.is_file():
        problems += _problems_of_reference(check, span)
    return CheckedTake(tuple(problems), span[1] - span[0] if span else 0.0, digest)


def _problems_of_markers(entry: TakeEntry, recipe: Recipe, take: Take) -> list[str]:
    """Whether the markers are those of the layout."""
    from signface.solver.layout_fit import check_take as check_fit_of
    from signface.takes.labels import rename_to

    layout = layout_for(recipe, take.labels)
    try:
        labels = rename_to(take, layout.labels).labels
    except SignfaceError as error:
        return [str(error.at(entry.path))]
    try:
        check_fit_of(take, layout, face_for(recipe))
    except SignfaceError as error:
        return [str(error.at(entry.path))]
    heads = [label for label in layout.head_labels if label in labels]
    if len(heads) >= HEAD_MARKERS:
        return []
    return [
        f"{entry.path}: has {len(heads)} of the {len(layout.head_labels)} head markers of {layout.name}, "
        f"{HEAD_MARKERS} are needed"
    ]


def _problems_of_reference(check: TakeCheck, span: tuple[float, float] | None) -> list[str]:
    """What is wrong with a reference annotation, by itself and beside its take (start and end in seconds)."""
    from signface.elan.annotators import read_tiers
    from signface.elan.reference import read_reference, reference_vocabulary
    from signface.label.vocabulary import AFFECT, NONE, Vocabulary

    entry, tier, mapping = check.entry, check.tier, check.mapping
    file = entry.annotation
    assert file is not None
    problems = []
    try:
        tiers = read_tiers(file)
        if mapping is not None:
            tiers = translated({file.name: tiers}, mapping)[file.name]
        annotators = {name.removeprefix(f"{tier}@") for name in tiers if name.startswith(f"{tier}@")}
        strangers = sorted(annotators - check.signers)
        problems += [f"{file}: its tier {tier}@{name} is of a signer who is not in takes.csv" for name in strangers]
        rows = next((tiers[name] for name in (f"{tier}@{entry.signer}", tier) if name in tiers), None)
        annotated = () if rows is None else tuple(dict.fromkeys(rows["label"].str.strip()))
        vocabulary = check.vocabulary
        if vocabulary is None and (annotated or tier == "affect"):
            vocabulary = reference_vocabulary([(file, entry.signer)], tier, mapping=mapping)
        if vocabulary is not None and not (check.sparse or vocabulary.transitions):
            vocabulary = vocabulary.including(NONE)
        foreign = [label for label in annotated if vocabulary is not None and label not in vocabulary.allowed]
        try:
            reference = read_reference(
                file, entry.signer, tier=tier, vocabulary=vocabulary, mapping=mapping, video=entry.video
            )
        except SignfaceError:
            if not foreign:
                raise
            assert vocabulary is not None
            problems.append(
                f"{file}: the labels {', '.join(map(repr, foreign))} on the tier of {entry.signer} are not in the "
                f"vocabulary. Stable labels are {' '.join(vocabulary.values)}"
                + ("; transitions join two of them, as NA" if vocabulary == AFFECT else "")
            )
            said = Vocabulary("annotated", annotated)
            reference = read_reference(
                file, entry.signer, tier=tier, vocabulary=said, mapping=mapping, video=entry.video
            )
    except SignfaceError as error:
        return [*problems, str(error) if error.file is not None else f"{file}: {error}"]
    table = reference.table
    whole = vocabulary is not None and vocabulary.transitions  # elsewhere, moments in which nothing happens are empty
    if not len(table):
        if not whole:
            return problems
        return [*problems, f"{file}: its reference tier of {entry.signer} is empty"]
    if span is None:
        return problems
    first, last = float(table["start_s"].min()), float(table["end_s"].max())
    if first < span[0] - BEYOND_S or last > span[1] + BEYOND_S:
        problems.append(
            f"{file}: annotates {first:.3f} to {last:.3f} s, but the take {entry.path.name} lasts from {span[0]:.3f} "
            f"to {span[1]:.3f} s. Is it the annotation of this take? Does start_s say where the take begins?"
        )
    covered = float((table["end_s"].clip(*span) - table["start_s"].clip(*span)).sum()) / (span[1] - span[0])
    if whole and covered < LEAST_COVERED:
        problems.append(
            f"{file}: annotates {covered:.0%} of the take {entry.path.name}. Is it the annotation of this take?"
        )
    return problems
