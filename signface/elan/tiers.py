"""Tiers as plain objects, before they become EAF.

- `Tier`: a time-aligned tier and the tiers that depend on it by symbolic association.
- `milliseconds`: seconds to the whole milliseconds of EAF, without gaps, overlaps or empty annotations appearing.
- `label_tier`: the tiers `affect@SIGNER`, `affect-confidence@SIGNER` and `intensity@SIGNER` from labelled segments.
- `in_annotation_time`: a tier of the film in a document that begins later or earlier than the film.
- `doubtful_tier`: the segments whose confidence is low, on a tier of their own.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd

from signface.content import Content
from signface.errors import SignfaceError
from signface.label.vocabulary import AFFECT, INTENSITY, Vocabulary
from signface.segmentation.segments import Segments
from signface.trust import Stretch


@dataclass(frozen=True, eq=False)
class Tier(Content):
    """A time-aligned tier of one channel of one signer.

    Parameters
    ----------
    channel : str
        What is annotated: `affect`, `brows`, ... It names the linguistic type as well.
    signer : str
        The participant; empty for a tier without `@`.
    start_ms, end_ms : (n,) int64 array
        Times of the annotations in milliseconds, in order, without overlap.
    values : (n,) tuple of str
    vocabulary : Vocabulary, optional
        The closed vocabulary of the values.
    dependents : tuple of DependentTier

    Raises
    ------
    SignfaceError
        Annotations overlap, are empty, out of order or before time 0, or a value is not in the vocabulary.
    """

    channel: str
    signer: str
    start_ms: np.ndarray
    end_ms: np.ndarray
    values: tuple[str, ...]
    vocabulary: Vocabulary | None = None
    dependents: tuple[DependentTier, ...] = field(default=())

    def __post_init__(self) -> None:
        if not len(self.start_ms) == len(self.end_ms) == len(self.values):
            raise SignfaceError(f"tier {self.name}: times and values are not of one length")
        if (self.start_ms >= self.end_ms).any() or (self.start_ms[1:] < self.end_ms[:-1]).any():
            raise SignfaceError(f"tier {self.name}: annotations overlap, are empty or out of order")
        if len(self.start_ms) and self.start_ms[0] < 0:
            raise SignfaceError(f"tier {self.name}: an annotation starts before time 0")
        if self.vocabulary is not None:
            self.vocabulary.check(list(self.values), f"tier {self.name}")

    @property
    def name(self) -> str:
        """The `TIER_ID`: `CHANNEL@SIGNER`."""
        return tier_name(self.channel, self.signer)


@dataclass(frozen=True)
class DependentTier:
    """A tier whose annotations hang on those of its parent by symbolic association.

    Parameters
    ----------
    channel : str
    values : (n,) tuple of str or None
        One for each annotation of the parent; None where there is none.
    vocabulary : Vocabulary, optional
    """

    channel: str
    values: tuple[str | None, ...]
    vocabulary: Vocabulary | None = None


def milliseconds(start_s: np.ndarray, end_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Round times in seconds to whole milliseconds.

    Two segments that touch (within half a millisecond) still touch afterwards, none overlaps another, and none is
    shorter than a millisecond.

    Parameters
    ----------
    start_s, end_s : (n,) arrays
        In order, without overlap.

    Returns
    -------
    start_ms, end_ms : (n,) int64 arrays
    """
    starts = np.floor(np.asarray(start_s, float) * 1000 + 0.5).astype(np.int64)
    ends = np.floor(np.asarray(end_s, float) * 1000 + 0.5).astype(np.int64)
    for i in range(len(starts)):
        if i and (starts[i] < ends[i - 1] or abs(start_s[i] - end_s[i - 1]) < 0.0005):
            starts[i] = ends[i - 1]
        ends[i] = max(ends[i], starts[i] + 1)
    return starts, ends


def label_tier(
    segments: Segments, signer: str = "", *, channel: str = "affect", vocabulary: Vocabulary = AFFECT
) -> Tier:
    """The tier `CHANNEL@SIGNER` and what depends on it.

    Segments that end before time 0 (a take that began before its video) are left out and one that contains it is
    cut there: EAF has no negative times.

    Parameters
    ----------
    segments : Segments
        With `label`; a `confidence` column (0 to 1) gives `CHANNEL-confidence@SIGNER`, an `intensity` column (1, 2
        or 3, missing where not annotated) gives `intensity@SIGNER`.
    signer : str
        Empty for a tier without `@`.
    channel : str
        What was labelled.
    vocabulary : Vocabulary
        The labels allowed. Its blank, where it has one, is not written.

    Raises
    ------
    SignfaceError
        The segments carry no label, or one outside the vocabulary.
    """
    table, start_ms, end_ms = _after_time_0(segments, vocabulary)
    dependents = []
    if "confidence" in table.columns:
        numbers = table["confidence"].to_numpy(float)
        texts = tuple(f"{number:.2f}" if np.isfinite(number) else None for number in numbers)
        dependents.append(DependentTier(f"{channel}-confidence", texts))
    if "intensity" in table.columns:
        numbers = table["intensity"].to_numpy(float)
        texts = tuple(f"{number:g}" if np.isfinite(number) else None for number in numbers)
        INTENSITY.check([value for value in texts if value is not None], f"{segments.name}: intensity")
        dependents.append(DependentTier("intensity", texts, INTENSITY))
    labels = tuple(str(label) for label in table["label"])
    return Tier(channel, signer, start_ms, end_ms, labels, vocabulary, tuple(dependents))


