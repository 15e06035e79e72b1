"""A take at a glance: its energy curves above its labelled segments (Reverdy 2019, figure 4.3).

- `draw_timeline`: the figure; `draw_timeline_on`: on a part of another; `draw_rows_on`: with any rows of segments.
- `save_figure`: any figure to a file, whole or not at all.
"""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.label.vocabulary import Vocabulary
from signface.report.colours import colour_of, ink_on
from signface.segmentation.segments import Segments

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure


def draw_timeline(
    descriptors: Descriptors,
    segments: Segments,
    *,
    reference: Segments | None = None,
    title: str | None = None,
    vocabulary: Vocabulary | None = None,
) -> Figure:
    """Draw the velocity and acceleration energies of a take above its segments.

    Parameters
    ----------
    descriptors : Descriptors
        The take.
    segments : Segments
        Automatic segments, labelled or not.
    reference : Segments, optional
        An annotator's segments, drawn below the automatic ones.
    title : str, optional
        The name of the take by default.
    vocabulary : Vocabulary, optional
        Gives the labels their colours; by default that of affect, or one of the labels at hand.

    Returns
    -------
    matplotlib.figure.Figure
        Save it with `save_figure`.

    Examples
    --------
    >>> import signface as sf
    >>> weights = sf.datasets.mini_weights()
    >>> figure = sf.draw_timeline(weights, sf.segment(weights), reference=sf.datasets.mini_reference())
    >>> figure.savefig("timeline.png")
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 3.1 if reference is None else 3.6), layout="constrained")
    draw_timeline_on(figure, descriptors, segments, reference, title, vocabulary)
    return figure


def draw_timeline_on(
    figure: Figure | SubFigure,
    descriptors: Descriptors,
    segments: Segments,
    reference: Segments | None = None,
    title: str | None = None,
    vocabulary: Vocabulary | None = None,
) -> None:
    """Draw the timeline on a figure, or on a part of one; see `draw_timeline`."""
    rows = {"automatic": segments} if reference is None else {"automatic": segments, "reference": reference}
    draw_rows_on(figure, descriptors, rows, title=title, vocabulary=vocabulary)


def draw_rows_on(
    figure: Figure | SubFigure,
    descriptors: Descriptors,
    rows: Mapping[str, Segments],
    *,
    title: str | None = None,
    rate: float | None = None,
    marks: Mapping[str, np.ndarray] | None = None,
    vocabulary: Vocabulary | None = None,
) -> None:
    """Draw the energies of a take above any rows of segments, the first on top.

    Parameters
    ----------
    figure : Figure or SubFigure
    descriptors : Descriptors
    rows : mapping of str to Segments
        What stands beside each row, and its segments; the transitions of the first shade the curves.
    title : str, optional
        The name of the take by default.
    rate : float, optional
        Points of the curves per second, where that is fewer than the take has frames: for pages that hold many.
    marks : mapping of str to (K,) array, optional
        Row to times of boundaries that are pointed out on it (seconds).
    vocabulary : Vocabulary, optional
        As in `draw_timeline`.
    """
    from signface.segmentation.energy import energies

    curves = energies(descriptors)
    step = 1 if rate is None else max(1, round((len(curves.time) - 1) / (curves.time[-1] - curves.time[0]) / rate))
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3, 0.8 * len(rows)])
    above.plot(curves.time[::step], curves.velocity[::step], color="#0a7e8c", lw=1.3, label="velocity energy (1/s)")
    above.plot(
        curves.time[::step],
        curves.time_constant_s * curves.acceleration[::step],
        color="#d97b00",
        lw=1.0,
        label=f"acceleration energy × {curves.time_constant_s:g} s (1/s)",
    )
    first = next(iter(rows.values())).table
    moving = first[first["kind"] == "transition"]
    top = 1.18 * above.get_ylim()[1]  # room for the legend
    if len(moving):
        spans = list(zip(moving["start_s"], moving["end_s"] - moving["start_s"], strict=True))
        above.broken_barh(spans, (0, top), color="#000000", alpha=0.06, lw=0)
    above.set_title(descriptors.name if title is None else title, loc="left", fontsize=11)
    above.set_ylim(0, top)
    above.legend(loc="upper right", fontsize=8, frameon=False, ncols=2)
    if vocabulary is None:
        vocabulary = Vocabulary.holding(
            label for segments in rows.values() if segments.labelled for label in segments.table["label"]
        )
    for position, (name, segments) in enumerate(reversed(list(rows.items()))):
        _draw_segments(below, segments, position, vocabulary)
        times = (marks or {}).get(name, np.zeros(0))
        if len(times):
            below.plot(times, np.full(len(times), position + 0.4), "v", color="#c00000", ms=4.5, mec="white", mew=0.5)
    below.set_yticks(range(len(rows)), list(rows)[::-1])
    below.set_ylim(-0.5, len(rows) - 0.5)
    below.set_xlabel("time (s)")
    below.set_xlim(descriptors.start, descriptors.start + descriptors.duration)
    for axes in (above, below):
        axes.spines[["top", "right"]].set_visible(False)
    below.tick_params(axis="y", length=0)


def _draw_segments(axes: Axes, segments: Segments, position: int, vocabulary: Vocabulary) -> None:
    """One row of coloured boxes; a label is written where its box is wide enough to hold it."""
    table = segments.table
    if not len(table):
        return
    span = table["end_s"].max() - table["start_s"].min()
    width = (table["end_s"] - table["start_s"]).to_numpy(float)
    labels = table["label"].astype(str) if "label" in table else table["kind"].map({"stable": "", "transition": "~"})
    axes.broken_barh(
        list(zip(table["start_s"], width, strict=True)),
        (position - 0.4, 0.8),
        facecolors=[colour_of(label, vocabulary) for label in labels],
        edgecolor="#404040",
        lw=0.5,
    )
    for start, length, label, kind in zip(table["start_s"], width, labels, table["kind"], strict=True):
        if kind == "stable" and length > 0.009 * span * max(1, len(label)):
            ink = ink_on(label, vocabulary)
            axes.text(start + length / 2, position, label, ha="center", va="center", fontsize=8, color=ink)


def save_figure(figure: Figure, path: str | PathLike[str], *, dpi: int = 150) -> None:
    """Write a figure as .png, .svg or .pdf, by the ending of `path`, the same bytes for the same figure.

    Raises
    ------
    SignfaceError
        The ending is none of these, or the folder cannot be written.
    """
    import matplotlib as mpl

    from signface.files import whole_file

    suffix = Path(path).suffix.lower()
    undated = {".png": {"Software": None}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    if suffix not in undated:
        raise SignfaceError("the ending of a figure is .png, .svg or .pdf", file=path)
    with whole_file(path) as temporary, mpl.rc_context({"svg.hashsalt": "signface"}):
        figure.savefig(temporary, dpi=dpi, metadata=undated[suffix])
