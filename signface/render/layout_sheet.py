"""A sheet for the person who glues the markers: front and both sides, numbered, with distances in millimetres.

- `draw_sheet`: the sheet, on one A4 page, as .svg, .pdf or .png.
- `numbering`: which number a marker has, the same on the sheet and in the table.
- `distances`: the table of distances.
"""

from __future__ import annotations

from os import PathLike

import numpy as np
import pandas as pd

from signface.face.camera import Camera
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.files import whole_file
from signface.render.still import render, whole_mesh

#: Title of each view, its yaw in degrees, and its place on the page (left, bottom, width, height).
VIEWS = (
    ("front", 0.0, (0.01, 0.13, 0.40, 0.78)),
    ("signer's right", -65.0, (0.42, 0.53, 0.30, 0.38)),
    ("signer's left", 65.0, (0.42, 0.11, 0.30, 0.38)),
)
#: A marker on skin turned away farther than this (cosine) is shown in another view only.
FACING = 0.25
#: Width of a view in pixels.
_PIXELS = 600


def numbering(layout: MarkerLayout, face: FaceModel) -> dict[str, int]:
    """Number of each face marker: from the forehead down, on a level from the signer's right to the left."""
    points = dict(zip(layout.face_labels, layout.points(face)))
    order = sorted(points, key=lambda label: (-round(points[label][1] / 4.0), points[label][0]))
    return {label: number for number, label in enumerate(order, start=1)}


def distances(layout: MarkerLayout, face: FaceModel) -> pd.DataFrame:
    """One row for each face marker, by number: marker, from_midline_mm, and its two nearest neighbours.

    Straight distances, as a calliper measures them, on this face; on another head they scale with it.
    """
    numbers = numbering(layout, face)
    labels = sorted(numbers, key=numbers.__getitem__)
    points = layout.points(face, labels)
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    rows = []
    for row, label in enumerate(labels):
        near = np.argsort(apart[row])[:2]
        rows.append(
            (row + 1, label, round(abs(float(points[row, 0]))), *(
                value for other in near for value in (int(other) + 1, round(float(apart[row, other])))
            ))
        )  # fmt: skip
    columns = ["number", "marker", "from_midline_mm", "nearest", "nearest_mm", "second", "second_mm"]
    return pd.DataFrame(rows, columns=columns)


