"""The descriptors of a corpus on disk: solved once, kept beside the recordings, open to any tool.

- `DescriptorStore`: read and write the descriptors of takes by their origin.
- `read_stored`: one file of a store.
- `open_store`: the store of a corpus, or None where there can be none.

A store is the folder `descriptors` of a corpus. Each recipe (face, layout, parameters, solver) has a folder in it, and
each take one Parquet file there, so that a folder of a recipe is one table:

    pandas.read_parquet("feel/descriptors/default-5f0c1e2ab4")
    duckdb.sql("FROM 'feel/descriptors/default-5f0c1e2ab4/**/*.parquet' SELECT signer, avg(jawOpen) GROUP BY ALL")

The columns are `take, signer, kind, time_s`, one per base, `residual_mm`, and `head_00` to `head_33`, the pose of the
head row by row (millimetres). A base whose name is taken is called `base:NAME`. The file's metadata holds, under
`signface`, what cannot stand in a row and where it all comes from. Values are kept to the last bit.
"""

from __future__ import annotations

import io
import json
import os
import socket
import tempfile
from collections.abc import Iterator
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from signface.corpus.origin import Origin
from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.files import bundled_corpus

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

FOLDER = "descriptors"

#: Raised whenever an older signface would misread what a newer one wrote.
FORMAT = 1
METADATA = b"signface"

HEAD = tuple(f"head_{row}{column}" for row in range(4) for column in range(4))
WORDS = ("take", "signer", "kind")
TAKEN = (*WORDS, "time_s", "residual_mm", *HEAD)


