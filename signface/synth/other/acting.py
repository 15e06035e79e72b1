"""What people of the second synthetic corpus do: affect that swells and fades, words on the lips, grammar, blinks.

- `Score`, `draw_score`: when which affect is meant, and when somebody signs.
- `act`: the weights of a take, and the head's turns.
- `follow`: a face that is drawn towards what is meant, as a damped mass is.

Beside the first corpus, whose faces go from pose to pose by minimum jerk: here each part of the face follows its own
command with its own lag, affect begins before the words or after them and stays on, a third of the sentences have
none, syllables are an opening and a closing at 3 to 6 Hz (P. MacNeilage, The frame/content theory, Behav. Brain Sci.
21, 1998, for speech), and grammar comes with every sentence, in brows, lids and head at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from signface.synth.other.people import AFFECTS, Person, weights_of

#: Steps per second in which a take is acted, before a camera looks at it (Hz).
STEPS_HZ = 240.0
#: What moves together, each with a lag of its own.
REGIONS = (("brow",), ("eye", "cheek", "nose"), ("mouth", "jaw"))

#: Mouth shapes between which syllables alternate.
OPEN = (
    {"jawOpen": 0.45},
    {"jawOpen": 0.25, "mouthSmile*": 0.20},
    {"jawOpen": 0.30, "mouthFunnel": 0.40},
    {"jawOpen": 0.15, "mouthStretch*": 0.30},
    {"mouthPucker": 0.70},
    {"jawOpen": 0.20, "mouthLowerDown*": 0.40},
)
CLOSED: tuple[dict[str, float], ...] = (
    {"mouthPress*": 0.50},
    {"mouthClose": 0.10, "mouthRollLower": 0.35},
    {"mouthPucker": 0.30, "mouthPress*": 0.20},
    {},
    {"jawOpen": 0.05},
)

#: Kind of sentence: (bases, turn of the head about x, y, z in degrees, swings per second or 0 for a posture, how
#: often).
GRAMMAR: dict[str, tuple[dict[str, float], tuple[float, float, float], float, float]] = {
    "statement": ({}, (0.0, 0.0, 0.0), 0.0, 0.30),
    "assertion": ({"eyeSquint*": 0.15}, (9.0, 0.0, 0.0), 2.2, 0.12),
    "polar": ({"browInnerUp": 0.55, "browOuterUp*": 0.50, "eyeWide*": 0.20}, (10.0, 0.0, 0.0), 0.0, 0.14),
    "content": ({"browDown*": 0.55, "eyeSquint*": 0.25}, (6.0, 0.0, 7.0), 0.0, 0.14),
    "topic": ({"browInnerUp": 0.40, "browOuterUp*": 0.45}, (-7.0, 0.0, 4.0), 0.0, 0.12),
    "negation": ({"browDown*": 0.20, "mouthFrown*": 0.30, "mouthShrugLower": 0.20}, (0.0, 13.0, 0.0), 2.0, 0.12),
    "doubt": ({"mouthShrugLower": 0.40, "mouthFrown*": 0.25, "browInnerUp": 0.25}, (0.0, 0.0, 9.0), 0.0, 0.06),
}


@dataclass(frozen=True)
class Meant:
    """A stretch of time in which one affect is meant.

    Parameters
    ----------
    affect : str
        `N` for none.
    intensity : int
        1 to 3; 0 for none.
    start_s, end_s : float
    """

    affect: str
    intensity: int
    start_s: float
    end_s: float


@dataclass(frozen=True)
class Score:
    """What happens in a take.

    Parameters
    ----------
    meant : tuple of Meant
        They follow each other without gaps and cover the take.
    sentences : tuple of (str, float, float)
        Kind in `GRAMMAR`, start and end in seconds.
    """

    meant: tuple[Meant, ...]
    sentences: tuple[tuple[str, float, float], ...]

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.meant[-1].end_s


def draw_score(kind: str, number: int, person: Person, rng: np.random.Generator) -> Score:
    """What happens in take `number` (from 0) of a kind: `IE` (one affect, four times, no words), `EU` (sentences)."""
    meant: list[Meant] = []
    sentences = []
    now = 0.0

    def mean(affect: str, seconds: float) -> None:
        nonlocal now
        intensity = 0 if affect == "N" else int(rng.integers(1, 4))
        if meant and meant[-1].affect == affect:
            meant[-1] = Meant(affect, max(intensity, meant[-1].intensity), meant[-1].start_s, now + seconds)
        else:
            meant.append(Meant(affect, intensity, now, now + seconds))
        now += seconds

    mean("N", rng.uniform(0.9, 2.2))
    if kind == "IE":
        for _ in range(4):
            mean(AFFECTS[number], rng.uniform(1.2, 4.0))
            mean("N", rng.uniform(0.9, 2.5))
        return Score(tuple(meant), ())
    feelings = [AFFECTS[number % len(AFFECTS)], str(rng.choice(AFFECTS)), "N", str(rng.choice([*AFFECTS, "N"]))]
    kinds = list(GRAMMAR)
    chances = np.array([GRAMMAR[name][3] for name in kinds])
    for affect in rng.permutation(feelings):
        length = rng.uniform(1.4, 4.5) / person.tempo
        begins = now + rng.uniform(-0.4, 0.5)
        mean(str(affect), length + rng.uniform(0.0, 0.9))
        sentences.append((str(rng.choice(kinds, p=chances / chances.sum())), max(0.2, begins), begins + length))
        if rng.random() < 0.6:
            mean("N", rng.uniform(0.6, 1.8))
    mean("N", rng.uniform(0.9, 1.6))
    return Score(tuple(meant), tuple(sentences))


def follow(command: np.ndarray, lag_s: np.ndarray, rate: float) -> np.ndarray:
    """(F, N) values that are drawn to their (F, N) commands as a critically damped mass, slower with a longer lag.

    Two first-order lags in a row; `lag_s` (N,) is the time constant of each.
    """
    keep = np.exp(-1.0 / (lag_s * rate))
    first = second = command[0]
    followed = np.empty_like(command)
    for step, wanted in enumerate(command):
        first = keep * first + (1.0 - keep) * wanted
        second = keep * second + (1.0 - keep) * first
        followed[step] = second
    return followed


def act(
    score: Score, person: Person, names: tuple[str, ...], rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, list[tuple[float, float]]]:
    """A take as it is acted.

    Returns
    -------
    weights : (F, N) array
        Of the person's own bases, 0 to 1, `STEPS_HZ` a second.
    turns : (F, 3) array
        Of the head about x, y, z, radians.
    changes : list of (float, float)
        For each change of affect, when it is first seen and when it is done, seconds.
    """
    time = np.arange(round(score.duration * STEPS_HZ)) / STEPS_HZ
    region = np.array([next(i for i, starts in enumerate(REGIONS) if name.startswith(starts)) for name in names])
    lag = (rng.uniform(0.05, 0.12, len(REGIONS)) / person.tempo)[region] * np.exp(0.1 * rng.standard_normal(len(names)))
    command = np.tile(person.tonic, (len(time), 1))
    shown = np.zeros(len(time))
    for number, part in enumerate(score.meant):
        inside = (time >= part.start_s) & (time < part.end_s)
        shown[inside] = number
        if part.affect == "N":
            continue
        level = (0.35, 0.65, 1.0)[part.intensity - 1] * person.strength
        face = person.habits[part.affect] * np.exp(0.2 * rng.standard_normal(len(names)))
        share = (time[inside] - part.start_s) / (part.end_s - part.start_s)
        swell = 1.0 - rng.uniform(0.0, 0.35) * np.abs(share - rng.uniform(0.2, 0.7))  # strongest somewhere within
        command[inside] += level * swell[:, None] * face
    weights = follow(command, lag, STEPS_HZ)
    usual = follow(shown[:, None], np.array([lag.mean()]), STEPS_HZ)[:, 0]
    spoken, turns = np.zeros_like(weights), np.zeros((len(time), 3))
    for kind, start, end in score.sentences:
        bases, degrees, swings, _ = GRAMMAR[kind]
        inside = (time >= start) & (time < end)
        held = follow(inside[:, None].astype(float), np.array([0.07 / person.tempo]), STEPS_HZ)
        size = person.lively * rng.uniform(0.5, 1.2)
        spoken += person.strength * size * held * weights_of(bases, names)
        rhythm = np.cos(2 * np.pi * swings * (time - start) * rng.uniform(0.85, 1.15)) if swings else 1.0
        turns += np.radians(degrees) * size * held * np.reshape(rhythm, (-1, 1))
        spoken += person.strength * person.lively * _words(time, start, end, person, names, rng)
    mouth = region == 2
    talking = np.minimum(spoken[:, mouth].sum(axis=1, keepdims=True), 1.0)
    weights[:, mouth] *= 1.0 - 0.5 * talking
    weights = weights + spoken
    lids = _blinks(time, [end for _, _, end in score.sentences], rng)
    eyes = [i for i, name in enumerate(names) if name.startswith(("eyeWide", "eyeSquint"))]
    weights[:, eyes] *= (1.0 - lids)[:, None]
    weights += lids[:, None] * weights_of({"eyeBlink*": 1.0}, names)
    turns += np.radians(2.5) * person.lively * wander(len(time), STEPS_HZ, 0.8, 3, rng)
    return np.clip(weights, 0.0, 1.0), turns, _seen(score, time, usual)


def _words(
    time: np.ndarray, start: float, end: float, person: Person, names: tuple[str, ...], rng: np.random.Generator
) -> np.ndarray:
    """(F, N) weights of words on the lips: openings and closings in turn, in words with pauses."""
    command = np.zeros((len(time), len(names)))
    now = start + rng.uniform(0.0, 0.3)
    while now < end:
        for _ in range(int(rng.integers(1, 5))):
            length = 1.0 / (rng.uniform(3.0, 6.0) * person.tempo)
            for shapes, first, last in ((OPEN, 0.0, 0.6), (CLOSED, 0.6, 1.0)):
                inside = (time >= now + first * length) & (time < min(now + last * length, end))
                command[inside] = rng.uniform(0.5, 1.2) * weights_of(shapes[rng.integers(len(shapes))], names)
            now += length
        now += rng.uniform(0.05, 0.5) / person.tempo
    return follow(command, np.full(len(names), 0.03), STEPS_HZ)


def _blinks(time: np.ndarray, ends: list[float], rng: np.random.Generator) -> np.ndarray:
    """(F,) how far the lids are closed: at the ends of sentences, and some 15 times a minute."""
    moments = [end + rng.normal(0.0, 0.1) for end in ends if rng.random() < 0.6]
    moments += list(rng.uniform(0.0, time[-1], rng.poisson(time[-1] / 4.0)))
    closed = np.zeros(len(time))
    for moment in moments:
        away = (time - moment) / np.where(time < moment, rng.uniform(0.03, 0.05), rng.uniform(0.06, 0.11))
        closed = np.maximum(closed, np.exp(-0.5 * away**2))
    return closed


def wander(frames: int, rate: float, lasting_s: float, width: int, rng: np.random.Generator) -> np.ndarray:
    """(F, width) noise of unit variance that is forgotten within `lasting_s`: an autoregression of first order."""
    keep = np.exp(-1.0 / (lasting_s * rate))
    fresh = rng.standard_normal((frames, width)) * np.sqrt(1.0 - keep**2)
    values = np.empty((frames, width))
    last = rng.standard_normal(width)
    for step in range(frames):
        last = keep * last + fresh[step]
        values[step] = last
    return values


def _seen(score: Score, time: np.ndarray, shown: np.ndarray) -> list[tuple[float, float]]:
    """When each change begins and ends to be seen: from a twentieth of the way to nineteen twentieths."""
    moments = []
    for number, part in enumerate(score.meant[1:]):
        after = time >= part.start_s
        way = shown[after] - number
        begun, done = np.argmax(way >= 0.05), np.argmax(way >= 0.95)
        if way[done] < 0.95:  # left before it was reached
            done = np.intp(len(way) - 1)
        moments.append((float(time[after][begun]), float(time[after][done])))
    return moments
