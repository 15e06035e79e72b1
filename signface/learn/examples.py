"""Annotated takes, as what classifiers learn from.

- `Example`: a solved take with its reference annotation.
- `training_frames`: the frames of one that a classifier learns from.
- `frame_table`: those of many, with the take and the signer of each, for scikit-learn.
- `common_bases`, `common_vocabulary`: what they must share.
- `in_order`: takes in an order that does not depend on the corpus's.
- `signer_levels`: what each signer's weights are normalised by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pandas as pd

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.label.courses import segment_courses
from signface.label.variants import DescriptorVariant
from signface.label.vocabulary import AFFECT, Vocabulary
from signface.segmentation.segments import Segments
from signface.settings.choices import BY_SIGNER
from signface.signer_level import SignerLevel, signer_level

#: Frames per second kept for training: a held face hardly changes in a tenth of a second.
TRAINING_RATE = 10.0

#: How long a transition lasts where annotators mark its moment only (s).
TRANSITION_S = 0.16

#: Segments nearer to each other than this touch (s): EAF holds whole milliseconds.
TOUCHING_S = 0.0015


class FrameTable(NamedTuple):
    """Frames as scikit-learn wants them.

    Parameters
    ----------
    X : (K, columns) array
        Descriptors of the frames.
    y : (K,) array of str
        Their labels.
    takes, signers : (K,) arrays of str
        Where each frame is from: groups for `GroupKFold`, `LeaveOneGroupOut` and the like.
    """

    X: np.ndarray
    y: np.ndarray
    takes: np.ndarray
    signers: np.ndarray


@dataclass(frozen=True)
class Example:
    """A solved take with its reference annotation.

    Parameters
    ----------
    take : str
        Name of the take, unique in its corpus.
    signer, kind : str
        As in the corpus (`IE`, `SE`, `EU` or any other word).
    descriptors : Descriptors
    reference : Segments
        With the column `label`: labels of stable segments, names of transitions; perhaps `intensity` (1, 2 or 3).
    sentence : str, optional
        What is signed, where the corpus names it: takes of one sentence are alike.
    vocabulary : Vocabulary
        Of the reference's labels.
    tier : str
        What was annotated: `affect`, or the tier's name without its signer.
    level : SignerLevel, optional
        Where the signer's face rests, where the corpus says so (`signface.corpus.signers`).

    See Also
    --------
    signface.solve_corpus : the examples of a corpus.

    Examples
    --------
    >>> import signface as sf
    >>> example = sf.datasets.mini_examples()[0]
    >>> example.take, example.signer, example.kind
    ('M1_IE_J', 'M1', 'IE')
    >>> example.stable["label"].tolist()
    ['N', 'J', 'N', 'J', 'N']
    """

    take: str
    signer: str
    kind: str
    descriptors: Descriptors
    reference: Segments
    sentence: str | None = None
    vocabulary: Vocabulary = AFFECT
    tier: str = "affect"
    level: SignerLevel | None = None

    def __post_init__(self) -> None:
        if not self.reference.labelled:
            raise SignfaceError(f"{self.take}: its reference annotation has no labels")
        unknown = sorted({str(label) for label in self.stable["label"]} - set(self.vocabulary.values))
        if unknown:
            raise SignfaceError(
                f"{self.take}: its reference annotation has the unknown label {', '.join(unknown)}",
                hint=f"the labels of stable segments are {' '.join(self.vocabulary.values)}",
            )

    @property
    def stable(self) -> pd.DataFrame:
        """The rows of the reference's stable segments."""
        return self.reference.table[self.reference.table["kind"] == "stable"]

    @property
    def moving(self) -> Segments:
        """The reference with a transition wherever one label follows another, as sequence models learn it."""
        if self.vocabulary.transitions:
            return self.reference
        return self.reference.changed("with_transitions", _with_transitions(self.reference.table))