class DescriptorStore:
    """The descriptors of the takes of a corpus.

    Parameters
    ----------
    corpus : path
        The folder of the corpus; the store is its folder `descriptors`, made when something is written.

    Raises
    ------
    SignfaceError
        The store was written by a newer signface.

    Examples
    --------
    >>> import signface as sf
    >>> from signface.corpus.origin import find_origin, weights_recipe
    >>> corpus = sf.datasets.mini_corpus()
    >>> entry = corpus.takes[0]
    >>> origin = find_origin(entry, corpus.folder, weights_recipe())
    >>> store = DescriptorStore("feel")
    >>> print(store.read(origin))
    None
    >>> written = store.write(origin, sf.datasets.mini_weights(entry.name))
    >>> store.read(origin).n_frames
    2149
    """

    def __init__(self, corpus: str | PathLike[str]) -> None:
        self.folder = Path(corpus) / FOLDER
        for recipe in self.recipes():
            first = next(stored_files(recipe), None)
            if first is not None:
                _metadata(first, _content(first))

    def recipes(self) -> list[Path]:
        """Folders of the recipes there are, sorted."""
        return sorted(path for path in self.folder.glob("*") if path.is_dir())

    def path(self, origin: Origin) -> Path:
        """Where the descriptors of a take are or would be."""
        return self.folder / origin.recipe.name / f"{origin.take}.parquet"

    def read(self, origin: Origin) -> Descriptors | None:
        """The descriptors of exactly this origin, or None.

        A file of another origin (the recording was exported again, say) or a damaged one counts as none: solving
        again replaces it.

        Raises
        ------
        SignfaceError
            The file was written by a newer signface.
        """
        file = self.path(origin)
        if not file.is_file():
            return None
        try:
            content = _content(file)
            if _metadata(file, content)["key"] != origin.key:
                return None
            return _from_parquet(file, content)
        except NewerStore:
            raise
        except SignfaceError:
            return None

    def write(self, origin: Origin, descriptors: Descriptors) -> Path:
        """Put the descriptors of a take in the store: all of it or nothing, whoever else is writing.

        Raises
        ------
        SignfaceError
            The folder cannot be written.
        """
        file = self.path(origin)
        content = _as_parquet(origin, descriptors)
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            # Not named .parquet until it is whole: a query over the folder may run at any moment.
            handle, name = tempfile.mkstemp(prefix=f".{file.stem}-{_owner()}-", suffix=".part", dir=file.parent)
            try:
                with os.fdopen(handle, "wb") as stream:
                    stream.write(content)
                    stream.flush()
                    os.fsync(stream.fileno())
                os.chmod(name, 0o644)
                os.replace(name, file)
            finally:
                Path(name).unlink(missing_ok=True)
        except OSError as error:
            raise SignfaceError(
                f"cannot be written ({error.strerror})", file=file, hint="free the disk, or make the corpus writable"
            ) from error
        return file

    def clean(self) -> None:
        """Remove what processes of this machine that were killed left half written."""
        for part in self.folder.glob("**/.*.part"):
            host, _, process = part.stem.rpartition("-")[0].rpartition("~")[2].rpartition("@")
            if host == socket.gethostname() and process.isdecimal() and not _alive(int(process)):
                part.unlink(missing_ok=True)

    def query(self, sql: str, recipe: str | None = None) -> pd.DataFrame:
        """Ask with SQL; the table is called `descriptors`.

        Parameters
        ----------
        sql : str
        recipe : str, optional
            Folder of the recipe; the only one when not given.

        Raises
        ------
        SignfaceError
            DuckDB is not installed, the store is empty or has several recipes, or the query is wrong.

        Examples
        --------
        >>> import signface as sf
        >>> from signface.corpus.origin import find_origin, weights_recipe
        >>> corpus, store = sf.datasets.mini_corpus(), DescriptorStore("asked")
        >>> for entry in corpus:
        ...     origin = find_origin(entry, corpus.folder, weights_recipe())
        ...     written = store.write(origin, sf.datasets.mini_weights(entry.name))
        >>> print(store.query("SELECT take, count(*) AS frames FROM descriptors GROUP BY take ORDER BY take"))
               take  frames
        0  M1_EU_11    1195
        1   M1_IE_J    2149
        2  M2_EU_04    1184
        3   M2_SE_A    1758
        """
        try:
            import duckdb
        except ModuleNotFoundError as error:
            raise SignfaceError("the package duckdb is not installed", hint="pip install 'signface[corpus]'") from error
        there = [path.name for path in self.recipes()]
        if recipe is None and len(there) == 1:
            recipe = there[0]
        if recipe not in there:
            problem = "is empty" if not there else f"has the recipes {', '.join(there)}"
            hint = "fill it with: signface corpus run CORPUS" if not there else "name one of them"
            raise SignfaceError(problem, file=self.folder, hint=hint)
        pattern = str(self.folder / str(recipe) / "**" / "*.parquet")
        with duckdb.connect() as connection:
            connection.execute("SET enable_progress_bar = false")
            try:
                connection.read_parquet(pattern, union_by_name=True).create_view("descriptors")
                return connection.sql(sql).df()
            except duckdb.Error as error:
                raise SignfaceError(f"the query failed: {str(error).splitlines()[0]}", file=self.folder) from error


class NewerStore(SignfaceError):
    """A file was written by a newer signface than this one."""


def open_store(corpus: str | PathLike[str]) -> DescriptorStore | None:
    """The store of a corpus; None for the corpus that ships with signface and for one that cannot be written.

    Raises
    ------
    SignfaceError
        The store was written by a newer signface.
    """
    folder = Path(corpus)
    if folder.resolve() == bundled_corpus().resolve() or not os.access(folder, os.W_OK):
        return None
    return DescriptorStore(folder)


def stored_files(folder: Path) -> Iterator[Path]:
    """The files of takes in the folder of a recipe, sorted."""
    yield from sorted(path for path in folder.rglob("*.parquet") if not path.name.startswith("."))


def read_stored(path: str | PathLike[str]) -> Descriptors:
    """Read one file of a store.

    Raises
    ------
    SignfaceError
        The file is missing, damaged, no file of a store, or was written by a newer signface.
    """
    file = Path(path)
    return _from_parquet(file, _content(file))


def read_provenance(path: str | PathLike[str]) -> dict[str, Any]:
    """Where a file of a store comes from: `key`, `origin` (with the recipe), `versions`, `history`, ...

    Raises
    ------
    SignfaceError
        As `read_stored`.
    """
    return _metadata(Path(path), _content(Path(path)))


