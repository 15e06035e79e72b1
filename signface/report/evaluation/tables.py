"""The tables of an evaluation, from the content of metrics.json.

- `by_protocol`: the parts of metrics.json by protocol.
- `results_table`, `by_signer_table`: accuracies and their company.
- `segmentation_table`: boundaries and segments, by method and by kind of take.
- `mcnemar_table`: classifiers against each other.
- `confusion_table`: which expression was taken for which.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

SECTIONS = {
    "manual_segments": "manual segments",
    "automatic_segments": "automatic segments",
    "frames": "frames",
}

PROTOCOL_TITLES = {"within": "signer trained on", "across": "signer not trained on"}


def by_protocol(metrics: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Protocol to its part of metrics.json: the whole of it for the first, what stands under `also` for others."""
    return {metrics["protocol"]["name"]: metrics, **metrics.get("also", {})}


def results_table(classifiers: Mapping[str, Mapping]) -> pd.DataFrame:
    """One row a classifier and section: accuracy, its interval, balanced accuracy, macro F1, chance, majority, n.

    Parameters
    ----------
    classifiers : mapping
        The entry `classifiers` of metrics.json.
    """
    rows = []
    for name, sections in classifiers.items():
        for section, title in SECTIONS.items():
            scores = sections[section]
            low, high = scores.get("accuracy_interval") or (None, None)
            rows.append(
                {
                    "classifier": name,
                    "section": title,
                    "accuracy": scores["accuracy"],
                    "low": low,
                    "high": high,
                    "balanced accuracy": scores.get("balanced_accuracy"),
                    "macro F1": scores["macro_f1"],
                    "chance": scores["chance"],
                    "majority": scores["majority"],
                    "majority label": scores["majority_label"],
                    "n": scores["n"],
                }
            )
    return pd.DataFrame(rows)


def by_signer_table(protocol: Mapping[str, Any]) -> pd.DataFrame:
    """One row a signer and classifier: takes, and accuracy with its interval on each section.

    Parameters
    ----------
    protocol : mapping
        The entry `protocol` of a part of metrics.json. A signer tested in turns has several folds with one result.
    """
    rows = []
    for signer in dict.fromkeys(fold["signer"] for fold in protocol["folds"]):
        folds = [fold for fold in protocol["folds"] if fold["signer"] == signer]
        for name, sections in folds[0]["classifiers"].items():
            row = {
                "signer": signer,
                "classifier": name,
                "training takes": len({take for fold in folds for take in fold["train_takes"]}),
                "test takes": sum(len(fold["test_takes"]) for fold in folds),
            }
            for section, title in SECTIONS.items():
                low, high = sections[section].get("accuracy_interval") or (None, None)
                row |= {title: sections[section]["accuracy"], f"{title} low": low, f"{title} high": high}
            rows.append(row | {"majority": sections["manual_segments"]["majority"]})
    return pd.DataFrame(rows)


def segmentation_table(by_kind: Mapping[str, Mapping[str, Mapping[str, Mapping]]]) -> pd.DataFrame:
    """One row a protocol, method and kind of take.

    Parameters
    ----------
    by_kind : mapping
        The entry `segmentation_by_kind` of metrics.json: protocol, method and kind to what `segmentation_metrics` says.
    """
    rows = []
    for protocol, methods in by_kind.items():
        for method, kinds in methods.items():
            for kind, scores in kinds.items():
                row = {"protocol": protocol, "method": method, "kind": kind}
                row |= {f"boundary F1, {float(t):.2f} s": value for t, value in scores["boundary_f1"].items()}
                row |= {
                    "mean IoU": scores["mean_iou"],
                    "frame agreement": scores["frame_agreement"],
                    "over-segmentation": scores["over_segmentation"],
                    "under-segmentation": scores["under_segmentation"],
                    "edit score": scores["edit_score"],
                    "segments, reference": scores["n_reference"],
                    "segments, found": scores["n_found"],
                }
                rows.append(row)
    return pd.DataFrame(rows)


def mcnemar_table(pairs: list[Mapping[str, Any]]) -> pd.DataFrame:
    """One row a pair of classifiers: segments that only one of them labels rightly, and the p value."""
    rows = [
        {
            "first": pair["first"],
            "second": pair["second"],
            "only the first right": pair["only_first"],
            "only the second right": pair["only_second"],
            "p": pair["p"],
        }
        for pair in pairs
    ]
    return pd.DataFrame(rows, columns=["first", "second", "only the first right", "only the second right", "p"])


def confusion_table(sections: Mapping[str, Mapping]) -> pd.DataFrame:
    """Counts of all sections of a classifier below each other: `on`, `reference`, a column for each label found."""
    columns = sections["frames"]["labels"]
    parts = []
    for section, scores in sections.items():
        if "confusion" not in scores:
            continue
        part = pd.DataFrame(scores["confusion"], columns=scores["labels"]).reindex(columns=columns)
        part.insert(0, "reference", scores["labels"])
        part.insert(0, "on", section)
        parts.append(part)
    table = pd.concat(parts, ignore_index=True)
    return table.astype({column: "Int64" for column in columns})
