"""Where do the markers of an unknown take stand? `suggest_layout` lays its neutral frame on a face.

The neutral markers are registered to the skin: first by rotation, translation and scale, iterating nearest points
(P. Besl and N. McKay, 1992) from every axis convention a recording may have; then by an affine map and a smooth warp,
because the signer's head has another shape. The result is a proposal to be looked at, not a measurement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.layout_files import nearest_points
from signface.face.model import FaceModel
from signface.face.subdivision import subdivide

#: A head is at most so much smaller or larger than the model's.
SCALES = (0.8, 1.25)
#: Skin that no base moves by this much (mm) carries head markers.
RIGID_MM = 0.5
#: A marker this far from the skin after registration stands on a cap or a stick (mm).
OFF_SKIN_MM = 15.0
#: Share of the markers, the nearest ones, that a step of the registration listens to.
HEEDED = 0.85


@dataclass(frozen=True)
class Suggestion:
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

    Returns
    -------
    Suggestion

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
    lively = face.mesh.vertices[np.linalg.norm(face.bases, axis=2).max(axis=0) > 2.0]
    placed, scale = _best_similarity(points, fine, skin, lively)
    distance = skin.query(placed)[0]
    warped = _warp(placed, fine, skin)
    corners, barycentric, apart = nearest_points(face.mesh, warped)
    moved = np.linalg.norm(
        np.einsum("npkd,pk->npd", face.bases[:, corners], barycentric), axis=2
    ).max(axis=0)  # fmt: skip
    rigid = (moved < RIGID_MM) | (apart > OFF_SKIN_MM)
    roles = tuple("head" if off else "face" for off in rigid)
    return Suggestion(MarkerLayout(tuple(names), roles, corners, barycentric, "suggested"), distance, scale)


def _similarity(source: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Rotation (3, 3), shift (3,) and scale that bring source points onto target points best (S. Umeyama, 1991)."""
    a, b = source - source.mean(axis=0), target - target.mean(axis=0)
    u, singular, vt = np.linalg.svd(b.T @ a)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rotation = (u * sign) @ vt
    scale = float(np.clip((singular * sign).sum() / max((a**2).sum(), 1e-12), *SCALES))
    return rotation, target.mean(axis=0) - scale * rotation @ source.mean(axis=0), scale


def _best_similarity(
    points: np.ndarray, fine: np.ndarray, skin: cKDTree, lively: np.ndarray
) -> tuple[np.ndarray, float]:
    """The markers on the face and the scale, over all starts.

    A start is judged by the markers' distance from the skin, and by how well they cover the skin that moves: on a skull
    alone, many places fit a handful of points.
    """
    best: tuple[float, np.ndarray, float] | None = None
    heeded = max(6, round(HEEDED * len(points)))
    for start in Rotation.create_group("O"):
        now = start.apply(points - points.mean(axis=0)) + lively.mean(axis=0)
        scale = 1.0
        for _ in range(40):
            apart, nearest = skin.query(now)
            use = np.argsort(apart)[:heeded]
            rotation, shift, scale = _similarity(points[use], fine[nearest[use]])
            moved = scale * points @ rotation.T + shift
            if np.abs(moved - now).max() < 0.01:
                break
            now = moved
        apart = np.sort(skin.query(now)[0])[:heeded]
        cover = cKDTree(now).query(lively)[0]
        cost = float(np.sqrt((apart**2).mean()) + 0.5 * np.sqrt((cover**2).mean()))
        if best is None or cost < best[0]:
            best = cost, now, scale
    assert best is not None
    return best[1], best[2]


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
