"""Markers of the synthetic corpus: glued to a head, recorded by cameras.

- `glue_markers`: where the markers of a layout really come to stand on somebody's face.
- `head_motion`: how a head moves while somebody signs.
- `record`: the trajectories that a motion-capture system gives.

Nobody glues markers to the vertex that the layout names, and no skin carries them at its very surface: each stands 1 to
3 mm aside and a marker's radius above the skin. Adhesive creeps, cameras see a tenth of a millimetre of noise, a hand
passes before the face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra
from scipy.spatial.transform import Rotation

from signface.content import Content
from signface.face.layout import MarkerLayout
from signface.face.layout_files import nearest_points
from signface.face.mesh import Mesh
from signface.synth.heads import Head
from signface.synth.motion import smooth_noise
from signface.synth.programme import Programme
from signface.synth.signing import GRAMMAR, head_gestures

#: How far from the layout's point a marker is glued, along the skin.
PLACEMENT_MM = (1.0, 3.0)
#: Radius of a facial marker: how far its centre stands above the skin.
RADIUS_MM = 1.5
#: Root mean square jitter of a marker in space.
JITTER_MM = (0.1, 0.3)
#: How far a marker creeps, root mean square.
SLIP_MM = 0.25
#: How long a marker is lost.
DROPOUT_S = (0.020, 0.300)


@dataclass(frozen=True, eq=False)
class Glued(Content):
    """Markers on a head.

    Parameters
    ----------
    labels : (M,) tuple of str
    corners : (M, 3) int array
        Vertices of the triangle below each marker.
    barycentric : (M, 3) array
        Weights of those vertices.
    jitter : (M,) array
        Root mean square noise, millimetres.
    """

    labels: tuple[str, ...]
    corners: np.ndarray
    barycentric: np.ndarray
    jitter: np.ndarray


def glue_markers(head: Head, layout: MarkerLayout, rng: np.random.Generator) -> Glued:
    """Put the markers of a layout on a head, each 1 to 3 mm from its point along the skin."""
    mesh = head.face.mesh
    wanted = layout.interpolate(mesh.vertices, layout.labels)
    normals = mesh.vertex_normals
    distances = _walks(mesh, layout.corners[:, 0], limit=14.0)
    corners, barycentric = [], []
    for point, corner, weights, distance in zip(wanted, layout.corners, layout.barycentric, distances):
        normal = weights @ normals[corner]
        normal /= np.linalg.norm(normal)
        aside = rng.standard_normal(3)
        aside -= (aside @ normal) * normal
        aside *= rng.uniform(*PLACEMENT_MM) / np.linalg.norm(aside)
        # Only skin that is reached without crossing the mouth or an eye: from a lip one does not step to the other.
        facing = mesh.triangle_normals @ normal > 0.3 * np.linalg.norm(mesh.triangle_normals, axis=1)
        touching = (mesh.triangles == corner[0]).any(axis=1)
        near = np.flatnonzero(touching | (facing & np.isfinite(distance[mesh.triangles]).all(axis=1)))
        corner, weights, _ = nearest_points(Mesh(mesh.vertices, mesh.triangles[near]), (point + aside)[None])
        corners.append(corner[0])
        barycentric.append(weights[0])
    jitter = rng.uniform(*JITTER_MM, len(layout.labels))
    return Glued(layout.labels, np.array(corners), np.array(barycentric), jitter)


def _walks(mesh: Mesh, sources: np.ndarray, limit: float) -> np.ndarray:
    """(len(sources), V) length of the shortest way over the mesh's edges; infinite beyond the limit."""
    edges = np.concatenate([mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]], mesh.triangles[:, [2, 0]]])
    length = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    count = len(mesh.vertices)
    edges, first = np.unique(np.sort(edges, axis=1), axis=0, return_index=True)
    graph = sparse.csr_matrix((length[first], (edges[:, 0], edges[:, 1])), (count, count))
    return dijkstra(graph, directed=False, indices=sources, limit=limit)


