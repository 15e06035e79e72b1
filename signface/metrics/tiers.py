"""Agreement of annotators on all their tiers.

- `compare_tiers`: a `TierAgreement` for each tier; `explained`: what its values do not say by themselves.
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
        (`signface.elan.annotators.read_annotators`).
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
        raise SignfaceError(
            "agreement needs two files or more", hint="name the files of two annotators, or two tiers of one"
        )
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


def explained(agreement: TierAgreement) -> list[str]:
    """Why measures of the first two annotators are undefined or low although they agree on much of the time."""
    row, lines = agreement.table.iloc[0], []
    (name, first), (other, second) = list(agreement.annotators.items())[:2]
    labels = {who: set(table["label"]) for who, table in ((name, first), (other, second))}
    if pd.isna(row["cohen_kappa"]) or pd.isna(row["modified_kappa"]):
        lines.append(
            "undefined: nothing is annotated"
            if not len(first) or not len(second)
            else "undefined: with one label only and nothing unmatched, chance could not disagree (0/0)"
        )
    if row["matched"] == 0 and len(first) and len(second):
        lines.append("no annotation is matched: none shares enough of the longer one (--overlap)")
    if row["agreement"] >= 0.5 and row["cohen_kappa"] < 0.2:
        same = next((who for who, held in labels.items() if len(held) == 1), None)
        reason = f"{same} never changes the label" if same else "one label covers nearly all of the time"
        lines.append(f"kappa is low at {row['agreement']:.0%} agreement: {reason}, so that chance agrees as often")
    return lines


def renamed(
    annotators: Mapping[str, Mapping[str, pd.DataFrame]], names: Mapping[str, str]
) -> dict[str, dict[str, pd.DataFrame]]:
    """The annotators with tiers and labels called as others call them, so that they can be compared.

    Parameters
    ----------
    annotators : mapping
        As for `compare_tiers`.
    names : mapping
        Old name of a tier or a label: the new one.

    Raises
    ------
    SignfaceError
        An old name is neither a tier nor a label of any file, or two tiers of one file get one name.

    Examples
    --------
    >>> import pandas as pd
    >>> eva = {"brows@K01": pd.DataFrame({"start_s": [0.0], "end_s": [1.0], "label": ["br_raise"]})}
    >>> renamed({"eva": eva}, {"brows@K01": "brows@S1", "br_raise": "raised"})["eva"]["brows@S1"]["label"].tolist()
    ['raised']
    """
    known = {tier for tiers in annotators.values() for tier in tiers}
    labels = {str(label) for tiers in annotators.values() for table in tiers.values() for label in table["label"]}
    unknown = [name for name in names if name not in known | labels]
    if unknown:
        raise SignfaceError(
            f"no file has a tier or a label {unknown[0]}",
            hint=f"there are the tiers {', '.join(sorted(known))} and the labels {', '.join(sorted(labels))}",
        )
    result: dict[str, dict[str, pd.DataFrame]] = {}
    for annotator, tiers in annotators.items():
        theirs: dict[str, pd.DataFrame] = {}
        for tier, table in tiers.items():
            name = names.get(tier, tier)
            if name in theirs:
                raise SignfaceError(f"{annotator} would have two tiers {name}", hint="rename one of them otherwise")
            called = [names.get(str(label), label) for label in table["label"]]
            theirs[name] = table.assign(label=pd.Series(called, table.index, dtype=object))
        result[annotator] = theirs
    return result


def _compare(tier: str, annotators: Mapping[str, pd.DataFrame], overlap: float, gamma: bool) -> TierAgreement:
    table = agreement_table(annotators, overlap=overlap, with_gamma=gamma)
    table.insert(0, "tier", tier)
    pair = list(annotators.values())[:2]
    return TierAgreement(tier, annotators, table, confusion(frame_labels(pair)), modified_kappa(*pair).table)
