"""The figures of an evaluation, from the content of metrics.json and the tables made of it.

- `draw_accuracy`: bars for each classifier, manual and automatic segments (Reverdy 2019, figure 4.4).
- `draw_segmentation`: boundary F1 at every tolerance, by method and kind of take.
- `draw_confusions`: which expression is taken for which.
- `draw_learning_curve`: accuracy against the number of training takes or signers.
- `draw_take`: one take, its energies, what was found and the reference (figure 4.3).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from signface.descriptors import Descriptors
from signface.label.vocabulary import Vocabulary
from signface.report.evaluation.tables import PROTOCOL_TITLES, SECTIONS
from signface.report.style import COLOURS, MARKS, look, new_figure, short_name, styled
from signface.report.timeline import draw_rows_on
from signface.segmentation.segments import Segments

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Colour and hatching of the bars: both colours are told apart by colour-blind readers, the hatching in grey prints.
BARS = {"manual_segments": ("#0072b2", ""), "automatic_segments": ("#e69f00", "////")}

#: Points of a timeline's curves per second in a page that holds many.
CURVE_RATE = 40.0

#: Segments that a share must be counted from to be drawn.
LEAST_BIN = 5


def draw_accuracy(protocols: Mapping[str, Mapping[str, Mapping]]) -> Figure:
    """Accuracy of each classifier on manual and automatic segments, one panel for each protocol.

    Whiskers are the bootstrap's intervals over takes. Chance is a line through the panel; the majority class, which
    differs between the two kinds of segments, is a mark across each bar.

    Parameters
    ----------
    protocols : mapping
        Protocol to the entry `classifiers` of its part of metrics.json.
    """
    with styled():
        bars = max(len(classifiers) for classifiers in protocols.values())
        figure = new_figure(max(3.6, 0.75 + 0.82 * bars) * len(protocols) + 0.4, 3.7)
        panels = figure.subplots(1, len(protocols), squeeze=False, sharey=True)[0]
        for panel, (protocol, classifiers) in zip(panels, protocols.items(), strict=True):
            _accuracy_panel(panel, classifiers)
            panel.set_title(PROTOCOL_TITLES.get(protocol, protocol))
        panels[0].set_ylabel("accuracy")
        handles, labels = panels[0].get_legend_handles_labels()
        order = [labels.index(name) for name in sorted(labels, key=lambda name: "segments" not in name)]  # bars first
        wide = figure.get_figwidth() > 8
        figure.legend(
            [handles[k] for k in order], [labels[k] for k in order], loc="outside lower center", ncols=4 if wide else 2
        )
        return figure


def _accuracy_panel(panel: Axes, classifiers: Mapping[str, Mapping]) -> None:
    names = list(classifiers)
    for number, (section, (colour, hatch)) in enumerate(BARS.items()):
        scores = [classifiers[name][section] for name in names]
        accuracy = np.array([_float(scored["accuracy"]) for scored in scores])
        centres = np.arange(len(names)) + 0.38 * (number - 0.5)
        style = {"color": colour, "hatch": hatch, "edgecolor": "white", "linewidth": 0}
        panel.bar(centres, accuracy.tolist(), 0.36, label=SECTIONS[section], **style)  # type: ignore[arg-type]
        for at, scored, value in zip(centres, scores, accuracy, strict=True):
            low, high = scored.get("accuracy_interval") or (value, value)
            if low < high:
                panel.plot([at, at], [low, high], color="#222222", linewidth=1)
            if np.isfinite(value):
                panel.annotate(
                    f"{value:.2f}", (at, max(high, value)), (0, 2), textcoords="offset points", ha="center", fontsize=8
                )
        majority = [_float(scored["majority"]) for scored in scores]
        label = "_" if number else "always the most frequent label"
        panel.hlines(majority, centres - 0.18, centres + 0.18, color="#a51d2d", linewidth=1.8, label=label)
    chance = scores[0]["chance"]
    panel.axhline(chance, color="#444444", linewidth=1, linestyle=":", label="chance (one label in all)")
    panel.set_xticks(range(len(names)), [short_name(name) for name in names])
    panel.set_xlim(-0.6, len(names) - 0.4)
    panel.set_ylim(0, 1.05)
    panel.set_yticks(np.arange(0, 1.01, 0.2))
    panel.yaxis.grid(True)
    panel.tick_params(axis="x", length=0)


def draw_segmentation(table: pd.DataFrame) -> Figure:
    """Boundary F1 of each method, a panel for each kind of take, a mark for each tolerance.

    Parameters
    ----------
    table : DataFrame
        Of `signface.report.evaluation.tables.segmentation_table`.
    """
    with styled():
        kinds = list(dict.fromkeys(table["kind"]))
        methods = list(dict.fromkeys(_method(row) for row in table.to_dict("records")))
        figure = new_figure(2.6 + 2.2 * len(kinds), 1.3 + 0.28 * len(methods))
        panels = figure.subplots(1, len(kinds), squeeze=False, sharey=True)[0]
        tolerances = [column for column in table.columns if column.startswith("boundary F1")]
        for panel, kind in zip(panels, kinds, strict=True):
            for row in table[table["kind"] == kind].to_dict("records"):
                at = methods.index(_method(row))
                values = [row[column] for column in tolerances]
                panel.plot(values, [at] * len(values), color="#bbbbbb", linewidth=2, zorder=1)
                for number, (column, value) in enumerate(zip(tolerances, values, strict=True)):
                    within = column.removeprefix("boundary F1, ")
                    panel.plot(value, at, MARKS[number], color=COLOURS[number], markersize=6, label=f"within {within}")
            panel.set_title(kind)
            panel.set_xlim(0, 1.02)
            panel.set_ylim(len(methods) - 0.5, -0.5)
            panel.set_xlabel("boundary F1")
            panel.xaxis.grid(True)
            panel.set_yticks(range(len(methods)), methods)
            panel.tick_params(axis="y", length=0)
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles[: len(tolerances)], labels[: len(tolerances)], loc="outside lower center", ncols=3)
        return figure


def _method(row: Mapping[str, Any]) -> str:
    """Name of a row of the segmentation's table."""
    tested_on = {"within": "same signer", "across": "other signers"}.get(row["protocol"], "")
    return f"{short_name(row['method'])}, {tested_on}" if tested_on else short_name(row["method"])


