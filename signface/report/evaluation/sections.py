"""What the sections of an evaluation's page hold: sentences and tables.

Each function gives the paragraphs and the tables of one section.

- `labels`, `segmentation`, `confusions`: how good, where boundaries are, what is taken for what.
- `signers`, `comparison`: signer by signer, classifier against classifier.
- `confidence`, `curve`, `importance`: what confidences are worth, what more material brings, which bases matter.
"""

from __future__ import annotations

from typing import Any

import pandas as pd

from signface.report.evaluation import tables, words
from signface.report.evaluation.evaluated import Evaluated
from signface.report.pages import page_table, spelt
from signface.settings.choices import SEQUENCE_NAMES

#: Paragraphs and tables of a section.
Content = tuple[list[str], list[dict[str, Any]]]


def labels(evaluated: Evaluated) -> Content:
    """Accuracies, by protocol."""
    page_tables = []
    for protocol, part in evaluated.parts.items():
        table = tables.results_table(part["classifiers"])
        table["95 %"] = [_interval(low, high) for low, high in zip(table["low"], table["high"], strict=True)]
        table["majority"] = [
            f"{spelt(share)} ({label})" if label else "–"
            for share, label in zip(table["majority"], table["majority label"], strict=True)
        ]
        table = table.rename(columns={"section": "on"})
        columns = ["classifier", "on", "accuracy", "95 %", "balanced accuracy", "macro F1", "chance", "majority", "n"]
        title = tables.PROTOCOL_TITLES.get(protocol, protocol)
        left_out = {
            name: sections["automatic_segments"].get("without_reference", 0)
            for name, sections in part["classifiers"].items()
        }
        notes = []
        if any(left_out.values()):
            counts = ", ".join(f"{name} {count}" for name, count in left_out.items())
            notes.append(f"Automatic segments that lie in a transition of the reference and are not counted: {counts}.")
        page_tables.append(page_table(table[columns], f"results-{protocol}", title.capitalize(), notes=notes))
    paragraphs = [
        "Manual segments are the annotator’s: only the label is asked. On automatic segments, errors of the "
        "segmentation are added to those of the label. Frames are the whole annotation, transitions included."
    ]
    if any(name in SEQUENCE_NAMES for name in evaluated.metrics["classifiers"]):
        paragraphs.append(
            "Sequence models find segments of their own: on automatic segments they are not asked the same "
            "questions as the others. Compare them on frames."
        )
    return paragraphs, page_tables


def segmentation(evaluated: Evaluated) -> Content:
    """Boundaries and segments, by method and kind of take."""
    table = tables.segmentation_table(evaluated.metrics["segmentation_by_kind"])
    short = {"": "nothing", "within": "same signer", "across": "other signers"}
    table["protocol"] = [short.get(protocol, protocol) for protocol in table["protocol"]]
    table["method"] = [words.method_words(method) for method in table["method"]]
    table = table.rename(
        columns={
            "protocol": "trained on",
            **{  # a number and its unit stay on one line
                column: "F1 at " + column.split(", ")[1].replace(" ", "\N{NO-BREAK SPACE}")
                for column in table.columns
                if column.startswith("boundary")
            },
            "over-segmentation": "over-segmen\N{SOFT HYPHEN}tation",
            "under-segmentation": "under-segmen\N{SOFT HYPHEN}tation",
            "segments, reference": "reference",
            "segments, found": "found",
        }
    )
    paragraphs = [
        "The energies cut a take where its weights move (thesis, 4.4.2); whatever they find gets its labels from a "
        "classifier, and neighbours with one label become one segment. Sequence models find both at once."
    ]
    note = "The last two columns count segments, transitions included."
    return paragraphs, [page_table(table, "segmentation", "Against the reference’s segments", notes=[note])]


def confusions(evaluated: Evaluated) -> Content:
    """Every confusion matrix."""
    page_tables = []
    for protocol, part in evaluated.parts.items():
        for name, sections in part["classifiers"].items():
            for section, title in tables.SECTIONS.items():
                scores = sections[section]
                matrix = pd.DataFrame(scores["confusion"], columns=scores["labels"])
                matrix.insert(0, "reference \\ found", scores["labels"])
                caption = f"{name}, {title}, {tables.PROTOCOL_TITLES.get(protocol, protocol)}"
                page_tables.append(page_table(matrix, f"confusion-{protocol}-{name}-{section}", caption))
    return [_most_confused(evaluated)], page_tables


