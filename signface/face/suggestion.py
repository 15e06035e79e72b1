"""Where do the markers of an unknown take stand? `suggest_layout` lays its neutral frame on a face.

The neutral markers are registered to the skin: first by rotation, translation and scale, from every direction a
recording may have; then by an affine map and a smooth warp, because the signer's head has another shape. The result is
a proposal to be looked at, not a measurement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from signface.content import Content
from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.layout_files import nearest_points
from signface.face.model import FaceModel
from signface.face.subdivision import subdivide

#: A head is at most so much smaller or larger than the model's.
SCALES = (0.85, 1.15)
#: Skin that no base moves by this much (mm) carries head markers.
RIGID_MM = 0.5
#: A marker this far from the skin after registration stands on a cap or a stick (mm).
OFF_SKIN_MM = 15.0


@dataclass(frozen=True, eq=False)
class Suggestion(Content):
    """A proposed layout.

    Parameters
    ----------
    layout : MarkerLayout
        Every marker with a place and a role.
    distance : (M,) array
        How far each marker lay from the skin after the rigid registration, millimetres.
    scale : float
        Size of the model beside the signer.
    """

    layout: MarkerLayout
    distance: np.ndarray
    scale: float


def suggest_layout(labels: Sequence[str], points: np.ndarray, face: FaceModel) -> Suggestion:
    """Propose where markers stand on a face, from their positions in a neutral frame.

    Parameters
    ----------
    labels : (M,) sequence of str
    points : (M, 3) array
        Positions in millimetres in any frame of reference; NaN for a missing marker, which is left out.
    face : FaceModel

    Raises
    ------
    SignfaceError
        Fewer than eight markers are known, or they lie on a line.
    """
    points = np.asarray(points, dtype=np.float64)
    known = np.isfinite(points).all(axis=1)
    names = [label for label, here in zip(labels, known) if here]
    points = points[known]
    if len(points) < 8:
        raise SignfaceError(
            f"only {len(points)} markers are known in the neutral frame", hint="give another time with --neutral"
        )
    if np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] < 1.0:
        raise SignfaceError("the markers lie on a line in the neutral frame", hint="give another time with --neutral")

    fine = subdivide(face).mesh.vertices
    skin = cKDTree(fine)
    # Where markers are worn: skin that moves and looks forward, not the underside of the chin.
    moving = np.linalg.norm(face.bases, axis=2).max(axis=0) > 1.5
    normals = face.mesh.vertex_normals
    forward = normals[moving].mean(axis=0)
    lively = face.mesh.vertices[moving & (normals @ (forward / np.linalg.norm(forward)) > 0.35)]
    tries = [_settled(start, fine, skin) for start in _likely_motions(points, lively)]
    placed, scale, _ = min(tries, key=lambda settled: settled[2])
    distance = skin.query(placed)[0]
    warped = _warp(placed, fine, skin)
    corners, barycentric, apart = nearest_points(face.mesh, warped)
    moved = np.linalg.norm(
        np.einsum("npkd,pk->npd", face.bases[:, corners], barycentric), axis=2
    ).max(axis=0)  # fmt: skip
    rigid = (moved < RIGID_MM) | (apart > OFF_SKIN_MM)
    roles = tuple("head" if off else "face" for off in rigid)
    return Suggestion(MarkerLayout(tuple(names), roles, corners, barycentric, "suggested"), distance, scale)


def _similarity(source: np.ndarray, target: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Rotation (3, 3), shift (3,) and scale that bring source points onto target points best (S. Umeyama, 1991)."""
    share = weight / weight.sum()
    middle, goal = share @ source, share @ target
    a, b = source - middle, target - goal
    u, singular, vt = np.linalg.svd((b * share[:, None]).T @ a)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rotation = (u * sign) @ vt
    scale = float(np.clip((singular * sign).sum() / max((share[:, None] * a**2).sum(), 1e-12), *SCALES))
    return rotation, goal - scale * rotation @ middle, scale


def _settled(placed: np.ndarray, fine: np.ndarray, skin: cKDTree) -> tuple[np.ndarray, float, float]:
    """Markers settled on their nearest points with their own scale, the scale, and their distance left (mm, RMS)."""
    scale = 1.0
    heeded = max(8, round(0.85 * len(placed)))
    for _ in range(5):
        apart, nearest = skin.query(placed)
        use = np.argsort(apart)[:heeded]
        rotation, _, step = _similarity(placed[use], fine[nearest[use]], np.ones(len(use)))
        step = float(np.clip(scale * step, *SCALES)) / scale
        placed = step * (placed - placed[use].mean(axis=0)) @ rotation.T + fine[nearest[use]].mean(axis=0)
        scale *= step
    return placed, scale, float(np.sqrt((np.sort(skin.query(placed)[0])[:heeded] ** 2).mean()))


