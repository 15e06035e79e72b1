"""A table of a study's results: what it shows, how its cells are written, and its text, CSV and LaTeX.

- `StudyTable`: one table.
- `write_cell`: one cell as a reader sees it; `write_p`: a p-value inside a sentence.
- `as_text`, `as_latex`: the table for a terminal and for a paper. CSV keeps the numbers unrounded.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from signface.content import Content

if TYPE_CHECKING:
    import pandas as pd

#: How many decimals each kind of cell has. `p` and `text` have their own rules.
DECIMALS = {"statistic": 3, "effect": 3, "proportion": 3, "mean": 3, "count": 0}


@dataclass(frozen=True, eq=False)
class StudyTable(Content):
    """One table of results.

    Parameters
    ----------
    key : str
        Name of its files.
    title : str
        Its caption.
    frame : pandas.DataFrame
        Its cells, numbers unrounded. Columns are str, or tuples of two str for a header of two lines.
    kinds : dict
        Column to kind of cell: `text`, `p`, or a key of `DECIMALS`. A column that is not named is `text` when it
        holds text, `mean` otherwise.
    reference : str
        The thesis's table of that form ("6.3"), empty where it has none.
    notes : tuple of str
        What a reader must know, below the table.
    """

    key: str
    title: str
    frame: pd.DataFrame
    kinds: dict[str | tuple[str, str], str] = field(default_factory=dict)
    reference: str = ""
    notes: tuple[str, ...] = ()

    def kind(self, column: str | tuple[str, str]) -> str:
        """The kind of a column's cells."""
        if column in self.kinds:
            return self.kinds[column]
        return "mean" if self.frame[column].map(lambda cell: isinstance(cell, float | int)).all() else "text"

    def cells(self) -> list[list[str]]:
        """Every cell as it is shown, row by row."""
        kinds = [self.kind(column) for column in self.frame.columns]
        return [
            [write_cell(cell, kind) for cell, kind in zip(row, kinds)] for row in self.frame.itertuples(index=False)
        ]

    def header(self) -> tuple[list[str], list[str]]:
        """The upper header (empty strings where the table has one line only) and the lower one."""
        pairs = [column if isinstance(column, tuple) else ("", column) for column in self.frame.columns]
        return [above for above, _ in pairs], [below for _, below in pairs]

    def groups(self) -> list[tuple[str, int]]:
        """The upper header, each name with the columns that it spans; empty where the table has one line only."""
        above, _ = self.header()
        if not any(above):
            return []
        # columns without a name above them stand alone
        runs = itertools.groupby(enumerate(above), key=lambda cell: cell[1] or cell[0])
        return [(name if isinstance(name, str) else "", len(list(run))) for name, run in runs]


def write_cell(cell: object, kind: str) -> str:
    """One cell as a reader sees it.

    >>> write_cell(0.0003, "p"), write_cell(0.7245, "p"), write_cell(float("nan"), "mean")
    ('<0.001', '0.725', '–')
    >>> write_cell(-0.25, "effect"), write_cell(82.0, "statistic"), write_cell(29141.5, "statistic")
    ('−0.250', '82', '29141.5')
    """
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "–"
    if kind == "text" or isinstance(cell, str):
        return str(cell)
    number = float(cell)  # type: ignore[arg-type]
    if kind == "p":
        if number < 0.001:
            return "<0.001"
        # the thesis writes 0.0498 so that it does not read 0.050: a fourth decimal where three would touch 0.05
        return f"{number:.4f}" if 0.0495 <= number < 0.0505 else f"{number:.3f}"
    decimals = DECIMALS[kind]
    if kind == "statistic" and (number.is_integer() or abs(number) >= 1000):  # a count of pairs, a sum of ranks
        decimals = 0 if number.is_integer() else 1
    written = f"{number:.{decimals}f}"
    return written.lstrip("-") if float(written) == 0 else written.replace("-", "−")


def write_p(value: float) -> str:
    """A p-value inside a sentence: `p = 0.725`, `p < 0.001`, with spaces that do not break."""
    written = write_cell(float(value), "p")
    return f"p\u00a0<\u00a0{written[1:]}" if written.startswith("<") else f"p\u00a0=\u00a0{written}"


def as_text(table: StudyTable) -> str:
    """The table with aligned columns, for a terminal."""
    above, below = table.header()
    first = [name if name != before else "" for before, name in zip(["", *above], above)]
    rows = [*([first] if any(above) else []), below, *table.cells()]
    widths = [max(len(row[column]) for row in rows) for column in range(len(below))]
    left = [table.kind(column) == "text" for column in table.frame.columns]
    lines = [
        "  ".join(
            cell.ljust(width) if is_left else cell.rjust(width) for cell, width, is_left in zip(row, widths, left)
        )
        for row in rows
    ]
    lines.insert(len(rows) - len(table.frame), "-" * (sum(widths) + 2 * (len(widths) - 1)))
    reference = f" (form of table {table.reference})" if table.reference else ""
    return "\n".join([table.title + reference, *(line.rstrip() for line in lines), *table.notes])


def as_latex(table: StudyTable) -> str:
    """The table as a LaTeX `table` with booktabs' rules; its label is `tab:` and the key."""
    _, below = table.header()
    alignment = "".join("l" if table.kind(column) == "text" else "r" for column in table.frame.columns)
    lines = [r"\begin{table}", r"\centering", rf"\caption{{{_escape(table.title)}}}", rf"\label{{tab:{table.key}}}"]
    lines += [rf"\begin{{tabular}}{{{alignment}}}", r"\toprule"]
    spans = [
        _escape(name) if span == 1 else rf"\multicolumn{{{span}}}{{c}}{{{_escape(name)}}}"
        for name, span in table.groups()
    ]
    if spans:
        lines.append(" & ".join(spans) + r" \\")
    lines += [" & ".join(map(_escape, below)) + r" \\", r"\midrule"]
    lines += [" & ".join(map(_escape, row)) + r" \\" for row in table.cells()]
    lines += [r"\bottomrule", r"\end{tabular}"]
    lines += [rf"\par\smallskip\footnotesize {_escape(note)}" for note in table.notes]
    return "\n".join([*lines, r"\end{table}", ""])


_LATEX = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"$<$",
    ">": r"$>$",
    "χ": r"$\chi$",
    "ρ": r"$\rho$",
    "ε": r"$\varepsilon$",
    "σ": r"$\sigma$",
    "Δ": r"$\Delta$",
    "²": r"$^2$",
    "×": r"$\times$",
    "−": r"$-$",
    "–": "--",
    "≥": r"$\geq$",
    "±": r"$\pm$",
    "\u00a0": "~",
    **{letter: f"$_{digit}$" for digit, letter in enumerate("₀₁₂₃₄₅₆₇₈₉")},
}


def _escape(text: str) -> str:
    """Text that LaTeX prints as it stands."""
    return "".join(_LATEX.get(letter, letter) for letter in text)
