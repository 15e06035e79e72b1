"""The best, the middle and the worst take in one picture, annotated and found; for `benchmarks.real`.

- `draw_three`: of one list of takes, as `benchmarks.real` finds them.
- `draw_boundaries`: their energies, and where they are cut.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from signface.frames import Means
from signface.head import head_angles
from signface.label.vocabulary import NONE
from signface.learn.examples import Example
from signface.segmentation.cutting import segment
from signface.segmentation.energy import energies
from signface.segmentation.noise import jitter


def agreement(example: Example, table: pd.DataFrame, labels: Sequence[str]) -> float:
    """Share of the annotated and found time that is both, with the same label."""
    both = either = 0.0
    for label in labels:
        spans = [t[t["label"] == label][["start_s", "end_s"]].to_numpy(float) for t in (example.reference.table, table)]
        shared = sum(max(0.0, min(b, d) - max(a, c)) for a, b in spans[0] for c, d in spans[1])
        both += shared
        either += sum(b - a for one in spans for a, b in one) - shared
    return both / either if either else float("nan")


def draw_three(
    found: list[tuple[Example, pd.DataFrame]], labels: Sequence[str], path: Path, *, signal: str, title: str
) -> None:
    """Draw the three takes: a column of the weights, the head's pitch, the velocity energy, and both annotations.

    Takes in which nothing is annotated or found say nothing here and are passed over.
    """
    from matplotlib.figure import Figure

    scored = [(agreement(e, table, labels), number) for number, (e, table) in enumerate(found)]
    scored = sorted(pair for pair in scored if np.isfinite(pair[0]))
    figure = Figure(figsize=(11, 8), layout="constrained")
    rows = figure.subplots(3, 1)
    for axes, (what, (score, number)) in zip(
        rows, (("best", scored[-1]), ("middle", scored[len(scored) // 2]), ("worst", scored[0])), strict=True
    ):
        example, table = found[number]
        take = example.descriptors
        curves = energies(take)
        speed = np.interp(take.time, curves.time, curves.velocity)
        for values, name, colour in (
            (take.weight(signal), signal, "tab:blue"),
            (head_angles(take)["pitch"], "pitch of the head", "tab:gray"),
            (speed, "velocity energy", "tab:olive"),
        ):
            spread = np.nanmax(values) - np.nanmin(values)
            scaled = (values - np.nanmin(values)) / (spread if spread > 0 else 1.0)
            smooth = Means(np.nan_to_num(scaled)[:, None], take.rate)
            since = take.time - take.start
            axes.plot(take.time, smooth.between(since - 0.04, since + 0.04)[:, 0], color=colour, lw=1.2, label=name)
        for row, (kind, spans) in enumerate((("annotated", example.reference.table), ("found", table))):
            for start, end, label in spans[["start_s", "end_s", "label"]].itertuples(index=False):
                if label == NONE:
                    continue
                axes.axvspan(start, end, ymin=0.90 - 0.09 * row, ymax=0.98 - 0.09 * row, color=f"C{1 + 2 * row}", lw=0)
                axes.text(
                    (start + end) / 2, 1.265 - 0.12 * row, f"{kind}: {label}", ha="center", va="center", fontsize=8
                )
        axes.set_ylim(-0.05, 1.35)
        axes.set_yticks([])
        axes.set_title(f"{what}: {example.take}, {score:.0%} of the annotated and found time in both", fontsize=10)
    figure.legend(*rows[0].get_legend_handles_labels(), loc="outside lower center", fontsize=8, ncols=3)
    rows[-1].set_xlabel("time (s)")
    figure.suptitle(title)
    figure.savefig(path, dpi=110)


def draw_boundaries(scored: list[tuple[float, Example]], path: Path, *, title: str) -> None:
    """Draw the three takes: activity, the floor of its jitter, what is annotated, and the transitions found.

    `scored` is what `benchmarks.real_boundaries.scored_boundaries` gives.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 8), layout="constrained")
    rows = figure.subplots(3, 1)
    for axes, (what, (score, example)) in zip(
        rows, (("best", scored[-1]), ("middle", scored[len(scored) // 2]), ("worst", scored[0])), strict=True
    ):
        take, noise = example.descriptors, jitter(example.descriptors)
        spared = (3.0 * noise.velocities, 3.0 * noise.accelerations)
        curves, beyond = energies(take), energies(take, spared=spared)
        top = 1.45 * curves.activity.max()
        axes.plot(
            curves.time, curves.activity, color="tab:gray", lw=1.0, label="activity (root of the combined energy)"
        )
        axes.plot(beyond.time, beyond.activity, color="tab:olive", lw=1.4, label="what is beyond jitter")
        axes.axhspan(0, noise.activity, color="tab:red", alpha=0.35, lw=0, label="mean activity of jitter alone")
        for row, (kind, table) in enumerate((("annotated", example.reference.table), ("found", segment(take).table))):
            shown = table[table["label"] != NONE] if kind == "annotated" else table[table["kind"] == "transition"]
            for start, end in shown[["start_s", "end_s"]].to_numpy(float):
                axes.axvspan(start, end, ymin=0.90 - 0.10 * row, ymax=0.98 - 0.10 * row, color=f"C{1 + 2 * row}", lw=0)
                if kind == "annotated":
                    for mark in (start, end):
                        axes.axvline(mark, ymax=0.90, color="C1", lw=0.8, ls="--")
            labels = ", ".join(sorted(set(shown["label"]))) if kind == "annotated" else "transitions"
            axes.text(take.start, (0.94 - 0.10 * row) * top, f"{kind}: {labels} ", ha="right", va="center", fontsize=8)
        axes.set_xlim(take.start, take.start + take.duration)
        axes.set_ylim(0, top)
        axes.set_yticks([tick for tick in axes.get_yticks() if tick < top / 1.4])
        axes.set_ylabel("activity (1/s)")
        axes.set_title(f"{what}: {example.take}, F1 {score:.2f} within 0.2 s, {noise}", fontsize=10)
    figure.legend(*rows[0].get_legend_handles_labels(), loc="outside lower center", fontsize=8, ncols=3)
    rows[-1].set_xlabel("time (s)")
    figure.suptitle(title)
    figure.savefig(path, dpi=110)
