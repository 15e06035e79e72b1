"""The motion of the head in pictures: which way it is turned at a time, and about which point.

- `rotations_at`: how the head is turned at given times; None where nobody knows.
- `Neck`: about which point the head of a face turns, and what follows it.
- `moving_part`: the part of a face that expressions move.

Only rotations are shown. Where the head is in the room says where the signer stood and swayed: centimetres that would
take the face out of the picture or change its size, while nods, shakes, tilts and turns are what signers read.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from signface.descriptors import Descriptors
from signface.face.model import FaceModel

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

#: A solved take is measured from its neutral frame on the avatar's axes, and no head stays turned farther than this
#: all the time. One that never comes nearer to upright is measured from the axes of a room, such as one with Z up.
FARTHEST_DEG = 60.0


def rotations_at(descriptors: Descriptors, times: np.ndarray) -> np.ndarray | None:
    """Rotations of the head at given times, on its axes in the neutral frame: x to its left, y up, z ahead.

    Between two frames it goes the shortest way at an even pace (slerp; K. Shoemake, Animating rotation with quaternion
    curves, SIGGRAPH 1985). Where a pose is unknown, the last known one is held; before the first, that. Poses measured
    from the axes of a room count from their mean.

    Parameters
    ----------
    descriptors : Descriptors
    times : (K,) array
        Seconds; those outside the take show its first or last frame.

    Returns
    -------
    (K, 3, 3) array or None
        None when the head's pose is unknown: it never moves, or no frame has one.

    Examples
    --------
    >>> nod = np.tile(np.eye(4), (2, 1, 1))
    >>> nod[1, :3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]  # the nose goes from ahead to down
    >>> take = Descriptors(np.zeros((2, 1)), ("jawOpen",), rate=1, head=nod)
    >>> (rotations_at(take, np.array([0.5]))[0] @ [0, 0, 1]).round(3).tolist()
    [0.0, -0.707, 0.707]
    """
    from scipy.spatial.transform import Rotation

    assert descriptors.head is not None
    matrices = descriptors.head[:, :3, :3]
    known = np.isfinite(matrices).all(axis=(1, 2))
    if not known.any() or np.allclose(matrices[known], np.eye(3), rtol=0, atol=1e-9):
        return None
    frames = np.arange(len(matrices))
    held = np.maximum.accumulate(np.where(known, frames, known.argmax()))
    position = np.clip((np.asarray(times) - descriptors.start) * descriptors.rate, 0, frames[-1])
    before = np.floor(position).astype(int)
    after = np.minimum(before + 1, frames[-1])
    first, second = (Rotation.from_matrix(matrices[held[frame]]) for frame in (before, after))
    step = Rotation.from_rotvec((first.inv() * second).as_rotvec() * (position - before)[:, None])
    return (_upright(matrices[known]) * first * step).as_matrix()


def _upright(matrices: np.ndarray) -> Rotation:
    """What brings the neutral head from the axes of the recording to its own."""
    from scipy.spatial.transform import Rotation

    poses = Rotation.from_matrix(matrices)
    measured_from_room = np.degrees(poses.magnitude()).min() > FARTHEST_DEG
    return poses.mean().inv() if measured_from_room else Rotation.identity()


def moving_part(face: FaceModel) -> np.ndarray:
    """(M, 3) vertices of the neutral face that an expression moves visibly, by more than 3 mm: from chin to brows."""
    moves = np.linalg.norm(face.bases, axis=2).max(axis=0, initial=0.0) > 3.0
    return face.mesh.vertices[moves] if moves.any() else face.mesh.vertices


class Neck:
    """What a head turns on.

    The head turns about the place between the ears where the skull rests on the spine. It is taken from what moves, so
    that a mask without a skull has it, too. A neck bends: from the jaw downwards it follows the head less and less, and
    its cut end stays below the picture. A face without a neck turns as a whole.

    Parameters
    ----------
    face : FaceModel
    vertices : (V, 3) array, optional
        Neutral places of what will be turned, where that is more than the face's mesh: eyes, teeth.

    Attributes
    ----------
    centre : (3,) array
        About which the head turns, millimetres.
    share : (V, 1) array
        How much of the head's rotation each vertex follows, 0 to 1.

    Examples
    --------
    >>> from signface.face.reading import read_face
    >>> neck = Neck(read_face("default"))
    >>> neck.centre.round().tolist()
    [0.0, -5.0, -5.0]
    >>> float(neck.share.min()), float(neck.share.max())
    (0.0, 1.0)
    """

    def __init__(self, face: FaceModel, vertices: np.ndarray | None = None) -> None:
        vertices = face.mesh.vertices if vertices is None else vertices
        moving = moving_part(face)
        (left, chin, _), (right, brows, nose) = moving.min(axis=0), moving.max(axis=0)
        height = brows - chin
        # Proportions of the default head: the ears are level with the middle of the moving part.
        self.centre = np.array([(left + right) / 2, (chin + brows) / 2, nose - 0.7 * height])
        end = face.mesh.vertices[:, 1].min()
        self.share = np.ones((len(vertices), 1))
        if chin - end > 0.1 * height:
            rise = 0.3 * np.maximum(nose - vertices[:, 2], 0.0)  # the jaw's edge rises towards the nape, the cut less
            part = np.clip((vertices[:, 1] - end - rise / 2) / (chin - end + rise / 2), 0.0, 1.0)
            self.share[:, 0] = part * part * (3.0 - 2.0 * part)

    def turn(self, vertices: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """(..., V, 3) vertices under (..., 3, 3) rotations of the head; the identity leaves them to the last bit."""
        return vertices + self.share * ((vertices - self.centre) @ np.swapaxes(rotation - np.eye(3), -1, -2))
