"""A layout of so many markers by any of the methods, from the motion of some actors.

- `METHODS`: the methods, and how they are called in reports.
- `Material`: what they choose from; prepared once for a face, some actors and the captor's rules.
- `choose`: the layout.
- `unseen_bases`: what a motion or a layout does not show.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.placement.clusters import Clusters, cluster_markers, trajectories
from signface.placement.empirical import find_landmarks, with_head_markers
from signface.placement.evaluation import skin_metric
from signface.placement.selection import Criterion, OptimalDesign, Reconstruction, ThinShell, placement_noise, select
from signface.placement.sites import Rules, Sites, find_sites
from signface.synth.actors import Actor

METHODS = {
    "k-means": "k-means on trajectories",
    "greedy": "greedy on the reconstruction error",
    "a-optimal": "A-optimal design",
    "d-optimal": "D-optimal design",
    "thin-shell": "thin-shell selection",
}
#: Frames of each actor that are looked at: every so many (of 30 a second).
EVERY = 6
#: A base whose weight stays below this over a whole range of motion is not seen in it.
NEVER = 0.1


@dataclass(frozen=True)
class Material:
    """What layouts are chosen from.

    Parameters
    ----------
    face : FaceModel
        The avatar.
    actors : sequence of Actor
        Whose range of motion is looked at.
    rules : Rules
    """

    face: FaceModel
    actors: Sequence[Actor]
    rules: Rules

    @cached_property
    def sites(self) -> Sites:
        """Where markers may stand."""
        return find_sites(self.face, self.rules)

    @cached_property
    def weights(self) -> list[np.ndarray]:
        """(F, N) weights of each actor in the frames looked at."""
        return [actor.range_of_motion[::EVERY] for actor in self.actors]

    @cached_property
    def skins(self) -> list[np.ndarray]:
        """(F, V, 3) displacements of the skin of each actor in the frames looked at; 0 where nothing moves."""
        moving = self.sites.moving
        skins = []
        for actor, weights in zip(self.actors, self.weights):
            skin = np.zeros((len(weights), *self.face.mesh.vertices.shape))
            skin[:, moving] = actor.head.skin(weights, moving) - actor.head.face.mesh.vertices[moving]
            skins.append(skin)
        return skins

    @cached_property
    def rows(self) -> np.ndarray:
        """The trajectories to cluster."""
        clustered = self.sites.clustered
        mirror = None
        if self.rules.symmetric:
            row_of = np.full(len(self.face.mesh.vertices), -1)
            row_of[clustered] = np.arange(len(clustered))
            mirror = row_of[self.sites.mirror[clustered]]
            mirror = np.where(mirror < 0, np.arange(len(clustered)), mirror)
        return trajectories([skin[:, clustered] for skin in self.skins], mirror)

    @cached_property
    def _shell(self) -> ThinShell:
        return ThinShell(self.sites, self.face, np.concatenate(self.skins))

    @cached_property
    def _reconstruction(self) -> Reconstruction:
        union = self.sites.union
        positions = np.concatenate([skin[:, union] - skin[:, union].mean(axis=0) for skin in self.skins])
        seen_weights = [actor.shown(weights) for actor, weights in zip(self.actors, self.weights)]
        targets = np.concatenate([moved - moved.mean(axis=0) for moved in seen_weights])
        noise = placement_noise(self.face, np.concatenate(self.skins), union)
        return Reconstruction(self.sites, positions, targets, skin_metric(self.face), noise)

    def criterion(self, method: str, count: int) -> Criterion:
        """What forward selection goes by, before any marker is chosen."""
        if method in ("a-optimal", "d-optimal"):
            return OptimalDesign(
                self.sites, self.face, count, skin_metric(self.face) if method == "a-optimal" else None
            )
        return copy.copy(self._shell if method == "thin-shell" else self._reconstruction)

    def clusters(self, count: int, *, seed: int = 0) -> Clusters:
        """The clusters of k-means and their markers."""
        return cluster_markers(self.rows, self.sites, count, seed=seed)


def choose(material: Material, method: str, count: int, *, seed: int = 0) -> MarkerLayout:
    """A layout of `count` face markers, with the head markers of the default layout.

    Parameters
    ----------
    material : Material
    method : str
        A key of `METHODS`.
    count : int
    seed : int
        For k-means.

    Raises
    ------
    SignfaceError
        There is no such method, or so many markers cannot be placed.
    """
    if method not in METHODS:
        raise SignfaceError(f"no method is called {method}", hint=f"they are {', '.join(METHODS)}")
    if method == "k-means":
        vertices = material.clusters(count, seed=seed).markers
    else:
        sites = material.sites
        sites.check_count(count)
        vertices = select(material.criterion(method, count), sites, count)
    return named_layout(vertices, material.face, f"{method}-{count}")


def named_layout(vertices: Sequence[int], face: FaceModel, name: str) -> MarkerLayout:
    """A layout on vertices, each marker named after the landmark nearest to it, from the forehead down.

    The names say where to glue: `L_brow_tail`, and `L_brow_tail_2` for the next one there. Mirror images have names
    that differ in their side only.
    """
    landmarks = find_landmarks(face)
    sideless = sorted({key.removeprefix("L_").removeprefix("R_") for key in landmarks})
    known = np.array([landmarks.get(key, landmarks.get("L_" + key)) for key in sideless])
    places = face.mesh.vertices
    taken: dict[str, int] = {}
    labels: dict[str, int] = {}
    for vertex in sorted(vertices, key=lambda v: (-round(float(places[v, 1]), 1), abs(round(float(places[v, 0]), 1)))):
        x = float(places[vertex, 0])
        side = "" if abs(x) < 0.5 else "L_" if x > 0 else "R_"
        nearest = sideless[
            int(np.argmin(np.linalg.norm(known - np.abs(places[vertex]) * (1, np.sign(places[vertex, 1]), 1), axis=1)))
        ]
        taken[side + nearest] = taken.get(side + nearest, 0) + 1
        number = taken[side + nearest]
        labels[side + nearest + (f"_{number}" if number > 1 else "")] = int(vertex)
    return with_head_markers(MarkerLayout.on_vertices(labels, name=name), face)


def unseen_words(unseen: Sequence[str]) -> str:
    """What bases that no range of motion shows mean for a layout."""
    return f"the range of motion never shows {', '.join(unseen)}: layouts chosen from it may not see them"


def unseen_bases(face: FaceModel, actors: Sequence[Actor]) -> tuple[list[str], list[str]]:
    """Bases that no range of motion shows, and bases that move no skin at all.

    A layout chosen from a motion cannot see what the motion does not show.
    """
    most = np.max([actor.range_of_motion.max(axis=0) for actor in actors], axis=0)
    skinless = ~(np.linalg.norm(face.bases, axis=2) > 1e-2).any(axis=1)
    never = [name for name, peak, hidden in zip(face.names, most, skinless) if peak < NEVER and not hidden]
    return never, [name for name, hidden in zip(face.names, skinless) if hidden]
