"""The pages of reports: one HTML file each, which needs nothing else.

- `render_page`: a template of `templates/` with its values; `templates/base.html.j2` is the ground of all of them.
- `page_table`: a DataFrame with its caption, its cells spelt out, as the templates take it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

#: Text longer than this is broken into lines in a table's cell.
LONG = 40


def render_page(template: str, **values: Any) -> str:
    """A page as text: every value is escaped, a name that is not given is an error.

    Parameters
    ----------
    template : str
        Name of a file in `templates/`.
    values :
        What it names.
    """
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).with_name("templates")),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(**values)


def page_table(
    frame: pd.DataFrame,
    key: str,
    caption: str,
    *,
    notes: Sequence[str] = (),
    folded: bool = False,
    decimals: Mapping[str, int] | int = 2,
    strong: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """What the macro `table` of a template shows.

    Parameters
    ----------
    frame : DataFrame
    key : str
        Unique in the page.
    caption : str
    notes : sequence of str
        Below the table.
    folded : bool
        Shown when asked for.
    decimals : int, or mapping of str to int
        Digits after the point of every column, or of some columns and 2 of the others.
    strong : mapping, optional
        Column and value of the rows that are set off.
    """
    classes = ["" if pd.api.types.is_numeric_dtype(frame[column]) else "text" for column in frame.columns]
    digits = [decimals if isinstance(decimals, int) else decimals.get(str(name), 2) for name in frame.columns]
    rows = []
    for row in frame.itertuples(index=False):
        cells = [
            (text := spelt(value, places), "text long" if kind and len(text) > LONG else kind)
            for value, places, kind in zip(row, digits, classes, strict=True)
        ]
        named = dict(zip(frame.columns, row, strict=True))
        rows.append({"cells": cells, "strong": bool(strong) and all(named[k] == v for k, v in (strong or {}).items())})
    return {
        "key": key,
        "caption": caption,
        "reference": "",
        "groups": [],
        "columns": list(zip(map(str, frame.columns), classes, strict=True)),
        "rows": rows,
        "notes": list(notes),
        "folded": folded,
    }


def spelt(value: object, places: int = 2) -> str:
    """A value as it stands in a cell: a dash for nothing, a typographer's minus.

    Examples
    --------
    >>> spelt(None), spelt(0.125), spelt(-0.5, 1), spelt(12), spelt("N")
    ('–', '0.12', '−0.5', '12', 'N')
    """
    if value is None or (isinstance(value, float) and pd.isna(value)) or value is pd.NA:
        return "–"
    if isinstance(value, float):
        digits = f"{value:.{places}f}"
        return digits.replace("-", "−") if float(digits) else digits.replace("-", "")
    return str(value)
