"""A picture of agreement: the annotators' tiers above each other, and who called what what."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from signface.report.colours import colour_of, ink_on

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_agreement(annotators: Mapping[str, pd.DataFrame], seconds: pd.DataFrame, *, title: str = "") -> Figure:
    """Tiers on one time line, and the confusion table of the first two annotators.

    Parameters
    ----------
    annotators : mapping of name to table
        `start_s, end_s, label`.
    seconds : DataFrame
        What `signface.metrics.agreement.confusion` returns for the first two.
    title : str
    """
    from matplotlib.figure import Figure

    count = len(seconds)
    height = 0.6 * len(annotators) + 1.2
    size = max(2.5, 0.34 * count + 1.5)
    figure = Figure(figsize=(10, height + size), layout="constrained")
    upper, lower = figure.subplots(2, 1, height_ratios=[height, size])
    span = max((float(table["end_s"].max()) for table in annotators.values() if len(table)), default=1.0)
    for row, table in enumerate(annotators.values()):
        for start, end, label in table[["start_s", "end_s", "label"]].itertuples(index=False):
            width = end - start
            upper.barh(row, width, left=start, height=0.7, color=colour_of(label), edgecolor="white", linewidth=0.5)
            if width > 0.012 * span * max(1, len(label)):  # only where the label has room
                upper.text(start + width / 2, row, label, ha="center", va="center", fontsize=8, color=ink_on(label))
    upper.set_yticks(range(len(annotators)), list(annotators))
    upper.invert_yaxis()
    upper.set_xlabel("time (s)")
    upper.set_title(title)
    upper.spines[["top", "right"]].set_visible(False)

    values = seconds.to_numpy(float)
    totals = values.sum(axis=1, keepdims=True)
    share = np.divide(values, totals, out=np.zeros_like(values), where=totals >= 0.05)
    lower.imshow(share, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for row, column in np.argwhere(values >= 0.05):
        ink = "white" if share[row, column] > 0.6 else "black"
        lower.text(column, row, f"{values[row, column]:.1f}", ha="center", va="center", fontsize=8, color=ink)
    names = list(annotators)
    lower.set_xticks(range(count), list(seconds.columns), rotation=45 if count > 9 else 0)
    lower.set_yticks(range(count), list(seconds.index))
    lower.set_xlabel(f"{names[1]} (seconds)")
    lower.set_ylabel(names[0])
    return figure
