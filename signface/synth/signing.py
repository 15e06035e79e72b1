"""What a signing face does besides the affect: mouthing, grammar, blinks, glances, head movement.

- `mouthing`: a run of mouth shapes that flow into one another.
- `GRAMMAR`: faces and head gestures of questions, topics, negation and adverbials, and the affects they look like.
- `grammar_track`, `head_gestures`: their curves in time.
- `blinks`, `glances`: what eyes do all the time.

Brows rise with polar questions, topics and conditionals and lower with content questions, as reported for ASL
(C. Baker-Shenk, 1983), BSL (R. Sutton-Spence and B. Woll, 1999) and ISL (S. Dachkovsky and W. Sandler, 2009, who also
describe the squint of shared information). Adverbials puff the cheeks or shape the mouth (S. Liddell, 1980).
These faces overlap the affect in time and in the units they use, and an annotator of affect disregards them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from signface.synth.expressions import base_weights, unit_weights
from signface.synth.motion import pulse, smooth_noise

#: Mouth shapes of mouthed words at full size.
MOUTH_SHAPES: dict[str, dict[str, float]] = {
    "a": {"jawOpen": 0.38, "mouthLowerDown*": 0.20, "mouthUpperUp*": 0.08},
    "e": {"jawOpen": 0.18, "mouthStretch*": 0.28, "mouthLowerDown*": 0.15},
    "i": {"jawOpen": 0.08, "mouthStretch*": 0.30, "mouthSmile*": 0.20, "mouthUpperUp*": 0.10},
    "o": {"jawOpen": 0.22, "mouthFunnel": 0.50, "mouthPucker": 0.25},
    "u": {"jawOpen": 0.06, "mouthPucker": 0.65, "mouthFunnel": 0.20},
    "m": {"mouthPress*": 0.45, "mouthRollLower": 0.25, "mouthRollUpper": 0.20},
    "f": {"mouthRollLower": 0.40, "mouthUpperUp*": 0.18, "jawOpen": 0.05},
    "s": {"jawOpen": 0.07, "mouthStretch*": 0.18, "mouthLowerDown*": 0.22, "mouthUpperUp*": 0.15},
    "l": {"jawOpen": 0.20, "mouthLowerDown*": 0.12},
    "sh": {"mouthFunnel": 0.55, "jawOpen": 0.08, "mouthUpperUp*": 0.12},
}


@dataclass(frozen=True)
class Marking:
    """A face, and a head gesture, that grammar asks for.

    Parameters
    ----------
    units : dict
        Action unit: strength.
    gesture : str
        `none`, `forward`, `back`, `tilt`, `shake` or `nod`.
    mouth : dict
        Mouth shape (bases) of an adverbial; while it lasts, nothing is mouthed.
    """

    units: dict[int, float]
    gesture: str = "none"
    mouth: dict[str, float] | None = None


GRAMMAR: dict[str, Marking] = {
    "polar": Marking({1: 0.55, 2: 0.60, 5: 0.30}, "forward"),
    "content": Marking({4: 0.60, 7: 0.30}, "tilt"),
    "topic": Marking({1: 0.50, 2: 0.55}, "back"),
    "conditional": Marking({1: 0.45, 2: 0.55, 5: 0.15}, "tilt"),
    "shared": Marking({7: 0.55, 6: 0.20}, "none"),
    "negation": Marking({4: 0.35, 15: 0.35, 17: 0.20}, "shake"),
    "assertion": Marking({4: 0.15}, "nod"),
    "much": Marking({4: 0.15}, "none", {"cheekPuff": 0.75, "mouthPress*": 0.30}),
    "little": Marking({7: 0.30}, "none", {"mouthPucker": 0.60, "mouthDimple*": 0.20}),
    "easily": Marking({}, "none", {"mouthPress*": 0.35, "mouthShrugLower": 0.35, "mouthPucker": 0.25}),
    "carelessly": Marking({}, "tilt", {"jawOpen": 0.22, "mouthLowerDown*": 0.30, "mouthFrown*": 0.15}),
    "near": Marking({6: 0.40, 7: 0.30}, "tilt", {"mouthStretch*": 0.55, "mouthLowerDown*": 0.25, "mouthSmile*": 0.20}),
}


def mouthing(
    time: np.ndarray, start: float, end: float, names: tuple[str, ...], rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Weights of mouthed words and how far the mouth is taken by them.

    Each shape has a bell of dominance; where bells overlap, the mouth shows their mean, so that shapes flow into one
    another (M. Cohen and D. Massaro, Modeling coarticulation in synthetic visual speech, 1993).

    Returns
    -------
    (F, N) array
        Weights to add.
    (F,) array
        0 where the mouth is free, 1 where it is fully taken.
    """
    shapes = np.array([base_weights(shape, names) for shape in MOUTH_SHAPES.values()])
    total = np.zeros((len(time), len(names)))
    dominance = np.full(len(time), 0.35)  # a mouth at rest pulls too: single shapes are not reached fully
    busy = np.zeros(len(time))
    moment = start + rng.uniform(0.0, 0.2)
    while moment < end - 0.1:
        # A mouthed word of two to six shapes, then a pause: signs without mouthing stand between.
        word_start = moment
        for _ in range(int(rng.integers(2, 7))):
            if moment >= end:
                break
            width = rng.uniform(0.055, 0.10)
            bell = np.exp(-0.5 * ((time - moment) / width) ** 2)
            size = rng.uniform(0.5, 1.1)
            total += bell[:, None] * size * shapes[rng.integers(len(shapes))]
            dominance += bell
            moment += rng.uniform(0.11, 0.24)
        busy = np.maximum(busy, pulse(time, word_start - 0.12, min(moment, end) + 0.12, 0.15, 0.15))
        moment += rng.uniform(0.05, 0.7)
    return total / dominance[:, None], busy


