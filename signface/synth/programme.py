"""The programme of a take of the synthetic corpus: what a signer is asked to do.

- `plan_isolated` (IE), `plan_sequence` (SE), `plan_utterance` (EU): the phases of a take.
- `UTTERANCES`: the eighteen utterances, each with its affects and its grammar.
- `reference_segments`: what an annotator would write.

After 4.3.2 of the thesis (FEeL): IE holds one expression five times, neutral between; SE alternates one expression with
each other one; EU repeats an utterance with its affect three times.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from signface.segmentation.segments import Segments
from signface.synth.expressions import AFFECTS, NEUTRAL, Habits

KINDS = ("IE", "SE", "EU")

#: A transition is seen once a twentieth of the way is done, until a twentieth is left: minimum jerk is there after a
#: fifth of its time.
SEEN_AFTER = 0.19


@dataclass(frozen=True)
class Phase:
    """A face that is held.

    Parameters
    ----------
    affect : str
    intensity : int
        1 to 3; 0 for neutral.
    start_s, end_s : float
        When it is reached and when it is left, seconds.
    """

    affect: str
    intensity: int
    start_s: float
    end_s: float


@dataclass(frozen=True)
class Clause:
    """A stretch of signing: hands and mouth are busy, and grammar marks parts of it.

    Parameters
    ----------
    start_s, end_s : float
    markings : tuple of (str, float, float)
        Name in `GRAMMAR`, start and end in seconds.
    """

    start_s: float
    end_s: float
    markings: tuple[tuple[str, float, float], ...]


@dataclass(frozen=True)
class Programme:
    """What happens in a take.

    Parameters
    ----------
    phases : tuple of Phase
        In time order; between the end of one and the start of the next lies the transition.
    clauses : tuple of Clause
    duration : float
        Seconds.
    """

    phases: tuple[Phase, ...]
    clauses: tuple[Clause, ...]
    duration: float


@dataclass(frozen=True)
class Utterance:
    """A sentence to sign.

    Parameters
    ----------
    gist : str
        What it says.
    affects : tuple of (str, float)
        Affects in order, with their share of its time; a leading `N` is signed before the affect comes.
    markings : tuple of (str, float, float)
        Name in `GRAMMAR`, start and end as shares of its time.
    seconds : float
        How long it takes at a usual tempo.
    """

    gist: str
    affects: tuple[tuple[str, float], ...]
    markings: tuple[tuple[str, float, float], ...] = field(default=())
    seconds: float = 2.6


UTTERANCES: tuple[Utterance, ...] = (
    Utterance("You have broken my bicycle", (("A", 1.0),), (("topic", 0.0, 0.3), ("assertion", 0.6, 1.0)), 2.4),
    Utterance("Who has taken my keys", (("A", 1.0),), (("content", 0.1, 1.0),), 2.2),
    Utterance(
        "I told him three times, he does not listen",
        (("N", 0.45), ("A", 0.55)),
        (("shared", 0.0, 0.35), ("negation", 0.55, 1.0)),
        3.6,
    ),
    Utterance("The milk has turned, it stinks", (("N", 0.4), ("D", 0.6)), (("topic", 0.0, 0.35),), 2.8),
    Utterance("Mould, the bread is full of it", (("Su", 0.35), ("D", 0.65)), (("much", 0.55, 0.95),), 3.0),
    Utterance("Do you really eat that", (("D", 1.0),), (("polar", 0.15, 1.0),), 2.2),
    Utterance("Is somebody behind the door", (("F", 1.0),), (("polar", 0.0, 1.0),), 2.4),
    Utterance("The plane is shaking so much", (("F", 1.0),), (("topic", 0.0, 0.3), ("near", 0.55, 0.95)), 2.6),
    Utterance("If that dog comes loose, it bites me", (("N", 0.4), ("F", 0.6)), (("conditional", 0.0, 0.45),), 3.4),
    Utterance("We are moving to the sea", (("J", 1.0),), (("topic", 0.0, 0.25), ("assertion", 0.5, 1.0)), 2.4),
    Utterance("What, my sister has twins", (("Su", 0.4), ("J", 0.6)), (("content", 0.0, 0.3),), 3.0),
    Utterance("Did our team win", (("J", 1.0),), (("polar", 0.0, 1.0),), 2.0),
    Utterance("My neighbour has died", (("N", 0.35), ("Sa", 0.65)), (("shared", 0.0, 0.3),), 2.8),
    Utterance("Nobody came to the party", (("Sa", 1.0),), (("negation", 0.2, 0.9),), 2.6),
    Utterance("Why are you leaving already", (("Sa", 1.0),), (("content", 0.2, 1.0),), 2.4),
    Utterance("The shop is closed today", (("Su", 1.0),), (("polar", 0.3, 1.0),), 2.2),
    Utterance("Such a huge cake, for me", (("Su", 0.55), ("J", 0.45)), (("much", 0.1, 0.5),), 2.8),
    Utterance("I had forgotten, the examination is today", (("Su", 0.45), ("F", 0.55)), (("easily", 0.05, 0.35),), 3.2),
)


class _Course:
    """Builds the phases of a take one after the other."""

    def __init__(self, rng: np.random.Generator, habits: Habits) -> None:
        self.rng = rng
        self.tempo = habits.tempo
        self.phases: list[Phase] = []
        self.now = 0.0

    def hold(
        self, affect: str, seconds: float, intensity: int = 0, *, change: tuple[float, float] = (0.3, 0.6)
    ) -> Phase:
        """Go over to a face within a time drawn from `change` (none at the start of the take) and hold it."""
        if self.phases:
            self.now += self.rng.uniform(*change) / self.tempo
        phase = Phase(affect, intensity, self.now, self.now + seconds)
        self.phases.append(phase)
        self.now = phase.end_s
        return phase

    def plan(self, clauses: tuple[Clause, ...] = ()) -> Programme:
        return Programme(tuple(self.phases), clauses, self.now)


def plan_isolated(
    affect: str,
    rng: np.random.Generator,
    habits: Habits,
    *,
    times: int = 5,
    held_s: tuple[float, float] = (2.0, 3.6),
) -> Programme:
    """IE: one expression, held for seconds, `times` over, neutral before, between and after."""
    course = _Course(rng, habits)
    intensities = _intensities(rng, times)
    course.hold(NEUTRAL, rng.uniform(1.2, 2.0))
    for intensity in intensities:
        course.hold(affect, rng.uniform(*held_s), intensity, change=(0.25, 0.6))
        course.hold(NEUTRAL, rng.uniform(1.0, 1.8), change=(0.4, 0.9))
    return course.plan()


def plan_sequence(affect: str, rng: np.random.Generator, habits: Habits, *, others: int = 5) -> Programme:
    """SE: one expression alternating with each other one (in a drawn order), neutral at both ends."""
    course = _Course(rng, habits)
    order = rng.permutation([other for other in AFFECTS if other != affect])[:others]
    intensities = iter(_intensities(rng, 2 * len(order) + 1))
    course.hold(NEUTRAL, rng.uniform(1.0, 1.6))
    course.hold(affect, rng.uniform(1.1, 2.0), next(intensities))
    for other in order:
        course.hold(str(other), rng.uniform(1.1, 2.0), next(intensities))
        course.hold(affect, rng.uniform(1.1, 2.0), next(intensities))
    course.hold(NEUTRAL, rng.uniform(1.0, 1.6), change=(0.4, 0.9))
    return course.plan()


def plan_utterance(number: int, rng: np.random.Generator, habits: Habits, *, times: int = 3) -> Programme:
    """EU: utterance `number` (from 0) with its affects, `times` over, a rest between."""
    utterance = UTTERANCES[number]
    course = _Course(rng, habits)
    clauses = []
    course.hold(NEUTRAL, rng.uniform(0.8, 1.4))
    for _ in range(times):
        length = utterance.seconds / habits.tempo * np.exp(rng.normal(0.0, 0.10))
        intensity = int(rng.choice([1, 2, 3], p=[0.3, 0.4, 0.3]))
        before = course.now
        for affect, share in utterance.affects:
            level = 0 if affect == NEUTRAL else int(np.clip(intensity + rng.choice([-1, 0, 0, 0, 1]), 1, 3))
            course.hold(affect, max(0.45, share * length * rng.uniform(0.85, 1.15)), level, change=(0.2, 0.5))
        start = before + rng.uniform(-0.1, 0.25)
        end = course.now + rng.uniform(-0.25, 0.25)
        clauses.append(Clause(start, end, _marked(utterance, start, end, rng)))
        course.hold(NEUTRAL, rng.uniform(0.6, 1.3), change=(0.3, 0.7))
    return course.plan(tuple(clauses))


def _intensities(rng: np.random.Generator, count: int) -> list[int]:
    """Intensities 1 to 3, each as often as the others, in a drawn order."""
    return [int(value) for value in rng.permutation(np.resize([2, 3, 1], count))]


def _marked(
    utterance: Utterance, start: float, end: float, rng: np.random.Generator
) -> tuple[tuple[str, float, float], ...]:
    """The utterance's markings in seconds; a signer leaves one out now and then."""
    marked = []
    for name, begin, finish in utterance.markings:
        if rng.random() < 0.12:
            continue
        edges = np.array([begin, finish]) + rng.normal(0.0, 0.04, 2)
        first, last = start + np.clip(edges, 0.0, 1.0) * (end - start)
        if last - first > 0.3:
            marked.append((name, float(first), float(last)))
    return tuple(marked)