def column(base: str) -> str:
    """Name of the column of a base."""
    return f"base:{base}" if base in TAKEN else base


def _as_parquet(origin: Origin, descriptors: Descriptors) -> bytes:
    """The file of a take; the same descriptors give the same bytes."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    frames = descriptors.n_frames
    assert descriptors.residual is not None
    assert descriptors.head is not None
    columns: dict[str, Any] = {
        word: pa.DictionaryArray.from_arrays(pa.array(np.zeros(frames, np.int32)), pa.array([text]))
        for word, text in zip(WORDS, (origin.take, origin.signer, origin.kind), strict=True)
    }
    columns["time_s"] = descriptors.time
    columns |= {column(name): descriptors.weights[:, n] for n, name in enumerate(descriptors.names)}
    columns["residual_mm"] = descriptors.residual
    columns |= {name: descriptors.head.reshape(frames, 16)[:, n] for n, name in enumerate(HEAD)}
    about = {
        "format": FORMAT,
        "key": origin.key,
        "bases": list(descriptors.names),
        "rate": descriptors.rate.hex(),
        "start": descriptors.start.hex(),
        "name": descriptors.name,
        "history": list(descriptors.history),
        "origin": origin.as_dict(),
        "versions": {package: version(package) for package in ("signface", "numpy", "scipy")},
    }
    table = pa.table(columns).replace_schema_metadata({METADATA: json.dumps(about, ensure_ascii=False).encode()})
    buffer = io.BytesIO()
    # Doubles without a dictionary: it would make all NaN one.
    pq.write_table(
        table,
        buffer,
        compression="zstd",
        use_dictionary=list(WORDS),
        column_encoding={name: "BYTE_STREAM_SPLIT" for name in table.column_names if name not in WORDS},
        write_page_checksum=True,
    )
    return buffer.getvalue()


def _content(file: Path) -> pa.BufferReader:
    """The bytes of a file, read once: another writer may replace it at any moment."""
    import pyarrow as pa

    try:
        return pa.BufferReader(file.read_bytes())
    except FileNotFoundError as error:
        raise SignfaceError("no such file", file=file) from error
    except OSError as error:
        raise SignfaceError(f"cannot be read ({error.strerror})", file=file) from error


def _metadata(file: Path, content: pa.BufferReader) -> dict[str, Any]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        about = json.loads((pq.read_metadata(content).metadata or {})[METADATA])
        written = int(about["format"])
    except (pa.ArrowException, OSError, KeyError, ValueError, TypeError) as error:
        raise SignfaceError("is no descriptors of a store, or is cut off", file=file, hint="delete it") from error
    if written > FORMAT:
        raise NewerStore(
            f"was written by a newer signface (format {written}, this one reads up to {FORMAT})",
            file=file,
            hint="update signface; nothing was changed",
        )
    return about


def _from_parquet(file: Path, content: pa.BufferReader) -> Descriptors:
    import pyarrow as pa
    import pyarrow.parquet as pq

    about = _metadata(file, content)
    try:
        with pq.ParquetFile(content, page_checksum_verification=True) as parquet:
            table = parquet.read()
        weights = [table[column(name)].to_numpy() for name in about["bases"]]
        return Descriptors(
            weights=np.stack(weights, axis=1) if weights else np.zeros((table.num_rows, 0)),
            names=tuple(about["bases"]),
            rate=float.fromhex(about["rate"]),
            start=float.fromhex(about["start"]),
            residual=table["residual_mm"].to_numpy(),
            head=np.stack([table[name].to_numpy() for name in HEAD], axis=1).reshape(-1, 4, 4),
            name=about["name"],
            history=tuple(about["history"]),
        )
    except (pa.ArrowException, OSError, KeyError, ValueError, TypeError) as error:
        raise SignfaceError("is damaged", file=file, hint="delete it: the take is then solved again") from error


def _owner() -> str:
    return f"~{socket.gethostname()}@{os.getpid()}"


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
