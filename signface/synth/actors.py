"""Actors who do not exist: a head of their own, a range of motion, and takes to test on.

- `draw_actors`: heads of the synthetic corpus with both kinds of motion.
- `range_of_motion`: a face that goes through all it can do (Reverdy 2019, 3.4.2).
- `signed_takes`: utterances in sign language with affect, another kind of motion than the one trained on.
- `Virtual`: the markers of a layout on an actor, clean or as they are really glued.

The skin of a head departs from the avatar's bases (`signface.synth.heads`): nothing that is solved with
these bases inverts the program that made the data.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from signface.content import Content
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.face.reading import read_identities
from signface.synth.expressions import UNITS, Spread, draw_habits, unit_weights
from signface.synth.heads import Head, draw_head
from signface.synth.markers import JITTER_MM, glue_markers
from signface.synth.motion import pose_track, saturate, smooth_noise
from signface.synth.performance import group_of_bases, perform
from signface.synth.programme import UTTERANCES, plan_utterance

#: Frames per second, as in Reverdy 2019, 3.4.1.
RATE = 30.0


@dataclass(frozen=True, eq=False)
class Actor(Content):
    """An actor.

    Parameters
    ----------
    name : str
        `A`, `B`, ...
    head : Head
    range_of_motion : (F, N) array
        Weights of the head's own bases over the range-of-motion take.
    takes : (F', N) array
        The same over all test takes, one after the other.
    seed : int
    """

    name: str
    head: Head
    range_of_motion: np.ndarray
    takes: np.ndarray
    seed: int

    def shown(self, weights: np.ndarray) -> np.ndarray:
        """(F, N) weights with which the avatar shows the same: what a mapping from markers should find."""
        return self.head.avatar_weights(weights)


def draw_actors(face: FaceModel, count: int, *, seconds: float = 90.0, seed: int = 0) -> list[Actor]:
    """Actors with a range-of-motion take and test takes of `seconds` each.

    Parameters
    ----------
    face : FaceModel
        The default face: heads are drawn on its topology.
    count : int
        At most 26.
    seconds : float
    seed : int
        An actor depends on the seed and on its own letter only, not on how many there are.
    """
    identities, names = read_identities()
    actors = []
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        head = draw_head(face, identities, names, rng)
        motion = range_of_motion(face.names, seconds, rng)
        takes = signed_takes(face.names, seconds, rng)
        actors.append(Actor(chr(ord("A") + number), head, motion, takes, int(rng.integers(2**31))))
    return actors


def range_of_motion(names: tuple[str, ...], seconds: float, rng: np.random.Generator) -> np.ndarray:
    """(F, N) weights of somebody who explores what the face can do, making grimaces.

    Grimaces are of three kinds, in a drawn order: one base alone (each base has its turn while time lasts), a few bases
    on both sides at random strengths, and some action units of FACS together.
    """
    count = len(names)
    time = np.arange(round(seconds * RATE)) / RATE
    poses, starts, ends = [np.zeros(count)], [], []
    turn = list(rng.permutation(count))
    now = 0.5
    while now < seconds:
        kind = rng.random()
        pose = np.zeros(count)
        if kind < 0.4 and turn:
            pose[turn.pop()] = rng.uniform(0.6, 1.0)
        elif kind < 0.7:
            some = rng.choice(count, rng.integers(2, 7), replace=False)
            pose[some] = rng.uniform(0.2, 1.0, len(some))
        elif kind < 0.95:
            units = rng.choice(sorted(UNITS), rng.integers(1, 5), replace=False)
            sides = {int(unit): float(rng.normal(0.0, 0.3)) for unit in units}
            pose = unit_weights({int(unit): float(rng.uniform(0.3, 1.0)) for unit in units}, names, sides)
        change = rng.uniform(0.25, 0.6)
        poses.append(pose)
        starts.append(now)
        ends.append(now + change)
        now += change + rng.uniform(0.1, 0.7)
    track = pose_track(time, np.array(poses), starts, ends, group_of_bases(names), rng)
    noise = 0.01 * np.maximum(smooth_noise(rng, len(time), RATE, 0.5, count), 0.0)
    return saturate(np.maximum(track, 0.0) + noise)


def signed_takes(names: tuple[str, ...], seconds: float, rng: np.random.Generator) -> np.ndarray:
    """(F, N) weights of utterances of the synthetic corpus, each once, until `seconds` are filled."""
    spread = Spread()
    habits = draw_habits(rng, spread)
    parts: list[np.ndarray] = []
    frames = round(seconds * RATE)
    while sum(map(len, parts)) < frames:
        for number in rng.permutation(len(UTTERANCES)):
            plan = plan_utterance(int(number), rng, habits, times=1)
            time = np.arange(max(2, round(plan.duration * RATE))) / RATE
            parts.append(perform(plan, time, habits, spread, names, rng))
    return np.concatenate(parts)[:frames]


@dataclass(frozen=True, eq=False)
class Virtual(Content):
    """The markers of a layout on an actor.

    Parameters
    ----------
    corners : (P, 3) int array
    barycentric : (P, 3) array
        Where each marker really stands.
    jitter : (P,) array
        Root mean square noise of each, millimetres.
    """

    corners: np.ndarray
    barycentric: np.ndarray
    jitter: np.ndarray

    @classmethod
    def clean(cls, layout: MarkerLayout) -> Virtual:
        """Each marker on its point, without noise."""
        rows = [layout.labels.index(label) for label in layout.face_labels]
        return cls(layout.corners[rows], layout.barycentric[rows], np.zeros(len(rows)))

    @classmethod
    def glued(cls, layout: MarkerLayout, actor: Actor, rng: np.random.Generator) -> Virtual:
        """Each marker 1 to 3 mm from its point along the skin, with the jitter of cameras (0.1 to 0.3 mm)."""
        glued = glue_markers(actor.head, layout.restricted(layout.face_labels), rng)
        return cls(glued.corners, glued.barycentric, rng.uniform(*JITTER_MM, len(glued.labels)))

    def record(self, actor: Actor, weights: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """(F, P, 3) positions in the head's frame, millimetres."""
        vertices, where = np.unique(self.corners, return_inverse=True)
        skin = actor.head.skin(weights, vertices)
        recorded = np.zeros((len(weights), len(self.corners), 3))
        for corner, share in zip(where.reshape(self.corners.shape).T, self.barycentric.T):
            recorded += skin[:, corner] * share[:, None]
        return recorded + rng.standard_normal(recorded.shape) * (self.jitter / np.sqrt(3.0))[:, None]
