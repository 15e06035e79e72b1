"""Synthetic signers whom no solver has met, with their takes brought to the avatar.

- `make_recordings`: takes of some signers, prepared for solving, with the weights that show the same on the avatar.
- `without_creep`: displacements with what the markers crept taken away, as `solve` does.
- `slipped`: displacements in which markers have slipped.
- `own_face`: markers on the avatar itself.

Signers, takes and noise are those of `signface synth` (other heads by 4 to 6 mm RMS, bases stronger, weaker and turned,
markers misplaced by 1 to 3 mm, jitter of 0.1 to 0.3 mm, gaps), with seeds that nothing else uses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.settings.solve import SolveSettings
from signface.solver.creep import RATE_HZ, Creep
from signface.solver.range_of_motion import Shown
from signface.solver.solving import prepare_take
from signface.synth.corpus import TakeRequest, make_plan, make_signer, make_take
from signface.synth.expressions import Spread
from signface.synth.markers import head_motion, record
from signface.takes.take import Take

RATE = 200.0


@dataclass(frozen=True)
class Recording:
    """A take brought to the avatar, and the truth.

    Parameters
    ----------
    signer : int
    name : str
    displacements : dict of str to (F, P, 3) array
        By the name of the adaptation, millimetres, NaN where a marker is missing.
    weights : (F, N) array
        Weights with which the avatar shows what the signer shows.
    shown : tuple of Shown
        In a range-of-motion take, what somebody wrote down of it.
    """

    signer: int
    name: str
    displacements: dict[str, np.ndarray]
    weights: np.ndarray
    shown: tuple[Shown, ...] = ()


def _prepared(
    signer: int, name: str, take: Take, neutral_s: float, weights: np.ndarray, face, layout, shown=()
) -> Recording:
    displacements = {
        adaptation: prepare_take(
            take, face, layout, settings=SolveSettings(neutral=neutral_s, adaptation=adaptation, creep=False)
        ).displacements
        for adaptation in ("similarity", "rbf")
    }
    return Recording(signer, name, displacements, weights, tuple(shown))


def make_recordings(
    face: FaceModel, layout: MarkerLayout, *, seed: int, signers: int, takes: int
) -> tuple[list[Recording], list[Recording]]:
    """Takes of signers, and of each a range-of-motion take in which every base is shown by itself.

    Returns
    -------
    (list of Recording, list of Recording)
        Takes, and range-of-motion takes.
    """
    kinds = [("IE", 0), ("EU", 2), ("SE", 1), ("IE", 4), ("EU", 11), ("EU", 7)]
    recordings, motions = [], []
    for signer in range(signers):
        for step in range(takes):
            kind, number = kinds[(signer + step) % len(kinds)]
            request = TakeRequest(seed, signer, kind, number)
            made = make_take(request)
            recordings.append(
                _prepared(signer, request.name, made.take, made.neutral_s, made.avatar_weights.weights, face, layout)
            )
        motions.append(_range_of_motion(face, layout, seed, signer))
    return recordings, motions


def _range_of_motion(face: FaceModel, layout: MarkerLayout, seed: int, signer: int) -> Recording:
    """A second of rest, then each base rising and falling again within 0.8 s.

    Nobody shows a base as a machine would: each has a strength of its own (0.6 to 1), another base or two move along a
    little (up to 0.15), and what is written down of when it was shown is 0.05 s off.
    """
    who = make_signer(seed, signer, Spread())
    rng = np.random.default_rng([seed, signer])
    rest, length = int(RATE), int(0.8 * RATE)
    weights = np.zeros((rest + length * face.n_bases, face.n_bases))
    shape = np.sin(np.linspace(0.0, np.pi, length)) ** 2
    shown = []
    for base in range(face.n_bases):
        start = rest + base * length
        weights[start : start + length, base] = rng.uniform(0.6, 1.0) * shape
        for other in rng.choice(face.n_bases, rng.integers(0, 3), replace=False):
            weights[start : start + length, other] += rng.uniform(0.0, 0.15) * shape
        begin, end = np.array([start, start + length]) / RATE + rng.normal(0.0, 0.05, 2)
        shown.append(Shown(begin, end, (face.names[base],)))
    plan = make_plan(TakeRequest(seed, signer, "IE", 0), who.habits)
    time = np.arange(len(weights)) / RATE
    poses = head_motion(plan, time, RATE, rng)
    positions = record(who.head, who.glued, weights, poses, plan, RATE, rng)
    take = Take(positions, who.glued.labels, RATE, name=f"S{signer + 1}_ROM")
    return _prepared(signer, take.name, take, 0.5, who.head.avatar_weights(weights), face, layout, shown)


def without_creep(
    displacements: np.ndarray, face: FaceModel, layout: MarkerLayout, signer_bases: np.ndarray | None = None
) -> np.ndarray:
    """(F, P, 3) displacements of a whole take at `RATE` with the creep of its markers taken away."""
    step = round(RATE / RATE_HZ)
    creep = Creep(face, layout, signer_bases=signer_bases).fit(displacements[::step], RATE / step)
    return displacements - creep.at(np.arange(len(displacements)) / step)


def slipped(displacements: np.ndarray, seed: int) -> np.ndarray:
    """(F, P, 3) displacements in which two markers stand 4 mm beside their places for a third of the take."""
    rng, result = np.random.default_rng(seed), displacements.copy()
    for _ in range(2):
        start, aside = rng.integers(0, len(result) // 2), rng.normal(size=3)
        result[start : start + len(result) // 3, rng.integers(result.shape[1])] += 4.0 * aside / np.linalg.norm(aside)
    return result


def own_face(layout: MarkerLayout, face: FaceModel, weights: np.ndarray, jitter_mm: float, seed: int) -> np.ndarray:
    """(F, P, 3) displacements of markers on the avatar itself, each jittering by `jitter_mm` RMS in space."""
    marked = np.tensordot(weights, layout.bases(face), axes=1)
    return marked + np.random.default_rng(seed).normal(0.0, jitter_mm / np.sqrt(3.0), marked.shape)
