"""One take of a run: solved, annotated, logged, in whatever process.

- `Job`, `Outcome`: all that a process needs, and what became of the take.
- `annotate_job`: do it; whatever goes wrong is told in the outcome.
- `solve_job`: its first half.
- `write_log`: the log of a take, whose last line says what became of it.
"""

from __future__ import annotations

import contextlib
import datetime
import hashlib
import os
import socket
import time
import traceback
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from signface.corpus.describing import stored_or_solved
from signface.corpus.manifest import TakeEntry
from signface.corpus.origin import SOLVING_CODE, Origin, Recipe, code_digest, find_origin, shipped_digest, take_name
from signface.corpus.store import DescriptorStore
from signface.errors import SignfaceError
from signface.files import whole_file
from signface.settings.eaf import EafOptions
from signface.signer import Signer

if TYPE_CHECKING:
    from signface.label.model import TrainedModel

LOGS = "logs"

#: The date in every file of a run: the same corpus gives the same bytes on any day.
DATE = "2000-01-01T00:00:00+00:00"

#: The modules between descriptors and annotation files.
ANNOTATING_CODE = ("frames.py", "segmentation", "label", "sequence", "channels", "elan", "annotation.py")

#: What can become of a take. `corrected`: an annotator worked in its `.eaf`, which stays as it is.
DONE, BEFORE, CORRECTED, FAILED = "done", "before", "corrected", "failed"


@dataclass(frozen=True)
class Further:
    """A model beside the classifier, whose segments get a tier of their own.

    Parameters
    ----------
    classifier, model : str
        A shipped name or a file, and its SHA-256.
    recipe : Recipe
        How its takes were solved, and this one is.
    signer : Signer
        With the level over takes that were solved so, where the model needs one.
    """

    classifier: str
    model: str
    recipe: Recipe
    signer: Signer


@dataclass(frozen=True)
class Job:
    """All that a process needs to annotate one take.

    Parameters
    ----------
    entry : TakeEntry
    corpus : Path
        Folder of the corpus.
    output : Path
        Folder of the annotations.
    recipe : Recipe
    classifier : str
        A shipped name or a file.
    model : str
        SHA-256 of the classifier's file.
    code : str
        SHA-256 of the modules between descriptors and annotation.
    options : EafOptions
        How it is written, with absolute paths.
    options_digest : str
        Their SHA-256, the content of their files included.
    signer : Signer
        Who signs, with the level where the classifier needs one.
    further : tuple of Further
        Further models.
    """

    entry: TakeEntry
    corpus: Path
    output: Path
    recipe: Recipe
    classifier: str
    model: str
    code: str
    options: EafOptions
    options_digest: str
    signer: Signer
    further: tuple[Further, ...] = ()

    @property
    def take(self) -> str:
        """Name of the take in the corpus."""
        return take_name(self.entry, self.corpus)

    @property
    def eaf(self) -> Path:
        """Where its annotation goes."""
        return self.output / f"{self.take}.eaf"

    @property
    def log(self) -> Path:
        """Where its log goes."""
        return self.output / LOGS / f"{self.take}.log"


@dataclass(frozen=True)
class Outcome:
    """What became of a take.

    Parameters
    ----------
    take : str
    state : str
        `done`, `before` (nothing was left to do), `corrected` (left as the annotator made it) or `failed`.
    solved : bool
        Whether descriptors had to be solved.
    message : str
        What was found, or what is wrong.
    seconds : float
        How long it took.
    """

    take: str
    state: str
    solved: bool = False
    message: str = ""
    seconds: float = 0.0


def solve_job(job: Job) -> Outcome:
    """Make sure that the store has the descriptors of a take; a take that cannot be solved is told when annotated."""
    with contextlib.suppress(Exception):
        origin = find_origin(job.entry, job.corpus, job.recipe)
        stored_or_solved(job.entry, origin, DescriptorStore(job.corpus), job.corpus)
    return Outcome(job.take, DONE)


