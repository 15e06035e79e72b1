"""Descriptors on disk: Parquet to the last bit, and csv as its plain view.

- `write_weights`, `read_weights`: a take in one of the two, by the ending and by the content.
- `WeightsWriter`: the same piece by piece, for takes of any length.
- `read_parquet`, `read_about`: what the descriptor store of a corpus reads, too.
- `is_weights_table`: whether a table is one of weights.

Both begin with `time_s` and end with `residual_mm`, between which there is a column for each base and the head's pose:
in Parquet the matrix (`head_00` to `head_33`) and, where they are known, the weights' standard deviations
(`sd:NAME`); in csv, with fewer digits, three millimetres and three degrees (`signface.columns`). Rate, start, name,
history, settings and the bases that the markers cannot see (`unobserved`) stand in the metadata of the Parquet, under
`signface`. A csv has no place for them that every reader of csv passes over.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from signface.columns import DEVIATION, POSE, POSE_MATRIX, RESIDUAL, TIME, WORDS, base_column, base_of, poses_of
from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.files import whole_file
from signface.settings.solve import SolveSettings

if TYPE_CHECKING:
    import pyarrow as pa

#: Raised whenever an older signface would misread what a newer one wrote.
FORMAT = 1
METADATA = b"signface"

#: Decimals in a csv. A rate is recovered from the times: a microsecond's rounding would show in a take of few frames.
#: Eight of a degree keep the pose's matrix to 1e-9.
DECIMALS = 6
FINE_DECIMALS = {TIME: 9, **dict.fromkeys(POSE[3:], 8)}


class NewerFile(SignfaceError):
    """A file was written by a newer signface than this one."""


class WeightsWriter:
    """A weights file written piece by piece.

    As a context manager it appends to a temporary file, which takes the place of `path` when the block ends well and
    vanishes when it does not. The bytes depend on the frames, not on how they come in pieces, but for the groups of
    rows of a .parquet. The history and settings of the last piece are those of the take.

    Parameters
    ----------
    path : path
        .csv or .parquet.
    words : mapping of str to str
        Columns of a .parquet that say the same in each row; they open it.
    about : mapping
        More for the metadata of a .parquet, of what JSON knows.
    **options
        Of `signface.files.whole_file`.

    Raises
    ------
    SignfaceError
        The ending is neither, or the folder cannot be written.

    Examples
    --------
    >>> with WeightsWriter("weights.csv") as writer:
    ...     for second in range(3):
    ...         writer.append(Descriptors(np.zeros((100, 1)), ("jawOpen",), rate=100, start=second))
    >>> read_weights("weights.csv").duration
    3.0
    """

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        words: Mapping[str, str] | None = None,
        about: Mapping[str, Any] | None = None,
        **options: Any,
    ) -> None:
        if Path(path).suffix.lower() not in (".csv", ".parquet"):
            raise SignfaceError("the ending of a weights file is .csv or .parquet", file=path)
        self.path, self.frames = Path(path), 0
        self._words, self._about, self._options = dict(words or {}), dict(about or {}), options
        self._first: Descriptors | None = None
        self._open = contextlib.ExitStack()

    def __enter__(self) -> WeightsWriter:
        self._temporary = self._open.enter_context(whole_file(self.path, **self._options))
        return self

    def __exit__(self, kind: Any, error: Any, trace: Any) -> bool | None:
        if kind is None and self._first is None:
            nothing = SignfaceError("there are no weights to write", file=self.path)
            self._open.__exit__(SignfaceError, nothing, None)
            raise nothing
        if kind is None and self.path.suffix.lower() == ".parquet":
            self._writer.add_key_value_metadata({METADATA: json.dumps(self._about, ensure_ascii=False)})
        return self._open.__exit__(kind, error, trace)

    def append(self, piece: Descriptors) -> None:
        """Write the frames that follow those before.

        Raises
        ------
        SignfaceError
            The piece has other bases than those before, or is the only one with standard deviations or without; or
            the head's poses are no rigid motions, which a csv cannot hold.
        """
        import pyarrow as pa

        begin = self._first is None
        first = self._first = piece if self._first is None else self._first
        if piece.names != first.names or (piece.deviation is None) != (first.deviation is None):
            raise SignfaceError("the pieces of a take have different bases", file=self.path)
        plain = self.path.suffix.lower() == ".csv"
        columns = _plain_columns(piece) if plain else _exact_columns(piece, self._words)
        # Of one line with the pieces before, whatever their own start was rounded to.
        time = first.start + np.arange(self.frames, self.frames + piece.n_frames) / first.rate
        columns[TIME] = _arrow(time.round(FINE_DECIMALS[TIME]) if plain else time, unknown=plain)
        if begin:
            self._begin(pa.schema([(name, column.type) for name, column in columns.items()]))
        self._writer.write_table(pa.Table.from_arrays(list(columns.values()), schema=self._schema))
        self._about |= _about(first, piece)
        self.frames += piece.n_frames

    def _begin(self, schema: pa.Schema) -> None:
        self._schema = schema
        if self.path.suffix.lower() == ".csv":
            from pyarrow import csv

            file = self._open.enter_context(self._temporary.open("wb"))
            file.write((",".join(schema.names) + "\n").encode())  # Arrow would put the names in quotes
            options = csv.WriteOptions(include_header=False)
            self._writer: Any = self._open.enter_context(csv.CSVWriter(file, schema, write_options=options))
            return
        from pyarrow import parquet

        writer = parquet.ParquetWriter(
            self._temporary,
            schema,
            compression="zstd",
            use_dictionary=list(self._words),  # doubles without one: it would make all NaN one
            column_encoding={name: "BYTE_STREAM_SPLIT" for name in schema.names if name not in self._words},
            write_page_checksum=True,
        )
        self._writer = self._open.enter_context(writer)


def _about(first: Descriptors, last: Descriptors) -> dict[str, Any]:
    """What cannot stand in a row."""
    return {
        "format": FORMAT,
        "bases": list(first.names),
        "rate": first.rate.hex(),
        "start": first.start.hex(),
        "name": first.name,
        "history": list(last.history),
        "settings": None if last.settings is None else last.settings.as_dict(),
        "unobserved": list(last.unobserved),
    }


def _plain_columns(piece: Descriptors) -> dict[str, pa.Array]:
    return {name: _arrow(values.round(FINE_DECIMALS.get(name, DECIMALS))) for name, values in piece.columns().items()}


def _exact_columns(piece: Descriptors, words: Mapping[str, str]) -> dict[str, pa.Array]:
    import pyarrow as pa

    assert piece.head is not None
    assert piece.residual is not None
    frames = piece.n_frames
    numbers = {TIME: piece.time}
    numbers |= {base_column(name): values for name, values in zip(piece.names, piece.weights.T, strict=True)}
    numbers |= dict(zip(POSE_MATRIX, piece.head.reshape(frames, 16).T, strict=True))
    if piece.deviation is not None:
        numbers |= {DEVIATION + name: values for name, values in zip(piece.names, piece.deviation.T, strict=True)}
    numbers[RESIDUAL] = piece.residual
    columns = {word: pa.repeat(pa.scalar(text), frames).dictionary_encode() for word, text in words.items()}
    return columns | {name: _arrow(values, unknown=False) for name, values in numbers.items()}


def _arrow(column: np.ndarray, *, unknown: bool = True) -> pa.Array:
    """A column for Arrow, NaN an unknown cell on request (`pa.array` would import pandas, a third of a second)."""
    import pyarrow as pa

    column = np.ascontiguousarray(column)
    known = pa.py_buffer(np.packbits(~np.isnan(column), bitorder="little")) if unknown else None
    return pa.Array.from_buffers(pa.float64(), len(column), [known, pa.py_buffer(column)])


def write_weights(descriptors: Descriptors, path: str | PathLike[str]) -> None:
    """Write descriptors as .parquet, to the last bit, or as .csv, its plain view, by the ending of `path`.

    Raises
    ------
    SignfaceError
        The ending is neither, the folder cannot be written, or the head's poses are no rigid motions, which a csv
        cannot hold.

    Examples
    --------
    >>> import numpy as np
    >>> import signface as sf
    >>> take = sf.Descriptors(np.array([[1 / 3], [0.5]]), ("jawOpen",), rate=100, history=("solved",))
    >>> sf.write_weights(take, "weights.parquet")
    >>> sf.read_weights("weights.parquet") == take
    True
    """
    with WeightsWriter(path) as writer:
        writer.append(descriptors)


def is_weights_table(columns: Sequence[str]) -> bool:
    """Whether the columns of a table are those of weights (`time_s`, bases and poses, `residual_mm`)."""
    return len(columns) > 2 and columns[0] == TIME and columns[-1] == RESIDUAL


def read_weights(path: str | PathLike[str]) -> Descriptors:
    """Read descriptors that `write_weights` or a store wrote, or any table of the same columns.

    A Parquet that says how it came about is read to the last bit. In any other table the rate is recovered from the
    `time_s` column (median step), the name is the file's, and a head without columns is the identity.

    Raises
    ------
    SignfaceError
        The file is missing or is no weights file, has fewer than two rows and says no rate, its times do not rise
        evenly, or it was written by a newer signface.

    See Also
    --------
    signface.write_weights : the way to disk.

    Examples
    --------
    >>> import signface as sf
    >>> sf.write_weights(sf.datasets.mini_weights(), "weights.parquet")
    >>> sf.read_weights("weights.parquet").n_frames
    1184
    """
    file = Path(path)
    if not file.is_file():
        raise SignfaceError("no such file", file=file)
    try:
        with file.open("rb") as stream:
            if stream.read(4) == b"PAR1":
                return read_parquet(stream, file)
        import pandas as pd

        table = pd.read_csv(file)
    except SignfaceError:
        raise
    except Exception as error:  # a damaged file brings errors of every kind out of the parsers
        raise SignfaceError("cannot be read as a table of weights", file=file) from error
    return _from_columns({str(name): table[name].to_numpy() for name in table.columns}, file)


def read_about(stream: BinaryIO, file: Path) -> dict[str, Any] | None:
    """What a Parquet says of how it came about; None where it says nothing.

    Raises
    ------
    SignfaceError
        It is damaged, or was written by a newer signface (`NewerFile`).
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        content = (pq.read_metadata(stream).metadata or {}).get(METADATA)
        about = None if content is None else json.loads(content)
        written = 0 if about is None else int(about["format"])
    except (pa.ArrowException, OSError, KeyError, ValueError, TypeError) as error:
        raise SignfaceError("cannot be read as a table of weights, or is cut off", file=file) from error
    if written > FORMAT:
        raise NewerFile(
            f"was written by a newer signface (format {written}, this one reads up to {FORMAT})",
            file=file,
            hint="update signface; nothing was changed",
        )
    return about


