"""The report of an evaluation: the accuracy bars of the thesis's figure 4.4 and their tables, in one HTML page.

- `results_table`: one row for each classifier, protocol and section, as a table.
- `draw_accuracy`: the bars.
- `evaluation_page`: the page.
"""

from __future__ import annotations

import html
import io
from collections.abc import Mapping
from typing import TYPE_CHECKING

import pandas as pd

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SECTIONS = {
    "manual_segments": "reference segments",
    "automatic_segments": "automatic segments",
    "frames": "frames",
}

#: Bars of the sections: Okabe and Ito's colours, as everywhere.
BAR_COLOURS = {"manual_segments": "#0072b2", "automatic_segments": "#e69f00", "frames": "#999999"}

PROTOCOL_TITLES = {"within": "signer trained on", "across": "signer not trained on"}

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
table { border-collapse: collapse; margin: 1rem 0; }
th, td { padding: .25rem .7rem; border-bottom: 1px solid #ddd; text-align: right; }
th:first-child, td:first-child { text-align: left; }
td.hit { background: #e6f0f7; }
figure { margin: 1.5rem 0; } svg { max-width: 100%; height: auto; } figcaption, .note { color: #555; }
"""


def results_table(classifiers: Mapping[str, Mapping]) -> pd.DataFrame:
    """One row a classifier and section: accuracy, its interval, macro F1, chance, majority, n.

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
                    "macro F1": scores["macro_f1"],
                    "chance": scores["chance"],
                    "majority": scores["majority"],
                    "majority label": scores["majority_label"],
                    "n": scores["n"],
                }
            )
    return pd.DataFrame(rows)


def draw_accuracy(protocols: Mapping[str, Mapping[str, Mapping]]) -> Figure:
    """Accuracy of each classifier on each section, one panel for each protocol (thesis, figure 4.4).

    Whiskers are the bootstrap's intervals over takes. Chance and the majority class, which differ between segments and
    frames, are marks across each bar.

    Parameters
    ----------
    protocols : mapping
        Protocol to the entry `classifiers` of metrics.json.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.2 * len(protocols), 3.8), layout="constrained")
    panels = figure.subplots(1, len(protocols), squeeze=False, sharey=True)[0]
    for panel, (protocol, classifiers) in zip(panels, protocols.items(), strict=True):
        table = results_table(classifiers)
        names = list(classifiers)
        for number, (section, title) in enumerate(SECTIONS.items()):
            part = table[table["section"] == title].set_index("classifier").loc[names]
            accuracy = part["accuracy"].to_numpy(float)
            place = [index + 0.27 * (number - 1) for index in range(len(names))]
            panel.bar(place, accuracy, width=0.25, color=BAR_COLOURS[section], label=title)
            low, high = part["low"].to_numpy(float), part["high"].to_numpy(float)
            panel.errorbar(
                place, accuracy, yerr=[accuracy - low, high - accuracy], fmt="none", ecolor="#222", elinewidth=1
            )
            for column, style in (("chance", ":"), ("majority", "-")):
                level = part[column].to_numpy(float)
                left, right = [at - 0.125 for at in place], [at + 0.125 for at in place]
                name = {"chance": "chance", "majority": "majority class"}[column] if number == 0 else None
                panel.hlines(level, left, right, color="#d55e00", linewidth=1.6, linestyle=style, label=name)
        panel.set_xticks(range(len(names)), names)
        panel.set_ylim(0, 1)
        panel.set_title(PROTOCOL_TITLES[protocol])
        panel.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("accuracy")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, frameon=False, fontsize="small")
    return figure


def evaluation_page(
    *, corpus: str, segmentation: Mapping, protocols: Mapping[str, Mapping[str, Mapping]], settings: Mapping[str, str]
) -> str:
    """The report as one HTML page with nothing outside it.

    Parameters
    ----------
    corpus : str
        Name of the corpus.
    segmentation : mapping
        The entry `segmentation` of metrics.json.
    protocols : mapping
        Protocol to the entry `classifiers` of metrics.json.
    settings : mapping of str to str
        What was evaluated, for the list at the top.
    """
    parts = [
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>",
        f"<title>Evaluation on {html.escape(corpus)}</title><style>{STYLE}</style></head><body>",
        f"<h1>Evaluation on {html.escape(corpus)}</h1>",
        _table(["", ""], [[html.escape(name), html.escape(value)] for name, value in settings.items()]),
        "<h2>Labels</h2><figure>",
        _svg(draw_accuracy(protocols)),
        "<figcaption>Share of segments (or of time) with the reference's label. Whiskers: 95&nbsp;% of what other "
        "draws of whole takes give. Marks: a guess among the labels (dotted), and always the reference's most frequent "
        "label.</figcaption></figure>",
    ]
    for protocol, classifiers in protocols.items():
        parts += [f"<h3>{PROTOCOL_TITLES[protocol].capitalize()}</h3>", _results(classifiers)]
        for name, sections in classifiers.items():
            parts.append(f"<details><summary>Confusions of {html.escape(name)}, automatic segments</summary>")
            parts += [_confusion(sections["automatic_segments"]), "</details>"]
    f1 = ", ".join(f"{value:.2f} within {tolerance} s" for tolerance, value in segmentation["boundary_f1"].items())
    parts += [
        "<h2>Segments</h2><p>Automatic segments against the reference's: boundary F1 "
        f"{f1}; mean intersection over union {segmentation['mean_iou']:.2f}; stable or transition agree on "
        f"{segmentation['frame_agreement']:.0%} of the time. {segmentation['n_found']} automatic segments, "
        f"{segmentation['n_reference']} in the reference.</p>",
        "</body></html>\n",
    ]
    return "\n".join(parts)


def _results(classifiers: Mapping[str, Mapping]) -> str:
    header = ["classifier", "on", "accuracy", "95 %", "macro F1", "chance", "majority", "n"]
    rows = []
    for row in results_table(classifiers).to_dict("records"):
        interval = "" if pd.isna(row["low"]) else f"{row['low']:.2f} to {row['high']:.2f}"
        majority = "" if row["majority label"] is None else f"{row['majority']:.2f} ({row['majority label']})"
        shares = [number(row[name]) for name in ("accuracy", "macro F1", "chance")]
        rows.append([row["classifier"], row["section"], shares[0], interval, *shares[1:], majority, str(row["n"])])
    return _table(header, rows)


def number(value: float | None) -> str:
    """Two decimals, or a dash where there is nothing to say."""
    return "–" if value is None or pd.isna(value) else f"{value:.2f}"


def _confusion(scores: Mapping) -> str:
    """Rows: the reference's labels; columns: the labels found."""
    labels = scores["labels"]
    head = "".join(f"<th>{html.escape(label)}</th>" for label in ["reference \\ found", *labels])
    body = "".join(
        f"<tr><td>{html.escape(label)}</td>"
        + "".join(f"<td{' class=hit' if i == j else ''}>{count or ''}</td>" for j, count in enumerate(row))
        + "</tr>"
        for i, (label, row) in enumerate(zip(labels, scores["confusion"], strict=True))
    )
    return f"<table><tr>{head}</tr>{body}</table>"


def _table(header: list[str], rows: list[list[str]]) -> str:
    head = "" if not any(header) else "<tr>" + "".join(f"<th>{cell}</th>" for cell in header) + "</tr>"
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table>{head}{body}</table>"


def _svg(figure: Figure) -> str:
    """The figure as an SVG element, the same bytes every time."""
    import matplotlib

    stream = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "signface", "svg.fonttype": "none", "font.family": "sans-serif"}):
        figure.savefig(stream, format="svg", metadata={"Date": None})
    return stream.getvalue()[stream.getvalue().index("<svg") :]
