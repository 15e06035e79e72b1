"""The report of a perceptual study: one HTML file that needs nothing else, with tables as CSV and LaTeX beside it.

- `write_report`: the whole folder.
- `report_html`: the page alone.
"""

from __future__ import annotations

import base64
import math
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

from signface.errors import SignfaceError
from signface.files import whole_file, write_text
from signface.label.vocabulary import AFFECT
from signface.report.pages import render_page
from signface.report.study.figures import confusion_figure, differences_figure, expressions_figure, means_figure
from signface.study.statistics.analysis import Analysis, Section
from signface.study.statistics.tables import StudyTable, as_latex

#: Pictures of a folder of screenshots that are shown, by ending.
PICTURES = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".webp": "image/webp"}

#: A page with more than this in pictures is too heavy to send.
LARGEST_PICTURES = 20_000_000

#: Tables that are long and folded away in the page.
FOLDED = {"pairwise_matrix", "influence_details", "habit", "means_by_vision_problem", "means_by_gender"}

#: Text longer than this is broken into lines in a table's cell.
LONG = 32

#: Short names of the sections for the navigation.
SHORT = {
    "methods": "Methods",
    "models": "Participants as random effects",
    "interactions": "Interactions",
    "expressions": "Expressions",
    "participants": "Participants",
}

CAPTIONS = {
    "means_by_method": "Means by method. Bars: 95 % bootstrap intervals over participants. The vertical axes are cut "
    "to show differences; compare the numbers, not the heights. The bars hold what differs between participants; two "
    "methods may differ although their bars overlap, since the same participants saw both.",
    "differences": "Differences between methods, with 95 % bootstrap intervals over participants. Filled: shown by the "
    "mixed model with Holm's correction, for the question and for its pairs.",
    "confusion": "Confusion matrices: of all answers to films of an expression, the per cent that named "
    "each expression.",
    "means_by_expression": "Means by played expression and method.",
}


def write_report(
    analysis: Analysis,
    folder: str | PathLike[str],
    *,
    title: str | None = None,
    screenshots: str | PathLike[str] | None = None,
) -> Path:
    """Write `report.html`, `tables/*.csv`, `tables/*.tex` and `figures/*.svg`.

    Parameters
    ----------
    analysis : Analysis
    folder : path
        Created when missing.
    title : str, optional
        Of the page.
    screenshots : path, optional
        A folder of pictures of the questionnaire, shown in the order of their names.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    SignfaceError
        The folder cannot be written, or the pictures are missing or too large.
    """
    folder = Path(folder)
    figures = _figures(analysis)
    page = report_html(analysis, title=title, screenshots=screenshots, figures=figures)
    taken: set[str] = set()
    for table in analysis.tables:
        frame = table.frame.copy()
        frame.columns = [
            " ".join(part for part in column if part) if isinstance(column, tuple) else column
            for column in frame.columns
        ]
        if analysis.responses.simulated:
            frame["simulated"] = "yes"
            table = replace(table, title=f"SIMULATED ANSWERS. {table.title}")
        name = _file_name(table.key, taken)
        with whole_file(folder / "tables" / f"{name}.csv") as path:
            frame.to_csv(path, index=False)
        write_text(folder / "tables" / f"{name}.tex", as_latex(table))
    for drawn in (figure for section in figures.values() for figure in section):
        write_text(folder / "figures" / f"{drawn['name']}.svg", drawn["svg"])
    write_text(folder / "report.html", page)
    return folder / "report.html"


def _file_name(key: str, taken: set[str]) -> str:
    """A table's key as a file's name that no other table has; methods are named by users."""
    plain = "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in key)[:80]
    name, number = plain, 1
    while name.lower() in taken:
        number += 1
        name = f"{plain}_{number}"
    taken.add(name.lower())
    return name


def report_html(
    analysis: Analysis,
    *,
    title: str | None = None,
    screenshots: str | PathLike[str] | None = None,
    figures: dict[str, list[dict[str, str]]] | None = None,
) -> str:
    """The page: one file, no script, no request to anyone.

    Parameters
    ----------
    analysis : Analysis
    title, screenshots
        As for `write_report`.
    figures : dict, optional
        Section to its figures; drawn when not given.
    """
    import numpy
    import scipy

    from signface.extras import version_of

    responses = analysis.responses
    drawn = _figures(analysis) if figures is None else figures
    return render_page(
        "study.html.j2",
        title=title or "Perceptual study",
        simulated=responses.simulated,
        source=Path(responses.name).name,
        facts=_facts(analysis),
        warnings=[warning for warning in responses.warnings if "SIMULATED ANSWERS" not in warning],
        findings=analysis.findings,
        sections=[_section(section, drawn.get(section.key, []), analysis) for section in analysis.sections],
        screenshots=_pictures(screenshots),
        alpha=f"{analysis.alpha:g}",
        resamples=analysis.resamples,
        seed=analysis.seed,
        version=version_of("signface"),
        numpy=numpy.__version__,
        scipy=scipy.__version__,
        statsmodels=version_of("statsmodels"),
    )


