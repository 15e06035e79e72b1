"""What went wrong in a take, in words.

- `judge_take`: how much of a take is annotated as the reference has it, and the reasons why not more.
- `agreeing_stretches`: a take cut wherever the reference or what was found changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from signface.descriptors import Descriptors
from signface.frames import runs
from signface.label.vocabulary import AFFECT, Vocabulary
from signface.metrics.segmentation import match_boundaries
from signface.segmentation.segments import Segments, value_at

#: A boundary further than this from every other is missed (or one too many): where people would not take it for the
#: same (s).
FAR_S = 0.20

#: Boundaries that are moved, on the whole, by more than this are said to come late or early (s).
SHIFT_S = 0.08

#: What an expression must be taken for another to be mentioned (s).
LEAST_S = 0.20

#: A stretch must be as long as that for its place to be named (s).
LEAST_SHOWN_S = 0.1

#: A residual this many times that of the middle take is called high.
HIGH_RESIDUAL = 1.5

#: Mean confidence below which the classifier is called unsure.
UNSURE = 0.5

#: How many reasons, and how many places of each, are spelt out.
REASONS, PLACES = 6, 3


@dataclass(frozen=True)
class TakeVerdict:
    """How one take went.

    Parameters
    ----------
    take, signer, kind : str
        As in the corpus.
    agreement : float
        Share of the annotated time with the reference's label, all transitions as one; NaN where nothing is annotated.
    n_reference, n_found : int
        Stable segments of the reference and found.
    missed, superfluous : int
        Boundaries of the reference without one found within `FAR_S`, and the other way round.
    reasons : tuple of str
        Clauses, what costs most time first; empty where nothing is wrong.
    """

    take: str
    signer: str
    kind: str
    agreement: float
    n_reference: int
    n_found: int
    missed: int
    superfluous: int
    reasons: tuple[str, ...]


def judge_take(
    reference: Segments,
    found: Segments,
    descriptors: Descriptors | None = None,
    *,
    take: str = "take",
    signer: str = "",
    kind: str = "",
    usual_residual: float | None = None,
    vocabulary: Vocabulary = AFFECT,
) -> TakeVerdict:
    """Compare the annotation found with the reference and say what is wrong.

    Parameters
    ----------
    reference, found : Segments
        Both labelled.
    descriptors : Descriptors, optional
        For the residual and the frames without weights.
    take, signer, kind : str
    usual_residual : float, optional
        Mean residual of the middle take of the corpus (mm), which this one's is held against.
    vocabulary : Vocabulary
        What the labels stand for.

    Examples
    --------
    >>> table = pd.DataFrame({"start_s": [0.0, 1.0, 1.5], "end_s": [1.0, 1.5, 3.0], "label": ["N", "NF", "F"],
    ...                       "kind": ["stable", "transition", "stable"]})
    >>> other = table.assign(label=["N", "NSu", "Su"])
    >>> verdict = judge_take(Segments(table), Segments(other))
    >>> round(verdict.agreement, 3), verdict.reasons
    (0.5, ('fear taken for surprise during 1.5 of its 1.5 s (1.5 to 3.0 s)',))
    """
    parts = agreeing_stretches(reference, found)
    length = parts["end_s"] - parts["start_s"]
    total = float(length.sum())
    right = float(length[parts["truth"] == parts["said"]].sum())
    missed, superfluous, shift = _boundaries(reference.table, found.table)
    reasons = [
        *_confusions(parts, vocabulary),
        *missed.reasons("missed"),
        *superfluous.reasons("found where there is none"),
    ]
    held, there = (int((segments.table["kind"] == "stable").sum()) for segments in (reference, found))
    reasons += _count(held, there, missed.count, superfluous.count)
    if shift is not None:
        reasons.append((abs(shift) * 2, f"boundaries come {abs(shift):.2f} s too {'late' if shift > 0 else 'early'}"))
    ordered = [words for _, words in sorted(reasons, key=lambda reason: -reason[0])][:REASONS]
    if descriptors is not None:
        ordered += _recording(descriptors, usual_residual)
    if ordered and "confidence" in found.table and len(found):
        confidence = float(found.table.loc[found.table["kind"] == "stable", "confidence"].mean())
        if confidence < UNSURE:
            ordered.append(f"the classifier was unsure (mean confidence {confidence:.2f})")
    agreement = right / total if total > 0 else float("nan")
    return TakeVerdict(take, signer, kind, agreement, held, there, missed.count, superfluous.count, tuple(ordered))


def agreeing_stretches(reference: Segments, found: Segments) -> pd.DataFrame:
    """The annotated time of a take, cut wherever the reference or what was found changes.

    Returns
    -------
    DataFrame
        `start_s, end_s, truth, said`; transitions are called `transition` whatever their name, and `said` is empty
        where nothing was found.
    """
    tables = (reference.table, found.table)
    marks = np.unique(np.concatenate([table[["start_s", "end_s"]].to_numpy(float).ravel() for table in tables]))
    start, end = marks[:-1], marks[1:]
    middle = (start + end) / 2
    truth, said = (
        np.where(value_at(table, "kind", middle) == "transition", "transition", value_at(table, "label", middle))
        for table in tables
    )
    parts = pd.DataFrame({"start_s": start, "end_s": end, "truth": truth, "said": said})
    return parts[(parts["truth"] != "") & (end - start > 1e-6)].reset_index(drop=True)


@dataclass(frozen=True)
class _Lonely:
    """Boundaries of one table without a counterpart in the other, in runs that no matched boundary interrupts."""

    runs: tuple[np.ndarray, ...]
    of: int

    @property
    def count(self) -> int:
        return sum(len(run) for run in self.runs)

    def reasons(self, what: str) -> list[tuple[float, str]]:
        """At most one clause, weighed by how many boundaries there are."""
        if not self.count:
            return []
        longest = sorted(self.runs, key=lambda run: (-len(run), run[0]))[:PLACES]
        single = len(self.runs) == 1
        shown = [("" if single else f"{len(run)} ") + _when(run) for run in sorted(longest, key=lambda run: run[0])]
        rest = "" if len(self.runs) <= PLACES else ", and elsewhere"
        noun = f"{self.count} {'boundary' if self.count == 1 else 'boundaries'} {what}"
        return [(0.2 * self.count, f"{noun}{' ' if single else ': '}{', '.join(shown)}{rest}")]


def _when(run: np.ndarray) -> str:
    """`at 2.1 s` or `between 2.1 and 3.0 s`."""
    if len(run) == 1:
        return f"at {run[0]:.1f} s"
    return f"between {run[0]:.1f} and {run[-1]:.1f} s"


def _boundaries(reference: pd.DataFrame, found: pd.DataFrame) -> tuple[_Lonely, _Lonely, float | None]:
    """Boundaries missed, boundaries too many, and how far the others are moved on the whole (s), where that is much."""
    first, second, pairs = match_boundaries(reference, found, tolerance_s=FAR_S)
    missed = _runs(first, [i for i, _ in pairs])
    superfluous = _runs(second, [j for _, j in pairs])
    moved = np.array([second[j] - first[i] for i, j in pairs])
    shift = float(np.median(moved)) if len(moved) >= 4 else 0.0
    return missed, superfluous, shift if abs(shift) > SHIFT_S else None


def _runs(boundaries: np.ndarray, matched: Sequence[int]) -> _Lonely:
    lonely = np.ones(len(boundaries), bool)
    lonely[np.asarray(matched, dtype=int)] = False
    return _Lonely(tuple(boundaries[start:end] for start, end in runs(lonely)), len(boundaries))


def _confusions(parts: pd.DataFrame, vocabulary: Vocabulary) -> list[tuple[float, str]]:
    """`fear taken for surprise during 1.2 of its 3.0 s (at ...)`, weighed by the seconds."""
    parts = parts.assign(length=parts["end_s"] - parts["start_s"])
    held = parts[parts["truth"].isin(vocabulary.values)]
    reasons = []
    for (truth, said), own in held[held["said"] != held["truth"]].groupby(["truth", "said"]):
        seconds = float(own["length"].sum())
        if (
            said not in vocabulary.values or seconds < LEAST_S
        ):  # what a transition takes of an expression is told as boundaries
            continue
        whole = float(held.loc[held["truth"] == truth, "length"].sum())
        places = [place for place in _joined(own) if place[1] - place[0] >= LEAST_SHOWN_S]
        shown = sorted(sorted(places, key=lambda place: place[0] - place[1])[:PLACES])
        spelt = ", ".join(f"{start:.1f} to {end:.1f} s" for start, end in shown) or "in short stretches"
        more = ", and elsewhere" if len(places) > PLACES else ""
        shown_as, taken_for = vocabulary.describe(str(truth)), vocabulary.describe(str(said))
        words = f"{shown_as} taken for {taken_for} during {seconds:.1f} of its {whole:.1f} s"
        reasons.append((seconds, f"{words} ({spelt}{more})"))
    return reasons


def _joined(parts: pd.DataFrame) -> list[tuple[float, float]]:
    """Stretches with those that touch made into one."""
    joined: list[tuple[float, float]] = []
    for start, end in parts[["start_s", "end_s"]].itertuples(index=False):
        if joined and start - joined[-1][1] < 1e-6:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((start, end))
    return joined


def _count(reference: int, found: int, missed: int, superfluous: int) -> list[tuple[float, str]]:
    """Far too many or far too few segments, where the boundaries say so too."""
    words = f"{found} stable segment{'s' * (found != 1)} found for {reference} in the reference"
    if found == 0:
        return [(np.inf, f"no stable segment found for {reference} in the reference")]
    if found >= 1.4 * reference and superfluous > missed:
        return [(0.2 * superfluous + 0.01, f"cut too often: {words}")]
    if reference >= 1.4 * found and missed > superfluous:
        return [(0.2 * missed + 0.01, f"cut too seldom: {words}")]
    return []


def _recording(descriptors: Descriptors, usual_residual: float | None) -> list[str]:
    """What the recording itself may be blamed for."""
    reasons = []
    residual = descriptors.residual
    assert residual is not None
    if usual_residual and np.isfinite(residual).any():
        own = float(np.nanmean(residual))
        if own > HIGH_RESIDUAL * usual_residual:
            reasons.append(
                f"the solved face lies {own:.2f} mm from the markers, in the middle take {usual_residual:.2f} mm"
            )
    blind = ~np.isfinite(descriptors.weights).all(axis=1)
    if blind.mean() > 0.005:
        blind_runs = runs(blind)
        start, end = blind_runs[np.argmax(blind_runs[:, 1] - blind_runs[:, 0])] / descriptors.rate + descriptors.start
        share = f"{100 * blind.mean():.0f} %" if blind.mean() >= 0.01 else "a few"
        reasons.append(f"{share} of the frames have no weights, the longest stretch from {start:.1f} to {end:.1f} s")
    return reasons
