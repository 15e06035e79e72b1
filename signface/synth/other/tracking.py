"""How a tracker of landmarks sees the people of the second synthetic corpus.

- `Tracker`, `draw_tracker`: one of many.
- `track`: the landmarks that it gives.

What is put in is what such trackers are known for: jitter of one to three millimetres that neighbouring landmarks
share and that lasts for some frames, since frames are filtered or start from the last one; landmarks that move with
the head's pose, since depth is guessed; regions that are never seen (hair over a brow, a beard on the chin); and hands
before the face, behind which landmarks are lost or, more often, guessed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from signface.synth.other.acting import STEPS_HZ, wander
from signface.synth.other.people import Person

#: Frames per second of films (Hz).
RATES_HZ = (25.0, 30.0, 50.0, 60.0)
#: Root mean square jitter in space (mm), and over how much of the face it is shared (mm).
JITTER_MM, SHARED_MM = (1.0, 3.0), 18.0
#: How far landmarks are off at 30 degrees of yaw or pitch (mm, root mean square in space).
POSE_BIAS_MM = (0.5, 2.5)
#: Share of takes in which a region of the face is never seen, and its radius (mm).
HIDDEN, HIDDEN_MM = 0.3, (15.0, 28.0)
#: Hands before the face, a second of signing; how long (s), how large (mm), and how far off what is guessed is (mm).
HANDS_HZ, HAND_S, HAND_MM, GUESSED_MM = 0.25, (0.15, 0.7), (18.0, 40.0), (2.0, 7.0)
#: Share of them behind which landmarks are guessed, not lost.
GUESSES = 0.6
#: The head turns about the top of the neck (mm, in the head's frame).
NECK = np.array([0.0, -105.0, -25.0])


@dataclass(frozen=True)
class Tracker:
    """A film and a tracker.

    Parameters
    ----------
    rate : float
        Frames per second (Hz).
    jitter_mm : float
    lasting_s : float
        How long half of the jitter lasts; the other half differs from frame to frame.
    bias_mm : float
        See `POSE_BIAS_MM`.
    """

    rate: float
    jitter_mm: float
    lasting_s: float
    bias_mm: float


def draw_tracker(rng: np.random.Generator) -> Tracker:
    """A film and a tracker, drawn."""
    return Tracker(
        rate=float(rng.choice(RATES_HZ)),
        jitter_mm=float(rng.uniform(*JITTER_MM)),
        lasting_s=float(np.exp(rng.uniform(np.log(0.03), np.log(0.3)))),
        bias_mm=float(rng.uniform(*POSE_BIAS_MM)),
    )


def track(
    tracker: Tracker,
    person: Person,
    weights: np.ndarray,
    turns: np.ndarray,
    signing: list[tuple[float, float]],
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The landmarks that a tracker gives of a take.

    Parameters
    ----------
    tracker : Tracker
    person : Person
        With M landmarks.
    weights, turns : (S, N) and (S, 3) arrays
        As acted, `STEPS_HZ` a second.
    signing : list of (float, float)
        When hands are busy, seconds.
    rng : numpy Generator

    Returns
    -------
    positions : (F, M, 3) array
        Millimetres in the room, Y up; NaN where a landmark is lost.
    weights : (F, N) array
        As acted at the frames.
    poses : (F, 4, 4) array
        Of the head in the room.
    """
    frames = int(len(weights) / STEPS_HZ * tracker.rate)
    at = np.round(np.arange(frames) * STEPS_HZ / tracker.rate).astype(int)
    weights, turns = weights[at], turns[at]
    count = len(person.labels)
    seen = person.skin(weights)
    yaw, pitch = turns[:, 1] / np.radians(30.0), turns[:, 0] / np.radians(30.0)
    alike = _alike(person.rest)
    bias = tracker.bias_mm / np.sqrt(3.0) * np.einsum("mk,ckd->cmd", alike, rng.standard_normal((2, count, 3)))
    seen = seen + yaw[:, None, None] * bias[0] + pitch[:, None, None] * bias[1]
    fast = rng.standard_normal((frames, count, 3))
    slow = wander(frames, tracker.rate, tracker.lasting_s, count * 3, rng).reshape(frames, count, 3)
    jitter = (fast + np.einsum("mk,fkd->fmd", alike, slow)) / np.sqrt(2.0)
    seen += tracker.jitter_mm / np.sqrt(3.0) * jitter
    _hide(seen, person, signing, tracker.rate, rng)
    poses = np.tile(np.eye(4), (frames, 1, 1))
    facing = Rotation.from_euler("y", rng.uniform(-20.0, 20.0), degrees=True)
    poses[:, :3, :3] = (facing * Rotation.from_rotvec(turns)).as_matrix()
    sway = 6.0 * wander(frames, tracker.rate, 1.5, 3, rng)
    for axis in range(3):  # a body sways smoothly, whatever its random course
        sway[:, axis] = np.convolve(np.pad(sway[:, axis], 15, mode="edge"), np.full(31, 1 / 31), mode="valid")
    poses[:, :3, 3] = np.array([0.0, 0.0, 900.0]) + sway + NECK - np.einsum("fij,j->fi", poses[:, :3, :3], NECK)
    return np.einsum("fij,fmj->fmi", poses[:, :3, :3], seen) + poses[:, None, :3, 3], weights, poses


def _alike(points: np.ndarray) -> np.ndarray:
    """(M, M) rows of unit length that make neighbours of unit noise alike."""
    near = np.exp(-0.5 * (np.linalg.norm(points[:, None] - points, axis=2) / SHARED_MM) ** 2)
    return near / np.linalg.norm(near, axis=1, keepdims=True)


def _hide(
    seen: np.ndarray, person: Person, signing: list[tuple[float, float]], rate: float, rng: np.random.Generator
) -> None:
    """Lose, or guess, landmarks in place: a region for the whole take now and then, and behind hands."""
    of_face = np.flatnonzero(np.abs(person.bases).max(axis=(0, 2)) > 0)
    places = person.rest[of_face]

    def around(radius: float) -> np.ndarray:
        centre = places[rng.integers(len(places))]
        return of_face[np.linalg.norm(places - centre, axis=1) < radius]

    for start, end in signing:
        for moment in rng.uniform(start, end, rng.poisson(HANDS_HZ * (end - start))):
            first, last = (round(edge * rate) for edge in (moment, moment + rng.uniform(*HAND_S)))
            behind = around(rng.uniform(*HAND_MM))
            frames = slice(max(first, 0), max(last, 1))
            if rng.random() < GUESSES:
                seen[frames, behind] += rng.uniform(*GUESSED_MM) * _direction(rng)
            else:
                seen[frames, behind] = np.nan
    if rng.random() < HIDDEN:
        seen[:, around(rng.uniform(*HIDDEN_MM))] = np.nan


def _direction(rng: np.random.Generator) -> np.ndarray:
    """(3,) unit vector."""
    drawn = rng.standard_normal(3)
    return drawn / np.linalg.norm(drawn)
