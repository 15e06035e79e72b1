"""A take in one picture: the face at a few moments above its timeline."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from signface.descriptors import Descriptors
from signface.face.model import FaceModel
from signface.label.vocabulary import Vocabulary
from signface.report.colours import colour_of
from signface.report.timeline import draw_timeline_on
from signface.segmentation.segments import Segments

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_overview(
    descriptors: Descriptors,
    segments: Segments,
    face: FaceModel,
    *,
    reference: Segments | None = None,
    title: str | None = None,
    moments: int = 3,
    vocabulary: Vocabulary | None = None,
) -> Figure:
    """Draw the avatar, driven by the solved weights, in the middle of some stable segments, above the timeline.

    Parameters
    ----------
    descriptors : Descriptors
        Solved for `face`.
    segments : Segments
        Labelled.
    face : FaceModel
    reference : Segments, optional
        An annotator's segments.
    title : str, optional
        The name of the take by default.
    moments : int
        How many faces at most.
    vocabulary : Vocabulary, optional
        What the labels stand for; by default that of affect, or one of the labels at hand.

    Returns
    -------
    matplotlib.figure.Figure
        Save it with `signface.report.timeline.save_figure`.
    """
    from matplotlib.figure import Figure

    from signface.render.still import draw_face

    if vocabulary is None:
        vocabulary = Vocabulary.holding(segments.table["label"])
    frames = telling_frames(descriptors, segments, moments)
    figure = Figure(figsize=(10, 6.4), layout="constrained")
    faces, below = figure.subfigures(2, 1, squeeze=False, height_ratios=[1.05, 1])[:, 0]
    draw_timeline_on(below, descriptors, segments, reference, title, vocabulary)
    pictures = faces.subplots(1, max(1, len(frames)), squeeze=False)[0]
    for axes, (frame, label) in zip(pictures, frames, strict=False):
        axes.imshow(draw_face(face, descriptors.weights[frame], size=(440, 420)))
        axes.set_xlabel(f"{descriptors.time[frame]:.2f} s: {vocabulary.describe(label)}", fontsize=10)
        axes.set_xticks([])
        axes.set_yticks([])
        for spine in axes.spines.values():
            spine.set(color=colour_of(label, vocabulary), linewidth=3)
    for frame, _ in frames:
        below.axes[0].axvline(descriptors.time[frame], color="#303030", lw=0.8, ls=":", zorder=0)
    return figure


def telling_frames(descriptors: Descriptors, segments: Segments, most: int) -> list[tuple[int, str]]:
    """Frames in the middle of stable segments, each label's longest first, in the order of time, with their labels."""
    table = segments.table[segments.table["kind"] == "stable"]
    table = table.assign(seconds=table["end_s"] - table["start_s"]).sort_values("seconds", ascending=False)
    chosen = table.drop_duplicates("label").head(most)
    rest = table.drop(chosen.index).head(most - len(chosen))
    solved = np.flatnonzero(np.isfinite(descriptors.weights).all(axis=1))
    frames = []
    for segment in sorted([*chosen.index, *rest.index]):
        row = table.loc[segment]
        middle = (row["start_s"] + row["end_s"]) / 2
        if len(solved):
            frames.append((int(solved[np.argmin(np.abs(descriptors.time[solved] - middle))]), str(row["label"])))
    return frames
