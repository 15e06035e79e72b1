"""A table of text as spreadsheets and experiments write it, with its row numbers.

- `read_table`: the cells as text; blank rows are left out, and each row keeps the number it has in the file.
- `numbered`: the same of rows that were read already.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import pandas as pd

from signface.errors import SignfaceError

#: What the index of row numbers is called.
ROW = "row"

_MARKS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16", b"\xef\xbb\xbf": "utf-8-sig"}


def read_table(path: str | PathLike[str], *, hint: str = "save it as UTF-8 csv with a header") -> pd.DataFrame:
    """Read a table separated by commas, semicolons or tabs.

    Parameters
    ----------
    path : path
        UTF-8, or UTF-16 with its mark. Its first row that is not blank names the columns.
    hint : str
        What to do about a file that is no such table.

    Returns
    -------
    pandas.DataFrame
        Text without blanks at its ends, empty where a row is short. The index are the rows' numbers as a spreadsheet
        shows them. Rows of empty cells are left out.

    Raises
    ------
    SignfaceError
        No such file, no text, no table; a column named twice; a row with more cells than the header names columns.
    """
    try:
        content = Path(path).read_bytes()
    except FileNotFoundError as error:
        raise SignfaceError("no such file", file=path, hint=hint) from error
    except OSError as error:
        raise SignfaceError(f"cannot be read ({error.strerror})", file=path) from error
    try:
        text = content.decode(_MARKS.get(content[:2], _MARKS.get(content[:3], "utf-8")))
    except UnicodeDecodeError as error:
        raise SignfaceError(f"cannot be read as a csv ({error.reason})", file=path, hint=hint) from error
    if "\0" in text:
        raise SignfaceError("is no table: it holds bytes that are no text", file=path, hint=hint)
    first = next((line for line in text.splitlines() if line.strip(" ,;\t")), "")
    separator = max(",;\t", key=first.count)
    if not first.count(separator):
        raise SignfaceError("is no table" if first else "is empty", file=path, hint=hint)
    try:
        rows = list(csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=False))
    except csv.Error as error:
        raise SignfaceError(f"is no table ({error})", file=path, hint=hint) from error
    return numbered(rows, path)


def numbered(rows: Sequence[Sequence[str]], name: str | PathLike[str]) -> pd.DataFrame:
    """Rows of text as a table; the first that is not blank names the columns. Errors are those of `read_table`."""
    cells = [(number, [cell.strip() for cell in row]) for number, row in enumerate(rows, start=1)]
    cells = [(number, row) for number, row in cells if any(row)]
    header = cells[0][1] if cells else []
    while header and not header[-1]:
        header = header[:-1]
    twice = sorted({column for column in header if column and header.count(column) > 1})
    if twice:
        raise SignfaceError(
            f"two columns are named {', '.join(twice)}", file=name, hint="keep one of them, or name them differently"
        )
    long = [number for number, row in cells if any(row[len(header) :])]
    if long:
        more = f" and {len(long) - 1} more rows" if len(long) > 1 else ""
        raise SignfaceError(
            f"row {long[0]}{more} holds more cells than the header names columns ({len(header)})",
            file=name,
            hint="put quotes around cells that hold the separator",
        )
    filled = [[*row, *[""] * len(header)][: len(header)] for _number, row in cells[1:]]
    index = pd.Index([number for number, _row in cells[1:]], name=ROW, dtype=int)
    table = pd.DataFrame(filled, columns=header, index=index, dtype=object)
    return table.loc[:, [bool(column) for column in header]]