def _facts(analysis: Analysis) -> list[tuple[str, str, str]]:
    responses = analysis.responses
    table, people = responses.table, responses.people()
    facts = [
        ("participants", f"{len(responses.participants)}", "simulated" if responses.simulated else ""),
        ("answers", f"{len(table)}", f"{len(table) / len(people):.3g} each"),
        ("methods", f"{len(responses.methods)}", ", ".join(responses.methods)),
        ("expressions", f"{len(responses.expressions)}", ", ".join(map(_spelt, responses.expressions))),
    ]
    if people["age"].notna().any():
        age = people["age"].dropna()
        facts.append(("age", f"{age.min():g} to {age.max():g}", f"mean {age.mean():.1f}, median {age.median():g}"))
    if people["gender"].notna().any():
        counts = people["gender"].value_counts().sort_index()
        facts.append(("gender", " · ".join(f"{count} {name}" for name, count in counts.items()), ""))
    return facts


def _spelt(label: str) -> str:
    """An expression's label with what it stands for, where it is one of signface's own."""
    return f"{label} {AFFECT.describe(label)}" if label in AFFECT.values else label


def _section(section: Section, figures: list[dict[str, str]], analysis: Analysis) -> dict[str, Any]:
    return {
        "key": section.key,
        "title": section.title,
        "short": SHORT.get(section.key, section.title),
        "intro": section.intro,
        "figures": figures,
        "tables": [_table(table, analysis.alpha) for table in section.tables],
    }


def _table(table: StudyTable, alpha: float) -> dict[str, Any]:
    _, below = table.header()
    kinds = [table.kind(column) for column in table.frame.columns]
    rows = [
        {"cells": [(text, _class(value, kind, alpha)) for text, value, kind in zip(texts, row, kinds)], "strong": False}
        for texts, row in zip(table.cells(), table.frame.itertuples(index=False))
    ]
    reference = table.reference
    if reference and not reference.startswith("figure"):
        reference = ("tables " if "," in reference else "table ") + reference
    return {
        "key": table.key,
        "caption": table.title,
        "reference": f"form of {reference} of the thesis" if reference else "",
        "groups": table.groups(),
        "columns": [
            (name, ("text" if kind == "text" else "") + (" broken" if len(name) > 14 else ""))
            for name, kind in zip(below, kinds)
        ],
        "rows": rows,
        "notes": table.notes,
        "folded": table.key in FOLDED or table.key.startswith("confusion_"),
    }


def _class(value: object, kind: str, alpha: float) -> str:
    if kind == "p" and isinstance(value, float) and not math.isnan(value) and value < alpha:
        return "low"
    return "" if kind != "text" else "text long" if isinstance(value, str) and len(value) > LONG else "text"


def _figures(analysis: Analysis) -> dict[str, list[dict[str, str]]]:
    """Section to its figures, each with the name of its file and its caption; what a study does not allow is absent."""
    responses, contrasts, models = analysis.responses, analysis.table("contrasts"), analysis.table("models")
    means = means_figure(responses, resamples=analysis.resamples, seed=analysis.seed)
    differences = ""
    if contrasts is not None and models is not None:
        differences = differences_figure(responses, contrasts, models, alpha=analysis.alpha)
    figures: dict[str, list[dict[str, str]]] = {"methods": [], "models": [], "expressions": []}
    for section, name, svg in (
        ("methods", "means_by_method", means),
        ("models", "differences", differences),
        ("expressions", "confusion", confusion_figure(responses)),
        ("expressions", "means_by_expression", expressions_figure(responses)),
    ):
        if svg:
            figures[section].append({"name": name, "svg": svg, "caption": CAPTIONS[name]})
    return figures


def _pictures(folder: str | PathLike[str] | None) -> list[tuple[str, str]]:
    """Name and data URI of each picture of a folder."""
    if folder is None:
        return []
    if not Path(folder).is_dir():
        raise SignfaceError("no such folder", file=folder, hint="name the folder of the questionnaire's screenshots")
    files = sorted(file for file in Path(folder).iterdir() if file.suffix.lower() in PICTURES and file.is_file())
    if not files:
        raise SignfaceError("holds no picture", file=folder, hint=f"put {', '.join(PICTURES)} files there")
    total = sum(file.stat().st_size for file in files)
    if total > LARGEST_PICTURES:
        raise SignfaceError(
            f"holds {total / 1e6:.0f} MB of pictures", file=folder, hint=f"stay below {LARGEST_PICTURES / 1e6:.0f} MB"
        )
    return [
        (
            file.stem.replace("_", " ").replace("-", " "),
            f"data:{PICTURES[file.suffix.lower()]};base64,{base64.b64encode(file.read_bytes()).decode()}",
        )
        for file in files
    ]
