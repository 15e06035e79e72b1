"""Layouts compared, cell by cell: every layout under every condition, each cell kept on disk as soon as it is done.

- `ComparisonPlan`: what is compared.
- `compare_layouts`: all of it, as a `Comparison`.
- `make_layouts`: the layouts of a plan; those that are optimised see the selection actors only.
- `run_cells`, `Cell`: one layout under one condition.
- `collect`, `summarise`: the tables of a comparison from its cells.
- `recommend`: the method for the recommended layout, judged on the selection actors alone.

The actors are split: markers are chosen on the motion of some (the selection actors), and errors are taken on the takes
of the others (the held-out actors), which no choice has seen.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field, replace
from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd

from signface.content import Content
from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.layout_files import read_layout
from signface.face.model import FaceModel
from signface.files import whole_file
from signface.placement.choosing import METHODS, Material, choose, unseen_bases
from signface.placement.empirical import EMPIRICAL, place_layout
from signface.placement.evaluation import Errors, evaluate_layout
from signface.placement.sites import Rules
from signface.synth.actors import Actor, draw_actors

#: Goes through the cells that are left; is given their number, and how many were done before.
Progress = Callable[[Iterable[list[Errors]], int, int], Iterable[list[Errors]]]

#: Changes when a cell's numbers would: cells on disk are then computed anew.
VERSION = 2


@dataclass(frozen=True)
class ComparisonPlan:
    """What is compared.

    Parameters
    ----------
    actors : int
        How many actors, of whom the first `selection` are selection actors and the others are held out.
    selection : int
    seconds : float
        Length of the range of motion and of the takes, each, per actor.
    sizes : tuple of int
        Numbers of markers of the optimised layouts.
    methods : tuple of str
        Some of `METHODS`.
    empirical : tuple of str
        Some of `EMPIRICAL`, shipped layouts, or files.
    draws : int
        Draws of the placement errors.
    recommended : int
        Size of the recommended layout.
    seed : int
    """

    actors: int = 4
    selection: int = 2
    seconds: float = 90.0
    sizes: tuple[int, ...] = (15, 22, 30, 40, 50, 60)
    methods: tuple[str, ...] = tuple(METHODS)
    empirical: tuple[str, ...] = (*EMPIRICAL, "default-40")
    draws: int = 2
    recommended: int = 40
    seed: int = 0

    def __post_init__(self) -> None:
        if not 1 <= self.selection < self.actors <= 26:
            raise SignfaceError(
                f"{self.selection} of {self.actors} actors for selection leave no one to test on",
                hint="choose on at least one actor, test on at least one other; at most 26 in all",
            )
        if self.seconds < 5:
            raise SignfaceError(f"{self.seconds:g} seconds of motion are too few", hint="give 5 or more")


@dataclass(frozen=True)
class Candidate:
    """A layout that is compared.

    Parameters
    ----------
    layout : MarkerLayout
    family : str
        `man`, `star`, `default`, `recommended`, or a method.
    """

    layout: MarkerLayout
    family: str


@dataclass(frozen=True)
class Cell:
    """One layout under one condition.

    Parameters
    ----------
    layout : str
    family : str
    markers : int
    condition : str
    draw : int
    errors : tuple of Errors
    """

    layout: str
    family: str
    markers: int
    condition: str
    draw: int
    errors: tuple[Errors, ...] = field(repr=False)


@dataclass(frozen=True, eq=False)
class Comparison(Content):
    """What a comparison found.

    Parameters
    ----------
    plan : ComparisonPlan
    face : FaceModel
    material : Material
        What layouts were chosen from: the selection actors.
    candidates : list of Candidate
        The recommended layout is the last.
    cells : list of Cell
    rivals : DataFrame
        Of `recommend`.
    method : str
        Of the recommended layout.
    unseen : tuple of str
        Bases that the selection actors never show: no layout is chosen for them.
    """

    plan: ComparisonPlan
    face: FaceModel
    material: Material
    candidates: list[Candidate]
    cells: list[Cell]
    rivals: pd.DataFrame
    method: str
    unseen: tuple[str, ...] = ()

    @property
    def recommended(self) -> MarkerLayout:
        """The recommended layout."""
        return self.candidates[-1].layout

    @property
    def table(self) -> pd.DataFrame:
        """See `collect`."""
        return collect(self.cells, int(self.face.moving.sum()))


def compare_layouts(
    plan: ComparisonPlan,
    face: FaceModel,
    rules: Rules | None = None,
    *,
    folder: str | PathLike[str],
    jobs: int = 0,
    progress: Progress | None = None,
) -> Comparison:
    """Choose layouts on some synthetic actors, and measure them and the empirical ones on the others.

    Parameters
    ----------
    plan : ComparisonPlan
    face : FaceModel
    rules : Rules, optional
        What the captor allows.
    folder : path
        Where cells are kept; those that it holds are not done again.
    jobs : int
        Processes; 0 for one for each core.
    progress : Progress, optional

    Raises
    ------
    SignfaceError
        A layout or a method is unknown, markers do not fit, or the folder cannot be written.

    See Also
    --------
    signface.report.layouts.report.write_report : writes what was found.
    """
    rules = rules or Rules()
    actors = draw_actors(face, plan.actors, seconds=plan.seconds, seed=plan.seed)
    material = Material(face, actors[: plan.selection], rules)
    unseen, _ = unseen_bases(face, material.actors)
    candidates = make_layouts(plan, face, actors, rules)
    method, rivals = recommend(plan, face, actors, rules)
    layout = choose(material, method, plan.recommended, seed=plan.seed)
    candidates.append(Candidate(replace(layout, name=f"recommended-{plan.recommended}"), "recommended"))
    cells = run_cells(plan, face, actors, candidates, folder=folder, jobs=jobs, progress=progress)
    return Comparison(plan, face, material, candidates, cells, rivals, method, tuple(unseen))


def make_layouts(plan: ComparisonPlan, face: FaceModel, actors: list[Actor], rules: Rules) -> list[Candidate]:
    """The layouts of a plan: empirical ones, then those optimised on the selection actors.

    K-means is also run on the first actor alone, as in figure 3.7.
    """
    candidates = []
    for name in plan.empirical:
        if name in EMPIRICAL:
            candidates.append(Candidate(place_layout(name, face), "man" if name.startswith("man-") else "star"))
        else:
            candidates.append(Candidate(read_layout(name, face), "default"))
    several = Material(face, actors[: plan.selection], rules)
    for method in plan.methods:
        candidates += [Candidate(choose(several, method, size, seed=plan.seed), method) for size in plan.sizes]
    if "k-means" in plan.methods and plan.selection > 1:
        alone = Material(face, actors[:1], rules)
        for size in plan.sizes:
            layout = choose(alone, "k-means", size, seed=plan.seed)
            candidates.append(Candidate(replace(layout, name=f"k-means-1-actor-{size}"), "k-means, one actor"))
    return candidates


def conditions(plan: ComparisonPlan) -> list[tuple[str, int]]:
    """(condition, draw) of each cell of a layout."""
    return [("clean", 0), *(("glued", draw) for draw in range(plan.draws))]


def cell_key(plan: ComparisonPlan, candidate: Candidate, condition: str, draw: int, tested: list[str]) -> str:
    """A name for a cell that changes with all that its numbers depend on."""
    people = {key: value for key, value in asdict(plan).items() if key in ("actors", "seconds", "seed")}
    digest = hashlib.sha256(json.dumps([VERSION, people, condition, draw, tested], sort_keys=True).encode())
    digest.update(candidate.layout.corners.tobytes() + candidate.layout.barycentric.round(9).tobytes())
    digest.update("".join(candidate.layout.roles).encode())
    return digest.hexdigest()[:20]


def run_cells(
    plan: ComparisonPlan,
    face: FaceModel,
    actors: list[Actor],
    candidates: list[Candidate],
    *,
    folder: str | PathLike[str],
    jobs: int = 0,
    progress: Progress | None = None,
) -> list[Cell]:
    """Every cell of a comparison; those done before are read back. Parameters as for `compare_layouts`."""
    from joblib import Parallel, delayed

    tested = [actor.name for actor in actors[plan.selection :]]
    work = [(candidate, condition, draw) for candidate in candidates for condition, draw in conditions(plan)]
    files = [Path(folder) / f"{cell_key(plan, *cell, tested)}.npz" for cell in work]
    known = {file: load_cell(file) for file in files}
    left = {file: cell for file, cell in zip(files, work) if known[file] is None}
    runs = Parallel(n_jobs=min(jobs or os.cpu_count() or 1, max(1, len(left))), return_as="generator")(
        delayed(evaluate_layout)(face, candidate.layout, actors, tested, condition=condition, draw=draw)
        for candidate, condition, draw in left.values()
    )
    results = runs if progress is None else progress(runs, len(left), len(known) - len(left))
    for file, errors in zip(left, results):
        save_cell(errors, file)
        known[file] = errors
    return [
        Cell(
            candidate.layout.name,
            candidate.family,
            len(candidate.layout.face_labels),
            condition,
            draw,
            tuple(known[file] or ()),
        )
        for (candidate, condition, draw), file in zip(work, files)
    ]


def save_cell(errors: list[Errors], path: str | PathLike[str]) -> None:
    """Keep a cell's errors (.npz)."""
    with whole_file(path) as temporary:
        np.savez_compressed(
            temporary,
            mapping=[pair.mapping for pair in errors],
            train=[pair.train for pair in errors],
            test=[pair.test for pair in errors],
            rms_mm=[pair.rms_mm for pair in errors],
            moment=np.array([pair.moment for pair in errors]),
        )


