"""The second synthetic corpus on disk: the same kind of folder as `signface.synth.corpus` writes.

- `synthesise_other`: the whole corpus into a folder.
- `plan_other`, `make_other_take`: its steps, one take at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd

from signface.corpus.manifest import Corpus
from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.face.layout_files import read_layout
from signface.face.model import FaceModel
from signface.face.reading import read_face
from signface.segmentation.segments import Segments
from signface.synth.corpus import FACE, LAYOUT, SyntheticTake, write_corpus
from signface.synth.other.acting import Score, act, draw_score
from signface.synth.other.people import AFFECTS, Person, draw_person
from signface.synth.other.tracking import draw_tracker, track
from signface.takes.take import Take

#: Kinds of takes, and how many of each a person has.
KINDS = {"IE": len(AFFECTS), "EU": 12}
#: Raised when the same seed no longer gives the same corpus.
EDITION = 1
#: Deviation of an annotator's boundaries (s), and the shortest segment.
ANNOTATOR_S, SHORTEST_S = (0.03, 0.08), 0.06
#: Sets the streams of random numbers apart from those of the first corpus with the same seed.
STREAM = 20140331


@dataclass(frozen=True)
class OtherRequest:
    """A take to be made.

    Parameters
    ----------
    seed : int
    signer : int
        From 0.
    kind : str
        `IE` or `EU`.
    number : int
        Which affect (IE) or which utterance (EU), from 0.
    """

    seed: int
    signer: int
    kind: str
    number: int

    @property
    def signer_name(self) -> str:
        """`P1`, `P2`, ..."""
        return f"P{self.signer + 1}"

    @property
    def name(self) -> str:
        """Name of the take: `P1_IE_J`, `P2_EU_07`."""
        which = f"{self.number + 1:02d}" if self.kind == "EU" else AFFECTS[self.number]
        return f"{self.signer_name}_{self.kind}_{which}"

    @property
    def sentence(self) -> str | None:
        """None: no two takes sign the same."""
        return None

    def stream(self, *, what: int) -> np.random.Generator:
        """Random numbers of this take for one purpose."""
        key = (STREAM, self.signer, 1 + list(KINDS).index(self.kind), self.number, what)
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=key))


def plan_other(*, signers: int = 2, seed: int = 0, kinds: Sequence[str] = tuple(KINDS)) -> list[OtherRequest]:
    """The takes of a corpus: six IE and twelve EU for each person.

    Raises
    ------
    SignfaceError
        No signer, a negative seed, or a kind that is not `IE` or `EU`.
    """
    unknown = sorted(set(kinds) - set(KINDS))
    if unknown or not kinds:
        raise SignfaceError(
            f"the generator other has no kind of take named {', '.join(unknown) or 'none'}", hint="its kinds are IE, EU"
        )
    if signers < 1:
        raise SignfaceError(f"a corpus of {signers} signers holds nothing", hint="ask for 1 or more")
    if seed < 0:
        raise SignfaceError(f"the seed {seed} is negative", hint="give 0 or more")
    return [
        OtherRequest(seed, signer, kind, number)
        for signer in range(signers)
        for kind in KINDS
        if kind in kinds
        for number in range(KINDS[kind])
    ]


@lru_cache(maxsize=16)
def _person(seed: int, signer: int) -> tuple[FaceModel, Person]:
    face = read_face(FACE)
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(STREAM, signer, 0)))
    return face, draw_person(face, read_layout(LAYOUT, face), rng)


def make_other_take(request: OtherRequest) -> SyntheticTake:
    """Act one take and track it.

    Parameters
    ----------
    request : OtherRequest

    Returns
    -------
    SyntheticTake
        At the film's rate. `avatar_weights` are the truth: with which the avatar shows what the person shows.
    """
    face, person = _person(request.seed, request.signer)
    score = draw_score(request.kind, request.number, person, request.stream(what=0))
    acted, turns, changes = act(score, person, face.names, request.stream(what=1))
    tracker = draw_tracker(request.stream(what=2))
    signing = [(start, end) for _, start, end in score.sentences]
    positions, weights, poses = track(tracker, person, acted, turns, signing, request.stream(what=3))
    take = Take(positions, person.labels, tracker.rate, name=request.name, history=("synthetic, generator other",))

    def descriptors(values: np.ndarray) -> Descriptors:
        return Descriptors(
            np.round(values, 3), face.names, tracker.rate, residual=np.zeros(len(values)), head=poses, name=request.name
        )

    time = np.arange(len(weights)) / tracker.rate
    first = score.meant[0].end_s if not signing else min(score.meant[0].end_s, signing[0][0])
    resting = (time > 0.1) & (time < max(first - 0.1, 0.3))
    effort = np.where(resting, weights.sum(axis=1), np.inf)
    return SyntheticTake(
        take=take,
        reference=_segments(score, changes, request.name, request.stream(what=4)),
        neutral_s=float(time[np.argmin(effort)]),
        boundaries=_segments(score, changes, request.name),
        weights=descriptors(weights),
        avatar_weights=descriptors(weights * person.gains),
    )


def _segments(
    score: Score, changes: list[tuple[float, float]], name: str, rng: np.random.Generator | None = None
) -> Segments:
    """What an annotator writes: boundaries where a change is seen; with `rng`, as uncertain as annotators are."""
    edges = np.array([edge for change in changes for edge in change])
    if rng is not None:
        edges = edges + rng.uniform(*ANNOTATOR_S) * np.clip(rng.standard_normal(len(edges)), -2.5, 2.5)
    ordered = [0.0]
    for edge in edges:
        ordered.append(round(float(max(edge, ordered[-1] + SHORTEST_S)), 3))
    ordered.append(round(max(score.duration, ordered[-1] + SHORTEST_S), 3))
    rows = []
    for number in range(len(ordered) - 1):
        part, moving = score.meant[number // 2], number % 2 == 1
        label = part.affect + score.meant[number // 2 + 1].affect if moving else part.affect
        intensity = np.nan if moving or not part.intensity else float(part.intensity)
        rows.append((ordered[number], ordered[number + 1], "transition" if moving else "stable", label, intensity))
    table = pd.DataFrame(rows, columns=["start_s", "end_s", "kind", "label", "intensity"])
    return Segments(table, name=name, history=("synthetic, generator other",))


def synthesise_other(
    folder: str | PathLike[str],
    *,
    signers: int = 2,
    seed: int = 0,
    kinds: Sequence[str] = tuple(KINDS),
    show: Callable[[list[OtherRequest]], Iterable[OtherRequest]] = iter,
) -> Corpus:
    """Make a corpus by the second generator.

    Parameters and errors are those of `signface.synth.corpus.synthesise`; the kinds are IE and EU.

    Examples
    --------
    >>> corpus = synthesise_other("corpora/other", signers=3)  # doctest: +SKIP
    """
    requests = plan_other(signers=signers, seed=seed, kinds=kinds)
    settings = {
        "made_by": "signface synth --generator other",
        "note": "synthetic: no person is recorded; to test on, not to train on",
        "edition": EDITION,
        "seed": seed,
        "takes": [request.name for request in requests],
    }
    return write_corpus(Path(folder), settings, requests, make_other_take, show)