def doubtful_tier(
    segments: Segments,
    signer: str = "",
    *,
    below: float | None = 0.5,
    untrusted: Sequence[Stretch] = (),
    channel: str = "affect",
    vocabulary: Vocabulary = AFFECT,
) -> Tier:
    """The tier `CHANNEL-doubtful@SIGNER`: the segments whose confidence is low, for an annotator to go through first.

    So are those that reach into a stretch in which the solved face lies too far from the markers.

    Parameters
    ----------
    segments : Segments
        With `label` and `confidence`.
    signer : str
    below : float
        Segments with a confidence under it are taken; None for none of them.
    untrusted : sequence of Stretch
        Stretches that cannot be trusted (`signface.trust.untrusted`).
    channel : str
    vocabulary : Vocabulary

    Raises
    ------
    SignfaceError
        As `label_tier`, or the segments carry no confidence.
    """
    table, start_ms, end_ms = _after_time_0(segments, vocabulary)
    low = np.zeros(len(table), dtype=bool)
    if below is not None:
        if "confidence" not in table.columns:
            raise SignfaceError(f"{segments.name}: the segments carry no confidence", hint="label them first")
        low = table["confidence"].to_numpy(float) < below
    for one in untrusted:
        low |= ((table["start_s"] < one.end_s) & (table["end_s"] > one.start_s)).to_numpy(bool)
    labels = tuple(str(label) for label in table["label"][low])
    return Tier(f"{channel}-doubtful", signer, start_ms[low], end_ms[low], labels, vocabulary)


def in_annotation_time(tier: Tier, origin_ms: int) -> Tier:
    """A tier in the clock of the film as it stands in a document whose time 0 is `origin_ms` in the film.

    What lies before that is left out, and an annotation that contains it begins there.

    Examples
    --------
    >>> tier = Tier("brows", "", np.array([0, 800, 2000]), np.array([500, 1500, 2500]), ("up", "down", "up"))
    >>> moved = in_annotation_time(tier, 1000)
    >>> moved.start_ms.tolist(), moved.end_ms.tolist(), moved.values
    ([0, 1000], [500, 1500], ('down', 'up'))
    """
    if not origin_ms:
        return tier
    start, end = tier.start_ms - origin_ms, tier.end_ms - origin_ms
    kept = end > 0

    def chosen(values: tuple) -> tuple:
        return tuple(value for value, keep in zip(values, kept, strict=True) if keep)

    return replace(
        tier,
        start_ms=start[kept].clip(min=0),
        end_ms=end[kept],
        values=chosen(tier.values),
        dependents=tuple(replace(child, values=chosen(child.values)) for child in tier.dependents),
    )


def _after_time_0(segments: Segments, vocabulary: Vocabulary) -> tuple[pd.DataFrame, np.ndarray, np.ndarray]:
    """The labelled rows that lie after time 0 and are written, and their times in milliseconds."""
    if not segments.labelled:
        raise SignfaceError(f"{segments.name}: the segments carry no labels", hint="label them first")
    table = segments.table[segments.table["end_s"] > 0.0005]
    if vocabulary.blank:
        table = table[table["label"] != vocabulary.blank]
    start_ms, end_ms = milliseconds(table["start_s"].clip(lower=0).to_numpy(float), table["end_s"].to_numpy(float))
    return table, start_ms, end_ms


def tier_name(channel: str, signer: str) -> str:
    """`CHANNEL@SIGNER`, or `CHANNEL` where no signer is named; the signer's name as `clean_name` gives it."""
    clean = clean_name(signer)
    return f"{channel}@{clean}" if clean else channel


def clean_name(text: str) -> str:
    """A name as it stands in an attribute: `xml_text` with single spaces."""
    return " ".join(xml_text(text).split())


def xml_text(text: str) -> str:
    """Text in which the characters that XML cannot hold (control characters, halves of surrogate pairs) are spaces."""
    return re.sub("[\x00-\x08\x0b-\x1f\x7f\ud800-\udfff\ufffe\uffff]", " ", text)