def _likely_motions(points: np.ndarray, lively: np.ndarray, most: int = 6) -> list[np.ndarray]:
    """The markers (M, 3) moved rigidly onto the face: the likeliest different ways, from all starts.

    Rigid coherent point drift (A. Myronenko and X. Song, 2010): the markers are the centres of a mixture of Gaussians
    that explains points spread over the skin that moves. Unlike nearest points alone, it asks that the markers cover
    that skin, so they do not slide about on a smooth skull.
    """
    some, skin = _spread(points, 60), _spread(lively, 200)
    ways: list[tuple[float, np.ndarray]] = []
    middle = np.median(some, axis=0)
    for start in _starts(some - middle):
        rotation, shift = start, skin.mean(axis=0) - start @ middle
        variance = 40.0**2
        for _ in range(60):
            now = some @ rotation.T + shift
            squared = ((skin[:, None] - now[None]) ** 2).sum(axis=2)
            kernel = np.exp(-squared / (2 * variance))
            outlier = (2 * np.pi * variance) ** 1.5 * 0.1 / 0.9 * len(some) / 4e6  # spread over a head's volume, mm3
            total = kernel.sum(axis=1, keepdims=True) + outlier
            share = kernel / total
            weight = share.sum(axis=0)
            goal = (share.T @ skin) / np.maximum(weight, 1e-12)[:, None]
            rotation, shift, _ = _similarity(some, goal, weight)  # the markers' spread is no measure of size
            shift = weight @ (goal - some @ rotation.T) / weight.sum()
            before = variance
            moved = some @ rotation.T + shift
            spread = (share * ((skin[:, None] - moved[None]) ** 2).sum(axis=2)).sum()
            variance = max(float(spread / (3 * weight.sum())), 4.0)
            if abs(variance - before) < 1e-4 * before:
                break
        cost = float(-np.log(total / (2 * np.pi * variance) ** 1.5).mean())
        ways.append((cost, points @ rotation.T + shift))
    different: list[np.ndarray] = []
    for _, moved in sorted(ways, key=lambda way: way[0]):
        if all(np.abs(moved - other).max() > 15.0 for other in different):
            different.append(moved)
    return different[:most]


def _starts(centred: np.ndarray) -> list[np.ndarray]:
    """Rotations to start from: every axis convention, and the plane of the markers facing forward at every turn."""
    starts = list(Rotation.create_group("O").as_matrix())
    axes = np.linalg.svd(centred, full_matrices=False)[2]
    axes[2] *= np.sign(np.linalg.det(axes))
    for flip in (np.eye(3), np.diag([-1.0, 1.0, -1.0])):
        for turn in np.arange(0.0, 360.0, 30.0):
            starts.append(Rotation.from_euler("z", turn, degrees=True).as_matrix() @ flip @ axes)
    return starts


def _spread(points: np.ndarray, count: int) -> np.ndarray:
    """At most `count` of the points spread evenly: each next one is the farthest from those before."""
    rows = [int(np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1)))]
    distance = np.linalg.norm(points - points[rows[0]], axis=1)
    while len(rows) < min(count, len(points)):
        rows.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(points - points[rows[-1]], axis=1))
    return points[rows]


def _warp(placed: np.ndarray, fine: np.ndarray, skin: cKDTree) -> np.ndarray:
    """Markers drawn onto the skin by ever less stiff maps: affine, then smooth splines."""
    now = placed
    for _ in range(10):
        apart, nearest = skin.query(now)
        use = apart <= max(OFF_SKIN_MM, np.median(apart))
        plain = np.column_stack([now, np.ones(len(now))])
        pull = 0.2 * use.sum()  # towards staying: half a dozen markers must not shear the head
        stay = np.vstack([plain[use], np.sqrt(pull / len(now)) * plain])
        goal = np.vstack([fine[nearest[use]], np.sqrt(pull / len(now)) * now])
        now = plain @ np.linalg.lstsq(stay, goal, rcond=None)[0]
    for smoothing in (100.0, 10.0):
        apart, nearest = skin.query(now)
        use = np.flatnonzero(apart <= OFF_SKIN_MM)
        _, single = np.unique(np.round(now[use], 6), axis=0, return_index=True)
        use = use[single]
        if len(use) < 8:
            break
        offset = fine[nearest[use]] - now[use]
        now = now + RBFInterpolator(now[use], offset, kernel="linear", degree=0, smoothing=smoothing)(now)
    return now
