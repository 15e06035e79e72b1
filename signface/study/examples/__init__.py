"""The three questionnaires of the thesis (6.3.2 and 6.4.2), to be served as they are or to begin from."""

from __future__ import annotations

import shutil
from os import PathLike
from pathlib import Path

from signface.errors import SignfaceError


def example_folder(name: str) -> Path:
    """The folder of an example that ships.

    Raises
    ------
    SignfaceError
        There is none of that name.
    """
    here = Path(__file__).parent
    names = sorted(file.parent.name for file in here.glob("*/study.toml"))
    if name not in names:
        raise SignfaceError(f"no example named {name}", hint=f"there are {', '.join(names)}")
    return here / name


def copy_example(name: str, folder: str | PathLike[str]) -> None:
    """Copy an example to a folder that is new or empty.

    Raises
    ------
    SignfaceError
        There is no such example, or the folder holds something.
    """
    source, target = example_folder(name), Path(folder)
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise SignfaceError("is not empty", file=target, hint="name a new folder")
    target.mkdir(parents=True, exist_ok=True)
    shutil.copy(source / "study.toml", target)
