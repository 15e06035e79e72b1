"""Figures as elements of a page and as files for a paper: the same figure gives the same bytes.

- `STYLE`, `styled`: the type and the lines that the figures of a report share.
- `svg_element`: a figure as one `<svg>` to put into a page, with a description for who cannot see it.
- `save_vector`: the same figure as SVG and PDF files.
"""

from __future__ import annotations

import html
import io
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from signface.files import whole_file
from signface.report.timeline import save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Okabe and Ito's colours without yellow, told apart by colour-blind readers, and marks that differ in print.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#444444")
MARKS = ("o", "s", "D", "^", "v", "P", "X")

STYLE: dict[Any, Any] = {
    "font.size": 9,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial"],  # the first one lays out; others are nearly as wide
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#777777",
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.axisbelow": True,
    "grid.color": "#e6e6e6",
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "hatch.linewidth": 0.6,
    "legend.frameon": False,
    "path.simplify": True,
    "pdf.fonttype": 42,  # letters that a paper's publisher can embed and search
    "svg.fonttype": "none",  # letters stay letters: they can be searched, and read aloud
    "svg.hashsalt": "signface",
    "text.parse_math": False,  # a take's name may hold a dollar
}


def styled():  # type: ignore[no-untyped-def]  # a context manager of matplotlib's
    """The style of the figures, for a `with` around drawing and around writing."""
    import matplotlib

    return matplotlib.rc_context(STYLE)


def svg_element(figure: Figure, name: str, description: str) -> str:
    """The figure as one SVG element.

    Parameters
    ----------
    figure : Figure
    name : str
        Unique in the page: the identifiers inside the picture begin with it, so that pictures do not paint with each
        other's parts.
    description : str
        What is to be seen, for a screen reader.
    """
    stream = io.StringIO()
    with styled():
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
        figure.set_layout_engine("none")  # what is laid out stays as it is, and is not laid out again
    text = stream.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.S)
    text = re.sub(r'\bid="([^"]+)"', rf'id="{name}-\1"', text)
    text = re.sub(r'(href="#|url\(#)', rf"\g<1>{name}-", text)
    text = re.sub(r"\n\s*", "\n", text)
    text = re.sub(r"(?<=[\s\"(,-])(\d+\.\d\d)\d+", r"\1", text)  # a hundredth of a point is finer than any printer
    label = html.escape(description, quote=True)
    return text.replace("<svg ", f'<svg role="img" aria-label="{label}" ', 1)


def save_vector(figure: Figure, svg: str, folder: Path, name: str) -> None:
    """Write `name.svg` and `name.pdf` into a folder.

    Parameters
    ----------
    figure : Figure
    svg : str
        What `svg_element` made of it: a figure is laid out and drawn once.
    folder : Path
    name : str
    """
    with whole_file(folder / f"{name}.svg") as temporary:
        temporary.write_text(f'<?xml version="1.0" encoding="utf-8"?>\n{svg}', encoding="utf-8")
    with styled():
        save_figure(figure, folder / f"{name}.pdf")
