"""Packages that only some of signface needs: the extras of `pip install 'signface[...]'`.

- `needed`: import one, or say what to install.
- `version_of`: the version of an installed package.
"""

from __future__ import annotations

import importlib
from types import ModuleType

from signface.errors import SignfaceError


def needed(module: str, extra: str) -> ModuleType:
    """Import a module of an extra.

    Raises
    ------
    SignfaceError
        It is not installed; the message names the extra.

    Examples
    --------
    >>> needed("pandas", "study").DataFrame({"marker": ["LBRO"]}).shape
    (1, 1)
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module.partition(".")[0]:
            raise
        raise SignfaceError(
            f"the package {error.name} is not installed", hint=f"pip install 'signface[{extra}]'"
        ) from error


def version_of(package: str) -> str:
    """The version of an installed package, `not installed` where it is absent."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
