"""Draw the pictures of docs/elan-tutorial.md: python build_elan_tutorial.py FOLDER

FOLDER is where the tutorial's commands were run; the pictures are written beside this script.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from signface.elan.channels import COLOURS
from signface.elan.curves import CURVES
from signface.elan.reference import read_tiers
from signface.label.vocabulary import AFFECT
from signface.report.colours import colour_of, ink_on
from signface.report.timeline import save_figure

HERE = Path(__file__).parent


def draw_tiers(eaf: Path, curves: Path) -> Figure:
    """The panels of curves and the filled tiers of a file on one time line."""
    table = pd.read_csv(curves)
    tiers = {name: rows for name, rows in read_tiers(eaf).items() if len(rows)}
    panels: dict[int, list[str]] = {}
    for name in table.columns[1:]:
        panels.setdefault(CURVES[name].panel, []).append(name)
    heights = [1.0 if panel != 3 else 1.8 for panel in panels] + [0.36 * len(tiers)]
    figure = Figure(figsize=(10, sum(heights) + 0.6), layout="constrained")
    *upper, lower = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    for axes, names in zip(upper, panels.values(), strict=True):
        for name in names:
            colour = [part / 255 for part in CURVES[name].colour]
            axes.plot(table["#time_s"], table[name], color=colour, lw=1, label=name)
        axes.legend(loc="upper right", fontsize=7, frameon=False, ncols=4)
        axes.set_ylim(0, 1.35 * table[names].max(axis=None))
    for row, rows in enumerate(tiers.values()):
        values = {value: number for number, value in enumerate(dict.fromkeys(rows["label"]))}
        for start, end, label in rows[["start_s", "end_s", "label"]].itertuples(index=False):
            known = label in AFFECT.values or AFFECT.is_transition(label)
            colour = colour_of(label) if known else [part / 255 for part in COLOURS[values[label] % len(COLOURS)]]
            lower.barh(row, end - start, left=start, height=0.8, color=colour, edgecolor="grey", linewidth=0.4)
            if end - start > 0.06 * max(1, len(label)):
                ink = ink_on(label) if known else "black"
                lower.text((start + end) / 2, row, label, ha="center", va="center", fontsize=7, color=ink)
    lower.set_yticks(range(len(tiers)), list(tiers), fontsize=8)
    lower.invert_yaxis()
    lower.set_xlabel("time (s)")
    lower.set_xlim(0, table["#time_s"].iloc[-1])
    for axes in (*upper, lower):
        axes.spines[["top", "right"]].set_visible(False)
    return figure


if __name__ == "__main__":
    place = Path(sys.argv[1])
    shutil.copy(place / "mine/M1_EU_11.png", HERE / "elan-tutorial-take.png")
    shutil.copy(next(place.glob("agreement/agreement_affect@M1.png")), HERE / "elan-tutorial-agreement.png")
    save_figure(draw_tiers(place / "machine.eaf", place / "mine/M1_EU_11.curves.csv"), HERE / "elan-tutorial-tiers.png")
