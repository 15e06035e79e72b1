"""Rigid motions: the best rotation and translation between point sets, for many frames at once.

- `rigid_transforms`: weighted least squares, proper rotations, batched.
- `apply`, `inverse`: poses as (4, 4) matrices.
- `flatness`: whether points fix a rotation at all.
"""

from __future__ import annotations

import numpy as np


def rigid_transforms(source: np.ndarray, target: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Rotation and translation that bring `source` onto `target` in the weighted least-squares sense, frame by frame.

    W. Kabsch, Acta Crystallographica A 34 (1978) 827-828, with the sign of the least singular vector chosen so that
    the result is a proper rotation, never a reflection.

    Parameters
    ----------
    source : (Q, 3) or (F, Q, 3) array
    target : (F, Q, 3) array
    weights : (F, Q) array
        Not negative; a point of weight 0 may be NaN.

    Returns
    -------
    (F, 4, 4) array
        Poses: `target = pose @ source`. NaN in frames without any weight.
    """
    known = weights > 0
    total = weights.sum(axis=1)
    share = weights / np.where(total > 0, total, 1.0)[:, None]
    target = np.where(known[..., None], target, 0.0)
    source = np.where(known[..., None], source, 0.0)
    middle_source = np.einsum("fq,fqd->fd", share, source)
    middle_target = np.einsum("fq,fqd->fd", share, target)
    centred = (source - middle_source[:, None]) * share[..., None]
    covariance = np.matmul(centred.transpose(0, 2, 1), target - middle_target[:, None])
    left, _, right = np.linalg.svd(covariance)
    sign = np.linalg.det(np.matmul(left, right))
    left[:, :, 2] *= np.where(sign < 0, -1.0, 1.0)[:, None]
    rotation = np.matmul(left, right).transpose(0, 2, 1)
    poses = np.zeros((len(target), 4, 4))
    poses[:, 3, 3] = 1.0
    poses[:, :3, :3] = rotation
    poses[:, :3, 3] = middle_target - np.einsum("fij,fj->fi", rotation, middle_source)
    poses[total <= 0] = np.nan
    return poses


def apply(poses: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(F, M, 3) or (M, 3) points moved by (F, 4, 4) poses, or all by one (4, 4) pose."""
    return np.matmul(points, np.swapaxes(poses[..., :3, :3], -1, -2)) + poses[..., None, :3, 3]


def inverse(poses: np.ndarray) -> np.ndarray:
    """(..., 4, 4) inverse rigid poses, by transposing the rotation."""
    turned = np.swapaxes(poses[..., :3, :3], -1, -2)
    result = np.zeros_like(poses)
    result[..., 3, 3] = poses[..., 3, 3]
    result[..., :3, :3] = turned
    result[..., :3, 3] = -np.einsum("...ij,...j->...i", turned, poses[..., :3, 3])
    return result


def flatness(points: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(F,) how far the points of each frame are from lying on one line, in their own unit; 0 for fewer than three.

    The root mean square distance from the best line (the second principal axis and the third).

    Parameters
    ----------
    points : (Q, 3) array
    weights : (F, Q) array
        0 for a point that a frame lacks.
    """
    seen = weights > 0
    safe = np.where(np.isfinite(points), points, 0.0)
    count = np.maximum(seen.sum(axis=1), 1)
    middle = seen @ safe / count[:, None]
    second = np.einsum("fq,qi,qj->fij", seen / count[:, None], safe, safe) - middle[:, :, None] * middle[:, None, :]
    values = np.linalg.eigvalsh(second)
    off_line = np.sqrt(np.maximum(values[:, 0] + values[:, 1], 0.0))
    return np.where(seen.sum(axis=1) >= 3, off_line, 0.0)
