"""Small hand-made takes for the tests of segmenting, labelling and evaluating: known motion, known labels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from signface.descriptors import Descriptors
from signface.label.training import Example
from signface.label.vocabulary import AFFECTS
from signface.segment.segments import Segments

BASES = tuple(f"base{number}" for number in range(12))

#: One face for each label: neutral is at rest, the others move three bases each, of which they share some.
FACES = {label: np.zeros(len(BASES)) for label in AFFECTS}
for number, label in enumerate(list(AFFECTS)[1:]):
    FACES[label][[2 * number, (2 * number + 1) % 12, (2 * number + 5) % 12]] = (0.9, 0.6, 0.4)


def eased(time: np.ndarray, start: float, duration: float) -> np.ndarray:
    """From 0 to 1 along the minimum-jerk curve."""
    s = np.clip((time - start) / duration, 0, 1)
    return 10 * s**3 - 15 * s**4 + 6 * s**5


def moving_face(
    faces: Sequence[np.ndarray],
    *,
    rate: float = 100.0,
    hold: float = 1.0,
    duration: float = 0.4,
    start: float = 0.0,
    noise: float = 0.0,
    seed: int = 0,
    name: str = "take",
) -> tuple[Descriptors, list[tuple[float, float]]]:
    """A take that holds each face in turn and moves between them, and when it moves (seconds)."""
    total = len(faces) * hold + (len(faces) - 1) * duration
    time = np.arange(round(total * rate)) / rate
    weights = np.tile(faces[0], (len(time), 1)).astype(float)
    moves = []
    for number in range(1, len(faces)):
        begin = number * hold + (number - 1) * duration
        weights += eased(time, begin, duration)[:, None] * (faces[number] - faces[number - 1])
        moves.append((start + begin, start + begin + duration))
    weights += np.random.default_rng(seed).normal(0, noise, weights.shape) if noise else 0
    names = BASES if weights.shape[1] == len(BASES) else tuple(f"b{i}" for i in range(weights.shape[1]))
    return Descriptors(weights, names, rate, start=start, name=name), moves


def example(
    labels: Sequence[str], *, take: str = "take", signer: str = "S1", kind: str = "IE", seed: int = 0, **motion
) -> Example:
    """An annotated take that shows the labels in turn, each a little differently each time."""
    rng = np.random.default_rng(seed)
    faces = [FACES[label] * rng.uniform(0.6, 1.0) + rng.normal(0, 0.02, len(BASES)) for label in labels]
    descriptors, moves = moving_face(faces, seed=seed, name=take, **{"noise": 0.01, **motion})
    marks = [descriptors.start, *(mark for move in moves for mark in move), descriptors.start + descriptors.duration]
    rows = [
        (marks[i], marks[i + 1], "transition", labels[i // 2] + labels[i // 2 + 1])
        if i % 2
        else (marks[i], marks[i + 1], "stable", labels[i // 2])
        for i in range(len(marks) - 1)
    ]
    reference = Segments(pd.DataFrame(rows, columns=["start_s", "end_s", "kind", "label"]), name=take)
    return Example(take=take, signer=signer, kind=kind, descriptors=descriptors, reference=reference)


def corpus(signers: Sequence[str] = ("S1", "S2"), *, hold: float = 0.6) -> list[Example]:
    """A small corpus of the protocol of the thesis: IE and EU of each signer, for each expression."""
    examples = []
    for s, signer in enumerate(signers):
        for n, label in enumerate(list(AFFECTS)[1:]):
            seed = 100 * s + n
            isolated = ["N", label, "N", label, "N"]
            examples.append(
                example(isolated, take=f"{signer}-IE-{label}", signer=signer, kind="IE", seed=seed, hold=hold)
            )
            uttered = ["N", label, "N"]
            examples.append(
                example(uttered, take=f"{signer}-EU-{label}", signer=signer, kind="EU", seed=seed + 50, hold=hold)
            )
    return examples
