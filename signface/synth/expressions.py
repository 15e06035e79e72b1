"""Expressions of the synthetic corpus: from an affect to the weights of a face.

- `UNITS`: the action units of FACS on the 51 bases of the default face (the ARKit names).
- `PROTOTYPES`: which units make an affect, in several variants.
- `Habits`, `draw_habits`: what is a signer's own.
- `draw_face`: one realisation of an affect by a signer, never twice the same.

The combinations are those that EMFACS predicts (P. Ekman and W. V. Friesen, EMFACS-7, 1983; table 10-1 of P. Ekman,
W. V. Friesen and J. C. Hager, FACS Investigator's Guide, 2002: prototypes and major variants). What people really
show departs from them: units are missing, another affect is mixed in, and units stray in that belong to none. The
mixing prefers the pairs that people confuse (fear with surprise, anger with disgust, sadness with neutral).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from signface.content import Content
from signface.errors import SignfaceError

AFFECTS = ("A", "D", "F", "J", "Sa", "Su")
NEUTRAL = "N"

#: Action unit: weights of the bases when it is fully active. `*` stands for Left and Right.
UNITS: dict[int, dict[str, float]] = {
    1: {"browInnerUp": 0.90},  # inner brow raiser
    2: {"browOuterUp*": 0.90},  # outer brow raiser
    4: {"browDown*": 0.90},  # brow lowerer
    5: {"eyeWide*": 0.90},  # upper lid raiser
    6: {"cheekSquint*": 0.90, "eyeSquint*": 0.25},  # cheek raiser
    7: {"eyeSquint*": 0.90},  # lid tightener
    9: {"noseSneer*": 0.95, "browDown*": 0.20, "mouthUpperUp*": 0.20},  # nose wrinkler
    10: {"mouthUpperUp*": 0.85, "noseSneer*": 0.20},  # upper lip raiser
    11: {"mouthUpperUp*": 0.25, "cheekSquint*": 0.20},  # nasolabial deepener
    12: {"mouthSmile*": 0.90},  # lip corner puller
    14: {"mouthDimple*": 0.80},  # dimpler
    15: {"mouthFrown*": 0.90},  # lip corner depressor
    16: {"mouthLowerDown*": 0.80},  # lower lip depressor
    17: {"mouthShrugLower": 0.80, "mouthShrugUpper": 0.35},  # chin raiser
    18: {"mouthPucker": 0.80},  # lip pucker
    20: {"mouthStretch*": 0.90},  # lip stretcher
    22: {"mouthFunnel": 0.70},  # lip funneler
    23: {"mouthPress*": 0.45, "mouthRollLower": 0.25, "mouthRollUpper": 0.20},  # lip tightener
    24: {"mouthPress*": 0.85, "mouthRollLower": 0.15},  # lip pressor
    25: {"mouthLowerDown*": 0.25, "mouthUpperUp*": 0.10, "jawOpen": 0.06},  # lips part
    26: {"jawOpen": 0.40},  # jaw drop
    27: {"jawOpen": 0.85},  # mouth stretch
    28: {"mouthRollLower": 0.70, "mouthRollUpper": 0.60},  # lip suck
    34: {"cheekPuff": 0.85},  # puff
    43: {"eyeBlink*": 0.35},  # eyes narrowed towards closure
}

#: Affect: variants, each a strength per action unit at the highest intensity.
PROTOTYPES: dict[str, tuple[dict[int, float], ...]] = {
    "A": (
        {4: 0.90, 5: 0.55, 7: 0.65, 23: 0.80},
        {4: 0.90, 5: 0.50, 7: 0.60, 24: 0.80},
        {4: 0.85, 7: 0.65, 17: 0.55, 24: 0.70},
        {4: 0.90, 5: 0.50, 7: 0.60, 10: 0.55, 23: 0.60, 25: 0.70},
        {4: 0.85, 5: 0.60, 7: 0.60, 10: 0.50, 22: 0.55, 25: 0.70, 26: 0.60},
        {4: 0.90, 7: 0.70, 10: 0.45, 17: 0.40},
    ),
    "D": (
        {9: 0.85},
        {9: 0.80, 17: 0.60},
        {9: 0.80, 15: 0.50, 16: 0.55, 25: 0.60},
        {10: 0.85},
        {10: 0.80, 17: 0.60},
        {10: 0.80, 16: 0.55, 25: 0.60, 26: 0.50},
    ),
    "F": (
        {1: 0.80, 2: 0.60, 4: 0.55, 5: 0.80, 20: 0.75, 25: 0.80},
        {1: 0.80, 2: 0.60, 4: 0.55, 5: 0.80, 20: 0.65, 26: 0.80},
        {1: 0.80, 2: 0.60, 4: 0.50, 5: 0.80, 25: 0.80, 26: 0.60},
        {1: 0.80, 2: 0.65, 4: 0.55, 5: 0.80},
        {1: 0.75, 2: 0.70, 5: 0.90, 25: 0.60, 26: 0.60},
        {5: 0.80, 20: 0.75, 25: 0.70},
    ),
    "J": (
        {6: 0.75, 12: 0.85},
        {6: 0.70, 12: 0.85, 25: 0.80},
        {6: 0.75, 12: 0.90, 25: 0.80, 26: 0.70},
        {12: 0.70},
    ),
    "Sa": (
        {1: 0.75, 4: 0.50, 15: 0.75},
        {1: 0.75, 4: 0.50, 15: 0.45, 17: 0.65},
        {1: 0.75, 4: 0.50, 11: 0.55, 15: 0.40},
        {6: 0.50, 15: 0.75},
        {11: 0.60, 17: 0.65},
        {11: 0.55, 15: 0.45, 43: 0.40},
    ),
    "Su": (
        {1: 0.85, 2: 0.85, 5: 0.45, 26: 0.90},
        {1: 0.85, 2: 0.85, 5: 0.45, 27: 0.70},
        {1: 0.85, 2: 0.85, 5: 0.45},
        {1: 0.85, 2: 0.85, 26: 0.90},
        {5: 0.50, 26: 0.90},
    ),
}

#: Which affect is mixed into another: relative frequencies.
MIXTURES: dict[str, dict[str, float]] = {
    "A": {"D": 5, "F": 1, "Sa": 1, "J": 0.5, "Su": 1},
    "D": {"A": 5, "Sa": 2, "F": 1, "J": 1, "Su": 0.5},
    "F": {"Su": 5, "Sa": 2, "A": 1, "D": 1, "J": 0.5},
    "J": {"Su": 3, "D": 1, "Sa": 1, "F": 0.5, "A": 0.5},
    "Sa": {"F": 2, "D": 2, "A": 2, "J": 0.5, "Su": 0.5},
    "Su": {"F": 5, "J": 3, "Sa": 1, "A": 0.5, "D": 0.5},
}

#: Units that stray into faces without meaning an affect.
STRAYS = (2, 4, 7, 14, 17, 18, 23, 24, 25, 28, 43)


@dataclass(frozen=True)
class Spread:
    """How far realisations stray from the prototypes; the difficulty of the corpus lies here.

    Parameters
    ----------
    missing : float
        Probability that a unit of the variant is not shown.
    mixed : float
        Probability that another affect is mixed in.
    mixed_share : (float, float)
        Least and greatest share of the other affect.
    stray : float
        Probability that a unit from `STRAYS` is added.
    repetition : float
        Standard deviation of the logarithm of a unit's strength from one repetition to the next.
    habit : float
        The same from one signer to the next.
    amplitude : (float, float, float)
        Fraction of the full strength at intensities 1, 2 and 3.
    """

    missing: float = 0.14
    mixed: float = 0.40
    mixed_share: tuple[float, float] = (0.15, 0.45)
    stray: float = 0.35
    repetition: float = 0.28
    habit: float = 0.30
    amplitude: tuple[float, float, float] = (0.34, 0.60, 0.90)


@dataclass(frozen=True, eq=False)
class Habits(Content):
    """What is a signer's own in showing affects and in moving.

    Parameters
    ----------
    variants : dict
        Affect: (variants,) probabilities, few of them likely.
    gains : dict
        (affect, action unit): factor on the strength; 0 where the signer never shows that unit for that affect.
    asymmetry : dict
        Action unit: relative difference between left and right (positive: left stronger).
    expressivity : float
        Factor on everything.
    tempo : float
        Factor on the speed of transitions.
    resting : dict
        Base: tonic weight that comes and goes at rest.
    """

    variants: dict[str, np.ndarray]
    gains: dict[tuple[str, int], float]
    asymmetry: dict[int, float]
    expressivity: float
    tempo: float
    resting: dict[str, float]


#: Bases that are seldom quite at rest, and how far they go.
RESTING = {
    "browInnerUp": 0.06,
    "browDown*": 0.06,
    "eyeSquint*": 0.05,
    "mouthPress*": 0.08,
    "mouthFrown*": 0.07,
    "mouthSmile*": 0.05,
    "mouthRollLower": 0.05,
    "mouthShrugLower": 0.06,
    "jawOpen": 0.03,
}


def draw_habits(rng: np.random.Generator, spread: Spread) -> Habits:
    """The habits of a new signer."""
    variants, gains = {}, {}
    for affect, prototypes in PROTOTYPES.items():
        # Concentration below one: a person has one or two ways of showing an affect, not all of them.
        variants[affect] = rng.dirichlet(np.full(len(prototypes), 0.6))
        for unit in sorted({unit for prototype in prototypes for unit in prototype}):
            never = rng.random() < 0.5 * spread.missing
            gains[affect, unit] = 0.0 if never else float(np.exp(rng.normal(0.0, spread.habit)))
    return Habits(
        variants=variants,
        gains=gains,
        asymmetry={unit: float(np.clip(rng.normal(0.0, 0.12), -0.3, 0.3)) for unit in UNITS},
        expressivity=float(rng.uniform(0.85, 1.10)),
        tempo=float(rng.uniform(0.85, 1.20)),
        resting={name: float(weight * rng.uniform(0.2, 1.0)) for name, weight in RESTING.items()},
    )


def draw_units(
    affect: str, intensity: int, habits: Habits, spread: Spread, rng: np.random.Generator
) -> dict[int, float]:
    """Strength per action unit of one realisation of an affect, before mixing and strays."""
    variant = rng.choice(len(PROTOTYPES[affect]), p=habits.variants[affect])
    amplitude = spread.amplitude[intensity - 1] * habits.expressivity * np.exp(rng.normal(0.0, 0.10))
    strengths = {}
    for unit, strength in PROTOTYPES[affect][variant].items():
        present = rng.random() >= spread.missing
        factor = habits.gains[affect, unit] * np.exp(rng.normal(0.0, spread.repetition))
        strengths[unit] = float(strength * amplitude * factor) if present else 0.0
    if max(strengths.values()) < 0.5 * amplitude * max(PROTOTYPES[affect][variant].values()):
        # An annotator would not have seen the affect: its first (defining) unit is shown after all.
        first = next(iter(PROTOTYPES[affect][variant]))
        strengths[first] = float(PROTOTYPES[affect][variant][first] * amplitude)
    return strengths


def draw_face(
    affect: str, intensity: int, habits: Habits, spread: Spread, names: tuple[str, ...], rng: np.random.Generator
) -> np.ndarray:
    """(N,) weights of one realisation of an affect at its apex.

    Parameters
    ----------
    affect : str
        One of `AFFECTS`, or `N` for a face at rest (never quite zero).
    intensity : int
        1, 2 or 3; of no account for `N`.
    habits : Habits
        Whose face.
    spread : Spread
    names : (N,) tuple of str
        The bases' names, in order.
    rng : numpy Generator

    Returns
    -------
    (N,) float64 array
    """
    if affect == NEUTRAL:
        tonic = {name: weight * rng.random() for name, weight in habits.resting.items()}
        return base_weights(tonic, names)
    strengths = draw_units(affect, intensity, habits, spread, rng)
    if rng.random() < spread.mixed:
        others = MIXTURES[affect]
        chances = np.array(list(others.values()), dtype=float)
        other = str(rng.choice(list(others), p=chances / chances.sum()))
        share = rng.uniform(*spread.mixed_share)
        mixed = draw_units(other, intensity, habits, spread, rng)
        strengths = {
            unit: (1 - share) * strengths.get(unit, 0.0) + share * mixed.get(unit, 0.0)
            for unit in sorted({*strengths, *mixed})
        }
    if rng.random() < spread.stray:
        unit = int(rng.choice(STRAYS))
        strengths[unit] = strengths.get(unit, 0.0) + float(rng.uniform(0.1, 0.4))
    sides = {unit: habits.asymmetry[unit] + rng.normal(0.0, 0.06) for unit in strengths}
    return unit_weights(strengths, names, sides)


def unit_weights(
    strengths: dict[int, float], names: tuple[str, ...], asymmetry: dict[int, float] | None = None
) -> np.ndarray:
    """(N,) weights of the bases from strengths of action units."""
    total = np.zeros(len(names))
    for unit, strength in strengths.items():
        side = 0.0 if asymmetry is None else asymmetry.get(unit, 0.0)
        total += base_weights({name: strength * weight for name, weight in UNITS[unit].items()}, names, side)
    return total


def base_weights(shape: dict[str, float], names: tuple[str, ...], asymmetry: float = 0.0) -> np.ndarray:
    """(N,) weights from `{base: weight}`, where `*` in a name stands for Left and Right.

    Raises
    ------
    SignfaceError
        The face has no such base.
    """
    weights = np.zeros(len(names))
    for name, weight in shape.items():
        sides = (("Left", 1 + asymmetry), ("Right", 1 - asymmetry)) if "*" in name else (("", 1.0),)
        for side, factor in sides:
            base = name.replace("*", side)
            if base not in names:
                raise SignfaceError(f"the face has no base named {base}", hint="synthesise with the default face")
            weights[names.index(base)] += weight * factor
    return weights
