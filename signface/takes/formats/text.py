"""Text files of numbers, as the readers of TRC, TSV and CSV share them.

- `header_cells`: a header line's cells, and what separates them.
- `read_text`: a file's text, whatever its encoding.
- `TextFile`, `TextRows`: a file whose lines, or rows of numbers, are read in pieces.
- `numbers`: cells to a table of floats, quickly, with the line and the cell named that do not fit.
- `marker_rows`: rows of numbers as a recording.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from signface.errors import SignfaceError
from signface.files import reading
from signface.takes.formats.missing import MISSING
from signface.takes.formats.timing import GAP, Clock
from signface.takes.formats.uneven import even_frames
from signface.takes.formats.units import in_millimetres
from signface.takes.recording import TakeFile
from signface.takes.take import Take

#: Bytes that are looked through at a time for the beginnings of lines, and rows whose times are read at a time.
BLOCK, ROWS = 1 << 20, 16384

#: What a blank line consists of: the signs up to the space.
BLANK = "".join(map(chr, range(33)))


def header_cells(line: str) -> tuple[list[str], str]:
    """The cells of a header line and the separator that it uses (`,`, `;` or tab).

    Examples
    --------
    >>> header_cells("time_s; LBRO_x; LBRO_y")
    (['time_s', 'LBRO_x', 'LBRO_y'], ';')
    """
    separator = max((",", ";", "\t"), key=line.count)
    return [cell.strip() for cell in next(csv.reader(line.splitlines(), delimiter=separator), [])], separator


def number_or_nan(cell: str) -> float:
    """A number of a header, with a decimal point or comma; NaN where it is none.

    Examples
    --------
    >>> number_or_nan("59,94"), number_or_nan("Hz")
    (59.94, nan)
    """
    try:
        return float(cell.replace(",", "."))
    except ValueError:
        return math.nan


def read_text(file: Path) -> str:
    """The text of a file: UTF-8 (with or without a mark), UTF-16 with a mark, else Latin-1.

    Raises
    ------
    SignfaceError
        The file cannot be read, is empty, or is binary.
    """
    with reading(file):
        content = file.read_bytes()
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


class TextFile:
    """A text file whose lines are read in pieces.

    Where each line begins is found in one pass; of the lines themselves only those asked for lie in memory. (A file in
    UTF-16 is held whole, in UTF-8.) Blank lines do not count.

    Attributes
    ----------
    file : Path
    starts : (L + 1,) int64 array
        The byte at which each line begins, and the end of the file.
    line_numbers : (L,) int64 array
        Numbers of the lines in the file, from 1, as editors count them.

    Raises
    ------
    SignfaceError
        The file cannot be read, is empty, or is binary.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self._content: bytes | None = None
        self._newline = b"\n"
        with self._opened() as stream:
            mark = stream.read(3)
        if mark[:2] in (b"\xff\xfe", b"\xfe\xff"):
            self._content, mark = read_text(file).encode("utf-8"), b""
        self.starts, self.line_numbers = self._index(3 if mark == b"\xef\xbb\xbf" else 0)
        if len(self.line_numbers) == 0:
            raise SignfaceError("the file is empty", file=file, hint="export it again")

    def __len__(self) -> int:
        return len(self.line_numbers)

    def _opened(self) -> BinaryIO:
        if self._content is not None:
            return io.BytesIO(self._content)
        with reading(self.file):
            return self.file.open("rb")

    def _index(self, begin: int) -> tuple[np.ndarray, np.ndarray]:
        """The attributes `starts` and `line_numbers`, from the bytes after the first `begin`."""
        starts: list[np.ndarray] = []
        numbers: list[np.ndarray] = []
        start, ink, number, at = begin, 0, 1, begin
        with self._opened() as stream:
            stream.seek(begin)
            while block := stream.read(BLOCK):
                if b"\0" in block:
                    raise SignfaceError("is no text file", file=self.file, hint="export it again")
                if at == begin and b"\n" not in block and b"\r" in block:
                    self._newline = b"\r"
                signs = np.frombuffer(block, dtype=np.uint8)
                ends = np.flatnonzero(signs == self._newline[0])
                seen = np.concatenate(([0], np.cumsum(signs > 32, dtype=np.int64)))
                begins = np.concatenate(([start], at + 1 + ends))  # of the line that was open, and of those after it
                inked = np.diff(seen[np.concatenate(([0], ends, [len(block)]))])
                inked[0] += ink
                filled = inked[:-1] > 0
                starts.append(begins[:-1][filled])
                numbers.append(number + np.flatnonzero(filled))
                start, ink, number, at = int(begins[-1]), int(inked[-1]), number + len(ends), at + len(block)
        if ink:
            starts.append(np.array([start]))
            numbers.append(np.array([number]))
        return np.concatenate([*starts, [at]]).astype(np.int64), np.concatenate([[], *numbers]).astype(np.int64)

    def lines(self, first: int, last: int, step: int = 1) -> list[tuple[int, str]]:
        """Number and text (UTF-8, else Latin-1) of every `step`-th line from `first` to before `last`."""
        wanted = range(first, min(last, len(self)), step)
        if len(wanted) == 0:
            return []
        with self._opened() as stream:
            if step == 1:
                stream.seek(int(self.starts[first]))
                content = stream.read(int(self.starts[wanted.stop] - self.starts[first]))
            else:
                rows = []
                for line in wanted:
                    stream.seek(int(self.starts[line]))
                    rows.append(
                        stream.read(int(self.starts[line + 1] - self.starts[line])).rstrip(b"\r\n") + self._newline
                    )
                content = b"".join(rows)
        try:
            text = content.decode("utf-8")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
        filled = [line.rstrip("\r") for line in text.split(self._newline.decode()) if line.strip(BLANK)]
        return list(zip(self.line_numbers[first : wanted.stop : step].tolist(), filled, strict=True))