def load_cell(path: str | PathLike[str]) -> list[Errors] | None:
    """A cell's errors, or None when it has not been done or cannot be read."""
    if not Path(path).is_file():
        return None
    try:
        with np.load(path, allow_pickle=False) as content:
            columns = [content[name] for name in ("mapping", "train", "test", "rms_mm", "moment")]
    except Exception:  # a damaged archive brings errors of several kinds; the cell is simply done again
        return None
    return [Errors(str(a), str(b), str(c), float(d), e) for a, b, c, d, e in zip(*columns)]


def collect(cells: list[Cell], moving: int) -> pd.DataFrame:
    """One row for each layout, condition, draw, mapping and pair of actors.

    Columns: layout, family, markers, condition, draw, mapping, train, test, rms_mm (per vertex), rmse_mm (eq. 3.5: the
    vertices' squared errors summed, not averaged).
    """
    rows = [
        (c.layout, c.family, c.markers, c.condition, c.draw, e.mapping, e.train, e.test, e.rms_mm,
         e.rms_mm * np.sqrt(moving))
        for c in cells
        for e in c.errors
    ]  # fmt: skip
    names = ["layout", "family", "markers", "condition", "draw", "mapping", "train", "test", "rms_mm", "rmse_mm"]
    return pd.DataFrame(rows, columns=names)


