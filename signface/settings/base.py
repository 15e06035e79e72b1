"""Decisions as objects: how to solve, how to train, how to write an EAF.

- `Settings`: what they share. A frozen dataclass whose fields say, in their metadata, what the command line and a
  laboratory's TOML call them; validated once, when it is made.
- `option`: a field of one; `number`: one that may be None, for the usual value.

The decisions: `solve.SolveSettings`, `training.TrainingSettings`, `eaf.EafOptions`; `laboratory` reads a TOML of them.
"""

from __future__ import annotations

import difflib
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, field, fields, replace
from functools import partial
from os import PathLike
from typing import Any, Self

from signface.errors import SignfaceError


def option(
    default: Any = MISSING,
    *,
    help: str,
    kind: type = str,
    choices: Sequence[str] = (),
    flag: str | None = None,
    metavar: str | None = None,
    path: bool = False,
    bare: str | None = None,
    default_factory: Any = MISSING,
) -> Any:
    """A field of a `Settings`, with what a door must know of it.

    Parameters
    ----------
    default, default_factory :
        As in `dataclasses.field`.
    help : str
        What it decides, in a clause; `--help` shows it.
    kind : type
        `float`, `int`, `bool`, `str`, or `tuple` for a list of words. None is allowed where the default is None.
    choices : sequence of str
        The only values, where they are few.
    flag : str, optional
        Its name on the command line where that is not its own with dashes; `--keep-...` and `--no-...` turn it off.
    metavar : str, optional
    path : bool
        A path: in a TOML it is relative to the TOML's folder. Where `choices` or shipped names exist, a name that is
        no file there stays a name.
    bare : str, optional
        What the option stands for on the command line when no value follows it.
    """
    about = {"help": help, "kind": kind, "choices": tuple(choices), "flag": flag}
    about |= {"metavar": metavar, "path": path, "bare": bare}
    if default_factory is not MISSING:
        return field(default_factory=default_factory, metadata=about)
    return field(default=default, metadata=about)


#: An `option` that is a number, or None for the usual one.
number = partial(option, None, kind=float)


class Settings:
    """What all decisions share: plain values in and out, a digest, and words for a history."""

    #: The table of a laboratory's TOML.
    TABLE = ""

    def __post_init__(self) -> None:
        for item in fields(self):  # type: ignore[arg-type]
            object.__setattr__(self, item.name, self._checked(item, getattr(self, item.name)))

    @classmethod
    def _checked(cls, item: Field[Any], value: Any) -> Any:
        kind, choices = item.metadata.get("kind"), item.metadata.get("choices", ())
        if value is None and item.default is None:
            return None
        if kind is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if kind is tuple and isinstance(value, (list, tuple)):
            value = tuple(str(word) for word in value)
        if item.metadata.get("path") and isinstance(value, PathLike):
            value = str(value)
        if kind is not None and (not isinstance(value, kind) or (kind is not bool and isinstance(value, bool))):
            raise SignfaceError(f"{item.name} is no {_WORDS.get(kind, kind.__name__)}: {value!r}")
        if choices and value not in choices:
            close = difflib.get_close_matches(str(value), choices, n=1)
            hint = f"did you mean {close[0]}" if close else f"choose one of {', '.join(choices)}"
            raise SignfaceError(f"no {item.name} is called {value!r}", hint=hint)
        return value

    def as_dict(self) -> dict[str, Any]:
        """Every field as a plain value, for JSON and TOML."""
        values = {item.name: getattr(self, item.name) for item in fields(self)}  # type: ignore[arg-type]
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any], *, file: str | PathLike[str] | None = None) -> Self:
        """The settings from plain values; what is not named has its default.

        Raises
        ------
        SignfaceError
            A name is unknown, or a value is not what the field wants.
        """
        known = [item.name for item in fields(cls)]  # type: ignore[arg-type]
        for name in values:
            if name not in known:
                close = difflib.get_close_matches(name, known, n=1)
                raise SignfaceError(
                    f"[{cls.TABLE}] has no {name}" if cls.TABLE else f"there is no setting {name}",
                    file=file,
                    hint=f"did you mean {close[0]}" if close else f"there are {', '.join(known)}",
                )
        try:
            return cls(**values)
        except SignfaceError as error:
            raise error.at(file) if file is not None else error from error

    def changed(self, **values: Any) -> Self:
        """The settings with some fields replaced."""
        return replace(self, **values)  # type: ignore[type-var]

    @property
    def chosen(self) -> dict[str, Any]:
        """The fields that differ from their defaults, as plain values."""
        plain = type(self)().as_dict()
        return {name: value for name, value in self.as_dict().items() if value != plain[name]}

    @property
    def digest(self) -> str:
        """SHA-256 of all fields."""
        return hashlib.sha256(json.dumps(self.as_dict(), sort_keys=True, default=str).encode()).hexdigest()

    def __str__(self) -> str:
        return ", ".join(f"{name} {value}" for name, value in self.chosen.items()) or "defaults"


_WORDS = {float: "number", int: "whole number", bool: "true or false", str: "text", tuple: "list of words"}
