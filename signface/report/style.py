"""How the figures of reports look.

- `styled`: the type and the lines of `style.mplstyle`, for a `with` around drawing and around writing.
- `COLOURS`, `MARKS`: of what is told apart in one figure, in this order.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

#: Okabe and Ito's colours without yellow, told apart by colour-blind readers, and marks that differ in print.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#444444")
MARKS = ("o", "s", "D", "^", "v", "P", "X")


def styled():  # type: ignore[no-untyped-def]  # a context manager of matplotlib's
    """The style of the figures."""
    import matplotlib

    return matplotlib.rc_context(_parameters())


@cache
def _parameters():  # type: ignore[no-untyped-def]  # a mapping of matplotlib's
    from matplotlib import rc_params_from_file

    return rc_params_from_file(Path(__file__).with_name("style.mplstyle"), use_default_template=False)