def training_frames(
    example: Example,
    bases: Sequence[str],
    *,
    rate: float = TRAINING_RATE,
    variant: DescriptorVariant | None = None,
    level: SignerLevel | None = None,
    courses: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Weights and labels of evenly spaced frames of the reference's stable segments.

    Neighbouring frames at 200 Hz are nearly equal: `rate` frames per second are kept (at least the middle one of
    each segment), which costs no accuracy worth the name and makes the support vector machines train in seconds.
    Frames without weights are left out.

    Parameters
    ----------
    example : Example
    bases : sequence of str
        The columns wanted, in this order.
    rate : float
        Frames kept per second of stable segment (Hz).
    variant, level : optional
        What is made of the weights, and by which level of the signer it is normalised; the weights themselves when
        not given.
    courses : bool
        A row for each stable segment instead (`signface.label.courses.segment_courses`); `rate` does nothing then.

    Returns
    -------
    (K, columns) weights and (K,) labels.
    """
    take = example.descriptors.on(bases)
    descriptors = take if variant is None else variant.of(take, level)
    if courses:
        rows = segment_courses(descriptors, example.stable[["start_s", "end_s"]].to_numpy(float))
        whole = np.isfinite(rows).all(axis=1)
        return rows[whole], example.stable["label"].to_numpy(str)[whole]
    known = np.isfinite(descriptors.weights).all(axis=1)
    time = descriptors.time
    frames, labels = [], []
    for start, end, label in example.stable[["start_s", "end_s", "label"]].itertuples(index=False):
        inside = np.flatnonzero((time >= start) & (time < end) & known)
        if len(inside) == 0:
            continue
        count = max(1, round(len(inside) / descriptors.rate * rate))
        picked = inside[((np.arange(count) + 0.5) * len(inside) / count).astype(int)]
        frames.append(descriptors.weights[picked])
        labels += [label] * count
    if not frames:
        return np.zeros((0, descriptors.weights.shape[1])), np.zeros(0, dtype=str)
    return np.concatenate(frames), np.array(labels, dtype=str)


def common_bases(examples: Sequence[Example]) -> tuple[str, ...]:
    """The bases of the examples.

    Raises
    ------
    SignfaceError
        Two takes have other bases; the message names them.
    """
    first = examples[0]
    for other in examples[1:]:
        if set(other.descriptors.names) != set(first.descriptors.names):
            differ = sorted(set(other.descriptors.names) ^ set(first.descriptors.names))
            raise SignfaceError(
                f"the takes {first.take} and {other.take} were solved with other bases ({', '.join(differ[:5])})",
                hint="train on takes of one face",
            )
    return first.descriptors.names


def common_vocabulary(examples: Sequence[Example]) -> Vocabulary:
    """The vocabulary of the examples.

    Raises
    ------
    SignfaceError
        Two takes were annotated with different ones, or on different tiers.
    """
    first = examples[0]
    for other in examples[1:]:
        if (other.vocabulary, other.tier) != (first.vocabulary, first.tier):
            raise SignfaceError(
                f"the takes {first.take} and {other.take} are annotated with other vocabularies "
                f"({first.vocabulary.name} on {first.tier}, {other.vocabulary.name} on {other.tier})",
                hint="train on takes of one tier, and name its vocabulary",
            )
    return first.vocabulary


def label_counts(examples: Sequence[Example]) -> dict[str, tuple[int, int]]:
    """How many stable segments each label of the vocabulary has, and in how many takes; a typo is a label of one take.

    Examples
    --------
    >>> import signface as sf
    >>> label_counts(sf.datasets.mini_examples())["J"]
    (4, 3)
    """
    labels = [example.stable["label"].tolist() for example in examples]
    return {
        value: (sum(take.count(value) for take in labels), sum(value in take for take in labels))
        for value in common_vocabulary(examples).values
    }


def in_order(examples: Sequence[Example]) -> list[Example]:
    """The takes by signer, kind and name, so that a training does not depend on their order."""
    return sorted(examples, key=lambda example: (example.signer, example.kind, example.take))


def signer_levels(examples: Sequence[Example]) -> dict[str, SignerLevel]:
    """The level of each signer: what the corpus says, or that of these takes of theirs; no label is looked at.

    What the corpus says serves where it is of the takes' own columns: measures are not judged by weights.
    """
    levels = {
        example.signer: example.level
        if example.level is not None and set(example.descriptors.names) <= set(example.level.names)
        else None
        for example in examples
    }
    for name, level in levels.items():
        if level is None:
            levels[name] = signer_level([example.descriptors for example in examples if example.signer == name])
    return {name: level for name, level in levels.items() if level is not None}


def frame_table(
    examples: Sequence[Example],
    *,
    features: Sequence[str] = ("weights",),
    normalise: str = "none",
    rate: float = TRAINING_RATE,
    courses: bool = False,
) -> FrameTable:
    """Frames of the stable segments of annotated takes, for scripts with scikit-learn.

    Frames of one take are alike, and frames of one signer are: whoever splits them must keep them together, by
    `groups=takes` or, to know how it does on somebody else, `groups=signers`.

    Parameters
    ----------
    examples : sequence of Example
    features, normalise : optional
        As in `signface.label.variants.DescriptorVariant`; signers are normalised by these takes of theirs.
    rate : float
        As in `training_frames`.

    Raises
    ------
    SignfaceError
        There is no example, or takes have other bases.

    Examples
    --------
    >>> from sklearn.model_selection import LeaveOneGroupOut, cross_val_score
    >>> import signface as sf
    >>> X, y, takes, signers = sf.frame_table(sf.datasets.mini_examples())
    >>> X.shape, len(set(y)), len(set(takes))
    ((272, 51), 5, 4)
    >>> len(cross_val_score(sf.make_labeller("knn3"), X, y, groups=signers, cv=LeaveOneGroupOut()))
    2
    """
    if not examples:
        raise SignfaceError("there is no annotated take", hint="name other kinds or another signer")
    bases = common_bases(examples)
    variant = DescriptorVariant(features, normalise).check()
    levels = signer_levels(examples) if normalise in BY_SIGNER else {}
    pairs = [
        training_frames(e, bases, rate=rate, variant=variant, level=levels.get(e.signer), courses=courses)
        for e in examples
    ]
    counts = [len(labels) for _, labels in pairs]
    return FrameTable(
        np.concatenate([frames for frames, _ in pairs]),
        np.concatenate([labels for _, labels in pairs]),
        np.repeat(np.array([e.take for e in examples], dtype=str), counts),
        np.repeat(np.array([e.signer for e in examples], dtype=str), counts),
    )


def _with_transitions(table: pd.DataFrame) -> pd.DataFrame:
    """A labelled table with a short transition in the middle of which each boundary between two labels lies."""
    columns = ["start_s", "end_s", "kind", "label"]
    rows = [list(row) for row in table[columns].itertuples(index=False)]
    result = rows[:1]
    for before, after in pairwise(rows):
        boundary = after[0]
        if boundary - before[1] < TOUCHING_S and before[3] != after[3]:
            reach = min(TRANSITION_S / 2, (before[1] - before[0]) / 3, (after[1] - boundary) / 3)
            before[1], after[0] = boundary - reach, boundary + reach
            result.append([boundary - reach, boundary + reach, "transition", f"{before[3]}{after[3]}"])
        result.append(after)
    return pd.DataFrame(result, columns=columns)
