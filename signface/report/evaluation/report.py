"""The report of an evaluation: a page that needs nothing else, with its figures and tables as files beside it.

- `write_report`: the whole folder; `write_files`, of an `Evaluated`.
- `evaluation_page`: the page alone, as text.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Sequence
from functools import cache
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from signface.corpus.facts import corpus_facts
from signface.corpus.manifest import Corpus
from signface.evaluation.measure import Measured
from signface.face.reading import read_face
from signface.files import whole_file, write_text
from signface.learn.examples import Example
from signface.metrics.segmentation import match_boundaries
from signface.report.evaluation import figures, tables
from signface.report.evaluation.evaluated import Drawn, Evaluated, figure_name, takes_table
from signface.report.evaluation.importance import draw_importance
from signface.report.evaluation.page import evaluation_page
from signface.report.evaluation.worst_takes import FAR_S, TakeVerdict
from signface.report.figure_files import save_vector
from signface.settings.solve import SolveSettings

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_report(
    measured: Measured,
    examples: Sequence[Example],
    corpus: Corpus,
    folder: str | PathLike[str],
    *,
    settings: SolveSettings | None = None,
    date: str | None = None,
) -> Path:
    """Write the report of an evaluation: `report.html`, `metrics.json`, tables as CSV, figures as SVG and PDF.

    Parameters
    ----------
    measured : Measured
        What `signface.evaluate` gave.
    examples : sequence of Example
        What it was given.
    corpus : Corpus
        Where they come from.
    folder : path
    settings : SolveSettings, optional
        How they were solved.
    date : str, optional
        A date to print; without one, the same evaluation gives the same bytes.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    SignfaceError
        The folder cannot be written.

    See Also
    --------
    signface.evaluate : what is reported.

    Examples
    --------
    >>> import signface as sf
    >>> examples = sf.datasets.mini_examples()
    >>> measured = sf.evaluate(examples, classifiers=["knn1"], protocols=["across"])
    >>> sf.write_report(measured, examples, sf.datasets.mini_corpus(), "report").name
    'report.html'
    """
    settings = settings or SolveSettings()
    facts = corpus_facts(corpus, settings=settings)
    face = read_face(settings.face) if facts["faces"] else None
    metrics = {**measured.metrics, "corpus": facts}
    return write_files(Evaluated(metrics, facts, examples, measured.segments, face, date), Path(folder))


def write_files(evaluated: Evaluated, folder: Path) -> Path:
    """Write all files of a report, and give its page; see `write_report`."""
    write_text(folder / "metrics.json", json.dumps(evaluated.metrics, indent=1, ensure_ascii=False) + "\n")
    drawn = draw_all(evaluated)
    for figure in [figure for section in drawn.values() for figure in section]:
        save_vector(figure.figure, figure.svg, folder / "figures", figure.name)
    for name, table in files(evaluated).items():
        with whole_file(folder / f"{name}.csv") as temporary:
            table.to_csv(temporary, index=False, lineterminator="\n")
    write_text(folder / "report.html", evaluation_page(evaluated, drawn))
    return folder / "report.html"


def files(evaluated: Evaluated) -> dict[str, pd.DataFrame]:
    """Every table, by the name of its file."""
    frames_of = {}
    results, signers, pairs, curves, importance = [], [], [], [], []
    for protocol, part in evaluated.parts.items():
        results.append(tables.results_table(part["classifiers"]).assign(protocol=protocol))
        signers.append(tables.by_signer_table(part["protocol"]).assign(protocol=protocol))
        pairs.append(tables.mcnemar_table(part["mcnemar"]).assign(protocol=protocol))
        curves.append(pd.DataFrame(evaluated.metrics["learning_curve"].get(protocol, [])).assign(protocol=protocol))
        for name, sections in part["classifiers"].items():
            frames_of[f"confusion_{protocol}_{name}"] = tables.confusion_table(sections)
    for name, rows in evaluated.metrics["importance"].items():
        importance.append(pd.DataFrame(rows).assign(classifier=name))
    named = {
        "results": results,
        "by_signer": signers,
        "segmentation": [tables.segmentation_table(evaluated.metrics["segmentation_by_kind"])],
        "mcnemar": pairs,
        "learning_curve": curves,
        "importance": importance,
        "takes": [takes_table(evaluated.verdicts)],
        "recordings": [pd.DataFrame(evaluated.facts["recordings"])],
    }
    for name, frames in named.items():
        kept = [frame for frame in frames if len(frame)]
        if kept:
            frames_of[name] = pd.concat(kept, ignore_index=True)
    return frames_of


def draw_all(evaluated: Evaluated) -> dict[str, list[Drawn]]:
    """Section of the page to its figures."""
    metrics, parts = evaluated.metrics, evaluated.parts
    titles = {protocol: tables.PROTOCOL_TITLES[protocol] for protocol in parts}
    main = next(iter(parts))
    segmentation = tables.segmentation_table(metrics["segmentation_by_kind"])
    drawn: dict[str, list[Drawn]] = {
        "accuracy": [_drawn("accuracy", figures.draw_accuracy({key: parts[key]["classifiers"] for key in parts}))],
        "segmentation": [_drawn("segmentation", figures.draw_segmentation(segmentation))],
        "confusions": [],
        "confidence": [],
        "curve": [],
        "importance": [],
    }
    for protocol, part in parts.items():
        panels = figures.section_titles(part["classifiers"], "automatic_segments")
        if panels:
            figure = figures.draw_confusions(panels)
            drawn["confusions"].append(_drawn("confusions", figure, f"_{protocol}", protocol=titles[protocol]))
    curves = {name: bins for name, bins in metrics["reliability"].get(main, {}).items() if bins}
    if curves:
        figure = figures.draw_reliability(curves)
        drawn["confidence"].append(_drawn("reliability", figure, protocol=titles[main], least=str(figures.LEAST_BIN)))
    points = [
        pd.DataFrame(curve).assign(protocol=protocol) for protocol, curve in metrics["learning_curve"].items() if curve
    ]
    if points:
        figure = figures.draw_learning_curve(pd.concat(points, ignore_index=True))
        drawn["curve"].append(_drawn("learning_curve", figure))
    name = evaluated.best if evaluated.best in metrics["importance"] else next(iter(metrics["importance"]), None)
    if name:
        figure = draw_importance(pd.DataFrame(metrics["importance"][name]), evaluated.face, title=name)
        drawn["importance"].append(_drawn("importance", figure, classifier=name, protocol=titles[main]))
    drawn["worst"] = [_take(evaluated, verdict) for verdict in evaluated.worst if _drawable(evaluated, verdict)]
    drawn["gallery"] = [_take(evaluated, verdict) for verdict in evaluated.gallery if _drawable(evaluated, verdict)]
    return drawn


@cache
def _captions() -> dict[str, dict[str, str]]:
    return tomllib.loads(Path(__file__).with_name("captions.toml").read_text(encoding="utf-8"))


def _drawn(key: str, figure: Figure, ending: str = "", **values: str) -> Drawn:
    """A figure with its words of `captions.toml`."""
    words = _captions()[key]
    return Drawn(key + ending, figure, words["description"].format(**values), words["caption"].format(**values))


def _drawable(evaluated: Evaluated, verdict: TakeVerdict) -> bool:
    """Whether a take has an energy curve at all."""
    descriptors = _example(evaluated, verdict).descriptors
    return descriptors.n_frames >= 3 and bool(np.isfinite(descriptors.weights).all(axis=1).any())


def _example(evaluated: Evaluated, verdict: TakeVerdict) -> Example:
    return next(example for example in evaluated.examples if example.take == verdict.take)


def _take(evaluated: Evaluated, verdict: TakeVerdict) -> Drawn:
    """The timeline of a take: a row for each protocol, and the reference."""
    example = _example(evaluated, verdict)
    short = {"within": "same signer", "across": "other signers"}
    rows = {
        short.get(protocol, protocol): of_protocol[evaluated.best][verdict.take]
        for protocol, of_protocol in evaluated.found.items()
        if verdict.take in of_protocol.get(evaluated.best, {})
    }
    first = next(iter(rows))
    boundaries, boundaries_found, pairs = match_boundaries(
        example.reference.table, rows[first].table, tolerance_s=FAR_S
    )
    marks = {
        "reference": np.delete(boundaries, [i for i, _ in pairs]),
        first: np.delete(boundaries_found, [j for _, j in pairs]),
    }
    rows["reference"] = example.reference
    return Drawn(
        figure_name(verdict.take),
        figures.draw_take(example.descriptors, rows, marks=marks, vocabulary=example.vocabulary),
        f"Timeline of {verdict.take}: energies above, the segments of {evaluated.best} and of the reference below. "
        + ("; ".join(verdict.reasons) or "Nothing is wrong."),
        "",
    )
