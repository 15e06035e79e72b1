"""How well two segmentations of a take agree, on plain tables of segments.

- `boundary_f1`: boundaries found within a tolerance, both ways; `match_boundaries`: which of them.
- `mean_iou`: overlap of each segment with its best counterpart.
- `frame_agreement`: share of the time on which both say stable, or both say transition.
- `over_segmentation`, `under_segmentation`: segments that are cut into several, either way.
- `edit_score`: whether the order of the segments is the same.
- `segmentation_metrics`: all of them over the takes of a corpus.

`boundary_f1`, `mean_iou` and `frame_agreement` are symmetric, lie between 0 and 1, and are 1 for equal tables. A table
has the columns `start_s`, `end_s` and `kind`, in time order. Only the time that both tables cover is compared.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd

from signface.segmentation.segments import value_at

#: Tolerances at which boundaries are compared (s).
TOLERANCES_S = (0.05, 0.10, 0.20)


def boundary_f1(reference: pd.DataFrame, found: pd.DataFrame, *, tolerance_s: float = 0.10) -> float:
    """F1 of the boundaries between segments: `2 * matched / (boundaries of one + boundaries of the other)`.

    See `match_boundaries`. 1 if neither table has any.

    Examples
    --------
    >>> one = pd.DataFrame({"start_s": [0, 1.0], "end_s": [1.0, 2], "kind": ["stable", "transition"]})
    >>> other = pd.DataFrame({"start_s": [0, 1.2], "end_s": [1.2, 2], "kind": ["stable", "transition"]})
    >>> boundary_f1(one, other, tolerance_s=0.1), boundary_f1(one, other, tolerance_s=0.3)
    (0.0, 1.0)
    """
    matched, total = _matches(reference, found, tolerance_s)
    return 1.0 if total == 0 else 2 * matched / total


def match_boundaries(
    reference: pd.DataFrame, found: pd.DataFrame, *, tolerance_s: float = 0.10
) -> tuple[np.ndarray, np.ndarray, list[tuple[int, int]]]:
    """The boundaries of both tables in the time that both cover, and which of them belong together.

    Each is matched with at most one of the other table, no further than the tolerance, and the number of matches is
    the largest possible. Where the common time begins and ends is no boundary.

    Returns
    -------
    (A,) and (B,) arrays of seconds, and pairs of rows of the one and the other.

    Examples
    --------
    >>> one = pd.DataFrame({"start_s": [0, 1.0, 2.0], "end_s": [1.0, 2.0, 3.0]})
    >>> other = pd.DataFrame({"start_s": [0, 1.9], "end_s": [1.9, 3.0]})
    >>> match_boundaries(one, other, tolerance_s=0.2)[2]
    [(1, 0)]
    """
    span = _common_span(reference, found)
    first, second = _boundaries(reference, *span), _boundaries(found, *span)
    return first, second, match_times(first, second, tolerance_s)


def match_times(first: np.ndarray, second: np.ndarray, tolerance_s: float) -> list[tuple[int, int]]:
    """Pairs of places in two rising arrays of times (s), each in one pair at most, as many as there can be.

    Examples
    --------
    >>> match_times(np.array([1.0, 2.0]), np.array([1.9, 2.05]), 0.2)
    [(1, 0)]
    """
    pairs = []
    i = j = 0
    while i < len(first) and j < len(second):  # with one tolerance for all, taking the earliest pair is optimal
        if abs(first[i] - second[j]) <= tolerance_s + 1e-9:
            pairs.append((i, j))
            i, j = i + 1, j + 1
        elif first[i] < second[j]:
            i += 1
        else:
            j += 1
    return pairs


def mean_iou(reference: pd.DataFrame, found: pd.DataFrame) -> float:
    """Mean, over the segments of both tables, of the largest intersection over union with one of the other table.

    Only segments of the same kind are counterparts. 1 if both tables are empty.
    """
    values = _ious(reference, found)
    return 1.0 if len(values) == 0 else float(np.mean(values))


def frame_agreement(reference: pd.DataFrame, found: pd.DataFrame) -> float:
    """Share of the common time on which both tables name the same kind (or neither names one).

    It is counted on exact times and so does not depend on a frame rate. 1 if there is no common time.
    """
    same, common = _agreeing_time(reference, found)
    return 1.0 if common == 0 else same / common


def over_segmentation(reference: pd.DataFrame, found: pd.DataFrame) -> float:
    """Share of the reference's stable segments that are cut: two or more stable ones found lie mostly in them."""
    cut, total = _cut(reference, found)
    return 0.0 if total == 0 else cut / total


def under_segmentation(reference: pd.DataFrame, found: pd.DataFrame) -> float:
    """Share of the stable segments found in which two or more of the reference's stable segments mostly lie."""
    return over_segmentation(found, reference)


def edit_score(reference: pd.DataFrame, found: pd.DataFrame) -> float:
    """One less the edit distance of the two orders of segments, over the length of the longer (Lea et al. 2017).

    The orders are those of the labels where both tables have them, else of the kinds. It asks whether everything
    happened and in which order, not when. 1 if both tables are empty.

    Examples
    --------
    >>> one = pd.DataFrame({"start_s": [0, 1.0, 2], "end_s": [1.0, 2, 3], "kind": ["stable", "transition", "stable"]})
    >>> edit_score(one, one), round(edit_score(one, one[:2]), 2)
    (1.0, 0.67)
    """
    column = "label" if "label" in reference and "label" in found else "kind"
    first, second = reference[column].tolist(), found[column].tolist()
    if not first and not second:
        return 1.0
    row = list(range(len(second) + 1))
    for i, one in enumerate(first, start=1):
        before, row[0] = row[0], i
        for j, other in enumerate(second, start=1):
            before, row[j] = row[j], min(row[j] + 1, row[j - 1] + 1, before + (one != other))
    return 1 - row[-1] / max(len(first), len(second))


