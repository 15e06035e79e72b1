"""Agreement of annotators as files.

- `write_agreement`: tables and a picture of each tier.
- `draw_agreement`: the picture: the annotators' tiers above each other, and who called what what.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from signface.files import whole_file
from signface.label.vocabulary import Vocabulary
from signface.metrics.tiers import TierAgreement
from signface.report.colours import colour_of, ink_on
from signface.report.timeline import save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_agreement(agreements: Sequence[TierAgreement], folder: str | PathLike[str]) -> list[Path]:
    """Write `agreement.csv`, and for each tier two confusion tables and a picture.

    Parameters
    ----------
    agreements : sequence of TierAgreement
        What `signface.metrics.tiers.compare_tiers` returns.
    folder : path

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    SignfaceError
        The folder cannot be written.
    """
    files = []

    def write(table: pd.DataFrame, name: str, **how: Any) -> None:
        files.append(Path(folder) / name)
        with whole_file(files[-1]) as temporary:
            table.to_csv(temporary, **how)

    for agreement in agreements:
        stem = "".join(c if c.isalnum() or c in "-_@." else "_" for c in agreement.tier)
        write(agreement.seconds.round(3), f"confusion_{stem}_seconds.csv")
        write(agreement.annotations, f"confusion_{stem}_annotations.csv")
        files.append(Path(folder) / f"agreement_{stem}.png")
        save_figure(draw_agreement(agreement.annotators, agreement.seconds, title=agreement.tier), files[-1])
    tables = pd.concat([agreement.table for agreement in agreements], ignore_index=True)
    write(tables, "agreement.csv", index=False, float_format="%.4f")
    return files


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
    vocabulary = Vocabulary.holding(label for table in annotators.values() for label in table["label"])
    for row, table in enumerate(annotators.values()):
        for start, end, label in table[["start_s", "end_s", "label"]].itertuples(index=False):
            width = end - start
            upper.barh(
                row, width, left=start, height=0.7, color=colour_of(label, vocabulary), edgecolor="white", linewidth=0.5
            )
            if width > 0.012 * span * max(1, len(label)):  # only where the label has room
                ink = ink_on(label, vocabulary)
                upper.text(start + width / 2, row, label, ha="center", va="center", fontsize=8, color=ink)
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
