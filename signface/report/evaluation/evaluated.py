"""What the report of an evaluation is made of.

- `Evaluated`: all results of an evaluation, with the verdicts on its takes.
- `Drawn`, `figure_name`: a figure of it, and what the figure of a take is called.
- `takes_table`: the verdicts as a table.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np
import pandas as pd

from signface.evaluation.details import favourite
from signface.face.model import FaceModel
from signface.label.vocabulary import Vocabulary
from signface.learn.examples import Example
from signface.report.evaluation.tables import by_protocol
from signface.report.evaluation.worst_takes import TakeVerdict, judge_take
from signface.report.figure_files import svg_element
from signface.segmentation.segments import Segments

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Takes shown as the worst, and others in the gallery.
WORST, GALLERY = 10, 6


@dataclass(frozen=True)
class Evaluated:
    """What a report is made of.

    Parameters
    ----------
    metrics : dict
        The content of metrics.json.
    facts : dict
        Of `signface.corpus.facts.corpus_facts`.
    examples : sequence of Example
        The test takes at least.
    found : mapping
        Protocol, classifier and take to the labelled segments.
    face : FaceModel, optional
        What the importance of bases is painted on.
    date : str, optional
        When it was made, as the caller has it; nothing else in a report knows the time.
    """

    metrics: dict[str, Any]
    facts: dict[str, Any]
    examples: Sequence[Example]
    found: Mapping[str, Mapping[str, Mapping[str, Segments]]]
    face: FaceModel | None = None
    date: str | None = None

    @property
    def parts(self) -> dict[str, Mapping[str, Any]]:
        """Protocol to its part of metrics.json, the main one first."""
        return by_protocol(self.metrics)

    @property
    def vocabulary(self) -> Vocabulary:
        """What the labels stand for."""
        return self.examples[0].vocabulary

    @cached_property
    def best(self) -> str:
        """The classifier that is looked at closely."""
        return favourite(self.metrics["classifiers"])

    @cached_property
    def verdicts(self) -> list[TakeVerdict]:
        """What the best classifier made of each test take under the main protocol, the worst first."""
        labelled = next(iter(self.found.values()))[self.best]
        residuals = [
            float(np.nanmean(example.descriptors.residual))
            for example in self.examples
            if example.descriptors.residual is not None and np.isfinite(example.descriptors.residual).any()
        ]
        usual = float(np.median(residuals)) if residuals else None
        judged = [
            judge_take(
                e.reference,
                labelled[e.take],
                e.descriptors,
                take=e.take,
                signer=e.signer,
                kind=e.kind,
                usual_residual=usual,
                vocabulary=e.vocabulary,
            )
            for e in self.examples
            if e.take in labelled
        ]
        return sorted(judged, key=lambda verdict: (np.nan_to_num(verdict.agreement, nan=2.0), verdict.take))

    @property
    def worst(self) -> list[TakeVerdict]:
        """The worst takes: at most `WORST`, and no more than half where there are few."""
        return self.verdicts[: min(WORST, (len(self.verdicts) + 1) // 2)]

    @property
    def gallery(self) -> list[TakeVerdict]:
        """Some of the others, from good to bad, evenly spaced."""
        rest = self.verdicts[len(self.worst) :][::-1]
        positions = np.unique(np.linspace(0, len(rest) - 1, min(GALLERY, len(rest))).round().astype(int))
        return [rest[position] for position in positions]


@dataclass(frozen=True)
class Drawn:
    """A figure with the name of its files, what it shows in words, and its caption."""

    name: str
    figure: Figure
    description: str
    caption: str

    @cached_property
    def svg(self) -> str:
        """As an element of a page."""
        return svg_element(self.figure, self.name, self.description)


def takes_table(verdicts: Sequence[TakeVerdict]) -> pd.DataFrame:
    """One row a take, with its reasons in one cell."""
    rows = [
        {
            "take": verdict.take,
            "signer": verdict.signer,
            "kind": verdict.kind,
            "agreement": verdict.agreement,
            "segments, reference": verdict.n_reference,
            "segments, found": verdict.n_found,
            "boundaries missed": verdict.missed,
            "boundaries too many": verdict.superfluous,
            "reasons": "; ".join(verdict.reasons),
        }
        for verdict in verdicts
    ]
    return pd.DataFrame(rows)


def figure_name(take: str) -> str:
    """The name of a take's figure: a file's name on every system, and another one for every take.

    Examples
    --------
    >>> figure_name("S1_EU_07"), figure_name("S1/laugh")
    ('take_S1_EU_07', 'take_S1_laugh_a2d286d2')
    """
    plain = re.sub(r"[^A-Za-z0-9_-]", "_", take)
    return f"take_{plain}" if plain == take else f"take_{plain}_{crc32(take.encode()):08x}"