def annotate_job(job: Job) -> Outcome:
    """Solve and annotate one take and write its log; whatever goes wrong is told in the outcome, never raised."""
    begun = time.monotonic()
    notes: list[str] = []
    try:
        state, solved, message = _annotate(job, notes)
    except SignfaceError as error:
        state, solved, message = FAILED, False, str(error)
    except Exception as error:  # a defect of ours in one take must not stop the others
        state, solved = FAILED, False
        message = f"{job.entry.path}: a defect of signface, {type(error).__name__}: {error}"
        notes += traceback.format_exc().splitlines()
    if state == FAILED:
        with contextlib.suppress(SignfaceError, OSError):  # where nothing can be written, the outcome says so
            write_log(job, [*notes, message, FAILED])
    return Outcome(job.take, state, solved, message, time.monotonic() - begun)


def _annotate(job: Job, notes: list[str]) -> tuple[str, bool, str]:
    """State, whether it was solved, and what was found; `notes` gets what the log should say."""
    from signface.annotation import annotate, find_clause
    from signface.elan.writing import check_writable, write_eaf

    if (job.recipe.solver, job.code) != (code_digest(*SOLVING_CODE), code_digest(*ANNOTATING_CODE)):
        raise SignfaceError(
            f"{socket.gethostname()} has another version of signface than the machine that began the run",
            hint="install the same one everywhere",
        )
    origin = find_origin(job.entry, job.corpus, job.recipe)
    further = [find_origin(job.entry, job.corpus, one.recipe) for one in job.further]
    ending = f"{DONE} {_annotation_key(job, [origin, *further])}"
    if job.eaf.is_file() and _last_line(job.log) == ending:
        return BEFORE, False, ""
    store = DescriptorStore(job.corpus)
    descriptors, solved = stored_or_solved(job.entry, origin, store, job.corpus)
    notes += [f"recording {origin.file} (SHA-256 {origin.recording})", *descriptors.history]
    notes.append(f"{'solved into' if solved else 'taken from'} {store.path(origin)}")
    try:
        check_writable(job.eaf)
    except SignfaceError as error:
        write_log(job, [*notes, str(error), CORRECTED])
        return CORRECTED, solved, f"{job.eaf}: was worked in and stays as it is"
    model = _model(job.classifier, job.model)
    clauses = []
    for one, its in zip(job.further, further, strict=True):
        seen, _ = stored_or_solved(job.entry, its, store, job.corpus)
        clauses.append(find_clause(seen, _model(one.classifier, one.model), signer=one.signer))
    channels = job.options.channels or False
    annotation = annotate(descriptors, model, signer=job.signer, channels=channels, clauses=clauses)
    properties = {"file": origin.file}
    write_eaf(annotation, job.eaf, options=job.options, video=job.entry.video, date=DATE, properties=properties)
    write_log(job, [*notes, str(annotation), f"written to {job.eaf}", ending])
    return DONE, solved, str(annotation)


def _annotation_key(job: Job, origins: list[Origin]) -> str:
    """SHA-256 of all that an annotation depends on, from the origins of its descriptors and of each further model's."""
    video = "" if job.entry.video is None else os.path.relpath(job.entry.video, job.output)
    content = [
        origins[0].key,
        job.model,
        job.code,
        job.options_digest,
        job.entry.signer,
        video,
        job.signer.level_digest,
    ]
    for one, its in zip(job.further, origins[1:], strict=True):
        content += [its.key, one.model, one.signer.level_digest]
    return hashlib.sha256("\n".join(content).encode()).hexdigest()


def write_log(job: Job, lines: list[str]) -> None:
    """Write the log of a take; its last line says what became of it."""
    now = datetime.datetime.now().astimezone().isoformat(timespec="seconds")
    with whole_file(job.log) as temporary:
        temporary.write_text("\n".join([f"{job.take}, {now}, {socket.gethostname()}", *lines, ""]), encoding="utf-8")


def _last_line(log: Path) -> str:
    try:
        return log.read_text(encoding="utf-8").rstrip("\n").rpartition("\n")[2]
    except (OSError, UnicodeDecodeError):
        return ""


@lru_cache(maxsize=4)
def _model(classifier: str, digest: str) -> TrainedModel:
    """A classifier whose content is the one that was asked for."""
    from signface.label.persistence import load_model

    if shipped_digest("classifiers", ".skops", classifier) != digest:
        raise SignfaceError("is not the classifier that the run began with", file=classifier, hint="run again")
    return load_model(classifier)
