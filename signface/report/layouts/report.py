"""The report of a comparison of layouts: a folder with its page, its tables and the recommended layout.

- `write_report`: the folder.
- `comparison_page`: the page alone.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from signface.face.layout_files import write_layout
from signface.files import whole_file, write_text
from signface.placement.choosing import METHODS, Material, unseen_words
from signface.placement.comparison import Comparison, summarise
from signface.placement.empirical import EMPIRICAL
from signface.placement.evaluation import MAPPINGS, error_map
from signface.placement.findings import against, flattening, mean_moment, same_size
from signface.render.layout_sheet import distances, draw_sheet
from signface.report.figure_files import png_element, svg_element
from signface.report.layouts.figures import draw_curves, paint_clusters, paint_errors
from signface.report.pages import page_table, render_page

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Clusters drawn, as in figure 3.6.
CLUSTERS = 30
#: What the recommended layout is held against.
PRESENT = "default-40"


def write_report(comparison: Comparison, folder: str | PathLike[str]) -> Path:
    """Write `report.html`, the tables as CSV, every layout, and the recommended one with its sheet.

    Parameters
    ----------
    comparison : Comparison
    folder : path
        Created when missing.

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
    signface.placement.comparison.compare_layouts : makes the comparison.
    """
    folder, face, layout = Path(folder), comparison.face, comparison.recommended
    table = comparison.table
    tables = {"errors": table, "summary": summarise(table), "choice_of_method": comparison.rivals}
    for name, frame in tables.items():
        with whole_file(folder / f"{name}.csv") as temporary:
            frame.to_csv(temporary, index=False, float_format="%.5f")
    for candidate in comparison.candidates:
        write_layout(candidate.layout, folder / "layouts" / f"{candidate.layout.name}.csv", face)
    write_layout(layout, folder / f"{layout.name}.csv", face)
    with whole_file(folder / f"{layout.name}-distances.csv") as temporary:
        distances(layout, face).to_csv(temporary, index=False)
    sheets = [folder / f"{layout.name}-sheet.{ending}" for ending in ("pdf", "svg", "png")]
    draw_sheet(face, layout, *sheets, note=f"Chosen by: {METHODS[comparison.method]}.")
    write_text(folder / "report.html", comparison_page(comparison))
    return folder / "report.html"


def comparison_page(comparison: Comparison) -> str:
    """The page: one file, no script, no request to anyone."""
    from signface.extras import version_of

    plan, table, name = comparison.plan, comparison.table, comparison.recommended.name
    summary = summarise(table)
    curves = draw_curves(summary[summary["family"] != "recommended"], MAPPINGS)
    description = "Lines: error of each family of layouts against the number of markers; the tables have the numbers."
    shown = [
        ("summary", "Mean error of every layout, mm per vertex", summary),
        ("flattening", "Where the curves flatten", flattening(table)),
        ("same-size", "Optimised layouts beside empirical ones of their size", same_size(table)),
        ("recommended", f"{name} beside {PRESENT}", against(table, name, PRESENT)),
    ]
    return render_page(
        "layouts.html.j2",
        title="Which markers, how many, where",
        warnings=[unseen_words(comparison.unseen)] if comparison.unseen else [],
        findings=_findings(table, name, comparison.method),
        figures=[
            {
                "svg": svg_element(curves, "curves", description),
                "caption": "Error against the number of markers on held-out actors (figures 3.5, 3.7 and 3.8 of the "
                "thesis).",
            },
            *_painted(comparison),
        ],
        tables=[page_table(frame, key, caption, decimals=3, folded=True) for key, caption, frame in shown],
        plan=plan,
        empirical=EMPIRICAL,
        version=version_of("signface"),
    )


def _painted(comparison: Comparison) -> list[dict[str, str]]:
    """The pictures of the face: errors of some layouts, and clusters."""
    plan, face = comparison.plan, comparison.face
    layouts = {candidate.layout.name: candidate.layout for candidate in comparison.candidates}
    names = [name for name in ("man-15", "sign3d-60", PRESENT, comparison.recommended.name) if name in layouts]
    points = {name: layouts[name].points(face) for name in names}
    figures = []
    for mapping in ("thin-shell", "gp"):
        maps = {name: error_map(face, mean_moment(comparison.cells, name, "glued", mapping)) for name in names}
        title = f"{MAPPINGS[mapping]}, markers as they are really glued"
        description = f"Faces painted with the error of {', '.join(names)}: {title}"
        figures.append(
            {
                "svg": png_element(paint_errors(face, maps, points, title), description),
                "caption": "Where the error lies (figure 3.4 of the thesis).",
            }
        )
    if "k-means" in plan.methods:
        figures.append(
            {
                "svg": png_element(_clusters(comparison), "Faces painted with clusters of k-means, and their markers"),
                "caption": "Clusters of k-means and their markers (figure 3.6).",
            }
        )
    return figures


def _clusters(comparison: Comparison) -> Figure:
    plan, face, material = comparison.plan, comparison.face, comparison.material
    materials = {"one actor": Material(face, material.actors[:1], material.rules)}
    if plan.selection > 1:
        materials[f"{plan.selection} actors"] = material
    count = min(CLUSTERS, max(plan.sizes))
    clusters: dict[str, Any] = {
        f"{count} clusters, {name}": part.clusters(count, seed=plan.seed) for name, part in materials.items()
    }
    return paint_clusters(
        face,
        material.sites.clustered,
        {title: part.members for title, part in clusters.items()},
        {title: face.mesh.vertices[list(part.markers)] for title, part in clusters.items()},
    )


def _findings(table: pd.DataFrame, recommended: str, method: str) -> list[str]:
    """Sentences with the numbers of this comparison."""
    words = []
    flat = flattening(table)
    for (condition, mapping), curves in flat.groupby(["condition", "mapping"], sort=False):
        least = curves.loc[curves["least_mm"].idxmin()]
        spans = ", ".join(f"{row.family} {row.enough}" for row in curves.itertuples(index=False))
        words.append(
            f"{MAPPINGS[str(mapping)]}, {condition} markers: markers from which the error is within 5 % of the curve's "
            f"least: {spans}. Least of all: {least['least_mm']:.2f} mm ({least['family']}, {least['at']} markers)."
        )
    pairs = same_size(table)
    if len(pairs):
        for family, rows in pairs.groupby(pairs["layout"].str.replace(r"-\d+$", "", regex=True), sort=False):
            if family == "recommended":
                continue
            words.append(
                f"{family}: less error than empirical layouts of its size in {np.mean(rows['change'] > 0):.0%} of "
                f"{len(rows)} comparisons (layout, condition, mapping); {rows['change'].mean():+.0%} less on average."
            )
    rivals = against(table, recommended, PRESENT)
    for row in rivals.itertuples(index=False):
        words.append(
            f"{recommended} ({METHODS[method]}) beside {PRESENT}, {MAPPINGS[str(row.mapping)]}, {row.condition}: "
            f"{row.one_mm:.3f} against {row.other_mm:.3f} mm ({row.change:+.0%} less), better in {row.better:.0%} of "
            f"{row.pairs} pairs of actors and draws."
        )
    return words
