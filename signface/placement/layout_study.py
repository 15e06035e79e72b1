"""The layout study, cell by cell: every layout under every condition, each cell kept on disk as soon as it is done.

- `Plan`: what is compared.
- `make_layouts`: the layouts of a plan; those that are optimised see the selection actors only.
- `run_cell`, `Cell`: one layout under one condition.
- `collect`: the tables of a study from its cells.
- `recommend`: the method for the recommended layout, judged on the selection actors alone.

The actors are split: markers are chosen on the motion of some (the selection actors), and errors are taken on the takes
of the others (the held-out actors), which no choice has seen.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd

from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.layout_files import read_layout
from signface.face.model import FaceModel
from signface.files import whole_file
from signface.placement.choosing import METHODS, Material, choose
from signface.placement.empirical import EMPIRICAL, place_layout
from signface.placement.evaluation import Errors, evaluate_layout
from signface.placement.sites import Rules
from signface.synth.actors import Actor

#: Changes when a cell's numbers would: cells of an older study are then computed anew.
VERSION = 1


@dataclass(frozen=True)
class Plan:
    """What a study compares.

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
class Entry:
    """A layout of a study.

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


def make_layouts(plan: Plan, face: FaceModel, actors: list[Actor], rules: Rules) -> list[Entry]:
    """The layouts of a plan: empirical ones, then those optimised on the selection actors.

    K-means is also run on the first actor alone, as in figure 3.7.
    """
    entries = []
    for name in plan.empirical:
        if name in EMPIRICAL:
            entries.append(Entry(place_layout(name, face), "man" if name.startswith("man-") else "star"))
        else:
            entries.append(Entry(read_layout(name, face), "default"))
    several = Material(face, actors[: plan.selection], rules)
    for method in plan.methods:
        entries += [Entry(choose(several, method, size, seed=plan.seed), method) for size in plan.sizes]
    if "k-means" in plan.methods and plan.selection > 1:
        alone = Material(face, actors[:1], rules)
        for size in plan.sizes:
            own = choose(alone, "k-means", size, seed=plan.seed)
            renamed = MarkerLayout(own.labels, own.roles, own.corners, own.barycentric, f"k-means-1-actor-{size}")
            entries.append(Entry(renamed, "k-means, one actor"))
    return entries


def conditions(plan: Plan) -> list[tuple[str, int]]:
    """(condition, draw) of each cell of a layout."""
    return [("clean", 0), *(("glued", draw) for draw in range(plan.draws))]


def cell_key(plan: Plan, entry: Entry, condition: str, draw: int, tested: list[str]) -> str:
    """A name for a cell that changes with all that its numbers depend on."""
    own = {key: value for key, value in asdict(plan).items() if key in ("actors", "seconds", "seed")}
    digest = hashlib.sha256(json.dumps([VERSION, own, condition, draw, tested], sort_keys=True).encode())
    digest.update(entry.layout.corners.tobytes() + entry.layout.barycentric.round(9).tobytes())
    digest.update("".join(entry.layout.roles).encode())
    return digest.hexdigest()[:20]


def run_cell(
    face: FaceModel, entry: Entry, actors: list[Actor], tested: list[str], condition: str, draw: int
) -> list[Errors]:
    """The errors of one cell."""
    return evaluate_layout(face, entry.layout, actors, tested, condition=condition, draw=draw)


def save_cell(errors: list[Errors], path: str | PathLike[str]) -> None:
    """Keep a cell's errors (.npz)."""
    with whole_file(path) as temporary:
        np.savez_compressed(
            temporary,
            mapping=[own.mapping for own in errors],
            train=[own.train for own in errors],
            test=[own.test for own in errors],
            rms_mm=[own.rms_mm for own in errors],
            moment=np.array([own.moment for own in errors]),
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


def recommend(plan: Plan, face: FaceModel, actors: list[Actor], rules: Rules) -> tuple[str, pd.DataFrame]:
    """The method of the recommended layout: the least error when glued, among selection actors.

    Each selection actor is left out in turn: markers are chosen on the others and tested on the takes of the one left
    out. The held-out actors have no part in it. With one selection actor, the first method of the plan is taken.

    Returns
    -------
    (str, table)
        The method, and its rivals' mean errors: method, mapping, rms_mm.
    """
    own = actors[: plan.selection]
    if len(own) < 2:
        return plan.methods[0], pd.DataFrame(columns=["method", "mapping", "rms_mm"])
    rows = []
    for out in own:
        material = Material(face, [actor for actor in own if actor is not out], rules)
        for method in plan.methods:
            layout = choose(material, method, plan.recommended, seed=plan.seed)
            for errors in evaluate_layout(face, layout, own, [out.name], condition="glued"):
                rows.append((method, errors.mapping, errors.rms_mm))
    table = pd.DataFrame(rows, columns=["method", "mapping", "rms_mm"])
    table = table.groupby(["method", "mapping"], sort=False)["rms_mm"].mean().reset_index()
    # Mappings err by different amounts, so that each is taken as a share of its mean; the two Gaussian processes are
    # one kind of mapping, which counts as much as the solve.
    shares = table["rms_mm"] / table.groupby("mapping")["rms_mm"].transform("mean")
    scores = shares.groupby([table["method"], table["mapping"] == "thin-shell"]).mean().groupby("method").mean()
    return str(scores.idxmin()), table
