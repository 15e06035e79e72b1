"""Compiled loops: compiled at their first call, kept on disk for the next process, and word of it for who waits.

- `compiled`: the decorator of a loop.
- `on_compiling`: have something called when loops begin to be compiled, the one wait of some seconds that a user meets.

Numba is imported by the first loop that is declared, so that a command can ask to be told without importing it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

_waiting: list[Callable[[bool], None]] = []
#: Modules whose loops are compiled here, and the loops for which there is no folder to keep them in.
_modules: set[str] = set()
_unkept: list[str] = []


def on_compiling(call: Callable[[bool], None]) -> None:
    """Have `call(once)` called when loops begin to be compiled in this process; not when they are read from disk.

    `once` is False where no folder can be written to keep them in, so that every process compiles for itself.
    """
    _waiting.append(call)


def tell(*, once: bool) -> None:
    """Tell whoever waits, one time."""
    while _waiting:
        _waiting.pop()(once)


def compiled(*, fastmath: bool | set[str] = False) -> Callable[[Callable], Any]:
    """Compile a function at its first call; it runs without the interpreter's lock.

    Numba keeps it beside its module, or in the user's cache folder where that is read-only. Where neither can be
    written, every process compiles for itself.

    Parameters
    ----------
    fastmath : bool or set of str
        What the compiler may do to sums and products, as numba's; False keeps the order of every operation, so that
        all machines round alike.
    """
    import numba

    def decorate(function: Callable) -> Any:
        _listen()
        loop = numba.njit(nogil=True, error_model="numpy", fastmath=fastmath)(function)
        _modules.add(function.__module__)
        try:
            loop.enable_caching()
        except RuntimeError:
            _unkept.append(function.__name__)
        except AttributeError:  # NUMBA_DISABLE_JIT is set: there is nothing to keep
            pass
        return loop

    return decorate


@cache
def _listen() -> None:
    """Have numba say when it begins to compile one of our loops."""
    from numba.core import event

    class Teller(event.Listener):
        def on_start(self, event: event.Event) -> None:
            if event.data["dispatcher"].py_func.__module__ in _modules:
                tell(once=not _unkept)

        def on_end(self, event: event.Event) -> None:
            """The end needs no word."""

    event.register("numba:compile", Teller())
