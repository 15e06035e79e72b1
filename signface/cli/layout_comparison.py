"""`signface layout place|optimise|study`: which markers, how many, where."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from signface.errors import SignfaceError
from signface.progress import progress

if TYPE_CHECKING:
    from signface.face.model import FaceModel
    from signface.placement.evaluation import Errors
    from signface.placement.sites import Rules

EXAMPLE = (
    "  signface layout place signcom-41 -o signcom.csv\n"
    "  signface layout optimise --markers 40 --method greedy -o mine.csv\n"
    "  signface layout study -o layout-study"
)


def add_actions(actions: argparse._SubParsersAction) -> None:
    """Add the three actions to those of `signface layout`."""
    place = actions.add_parser("place", help="an empirical layout, placed on a face by anatomical landmarks")
    place.add_argument("name", metavar="NAME", help="mpeg4-53, face-robot-35, signcom-41, sign3d-60, man-62 ... man-15")
    place.add_argument("--face", default="default", help="a shipped face or a file (default: %(default)s)")
    place.add_argument("-o", "--output", type=Path, default=Path("layout.csv"), help="(default: %(default)s)")

    optimise = actions.add_parser("optimise", help="choose where so many markers tell most")
    optimise.add_argument("--markers", type=int, default=40, metavar="N", help="face markers (default: %(default)s)")
    optimise.add_argument(
        "--method",
        default="greedy",
        help="k-means, greedy, a-optimal, d-optimal or thin-shell (default: %(default)s)",
    )
    optimise.add_argument("--actors", type=int, default=4, metavar="N", help="synthetic actors (default: %(default)s)")
    optimise.add_argument(
        "-o", "--output", type=Path, default=Path("layout.csv"), help="the layout; its sheet comes beside it"
    )

    study = actions.add_parser("study", help="compare layouts: how many markers, where, with a report")
    study.add_argument("-o", "--output", type=Path, default=Path("layout-study"), help="folder (default: %(default)s)")
    study.add_argument("--actors", type=int, default=4, metavar="N", help="synthetic actors (default: %(default)s)")
    study.add_argument(
        "--selection", type=int, default=2, metavar="N", help="of them, choose markers on so many (default: 2)"
    )
    study.add_argument("--sizes", default="15,30,40,60", metavar="N,N,...", help="markers (default: %(default)s)")
    study.add_argument("--methods", default="all", metavar="NAME,...", help="methods of choice (default: all)")
    study.add_argument(
        "--layouts", default="all", metavar="NAME,...", help="empirical or shipped layouts or files (default: all)"
    )
    study.add_argument("--draws", type=int, default=2, metavar="N", help="draws of placement errors (default: 2)")
    study.add_argument("--recommended", type=int, default=40, metavar="N", help="size of the recommended layout")
    study.add_argument("--jobs", type=int, default=0, metavar="N", help="processes (default: one for each core)")
    for command in (optimise, study):
        command.add_argument("--seconds", type=float, default=90.0, help="of each motion of an actor (default: 90)")
        command.add_argument("--seed", type=int, default=0, help="(default: %(default)s)")
        command.add_argument("--asymmetric", action="store_true", help="do not pair markers left and right")
        command.add_argument(
            "--forbid",
            action="append",
            metavar="ZONE|CSV",
            help="where no marker may stand: lids, lips-inner, nostrils, under-jaw, none, or a csv of x,y,z,radius_mm;"
            " may be repeated (default: the four zones)",
        )
        command.add_argument("--apart", type=float, default=8.0, metavar="MM", help="least distance (default: 8)")
        command.add_argument(
            "--keep", type=Path, metavar="LAYOUT.csv", help="markers that stay, at the nearest vertices"
        )


def run_action(arguments: argparse.Namespace) -> None:
    """Do the action that was asked for."""
    {"place": _place, "optimise": _optimise, "study": _compare}[arguments.action](arguments)


def _place(arguments: argparse.Namespace) -> None:
    from signface.face.layout_files import write_layout
    from signface.face.reading import read_face
    from signface.placement.empirical import EMPIRICAL, place_layout

    face = read_face(arguments.face)
    layout = place_layout(arguments.name, face)
    write_layout(layout, arguments.output, face)
    print(f"{arguments.output}: {EMPIRICAL[arguments.name]}")
    print(f"look at it: signface layout show --layout {arguments.output}")


def _rules(arguments: argparse.Namespace, face: FaceModel) -> Rules:
    """The captor's rules from the command line."""
    import numpy as np
    import pandas as pd

    from signface.face.layout_files import read_layout
    from signface.placement.sites import ZONES, Rules

    zones: list[str] = []
    spheres = []
    for word in arguments.forbid or list(ZONES):
        if word.endswith(".csv"):
            try:
                table = pd.read_csv(word)
                rows = table[["x", "y", "z", "radius_mm"]].to_numpy(float)
            except (OSError, KeyError, ValueError) as error:
                raise SignfaceError(
                    "is no table of forbidden places", file=word, hint="its columns are x, y, z, radius_mm"
                ) from error
            spheres += [(row[:3], float(row[3])) for row in rows]
        elif word != "none":
            zones.append(word)
    fixed: tuple[int, ...] = ()
    if arguments.keep is not None:
        points = read_layout(arguments.keep, face).points(face)
        apart = np.linalg.norm(face.mesh.vertices[None] - points[:, None], axis=2)
        fixed = tuple(dict.fromkeys(int(vertex) for vertex in apart.argmin(axis=1)))
    return Rules(not arguments.asymmetric, tuple(zones), tuple(spheres), arguments.apart, fixed)