def _cut(whole: pd.DataFrame, parts: pd.DataFrame) -> tuple[int, int]:
    """How many stable segments of the one table hold two or more of the other, and how many there are."""
    (start, end), (begin, stop) = (
        table.loc[table["kind"] == "stable", ["start_s", "end_s"]].to_numpy(float).T for table in (whole, parts)
    )
    overlap = np.minimum(end[:, None], stop) - np.maximum(start[:, None], begin)
    inside = overlap > 0.5 * (stop - begin)
    return int((inside.sum(axis=1) >= 2).sum()), len(start)


def segmentation_metrics(pairs: Iterable[tuple[pd.DataFrame, pd.DataFrame]]) -> dict:
    """The metrics over several takes: boundaries, segments and seconds are pooled, so that long takes count more.

    Parameters
    ----------
    pairs : iterable of (DataFrame, DataFrame)
        Reference and found segments of each take.

    Returns
    -------
    dict
        `boundary_f1` (by tolerance), `mean_iou`, `frame_agreement`, and how many segments there were
        (`n_reference`, `n_found`); `over_segmentation`, `under_segmentation` and `edit_score` (mean over the takes).
    """
    tables = [(reference, found) for reference, found in pairs]
    scores: dict = {"boundary_f1": {}}
    for tolerance in TOLERANCES_S:
        counts = np.array([_matches(*pair, tolerance) for pair in tables]).reshape(-1, 2).sum(axis=0)
        scores["boundary_f1"][f"{tolerance:.2f}"] = 1.0 if counts[1] == 0 else float(2 * counts[0] / counts[1])
    ious = np.concatenate([np.zeros(0), *(_ious(*pair) for pair in tables)])
    times = np.array([_agreeing_time(*pair) for pair in tables]).reshape(-1, 2).sum(axis=0)
    scores["mean_iou"] = float(ious.mean()) if len(ious) else 1.0
    scores["frame_agreement"] = float(times[0] / times[1]) if times[1] else 1.0
    for name, flipped in (("over_segmentation", False), ("under_segmentation", True)):
        cut = np.array([_cut(*(pair[::-1] if flipped else pair)) for pair in tables]).reshape(-1, 2).sum(axis=0)
        scores[name] = float(cut[0] / cut[1]) if cut[1] else 0.0
    scores["edit_score"] = float(np.mean([edit_score(*pair) for pair in tables])) if tables else 1.0
    scores["n_reference"] = sum(len(reference) for reference, _ in tables)
    scores["n_found"] = sum(len(found) for _, found in tables)
    return scores


def _common_span(reference: pd.DataFrame, found: pd.DataFrame) -> tuple[float, float]:
    """Start and end of the time that both tables cover; an empty span if there is none."""
    if reference.empty or found.empty:
        return 0.0, 0.0
    start = max(reference["start_s"].iloc[0], found["start_s"].iloc[0])
    end = min(reference["end_s"].iloc[-1], found["end_s"].iloc[-1])
    return float(start), float(max(start, end))


def _boundaries(table: pd.DataFrame, start: float, end: float) -> np.ndarray:
    """Times strictly inside the span at which a segment starts or ends."""
    marks = np.unique(table[["start_s", "end_s"]].to_numpy(float).round(6))
    return marks[(marks > start + 1e-6) & (marks < end - 1e-6)]


def _matches(reference: pd.DataFrame, found: pd.DataFrame, tolerance_s: float) -> tuple[int, int]:
    """The largest number of pairs within the tolerance, and the number of boundaries of both tables together."""
    first, second, pairs = match_boundaries(reference, found, tolerance_s=tolerance_s)
    return len(pairs), len(first) + len(second)


def _ious(reference: pd.DataFrame, found: pd.DataFrame) -> np.ndarray:
    """Best intersection over union of each segment of both tables that lies in the common time."""
    span = _common_span(reference, found)
    (one, one_kind), (other, other_kind) = (_clipped(table, *span) for table in (reference, found))
    if len(one) == 0 and len(other) == 0:
        return np.zeros(0)
    overlap = np.minimum(one[:, None, 1], other[None, :, 1]) - np.maximum(one[:, None, 0], other[None, :, 0])
    overlap = np.where(one_kind[:, None] == other_kind[None, :], np.maximum(overlap, 0), 0)
    lengths = (one[:, 1] - one[:, 0])[:, None] + (other[:, 1] - other[:, 0])[None, :]
    iou = overlap / (lengths - overlap)
    return np.concatenate([iou.max(axis=1, initial=0), iou.max(axis=0, initial=0)])


def _clipped(table: pd.DataFrame, start: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Spans and kinds of the segments, cut to a span of time."""
    spans = table[["start_s", "end_s"]].to_numpy(float).clip(start, end)
    inside = spans[:, 1] - spans[:, 0] > 1e-9
    return spans[inside], table["kind"].to_numpy(str)[inside]


def _agreeing_time(reference: pd.DataFrame, found: pd.DataFrame) -> tuple[float, float]:
    """Seconds on which both tables name the same kind, and seconds that both cover."""
    start, end = _common_span(reference, found)
    if end <= start:
        return 0.0, 0.0
    marks = np.unique(np.concatenate([[start, end], *(_boundaries(table, start, end) for table in (reference, found))]))
    middles, lengths = (marks[1:] + marks[:-1]) / 2, np.diff(marks)
    same = value_at(reference, "kind", middles) == value_at(found, "kind", middles)
    return float(lengths[same].sum()), float(lengths.sum())
