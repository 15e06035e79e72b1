"""Agreement between annotators, or between one and the machine, on plain tables of annotations.

- `frame_labels`: what each annotator says at each moment.
- `cohen_kappa`, `krippendorff_alpha`: chance-corrected agreement on frames.
- `match_annotations`, `modified_kappa`: agreement on annotations that overlap (Holle and Rein 2014, EasyDIAg).
- `gamma`, `gamma_interval`: the measure of Mathet et al. (2015), which aligns and compares at once (needs
  pygamma-agreement).
- `boundary_distances`: how far the starts and ends of matched annotations lie apart.
- `confusion`: who called what what, "nothing" included.
- `agreement_table`: all of them for each pair of annotators.

A table has the columns `start_s, end_s, label`, in order of time, without overlap.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pandas as pd

from signface.content import Content
from signface.errors import SignfaceError
from signface.extras import needed

#: How the absence of an annotation is named.
NOTHING = "nothing"

#: Distance of the frames on which kappa and alpha are counted (s).
FRAME_S = 0.01

#: Share of the longer of two annotations that must overlap for them to be a match (Holle and Rein 2014).
OVERLAP = 0.6
#: How closely the disorder of chance is known that gamma is held against, as a share of it.
GAMMA_PRECISION = 0.02


def frame_labels(tables: Sequence[pd.DataFrame], *, frame_s: float = FRAME_S) -> np.ndarray:
    """(R, K) labels that R annotators give at K moments, `NOTHING` where they give none.

    The moments lie in the middle of frames of `frame_s` seconds, from the first annotation of any of them to the last.
    """
    starts = [table["start_s"].min() for table in tables if len(table)]
    ends = [table["end_s"].max() for table in tables if len(table)]
    if not starts:
        return np.empty((len(tables), 0), dtype=object)
    count = max(1, int((max(ends) - min(starts)) / frame_s + 1e-9))  # a broken frame at the end is left out
    time = min(starts) + (np.arange(count) + 0.5) * frame_s
    labels = np.full((len(tables), count), NOTHING, dtype=object)
    for row, table in zip(labels, tables):
        if not len(table):
            continue
        start, end = table["start_s"].to_numpy(float), table["end_s"].to_numpy(float)
        index = np.searchsorted(start, time, side="right") - 1
        inside = (index >= 0) & (time < end[index.clip(min=0)])
        row[inside] = table["label"].to_numpy(object)[index[inside]]
    return labels


def cohen_kappa(first: np.ndarray, second: np.ndarray) -> float:
    """Cohen's kappa (1960) of two rows of labels; NaN where chance alone would agree completely.

    Examples
    --------
    >>> cohen_kappa(np.array(["N", "N", "J", "J"]), np.array(["N", "J", "J", "J"]))
    0.5
    """
    from sklearn.metrics import cohen_kappa_score

    first, second = np.asarray(first).astype(str), np.asarray(second).astype(str)
    if len(set(first) | set(second)) < 2:
        return float("nan")
    return float(cohen_kappa_score(first, second))


def krippendorff_alpha(labels: np.ndarray) -> float:
    """Krippendorff's alpha for nominal values of (R, K) labels; NaN where only one value occurs.

    `1 - (n - 1) * o / e` over the n = R K values, with o the pairs within a moment that differ (each moment's divided
    by R - 1) and e the pairs of all values that differ (Krippendorff, Computing Krippendorff's alpha-reliability,
    2011, section C, without missing data: who annotates nothing says so). The one Python package for it is under the
    GPL, which this one cannot depend on.

    Examples
    --------
    >>> krippendorff_alpha(np.array([["N", "N", "J", "J"], ["N", "J", "J", "J"]]))
    0.5333333333333333
    """
    annotators, moments = labels.shape
    values, codes = np.unique(labels.astype(str), return_inverse=True)
    if annotators < 2 or len(values) < 2:
        return float("nan")
    counts = np.zeros((moments, len(values)))
    np.add.at(counts, (np.tile(np.arange(moments), annotators), codes.ravel()), 1)
    within = (annotators**2 - (counts**2).sum(axis=1)).sum() / (annotators - 1)
    total = counts.sum(axis=0)
    among = total.sum() ** 2 - (total**2).sum()
    return float(1 - (total.sum() - 1) * within / among)


def match_annotations(first: pd.DataFrame, second: pd.DataFrame, *, overlap: float = OVERLAP) -> list[tuple[int, int]]:
    """Pairs (row of the first, row of the second) of annotations that match.

    Two annotations match when they share at least `overlap` of the longer of them. The best overlaps are taken first,
    and none is matched twice.

    Raises
    ------
    SignfaceError
        `overlap` is not above 0 and at most 1.
    """
    if not 0 < overlap <= 1:
        raise SignfaceError(f"the overlap must lie between 0 and 1, not {overlap:g}")
    begin = second["start_s"].to_numpy(float)
    end = second["end_s"].to_numpy(float)
    candidates = []
    for i, (start, stop) in enumerate(zip(first["start_s"], first["end_s"])):
        low, high = np.searchsorted(end, start, side="right"), np.searchsorted(begin, stop, side="left")
        for j in range(low, high):
            shared = min(stop, end[j]) - max(start, begin[j])
            share = shared / max(stop - start, end[j] - begin[j])
            if share >= overlap - 1e-9:
                candidates.append((-share, -shared, i, j))
    pairs, used_first, used_second = [], set(), set()
    for *_, i, j in sorted(candidates):
        if i not in used_first and j not in used_second:
            used_first.add(i)
            used_second.add(j)
            pairs.append((i, j))
    return sorted(pairs)


@dataclass(frozen=True, eq=False)
class ModifiedKappa(Content):
    """Result of `modified_kappa`.

    Parameters
    ----------
    kappa : float
        The modified kappa; NaN where it is undefined. It can be negative (EasyDIAg shows 0 then).
    kappa_max : float
        The highest kappa that the annotators' own shares of the labels allow, over the chance that `kappa` itself is
        corrected by, so that the two can be compared. ELAN takes for its maximum the chance of an ordinary kappa (the
        product of the margins), and shows another number here.
    raw : float
        Agreement as a share, uncorrected.
    table : DataFrame
        Counts, rows the first annotator, columns the second, `NOTHING` last.
    """

    kappa: float
    kappa_max: float
    raw: float
    table: pd.DataFrame


def modified_kappa(first: pd.DataFrame, second: pd.DataFrame, *, overlap: float = OVERLAP) -> ModifiedKappa:
    """The modified kappa of Holle and Rein (2014), as EasyDIAg and ELAN compute it.

    Annotations are matched (`match_annotations`). A match counts twice, once for each annotator, and an annotation
    without a match once, against `NOTHING`. That neither annotates something cannot be counted: the cell
    (`NOTHING`, `NOTHING`) is a structural zero. So the agreement expected by chance is found by fitting the table's
    margins with that cell kept at zero (iterative proportional fitting), instead of by multiplying them.
    """
    pairs = match_annotations(first, second, overlap=overlap)
    labels = sorted({*map(str, first["label"]), *map(str, second["label"])})
    code = {label: number for number, label in enumerate(labels)}
    size = len(labels) + 1
    counts = np.zeros((size, size))
    one, other = [str(label) for label in first["label"]], [str(label) for label in second["label"]]
    for i, j in pairs:
        counts[code[one[i]], code[other[j]]] += 2
    for i in set(range(len(one))) - {i for i, _ in pairs}:
        counts[code[one[i]], -1] += 1
    for j in set(range(len(other))) - {j for _, j in pairs}:
        counts[-1, code[other[j]]] += 1
    table = pd.DataFrame(counts.astype(int), index=[*labels, NOTHING], columns=[*labels, NOTHING])
    total = counts.sum()
    if not total:
        return ModifiedKappa(float("nan"), float("nan"), float("nan"), table)
    rows, columns = counts.sum(axis=1), counts.sum(axis=0)
    chance = float(np.trace(_fitted(rows, columns))) / total
    raw, highest = float(np.trace(counts)) / total, float(np.minimum(rows, columns).sum()) / total
    kappa, kappa_max = (
        float((share - chance) / (1 - chance)) if 1 - chance >= 1e-12 else float("nan") for share in (raw, highest)
    )
    return ModifiedKappa(kappa, kappa_max, float(raw), table)


def _fitted(rows: np.ndarray, columns: np.ndarray, *, rounds: int = 2000) -> np.ndarray:
    """The table with these margins whose last cell is zero and whose others are as independent as that allows."""
    fitted = np.ones((len(rows), len(columns)))
    fitted[-1, -1] = 0
    for _ in range(rounds):
        before = fitted.copy()
        fitted *= _ratio(rows, fitted.sum(axis=1))[:, None]
        fitted *= _ratio(columns, fitted.sum(axis=0))[None, :]
        if np.abs(fitted - before).max() < 1e-12:
            break
    return fitted


def _ratio(wanted: np.ndarray, given: np.ndarray) -> np.ndarray:
    return np.divide(wanted, given, out=np.zeros_like(wanted), where=given > 0)


def gamma(tables: Sequence[pd.DataFrame], *, seed: int = 0) -> float:
    """The gamma of `gamma_interval`, alone."""
    return gamma_interval(tables, seed=seed)[0]


def gamma_interval(tables: Sequence[pd.DataFrame], *, seed: int = 0) -> tuple[float, float, float]:
    """The gamma of Mathet, Widlöcher and Métivier (2015): agreement on where the annotations lie and what they say.

    Positions weigh three times what categories do (in pygamma-agreement 0.5.9 both weigh 1 by default). Chance is found
    by drawing annotations at random, hence the seed, and the interval.

    Returns
    -------
    (float, float, float)
        Gamma, and the ends of the interval in which it lies for all that is drawn (95 %: so many are drawn that the
        disorder of chance is known to 2 %). It says nothing of other takes or annotators. NaN when an annotator has no
        annotation.

    Raises
    ------
    SignfaceError
        pygamma-agreement is not installed.
    """
    if any(len(table) == 0 for table in tables):
        return (float("nan"),) * 3
    package = needed("pygamma_agreement", "agreement")
    from pyannote.core import Segment

    continuum = package.Continuum()
    for number, table in enumerate(tables):
        for row in table.itertuples(index=False):
            continuum.add(f"annotator {number}", Segment(float(row.start_s), float(row.end_s)), str(row.label))
    level = logging.root.level
    state = np.random.get_state()  # noqa: NPY002 - pygamma-agreement draws from numpy's global generator
    try:
        logging.root.setLevel(logging.ERROR)  # it warns at every step that a faster solver could be installed
        np.random.seed(seed)  # noqa: NPY002
        dissimilarity = package.CombinedCategoricalDissimilarity(alpha=3, beta=1)
        result = continuum.compute_gamma(dissimilarity, precision_level=GAMMA_PRECISION)
    finally:
        logging.root.setLevel(level)
        np.random.set_state(state)  # noqa: NPY002
    low, high = result.approx_gamma_range
    return float(result.gamma), float(low), float(high)


def _gamma_columns(tables: Sequence[pd.DataFrame], seed: int, asked: bool) -> dict[str, float]:
    found = gamma_interval(tables, seed=seed) if asked else (float("nan"),) * 3
    return dict(zip(("gamma", "gamma_low", "gamma_high"), found, strict=True))


def boundary_distances(first: pd.DataFrame, second: pd.DataFrame, *, overlap: float = OVERLAP) -> pd.DataFrame:
    """How far the second annotator's boundaries lie after the first's, for matched annotations.

    Returns
    -------
    DataFrame
        `label` (of the first), `start_s, end_s` (second less first, seconds), a row for each match.
    """
    pairs = match_annotations(first, second, overlap=overlap)
    rows = [
        (
            str(first["label"].iloc[i]),
            float(second["start_s"].iloc[j] - first["start_s"].iloc[i]),
            float(second["end_s"].iloc[j] - first["end_s"].iloc[i]),
        )
        for i, j in pairs
    ]
    return pd.DataFrame(rows, columns=["label", "start_s", "end_s"])


def confusion(labels: np.ndarray, *, frame_s: float = FRAME_S) -> pd.DataFrame:
    """Seconds that two annotators give to each pair of labels, `NOTHING` last.

    Parameters
    ----------
    labels : (2, K) array
        What `frame_labels` returns for two annotators.

    Returns
    -------
    DataFrame
        Rows the first annotator's labels, columns the second's.
    """
    values = [*sorted(set(labels.ravel().tolist()) - {NOTHING}), NOTHING]
    table = pd.crosstab(pd.Categorical(labels[0], values), pd.Categorical(labels[1], values), dropna=False)
    table = table.reindex(index=values, columns=values, fill_value=0) * frame_s
    table.index.name = table.columns.name = None
    return table


def agreement_table(
    annotators: Mapping[str, pd.DataFrame], *, overlap: float = OVERLAP, with_gamma: bool = False, seed: int = 0
) -> pd.DataFrame:
    """Every measure for each pair of annotators, and over all where there are more than two.

    Parameters
    ----------
    annotators : mapping of name to table
    overlap : float
        As in `match_annotations`.
    with_gamma : bool
        Compute gamma too; it takes seconds to minutes.
    seed : int

    Returns
    -------
    DataFrame
        `annotators`, `annotations` (of each), `matched`, `agreement` (share of the time), `cohen_kappa`,
        `modified_kappa`, `modified_kappa_max`, `krippendorff_alpha`, `gamma`, `gamma_low` and `gamma_high`
        (`gamma_interval`), `start_ms` and `end_ms` (median absolute distance of matched boundaries).

    Examples
    --------
    >>> import signface as sf
    >>> reference, weights = sf.datasets.mini_reference(), sf.datasets.mini_weights()
    >>> automatic = sf.label_segments(weights, sf.segment(weights), sf.load_model())
    >>> table = sf.agreement_table({"reference": reference.table, "automatic": automatic.table})
    >>> print(table[["annotators", "cohen_kappa", "modified_kappa"]].round(2))
                  annotators  cohen_kappa  modified_kappa
    0  reference / automatic         0.88            0.73
    """
    rows = []
    for (name, first), (other, second) in combinations(annotators.items(), 2):
        labels = frame_labels([first, second])
        modified = modified_kappa(first, second, overlap=overlap)
        distances = boundary_distances(first, second, overlap=overlap)
        rows.append(
            {
                "annotators": f"{name} / {other}",
                "annotations": f"{len(first)} / {len(second)}",
                "matched": len(distances),
                "agreement": float(np.mean(labels[0] == labels[1])) if labels.shape[1] else float("nan"),
                "cohen_kappa": cohen_kappa(labels[0], labels[1]),
                "modified_kappa": modified.kappa,
                "modified_kappa_max": modified.kappa_max,
                "krippendorff_alpha": krippendorff_alpha(labels),
                **_gamma_columns([first, second], seed, with_gamma),
                "start_ms": 1000 * float(distances["start_s"].abs().median()),
                "end_ms": 1000 * float(distances["end_s"].abs().median()),
            }
        )
    if len(annotators) > 2:
        tables = list(annotators.values())
        rows.append(
            {
                "annotators": "all",
                "annotations": " / ".join(str(len(table)) for table in tables),
                "krippendorff_alpha": krippendorff_alpha(frame_labels(tables)),
                **_gamma_columns(tables, seed, with_gamma),
            }
        )
    table = pd.DataFrame(rows)
    return table.astype({"matched": "Int64"}) if len(table) else table