def grammar_track(
    time: np.ndarray, marking: str, start: float, end: float, names: tuple[str, ...], rng: np.random.Generator
) -> np.ndarray:
    """(F, N) weights of a grammatical face over its stretch of the utterance."""
    grammar = GRAMMAR[marking]
    face = unit_weights({unit: s * np.exp(rng.normal(0.0, 0.2)) for unit, s in grammar.units.items()}, names)
    if grammar.mouth is not None:
        face = face + base_weights(grammar.mouth, names) * np.exp(rng.normal(0.0, 0.2))
    rise, fall = rng.uniform(0.12, 0.30), rng.uniform(0.15, 0.40)
    wavering = 1.0 + 0.12 * smooth_noise(rng, len(time), 1.0 / (time[1] - time[0]), 1.0)
    return pulse(time, start, end, rise, fall)[:, None] * wavering * face


def blinks(
    time: np.ndarray, likely: list[float], per_minute: float, names: tuple[str, ...], rng: np.random.Generator
) -> np.ndarray:
    """(F, N) weights of blinks: at the `likely` moments (ends of clauses, head turns) and now and then.

    Lids close in some 80 ms and open in twice that (F. VanderWerf et al., Eyelid movements, 2003).
    """
    moments = [moment + rng.normal(0.05, 0.12) for moment in likely if rng.random() < 0.5]
    moment = time[0] + rng.exponential(60.0 / per_minute)
    while moment < time[-1]:
        moments.append(moment)
        moment += 0.3 + rng.exponential(60.0 / per_minute)
    lids = base_weights({"eyeBlink*": 1.0}, names)
    curve = np.zeros(len(time))
    for moment in moments:
        closing, opening = rng.uniform(0.06, 0.10), rng.uniform(0.11, 0.22)
        depth = rng.uniform(0.8, 1.0)
        curve = np.maximum(curve, depth * pulse(time, moment - closing, moment + opening, closing, opening))
    return curve[:, None] * lids


def glances(time: np.ndarray, per_minute: float, names: tuple[str, ...], rng: np.random.Generator) -> np.ndarray:
    """(F, N) weights of eyes that look aside (to the hands, to a place in the signing space) and return."""
    weights = np.zeros((len(time), len(names)))
    moment = time[0] + rng.exponential(60.0 / per_minute)
    while moment < time[-1]:
        length = rng.uniform(0.3, 1.2)
        aside, size = rng.choice([-1.0, 1.0]), rng.uniform(0.2, 0.7)
        down = rng.uniform(-0.2, 0.6)
        gaze = {
            "eyeLookOutLeft" if aside > 0 else "eyeLookInLeft": size,
            "eyeLookInRight" if aside > 0 else "eyeLookOutRight": size,
            "eyeLookDown*" if down > 0 else "eyeLookUp*": abs(down),
        }
        weights += pulse(time, moment, moment + length, 0.06, 0.06)[:, None] * base_weights(gaze, names)
        moment += length + rng.exponential(60.0 / per_minute)
    return weights


def head_gestures(
    time: np.ndarray, gesture: str, start: float, end: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and translation of a head gesture.

    Returns
    -------
    (F, 3) array
        Rotation vector in radians: pitch (nod) about x, yaw (shake) about y, roll (tilt) about z.
    (F, 3) array
        Translation in millimetres: x to the signer's left, y up, z forward.
    """
    turn, move = np.zeros((len(time), 3)), np.zeros((len(time), 3))
    envelope = pulse(time, start, end, 0.25, 0.3)
    size = np.exp(rng.normal(0.0, 0.25))
    if gesture == "forward":
        turn[:, 0] = np.radians(7.0) * size * envelope
        move[:, 2] = 20.0 * size * envelope
    elif gesture == "back":
        turn[:, 0] = -np.radians(6.0) * size * envelope
        move[:, 2] = -12.0 * size * envelope
    elif gesture == "tilt":
        side = rng.choice([-1.0, 1.0])
        turn[:, 2] = side * np.radians(8.0) * size * envelope
        move[:, 0] = -side * 10.0 * size * envelope
    elif gesture in ("shake", "nod"):
        axis, degrees = (1, 11.0) if gesture == "shake" else (0, 7.0)
        rhythm = np.sin(2 * np.pi * rng.uniform(1.6, 2.6) * (time - start))
        turn[:, axis] = np.radians(degrees) * size * envelope * rhythm
    return turn, move
