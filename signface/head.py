"""How the head is held and where it is, as columns beside the weights.

- `head_angles`: pitch, yaw and roll in degrees.
- `with_head`: a take with `HEAD_COLUMNS` among its columns.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from signface.descriptors import Descriptors

#: Angles in degrees, and places in millimetres from the neutral one: to the signer's left, up, towards the camera.
HEAD_COLUMNS = ("headPitch", "headYaw", "headRoll", "headX", "headY", "headZ")


def head_angles(descriptors: Descriptors) -> dict[str, np.ndarray]:
    """Angles of the head from its neutral pose, degrees, each (F,).

    The face looks along +z with y up, so the signer's left is +x. `yaw` is positive to the signer's left, `pitch`
    positive downwards (a nod), `roll` positive when the head is tilted to the signer's right shoulder. They are the
    intrinsic rotations about y, then x, then z; NaN where the pose is unknown.
    """
    assert descriptors.head is not None
    rotation = descriptors.head[:, :3, :3]
    known = np.isfinite(rotation).all(axis=(1, 2))
    angles = np.full((3, descriptors.n_frames), np.nan)
    if known.any():
        from scipy.spatial.transform import Rotation

        angles[:, known] = Rotation.from_matrix(rotation[known]).as_euler("YXZ", degrees=True).T
    yaw, pitch, roll = angles
    return {"pitch": pitch, "yaw": yaw, "roll": roll}


def with_head(descriptors: Descriptors) -> Descriptors:
    """The take with the columns `HEAD_COLUMNS` behind its own; a take that has them stays as it is.

    Examples
    --------
    >>> import signface as sf
    >>> with_head(sf.datasets.mini_weights()).names[-6:]
    ('headPitch', 'headYaw', 'headRoll', 'headX', 'headY', 'headZ')
    """
    if set(HEAD_COLUMNS) <= set(descriptors.names):
        return descriptors
    assert descriptors.head is not None
    columns = np.column_stack([*head_angles(descriptors).values(), descriptors.head[:, :3, 3]])
    weights = np.concatenate([descriptors.weights, columns], axis=1)
    return replace(descriptors, weights=weights, names=(*descriptors.names, *HEAD_COLUMNS), deviation=None)