def _most_confused(evaluated: Evaluated) -> str:
    """The commonest mistake of the best classifier, in words."""
    scores = evaluated.metrics["classifiers"][evaluated.best]["automatic_segments"]
    mistakes = [
        (count, evaluated.vocabulary.describe(truth), evaluated.vocabulary.describe(called))
        for truth, row in zip(scores["labels"], scores["confusion"], strict=True)
        for called, count in zip(scores["labels"], row, strict=True)
        if truth != called and count
    ]
    if not mistakes:
        return f"“{evaluated.best}” takes no expression for another on automatic segments."
    spelt_out = ", ".join(
        f"{truth} for {called} ({count} {'segment' if count == 1 else 'segments'})"
        for count, truth, called in sorted(mistakes, reverse=True)[:3]
    )
    return f"What “{evaluated.best}” takes for something else most often on automatic segments: {spelt_out}."


def signers(evaluated: Evaluated) -> Content:
    """Accuracies of each signer."""
    page_tables = []
    for protocol, part in evaluated.parts.items():
        table = tables.by_signer_table(part["protocol"])
        for title in tables.SECTIONS.values():
            bounds = zip(table.pop(f"{title} low"), table.pop(f"{title} high"), strict=True)
            column = table.columns.get_loc(title)
            assert isinstance(column, int)
            table.insert(column + 1, f"95 % ({title.split()[0]})", [_interval(low, high) for low, high in bounds])
        title = tables.PROTOCOL_TITLES.get(protocol, protocol)
        page_tables.append(page_table(table, f"signers-{protocol}", title.capitalize()))
    signers = {fold["signer"] for fold in evaluated.metrics["protocol"]["folds"]}
    if len(signers) == 1:
        return ["One signer was tested, so that this repeats the numbers above."], page_tables
    return ["How much accuracies differ from signer to signer tells more than any interval over takes."], page_tables


def comparison(evaluated: Evaluated) -> Content:
    """McNemar's test of each two classifiers."""
    page_tables = [
        page_table(
            tables.mcnemar_table(part["mcnemar"]).assign(p=[_probability(pair["p"]) for pair in part["mcnemar"]]),
            f"mcnemar-{protocol}",
            f"McNemar’s test on manual segments, {tables.PROTOCOL_TITLES.get(protocol, protocol)}",
        )
        for protocol, part in evaluated.parts.items()
        if part["mcnemar"]
    ]
    if not page_tables:
        return ["There is one classifier only, with nothing to compare it with."], []
    pairs = len(evaluated.metrics["mcnemar"])
    several = f" With {pairs} pairs, one in twenty falls below 0.05 by chance alone." if pairs > 5 else ""
    return [
        "Segments that only one of two classifiers labels rightly. Segments of one take are alike, so that p is "
        "smaller than it should be: read it beside the intervals over takes." + several
    ], page_tables


def confidence(evaluated: Evaluated) -> Content:
    """Calibration, intensities and what was searched."""
    rows, intensities, parameters = [], [], []
    for protocol, part in evaluated.parts.items():
        title = tables.PROTOCOL_TITLES.get(protocol, protocol)
        for name, sections in part["classifiers"].items():
            for section in ("manual_segments", "automatic_segments"):
                scores = sections[section]
                rows.append(
                    {
                        "classifier": name,
                        "": title,
                        "on": tables.SECTIONS[section],
                        "calibration error": scores.get("calibration_error"),
                        "Brier score": scores.get("brier"),
                    }
                )
        for how, scores in part.get("intensity", {}).items():
            kept = {key.replace("_", " "): value for key, value in scores.items() if isinstance(value, int | float)}
            intensities.append({"intensity by": how, "": title, **kept})
        for fold in part["protocol"]["folds"]:
            for name, training in fold.get("trained", {}).items():
                if training.get("parameters"):
                    chosen = ", ".join(f"{key} {value}" for key, value in training["parameters"].items())
                    parameters.append({"classifier": name, "signer": fold["signer"], "": title, "chosen": chosen})
    paragraphs = [
        "A confidence of 0.8 should be right eight times in ten. The expected calibration error is the mean distance "
        "from that; the Brier score, the mean squared distance of the confidence from right (1) or wrong (0), also "
        "rewards being sure where that is deserved. Lower is better for both."
    ]
    page_tables = [
        page_table(
            pd.DataFrame(rows),
            "calibration",
            "How far confidences can be believed",
            decimals={"calibration error": 3, "Brier score": 3},
        )
    ]
    if intensities:
        paragraphs.append(
            "Intensity (1 to 3) of the annotator’s segments, given their labels: learnt from the training takes, and "
            "by the rule that needs no training."
        )
        page_tables.append(page_table(pd.DataFrame(intensities), "intensity", "Intensity"))
    if parameters:
        paragraphs.append("Parameters were searched within the training takes of each signer.")
        page_tables.append(page_table(pd.DataFrame(parameters), "parameters", "Parameters chosen"))
    return paragraphs, page_tables


