"""A take at a glance: its energy curves above its labelled segments (Reverdy 2019, figure 4.3).

- `draw_timeline`: the figure; `draw_timeline_on`: on a part of another.
- `save_figure`: any figure to a file, whole or not at all.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.report.colours import colour_of, ink_on
from signface.segment.segments import Segments

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure


def draw_timeline(
    descriptors: Descriptors,
    segments: Segments,
    *,
    reference: Segments | None = None,
    title: str | None = None,
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

    Returns
    -------
    matplotlib.figure.Figure
        Save it with `save_figure`.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 3.1 if reference is None else 3.6), layout="constrained")
    draw_timeline_on(figure, descriptors, segments, reference, title)
    return figure


def draw_timeline_on(
    figure: Figure | SubFigure,
    descriptors: Descriptors,
    segments: Segments,
    reference: Segments | None = None,
    title: str | None = None,
) -> None:
    """Draw the timeline on a figure, or on a part of one; see `draw_timeline`."""
    from signface.segment.energy import energies

    rows = [("automatic", segments)] if reference is None else [("automatic", segments), ("reference", reference)]
    curves = energies(descriptors)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3, 0.8 * len(rows)])
    above.plot(curves.time, curves.velocity, color="#0a7e8c", lw=1.3, label="velocity energy (1/s)")
    above.plot(
        curves.time,
        curves.time_constant_s * curves.acceleration,
        color="#d97b00",
        lw=1.0,
        label=f"acceleration energy × {curves.time_constant_s:g} s (1/s)",
    )
    for row in segments.table.itertuples():
        if row.kind == "transition":
            above.axvspan(row.start_s, row.end_s, color="#000000", alpha=0.06, lw=0)
    above.set_title(title or descriptors.name, loc="left", fontsize=11)
    above.set_ylim(0, 1.18 * above.get_ylim()[1])  # room for the legend
    above.legend(loc="upper right", fontsize=8, frameon=False, ncols=2)
    for position, (_, row_segments) in enumerate(reversed(rows)):
        _draw_segments(below, row_segments, position)
    below.set_yticks(range(len(rows)), [name for name, _ in reversed(rows)])
    below.set_ylim(-0.5, len(rows) - 0.5)
    below.set_xlabel("time (s)")
    below.set_xlim(descriptors.start, descriptors.start + descriptors.duration)
    for axes in (above, below):
        axes.spines[["top", "right"]].set_visible(False)
    below.tick_params(axis="y", length=0)


def _draw_segments(axes: Axes, segments: Segments, position: int) -> None:
    """One row of coloured boxes; a label is written where its box is wide enough to hold it."""
    table = segments.table
    span = table["end_s"].max() - table["start_s"].min() if len(table) else 1.0
    for row in table.itertuples():
        label = getattr(row, "label", "" if row.kind == "stable" else "~")
        width = row.end_s - row.start_s
        axes.barh(
            position, width, left=row.start_s, height=0.8, color=colour_of(str(label)), edgecolor="#404040", lw=0.5
        )
        if row.kind == "stable" and width > 0.009 * span * max(1, len(str(label))):
            axes.text(
                row.start_s + width / 2, position, label, ha="center", va="center", fontsize=8, color=ink_on(label)
            )


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
