"""Stills of a face: smooth-shaded pictures from a small z-buffer of our own, in numpy.

- `Camera`: where a face is looked at from; projects points to pixels.
- `render`: a mesh to a picture.
- `draw_face`: a face with weights, its eyes and teeth with it where they ship.

Orthographic, because measurements on a picture should not depend on the distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from signface.face.mesh import Mesh
from signface.face.model import FaceModel
from signface.face.reading import read_parts

SKIN = (0.85, 0.68, 0.58)


@dataclass(frozen=True)
class Camera:
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


def fragments(corners: np.ndarray, width: int, height: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What each pixel shows: (G,) pixel, (G,) triangle and (G, 3) barycentric weights of the nearest fragments.

    Parameters
    ----------
    corners : (T, 3, 3) array
        Column, row and depth of the three corners of each triangle, in pixels and millimetres.
    width, height : int
        Size of the picture.
    """
    low = np.clip(np.ceil(corners[:, :, :2].min(axis=1) - 0.5), 0, (width, height)).astype(int)
    high = np.clip(np.floor(corners[:, :, :2].max(axis=1) - 0.5) + 1, 0, (width, height)).astype(int)
    span = (high - low).max(axis=1)
    span[(high <= low).any(axis=1)] = 0
    pixels, owners, weights, depths = [], [], [], []
    sizes = 2 ** np.arange(int(np.ceil(np.log2(max(span.max(initial=1), 1)))) + 1)
    for smaller, size in zip([0, *sizes[:-1]], sizes):
        some = np.flatnonzero((span > smaller) & (span <= size))
        for chunk in np.array_split(some, max(1, int(len(some) * size * size // 2_000_000))):
            step = np.arange(size)
            column = low[chunk, 0, None, None] + step[None, None, :]
            row = low[chunk, 1, None, None] + step[None, :, None]
            (ax, ay), (bx, by), (cx, cy) = (
                (corners[chunk, k, 0, None, None], corners[chunk, k, 1, None, None]) for k in range(3)
            )
            double = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
            with np.errstate(divide="ignore", invalid="ignore"):
                x, y = column + 0.5, row + 0.5
                second = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / double
                third = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / double
            first = 1 - second - third
            inside = (first >= 0) & (second >= 0) & (third >= 0)
            inside &= (column < high[chunk, 0, None, None]) & (row < high[chunk, 1, None, None])
            which, y_at, x_at = np.nonzero(inside)
            weight = np.stack([part[which, y_at, x_at] for part in (first, second, third)], axis=1)
            pixels.append((low[chunk[which], 1] + y_at) * width + low[chunk[which], 0] + x_at)
            owners.append(chunk[which])
            weights.append(weight)
            depths.append((weight * corners[chunk[which], :, 2]).sum(axis=1))
    pixel, owner = np.concatenate(pixels), np.concatenate(owners)
    weight, depth = np.concatenate(weights), np.concatenate(depths)
    order = np.lexsort((depth, pixel))
    nearest = order[np.append(pixel[order][1:] != pixel[order][:-1], True)] if len(order) else order
    return pixel[nearest], owner[nearest], weight[nearest]


def render(mesh: Mesh, camera: Camera, colours: np.ndarray, background: float = 1.0, samples: int = 2) -> np.ndarray:
    """A shaded picture of a mesh.

    Parameters
    ----------
    mesh : Mesh
    camera : Camera
    colours : (V, 3) array
        Colour of each vertex, 0 to 1.
    background : float
        Grey of what the mesh leaves free.
    samples : int
        Samples per pixel and axis, against jagged edges.

    Returns
    -------
    (height, width, 3) float array
        0 to 1.
    """
    width, height = (samples * side for side in camera.size)
    projected = camera.project(mesh.vertices) * (samples, samples, 1.0)
    pixel, triangle, weight = fragments(projected[mesh.triangles], width, height)
    corners = mesh.triangles[triangle]
    normal = np.einsum("gk,gkd->gd", weight, mesh.vertex_normals[corners]) @ camera.axes.T
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    normal *= np.where(normal[:, 2:] < 0, -1.0, 1.0)  # the inside of an open mesh is lit like its outside
    light = np.full(len(normal), 0.30)
    for direction, strength in (((-0.5, 0.6, 0.75), 0.62), ((0.8, 0.1, 0.5), 0.22)):
        direction = np.array(direction) / np.linalg.norm(direction)
        light += strength * np.clip(normal @ direction, 0.0, None)
    half = np.array([-0.25, 0.35, 0.9]) / np.linalg.norm([-0.25, 0.35, 0.9])
    shine = 0.08 * np.clip(normal @ half, 0.0, None) ** 24
    picture = np.full((height * width, 3), background)
    shaded = np.einsum("gk,gkd->gd", weight, np.asarray(colours)[corners]) * light[:, None] + shine[:, None]
    picture[pixel] = np.clip(shaded, 0.0, 1.0)
    return picture.reshape(camera.size[1], samples, camera.size[0], samples, 3).mean(axis=(1, 3))


def draw_face(
    face: FaceModel,
    weights: np.ndarray | None = None,
    *,
    yaw: float = 0.0,
    pitch: float = 0.0,
    size: tuple[int, int] = (500, 600),
    samples: int = 2,
) -> np.ndarray:
    """A picture of a face.

    Parameters
    ----------
    face : FaceModel
        With the default face, its eyes, teeth and mouth are drawn too.
    weights : (N,) array, optional
        By default the neutral.
    yaw, pitch : float
        Where it is seen from, as for `Camera`.
    size : (int, int)
        Width and height in pixels.
    samples : int
        Samples per pixel and axis.

    Returns
    -------
    (height, width, 3) float array

    Examples
    --------
    >>> from signface.face.reading import read_face
    >>> draw_face(read_face("default"), size=(50, 60)).shape
    (60, 50, 3)
    """
    mesh, colours = whole_mesh(face, weights)
    return render(mesh, face_camera(face, yaw=yaw, pitch=pitch, size=size), colours, samples=samples)


def whole_mesh(face: FaceModel, weights: np.ndarray | None = None) -> tuple[Mesh, np.ndarray]:
    """The posed skin with its colours (V, 3), and what else ships with the default face."""
    weights = np.zeros(face.n_bases) if weights is None else np.asarray(weights, dtype=np.float64)
    colours = np.tile(SKIN, (len(face.mesh.vertices), 1)) if face.colours is None else np.asarray(face.colours)
    skin = Mesh(face.pose(weights), face.mesh.triangles)
    if face.name != "default":
        return skin, colours
    parts = read_parts()
    assert parts.colours is not None
    if parts.names != face.names:
        return skin, colours
    together = Mesh(
        np.concatenate([skin.vertices, parts.pose(weights)]),
        np.concatenate([skin.triangles, parts.mesh.triangles + len(skin.vertices)]),
    )
    return together, np.concatenate([colours, parts.colours])


def face_camera(
    face: FaceModel, *, yaw: float = 0.0, pitch: float = 0.0, size: tuple[int, int] = (500, 600), margin: float = 1.45
) -> Camera:
    """A camera that shows the part of a face that its bases move, and `margin` times as much around it."""
    moving = face.moving if face.moving.any() else np.ones(len(face.mesh.vertices), bool)
    low, high = face.mesh.vertices[moving].min(axis=0), face.mesh.vertices[moving].max(axis=0)
    extent = margin * max(high[1] - low[1], (high[0] - low[0]) * size[1] / size[0])
    return Camera((low + high) / 2, float(extent), yaw, pitch, size)
