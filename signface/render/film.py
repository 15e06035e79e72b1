"""Films of a face: weights in time become pictures, and pictures an MP4 that every browser plays.

- `Avatar`: a face before a fixed camera; `picture` draws one moment.
- `at_rate`, `head_at_rate`: weights, and how the head is turned, at the rate of a film.
- `pictures_of`: every picture of a film, drawn by several threads, in order.
- `write_film`: H.264, 4:2:0, the index first, so that a browser begins at once.
- `read_film`: pictures of a real video at a film's rate and size.
- `beside`: several pictures side by side, with captions.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from os import PathLike
from pathlib import Path
from typing import TypeVar

import numpy as np

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.extras import needed
from signface.face.camera import Camera
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.files import whole_file
from signface.render.head import Neck, moving_part, rotations_at
from signface.render.raster import Scene, Style
from signface.render.still import SKIN, whole_face

Item = TypeVar("Item")
Made = TypeVar("Made")


class Avatar:
    """A face before a fixed camera.

    Parameters
    ----------
    face : FaceModel
        With the default face, its eyes, mouth, brows and lashes are drawn too.
    size : (int, int)
        Width and height in pixels; even, as the films need.
    yaw, pitch : float
        Degrees; where it is seen from.
    style : Style, optional
    layout : MarkerLayout, optional
        Its face markers are drawn as dots on the skin.
    colour : (float, float, float), optional
        One colour for the skin, 0 to 1.
    skin : str
        Tone of the default face's skin: fair, light, tan, brown, dark.

    Raises
    ------
    SignfaceError
        The size is odd or out of range, no tone of skin has this name, or the extra `render` is not installed.

    See Also
    --------
    pictures_of : many pictures, by several threads.

    Examples
    --------
    >>> from signface.face.reading import read_face
    >>> face = read_face("default")
    >>> Avatar(face, size=(160, 120)).picture(np.zeros(face.n_bases)).shape
    (120, 160, 3)
    """

    def __init__(
        self,
        face: FaceModel,
        *,
        size: tuple[int, int] = (640, 480),
        yaw: float = 0.0,
        pitch: float = 0.0,
        style: Style | None = None,
        layout: MarkerLayout | None = None,
        colour: tuple[float, float, float] | None = None,
        skin: str = SKIN,
    ) -> None:
        check_size(size)
        self.face, self.size, self._layout = face, size, layout
        whole = whole_face(face, skin=skin)
        mesh, colours = whole.mesh, np.array(whole.colours)
        self._skin = len(face.mesh.vertices)
        if colour is not None:
            colours[: self._skin] = colour
        self._neutral = mesh.vertices
        # For pictures, half the memory to go through.
        self._bases = whole.bases.reshape(face.n_bases, -1).astype(np.float32)
        self._neck = Neck(face, mesh.vertices)
        camera = film_camera(face, size, yaw, pitch)
        # From front to back, so that what is hidden is seldom drawn first.
        depth = camera.project(mesh.vertices)[:, 2]
        order = np.argsort(-depth[mesh.triangles].max(axis=1), kind="stable")
        self._scene = Scene(mesh.triangles[order], colours, camera, style, rest=mesh.vertices, skin=self._skin)

    def picture(self, weights: np.ndarray, head: np.ndarray | None = None) -> np.ndarray:
        """(height, width, 3) uint8: the face with (N,) weights; `head` as in `pose`."""
        return self.draw(self.pose(weights, head))

    def pose(self, weights: np.ndarray, head: np.ndarray | None = None) -> np.ndarray:
        """(..., V, 3) vertices of everything that is drawn, for (..., N) weights; cheaper for many at a time.

        `head` are (..., 3, 3) rotations of the head; None keeps it still.
        """
        moved = np.asarray(weights, dtype=np.float32) @ self._bases
        vertices = self._neutral + moved.reshape(*np.shape(weights)[:-1], -1, 3)
        return vertices if head is None else self._neck.turn(vertices, head)

    def draw(self, vertices: np.ndarray) -> np.ndarray:
        """(height, width, 3) uint8: a picture of posed vertices."""
        dots = None if self._layout is None else self._layout.interpolate(vertices[: self._skin])
        return self._scene.draw(vertices, dots)


def film_camera(face: FaceModel, size: tuple[int, int], yaw: float = 0.0, pitch: float = 0.0) -> Camera:
    """A camera that shows the head from the crown to a little below what moves; a neck's cut end stays outside."""
    vertices = face.mesh.vertices
    moving = moving_part(face)
    height = float(np.ptp(moving[:, 1]))
    low = max(float(vertices[:, 1].min()) - 0.04 * height, float(moving[:, 1].min()) - 0.09 * height)
    high = float(vertices[:, 1].max()) + 0.06 * height
    width = 1.12 * float(np.ptp(vertices[:, 0]))
    extent = max(high - low, width * size[1] / size[0])
    centre = np.array([float(np.mean([vertices[:, 0].min(), vertices[:, 0].max()])), (low + high) / 2, 0.0])
    return Camera(centre, extent, yaw, pitch, size)


