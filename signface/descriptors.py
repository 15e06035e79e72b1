"""`Descriptors`: blendshape weights in time, the object that everything after the solve works on.

It stands at the top of the package because the rooms on both sides of it (solve, and segment to render) share it.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from signface.errors import SignfaceError
from signface.files import whole_file

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

    from signface.solve_settings import SolveSettings


@dataclass(frozen=True)
class Descriptors:
    """Blendshape weights of a take.

    Parameters
    ----------
    weights : (F, N) float64 array
        Weight of each base, 0 at rest and 1 fully active. NaN where a frame could not be solved.
    names : (N,) tuple of str
        Names of the bases, as in the face model.
    rate : float
        Frames per second (Hz).
    start : float
        Time of frame 0 in seconds.
    residual : (F,) float64 array, optional
        Root mean square distance between adapted markers and the solved face, in millimetres. NaN when unknown
        (weights that came straight from a phone).
    head : (F, 4, 4) float64 array, optional
        Pose of the head relative to its neutral frame: maps a point of the neutral head to its place in the
        recording, millimetres. The identity when unknown.
    name : str
        Name of the take.
    history : tuple of str
        What was done, oldest first.
    deviation : (F, N) float64 array, optional
        Standard deviation of each weight; NaN where the markers say nothing. None when it was not asked for.
    settings : SolveSettings, optional
        How the weights were solved; None where that is not known, or nothing was solved.
    """

    weights: np.ndarray
    names: tuple[str, ...]
    rate: float
    start: float = 0.0
    residual: np.ndarray | None = None
    head: np.ndarray | None = None
    name: str = "take"
    history: tuple[str, ...] = field(default=())
    deviation: np.ndarray | None = None
    settings: SolveSettings | None = None

    def __post_init__(self) -> None:
        weights = np.array(self.weights, dtype=np.float64)
        names = tuple(str(name) for name in self.names)
        if weights.ndim != 2 or weights.shape[1] != len(names):
            raise SignfaceError(f"weights of shape {weights.shape} do not match {len(names)} base names")
        if len(set(names)) != len(names):
            raise SignfaceError("base names are repeated")
        if not (np.isfinite(self.rate) and self.rate > 0):
            raise SignfaceError(f"the rate must be positive, not {self.rate}")
        frames = weights.shape[0]
        residual = np.full(frames, np.nan) if self.residual is None else np.array(self.residual, dtype=np.float64)
        head = np.tile(np.eye(4), (frames, 1, 1)) if self.head is None else np.array(self.head, dtype=np.float64)
        if residual.shape != (frames,):
            raise SignfaceError(f"residual of shape {residual.shape} does not match {frames} frames")
        if head.shape != (frames, 4, 4):
            raise SignfaceError(f"head poses of shape {head.shape} do not match {frames} frames")
        if self.deviation is not None:
            deviation = np.array(self.deviation, dtype=np.float64)
            if deviation.shape != weights.shape:
                raise SignfaceError(f"deviations of shape {deviation.shape} do not match weights of {weights.shape}")
            deviation.setflags(write=False)
            object.__setattr__(self, "deviation", deviation)
        for array in (weights, residual, head):
            array.setflags(write=False)
        object.__setattr__(self, "weights", weights)
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "rate", float(self.rate))
        object.__setattr__(self, "start", float(self.start))
        object.__setattr__(self, "residual", residual)
        object.__setattr__(self, "head", head)
        object.__setattr__(self, "history", tuple(self.history))

    @property
    def n_frames(self) -> int:
        """Number of frames F."""
        return self.weights.shape[0]

    @property
    def duration(self) -> float:
        """Duration in seconds: frames over rate."""
        return self.n_frames / self.rate

    @property
    def time(self) -> np.ndarray:
        """(F,) time of each frame in seconds."""
        return self.start + np.arange(self.n_frames) / self.rate

    def weight(self, name: str) -> np.ndarray:
        """(F,) weights of one base, by name.

        Raises
        ------
        SignfaceError
            There is no base of that name.
        """
        return self.weights[:, self._column(name)]

    def on(self, bases: Sequence[str]) -> Descriptors:
        """The take with these bases only, in this order; standard deviations are left behind.

        Raises
        ------
        SignfaceError
            There is no base of a name.
        """
        if self.names == tuple(bases):
            return self
        columns = [self._column(name) for name in bases]
        return replace(self, weights=self.weights[:, columns], names=tuple(bases), deviation=None)

    def _column(self, name: str) -> int:
        if name not in self.names:
            raise SignfaceError(f"{self.name}: no base named {name}", hint=f"the bases are {', '.join(self.names)}")
        return self.names.index(name)

    def changed(self, operation: str, **fields: object) -> Descriptors:
        """A copy with some fields replaced and `operation` appended to its history."""
        return replace(self, history=(*self.history, operation), **fields)  # type: ignore[arg-type]

    def table(self) -> pd.DataFrame:
        """The columns of the weights file: `time_s`, one per base, `residual_mm`."""
        import pandas as pd

        table = pd.DataFrame(self.weights, columns=list(self.names))
        table.insert(0, "time_s", self.time)
        table["residual_mm"] = self.residual
        return table


class WeightsWriter:
    """A weights file written piece by piece: `time_s`, one column per base and `residual_mm`.

    As a context manager it appends to a temporary file, which takes the place of `path` when the block ends well and
    vanishes when it does not. The bytes depend on the frames, not on how they come in pieces, but for the groups of
    rows of a .parquet.

    Parameters
    ----------
    path : path
        .csv or .parquet.

    Raises
    ------
    SignfaceError
        The ending is neither, or the folder cannot be written.

    Examples
    --------
    >>> with WeightsWriter("weights.csv") as writer:  # doctest: +SKIP
    ...     for piece in solve_pieces(recording, face, layout):
    ...         writer.append(piece)
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        if Path(path).suffix.lower() not in (".csv", ".parquet"):
            raise SignfaceError("the ending of a weights file is .csv or .parquet", file=path)
        self.path, self.frames, self._begun = Path(path), 0, False
        self._names: tuple[str, ...] = ()
        self._start = self._rate = 0.0
        self._open = contextlib.ExitStack()

    def __enter__(self) -> WeightsWriter:
        self._temporary = self._open.enter_context(whole_file(self.path))
        return self

    def __exit__(self, kind: Any, error: Any, trace: Any) -> bool | None:
        if kind is None and not self._begun:
            nothing = SignfaceError("there are no weights to write", file=self.path)
            self._open.__exit__(SignfaceError, nothing, None)
            raise nothing
        return self._open.__exit__(kind, error, trace)

    def append(self, piece: Descriptors) -> None:
        """Write the frames that follow those before.

        Raises
        ------
        SignfaceError
            The piece has other bases than those before.
        """
        import pyarrow as pa

        if not self._begun:
            self._names, self._start, self._rate = piece.names, piece.start, piece.rate
            self._begin()
        elif piece.names != self._names:
            raise SignfaceError("the pieces of a take have different bases", file=self.path)
        time = self._start + np.arange(self.frames, self.frames + piece.n_frames) / self._rate
        columns = [time, *piece.weights.T, piece.residual]
        if self.path.suffix.lower() == ".csv":
            # A rate is recovered from the times: a microsecond's rounding would show in a take of few frames.
            columns = [time.round(9), *(column.round(6) for column in columns[1:])]
        arrays = [_arrow(np.ascontiguousarray(column)) for column in columns]
        self._writer.write_table(pa.Table.from_arrays(arrays, schema=self._schema))
        self.frames += piece.n_frames

    def _begin(self) -> None:
        import pyarrow as pa

        self._begun = True
        names = ["time_s", *self._names, "residual_mm"]
        self._schema = pa.schema([(name, pa.float64()) for name in names])
        if self.path.suffix.lower() == ".csv":
            from pyarrow import csv

            file = self._open.enter_context(self._temporary.open("wb"))
            file.write((",".join(names) + "\n").encode())  # Arrow would put the names in quotes
            options = csv.WriteOptions(include_header=False)
            self._writer: Any = self._open.enter_context(csv.CSVWriter(file, self._schema, write_options=options))
        else:
            from pyarrow import parquet

            self._writer = self._open.enter_context(parquet.ParquetWriter(self._temporary, self._schema))


