"""What the frozen dataclasses over arrays have in common.

- `Content`: equality by what an object holds. Python's own compares fields with `==`, which arrays answer element by
  element.
- `Summary`: an object in a few words, where Python would print all its arrays.
"""

from __future__ import annotations

import sys
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np


class Content:
    """Two objects of one class are equal when they hold the same content.

    Arrays and tables are compared by value, and what is unknown (NaN) in both is the same. Fields declared with
    `compare=False` do not count: how an object came about (its history, its source) is no part of what it holds. The
    hash goes with that: it looks at names, numbers and the sizes of arrays, so that objects can be keys of a
    dictionary at no cost.

    For dataclasses made with `eq=False`; otherwise `dataclass` would write its own.

    Examples
    --------
    >>> from signface.descriptors import Descriptors
    >>> one = Descriptors(np.array([[0.5], [np.nan]]), ("jawOpen",), rate=100)
    >>> one == one.changed("read again"), one == one.changed("doubled", weights=2 * one.weights)
    (True, False)
    """

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if type(self) is not type(other):
            return NotImplemented
        return all(_same(mine, theirs) for mine, theirs in zip(_contents(self), _contents(other), strict=True))

    def _hold(self, **values: Any) -> None:
        """Set fields while the object is made; arrays become read-only."""
        for name, value in values.items():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
            object.__setattr__(self, name, value)

    def __hash__(self) -> int:
        return hash((type(self), *map(_key, _contents(self))))


class Summary:
    """An object is shown by its name and its sizes, which `_sizes` tells; for dataclasses with `repr=False`.

    Examples
    --------
    >>> import signface as sf
    >>> sf.datasets.mini_take()
    <Take M2_EU_04: 1184 frames at 200 Hz, 46 markers>
    """

    if TYPE_CHECKING:

        @property
        def name(self) -> str: ...

        def _sizes(self) -> str: ...

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.name}: {self._sizes()}>"


def _contents(thing: Any) -> list[Any]:
    return [getattr(thing, item.name) for item in fields(thing) if item.compare]


def _same(mine: Any, theirs: Any) -> bool:
    if mine is theirs:
        return True
    if isinstance(mine, np.ndarray) and isinstance(theirs, np.ndarray):
        return np.array_equal(mine, theirs, equal_nan=mine.dtype.kind in "fc" and theirs.dtype.kind in "fc")
    if isinstance(mine, np.ndarray) or isinstance(theirs, np.ndarray):
        return False
    if type(mine) is not type(theirs):
        return bool(mine == theirs)
    if _is_table(mine):
        return bool(mine.equals(theirs))
    if isinstance(mine, (tuple, list)):
        return len(mine) == len(theirs) and all(map(_same, mine, theirs))
    if isinstance(mine, dict):
        return mine.keys() == theirs.keys() and all(_same(mine[key], theirs[key]) for key in mine)
    return bool(mine == theirs) or (isinstance(mine, float) and mine != mine and theirs != theirs)


def _is_table(value: Any) -> bool:
    pandas = sys.modules.get("pandas")  # not imported: then there are none
    return pandas is not None and isinstance(value, (pandas.DataFrame, pandas.Series))


def _key(value: Any) -> Any:
    if isinstance(value, np.ndarray) or _is_table(value):
        return value.shape
    if isinstance(value, float) and value != value:
        return "nan"
    try:
        hash(value)
    except TypeError:  # a mapping or a list
        return len(value)
    return value