def reference_segments(plan: Programme, name: str, rng: np.random.Generator | None = None) -> Segments:
    """Stable segments and transitions as an annotator sees them.

    Parameters
    ----------
    plan : Programme
    name : str
        Name of the take.
    rng : numpy Generator, optional
        With it, boundaries carry the annotator's own uncertainty, a standard deviation of 30 to 80 ms that is drawn for
        the take; without it they are exact.

    Returns
    -------
    Segments
        With `label` (`N`, `A`, ..., `NA`, ...) and `intensity` (1 to 3; NaN for neutral and for transitions).
    """
    phases = _merged(plan.phases)
    boundaries = []
    for before, after in itertools.pairwise(phases):
        unseen = SEEN_AFTER * (after.start_s - before.end_s)
        boundaries += [before.end_s + unseen, after.start_s - unseen]
    if rng is not None:
        deviation = rng.uniform(0.03, 0.08)
        boundaries = _in_order(
            np.array(boundaries) + deviation * np.clip(rng.normal(size=len(boundaries)), -2.5, 2.5), plan
        )
    edges = [0.0, *boundaries, plan.duration]
    rows = []
    for i, (start, end) in enumerate(itertools.pairwise(edges)):
        phase = phases[i // 2]
        if i % 2 == 0:
            rows.append((start, end, "stable", phase.affect, phase.intensity or np.nan))
        else:
            rows.append((start, end, "transition", phase.affect + phases[i // 2 + 1].affect, np.nan))
    table = pd.DataFrame(rows, columns=["start_s", "end_s", "kind", "label", "intensity"])
    return Segments(table, name=name, history=("synthetic",))


def _merged(phases: tuple[Phase, ...]) -> list[Phase]:
    """Phases, neighbours of one affect joined: between a neutral rest and a neutral beginning nothing changes."""
    merged = [phases[0]]
    for phase in phases[1:]:
        last = merged[-1]
        if phase.affect == last.affect:
            merged[-1] = Phase(last.affect, max(last.intensity, phase.intensity), last.start_s, phase.end_s)
        else:
            merged.append(phase)
    return merged


def _in_order(boundaries: np.ndarray, plan: Programme, least_s: float = 0.06) -> list[float]:
    """Boundaries to the millisecond, each at least `least_s` after the one before, inside the take."""
    ordered: list[float] = []
    for boundary in boundaries:
        earliest = (ordered[-1] if ordered else 0.0) + least_s
        ordered.append(round(float(max(boundary, earliest)), 3))
    if ordered and ordered[-1] > plan.duration - least_s:
        raise ValueError(
            "the last face is held too briefly for a boundary"
        )  # the plans above always leave half a second
    return ordered
