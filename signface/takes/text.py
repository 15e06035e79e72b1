"""Text files of numbers, as the readers of TRC, TSV and CSV share them.

- `read_text`: a file's text, whatever its encoding.
- `numbers`: cells to a table of floats, quickly, with the line named that does not fit.
- `even_rate`: the rate from a column of times.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from signface.errors import SignfaceError


def read_text(file: Path) -> str:
    """The text of a file: UTF-8 (with or without a mark), UTF-16 with a mark, else Latin-1.

    Raises
    ------
    SignfaceError
        The file cannot be read, is empty, or is binary.
    """
    try:
        content = file.read_bytes()
    except OSError as error:
        raise SignfaceError(f"cannot be read ({error.strerror})", file=file) from error
    if not content.strip():
        raise SignfaceError("the file is empty", file=file, hint="export it again")
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", errors="replace")
    if b"\0" in content:
        raise SignfaceError("is no text file", file=file, hint="export it again")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def numbers(lines: Sequence[str], columns: int, separator: str, file: Path, first_line: int = 1) -> np.ndarray:
    """Lines of cells to a (rows, columns) float64 array; an empty cell is NaN.

    Cells beyond `columns` are left out (many exporters end their lines with a separator). Numbers have a decimal point,
    or a decimal comma where the separator is another sign.

    Parameters
    ----------
    lines : sequence of str
        Without the header; blank ones are skipped.
    columns : int
        How many cells a row has.
    separator : str
        `,`, `;` or tab.
    file : Path
        Named in errors.
    first_line : int
        Number of the first line in the file, for errors.

    Raises
    ------
    SignfaceError
        A row has fewer cells than columns (the last one is often cut short) or cells are words.
    """
    kept = [(number, line) for number, line in enumerate(lines, start=first_line) if line.strip()]
    if not kept:
        raise SignfaceError("the file has no frames, only a header", file=file, hint="export it again")
    for number, line in kept:
        if line.count(separator) < columns - 1:
            cells = line.count(separator) + 1
            raise SignfaceError(
                f"line {number} has {cells} cells instead of {columns}", file=file, hint="the file may be cut short"
            )
    beginning = "".join(line for _, line in kept[:50])
    decimal = "," if separator != "," and "," in beginning and "." not in beginning else "."
    try:
        table = pd.read_csv(
            io.StringIO("\n".join(line for _, line in kept)),
            sep=separator,
            header=None,
            usecols=range(columns),
            names=range(max(line.count(separator) for _, line in kept) + 1),
            decimal=decimal,
            skipinitialspace=True,
            quoting=3,
            na_values=["NaN", "nan", "NULL", "null", "-", "#N/A"],
            low_memory=False,
            engine="c",
        )
        return table.to_numpy(dtype=np.float64)
    except (ValueError, OverflowError, pd.errors.ParserError) as error:
        raise SignfaceError(
            "has cells that are not numbers", file=file, hint="look at the rows below its header"
        ) from error


def even_rate(times: np.ndarray, file: Path) -> float:
    """Frames per second (Hz) from times in seconds that rise evenly.

    Times are often written with three digits, so that 1/120 s comes as 0.008, 0.017: the mean step over the whole
    file is right where single steps are not. Where a whole number is within that rounding, it is the rate; 29.97 Hz
    stays 29.97 Hz in any file long enough to tell.

    Raises
    ------
    SignfaceError
        Fewer than two times, or they do not rise evenly.
    """
    if len(times) < 2:
        raise SignfaceError("has one frame, and a rate needs two", file=file, hint="export more of the recording")
    steps = np.diff(times)
    if not np.isfinite(times).all() or not (steps > 0).all():
        raise SignfaceError("its times do not rise from row to row", file=file, hint="export it again")
    step = float(times[-1] - times[0]) / (len(times) - 1)
    rounding = 0.0005 if np.allclose(times * 1000, np.round(times * 1000), rtol=0, atol=1e-6) else 0.0000005
    if np.abs(steps - step).max() > 0.25 * step + 2 * rounding:
        raise SignfaceError(
            "its times do not rise evenly", file=file, hint="export it at one rate, with empty cells for gaps"
        )
    rate = 1 / step
    unsure = rate * 2 * rounding / float(times[-1] - times[0])
    return float(round(rate)) if abs(rate - round(rate)) <= unsure and round(rate) > 0 else rate
