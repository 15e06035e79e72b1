"""What a laboratory decided once: a TOML with the tables `[solve]`, `[train]` and `[eaf]`.

- `read_settings`: the file, as a `Laboratory`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from os import PathLike
from pathlib import Path
from typing import Any

from signface.errors import SignfaceError
from signface.files import reading
from signface.settings.base import Settings
from signface.settings.eaf import EafOptions
from signface.settings.solve import SolveSettings
from signface.settings.training import TrainingSettings


@dataclass(frozen=True)
class Laboratory:
    """What a laboratory decided once, from its TOML."""

    solve: SolveSettings = field(default_factory=SolveSettings)
    train: TrainingSettings = field(default_factory=TrainingSettings)
    eaf: EafOptions = field(default_factory=EafOptions)


def read_settings(path: str | PathLike[str], usual: Laboratory | None = None) -> Laboratory:
    """A laboratory's settings from a TOML with the tables `[solve]`, `[train]` and `[eaf]`, none of them required.

    Parameters
    ----------
    path : path
    usual : Laboratory, optional
        What holds where the file says nothing; the defaults of all settings when not given.

    Raises
    ------
    SignfaceError
        There is no such file, it is no TOML, or it names something that there is not.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import mkdtemp
    >>> import signface as sf
    >>> file = Path(mkdtemp()) / "lab.toml"
    >>> _ = file.write_text("[solve]\\nalpha = 0.3\\n")
    >>> sf.read_settings(file).solve.alpha
    0.3
    """
    file = Path(path)
    try:
        with reading(file):
            content = tomllib.loads(file.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise SignfaceError(f"cannot be read as TOML ({error})", file=file) from error
    tables: dict[str, type[Settings]] = {"solve": SolveSettings, "train": TrainingSettings, "eaf": EafOptions}
    for name, table in content.items():
        if name not in tables or not isinstance(table, dict):
            raise SignfaceError(f"has no table [{name}]", file=file, hint=f"its tables are {', '.join(tables)}")
    usual = Laboratory() if usual is None else usual
    made = {}
    for name, kind in tables.items():
        stated = _with_paths(kind, content.get(name, {}), file.parent)
        made[name] = kind.from_dict({**getattr(usual, name).as_dict(), **stated}, file=file)
    return Laboratory(**made)  # type: ignore[arg-type]


def _with_paths(kind: type[Settings], values: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The values, with paths that exist beside the TOML made its folder's."""
    paths = {item.name for item in fields(kind) if item.metadata.get("path")}  # type: ignore[arg-type]
    return {
        name: str(folder / value) if name in paths and isinstance(value, str) and (folder / value).exists() else value
        for name, value in values.items()
    }
