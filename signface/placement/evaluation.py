"""How well a layout tells what the face does (Reverdy 2019, 3.3.2, eq. 3.5).

- `skin_metric`: the squared error of the skin as a quadratic form of the weights' errors.
- `evaluate_layout`: train on one actor's range of motion, test on the others' takes, by three mappings.
- `error_map`: where on the face the error lies.

The truth is the weights with which the avatar shows what the actor's skin shows (`Actor.shown`), and the error is taken
on the avatar's skin, in millimetres, so that mappings that learn weights and a solver that finds them are measured by
the same yardstick.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from signface.content import Content
from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.solver.adaptation import SimilarityAdaptation
from signface.solver.methods import make_solver
from signface.solver.rivals.gaussian_process import GaussianProcess, SparseOnlineGaussianProcess
from signface.synth.actors import Actor, Virtual

#: The mappings, and how they are called in reports.
MAPPINGS = {
    "gp": "Gaussian process regression",
    "sogp": "sparse online Gaussian process",
    "thin-shell": "thin-shell solve",
}
#: Of the frames at 30 Hz, every so many is trained and tested on: neighbours say the same.
EVERY = 3
#: Most frames of the exact Gaussian process.
EXACT_FRAMES = 600
#: Frames of a neutral face that the thin-shell solve is given.
NEUTRAL_FRAMES = 10
#: A marker's coordinate that strays less than this (mm, standard deviation) is not blown up to 1.
STILL_MM = 0.1
#: How markers stand: on their points and without noise, or as they are really glued and seen.
CONDITIONS = ("clean", "glued")


@dataclass(frozen=True, eq=False)
class Errors(Content):
    """The errors of a layout under one mapping, from one actor to another.

    Parameters
    ----------
    mapping : str
        A key of `MAPPINGS`.
    train, test : str
        Names of the actors; `train` is `-` for the thin-shell solve, which learns nothing.
    rms_mm : float
        Root mean square distance of a vertex from the truth, over frames and the moving vertices.
    moment : (N, N) array
        Second moment of the weights' errors.
    """

    mapping: str
    train: str
    test: str
    rms_mm: float
    moment: np.ndarray


def skin_metric(face: FaceModel) -> np.ndarray:
    """(N, N) Gram matrix of the bases over the moving vertices, per vertex (mm squared).

    For errors `e` of the weights, `e' G e` is the mean squared error of the moving vertices; times their number, it is
    the inner sum of eq. 3.5.
    """
    flat = face.bases[:, face.moving].reshape(face.n_bases, -1)
    return flat @ flat.T / int(face.moving.sum())


def error_map(face: FaceModel, moment: np.ndarray) -> np.ndarray:
    """(V,) root mean square error of each vertex, millimetres, from the second moment of the weights' errors."""
    bases = face.bases.transpose(1, 2, 0)
    return np.sqrt(np.maximum(np.einsum("vdn,nm,vdm->v", bases, moment, bases, optimize=True), 0.0))


def evaluate_layout(
    face: FaceModel,
    layout: MarkerLayout,
    actors: Sequence[Actor],
    tested: Sequence[str],
    *,
    condition: str = "clean",
    draw: int = 0,
    mappings: Sequence[str] = tuple(MAPPINGS),
) -> list[Errors]:
    """Errors of a layout for every mapping and every pair of actors.

    The Gaussian processes are trained on the range of motion of each actor in turn and tested on the takes of the
    others. As in 3.4.3, markers are centred and scaled by the mean and standard deviation that they have in the range
    of motion of the actor who wears them.

    Parameters
    ----------
    face : FaceModel
        The avatar.
    layout : MarkerLayout
    actors : sequence of Actor
    tested : sequence of str
        Names of the actors whose takes are tested on.
    condition : str
        `clean`, or `glued`: every actor wears each marker 1 to 3 mm aside, with jitter, in training and in tests.
    draw : int
        Which draw of the placement errors.
    mappings : sequence of str
        Some of `MAPPINGS`.

    Raises
    ------
    SignfaceError
        There is no such condition or mapping, or the layout does not suit the face.
    """
    if condition not in CONDITIONS:
        raise SignfaceError(f"no condition is called {condition}", hint=f"they are {', '.join(CONDITIONS)}")
    unknown = [mapping for mapping in mappings if mapping not in MAPPINGS]
    if unknown:
        raise SignfaceError(f"no mapping is called {unknown[0]}", hint=f"they are {', '.join(MAPPINGS)}")
    metric = skin_metric(face)
    worn = [_Worn.by(actor, layout, condition, draw) for actor in actors]
    errors: list[Errors] = []

    def note(mapping: str, train: str, test: _Worn, weights: np.ndarray) -> None:
        error = weights - test.truth
        moment = error.T @ error / len(error)
        errors.append(Errors(mapping, train, test.actor.name, float(np.sqrt((metric * moment).sum())), moment))

    learners: dict[str, Callable[[_Worn], object]] = {"gp": _train_exact, "sogp": _train_sparse}
    for mapping in mappings:
        if mapping == "thin-shell":
            solver = make_solver("thin-shell", face, layout)
            target = layout.points(face)
            for test in worn:
                if test.actor.name in tested:
                    adaptation = SimilarityAdaptation(test.neutral, target)
                    moved = adaptation.transform(test.takes) - adaptation.transform(test.neutral)
                    note(mapping, "-", test, solver.solve(moved).weights)
            continue
        for train in worn:
            if not any(name != train.actor.name for name in tested):
                continue
            model = learners[mapping](train)
            for test in worn:
                if test.actor.name in tested and test is not train:
                    note(mapping, train.actor.name, test, model.predict(test.scaled(test.takes)))  # type: ignore[attr-defined]
    return errors


@dataclass(frozen=True)
class _Worn:
    """The markers that an actor wears, as recorded."""

    actor: Actor
    training: np.ndarray
    takes: np.ndarray
    neutral: np.ndarray

    @classmethod
    def by(cls, actor: Actor, layout: MarkerLayout, condition: str, draw: int) -> _Worn:
        rng = np.random.default_rng([actor.seed, draw])
        markers = Virtual.clean(layout) if condition == "clean" else Virtual.glued(layout, actor, rng)
        neutral = markers.record(actor, np.zeros((NEUTRAL_FRAMES, actor.takes.shape[1])), rng).mean(axis=0)
        training = markers.record(actor, actor.range_of_motion[::EVERY], rng)
        return cls(actor, training, markers.record(actor, actor.takes[::EVERY], rng), neutral)

    @property
    def truth(self) -> np.ndarray:
        """(F, N) weights shown in the takes."""
        return self.actor.shown(self.actor.takes[::EVERY])

    @property
    def lesson(self) -> np.ndarray:
        """(F, N) weights shown in the range of motion."""
        return self.actor.shown(self.actor.range_of_motion[::EVERY])

    def scaled(self, positions: np.ndarray) -> np.ndarray:
        """(F, 3P) positions about their mean in the range of motion, divided by their deviation there."""
        deviation = np.maximum(self.training.std(axis=0), STILL_MM)
        return ((positions - self.training.mean(axis=0)) / deviation).reshape(len(positions), -1)


def _train_exact(worn: _Worn) -> GaussianProcess:
    some = np.linspace(0, len(worn.training) - 1, min(EXACT_FRAMES, len(worn.training))).astype(int)
    return GaussianProcess().fit(worn.scaled(worn.training)[some], worn.lesson[some])


def _train_sparse(worn: _Worn) -> SparseOnlineGaussianProcess:
    return SparseOnlineGaussianProcess().fit(worn.scaled(worn.training), worn.lesson)