def check_size(size: tuple[int, int]) -> None:
    """Refuse a size that H.264 with 4:2:0 cannot hold.

    Raises
    ------
    SignfaceError
        A side is odd, under 32 or over 4096 pixels.
    """
    if any(side % 2 or not 32 <= side <= 4096 for side in size):
        raise SignfaceError(
            f"a film of {size[0]}x{size[1]} cannot be written", hint="both sides must be even, from 32 to 4096 pixels"
        )


def at_rate(
    descriptors: Descriptors, rate: float, *, start_s: float | None = None, end_s: float | None = None
) -> np.ndarray:
    """(K, N) weights at the times `start_s + k / rate` up to `end_s`, between frames by straight lines.

    A frame that could not be solved is passed over.

    Raises
    ------
    SignfaceError
        The rate is not positive, the times lie outside the take, or no frame could be solved.
    """
    times = _film_times(descriptors, rate, start_s, end_s)
    solved = np.isfinite(descriptors.weights).all(axis=1)
    if not solved.any():
        raise SignfaceError(f"{descriptors.name}: no frame could be solved")
    columns = [np.interp(times, descriptors.time[solved], column[solved]) for column in descriptors.weights.T]
    return np.stack(columns, axis=1)


def head_at_rate(
    descriptors: Descriptors, rate: float, *, start_s: float | None = None, end_s: float | None = None
) -> np.ndarray | None:
    """(K, 3, 3) rotations of the head at the times of `at_rate`; None when its pose is unknown.

    Raises
    ------
    SignfaceError
        The rate is not positive, or the times lie outside the take.

    See Also
    --------
    signface.render.head.rotations_at : between frames, and where a pose is unknown.

    Examples
    --------
    >>> import signface as sf
    >>> weights = sf.solve(sf.datasets.mini_take())
    >>> head_at_rate(weights, 25, start_s=1.0, end_s=2.0).shape
    (26, 3, 3)
    """
    return rotations_at(descriptors, _film_times(descriptors, rate, start_s, end_s))


def _film_times(descriptors: Descriptors, rate: float, start_s: float | None, end_s: float | None) -> np.ndarray:
    if not (np.isfinite(rate) and 0 < rate <= 240):
        raise SignfaceError(f"a film of {rate:g} pictures a second cannot be made", hint="choose 1 to 240")
    time = descriptors.time
    start = time[0] if start_s is None else start_s
    end = time[-1] if end_s is None else end_s
    if not (time[0] - 1e-6 <= start < end <= time[-1] + 1.5 / descriptors.rate):
        raise SignfaceError(
            f"{descriptors.name}: {start:g} to {end:g} s is not inside the take",
            hint=f"it goes from {time[0]:.3f} to {time[-1]:.3f} s",
        )
    return start + np.arange(max(1, int((end - start) * rate + 1e-6) + 1)) / rate


def in_order(work: Callable[[Item], Made], items: Iterable[Item], workers: int | None = None) -> Iterator[Made]:
    """`map(work, items)` by several threads, a few items ahead, in order."""
    count = min(workers or os.cpu_count() or 1, 8)
    waiting = iter(items)
    with ThreadPoolExecutor(count) as pool:
        running = deque(pool.submit(work, item) for item in islice(waiting, 2 * count))
        while running:
            yield running.popleft().result()
            running.extend(pool.submit(work, item) for item in islice(waiting, 1))


