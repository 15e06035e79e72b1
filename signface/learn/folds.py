"""Folds within the training takes: what a classifier is tuned, calibrated and scored on without the test takes.

- `inner_folds`: training takes, and takes left out of them; a signer, a take or a sentence is never in both.
- `groups_of`: what may not be in both.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from signface.learn.examples import Example, in_order


def groups_of(examples: Sequence[Example], *, by_signer: bool | None = None) -> list[str]:
    """The group of each take: its signer, or with one signer its sentence where the corpus names it, else the take.

    Parameters
    ----------
    examples : sequence of Example
    by_signer : bool, optional
        Group by signer, or not; by default where there is more than one.
    """
    if by_signer is None:
        by_signer = len({example.signer for example in examples}) > 1
    if by_signer:
        return [example.signer for example in examples]
    return [f"sentence {example.sentence}" if example.sentence else f"take {example.take}" for example in examples]


def inner_folds(
    examples: Sequence[Example], *, folds: int = 5, by_signer: bool | None = None
) -> list[tuple[list[Example], list[Example]]]:
    """Pairs (kept, left out) of takes; every take is left out once, and no group is in both parts of a pair.

    The labels are spread over the folds as evenly as whole groups allow (`StratifiedGroupKFold`).

    Parameters
    ----------
    examples : sequence of Example
        Their order does not matter.
    folds : int
        At most as many as there are groups.
    by_signer : bool, optional
        As in `groups_of`.

    Returns
    -------
    list of pairs of lists of Example
        Empty with fewer than two groups, or where no take has a stable segment.
    """
    from sklearn.model_selection import StratifiedGroupKFold

    ordered = in_order(examples)
    held = [example for example in ordered if len(example.stable)]
    groups = np.array(groups_of(held, by_signer=by_signer), dtype=object)
    folds = min(folds, len(set(groups)))
    if folds < 2:
        return []
    labels = [example.stable["label"].to_numpy(str) for example in held]
    item = np.repeat(np.arange(len(held)), [len(part) for part in labels])
    spread = np.concatenate(labels)
    folds = min(folds, int(np.unique(spread, return_counts=True)[1].max()))
    if folds < 2:
        return []
    with warnings.catch_warnings():  # a label with fewer segments than folds is left out of some, which is as it is
        warnings.simplefilter("ignore", UserWarning)
        splits = [rows for _, rows in StratifiedGroupKFold(folds).split(item[:, None], spread, groups[item])]
    pairs = []
    for rows in splits:
        out = set(item[rows].tolist())
        pairs.append(([e for n, e in enumerate(held) if n not in out], [e for n, e in enumerate(held) if n in out]))
    return [pair for pair in pairs if pair[0] and pair[1]]