def draw_confusions(sections: Mapping[str, Mapping], *, columns: int = 3) -> Figure:
    """Confusion matrices side by side: counts, coloured by their share of the reference's label.

    Parameters
    ----------
    sections : mapping
        Title of each panel to scores with `labels` and `confusion`.
    """
    with styled():
        columns = min(columns, len(sections))
        lines = -(-len(sections) // columns)
        size = 0.34 * max(len(scores["labels"]) for scores in sections.values())
        figure = new_figure(columns * (size + 0.75), lines * (size + 1.05))
        axes = figure.subplots(lines, columns, squeeze=False).ravel()
        for panel, (title, scores) in zip(axes, sections.items()):
            counts = np.array(scores["confusion"], dtype=float)
            totals = counts.sum(axis=1, keepdims=True)
            shares = np.divide(counts, totals, out=np.zeros_like(counts), where=totals > 0)
            edges = np.arange(len(counts) + 1) - 0.5
            panel.pcolormesh(edges, edges, shares, cmap="Blues", vmin=0, vmax=1, edgecolors="white", linewidth=0.8)
            for row, column in np.argwhere(counts > 0):
                ink = "white" if shares[row, column] > 0.55 else "#222222"
                panel.text(column, row, f"{counts[row, column]:g}", ha="center", va="center", fontsize=8, color=ink)
            panel.set_aspect("equal")
            panel.invert_yaxis()
            names = ["~" if label == "transition" else label for label in scores["labels"]]
            panel.set_xticks(range(len(names)), names)
            panel.set_yticks(range(len(names)), names)
            panel.tick_params(length=0)
            panel.spines[:].set_visible(False)
            panel.set_title(title)
        for number, panel in enumerate(axes):
            if number >= len(sections):
                panel.set_axis_off()
                continue
            if number % columns == 0:
                panel.set_ylabel("reference")
            if number + columns >= len(sections):
                panel.set_xlabel("found")
        return figure


def draw_learning_curve(table: pd.DataFrame) -> Figure:
    """Accuracy against what was trained on, a panel for each protocol; bands: the least and the most of all draws.

    Parameters
    ----------
    table : DataFrame
        `protocol`, and the columns of `signface.evaluation.learning_curve.learning_curve`.
    """
    with styled():
        protocols = list(dict.fromkeys(table["protocol"]))
        figure = new_figure(0.6 + 4.1 * len(protocols), 3.5)
        panels = figure.subplots(1, len(protocols), squeeze=False, sharey=True)[0]
        for panel, protocol in zip(panels, protocols, strict=True):
            part = table[table["protocol"] == protocol]
            for number, name in enumerate(dict.fromkeys(part["classifier"])):
                drawn = part[part["classifier"] == name].groupby("size")["accuracy"].agg(["mean", "min", "max"])
                style = look(number, "-")
                panel.fill_between(drawn.index, drawn["min"], drawn["max"], color=style["color"], alpha=0.12, lw=0)
                panel.plot(drawn.index, drawn["mean"], **style, lw=1.4, markersize=4.5, label=short_name(name))
            panel.set_title(PROTOCOL_TITLES.get(protocol, protocol))
            panel.set_xticks(sorted(set(part["size"])))
            panel.set_xlabel("training " + part["by"].iloc[0] + (" of each signer" if protocol == "within" else ""))
            panel.grid(True)
        low, high = float(table["accuracy"].min()), float(table["accuracy"].max())
        panels[0].set_ylim(max(0.0, np.floor(10 * low - 0.2) / 10), min(1.02, np.ceil(10 * high + 0.2) / 10))
        panels[0].set_ylabel("accuracy on manual segments")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=6)
        return figure