def pictures_of(avatar: Avatar, weights: np.ndarray, head: np.ndarray | None = None) -> Iterator[np.ndarray]:
    """Every picture of (K, N) weights, in order; the head turned by (K, 3, 3) rotations, or still."""
    parts = (slice(start, start + 16) for start in range(0, len(weights), 16))
    posed = (
        vertices for part in parts for vertices in avatar.pose(weights[part], None if head is None else head[part])
    )
    return in_order(avatar.draw, posed)


def beside(pictures: list[np.ndarray], captions: list[str] | None = None) -> np.ndarray:
    """Pictures of one height side by side; captions are written at their upper left."""
    joined = np.concatenate(pictures, axis=1)
    if not captions:
        return joined
    from PIL import Image, ImageDraw, ImageFont

    image = Image.fromarray(joined)
    draw = ImageDraw.Draw(image)
    height = joined.shape[0]
    font = ImageFont.load_default(size=max(10, height // 22))
    left = 0
    for picture, caption in zip(pictures, captions):
        draw.text((left + height // 40, height // 60), caption, fill=(20, 22, 26), font=font)
        left += picture.shape[1]
    return np.asarray(image)


def write_film(path: str | PathLike[str], pictures: Iterable[np.ndarray], rate: float) -> int:
    """Write pictures as MP4 (H.264, yuv420p, index first); the number of pictures.

    Raises
    ------
    SignfaceError
        The ending is not .mp4, there is no picture, ffmpeg fails, or the extra `render` is not installed.
    """
    if Path(path).suffix.lower() != ".mp4":
        raise SignfaceError("the ending of a film is .mp4", file=path)
    ffmpeg = needed("imageio_ffmpeg", "render")
    count, writer = 0, None
    with whole_file(path) as temporary:
        try:
            for picture in pictures:
                if writer is None:
                    height, width = picture.shape[:2]
                    writer = ffmpeg.write_frames(
                        str(temporary),
                        (width, height),
                        fps=rate,
                        codec="libx264",
                        pix_fmt_in="rgb24",
                        pix_fmt_out="yuv420p",
                        quality=None,
                        macro_block_size=2,
                        ffmpeg_log_level="error",
                        output_params=[
                            *("-preset", "veryfast", "-crf", "18", "-g", str(max(1, round(rate)))),
                            *("-movflags", "+faststart", "-map_metadata", "-1", "-fflags", "+bitexact"),
                            *("-color_primaries", "bt709", "-color_trc", "bt709", "-colorspace", "bt709"),
                        ],
                    )
                    writer.send(None)
                writer.send(np.ascontiguousarray(picture))
                count += 1
            if writer is not None:
                writer.close()
        except OSError as error:
            raise SignfaceError(f"ffmpeg could not write the film ({error})", file=path) from error
        if count == 0:
            raise SignfaceError("has no picture to show", file=path)
    return count


def read_film(
    path: str | PathLike[str], *, rate: float, size: tuple[int, int], start_s: float = 0.0
) -> Iterator[np.ndarray]:
    """Pictures of a video from `start_s` on, at a rate, fitted into a size with grey bars.

    Raises
    ------
    SignfaceError
        No such file, it is no video, or the extra `render` is not installed.
    """
    if not Path(path).is_file():
        raise SignfaceError("no such file", file=path)
    ffmpeg = needed("imageio_ffmpeg", "render")
    width, height = size
    fit = f"scale={width}:{height}:force_original_aspect_ratio=decrease,pad={width}:{height}:-1:-1:color=0x8c9096"
    reader = ffmpeg.read_frames(
        str(path),
        input_params=["-ss", f"{start_s:.6f}"],
        output_params=["-vf", f"fps={rate:g},{fit},setsar=1"],
    )
    try:
        next(reader)
    except (OSError, StopIteration, RuntimeError) as error:
        raise SignfaceError(
            f"cannot be read as a video from {start_s:g} s on", file=path, hint="is it long enough, and does it play"
        ) from error
    try:
        for frame in reader:
            yield np.frombuffer(frame, np.uint8).reshape(height, width, 3)
    finally:
        reader.close()
