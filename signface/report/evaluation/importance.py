"""Which parts of the face a classifier lives on, painted on the face.

- `draw_importance`: bars for the bases that matter most, beside the face.
- `skin_values`: what each vertex of the skin is painted with.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from signface.face.model import FaceModel
from signface.report.style import styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Groups of bases that have a bar.
BARS = 14

#: Grey of skin that nothing moves, or nothing that matters.
STILL = 0.86


def skin_values(face: FaceModel, table: pd.DataFrame) -> np.ndarray:
    """(V,) importance of each vertex: that of each base, by how far the base moves the vertex; 0 to 1.

    Parameters
    ----------
    face : FaceModel
        Has all bases of the table.
    table : DataFrame
        Of `signface.evaluation.importance.permutation_importance`. Losses below zero are chance and count as none.
    """
    values = np.zeros(len(face.mesh.vertices))
    for bases, lost in zip(table["bases"], table["accuracy_lost"], strict=True):
        moved = sum(np.linalg.norm(face.bases[face.names.index(name)], axis=1) for name in bases.split())
        values += max(float(lost), 0.0) * moved / max(float(np.max(moved)), 1e-12)
    largest = float(values.max())
    return values / largest if largest > 0 else values


def draw_importance(table: pd.DataFrame, face: FaceModel | None, *, title: str) -> Figure:
    """Accuracy lost without each group of bases, beside the face painted with it.

    Parameters
    ----------
    table : DataFrame
        Of `permutation_importance`.
    face : FaceModel, optional
        None, or one that lacks a base: bars only.
    title : str
    """
    from matplotlib.figure import Figure

    largest = table.head(BARS)
    named = {name for bases in table["bases"] for name in bases.split()}
    painted = face is not None and named <= set(face.names)
    with styled():
        figure = Figure(figsize=(9.4 if painted else 5.4, 0.9 + 0.235 * len(largest)), layout="constrained")
        if painted:
            assert face is not None
            halves = figure.subfigures(1, 2, width_ratios=[1.05, 1], squeeze=False)[0]
            _paint(halves[1], face, skin_values(face, table))
            panel = halves[0].subplots()
        else:
            panel = figure.subplots()
        lost = largest["accuracy_lost"].to_numpy(float)
        panel.barh(range(len(largest)), lost, height=0.7, color="#0072b2")
        for at, (low, high) in enumerate(largest[["low", "high"]].to_numpy(float)):
            if np.isfinite([low, high]).all():
                panel.plot([low, high], [at, at], color="#222222", linewidth=1)
        panel.axvline(0, color="#777777", linewidth=0.8)
        panel.set_yticks(range(len(largest)), largest["group"])
        panel.set_ylim(len(largest) - 0.4, -0.6)
        panel.set_xlabel("accuracy lost")
        panel.xaxis.grid(True)
        panel.tick_params(axis="y", length=0)
        panel.set_title(title)
        return figure


def _paint(figure, face: FaceModel, values: np.ndarray) -> None:  # type: ignore[no-untyped-def]
    """The face from the front and from the side, its skin coloured by the values, with a scale."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap

    from signface.face.camera import face_camera
    from signface.render.still import render

    scale = LinearSegmentedColormap.from_list(
        "importance", [(STILL, STILL, STILL), *colormaps["Blues"]([0.45, 0.75, 1.0])]
    )
    axes = figure.subplots(1, 2, width_ratios=[1.0, 1.0])
    for panel, (yaw, name) in zip(axes, ((0.0, "front"), (40.0, "signer’s left")), strict=True):
        camera = face_camera(face, yaw=yaw, size=(340, 380), margin=1.12)
        panel.imshow(render(face.mesh, camera, scale(values)[:, :3]), interpolation="antialiased")
        panel.set_axis_off()
        panel.set_title(name, fontsize=9, fontweight="normal", loc="center")
    bar = figure.colorbar(ScalarMappable(cmap=scale), ax=list(axes), shrink=0.6, aspect=30, location="bottom", pad=0.02)
    bar.set_ticks([0, 1], labels=["does not matter", "matters most"])
    bar.outline.set_visible(False)