def head_motion(plan: Programme, time: np.ndarray, rate: float, rng: np.random.Generator) -> np.ndarray:
    """(F, 4, 4) pose of the head in the room, Z up, as it sways and makes the gestures of its clauses.

    The signer stands a little off the room's origin and does not face along an axis.
    """
    signing = len(plan.clauses) > 0
    sway_degrees, sway_mm = (3.5, 12.0) if signing else (1.2, 4.0)
    turn = np.radians(sway_degrees) * smooth_noise(rng, len(time), rate, 0.35, 3)
    move = sway_mm * smooth_noise(rng, len(time), rate, 0.25, 3) * (1.0, 0.4, 0.8)  # people sway less up and down
    for clause in plan.clauses:
        for marking, start, end in clause.markings:
            gesture_turn, gesture_move = head_gestures(time, GRAMMAR[marking].gesture, start, end, rng)
            turn += gesture_turn
            move += gesture_move
    upright = Rotation.from_euler("x", 90, degrees=True)  # the face is Y up, the room is Z up
    facing = Rotation.from_euler("z", rng.uniform(-35.0, 35.0), degrees=True)
    stance = facing * upright
    poses = np.tile(np.eye(4), (len(time), 1, 1))
    poses[:, :3, :3] = (stance * Rotation.from_rotvec(turn)).as_matrix()
    # The head turns about the top of the neck, not about its own centre.
    neck = np.array([0.0, -110.0, -20.0])
    place = np.array([rng.uniform(-300, 300), rng.uniform(-300, 300), rng.uniform(1450, 1700)])
    poses[:, :3, 3] = place + stance.apply(move + neck) - np.einsum("fij,j->fi", poses[:, :3, :3], neck)
    return poses


def record(
    head: Head,
    glued: Glued,
    weights: np.ndarray,
    poses: np.ndarray,
    plan: Programme,
    rate: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """Trajectories of the markers as the cameras give them.

    Parameters
    ----------
    head : Head
    glued : Glued
        M markers.
    weights : (F, N) array
        Weights of the head's own bases.
    poses : (F, 4, 4) array
        Pose of the head in the room.
    plan : Programme
        When hands are busy.
    rate : float
        Hz.
    rng : numpy Generator

    Returns
    -------
    (F, M, 3) array
        Millimetres in the room, NaN where a marker is lost.
    """
    frames, count = len(weights), len(glued.labels)
    vertices, where = np.unique(glued.corners, return_inverse=True)
    skin = head.skin(weights, vertices)[:, where.reshape(glued.corners.shape)]
    a, b, c = skin[:, :, 0], skin[:, :, 1], skin[:, :, 2]
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-9)
    markers = np.einsum("fmcd,mc->fmd", skin, glued.barycentric) + RADIUS_MM * normals
    creep = smooth_noise(rng, frames, rate, 0.03, 3 * count).reshape(frames, count, 3)
    creep -= (creep * normals).sum(axis=2, keepdims=True) * normals
    markers += SLIP_MM / np.sqrt(2.0) * creep
    markers = np.einsum("fij,fmj->fmi", poses[:, :3, :3], markers) + poses[:, None, :3, 3]
    markers += rng.standard_normal(markers.shape) * (glued.jitter / np.sqrt(3.0))[:, None]
    markers[_lost(glued, head, plan, frames, rate, rng)] = np.nan
    return markers


def _lost(glued: Glued, head: Head, plan: Programme, frames: int, rate: float, rng: np.random.Generator) -> np.ndarray:
    """(F, M) bool: where a marker is not seen.

    Single markers are lost now and then; while somebody signs, a hand hides neighbouring markers of the lower face.
    """
    lost = np.zeros((frames, len(glued.labels)), dtype=bool)
    shortest, longest = np.log(DROPOUT_S)

    def lose(markers: np.ndarray, moment: float) -> None:
        for marker in markers:
            length = np.exp(rng.uniform(shortest, longest))
            start = moment + rng.uniform(-0.03, 0.03)
            lost[max(0, round(start * rate)) : max(0, round((start + length) * rate)), marker] = True

    duration = frames / rate
    for marker in range(len(glued.labels)):
        for moment in rng.uniform(0.0, duration, rng.poisson(duration * 1.5 / 60.0)):
            lose(np.array([marker]), moment)
    places = np.einsum("mcd,mc->md", head.face.mesh.vertices[glued.corners], glued.barycentric)
    lower = np.flatnonzero(places[:, 1] < np.median(places[:, 1]))
    for clause in plan.clauses:
        length = clause.end_s - clause.start_s
        for moment in rng.uniform(clause.start_s, clause.end_s, rng.poisson(0.35 * length)):
            distance = np.linalg.norm(places - places[rng.choice(lower)], axis=1)
            lose(np.flatnonzero(distance < rng.uniform(12.0, 35.0)), moment)
    return lost
