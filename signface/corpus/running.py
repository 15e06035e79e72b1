"""The whole corpus at once: every take solved and annotated, wherever the run was stopped before.

- `run_corpus`: go through a corpus, yield an `Outcome` for each take.
- `plan_jobs`: the jobs of a run, and the rows that cannot be one.
- `signface.corpus.jobs`: one take, in whatever process.

What is done is known from the disk alone. The descriptors of a take are in the store under the key of their origin; its
annotation is done when its log ends with the key of everything that the annotation depends on, and the log is written
last. A run that was killed at any moment therefore repeats no more than the takes it was working on, and since no file
holds the time of day (except the logs), it ends with the same bytes.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from signface.channels.rules import read_channels
from signface.corpus.cluster import WorkerDied, on_cluster, on_cores
from signface.corpus.describing import recipe_of
from signface.corpus.jobs import (
    ANNOTATING_CODE,
    FAILED,
    LOGS,
    Further,
    Job,
    Outcome,
    annotate_job,
    solve_job,
    write_log,
)
from signface.corpus.manifest import Corpus, TakeEntry
from signface.corpus.origin import Recipe, code_digest, find_origin, make_recipe, shipped_digest, take_name
from signface.corpus.signers import find_signer, warn_of_unknown_rests
from signface.corpus.store import DescriptorStore
from signface.elan.mapping import read_mapping
from signface.errors import SignfaceError
from signface.settings.choices import BY_SIGNER
from signface.settings.eaf import EafOptions
from signface.settings.solve import SolveSettings

if TYPE_CHECKING:
    from signface.label.model import Card
    from signface.signer import Signer

#: Where annotations go when nothing else is said, in the folder of the corpus.
ANNOTATED = "annotated"
LOCK = ".lock"


def run_corpus(
    corpus: Corpus,
    *,
    output: Path | None = None,
    settings: SolveSettings | None = None,
    classifier: str = "default",
    clauses: Sequence[str] = (),
    workers: int | None = None,
    scheduler: str | None = None,
    options: EafOptions | None = None,
) -> Iterator[Outcome]:
    """Solve and annotate every take of a corpus; what is there already is not done again.

    Parameters
    ----------
    corpus : Corpus
    output : Path, optional
        Folder of the annotations; `annotated` in the corpus by default. The logs are in its folder `logs`.
    settings, classifier :
        As in `signface.annotation.annotate`; a take whose row names a face or a layout has its own. Signers are those
        of `signface.corpus.signers`; where the classifier normalises signers and no level of theirs is known, all takes
        are solved first, and a signer's level is that of all of them.
    clauses : sequence of str
        Further models, shipped names or files, whose segments get tiers of their own; takes are solved for each as its
        training takes were.
    workers : int, optional
        Takes at a time on this machine; as many as it has cores by default.
    scheduler : str, optional
        Address of a Dask cluster to run on instead. Its machines see the corpus under the same path.
    options : EafOptions, optional
        Which channels are sought, and how files are written.

    Yields
    ------
    Outcome
        As the takes are done, in any order; a take that fails stops no other.

    Raises
    ------
    SignfaceError
        The run cannot begin: an output folder that cannot be written or in which another run is at work, two takes
        of one name, no such face, layout or classifier, no cluster.

    Examples
    --------
    >>> from shutil import copytree
    >>> import signface as sf
    >>> corpus = sf.read_corpus(copytree(sf.datasets.mini_file().parent, "feel"))
    >>> for outcome in sf.run_corpus(corpus.select(kinds=["IE"]), workers=1):
    ...     print(outcome.take, outcome.state)
    M1_IE_J done
    """
    folder = Path(os.path.abspath(corpus.folder))
    output = folder / ANNOTATED if output is None else Path(os.path.abspath(output))
    warn_of_unknown_rests(corpus, folder, read_as=None if settings is None else settings.read_as)
    store = DescriptorStore(folder)  # says at once when a newer signface wrote it
    recipe = make_recipe(settings)
    jobs, failed = plan_jobs(corpus, output, recipe, classifier=classifier, options=options)
    with only_run_in(output):
        yield from failed

        def everywhere(work: Callable[[Job], Outcome], jobs: list[Job]) -> Iterator[tuple[Job, Any]]:
            if scheduler is not None:
                return on_cluster(work, jobs, scheduler=scheduler)
            return on_cores(work, jobs, workers=min(workers or os.cpu_count() or 1, max(1, len(jobs))))

        from signface.label.persistence import read_card

        def with_levels(jobs: list[Job], card: Card) -> list[Job]:
            if card.normalise not in BY_SIGNER:
                return jobs
            for _ in everywhere(solve_job, jobs):  # what fails says so when it is annotated
                pass
            return _with_levels(jobs, store, card.bases)

        seen_by = [with_levels(_solved_as(jobs, card), card) for card in map(read_card, clauses)]
        jobs = with_levels(jobs, read_card(classifier))
        for name, same in zip(clauses, seen_by, strict=True):
            model = shipped_digest("classifiers", ".skops", name)
            pairs = zip(jobs, same, strict=True)
            jobs = [replace(a, further=(*a.further, Further(name, model, b.recipe, b.signer))) for a, b in pairs]
        for job, result in everywhere(annotate_job, jobs):
            if isinstance(result, WorkerDied):
                result = Outcome(job.take, FAILED, message=f"{job.entry.path}: {result}")
                write_log(job, [result.message, FAILED])
            yield result
        # Only now: a process of a run that was killed may have lived on for a while.
        clean_output(output, jobs)
        store.clean()


def plan_jobs(
    corpus: Corpus, output: Path, recipe: Recipe, *, classifier: str, options: EafOptions | None = None
) -> tuple[list[Job], list[Outcome]]:
    """The jobs of a run, with absolute paths, and the takes whose own face or layout is not there.

    Raises
    ------
    SignfaceError
        Two takes would be written to the same file, there is no such classifier, or a file
        of the options is missing or wrong.
    """
    options = (EafOptions() if options is None else options).absolute()
    if options.mapping is not None:
        read_mapping(options.mapping)  # a file that is wrong is named before the run
    if options.channels is not None:
        read_channels(options.channels)
    options_digest = options.content_digest
    model, code = shipped_digest("classifiers", ".skops", classifier), code_digest(*ANNOTATING_CODE)
    folder = Path(os.path.abspath(corpus.folder))
    known: dict[tuple[str | None, ...], Recipe] = {}
    jobs: dict[str, Job] = {}
    signers: dict[str, Signer] = {}
    failed = []
    for entry in corpus:
        name = take_name(entry, corpus.folder)
        if name in jobs:
            raise SignfaceError(
                f"{jobs[name].entry.path.name} and {entry.path.name} would both be written to {name}.eaf",
                file=folder,
                hint="rename one of the recordings",
            )
        try:
            solved_as = recipe_of(entry, recipe, known)
        except SignfaceError as error:
            failed.append(Outcome(name, FAILED, message=f"{entry.path}: {error}"))
            continue
        if entry.signer not in signers:
            signers[entry.signer] = find_signer(folder, entry.signer)
        what = (classifier, model, code, options, options_digest, signers[entry.signer])
        jobs[name] = Job(_absolute(entry), folder, output, solved_as, *what)
    return list(jobs.values()), failed


def _solved_as(jobs: list[Job], card: Card) -> list[Job]:
    """The jobs, their takes solved as those that a model was trained on."""
    settings = next((job.recipe.settings for job in jobs), None)
    recipe = make_recipe(SolveSettings.from_dict(card.solve).for_take_of(settings))
    known: dict[tuple[str | None, ...], Recipe] = {}
    return [replace(job, recipe=recipe_of(job.entry, recipe, known)) for job in jobs]


def _with_levels(jobs: list[Job], store: DescriptorStore, bases: Sequence[str]) -> list[Job]:
    """The jobs with signers who have a level of these bases: of their file in the corpus, or of all their takes."""
    signers = {}
    for name in {job.entry.signer for job in jobs}:
        signer = find_signer(jobs[0].corpus, name)
        if signer.level is None or not set(bases) <= set(signer.level.names):
            takes = []
            for job in jobs:
                if job.entry.signer == name:
                    with contextlib.suppress(SignfaceError):
                        takes.append(store.read(find_origin(job.entry, job.corpus, job.recipe)))
            solved = [take for take in takes if take is not None]
            signer = signer.with_level(solved) if solved else replace(signer, level=None)
        signers[name] = signer
    return [replace(job, signer=signers[job.entry.signer]) for job in jobs]


@contextlib.contextmanager
def only_run_in(output: Path) -> Iterator[None]:
    """Keep other runs out of an output folder; the lock goes with the process, however it ends.

    Raises
    ------
    SignfaceError
        Another run is at work there, or the folder cannot be written.
    """
    try:
        import fcntl
    except ModuleNotFoundError:  # no such locks on Windows: two runs then do the same work twice, no harm is done
        yield
        return
    try:
        (output / LOGS).mkdir(parents=True, exist_ok=True)
        stream = (output / LOGS / LOCK).open("w")
    except OSError as error:
        raise SignfaceError(
            f"cannot be written ({error.strerror})", file=output, hint="choose a folder you may write to: -o FOLDER"
        ) from error
    with stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise SignfaceError(
                "another run is at work in this folder", file=output, hint="wait for it, or give another folder with -o"
            ) from error
        yield


def clean_output(output: Path, jobs: list[Job]) -> None:
    """Remove what a killed run left half written beside the files of these jobs (`signface.files.whole_file`)."""
    ours = {job.eaf.with_name(name) for job in jobs for name in _names_of(job)} | {job.log for job in jobs}
    for folder in {file.parent for file in ours}:
        for file in folder.glob(".*"):
            match = re.fullmatch(r"\.(.+)-[a-z0-9_]{8}(\.[a-z]+)", file.name)
            if match and folder / (match[1] + match[2]) in ours:
                file.unlink(missing_ok=True)


def _names_of(job: Job) -> list[str]:
    stem = job.eaf.stem
    return [f"{stem}.eaf", f"{stem}.pfsx", f"{stem}.curves.csv", f"{stem}_tsconf.xml"]


def _absolute(entry: TakeEntry) -> TakeEntry:
    """A row with absolute paths: a worker may stand in another folder."""
    return replace(
        entry,
        path=Path(os.path.abspath(entry.path)),
        video=None if entry.video is None else Path(os.path.abspath(entry.video)),
    )
