"""A compiled z-buffer: shaded pictures of a mesh at the rate of a film, without a display or a graphics driver.

- `Scene`: what stays the same from picture to picture (triangles, colours, camera, style); `draw` gives a picture.
- `Style`: background, wireframe, samples.
- `visible_triangles`: what a camera sees of a mesh.

Every pixel is sampled on a grid; the nearest triangle is found first and shaded once afterwards, with the normal
interpolated across the triangle (Phong). The loops (`signface.render.loops`) let go of Python's lock, so that two
threads draw two pictures.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass

import numpy as np

from signface.face.camera import Camera
from signface.face.mesh import Mesh
from signface.render import loops

#: Direction towards each light in the camera's frame (right, up, towards the viewer), and its strength.
#: The first comes steeply from above and aside, so that folds throw a side into shade; the others keep it legible.
LIGHTS = np.array([[-0.45, 0.80, 0.55, 0.66], [0.85, 0.20, 0.45, 0.22], [0.0, -0.75, 0.65, 0.07]])
AMBIENT = 0.24
SHINE = 0.12
#: Skin on less than 1 - FOLD_FROM of its area at rest is darkened by FOLD_DARK times what lacks, FOLD_MOST at most.
FOLD_FROM, FOLD_MOST, FOLD_DARK = 0.06, 0.40, 1.3
DOT = (0.05, 0.25, 0.75)
#: Width of a wire in pixels, and how dark it is.
WIRE_PIXELS, WIRE_DARK = 0.55, 0.45


@dataclass(frozen=True)
class Style:
    """How a scene looks.

    Parameters
    ----------
    background : (float, float, float)
        0 to 1.
    wireframe : bool
        Draw the edges of the triangles.
    samples : int
        Samples per pixel and axis.
    """

    background: tuple[float, float, float] = (0.60, 0.62, 0.64)
    wireframe: bool = False
    samples: int = 2


class Scene:
    """A mesh of fixed triangles and colours before a fixed camera.

    Parameters
    ----------
    triangles : (T, 3) int array
    colours : (V, 3) array
        0 to 1.
    camera : Camera
        Its `size` is that of the pictures.
    style : Style
    rest : (V, 3) array, optional
        The vertices at rest, millimetres: skin that is pressed together is drawn darker, as wrinkles make it.
    skin : int
        How many vertices, from the first, are skin.
    """

    def __init__(
        self,
        triangles: np.ndarray,
        colours: np.ndarray,
        camera: Camera,
        style: Style | None = None,
        *,
        rest: np.ndarray | None = None,
        skin: int = 0,
    ) -> None:
        self._triangles = np.ascontiguousarray(triangles, dtype=np.int64)
        self._colours = np.ascontiguousarray(colours, dtype=np.float64)
        self.camera, self.style = camera, style or Style()
        self._lights = LIGHTS.copy()
        self._lights[:, :3] /= np.linalg.norm(LIGHTS[:, :3], axis=1, keepdims=True)
        self._of_thread = threading.local()
        self._skin = 0 if rest is None else skin
        if rest is not None:
            areas = self._normals(self._in_samples(rest))[1]
            self._area_at_rest = np.maximum(areas[:skin], 1e-12)

    def draw(self, vertices: np.ndarray, dots: np.ndarray | None = None) -> np.ndarray:
        """A picture.

        Parameters
        ----------
        vertices : (V, 3) array
            Millimetres.
        dots : (D, 3) array, optional
            Points marked by a dot where the mesh does not hide them, millimetres.

        Returns
        -------
        (height, width, 3) uint8 array
        """
        width, height = self.camera.size
        samples = self.style.samples
        points = self._in_samples(vertices)
        normals, areas = self._normals(points)
        colours = self._colours
        if self._skin:
            pressed = 1.0 - FOLD_FROM - areas[: self._skin] / self._area_at_rest
            colours = colours.copy()
            colours[: self._skin] *= 1.0 - FOLD_DARK * np.clip(pressed, 0.0, FOLD_MOST)[:, None]
        owner, depth, first, second = self._buffers()
        loops.visible(points, self._triangles, depth, owner, first, second)
        picture = np.empty((height, width, 3), np.uint8)
        settings = (AMBIENT, SHINE, *map(float, self.style.background))
        seen = (owner, first, second)
        loops.shade(self._triangles, normals, colours, self._lights, *seen, depth, settings, picture)
        if self.style.wireframe:
            loops.wires(points, self._triangles, *seen, WIRE_PIXELS * samples, WIRE_DARK, picture)
        if dots is not None:
            marks = self.camera.project(dots[np.isfinite(dots).all(axis=1)]) * (samples, samples, 1.0)
            loops.spots(marks, depth, max(1.5, height / 160) * samples, *(255.0 * part for part in DOT), picture)
        return picture

    def _in_samples(self, vertices: np.ndarray) -> np.ndarray:
        """(V, 3) columns and rows in samples, and depths in millimetres."""
        return self.camera.project(vertices) * (self.style.samples, self.style.samples, 1.0)

    def _normals(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(V, 3) unit normals of points in samples, and (V,) how long their sums were: less where skin folds."""
        scale = self.style.samples * self.camera.size[1] / self.camera.extent
        upright = points * (1.0, -1.0, scale)  # rows run downwards; depth in samples
        normals = np.empty_like(points)
        loops.normals_of(upright, self._triangles, normals)
        lengths = np.sqrt(np.einsum("vk,vk->v", normals, normals))
        normals /= np.where(lengths > 0, lengths, 1.0)[:, None]
        return normals, lengths

    def _buffers(self) -> tuple[np.ndarray, ...]:
        """Owner, depth and two weights of each sample; every thread uses its buffers again for each picture."""
        if not hasattr(self._of_thread, "buffers"):
            width, height = (side * self.style.samples for side in self.camera.size)
            self._of_thread.buffers = _empty_buffers(width, height)
        return self._of_thread.buffers


def visible_triangles(mesh: Mesh, camera: Camera) -> np.ndarray:
    """(K,) the triangles of a mesh that fill a pixel of the camera's picture at least, ascending."""
    owner, depth, first, second = _empty_buffers(*camera.size)
    triangles = np.ascontiguousarray(mesh.triangles, dtype=np.int64)
    loops.visible(camera.project(mesh.vertices), triangles, depth, owner, first, second)
    return np.unique(owner[owner >= 0])


def _empty_buffers(width: int, height: int) -> tuple[np.ndarray, ...]:
    kinds = (np.int32, np.float32, np.float32, np.float32)
    return tuple(np.empty((height, width), kind) for kind in kinds)
