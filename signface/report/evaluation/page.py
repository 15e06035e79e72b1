"""The page of an evaluation: its sections, their sentences, figures and tables.

- `evaluation_page`: the page as text.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from signface.report.evaluation import sections, words
from signface.report.evaluation.evaluated import Drawn, Evaluated, figure_name, takes_table
from signface.report.evaluation.worst_takes import FAR_S, TakeVerdict
from signface.report.pages import page_table, render_page

#: Digits of a SHA-256 that are shown; the whole of it stands in metrics.json and recordings.csv.
DIGITS = 12

#: Sections in order: key, title, and what writes their paragraphs and tables.
SECTIONS: tuple[tuple[str, str, Callable[[Evaluated], sections.Content]], ...] = (
    ("accuracy", "Labels", sections.labels),
    ("segmentation", "Boundaries and segments", sections.segmentation),
    ("confusions", "What is taken for what", sections.confusions),
    ("signers", "Signer by signer", sections.signers),
    ("comparison", "Classifiers against each other", sections.comparison),
    ("confidence", "Confidence, intensity, parameters", sections.confidence),
    ("curve", "What more material brings", sections.curve),
    ("importance", "Which bases matter", sections.importance),
)


def evaluation_page(evaluated: Evaluated, drawn: Mapping[str, Sequence[Drawn]]) -> str:
    """The report as one HTML page with nothing outside it.

    Parameters
    ----------
    evaluated : Evaluated
    drawn : mapping
        Of `signface.report.evaluation.report.draw_all`.
    """
    metrics, facts = evaluated.metrics, evaluated.facts
    figures = {figure.name: figure for kind in ("worst", "gallery") for figure in drawn[kind]}
    return render_page(
        "evaluation.html.j2",
        title=f"Evaluation on {facts['name']}",
        synthetic=facts["synthetic"],
        date=evaluated.date,
        headline=words.headline(metrics, facts, evaluated.vocabulary),
        limits=words.limits(metrics, facts),
        done=[
            *(words.protocol_words(part["protocol"]) for part in evaluated.parts.values()),
            words.training_words(metrics["protocol"].get("training", {})),
        ],
        classifiers=words.classifier_words(metrics["classifiers"]),
        facts=_facts(evaluated),
        labels={value: evaluated.vocabulary.describe(value) for value in evaluated.vocabulary.values},
        sections=[_section(key, title, write(evaluated), drawn.get(key, ())) for key, title, write in SECTIONS],
        best=evaluated.best,
        far=f"{FAR_S:.2f}",
        worst=[_take(verdict, figures) for verdict in evaluated.worst],
        gallery=[_take(verdict, figures) for verdict in evaluated.gallery],
        takes=page_table(
            _plain_takes(evaluated.verdicts),
            "takes",
            "All takes, the worst first",
            decimals={"agreement": 2},
            folded=True,
        ),
        provenance=_provenance(evaluated),
        recordings=_recordings(facts),
        versions=facts["versions"],
        seed=metrics["protocol"]["seed"],
    )


def _section(key: str, title: str, content: sections.Content, figures: Sequence[Drawn]) -> dict[str, Any]:
    paragraphs, page_tables = content
    folded = "Every matrix in numbers" if key == "confusions" else ""
    words = {"key": key, "title": title, "paragraphs": paragraphs, "folded": folded}
    return words | {"tables": page_tables, "figures": list(figures)}


def _facts(evaluated: Evaluated) -> list[tuple[str, str, str]]:
    """Name, value and detail of what was worked on."""
    facts, protocol = evaluated.facts, evaluated.metrics["protocol"]
    folds = protocol["folds"]
    trained = {take for fold in folds for take in fold["train_takes"]}
    minutes = sum(example.descriptors.duration for example in evaluated.examples) / 60
    kinds = ", ".join(f"{count} {kind}" for kind, count in facts["kinds"].items())
    return [
        ("corpus", facts["name"], "synthetic: no person was recorded" if facts["synthetic"] else ""),
        ("signers", str(len(facts["signers"])), ", ".join(facts["signers"])),
        ("annotated takes", str(sum(facts["kinds"].values())), f"{kinds}; {minutes:.1f} minutes"),
        ("trained on", ", ".join(protocol["train_kinds"]), f"{len(trained)} takes"),
        ("tested on", ", ".join(protocol["test_kinds"]), f"{sum(len(fold['test_takes']) for fold in folds)} takes"),
        ("classifiers", str(len(evaluated.metrics["classifiers"])), ", ".join(evaluated.metrics["classifiers"])),
    ]


def _take(verdict: TakeVerdict, figures: Mapping[str, Drawn]) -> dict[str, Any]:
    name = figure_name(verdict.take)
    figure = figures.get(name)
    known = verdict.agreement == verdict.agreement
    return {
        "take": verdict.take,
        "name": name,
        "signer": verdict.signer,
        "kind": verdict.kind,
        "agreement": words.percent(verdict.agreement) if known else "nothing annotated",
        "reasons": verdict.reasons,
        "svg": figure.svg if figure else "",
    }


def _plain_takes(verdicts: Sequence[TakeVerdict]) -> pd.DataFrame:
    return takes_table(verdicts).rename(
        columns={"segments, reference": "reference", "segments, found": "found", "boundaries missed": "missed",
                 "boundaries too many": "too many"}
    )  # fmt: skip


def _provenance(evaluated: Evaluated) -> list[tuple[str, str, str]]:
    """What, its name and its SHA-256."""
    facts = evaluated.facts
    rows = [("recordings and annotations", f"{len(facts['recordings'])} takes of {facts['name']}", facts["digest"])]
    for what, key in (("face", "faces"), ("layout", "layouts"), ("solver and readers", "solvers")):
        rows += [(what, Path(file["name"]).name, file["sha256"]) for file in facts[key]]
    return rows


def _recordings(facts: Mapping[str, Any]) -> dict[str, Any]:
    table = pd.DataFrame(facts["recordings"])
    for column in ("recording", "annotation"):
        table[column] = [digest[:DIGITS] for digest in table[column]]
    note = f"The first {DIGITS} digits of the SHA-256; the whole of it stands in recordings.csv."
    return page_table(table, "recordings", "Every recording and its annotation", notes=[note], folded=True)
