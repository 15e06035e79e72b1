"""The descriptors of a corpus on disk: solved once, kept beside the recordings, open to any tool.

- `DescriptorStore`: read and write the descriptors of takes by their origin.
- `read_provenance`: where one file of a store comes from.
- `open_store`: the store of a corpus, or None where there can be none.

A store is the folder `descriptors` of a corpus. Each recipe (face, layout, parameters, solver) has a folder in it, and
each take one Parquet file there, so that a folder of a recipe is one table:

    pandas.read_parquet("feel/descriptors/default-5f0c1e2ab4")
    duckdb.sql("FROM 'feel/descriptors/default-5f0c1e2ab4/**/*.parquet' SELECT signer, avg(jawOpen) GROUP BY ALL")

The files are those of `signface.descriptors_files`, opened by the columns `take, signer, kind`. Their metadata says,
too, where it all comes from.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from signface.corpus.origin import Origin
from signface.descriptors import Descriptors
from signface.descriptors_files import NewerFile, WeightsWriter, read_about, read_parquet
from signface.errors import SignfaceError
from signface.extras import needed
from signface.files import bundled_corpus, reading

if TYPE_CHECKING:
    import pandas as pd

FOLDER = "descriptors"


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
                read_provenance(first)

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
            with _opened(file) as stream:
                return read_parquet(stream, file) if _provenance(stream, file)["key"] == origin.key else None
        except NewerFile:
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
        words = {"take": origin.take, "signer": origin.signer, "kind": origin.kind}
        about = {
            "key": origin.key,
            "origin": origin.as_dict(),
            "versions": {package: version(package) for package in ("signface", "numpy", "scipy")},
        }
        # Not named .parquet until it is whole: a query over the folder may run at any moment.
        writer = WeightsWriter(file, words=words, about=about, fsync=True, mark=f"{_owner()}-", suffix=".part")
        try:
            with writer:
                writer.append(descriptors)
        except OSError as error:
            raise SignfaceError(
                f"cannot be written ({error.strerror})", file=file, hint="free the disk, or make the corpus writable"
            ) from error
        return file

    def clean(self) -> None:
        """Remove what processes of this machine that were killed left half written."""
        for file in self.folder.glob("**/.*.part"):
            host, _, process = file.stem.rpartition("-")[0].rpartition("~")[2].rpartition("@")
            if host == socket.gethostname() and process.isdecimal() and not _alive(int(process)):
                file.unlink(missing_ok=True)

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
        duckdb = needed("duckdb", "corpus")
        recipes = [path.name for path in self.recipes()]
        if recipe is None and len(recipes) == 1:
            recipe = recipes[0]
        if recipe not in recipes:
            problem = "is empty" if not recipes else f"has the recipes {', '.join(recipes)}"
            hint = "fill it with: signface corpus run CORPUS" if not recipes else "name one of them"
            raise SignfaceError(problem, file=self.folder, hint=hint)
        pattern = str(self.folder / str(recipe) / "**" / "*.parquet")
        with duckdb.connect() as connection:
            connection.execute("SET enable_progress_bar = false")
            try:
                connection.read_parquet(pattern, union_by_name=True).create_view("descriptors")
                return connection.sql(sql).df()
            except duckdb.Error as error:
                raise SignfaceError(f"the query failed: {str(error).splitlines()[0]}", file=self.folder) from error


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


def read_provenance(path: str | PathLike[str]) -> dict[str, Any]:
    """Where a file of a store comes from: `key`, `origin` (with the recipe), `versions`, `history`, ...

    Raises
    ------
    SignfaceError
        The file is missing, damaged, no file of a store, or was written by a newer signface.
    """
    with _opened(Path(path)) as stream:
        return _provenance(stream, Path(path))


def _opened(file: Path) -> BinaryIO:
    """The file, opened once: another writer may replace it at any moment."""
    with reading(file):
        return file.open("rb")


def _provenance(stream: BinaryIO, file: Path) -> dict[str, Any]:
    about = read_about(stream, file)
    if about is None or "key" not in about:
        raise SignfaceError("is no descriptors of a store", file=file, hint="delete it")
    return about


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
