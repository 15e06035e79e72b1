"""People of the second synthetic corpus: a face of their own, and a way of showing what they feel.

- `Person`, `draw_person`: one of them.
- `COMPONENTS`: the parts of the expressions, and how many of all people show each.

The expressions are those that S. Du, Y. Tao and A. M. Martinez found in 230 people whom they asked for them (Compound
facial expressions of emotion, PNAS 111(15), 2014, table 1): action units that nearly all used, and units that a share
of them used, which is here the probability that a person has the habit. The first corpus takes the combinations that
EMFACS predicts, as whole variants. Nothing here was chosen by looking at what a classifier does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from signface.content import Content
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel

#: Action unit: bases at full strength; `*` stands for Left and Right.
MUSCLES: dict[int, dict[str, float]] = {
    1: {"browInnerUp": 0.75, "browOuterUp*": 0.10},
    2: {"browOuterUp*": 0.80, "browInnerUp": 0.10},
    4: {"browDown*": 0.75, "eyeSquint*": 0.10},
    5: {"eyeWide*": 0.80},
    6: {"cheekSquint*": 0.75, "eyeSquint*": 0.40},
    7: {"eyeSquint*": 0.75, "cheekSquint*": 0.10},
    9: {"noseSneer*": 0.80, "cheekSquint*": 0.20, "mouthUpperUp*": 0.10},
    10: {"mouthUpperUp*": 0.75},
    11: {"mouthUpperUp*": 0.15, "mouthDimple*": 0.20, "noseSneer*": 0.15},
    12: {"mouthSmile*": 0.80, "mouthDimple*": 0.10},
    15: {"mouthFrown*": 0.80, "mouthShrugLower": 0.10},
    17: {"mouthShrugLower": 0.75, "mouthShrugUpper": 0.20, "mouthPress*": 0.10},
    20: {"mouthStretch*": 0.85, "mouthFrown*": 0.10},
    23: {"mouthRollLower": 0.40, "mouthRollUpper": 0.30, "mouthPress*": 0.30},
    24: {"mouthPress*": 0.75, "mouthClose": 0.10},
    25: {"mouthLowerDown*": 0.40, "mouthUpperUp*": 0.20, "jawOpen": 0.08},
    26: {"jawOpen": 0.55, "mouthLowerDown*": 0.10},
}

#: Affect: action unit and the share of people who use it (1: nearly all).
COMPONENTS: dict[str, dict[int, float]] = {
    "A": {4: 1.0, 7: 1.0, 24: 1.0, 10: 0.26, 17: 0.52, 23: 0.29},
    "D": {9: 1.0, 10: 1.0, 17: 1.0, 4: 0.31, 24: 0.26},
    "F": {1: 1.0, 4: 1.0, 20: 1.0, 25: 1.0, 2: 0.57, 5: 0.63, 26: 0.33},
    "J": {12: 1.0, 25: 1.0, 6: 0.51},
    "Sa": {4: 1.0, 15: 1.0, 1: 0.60, 6: 0.50, 11: 0.26, 17: 0.67},
    "Su": {1: 1.0, 2: 1.0, 25: 1.0, 26: 1.0, 5: 0.66},
}
AFFECTS = tuple(COMPONENTS)

#: Distance from the avatar's face of what is drawn: deviation of sizes along the axes, and of single bumps (mm).
SIZES, BUMPS_MM = 0.05, 2.5
#: Bumps of a face, and how wide they are (mm).
BUMPS, BUMP_WIDTH_MM = 9, 30.0
#: Where displacements of skin begin to be held back (mm).
HELD_BACK_MM = 28.0
#: One person in three shows everything with half the strength.
RESERVED = 1 / 3


@dataclass(frozen=True, eq=False)
class Person(Content):
    """Somebody who does not exist.

    Parameters
    ----------
    labels : (M,) tuple of str
        Landmarks: those of the face first, then the head's.
    rest : (M, 3) array
        Where they are at rest, in the head's frame, millimetres.
    bases : (N, M, 3) array
        Their displacement by each base of this person; head landmarks do not move.
    gains : (N,) array
        Strength of each of these bases beside the avatar's.
    habits : dict
        Affect: strength of each base at full intensity, (N,).
    strength : float
        Factor on all that the face does.
    tempo : float
        Factor on how fast.
    lively : float
        How much the face does beside affect: mouthing, brows, head.
    tonic : (N,) array
        Weights at rest.
    """

    labels: tuple[str, ...]
    rest: np.ndarray
    bases: np.ndarray
    gains: np.ndarray
    habits: dict[str, np.ndarray]
    strength: float
    tempo: float
    lively: float
    tonic: np.ndarray

    def skin(self, weights: np.ndarray) -> np.ndarray:
        """(F, M, 3) landmarks in the head's frame for (F, N) weights; skin that is pulled far gives less."""
        moved = np.tensordot(weights, self.bases, axes=1)
        length = np.linalg.norm(moved, axis=2, keepdims=True)
        return self.rest + moved / np.sqrt(1.0 + (length / HELD_BACK_MM) ** 2)


