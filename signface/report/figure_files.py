"""Figures as elements of a page and as files for a paper: the same figure gives the same bytes.

- `svg_element`: a figure as one `<svg>` to put into a page, with a description for who cannot see it.
- `png_element`: a figure as one `<img>`, for painted faces, which would be large as lines.
- `save_vector`: the same figure as SVG and PDF files.
"""

from __future__ import annotations

import base64
import html
import io
import re
from pathlib import Path
from typing import TYPE_CHECKING

from signface.files import whole_file
from signface.report.style import styled
from signface.report.timeline import save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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


def png_element(figure: Figure, description: str) -> str:
    """The figure as one image element that holds its PNG.

    Parameters
    ----------
    figure : Figure
    description : str
        What is to be seen, for a screen reader.
    """
    stream = io.BytesIO()
    with styled():
        figure.savefig(stream, format="png", metadata={"Software": None})
    data = base64.b64encode(stream.getvalue()).decode()
    width = round(100 * figure.get_figwidth())  # CSS pixels: the picture is finer than that, for print
    return f'<img alt="{html.escape(description, quote=True)}" width="{width}" src="data:image/png;base64,{data}">'


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
