"""`Segments`: stretches of time, stable or transition, later with a label and a confidence.

- `write_segments`, `read_segments`: to and from a table on disk.
- `value_at`: what a table says at some times.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd

from signface.content import Content, Summary
from signface.errors import SignfaceError
from signface.files import whole_file

KINDS = ("stable", "transition")

#: Gaps between annotations shorter than this say nothing (s).
LEAST_GAP_S = 0.04


@dataclass(frozen=True, eq=False, repr=False)
class Segments(Summary, Content):
    """A table of segments in time order, without overlap.

    Parameters
    ----------
    table : DataFrame
        Columns `start_s`, `end_s` (seconds, start < end) and `kind` (`stable` or `transition`); after labelling
        also `label` and `confidence` (0 to 1).
    name : str
        Name of the take.
    history : tuple of str
        What was done, oldest first.

    See Also
    --------
    signface.segment, signface.annotate : where they come from.

    Examples
    --------
    >>> import signface as sf
    >>> segments = sf.datasets.mini_reference()
    >>> segments.labelled, len(segments.table)
    (True, 5)
    >>> segments.table.columns.tolist()
    ['start_s', 'end_s', 'kind', 'label', 'intensity']
    """

    table: pd.DataFrame
    name: str = "take"
    history: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        table = self.table.reset_index(drop=True)
        missing = [column for column in ("start_s", "end_s", "kind") if column not in table.columns]
        if missing:
            raise SignfaceError(f"{self.name}: a table of segments needs the columns {', '.join(missing)}")
        start, end = table["start_s"].to_numpy(float), table["end_s"].to_numpy(float)
        if not (np.isfinite(start).all() and np.isfinite(end).all() and (start < end).all()):
            raise SignfaceError(f"{self.name}: every segment must end after it starts")
        if (start[1:] < end[:-1] - 1e-9).any():
            raise SignfaceError(f"{self.name}: segments overlap or are out of order")
        unknown = sorted(set(table["kind"]) - set(KINDS))
        if unknown:
            raise SignfaceError(f"{self.name}: unknown kind of segment: {', '.join(map(str, unknown))}")
        self._hold(table=table, history=tuple(self.history))

    def _sizes(self) -> str:
        stable = int((self.table["kind"] == "stable").sum())
        return f"{stable} stable, {len(self) - stable} transitions, {'with' if self.labelled else 'no'} labels"

    def __len__(self) -> int:
        return len(self.table)

    @property
    def labelled(self) -> bool:
        """Whether the segments carry labels."""
        return "label" in self.table.columns

    def to_frame(self) -> pd.DataFrame:
        """The table, free to be changed."""
        return self.table.copy()

    def between(self, start_s: float, end_s: float) -> Segments:
        """The segments that reach into a stretch of time, cut to it.

        Parameters
        ----------
        start_s, end_s : float
            Seconds; `-math.inf` and `math.inf` leave an end as it is.

        Raises
        ------
        SignfaceError
            No segment reaches into it.

        See Also
        --------
        signface.Descriptors.between : the same frames.

        Examples
        --------
        >>> import pandas as pd
        >>> import signface as sf
        >>> table = pd.DataFrame({"start_s": [0.0, 1.0], "end_s": [1.0, 3.0], "kind": ["stable", "transition"]})
        >>> sf.Segments(table).between(0.5, 2.0).table
           start_s  end_s        kind
        0      0.5    1.0      stable
        1      1.0    2.0  transition
        """
        cut = self.table.assign(
            start_s=self.table["start_s"].clip(lower=start_s), end_s=self.table["end_s"].clip(upper=end_s)
        )
        cut = cut[cut["end_s"] - cut["start_s"] > 1e-9]
        if cut.empty:
            raise SignfaceError(f"{self.name}: no segment lies between {start_s:g} and {end_s:g} s")
        return self.changed(f"between {start_s:g} and {end_s:g} s", cut)

    def filled(self, start: float, end: float, label: str) -> Segments:
        """Labelled segments with stable ones of `label` wherever there are none from `start` to `end` (seconds).

        Gaps shorter than `LEAST_GAP_S` stay: they come from the hand on the mouse.
        """
        edges = [start, *self.table["end_s"]], [*self.table["start_s"], end]
        gaps = [(a, b, "stable", label) for a, b in zip(*edges, strict=True) if b - a >= LEAST_GAP_S]
        columns = ["start_s", "end_s", "kind", "label"]
        tables = [self.table, pd.DataFrame(gaps, columns=columns)] if gaps else [self.table]
        table = pd.concat(tables, ignore_index=True).sort_values("start_s", kind="stable", ignore_index=True)
        return self.changed(f"filled with {label}", table)

    def changed(self, operation: str, table: pd.DataFrame) -> Segments:
        """A copy with another table and `operation` appended to the history."""
        return Segments(table, name=self.name, history=(*self.history, operation))


def write_segments(segments: Segments, path: str | PathLike[str]) -> None:
    """Write the table as .csv, times to the tenth of a millisecond.

    See Also
    --------
    signface.read_segments : the way back.

    Examples
    --------
    >>> import signface as sf
    >>> sf.write_segments(sf.datasets.mini_reference(), "segments.csv")
    >>> open("segments.csv").readline().strip()
    'start_s,end_s,kind,label,intensity'
    """
    if Path(path).suffix.lower() != ".csv":
        raise SignfaceError("segments are written as .csv", file=path)
    with whole_file(path) as temporary:
        segments.table.to_csv(temporary, index=False, float_format="%.4f")


def read_segments(path: str | PathLike[str]) -> Segments:
    """Read a table written by `write_segments`.

    Raises
    ------
    SignfaceError
        The file is missing or is no table of segments.

    See Also
    --------
    signface.write_segments : the way to disk.

    Examples
    --------
    >>> import signface as sf
    >>> sf.write_segments(sf.datasets.mini_reference(), "segments.csv")
    >>> sf.read_segments("segments.csv").table["label"].tolist()
    ['N', 'ND', 'D', 'DN', 'N']
    """
    file = Path(path)
    if not file.is_file():
        raise SignfaceError("no such file", file=file)
    try:
        table = pd.read_csv(file)
    except (ValueError, pd.errors.ParserError, pd.errors.EmptyDataError) as error:
        raise SignfaceError("cannot be read as a table of segments", file=file) from error
    return Segments(table, name=file.stem, history=(f"read_segments {file.name}",))


def value_at(table: pd.DataFrame, column: str, times: np.ndarray) -> np.ndarray:
    """(K,) value of a column of a table of segments at some times; an empty string where no segment is.

    Parameters
    ----------
    table : DataFrame
        `start_s`, `end_s` and the column, in time order, without overlap.
    column : str
    times : (K,) array of seconds
    """
    if table.empty:
        return np.full(len(times), "", dtype=object)
    row = np.searchsorted(table["start_s"].to_numpy(float), times, side="right") - 1
    inside = (row >= 0) & (times < table["end_s"].to_numpy(float)[row.clip(0)])
    return np.where(inside, table[column].to_numpy(object)[row.clip(0)], "")