def _optimise(arguments: argparse.Namespace) -> None:
    from signface.face.layout_files import write_layout
    from signface.face.reading import read_face
    from signface.placement.choosing import METHODS, Material, choose, unseen_bases, unseen_words
    from signface.render.layout_sheet import draw_sheet
    from signface.synth.actors import draw_actors

    face = read_face("default")
    rules = _rules(arguments, face)
    actors = draw_actors(face, arguments.actors, seconds=arguments.seconds, seed=arguments.seed)
    unseen, _ = unseen_bases(face, actors)
    if unseen:
        print(f"warning: {unseen_words(unseen)}", file=sys.stderr)
    layout = choose(Material(face, actors, rules), arguments.method, arguments.markers, seed=arguments.seed)
    sheet = arguments.output.with_name(f"{arguments.output.stem}-sheet.pdf")
    layout = replace(layout, name=arguments.output.stem)
    write_layout(layout, arguments.output, face)
    draw_sheet(face, layout, sheet, note=f"Chosen by: {METHODS[arguments.method]}.")
    print(f"{arguments.output}: {len(layout.face_labels)} face markers, {len(layout.head_labels)} head markers")
    print(f"{sheet}: for the person who glues them")


def _compare(arguments: argparse.Namespace) -> None:
    from signface.face.reading import read_face
    from signface.placement.choosing import METHODS, unseen_words
    from signface.placement.comparison import ComparisonPlan, compare_layouts
    from signface.report.layouts.report import write_report

    face, folder = read_face("default"), Path(arguments.output)
    plan = ComparisonPlan(
        actors=arguments.actors,
        selection=arguments.selection,
        seconds=arguments.seconds,
        sizes=_numbers(arguments.sizes),
        methods=tuple(METHODS) if arguments.methods == "all" else tuple(arguments.methods.split(",")),
        empirical=ComparisonPlan.empirical if arguments.layouts == "all" else tuple(arguments.layouts.split(",")),
        draws=arguments.draws,
        recommended=arguments.recommended,
        seed=arguments.seed,
    )

    def in_sight(cells: Iterable[list[Errors]], left: int, done: int) -> Iterable[list[Errors]]:
        if done:
            print(f"{done} of {done + left} cells were done before", flush=True)
        return progress(cells, "comparing layouts", total=left)

    print(f"choosing markers on {plan.selection} of {plan.actors} actors", flush=True)
    comparison = compare_layouts(
        plan, face, _rules(arguments, face), folder=folder / "cells", jobs=arguments.jobs, progress=in_sight
    )
    if comparison.unseen:
        print(f"warning: {unseen_words(comparison.unseen)}", file=sys.stderr)
    page = write_report(comparison, folder)
    print(f"{page}: report; {comparison.recommended.name}.csv and its sheet beside it")


def _numbers(word: str) -> tuple[int, ...]:
    try:
        return tuple(int(part) for part in word.split(","))
    except ValueError:
        raise SignfaceError(f"{word!r} is no list of numbers", hint="write --sizes 15,30,40") from None