def summarise(table: pd.DataFrame) -> pd.DataFrame:
    """Mean error of each layout by condition and mapping, with its spread over draws and pairs of actors."""
    grouped = table.groupby(["family", "layout", "markers", "condition", "mapping"], sort=False)
    summary = grouped["rms_mm"].agg(["mean", "std"]).reset_index()
    return summary.rename(columns={"mean": "rms_mm", "std": "spread_mm"})


def recommend(plan: ComparisonPlan, face: FaceModel, actors: list[Actor], rules: Rules) -> tuple[str, pd.DataFrame]:
    """The method of the recommended layout: the least error when glued, among selection actors.

    Each selection actor is left out in turn: markers are chosen on the others and tested on the takes of the one left
    out. The held-out actors have no part in it. With one selection actor, the first method of the plan is taken.

    Returns
    -------
    (str, table)
        The method, and its rivals' mean errors: method, mapping, rms_mm.
    """
    chosen_on = actors[: plan.selection]
    if len(chosen_on) < 2:
        return plan.methods[0], pd.DataFrame(columns=["method", "mapping", "rms_mm"])
    rows = []
    for out in chosen_on:
        material = Material(face, [actor for actor in chosen_on if actor is not out], rules)
        for method in plan.methods:
            layout = choose(material, method, plan.recommended, seed=plan.seed)
            for errors in evaluate_layout(face, layout, chosen_on, [out.name], condition="glued"):
                rows.append((method, errors.mapping, errors.rms_mm))
    table = pd.DataFrame(rows, columns=["method", "mapping", "rms_mm"])
    table = table.groupby(["method", "mapping"], sort=False)["rms_mm"].mean().reset_index()
    # Mappings err by different amounts, so that each is taken as a share of its mean; the two Gaussian processes are
    # one kind of mapping, which counts as much as the solve.
    shares = table["rms_mm"] / table.groupby("mapping")["rms_mm"].transform("mean")
    scores = shares.groupby([table["method"], table["mapping"] == "thin-shell"]).mean().groupby("method").mean()
    return str(scores.idxmin()), table