def read_parquet(stream: BinaryIO, file: Path) -> Descriptors:
    """Descriptors from an open Parquet; `file` names it in messages.

    Raises
    ------
    SignfaceError
        It is damaged, holds no weights, or was written by a newer signface.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    about = read_about(stream, file)
    try:
        with pq.ParquetFile(stream, page_checksum_verification=True) as parquet:
            table = parquet.read()
        fields = [field for field in table.schema if field.name not in WORDS or pa.types.is_floating(field.type)]
        columns = {field.name: table[field.name].to_numpy() for field in fields}
        return _from_columns(columns, file) if about is None else _exactly(columns, about, file)
    except (pa.ArrowException, OSError, KeyError, ValueError, TypeError) as error:
        raise SignfaceError("is damaged", file=file, hint="delete it, and solve the take again") from error


def _exactly(columns: Mapping[str, np.ndarray], about: Mapping[str, Any], file: Path) -> Descriptors:
    names, rate, start = tuple(about["bases"]), float.fromhex(about["rate"]), float.fromhex(about["start"])
    time = columns[TIME]
    if not np.array_equal(time, start + np.arange(len(time)) / rate):  # rows were taken out since
        return _from_columns(columns, file)
    weights = [columns[base_column(name)] for name in names]
    deviations = [columns[DEVIATION + name] for name in names if DEVIATION + name in columns]
    return Descriptors(
        weights=np.stack(weights, axis=1) if weights else np.zeros((len(time), 0)),
        names=names,
        rate=rate,
        start=start,
        residual=columns[RESIDUAL],
        head=poses_of(columns),
        name=about["name"],
        history=tuple(about["history"]),
        deviation=np.stack(deviations, axis=1) if deviations else None,
        settings=_settings(about.get("settings")),
        unobserved=tuple(about.get("unobserved", ())),  # files of older versions say nothing of it
    )


def _settings(values: Mapping[str, Any] | None) -> SolveSettings | None:
    """The settings; those of a version that knew others are unknown."""
    with contextlib.suppress(SignfaceError):
        return None if values is None else SolveSettings.from_dict(values)
    return None


def _from_columns(table: Mapping[str, np.ndarray], file: Path) -> Descriptors:
    """Descriptors from the columns of any table."""
    if not is_weights_table(list(table)):
        raise SignfaceError(
            "is not a weights file", file=file, hint="its columns are time_s, one per base, residual_mm"
        )
    try:
        columns = {name: values.astype(np.float64) for name, values in table.items()}
    except ValueError as error:
        raise SignfaceError("has cells that are not numbers", file=file) from error
    time = columns[TIME]
    if len(time) < 2:
        raise SignfaceError("has fewer than two frames", file=file, hint="a rate needs two frames")
    steps = np.diff(time)
    step = float(np.median(steps))
    if not np.isfinite(time).all() or step <= 0 or np.abs(steps - step).max() > 0.25 * step:
        raise SignfaceError("the times in time_s do not rise evenly", file=file, hint="solve the take again")
    rate = (len(time) - 1) / (time[-1] - time[0])
    others = {TIME, RESIDUAL, *POSE, *POSE_MATRIX}
    bases = [name for name in columns if name not in others and not name.startswith(DEVIATION)]
    if not bases:
        raise SignfaceError("has no base", file=file, hint="its columns are time_s, one per base, residual_mm")
    return Descriptors(
        weights=np.stack([columns[name] for name in bases], axis=1),
        names=tuple(base_of(name) for name in bases),
        rate=round(rate, 3),  # 200 must not come back as 199.9999999
        start=float(time[0]),
        residual=columns[RESIDUAL],
        head=poses_of(columns),
        name=file.stem,
        history=(f"read_weights {file.name}",),
    )