def draw_sheet(face: FaceModel, layout: MarkerLayout, *paths: str | PathLike[str], note: str = "") -> None:
    """Draw the sheet, A4 across.

    Parameters
    ----------
    face : FaceModel
    layout : MarkerLayout
    paths : path
        Where to write it; each ends in .svg, .pdf or .png.
    note : str
        A line below the title.

    Raises
    ------
    SignfaceError
        The picture cannot be written.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    table = distances(layout, face)
    numbers = numbering(layout, face)
    mesh, colours = whole_mesh(face)
    pale = 0.45 * colours + 0.55  # numbers must be read on the skin, in black and white too
    with rc_context({"svg.hashsalt": "signface"}):  # two runs write the same bytes
        figure = Figure(figsize=(11.69, 8.27), dpi=110)
        FigureCanvasAgg(figure)
        for title, yaw, place in VIEWS:
            axes = figure.add_axes(place)
            size = (_PIXELS, round(_PIXELS * place[3] * 8.27 / (place[2] * 11.69)))
            camera = _camera(layout.points(face), yaw, size)
            axes.imshow(render(mesh, camera, pale), interpolation="antialiased")
            axes.set(xlim=(0, size[0]), ylim=(size[1], 0))
            axes.set_title(title, fontsize=10)
            axes.axis("off")
            _mark(axes, face, layout, numbers, camera, yaw, table)
        _write_table(figure, table)
        figure.text(0.02, 0.965, f"{layout.name}: where to glue {len(numbers)} markers", fontsize=15, weight="bold")
        head = ", ".join(layout.head_labels)
        figure.text(0.02, 0.945, note, fontsize=8.5)
        figure.text(
            0.02,
            0.085,
            "Figures on the lines: straight distances in mm, as a calliper measures them, on this head. Right and "
            "left are the signer's.\nOn another head keep the places by their features (corner of the mouth, end of "
            f"the brow), not the millimetres.\nHead markers, on what does not move: {head}.",
            fontsize=8,
            va="top",
        )
        metadata = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
        for path in paths:
            with whole_file(path) as temporary:
                figure.savefig(temporary, metadata=metadata.get(temporary.suffix.lower()))


def _camera(points: np.ndarray, yaw: float, size: tuple[int, int]) -> Camera:
    """A camera that fills the view with the markers."""
    plain = Camera(np.zeros(3), 1.0, yaw, size=size)
    seen = points @ plain.axes.T
    if yaw:
        seen = seen[points[:, 0] * np.sign(yaw) > -1.0]
    low, high = seen.min(axis=0), seen.max(axis=0)
    extent = 1.25 * max(high[1] - low[1], (high[0] - low[0]) * size[1] / size[0])
    return Camera((low + high) / 2 @ plain.axes, float(extent), yaw, size=size)


def _mark(axes, face, layout, numbers, camera, yaw, table) -> None:  # type: ignore[no-untyped-def]
    """Markers, their numbers, and lines to the nearest neighbour with its distance."""
    labels = sorted(numbers, key=numbers.__getitem__)
    rows = [layout.labels.index(label) for label in labels]
    points = layout.points(face, labels)
    normals = np.einsum("pkd,pk->pd", face.mesh.vertex_normals[layout.corners[rows]], layout.barycentric[rows])
    facing = normals @ camera.axes[2] > FACING
    if yaw:  # a side view is for one side
        facing &= points[:, 0] * np.sign(yaw) > -1.0
    pixels = camera.project(points)
    drawn = set()
    for row in np.flatnonzero(facing):
        other = int(table["nearest"].iloc[row]) - 1
        pair = (min(row, other), max(row, other))
        if not facing[other] or pair in drawn:
            continue
        drawn.add(pair)
        ends = pixels[[row, other], :2]
        axes.plot(ends[:, 0], ends[:, 1], color="#0353a4", linewidth=0.6, zorder=2)
        if not yaw:
            middle = ends.mean(axis=0)
            box = {"facecolor": "white", "edgecolor": "none", "pad": 0.3, "alpha": 0.7}
            axes.text(*middle, f"{table['nearest_mm'].iloc[row]}", fontsize=5.5, color="#0353a4", ha="center",
                      va="center", zorder=3, bbox=box)  # fmt: skip
    size = 7.5 if not yaw else 6.0
    for row in np.flatnonzero(facing):
        x, y = pixels[row, :2]
        axes.plot(x, y, "o", color="#c1121f", markersize=4.0, markeredgecolor="white", markeredgewidth=0.4, zorder=4)
        axes.annotate(
            str(row + 1), (x, y), (2.5, 2.5), textcoords="offset points", fontsize=size, weight="bold", zorder=5
        )


def _write_table(figure, table: pd.DataFrame) -> None:  # type: ignore[no-untyped-def]
    """The table at the right edge of the page."""
    axes = figure.add_axes((0.735, 0.03, 0.26, 0.90))
    axes.axis("off")
    lines = [("no.", "place", "midline", "nearest")]
    lines += [
        (str(r.number), str(r.marker).replace("_", " "), f"{r.from_midline_mm} mm",
         f"{r.nearest_mm} mm to {r.nearest}, {r.second_mm} mm to {r.second}")
        for r in table.itertuples(index=False)
    ]  # fmt: skip
    step = 1.0 / max(len(lines), 30)
    size = min(6.6, 6.6 * 42 / max(len(lines), 42))
    for row, line in enumerate(lines):
        for x, word in zip((0.0, 0.07, 0.45, 0.60), line):
            axes.text(x, 1.0 - row * step, word, fontsize=size, va="top", weight="bold" if row == 0 else "normal")