class TextRows:
    """The rows of numbers of a text file, from one of its lines on.

    Parameters
    ----------
    text : TextFile
    first : int
        Index of the first row among the lines that are not blank: blank lines do not count in the header either.
    columns, separator
        As for `numbers`.

    Raises
    ------
    SignfaceError
        There is no row.
    """

    def __init__(self, text: TextFile, first: int, columns: int, separator: str | None) -> None:
        self.text, self.first, self.columns, self.separator = text, first, columns, _separator(separator)
        if len(text) <= first:
            raise SignfaceError("the file has no frames, only a header", file=text.file, hint="export it again")
        self.decimal = _decimal(text.lines(first, first + 50), self.separator)

    def __len__(self) -> int:
        return len(self.text) - self.first

    def values(self, begin: int, end: int, step: int = 1) -> np.ndarray:
        """(K, columns) float64 array of every `step`-th row from `begin` to before `end`; see `numbers`."""
        lines = self.text.lines(self.first + begin, self.first + end, step)
        return numbers(lines, self.columns, self.separator, self.text.file, decimal=self.decimal)

    def column(self, number: int) -> np.ndarray:
        """One column of all rows.

        Raises
        ------
        SignfaceError
            A row has fewer cells than columns, or a cell of the column is no number.
        """
        values: list[float] = []
        for begin in range(self.first, len(self.text), ROWS):
            lines = self.text.lines(begin, begin + ROWS)
            _check_cells(lines, self.columns, self.separator, self.text.file)
            for line_number, line in lines:
                cell = line.split(self.separator, number + 1)[number].strip()
                try:
                    values.append(float(cell.replace(self.decimal, ".") or "nan"))
                except ValueError as error:
                    raise _no_number(line_number, cell, self.text.file) from error
        return np.array(values)


def _separator(separator: str | None) -> str | None:
    """A space stands for any white space, as None does."""
    return None if separator == " " else separator


def _decimal(lines: Sequence[tuple[int, str]], separator: str | None) -> str:
    """The decimal sign: a comma where lines have some that separate nothing, and no point."""
    beginning = "".join(line for _, line in lines[:50])
    return "," if separator != "," and "," in beginning and "." not in beginning else "."


def _count(line: str, separator: str | None) -> int:
    return len(line.split()) if separator is None else line.count(separator) + 1


def _check_cells(lines: Sequence[tuple[int, str]], columns: int, separator: str | None, file: Path) -> None:
    for number, line in lines:
        cells = _count(line, separator)
        if cells < columns:
            raise SignfaceError(
                f"line {number} has {cells} cells instead of {columns}", file=file, hint="the file may be cut short"
            )
        if cells > columns and any(cell.strip() for cell in line.split(separator)[columns:]):
            raise SignfaceError(
                f"line {number} has {cells} cells instead of {columns}",
                file=file,
                hint="export it again: its header and its rows disagree",
            )