def draw_take(
    descriptors: Descriptors,
    rows: Mapping[str, Segments],
    *,
    marks: Mapping[str, np.ndarray],
    vocabulary: Vocabulary | None = None,
) -> Figure:
    """One take: its energies, what was found, and the reference below; boundaries without a counterpart are marked.

    Parameters
    ----------
    descriptors : Descriptors
        At least three frames, one of them with weights.
    rows : mapping of str to Segments
    marks : mapping of str to (K,) array
        Row to the times that are marked on it (seconds).
    vocabulary : Vocabulary, optional
        Gives the labels their colours.
    """
    with styled():
        figure = new_figure(9.4, 2.0 + 0.28 * len(rows))
        draw_rows_on(figure, descriptors, rows, title="", rate=CURVE_RATE, marks=marks, vocabulary=vocabulary)
        return figure


def draw_reliability(curves: Mapping[str, Sequence[Mapping[str, float]]]) -> Figure:
    """Share right against confidence, a line for each classifier; on the diagonal a confidence means what it says.

    Parameters
    ----------
    curves : mapping
        Title to bins, each with `confidence`, `accuracy` and `n`.
    """
    with styled():
        figure = new_figure(5.0, 3.5)
        panel = figure.subplots()
        panel.plot([0, 1], [0, 1], color="#999999", linewidth=1, linestyle="--")
        for number, (name, bins) in enumerate(curves.items()):
            kept = [share for share in bins if share["n"] >= LEAST_BIN]
            confidence, accuracy = ([share[key] for share in kept] for key in ("confidence", "accuracy"))
            panel.plot(confidence, accuracy, **look(number, "-"), markersize=5, label=short_name(name))
        panel.set(xlim=(0, 1), ylim=(0, 1.02), xlabel="confidence", ylabel="share right")
        panel.grid(True)
        panel.set_aspect("equal")
        figure.legend(loc="outside right center")
        return figure


def section_titles(classifiers: Mapping[str, Mapping], section: str) -> dict[str, Mapping]:
    """Panels of `draw_confusions`: each classifier's scores of a section, with the accuracy beside the name."""
    return {
        f"{short_name(name)}, {_float(sections[section]['accuracy']):.2f}": sections[section]
        for name, sections in classifiers.items()
        if section in SECTIONS and sections[section]["n"]
    }


def _float(value: float | None) -> float:
    return float("nan") if value is None else float(value)
