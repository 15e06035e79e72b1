"""What a comparison of layouts found, from its table of errors.

- `flattening`: from how many markers on the error hardly falls.
- `against`: one layout beside another on the same actors, mappings and draws.
- `same_size`: the optimised layouts beside the empirical ones of about their size.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

#: A curve has flattened where its error lies within this share of its least.
FLAT = 0.05
#: Layouts whose numbers of markers differ by no more than this are of one size.
NEAR = 2

_KEYS = ["condition", "draw", "mapping", "train", "test"]


def flattening(table: pd.DataFrame) -> pd.DataFrame:
    """For each family with at least three sizes, by condition and mapping.

    Returns
    -------
    table
        family, condition, mapping, least_mm (the curve's least error), at (its number of markers), enough (the fewest
        markers within 5 % of it), first_mm (the error with the fewest markers).
    """
    means = table.groupby(["family", "condition", "mapping", "markers"], sort=False)["rms_mm"].mean().reset_index()
    rows = []
    for (family, condition, mapping), curve in means.groupby(["family", "condition", "mapping"], sort=False):
        if len(curve) < 3:
            continue
        curve = curve.sort_values("markers")
        error, markers = curve["rms_mm"].to_numpy(), curve["markers"].to_numpy()
        least = int(error.argmin())
        enough = int(markers[error <= (1.0 + FLAT) * error[least]].min())
        rows.append((family, condition, mapping, error[least], int(markers[least]), enough, error[0]))
    names = ["family", "condition", "mapping", "least_mm", "at", "enough", "first_mm"]
    return pd.DataFrame(rows, columns=names)


def against(table: pd.DataFrame, one: str, other: str) -> pd.DataFrame:
    """Errors of one layout minus another's, pair by pair (same actors, draw and mapping).

    Returns
    -------
    table
        condition, mapping, one_mm, other_mm, change (share by which `one` errs less, negative: more), better (share of
        the pairs in which it errs less), pairs.
    """
    joined = table[table["layout"] == one].merge(table[table["layout"] == other], on=_KEYS, suffixes=("", "_other"))
    rows = []
    for (condition, mapping), pairs in joined.groupby(["condition", "mapping"], sort=False):
        mean, rival = pairs["rms_mm"].mean(), pairs["rms_mm_other"].mean()
        better = float((pairs["rms_mm"] < pairs["rms_mm_other"]).mean())
        rows.append((condition, mapping, mean, rival, 1.0 - mean / rival, better, len(pairs)))
    return pd.DataFrame(rows, columns=["condition", "mapping", "one_mm", "other_mm", "change", "better", "pairs"])


def same_size(table: pd.DataFrame, empirical: tuple[str, ...] = ("man", "star", "default")) -> pd.DataFrame:
    """Each optimised layout beside every empirical one of the same size.

    Returns
    -------
    table
        layout, rival, condition, mapping, change (as for `against`), better.
    """
    sizes = table.drop_duplicates("layout").set_index("layout")[["family", "markers"]]
    rows = []
    for layout, size in sizes.iterrows():
        if size["family"] in empirical:
            continue
        for rival, other in sizes.iterrows():
            if other["family"] in empirical and abs(other["markers"] - size["markers"]) <= NEAR:
                for r in against(table, str(layout), str(rival)).itertuples(index=False):
                    rows.append((layout, rival, r.condition, r.mapping, r.change, r.better))
    return pd.DataFrame(rows, columns=["layout", "rival", "condition", "mapping", "change", "better"])


def mean_moment(cells: list, layout: str, condition: str, mapping: str) -> np.ndarray:
    """The mean second moment of the weights' errors of a layout (`signface.placement.evaluation.error_map`)."""
    return np.mean(
        [
            errors.moment
            for cell in cells
            if cell.layout == layout and cell.condition == condition
            for errors in cell.errors
            if errors.mapping == mapping
        ],
        axis=0,
    )
