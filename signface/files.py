"""Files read and written, whole or not at all, and the folder of data that ships with signface.

- `whole_file`: write beside the target, then rename over it; `write_text`: a text so.
- `reading`: what goes wrong where a file is read, as an error that names it.
- `DATA`, `models_folder`, `shipped`, `bundled_corpus`: where the data live that ship.
"""

from __future__ import annotations

import contextlib
import os
import stat
import tempfile
from collections.abc import Iterator
from os import PathLike
from pathlib import Path

from signface.errors import SignfaceError

_PACKAGE = Path(__file__).resolve().parent

#: Where `models` and `corpora/mini` stand: in an installed package itself, in a checkout beside it.
DATA = _PACKAGE if (_PACKAGE / "models").is_dir() else _PACKAGE.parent


@contextlib.contextmanager
def whole_file(
    path: str | PathLike[str], *, fsync: bool = False, mark: str = "", suffix: str | None = None
) -> Iterator[Path]:
    """Give a temporary path beside `path`; it replaces `path` if the block ends well, and vanishes if not.

    Parameters
    ----------
    path : path
        The file to write. Its folder is created when missing. A file that is there keeps its mode, and a symbolic link
        stays one: the file that it leads to is written.
    fsync : bool
        Whether what was written must be on the disk before it takes its name: a computer may lose its power.
    mark : str
        Stands in the temporary name, so that whose it is can be told.
    suffix : str, optional
        Ending of the temporary name; that of `path` by default, so that writers which look at the ending agree.

    Yields
    ------
    Path
        Where to write.

    Raises
    ------
    SignfaceError
        The folder cannot be created or written.
    """
    target = Path(path)
    try:
        if target.is_symlink():
            target = target.resolve()  # a ring of links is an OSError, one that leads nowhere yet makes the file there
        target.parent.mkdir(parents=True, exist_ok=True)
        ending = target.suffix if suffix is None else suffix
        handle, name = tempfile.mkstemp(prefix=f".{target.stem}-{mark}", suffix=ending, dir=target.parent)
        os.close(handle)
    except (OSError, RuntimeError) as error:  # Python before 3.13 raises RuntimeError for a ring of links
        reason = getattr(error, "strerror", None) or "symbolic links that lead to each other"
        raise SignfaceError(
            f"cannot be written ({reason})", file=target, hint="choose a folder you may write to"
        ) from error
    temporary = Path(name)
    try:
        yield temporary
        if fsync:
            with temporary.open("rb") as written:
                os.fsync(written.fileno())
        umask = os.umask(0)
        os.umask(umask)
        # mkstemp makes it private; a result is shared as any other file, or as the file was that it replaces
        temporary.chmod(stat.S_IMODE(target.stat().st_mode) if target.is_file() else 0o666 & ~umask)
        if target.is_dir():
            raise SignfaceError("is a folder, not a file", file=target, hint="name a file to write")
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: str | PathLike[str], text: str) -> None:
    """Write a text (UTF-8), whole or not at all; errors are those of `whole_file`."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


@contextlib.contextmanager
def reading(file: Path) -> Iterator[None]:
    """Say of a file that is read in the block what is wrong with it.

    Raises
    ------
    SignfaceError
        The file is missing, cannot be read, or is no text where text is read.
    """
    try:
        yield
    except FileNotFoundError as error:
        raise SignfaceError("no such file", file=file) from error
    except OSError as error:
        raise SignfaceError(f"cannot be read ({error.strerror or 'input error'})", file=file) from error
    except UnicodeDecodeError as error:
        raise SignfaceError("cannot be read as text", file=file) from error


def models_folder() -> Path:
    """The folder of the faces, layouts, classifiers and rules that ship."""
    return DATA / "models"


def shipped(kind: str, suffix: str) -> dict[str, Path]:
    """Names and files of the shipped data of one kind (`faces`, `layouts`, `classifiers`), sorted by name."""
    folder = models_folder() / kind
    return {file.name[: -len(suffix)]: file for file in sorted(folder.glob(f"*{suffix}"))}


def bundled_corpus() -> Path:
    """The folder of the small synthetic corpus."""
    return DATA / "corpora" / "mini"
