"""The synthetic corpus: who signs what, and the files it is written to.

- `synthesise`: the whole corpus into a folder.
- `plan_corpus`, `make_take`, `write_synthetic_take`: its steps, one take at a time.

Every take is drawn from its own stream of random numbers (seed, signer, kind, number), so that a corpus of three
signers contains the corpus of two, and one of utterances only contains the same utterances.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from os import PathLike
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from signface.corpus.manifest import Corpus, TakeEntry, read_corpus, write_takes
from signface.descriptors import Descriptors
from signface.descriptors_files import write_weights
from signface.elan.document import is_unmodified_output, read_document
from signface.elan.writing import write_eaf
from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.layout_files import read_layout
from signface.face.model import FaceModel
from signface.face.reading import read_face, read_identities
from signface.files import whole_file
from signface.segmentation.segments import Segments, write_segments
from signface.synth.expressions import AFFECTS, Habits, Spread, draw_habits
from signface.synth.heads import Head, draw_head
from signface.synth.markers import Glued, glue_markers, head_motion, record
from signface.synth.performance import perform
from signface.synth.programme import (
    KINDS,
    UTTERANCES,
    Programme,
    plan_isolated,
    plan_sequence,
    plan_utterance,
    reference_segments,
)
from signface.takes.formats.c3d import write_c3d
from signface.takes.take import Take

#: `change(weights, plan, time, names)`: (F, N) weights in [0, 1] made of those acted.
Change = Callable[[np.ndarray, Programme, np.ndarray, tuple[str, ...]], np.ndarray]

RATE = 200.0
FACE, LAYOUT = "default", "default-40"
#: What a folder made here holds; a folder without it is somebody else's.
RECORD = "synthetic.json"
#: Raised when the same seed no longer gives the same corpus.
EDITION = 1
#: An EAF has a date; the same corpus must have the same one.
DATE = "2018-05-07T12:00:00+00:00"
#: The signers of the corpus that ships; no other seed gives them.
MINI_SEED = 20180507


class Requested(Protocol):
    """What writing asks of a take to be made, by whichever generator; attributes as of `TakeRequest`."""

    @property
    def kind(self) -> str: ...

    @property
    def signer_name(self) -> str: ...

    @property
    def name(self) -> str: ...

    @property
    def sentence(self) -> str | None: ...


Request = TypeVar("Request", bound=Requested)


@dataclass(frozen=True)
class TakeRequest:
    """A take to be made.

    Parameters
    ----------
    seed : int
    signer : int
        From 0.
    kind : str
    number : int
        Which affect (IE, SE) or which utterance (EU), from 0.
    mini : bool
        A short one, for the corpus that ships.
    """

    seed: int
    signer: int
    kind: str
    number: int
    mini: bool = False

    @property
    def signer_name(self) -> str:
        """`S1`, `S2`, ...; `M1`, ... in the corpus that ships."""
        return f"{'M' if self.mini else 'S'}{self.signer + 1}"

    @property
    def name(self) -> str:
        """Name of the take: `S1_IE_J`, `S2_EU_07`."""
        which = f"{self.number + 1:02d}" if self.kind == "EU" else AFFECTS[self.number]
        return f"{self.signer_name}_{self.kind}_{which}"

    @property
    def sentence(self) -> str | None:
        """What is signed, the same for every signer: `07`; None for a take without words."""
        return f"{self.number + 1:02d}" if self.kind == "EU" else None

    def stream(self, *, what: int) -> np.random.Generator:
        """Random numbers of this take for one purpose."""
        key = (self.signer, 1 + KINDS.index(self.kind), self.number, what)
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=key))


@dataclass(frozen=True)
class Signer:
    """Somebody who does not exist, with markers on the face.

    Parameters
    ----------
    head : Head
    habits : Habits
    glued : Glued
    """

    head: Head
    habits: Habits
    glued: Glued


@dataclass(frozen=True)
class SyntheticTake:
    """A take and the truth about it.

    Parameters
    ----------
    take : Take
        What the cameras recorded.
    reference : Segments
        What the annotator wrote.
    neutral_s : float
        Time of a neutral frame.
    boundaries : Segments
        Where the boundaries truly are.
    weights : Descriptors
        Weights of the signer's own bases.
    avatar_weights : Descriptors
        Weights that show the same on the default face; `head` is the head's pose in the room.
    """

    take: Take
    reference: Segments
    neutral_s: float
    boundaries: Segments
    weights: Descriptors
    avatar_weights: Descriptors


def plan_corpus(*, signers: int = 2, seed: int = 0, kinds: Sequence[str] = KINDS) -> list[TakeRequest]:
    """The takes of a corpus: six IE, six SE and eighteen EU for each signer.

    Raises
    ------
    SignfaceError
        No signer, a negative seed, or a kind that is not `IE`, `SE` or `EU`.
    """
    unknown = sorted(set(kinds) - set(KINDS))
    if unknown or not kinds:
        raise SignfaceError(f"unknown kind of take: {', '.join(unknown) or 'none'}", hint="the kinds are IE, SE, EU")
    if signers < 1:
        raise SignfaceError(f"a corpus of {signers} signers holds nothing", hint="ask for 1 or more")
    if seed < 0:
        raise SignfaceError(f"the seed {seed} is negative", hint="give 0 or more")
    return [
        TakeRequest(seed, signer, kind, number)
        for signer in range(signers)
        for kind in KINDS
        if kind in kinds
        for number in range(len(UTTERANCES) if kind == "EU" else len(AFFECTS))
    ]


def plan_mini() -> list[TakeRequest]:
    """The takes of `corpora/mini`: four short ones of two signers of their own."""
    return [
        TakeRequest(MINI_SEED, 0, "IE", AFFECTS.index("J"), mini=True),
        TakeRequest(MINI_SEED, 0, "EU", 10, mini=True),
        TakeRequest(MINI_SEED, 1, "SE", AFFECTS.index("A"), mini=True),
        TakeRequest(MINI_SEED, 1, "EU", 3, mini=True),
    ]


@lru_cache(maxsize=1)
def _stage() -> tuple[FaceModel, MarkerLayout, np.ndarray, tuple[str, ...]]:
    """The default face, its layout, and the identity shapes with their names."""
    face = read_face(FACE)
    identities, names = read_identities()
    return face, read_layout(LAYOUT, face), identities, names


@lru_cache(maxsize=16)
def make_signer(seed: int, signer: int, spread: Spread) -> Signer:
    """Signer number `signer` of the corpus with this seed."""
    head, glued = _glued_head(seed, signer)
    return Signer(head, draw_habits(_stream(seed, signer, 1), spread), glued)


@lru_cache(maxsize=8)
def _glued_head(seed: int, signer: int) -> tuple[Head, Glued]:
    """A signer's head and the markers on it, which are the same however far their faces stray."""
    face, layout, identities, names = _stage()
    head = draw_head(face, identities, names, _stream(seed, signer, 0))
    return head, glue_markers(head, layout, _stream(seed, signer, 2))