def _no_number(line: int, cell: str, file: Path) -> SignfaceError:
    return SignfaceError(f"line {line} has a cell that is no number: {cell[:20]!r}", file=file, hint="correct it")


def numbers(
    lines: Sequence[tuple[int, str]], columns: int, separator: str | None, file: Path, *, decimal: str | None = None
) -> np.ndarray:
    """Lines of cells to a (rows, columns) float64 array; an empty cell, `-`, `nan` or `null` is NaN.

    Empty cells beyond `columns` are left out (many exporters end their lines with a separator). Numbers have a decimal
    point, or a decimal comma where the separator is another sign.

    Parameters
    ----------
    lines : sequence of (int, str)
        Number in the file, for errors, and text of each line below the header; none blank.
    columns : int
        How many cells a row has.
    separator : str, optional
        `,`, `;` or tab; a space or None for any white space, also at the ends of a line.
    file : Path
        Named in errors.
    decimal : str, optional
        The decimal sign, where other lines than these have told it.

    Raises
    ------
    SignfaceError
        A row has fewer cells than columns (the last one is often cut short) or more, or a cell is a word; the message
        names the line.

    Examples
    --------
    >>> numbers([(3, " 1.5  -  2 ")], 3, None, Path("smile.dots"))
    array([[1.5, nan, 2. ]])
    >>> numbers([(3, "1.5 high 2")], 3, None, Path("smile.dots"))
    Traceback (most recent call last):
    signface.errors.SignfaceError: smile.dots: line 3 has a cell that is no number: 'high'. Correct it
    """
    import pandas as pd

    separator = _separator(separator)
    _check_cells(lines, columns, separator, file)
    decimal = _decimal(lines, separator) if decimal is None else decimal
    try:
        table = pd.read_csv(
            io.StringIO("\n".join(line for _, line in lines)),
            sep=separator or r"\s+",
            header=None,
            usecols=range(columns),
            names=range(max(_count(line, separator) for _, line in lines)),
            decimal=decimal,
            skipinitialspace=True,
            quoting=3,
            na_values=MISSING,
            keep_default_na=False,
            low_memory=False,
            engine="c",
        )
        return table.to_numpy(dtype=np.float64)
    except (ValueError, OverflowError, pd.errors.ParserError) as error:
        for number, line in lines:
            for cell in map(str.strip, line.split(separator)[:columns]):
                try:
                    float("nan" if cell in MISSING else cell.replace(decimal, "."))
                except ValueError:
                    raise _no_number(number, cell, file) from error
        raise SignfaceError("has cells that are not numbers", file=file, hint="export it again") from error


def marker_rows(
    rows: TextRows,
    columns: np.ndarray,
    labels: Sequence[str],
    rate: float | Clock,
    *,
    units: str | None,
    unit: str | None,
    start: float = 0.0,
    history: tuple[str, ...],
) -> TakeFile | Take:
    """Rows of numbers as a recording.

    Parameters
    ----------
    rows : TextRows
        A row for each frame. A marker of which one coordinate is missing is missing.
    columns : (M, 3) int array
        Columns of x, y and z of each marker.
    labels, start, history
        As of `Take`; a note of the unit joins the history as its second entry.
    rate : float or Clock
        Frames per second (Hz), or what a column of times tells (`signface.takes.formats.timing`): it brings the start
        and its notes, and rows that do not come evenly are put on an even clock, in memory.
    units, unit : str, optional
        As `in_file` and `given` of `signface.takes.formats.units.unit_factor`.

    Raises
    ------
    SignfaceError
        A unit is not one of length.
    """
    file = rows.text.file

    def raw(begin: int, end: int, step: int = 1) -> np.ndarray:
        values = rows.values(begin, end, step)
        return values[:, columns.ravel()].reshape(len(values), len(columns), 3)

    clock = rate if isinstance(rate, Clock) else Clock(rate, start)
    read, note = in_millimetres(raw, len(rows), units, unit, markers=len(labels), file=file)
    history = (history[0], note, *clock.notes, *history[1:])
    if clock.times is None:
        return TakeFile(tuple(labels), clock.rate, len(rows), read, clock.start, file.stem, history)
    positions, _ = even_frames(clock.times, read(0, len(rows), 1)[clock.rows], clock.rate, longest_s=GAP / clock.rate)
    return Take(positions, tuple(labels), clock.rate, clock.start, file.stem, history)
