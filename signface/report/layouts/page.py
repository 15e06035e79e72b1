"""The page of a layout study: its sentences, and which figures it shows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from signface.face.model import FaceModel
from signface.placement.choosing import METHODS, Material
from signface.placement.empirical import EMPIRICAL
from signface.placement.evaluation import MAPPINGS, error_map
from signface.placement.findings import against, flattening, mean_moment, same_size
from signface.placement.layout_study import Cell, Entry, Plan, summarise
from signface.report.layouts.report import draw_curves, layout_page, paint_clusters, paint_errors

#: Clusters drawn, as in figure 3.6.
CLUSTERS = 30
#: What the recommended layout is held against.
PRESENT = "default-40"


def study_page(
    plan: Plan,
    face: FaceModel,
    entries: Sequence[Entry],
    cells: Sequence[Cell],
    table: pd.DataFrame,
    *,
    method: str,
    material: Material,
    warnings: Sequence[str] = (),
) -> str:
    """The page as HTML.

    Parameters
    ----------
    plan : Plan
    face : FaceModel
    entries : sequence of Entry
    cells : sequence of Cell
    table : DataFrame
        From `collect`.
    method : str
        Of the recommended layout.
    material : Material
        What it was chosen from.
    warnings : sequence of str
    """
    summary = summarise(table)
    recommended = f"recommended-{plan.recommended}"
    figures = [
        (
            draw_curves(summary[summary["family"] != "recommended"], MAPPINGS),
            "Error against the number of markers on held-out actors (figures 3.5, 3.7 and 3.8 of the thesis).",
            "svg",
        )
    ]
    layouts = {entry.layout.name: entry.layout for entry in entries}
    shown = [name for name in ("man-15", "sign3d-60", PRESENT, recommended) if name in layouts]
    for mapping in ("thin-shell", "gp"):
        maps = {name: error_map(face, mean_moment(list(cells), name, "glued", mapping)) for name in shown}
        points = {name: layouts[name].points(face) for name in shown}
        figures.append(
            (
                paint_errors(face, maps, points, f"{MAPPINGS[mapping]}, markers as they are really glued"),
                "Where the error lies (figure 3.4 of the thesis).",
                "png",
            )
        )
    if "k-means" in plan.methods:
        figures.append((_clusters(plan, face, material), "Clusters of k-means and their markers (figure 3.6).", "png"))
    return layout_page(
        title="Which markers, how many, where",
        findings=_findings(table, recommended, method),
        method=_method(plan),
        figures=figures,
        tables=[
            ("Mean error of every layout (mm per vertex)", summary),
            ("Where the curves flatten", flattening(table)),
            ("Optimised layouts beside empirical ones of their size", same_size(table)),
            (f"{recommended} beside {PRESENT}", against(table, recommended, PRESENT)),
        ],
        warnings=warnings,
    )


def _clusters(plan: Plan, face: FaceModel, material: Material):  # type: ignore[no-untyped-def]
    several = {"one actor": Material(face, material.actors[:1], material.rules)}
    if plan.selection > 1:
        several[f"{plan.selection} actors"] = material
    count = min(CLUSTERS, max(plan.sizes))
    found = {name: own.clusters(count, seed=plan.seed) for name, own in several.items()}
    return paint_clusters(
        face,
        material.sites.clustered,
        {f"{count} clusters, {name}": own.members for name, own in found.items()},
        {f"{count} clusters, {name}": face.mesh.vertices[list(own.markers)] for name, own in found.items()},
    )


def _findings(table: pd.DataFrame, recommended: str, method: str) -> list[str]:
    """Sentences with the numbers of this study."""
    words = []
    flat = flattening(table)
    for (condition, mapping), own in flat.groupby(["condition", "mapping"], sort=False):
        least = own.loc[own["least_mm"].idxmin()]
        spans = ", ".join(f"{row.family} {row.enough}" for row in own.itertuples(index=False))
        words.append(
            f"{MAPPINGS[str(mapping)]}, {condition} markers: markers from which the error is within 5 % of the curve's "
            f"least: {spans}. Least of all: {least['least_mm']:.2f} mm ({least['family']}, {least['at']} markers)."
        )
    pairs = same_size(table)
    if len(pairs):
        for family, own in pairs.groupby(pairs["layout"].str.replace(r"-\d+$", "", regex=True), sort=False):
            if family == "recommended":
                continue
            words.append(
                f"{family}: less error than empirical layouts of its size in {np.mean(own['change'] > 0):.0%} of "
                f"{len(own)} comparisons (layout, condition, mapping); {own['change'].mean():+.0%} less on average."
            )
    rivals = against(table, recommended, PRESENT)
    for row in rivals.itertuples(index=False):
        words.append(
            f"{recommended} ({METHODS[method]}) beside {PRESENT}, {MAPPINGS[str(row.mapping)]}, {row.condition}: "
            f"{row.one_mm:.3f} against {row.other_mm:.3f} mm ({row.change:+.0%} less), better in {row.better:.0%} of "
            f"{row.pairs} pairs of actors and draws."
        )
    return words


def _method(plan: Plan) -> list[str]:
    return [
        f"{plan.actors} synthetic actors, each with a head and skin of their own, a range of motion and signed takes "
        f"of {plan.seconds:g} s at 30 frames a second. Markers are chosen on the range of motion of the first "
        f"{plan.selection}; errors are taken on the takes of the others, which no choice has seen. The learnt mappings "
        "are trained on one actor's range of motion and tested on another actor's takes.",
        "Error: root mean square distance of a vertex that moves from its place on the avatar, in millimetres; eq. 3.5 "
        "of the thesis sums over the vertices instead, which multiplies it by the square root of their number (column "
        "rmse_mm of errors.csv).",
        "Glued: every actor wears every marker 1 to 3 mm beside its place, with 0.1 to 0.3 mm of jitter, in training "
        f"and in tests; {plan.draws} draws.",
        "The method of the recommended layout is the one with the least error on the selection actors, each left out "
        "in turn (choice_of_method.csv).",
        "Empirical layouts: " + "; ".join(f"{name}: {what}" for name, what in EMPIRICAL.items()) + ".",
        "These are synthetic faces with the avatar's 51 bases beneath: what a base does not show (a wrinkle) no layout "
        "is rewarded for seeing.",
    ]
