"""What an annotator changed in the machine's annotation, on plain tables.

- `changes`: one row for each annotation that was moved, renamed, added or removed.
- `summarise_changes`: the rows in plain words; `compare_corrections`: of the annotations of a corpus.

A table has the columns `start_s, end_s, label`, in order of time, without overlap.
"""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from signface.metrics.agreement import match_annotations

#: Share of the longer of two annotations that must overlap for one to be a correction of the other.
SAME = 0.3

#: Movements of a boundary below this are none (s): EAF holds whole milliseconds.
STILL_S = 0.0015


def changes(before: pd.DataFrame, after: pd.DataFrame) -> pd.DataFrame:
    """What changed from one table to the other.

    Returns
    -------
    DataFrame
        `start_s, end_s` (after the correction; before it for what was removed), `change` (`moved`, `renamed`,
        `moved and renamed`, `added`, `removed`), `before`, `after` (labels, empty where there is none), `start_by_s`,
        `end_by_s` (how far the boundaries went). Annotations left as they were have no row.
    """
    pairs = match_annotations(before, after, overlap=SAME)
    rows = []
    for i, j in pairs:
        old, new = before.iloc[i], after.iloc[j]
        start_by, end_by = float(new["start_s"] - old["start_s"]), float(new["end_s"] - old["end_s"])
        moved = max(abs(start_by), abs(end_by)) > STILL_S
        renamed = old["label"] != new["label"]
        if moved or renamed:
            what = " and ".join(word for word, true in (("moved", moved), ("renamed", renamed)) if true)
            rows.append((new["start_s"], new["end_s"], what, old["label"], new["label"], start_by, end_by))
    kept, made = {i for i, _ in pairs}, {j for _, j in pairs}
    for i in range(len(before)):
        if i not in kept:
            old = before.iloc[i]
            rows.append((old["start_s"], old["end_s"], "removed", old["label"], "", float("nan"), float("nan")))
    for j in range(len(after)):
        if j not in made:
            new = after.iloc[j]
            rows.append((new["start_s"], new["end_s"], "added", "", new["label"], float("nan"), float("nan")))
    columns = ["start_s", "end_s", "change", "before", "after", "start_by_s", "end_by_s"]
    return pd.DataFrame(rows, columns=columns).sort_values("start_s", ignore_index=True)


def summarise_changes(table: pd.DataFrame, annotations: int) -> list[str]:
    """Lines that say what changed: how many, from what to what, and by how much.

    Parameters
    ----------
    table : DataFrame
        What `changes` returns, of one take or several.
    annotations : int
        How many annotations there were before.
    """
    lines = [f"{len(table)} of {annotations} annotations were changed"]
    renamed = table[table["change"].str.contains("renamed")] if len(table) else table
    if len(renamed):
        pairs = renamed.groupby(["before", "after"]).size().sort_values(ascending=False, kind="stable")
        lines += [f"  renamed {old} -> {new}: {count}" for (old, new), count in pairs.items()]
    moved = table[table["change"].str.contains("moved")] if len(table) else table
    moved = moved[moved["start_by_s"].notna()] if len(moved) else moved
    if len(moved):
        by = pd.concat([moved["start_by_s"], moved["end_by_s"]])
        by = 1000 * by[by.abs() > STILL_S]
        lines.append(
            f"  boundaries moved: {len(by)}, by {by.abs().median():.0f} ms in the median and {by.abs().max():.0f} ms "
            f"at most ({(by > 0).sum()} later, {(by < 0).sum()} earlier)"
        )
    for what in ("added", "removed"):
        count = int((table["change"] == what).sum()) if len(table) else 0
        if count:
            lines.append(f"  {what}: {count}")
    return lines


def compare_corrections(tables: Sequence[tuple[pd.DataFrame, pd.DataFrame] | None]) -> list[str]:
    """Lines that say what annotators changed in a corpus.

    Parameters
    ----------
    tables : sequence of pairs of DataFrame, or None
        For each annotation, before and after; None for those that signface did not write.
    """
    known = [pair for pair in tables if pair is not None]
    lines = []
    if len(known) < len(tables):
        lines.append(
            f"{len(tables) - len(known)} of {len(tables)} annotations were not written by signface: they are learnt "
            "from as they are"
        )
    if known:
        changed = pd.concat([changes(*pair) for pair in known], ignore_index=True)
        lines += summarise_changes(changed, sum(len(before) for before, _ in known))
    return lines
