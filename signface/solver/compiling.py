"""Word that the solver is being compiled: the one wait of some seconds that a user meets, once on a machine.

Kept apart from `signface.solver.loops` so that a command can ask to be told without importing numba.
"""

from __future__ import annotations

from collections.abc import Callable

_waiting: list[Callable[[bool], None]] = []


def on_compiling(call: Callable[[bool], None]) -> None:
    """Have `call(once)` called when the solver's loops begin to be compiled in this process; not when they are read.

    `once` is False where no folder can be written to keep them in, so that every process compiles for itself.
    """
    _waiting.append(call)


def tell(*, once: bool) -> None:
    """Tell whoever waits, one time."""
    while _waiting:
        _waiting.pop()(once)
