"""The report of a layout study: one HTML page with its figures, tables and the recommended layout beside it.

- `draw_curves`: error against the number of markers (figures 3.5, 3.7 and 3.8 of the thesis).
- `paint_errors`: errors painted on the face (figure 3.4).
- `paint_clusters`: clusters and their markers (figure 3.6).
- `layout_page`: the page.
"""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from signface.face.camera import face_camera
from signface.face.model import FaceModel
from signface.render.still import render

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Family: name in the report, colour (Okabe and Ito), marker, line.
FAMILIES = {
    "man": ("manual (MAN)", "#000000", "s", "--"),
    "star": ("published (STAR)", "#999999", "D", ""),
    "default": ("default", "#e41a1c", "*", ""),
    "k-means": ("k-means", "#0072b2", "o", "-"),
    "k-means, one actor": ("k-means, one actor", "#56b4e9", "o", ":"),
    "greedy": ("greedy reconstruction", "#d55e00", "^", "-"),
    "a-optimal": ("A-optimal design", "#009e73", "v", "-"),
    "d-optimal": ("D-optimal design", "#cc79a7", "P", "-"),
    "thin-shell": ("thin-shell selection", "#e69f00", "X", "-"),
}
CONDITIONS = {"clean": "clean markers", "glued": "glued 1 to 3 mm aside, with jitter"}

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 66rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
table { border-collapse: collapse; margin: 1rem 0; font-size: .92rem; }
th, td { padding: .2rem .7rem; border-bottom: 1px solid #ddd; text-align: right; }
th:first-child, td:first-child { text-align: left; }
figure { margin: 1.5rem 0; } svg, img { max-width: 100%; height: auto; } figcaption, .note { color: #555; }
li { margin: .3rem 0; }
"""


def draw_curves(summary: pd.DataFrame, mappings: Mapping[str, str]) -> Figure:
    """Error against the number of markers, a row for each condition, a column for each mapping."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 6.6), layout="constrained")
    axes = figure.subplots(len(CONDITIONS), len(mappings), sharex=True, squeeze=False)
    for row, (condition, title) in enumerate(CONDITIONS.items()):
        for column, (mapping, name) in enumerate(mappings.items()):
            own = axes[row, column]
            part = summary[(summary["condition"] == condition) & (summary["mapping"] == mapping)]
            for family, (label, colour, marker, line) in FAMILIES.items():
                points = part[part["family"] == family].sort_values("markers")
                if len(points):
                    own.plot(points["markers"], points["rms_mm"], marker=marker, linestyle=line or "none", color=colour,
                             label=label, markersize=9 if marker == "*" else 5, linewidth=1.3)  # fmt: skip
            own.grid(color="#eeeeee")
            own.set_axisbelow(True)
            own.set_ylim(bottom=0)
            if row == 0:
                own.set_title(name, fontsize=11)
            if column == 0:
                own.set_ylabel(f"{title}\nerror of a vertex, mm (RMS)", fontsize=9)
            if row == len(CONDITIONS) - 1:
                own.set_xlabel("face markers", fontsize=9)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, fontsize=8.5, frameon=False)
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
    largest = max(float(np.quantile(own, 0.995)) for own in maps.values())
    scale, colours = Normalize(0.0, largest), colormaps["viridis"]
    figure = Figure(figsize=(2.4 * len(maps) + 0.8, 3.4), dpi=100, layout="constrained")
    axes = figure.subplots(1, len(maps), squeeze=False)[0]
    camera = face_camera(face, size=size, margin=1.1)
    for own, (name, errors) in zip(axes, maps.items()):
        _show(own, face, camera, colours(scale(errors))[:, :3], points[name], size)
        own.set_title(name, fontsize=9)
    figure.colorbar(ScalarMappable(scale, colours), ax=list(axes), shrink=0.8, label="error, mm (RMS)")
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

    size = (330, 400)
    figure = Figure(figsize=(3.3 * len(members), 4.1), dpi=100, layout="constrained")
    axes = figure.subplots(1, len(members), squeeze=False)[0]
    camera = face_camera(face, size=size, margin=1.1)
    for own, (name, cluster) in zip(axes, members.items()):
        hue = (cluster * 0.61803398875) % 1.0  # the golden section keeps successive hues apart
        colours = np.full((len(face.mesh.vertices), 3), 0.8)
        colours[clustered] = hsv_to_rgb(np.stack([hue, np.full(len(hue), 0.55), np.full(len(hue), 0.95)], axis=1))
        _show(own, face, camera, colours, points[name], size)
        own.set_title(name, fontsize=10)
    return figure


def _show(axes, face, camera, colours, points, size) -> None:  # type: ignore[no-untyped-def]
    axes.imshow(render(face.mesh, camera, colours), interpolation="antialiased")
    pixels = camera.project(points)
    axes.plot(pixels[:, 0], pixels[:, 1], "o", color="white", markersize=2.8, markeredgecolor="black", mew=0.5)
    axes.set(xlim=(0, size[0]), ylim=(size[1], 0))
    axes.axis("off")


def layout_page(
    *,
    title: str,
    findings: Sequence[str],
    method: Sequence[str],
    figures: Sequence[tuple[Figure, str, str]],
    tables: Sequence[tuple[str, pd.DataFrame]],
    warnings: Sequence[str] = (),
) -> str:
    """The page: one file that needs nothing else.

    Parameters
    ----------
    title : str
    findings, method, warnings : sequence of str
        Sentences.
    figures : sequence of (Figure, str, str)
        Each with its caption and how it is embedded: `svg`, or `png` for painted faces.
    tables : sequence of (str, DataFrame)
        Each with its caption.
    """
    parts = [f"<h1>{html.escape(title)}</h1>"]
    parts += [f"<p class='note'><strong>{html.escape(word)}</strong></p>" for word in warnings]
    parts.append("<h2>Findings</h2><ul>" + "".join(f"<li>{html.escape(word)}</li>" for word in findings) + "</ul>")
    for figure, caption, kind in figures:
        parts.append(f"<figure>{embedded(figure, kind)}<figcaption>{html.escape(caption)}</figcaption></figure>")
    parts.append("<h2>How it was measured</h2>" + "".join(f"<p>{html.escape(word)}</p>" for word in method))
    for caption, table in tables:
        body = table.to_html(index=False, border=0, float_format=lambda value: f"{value:.3f}", escape=True)
        parts.append(f"<details><summary>{html.escape(caption)}</summary>{body}</details>")
    body = "\n".join(parts)
    return (
        f"<!doctype html><html lang='en'><head><meta charset='utf-8'><title>{html.escape(title)}</title>"
        f"<style>{STYLE}</style></head><body>{body}</body></html>\n"
    )


def embedded(figure: Figure, kind: str) -> str:
    """A figure as inline SVG, or as an image element with its PNG in it."""
    from matplotlib import rc_context

    if kind == "svg":
        text = io.StringIO()
        with rc_context({"svg.hashsalt": "signface"}):
            figure.savefig(text, format="svg", metadata={"Date": None})
        content = text.getvalue()
        return content[content.index("<svg") :]
    data = io.BytesIO()
    figure.savefig(data, format="png")
    return f"<img alt='' src='data:image/png;base64,{base64.b64encode(data.getvalue()).decode()}'>"
