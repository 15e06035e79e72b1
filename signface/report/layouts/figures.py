"""The figures of a comparison of layouts.

- `draw_curves`: error against the number of markers (figures 3.5, 3.7 and 3.8 of the thesis).
- `paint_errors`: errors painted on the face (figure 3.4).
- `paint_clusters`: clusters and their markers (figure 3.6).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from signface.face.camera import Camera, face_camera
from signface.face.model import FaceModel
from signface.render.still import render
from signface.report.style import COLOURS, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Family: name in the report, colour, marker, line. Empirical layouts are black and grey, the default one stands out.
FAMILIES = {
    "man": ("manual (MAN)", "#000000", "s", "--"),
    "star": ("published (STAR)", "#999999", "D", ""),
    "default": ("default", "#e41a1c", "*", ""),
    "k-means": ("k-means", COLOURS[0], "o", "-"),
    "k-means, one actor": ("k-means, one actor", COLOURS[4], "o", ":"),
    "greedy": ("greedy reconstruction", COLOURS[1], "^", "-"),
    "a-optimal": ("A-optimal design", COLOURS[2], "v", "-"),
    "d-optimal": ("D-optimal design", COLOURS[3], "P", "-"),
    "thin-shell": ("thin-shell selection", COLOURS[5], "X", "-"),
}
CONDITIONS = {"clean": "clean markers", "glued": "glued 1 to 3 mm aside, with jitter"}


def draw_curves(summary: pd.DataFrame, mappings: Mapping[str, str]) -> Figure:
    """Error against the number of markers, a row for each condition, a column for each mapping."""
    from matplotlib.figure import Figure

    with styled():
        figure = Figure(figsize=(11.0, 6.6), layout="constrained")
        panels = figure.subplots(len(CONDITIONS), len(mappings), sharex=True, squeeze=False)
        for row, (condition, title) in enumerate(CONDITIONS.items()):
            for column, (mapping, name) in enumerate(mappings.items()):
                axes = panels[row, column]
                part = summary[(summary["condition"] == condition) & (summary["mapping"] == mapping)]
                for family, (label, colour, marker, line) in FAMILIES.items():
                    points = part[part["family"] == family].sort_values("markers")
                    if len(points):
                        axes.plot(
                            points["markers"],
                            points["rms_mm"],
                            marker=marker,
                            linestyle=line or "none",
                            color=colour,
                            label=label,
                            markersize=9 if marker == "*" else 5,
                            linewidth=1.3,
                        )
                axes.grid(True)
                axes.set_ylim(bottom=0)
                if row == 0:
                    axes.set_title(name)
                if column == 0:
                    axes.set_ylabel(f"{title}\nerror of a vertex, mm (RMS)")
                if row == len(CONDITIONS) - 1:
                    axes.set_xlabel("face markers")
        handles, labels = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=5)
        return figure


def paint_errors(
    face: FaceModel, maps: Mapping[str, np.ndarray], points: Mapping[str, np.ndarray], title: str
) -> Figure:
    """Faces coloured by the error of each vertex, one scale for all, with the markers of each layout.

    Parameters
    ----------
    face : FaceModel
    maps : mapping
        Title of each picture to its (V,) errors in millimetres.
    points : mapping
        The same titles to the (P, 3) places of the markers.
    title : str
        Of the figure.
    """
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    size = (260, 320)
    largest = max(float(np.quantile(errors, 0.995)) for errors in maps.values())
    scale, colours = Normalize(0.0, largest), colormaps["viridis"]
    with styled():
        figure = Figure(figsize=(2.4 * len(maps) + 0.8, 3.4), dpi=200, layout="constrained")
        panels = figure.subplots(1, len(maps), squeeze=False)[0]
        camera = face_camera(face, size=size, margin=1.1)
        for axes, (name, errors) in zip(panels, maps.items()):
            _paint(axes, face, camera, colours(scale(errors))[:, :3], points[name])
            axes.set_title(name, loc="center", weight="normal")
        figure.colorbar(ScalarMappable(scale, colours), ax=list(panels), shrink=0.8, label="error, mm (RMS)")
        figure.suptitle(title, fontsize=10)
        return figure


def paint_clusters(
    face: FaceModel, clustered: np.ndarray, members: Mapping[str, np.ndarray], points: Mapping[str, np.ndarray]
) -> Figure:
    """Faces coloured by cluster, neighbours apart in hue, with the markers.

    Parameters
    ----------
    face : FaceModel
    clustered : (K,) int array
        The vertices that are clustered.
    members : mapping
        Title to the (K,) clusters.
    points : mapping
        Title to the (P, 3) places of the markers.
    """
    from matplotlib.colors import hsv_to_rgb
    from matplotlib.figure import Figure

    with styled():
        figure = Figure(figsize=(3.3 * len(members), 4.1), dpi=200, layout="constrained")
        panels = figure.subplots(1, len(members), squeeze=False)[0]
        camera = face_camera(face, size=(330, 400), margin=1.1)
        for axes, (name, cluster) in zip(panels, members.items()):
            hue = (cluster * 0.61803398875) % 1.0  # the golden section keeps successive hues apart
            colours = np.full((len(face.mesh.vertices), 3), 0.8)
            colours[clustered] = hsv_to_rgb(np.stack([hue, np.full(len(hue), 0.55), np.full(len(hue), 0.95)], axis=1))
            _paint(axes, face, camera, colours, points[name])
            axes.set_title(name, loc="center", weight="normal")
        return figure


def _paint(axes: Axes, face: FaceModel, camera: Camera, colours: np.ndarray, points: np.ndarray) -> None:
    """The face in its colours, with markers at some points."""
    fine = replace(camera, size=(2 * camera.size[0], 2 * camera.size[1]))
    axes.imshow(render(face.mesh, fine, colours), interpolation="antialiased")
    pixels = fine.project(points)
    axes.plot(pixels[:, 0], pixels[:, 1], "o", color="white", markersize=2.8, markeredgecolor="black", mew=0.5)
    axes.set(xlim=(0, fine.size[0]), ylim=(fine.size[1], 0))
    axes.axis("off")
