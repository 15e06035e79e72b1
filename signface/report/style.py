"""How the figures of reports look.

- `styled`: the type and the lines of `style.mplstyle`, for a `with` around drawing and around writing.
- `COLOURS`, `MARKS`: of what is told apart in one figure, in this order; `look`: those of its n-th series.
- `new_figure`: an empty figure; `short_name`: a name that has room in it.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Okabe and Ito's colours without yellow, told apart by colour-blind readers, and marks that differ in print.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#444444")
MARKS = ("o", "s", "D", "^", "v", "P", "X")

#: Letters of a name that figures have room for.
LONGEST_NAME = 18


def styled():  # type: ignore[no-untyped-def]  # a context manager of matplotlib's
    """The style of the figures."""
    import matplotlib

    return matplotlib.rc_context(_parameters())


def look(series: int, line: str = "") -> dict[str, Any]:
    """Colour and mark of a series, by its number; `line` is matplotlib's style of the line through its marks."""
    return {"color": COLOURS[series % len(COLOURS)], "marker": MARKS[series % len(MARKS)], "linestyle": line or "none"}


def new_figure(width: float, height: float, *, padding: tuple[float, float] = (0.06, 0.06)) -> Figure:
    """An empty figure that lays itself out; size and padding (across, down) in inches."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    figure.get_layout_engine().set(w_pad=padding[0], h_pad=padding[1])  # type: ignore[union-attr, call-arg]
    return figure


def short_name(name: str) -> str:
    """A name cut to `LONGEST_NAME` letters."""
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 1]}…"


@cache
def _parameters():  # type: ignore[no-untyped-def]  # a mapping of matplotlib's
    from matplotlib import rc_params_from_file

    return rc_params_from_file(Path(__file__).with_name("style.mplstyle"), use_default_template=False)
