"""A picture of a marker layout: the face from the front and from both sides, every marker with its label."""

from __future__ import annotations

from os import PathLike

import numpy as np

from signface.face.camera import Camera
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.files import whole_file
from signface.render.still import render, whole_mesh

#: Title of each view and its yaw in degrees.
VIEWS = (("signer's right", -75.0), ("front", 0.0), ("signer's left", 75.0))
COLOURS = {"face": "#c1121f", "head": "#0353a4"}


def draw_layout(face: FaceModel, layout: MarkerLayout, path: str | PathLike[str]) -> None:
    """Draw the markers of a layout on a face, to a picture (.png, .svg or .pdf by its ending).

    Face markers are red, head markers blue; a head marker without a point is named below.

    Raises
    ------
    SignfaceError
        The picture cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    size = (720, 900)
    placed = [label for label, corner in zip(layout.labels, layout.corners) if corner[0] >= 0]
    rows = [layout.labels.index(label) for label in placed]
    points = layout.points(face, placed)
    normals = np.einsum("pkd,pk->pd", face.mesh.vertex_normals[layout.corners[rows]], layout.barycentric[rows])
    mesh, colours = whole_mesh(face)
    figure = Figure(figsize=(21.6, 9.6), dpi=100)
    FigureCanvasAgg(figure)
    low, high = points.min(axis=0), points.max(axis=0)
    centre, extent = (low + high) / 2, 1.2 * float(max(high[1] - low[1], np.max(high - low) * size[1] / size[0]))
    small = 7 if len(placed) > 120 else 9
    for column, (title, yaw) in enumerate(VIEWS):
        camera = Camera(centre, extent, yaw, 0.0, size)
        axes = figure.add_axes((column / 3, 0.03, 1 / 3, 0.92))
        axes.imshow(render(mesh, camera, colours), interpolation="none")
        axes.set_title(title, fontsize=12)
        axes.set_xlim(0, size[0])
        axes.set_ylim(size[1], 0)
        axes.axis("off")
        facing = normals @ camera.axes[2] > 0.12
        for row, pixel, seen in zip(rows, camera.project(points), facing):
            inside = 0 < pixel[0] < size[0] and 0 < pixel[1] < size[1]
            if not (seen and inside):
                continue
            colour = COLOURS[layout.roles[row]]
            axes.plot(pixel[0], pixel[1], "o", color=colour, markersize=small / 2, markeredgecolor="white", mew=0.5)
            axes.annotate(
                layout.labels[row], pixel[:2], (3, 3), textcoords="offset points", fontsize=small, color="black"
            )
    loose = [label for label in layout.labels if label not in placed]
    counts = f"{layout.name} on {face.name}: {len(layout.face_labels)} face, {len(layout.head_labels)} head markers"
    note = f"; without a point: {', '.join(loose)}" if loose else ""
    figure.text(0.5, 0.01, counts + note, ha="center", fontsize=11)
    with whole_file(path) as temporary:
        figure.savefig(temporary)