def _stream(seed: int, signer: int, what: int) -> np.random.Generator:
    """Random numbers of a signer for one purpose."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(signer, 0, what)))


def make_plan(request: TakeRequest, habits: Habits) -> Programme:
    """What happens in a take."""
    rng = request.stream(what=0)
    if request.kind == "IE":
        if request.mini:
            return plan_isolated(AFFECTS[request.number], rng, habits, times=2, held_s=(1.4, 2.0))
        return plan_isolated(AFFECTS[request.number], rng, habits)
    if request.kind == "SE":
        return plan_sequence(AFFECTS[request.number], rng, habits, others=1 if request.mini else 5)
    return plan_utterance(request.number, rng, habits, times=1 if request.mini else 3)


def make_take(request: TakeRequest, spread: Spread | None = None, *, change: Change | None = None) -> SyntheticTake:
    """Act and record one take.

    Parameters
    ----------
    request : TakeRequest
    spread : Spread, optional
        How far faces stray from the prototypes.
    change : callable, optional
        Makes other weights of those acted (`signface.synth.variety.Acting`).

    Returns
    -------
    SyntheticTake
    """
    spread = Spread() if spread is None else spread
    signer = make_signer(request.seed, request.signer, spread)
    plan = make_plan(request, signer.habits)
    names = signer.head.face.names
    time = np.arange(round(plan.duration * RATE)) / RATE
    weights = perform(plan, time, signer.habits, spread, names, request.stream(what=1))
    if change is not None:
        weights = change(weights, plan, time, names)
    poses = head_motion(plan, time, RATE, request.stream(what=2))
    positions = record(signer.head, signer.glued, weights, poses, plan, RATE, request.stream(what=3))
    take = Take(positions, signer.glued.labels, RATE, name=request.name, history=("synthetic",))
    seen = np.isfinite(positions).all(axis=(1, 2))
    resting = (time > 0.1) & (time < plan.phases[0].end_s - 0.2)
    effort = np.where(seen & resting, weights.sum(axis=1), np.inf)
    if not np.isfinite(effort).any():
        effort = np.where(resting, weights.sum(axis=1), np.inf)

    def descriptors(values: np.ndarray) -> Descriptors:
        # Half a thousandth is two hundredths of a millimetre at most on the skin, and compresses well.
        return Descriptors(
            np.round(values, 3), names, RATE, residual=np.zeros(len(time)), head=poses, name=request.name
        )

    return SyntheticTake(
        take=take,
        reference=reference_segments(plan, request.name, request.stream(what=4)),
        neutral_s=float(time[np.argmin(effort)]),
        boundaries=reference_segments(plan, request.name),
        weights=descriptors(weights),
        avatar_weights=descriptors(signer.head.avatar_weights(weights)),
    )


def write_synthetic_take(folder: Path, request: Requested, made: SyntheticTake) -> TakeEntry:
    """Write a take (`NAME.c3d`), its annotation under `reference/` and the truth about it under `truth/`.

    The annotation does not stand beside the recording: that is where `signface annotate` puts its own.
    """
    recording = folder / f"{request.name}.c3d"
    write_c3d(made.take, recording)
    annotation = annotation_of(folder, request)
    write_eaf(
        made.reference,
        annotation,
        signer=request.signer_name,
        date=DATE,
        properties={"take": recording.name, "note": "synthetic: no person is recorded"},
    )
    truth = folder / "truth" / request.name
    write_weights(made.avatar_weights, truth.with_suffix(".parquet"))
    write_weights(made.weights, truth.with_suffix(".signer.parquet"))
    write_segments(made.boundaries, truth.with_suffix(".segments.csv"))
    return TakeEntry(
        recording, request.signer_name, request.kind, annotation, made.neutral_s, sentence=request.sentence
    )


def annotation_of(folder: Path, request: Requested) -> Path:
    """Where the reference annotation of a take stands."""
    return folder / "reference" / f"{request.name}.eaf"


def synthesise(
    folder: str | PathLike[str],
    *,
    signers: int = 2,
    seed: int = 0,
    kinds: Sequence[str] = KINDS,
    mini: bool = False,
    show: Callable[[list[TakeRequest]], Iterable[TakeRequest]] = iter,
) -> Corpus:
    """Make a synthetic corpus.

    Parameters
    ----------
    folder : path
        New or empty, or a corpus made here with the same settings, which is made again.
    signers, seed, kinds
        See `plan_corpus`.
    mini : bool
        Make the corpus that ships (`plan_mini`) instead.
    show : callable
        Wraps the list of takes to be made, for a progress bar.

    Returns
    -------
    Corpus

    Raises
    ------
    SignfaceError
        The folder holds something else, or an annotation in it was corrected since; nothing is written then.

    Examples
    --------
    >>> corpus = synthesise("corpora/feel", signers=3)  # doctest: +SKIP
    """
    folder = Path(folder)
    requests = plan_mini() if mini else plan_corpus(signers=signers, seed=seed, kinds=kinds)
    spread = Spread()
    settings = {
        "made_by": "signface synth",
        "note": "synthetic: no person is recorded",
        "edition": EDITION,
        "seed": requests[0].seed,
        "takes": [request.name for request in requests],
        "spread": asdict(spread),
    }
    return write_corpus(folder, settings, requests, lambda request: make_take(request, spread), show)


def write_corpus(
    folder: Path,
    settings: dict[str, Any],
    requests: list[Request],
    make: Callable[[Request], SyntheticTake],
    show: Callable[[list[Request]], Iterable[Request]],
) -> Corpus:
    """Make the takes asked for and write them to a folder that is new, empty, or was made with the same settings.

    Raises
    ------
    SignfaceError
        As `synthesise`.
    """
    _make_sure_it_is_ours(folder, settings, requests)
    with whole_file(folder / RECORD) as temporary:
        temporary.write_text(json.dumps(settings, indent=1) + "\n", encoding="utf-8")
    write_takes(folder, [write_synthetic_take(folder, request, make(request)) for request in show(requests)])
    return read_corpus(folder)


def _make_sure_it_is_ours(folder: Path, settings: dict[str, Any], requests: Sequence[Requested]) -> None:
    if not folder.exists():
        return
    if not folder.is_dir():
        raise SignfaceError("is a file", file=folder, hint="name a folder")
    if not any(folder.iterdir()):
        return
    elsewhere = "choose a new or empty folder"
    record_file = folder / RECORD
    try:
        previous = json.loads(record_file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise SignfaceError("is not empty and no synthetic corpus", file=folder, hint=elsewhere) from None
    except (OSError, ValueError) as error:
        raise SignfaceError("cannot be read", file=record_file, hint=elsewhere) from error
    if previous != json.loads(json.dumps(settings)):
        raise SignfaceError("holds a corpus made with other settings", file=folder, hint=elsewhere)
    for request in requests:
        annotation = annotation_of(folder, request)
        if annotation.exists() and not is_unmodified_output(read_document(annotation).getroot()):
            raise SignfaceError(
                "was corrected since it was made", file=annotation, hint=f"{elsewhere}, or move it away first"
            )