def curve(evaluated: Evaluated) -> Content:
    """Accuracy against the number of training takes or signers."""
    curves = evaluated.metrics["learning_curve"]
    paragraphs = []
    if any(curves.values()):
        paragraphs.append(
            "Each classifier was trained on growing parts of the training takes, in several random orders."
        )
    page_tables = []
    for protocol, points in curves.items():
        table = pd.DataFrame(points)
        if not len(table):
            continue
        by = table["by"].iloc[0]
        mean = table.pivot_table(index="classifier", columns="size", values="accuracy", sort=False)
        mean = mean[sorted(mean.columns)]
        gains = [
            f"{name} from {row.iloc[0]:.2f} to {row.iloc[-1]:.2f}"
            for name, row in ((name, mean.loc[name].dropna()) for name in mean.index)
            if len(row) > 1
        ]
        title = tables.PROTOCOL_TITLES.get(protocol, protocol)
        if gains:
            paragraphs.append(
                f"{title.capitalize()}: from {mean.columns[0]} to {mean.columns[-1]} training {by}: {', '.join(gains)}."
            )
        mean.columns = [f"{size} {by if size > 1 else by.removesuffix('s')}" for size in mean.columns]
        page_tables.append(page_table(mean.reset_index(), f"curve-{protocol}", f"Mean accuracy, {title}"))
    left_out = [
        name
        for name in evaluated.metrics["classifiers"]
        if name not in {row["classifier"] for p in curves.values() for row in p}
    ]
    if left_out:
        paragraphs.append(
            f"Without a curve, since training takes long: {', '.join(left_out)} (--learning-curve draws it)."
        )
    return paragraphs, page_tables


def importance(evaluated: Evaluated) -> Content:
    """What each classifier loses without each base."""
    page_tables = []
    for name, rows in evaluated.metrics["importance"].items():
        table = pd.DataFrame(rows)
        table["95 %"] = [_interval(low, high) for low, high in zip(table.pop("low"), table.pop("high"), strict=True)]
        labels = [column for column in table.columns if column.startswith("lost_")]
        table = table[["group", "accuracy_lost", "95 %", *labels]].rename(
            columns={"group": "base", "accuracy_lost": "accuracy lost"}
            | {label: label.removeprefix("lost_") for label in labels}
        )
        note = "The last columns: share of the segments of each label that are lost with the base."
        page_tables.append(
            page_table(
                table,
                f"importance-{name}",
                f"What {name} loses without each base",
                notes=[note],
                folded=True,
                decimals={},
            )
        )
    paragraphs = [
        "A classifier that needs a base loses accuracy when the base’s weights are dealt out anew among the segments "
        "of the test takes. Left and right are dealt out together, since either could stand in for the other."
    ]
    without = [name for name in evaluated.metrics["classifiers"] if name not in evaluated.metrics["importance"]]
    if without:
        paragraphs.append(
            f"Not asked of {', '.join(without)}: what does not label a segment by its mean weights has no such answer."
        )
    return paragraphs, page_tables


def _probability(p: float) -> str:
    return "< 0.0001" if p < 0.0001 else f"{p:.4f}"


def _interval(low: float | None, high: float | None) -> str:
    if low is None or high is None or low != low or high != high:
        return "–"
    return f"{spelt(float(low))} to {spelt(float(high))}"
