"""Annotated takes with some of their labels only.

- `restricted`: the labels wanted; what is unknown counts as not annotated, the rest as nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pandas as pd

from signface.label.vocabulary import NONE, Vocabulary
from signface.learn.examples import TOUCHING_S, Example
from signface.segmentation.segments import Segments


def restricted(
    examples: Sequence[Example],
    labels: Sequence[str],
    unknown: Sequence[str] = (),
    *,
    vocabulary: Vocabulary | None = None,
) -> list[Example]:
    """The examples with these labels alone; neighbours of one label become one segment.

    Parameters
    ----------
    examples : sequence of Example
        What is not annotated is `none` (`signface.solve_corpus` without `sparse`).
    labels : sequence of str
        Those to be learnt; others are `none`.
    unknown : sequence of str
        Labels of what belongs to none of these: their segments are not learnt from, and not judged.
    vocabulary : Vocabulary, optional
        Of the labels; made of them when not given.

    Examples
    --------
    >>> import signface as sf
    >>> example = restricted(sf.datasets.mini_examples(), ["J"])[0]
    >>> example.stable["label"].tolist()
    ['none', 'J', 'none', 'J', 'none']
    """
    words = Vocabulary("restricted", tuple(labels)) if vocabulary is None else vocabulary
    kept = []
    for example in examples:
        table = example.stable[~example.stable["label"].isin(unknown)]
        named = table["label"].where(table["label"].isin(labels), NONE)
        rows: list[list[object]] = []
        for start, end, label in zip(table["start_s"], table["end_s"], named, strict=True):
            if rows and rows[-1][3] == label and start - float(str(rows[-1][1])) < TOUCHING_S:
                rows[-1][1] = end
            else:
                rows.append([start, end, "stable", label])
        joined = Segments(pd.DataFrame(rows, columns=["start_s", "end_s", "kind", "label"]), name=example.take)
        kept.append(replace(example, reference=joined, vocabulary=words.with_blank()))
    return kept
