"""Figures of a perceptual study, each as one SVG element to put into a page or a file.

- `means_figure`: means of every question by method with intervals over participants.
- `confusion_figure`: confusion matrices side by side (thesis figures 6.3 and 6.6).
- `expressions_figure`: means by played expression, a line per method.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from signface.report.figure_files import svg_element
from signface.report.style import COLOURS, LONGEST_NAME, look, new_figure, short_name, styled
from signface.study.responses import LIKERT, Responses
from signface.study.statistics.intervals import participant_interval
from signface.study.statistics.tables import StudyTable
from signface.study.statistics.thesis_tables import confusions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Inches between panels, across and down.
PADDING = (0.08, 0.1)


def means_figure(responses: Responses, *, resamples: int, seed: int) -> str:
    """Means of every question by method, bars: bootstrap intervals over participants at 95 %.

    Parameters
    ----------
    responses : Responses
    resamples, seed : int
        Of the bootstrap.

    Returns
    -------
    str
        An `<svg>` element.
    """
    questions, methods = responses.questions, responses.methods
    with styled():
        figure = new_figure(2.3 * len(questions) + 0.4, 2.9, padding=PADDING)
        for number, (column, name) in enumerate(questions.items(), start=1):
            axes = figure.add_subplot(1, len(questions), number)
            for row, method in enumerate(methods):
                answers = responses.table[responses.table["method"] == method]
                mean, low, high = participant_interval(answers, column, resamples=resamples, seed=seed)
                bars = [[mean - low], [high - mean]]
                axes.errorbar(row, mean, bars, **look(row), capsize=4, markersize=7, elinewidth=1.8)
                beside = axes.annotate(f"{mean:.2f}", (row, mean), (9, 0), textcoords="offset points", va="center")
                beside.set(fontsize=8.5, color="#333333")
            axes.set_title(name)
            axes.set_xticks(
                range(len(methods)), map(short_name, methods), rotation=30 if max(map(len, methods)) > 5 else 0
            )
            axes.set_xlim(-0.6, len(methods) - 0.2)
            axes.yaxis.grid(True)
            axes.set_ylabel("share recognised" if column == "correct" else "mean answer, 1 to 7")
        _mark(figure, responses)
        return svg_element(figure, "means", "Means of every question by method, with 95 % intervals over participants")


def differences_figure(responses: Responses, contrasts: StudyTable, models: StudyTable, *, alpha: float = 0.05) -> str:
    """Differences of means of every pair of methods with their intervals, a panel per question.

    Parameters
    ----------
    responses : Responses
    contrasts, models : StudyTable
        As `signface.study.statistics.model_tables` makes them.
    alpha : float
        A difference that the mixed model shows at this level, for the question and then for the pair, is filled.
    """
    questions = responses.questions
    with styled():
        pairs = list(dict.fromkeys(contrasts.frame["", "pair"]))  # a question may not have been asked for every method
        longest = min(2 * LONGEST_NAME + 3, max(map(len, pairs)))
        figure = new_figure(1.9 * len(questions) + 0.085 * longest + 1.2, 0.42 * len(pairs) + 1.1, padding=PADDING)
        panels = figure.subplots(1, len(questions), squeeze=False, sharey=True)[0]
        for axes, name in zip(panels, questions.values()):
            of_question = contrasts.frame[contrasts.frame["", "question"] == name]
            whole = models.frame["mixed model", "p (Holm)"][models.frame["", "question"] == name].min()
            for _, contrast in of_question.iterrows():
                row = pairs.index(contrast["", "pair"])
                value, low, high = (contrast["difference of means", part] for part in ("first − second", "low", "high"))
                significant = whole < alpha and contrast["mixed model", "p (Holm)"] < alpha
                bars = [[max(0.0, value - low)], [max(0.0, high - value)]]
                filling = COLOURS[0] if significant else "white"
                axes.errorbar(value, row, xerr=bars, **look(0), markerfacecolor=filling, capsize=3.5, elinewidth=1.8)
            axes.axvline(0, color="#888888", linewidth=1)
            axes.set_title(name)
            axes.set_yticks(range(len(pairs)), [" – ".join(map(short_name, pair.split(" – "))) for pair in pairs])
            axes.set_ylim(len(pairs) - 0.5, -0.5)
            axes.xaxis.grid(True)
            axes.set_xlabel("shares" if name == questions.get("correct") else "points")
            axes.tick_params(axis="y", length=0)
        _mark(figure, responses)
        return svg_element(figure, "differences", "Differences between methods with 95 % intervals over participants")


def confusion_figure(responses: Responses) -> str:
    """Confusion matrices by method: percentages of what was played; empty string where no expression was asked."""
    matrices = confusions(responses)
    if not matrices:
        return ""
    with styled():
        columns = min(3, len(matrices))
        lines = -(-len(matrices) // columns)
        first = next(iter(matrices.values()))
        size = max(2.6, 0.46 * len(first.columns))
        figure = new_figure(columns * (size + 0.5) + 0.3, lines * (size + 1.1), padding=PADDING)
        for number, (method, counts) in enumerate(matrices.items(), start=1):
            axes = figure.add_subplot(lines, columns, number)
            totals = counts.sum(axis=1).to_numpy()[:, None]
            shares = np.divide(counts.to_numpy(float), totals, out=np.zeros(counts.shape), where=totals > 0)
            edges = [np.arange(size + 1) - 0.5 for size in shares.shape[::-1]]
            axes.pcolormesh(*edges, shares, cmap="Blues", vmin=0, vmax=1, edgecolors="white", linewidth=1)
            axes.set_aspect("equal")
            axes.invert_yaxis()
            for row, column in np.ndindex(shares.shape):
                share = shares[row, column]
                ink = "white" if share > 0.55 else "#333333" if share >= 0.1 else "#999999"
                axes.text(column, row, f"{100 * share:.0f}", ha="center", va="center", fontsize=8.5, color=ink)
            axes.set_xticks(range(len(counts.columns)), counts.columns, rotation=_rotation(counts.columns))
            axes.set_yticks(range(len(counts.index)), counts.index)
            axes.set_title(short_name(method))
            axes.set_xlabel("answered")
            if (number - 1) % columns == 0:
                axes.set_ylabel("played")
            axes.tick_params(length=0)
            axes.spines[:].set_visible(False)
        _mark(figure, responses)
        return svg_element(figure, "confusion", "Confusion matrices by method, per cent of the films of an expression")


def expressions_figure(responses: Responses) -> str:
    """Means of every question by played expression, one mark per method."""
    questions, methods, expressions = responses.questions, responses.methods, responses.expressions
    with styled():
        columns = 2 if len(questions) in (2, 4) else min(3, len(questions))
        lines = -(-len(questions) // columns)
        figure = new_figure(9.6 if columns > 1 else 4.8, 2.5 * lines + 0.5, padding=PADDING)
        for number, (column, name) in enumerate(questions.items(), start=1):
            axes = figure.add_subplot(lines, columns, number)
            means = responses.table.groupby(["method", "expression"])[column].mean()
            for row, method in enumerate(methods):
                values = [means.get((method, expression), np.nan) for expression in expressions]
                shift = (row - (len(methods) - 1) / 2) * 0.16
                axes.plot(
                    np.arange(len(expressions)) + shift, values, **look(row), markersize=6, label=short_name(method)
                )
            for edge in np.arange(len(expressions) - 1) + 0.5:
                axes.axvline(edge, color="#eeeeee", linewidth=1)
            axes.set_title(name)
            axes.set_xticks(range(len(expressions)), expressions, rotation=_rotation(expressions))
            axes.set_ylim((0, 1.02) if column == "correct" else (LIKERT[0] - 0.1, LIKERT[1] + 0.1))
            if column != "correct":
                axes.set_yticks(range(LIKERT[0], LIKERT[1] + 1, 2))
            axes.yaxis.grid(True)
            axes.tick_params(axis="x", length=0)
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(methods))
        _mark(figure, responses)
        return svg_element(figure, "expressions", "Means by played expression and method")


def _rotation(labels: Sequence[str]) -> int:
    return 45 if max(len(str(label)) for label in labels) > 4 else 0


def _mark(figure: Figure, responses: Responses) -> None:
    """A figure of simulated answers says so itself, wherever it is pasted."""
    if responses.simulated:
        mark = figure.text(0.5, 0.5, "SIMULATED", ha="center", va="center")
        mark.set(fontsize=44, color="#b00020", alpha=0.09, rotation=18)
