"""Agreement of annotators on all their tiers.

- `compare_tiers`: a `TierAgreement` for each tier.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from signface.content import Content
from signface.errors import SignfaceError
from signface.metrics.agreement import OVERLAP, agreement_table, confusion, frame_labels, modified_kappa


@dataclass(frozen=True, eq=False)
class TierAgreement(Content):
    """How far annotators agree on one tier.

    Parameters
    ----------
    tier : str
    annotators : mapping of str to DataFrame
        What each annotated: `start_s, end_s, label`.
    table : DataFrame
        All measures for each pair of annotators (`signface.metrics.agreement.agreement_table`).
    seconds : DataFrame
        For how many seconds the first called what the second called what (`signface.metrics.agreement.confusion`).
    annotations : DataFrame
        The same, counted in annotations that match (`signface.metrics.agreement.modified_kappa`).
    """

    tier: str
    annotators: Mapping[str, pd.DataFrame]
    table: pd.DataFrame
    seconds: pd.DataFrame
    annotations: pd.DataFrame


def compare_tiers(
    annotators: Mapping[str, Mapping[str, pd.DataFrame]],
    *,
    tiers: Sequence[str] = (),
    overlap: float = OVERLAP,
    gamma: bool = False,
) -> list[TierAgreement]:
    """Agreement on every tier that all annotators have.

    Parameters
    ----------
    annotators : mapping
        Name of an annotator, and the tiers: name and table `start_s, end_s, label`
        (`signface.elan.reference.read_annotators`).
    tiers : sequence of str
        Which tiers; by default all that everybody has and somebody has filled.
    overlap : float
        Share of the longer annotation that must overlap for a match.
    gamma : bool
        Compute gamma too, which is slow.

    Raises
    ------
    SignfaceError
        There are fewer than two annotators, or not every one has such a tier.

    Examples
    --------
    >>> import pandas as pd
    >>> eva = pd.DataFrame({"start_s": [0.0, 1.0], "end_s": [1.0, 2.0], "label": ["N", "J"]})
    >>> tom = pd.DataFrame({"start_s": [0.0, 1.0], "end_s": [1.0, 2.0], "label": ["N", "Su"]})
    >>> agreement = compare_tiers({"eva": {"affect": eva}, "tom": {"affect": tom}})[0]
    >>> round(float(agreement.seconds.loc["J", "Su"]), 2)
    1.0
    """
    if len(annotators) < 2:
        raise SignfaceError("agreement needs two files or more", hint="name the files of two annotators")
    first = next(iter(annotators.values()))
    common = [tier for tier in first if all(tier in theirs for theirs in annotators.values())]
    wanted = list(tiers) or [tier for tier in common if any(len(theirs[tier]) for theirs in annotators.values())]
    missing = [tier for tier in wanted if tier not in common]
    if missing or not wanted:
        raise SignfaceError(
            f"not every file has a tier {missing[0]}" if missing else "the files have no filled tier in common",
            hint=f"tiers of all are {', '.join(common) or 'none'}",
        )
    return [
        _compare(tier, {name: theirs[tier] for name, theirs in annotators.items()}, overlap, gamma) for tier in wanted
    ]


def _compare(tier: str, annotators: Mapping[str, pd.DataFrame], overlap: float, gamma: bool) -> TierAgreement:
    table = agreement_table(annotators, overlap=overlap, with_gamma=gamma)
    table.insert(0, "tier", tier)
    pair = list(annotators.values())[:2]
    return TierAgreement(tier, annotators, table, confusion(frame_labels(pair)), modified_kappa(*pair).table)