def draw_person(face: FaceModel, layout: MarkerLayout, rng: np.random.Generator) -> Person:
    """A new person with the landmarks of a layout on the face."""
    points = np.concatenate([layout.points(face), layout.points(face, layout.head_labels)])
    avatar = np.concatenate([layout.bases(face), np.zeros((face.n_bases, len(layout.head_labels), 3))], axis=1)
    sizes = 1.0 + SIZES * rng.standard_normal(3)
    centres = points[rng.choice(len(points), BUMPS)]
    heights = BUMPS_MM * rng.standard_normal((BUMPS, 3))
    near = np.exp(-0.5 * (np.linalg.norm(points[:, None] - centres, axis=2) / BUMP_WIDTH_MM) ** 2)
    gains = np.exp(0.25 * rng.standard_normal(face.n_bases))
    sides = _sides(face.names)
    gains = gains * (1.0 + 0.12 * rng.standard_normal() * sides)  # faces are stronger on one side
    # Muscles insert elsewhere: each base is stronger here and weaker there, and pulls a little aside.
    local = np.exp(0.35 * (near - near.mean(axis=0)) @ rng.standard_normal((BUMPS, face.n_bases))).T
    aside = 0.12 * rng.standard_normal((face.n_bases, 3, 3))
    bases = np.einsum("nmi,nij->nmj", avatar, np.eye(3) + aside) * (sizes * gains[:, None, None] * local[:, :, None])
    return Person(
        labels=(*layout.face_labels, *layout.head_labels),
        rest=points * sizes + near @ heights,
        bases=bases,
        gains=gains,
        habits={affect: _habit(COMPONENTS[affect], face.names, rng) for affect in AFFECTS},
        strength=float(rng.uniform(0.45, 0.55) if rng.random() < RESERVED else rng.uniform(0.8, 1.15)),
        tempo=float(np.exp(rng.normal(0.0, 0.25))),
        lively=float(rng.uniform(0.4, 1.3)),
        tonic=np.where(rng.random(face.n_bases) < 0.2, rng.uniform(0.0, 0.12, face.n_bases), 0.0),
    )


def weights_of(shape: dict[str, float], names: tuple[str, ...]) -> np.ndarray:
    """(N,) weights of a shape, in which `*` stands for both sides."""
    weights = np.zeros(len(names))
    for pattern, weight in shape.items():
        for side in ("Left", "Right") if "*" in pattern else ("",):
            weights[names.index(pattern.replace("*", side))] += weight
    return weights


def _habit(units: dict[int, float], names: tuple[str, ...], rng: np.random.Generator) -> np.ndarray:
    """(N,) weights of an affect as one person shows it."""
    used = [unit for unit, share in units.items() if rng.random() < share]
    strengths = {unit: rng.uniform(0.55, 1.1) for unit in used}
    return np.sum([strength * weights_of(MUSCLES[unit], names) for unit, strength in strengths.items()], axis=0)


def _sides(names: tuple[str, ...]) -> np.ndarray:
    """(N,) 1 for bases of the left, -1 for those of the right, 0 for others."""
    return np.array([1.0 if name.endswith("Left") else -1.0 if name.endswith("Right") else 0.0 for name in names])
