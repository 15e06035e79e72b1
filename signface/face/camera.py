"""Where a face is looked at from.

- `Camera`: an orthographic camera; projects points to pixels.
- `face_camera`: a camera that shows the part of a face that its bases move.

Orthographic, because measurements on a picture should not depend on the distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from signface.content import Content
from signface.face.model import FaceModel


@dataclass(frozen=True, eq=False)
class Camera(Content):
    """An orthographic camera.

    Parameters
    ----------
    centre : (3,) array
        The point that falls in the middle of the picture, millimetres.
    extent : float
        Height of the picture in millimetres.
    yaw, pitch : float
        Degrees. 0, 0 looks the face in the eyes; a yaw of 90 shows the signer's left profile.
    size : (int, int)
        Width and height in pixels.
    """

    centre: np.ndarray
    extent: float
    yaw: float = 0.0
    pitch: float = 0.0
    size: tuple[int, int] = (600, 700)

    @property
    def axes(self) -> np.ndarray:
        """(3, 3) right, up and towards the viewer, as rows, in the face's frame."""
        yaw, pitch = np.radians([self.yaw, self.pitch])
        towards = np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)])
        right = np.array([np.cos(yaw), 0.0, -np.sin(yaw)])
        return np.stack([right, np.cross(towards, right), towards])

    def project(self, points: np.ndarray) -> np.ndarray:
        """(..., 3) pixel column, pixel row and depth (millimetres towards the viewer) of points in millimetres."""
        seen = (np.asarray(points) - self.centre) @ self.axes.T
        scale = self.size[1] / self.extent
        column = self.size[0] / 2 + scale * seen[..., 0]
        row = self.size[1] / 2 - scale * seen[..., 1]
        return np.stack([column, row, seen[..., 2]], axis=-1)


def face_camera(
    face: FaceModel, *, yaw: float = 0.0, pitch: float = 0.0, size: tuple[int, int] = (500, 600), margin: float = 1.45
) -> Camera:
    """A camera that shows the part of a face that its bases move, and `margin` times as much around it."""
    moving = face.moving if face.moving.any() else np.ones(len(face.mesh.vertices), bool)
    low, high = face.mesh.vertices[moving].min(axis=0), face.mesh.vertices[moving].max(axis=0)
    extent = margin * max(high[1] - low[1], (high[0] - low[0]) * size[1] / size[0])
    return Camera((low + high) / 2, float(extent), yaw, pitch, size)