def _arrow(column: np.ndarray) -> pa.Array:
    """A column for Arrow, empty where it is NaN (`pa.array` would import pandas, a third of a second)."""
    import pyarrow as pa

    known = np.packbits(~np.isnan(column), bitorder="little")
    return pa.Array.from_buffers(pa.float64(), len(column), [pa.py_buffer(known), pa.py_buffer(column)])


def write_weights(descriptors: Descriptors, path: str | PathLike[str]) -> None:
    """Write `time_s`, one column per base and `residual_mm` as .csv or .parquet, by the ending of `path`.

    Raises
    ------
    SignfaceError
        The ending is neither, or the folder cannot be written.
    """
    with WeightsWriter(path) as writer:
        writer.append(descriptors)


def is_weights_table(columns: list[str]) -> bool:
    """Whether the columns of a table are those of a weights file (`time_s`, bases, `residual_mm`)."""
    return len(columns) > 2 and columns[0] == "time_s" and columns[-1] == "residual_mm"


def read_weights(path: str | PathLike[str]) -> Descriptors:
    """Read a weights file written by `write_weights`.

    The rate is recovered from the `time_s` column (median step).

    Raises
    ------
    SignfaceError
        The file is missing or is no weights file, has fewer than two rows, or its times do not rise evenly.
    """
    import pandas as pd

    file = Path(path)
    if not file.is_file():
        raise SignfaceError("no such file", file=file)
    try:
        with file.open("rb") as stream:
            parquet = stream.read(4) == b"PAR1"
        table = pd.read_parquet(file) if parquet else pd.read_csv(file)
    except Exception as error:  # a damaged Parquet file brings errors of every kind out of pyarrow
        raise SignfaceError("cannot be read as a table of weights", file=file) from error
    if not is_weights_table([str(column) for column in table.columns]):
        raise SignfaceError(
            "is not a weights file", file=file, hint="its columns are time_s, one per base, residual_mm"
        )
    try:
        values = table.to_numpy(dtype=np.float64)
    except ValueError as error:
        raise SignfaceError("has cells that are not numbers", file=file) from error
    time = values[:, 0]
    if len(time) < 2:
        raise SignfaceError("has fewer than two frames", file=file, hint="a rate needs two frames")
    steps = np.diff(time)
    step = float(np.median(steps))
    if not np.isfinite(time).all() or step <= 0 or np.abs(steps - step).max() > 0.25 * step:
        raise SignfaceError("the times in time_s do not rise evenly", file=file, hint="solve the take again")
    rate = (len(time) - 1) / (time[-1] - time[0])
    rate = round(rate, 3)  # 200 must not come back as 199.9999999
    return Descriptors(
        weights=values[:, 1:-1],
        names=tuple(str(column) for column in table.columns[1:-1]),
        rate=rate,
        start=float(time[0]),
        residual=values[:, -1],
        name=file.stem,
        history=(f"read_weights {file.name}",),
    )
