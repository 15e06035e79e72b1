"""Tables as the pages' templates take them.

- `page_table`: a DataFrame with its caption, its cells spelt out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd


def page_table(
    frame: pd.DataFrame,
    key: str,
    caption: str,
    *,
    notes: Sequence[str] = (),
    folded: bool = False,
    decimals: Mapping[str, int] | None = None,
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
    decimals : mapping of str to int, optional
        Digits after the point of some columns; 2 otherwise.
    strong : mapping, optional
        Column and value of the rows that are set off.
    """
    text = [not pd.api.types.is_numeric_dtype(frame[column]) for column in frame.columns]
    digits = [(decimals or {}).get(str(column), 2) for column in frame.columns]
    rows = []
    for row in frame.itertuples(index=False):
        cells = [spelt(value, places) for value, places in zip(row, digits, strict=True)]
        named = dict(zip(frame.columns, row, strict=True))
        rows.append({"cells": cells, "strong": bool(strong) and all(named[k] == v for k, v in (strong or {}).items())})
    return {
        "key": key,
        "caption": caption,
        "columns": list(zip(map(str, frame.columns), text, strict=True)),
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
        shown = f"{value:.{places}f}"
        return shown.replace("-", "−") if float(shown) else shown.replace("-", "")
    return str(value)
