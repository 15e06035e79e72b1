"""`signface layout`: show a layout on a face, check it, or suggest one for an unknown take."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from signface.cli import layout_comparison
from signface.errors import SignfaceError

EXAMPLE = (
    "  signface layout show --layout default-40 -o layout.png\n"
    "  signface layout check --layout mine.csv\n"
    "  signface layout suggest take.c3d -o layout.csv --neutral 2.5\n" + layout_comparison.EXAMPLE
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `signface layout`."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    show = actions.add_parser("show", help="draw the markers on the face, from the front and both sides")
    check = actions.add_parser("check", help="read a layout and say which bases its markers cannot tell")
    for own in (show, check):
        own.add_argument("--layout", default="default-40", help="a shipped layout or a .csv (default: %(default)s)")
    suggest = actions.add_parser("suggest", help="propose where the markers of a take stand, from its neutral frame")
    suggest.add_argument("take", type=Path, metavar="TAKE", help="a recording of markers")
    suggest.add_argument("--unit", help="unit of length of the take, where it says none or a wrong one")
    suggest.add_argument(
        "--neutral", type=float, metavar="SECONDS", help="time of a neutral frame (default: it is found)"
    )
    for own in (show, check, suggest):
        own.add_argument("--face", default="default", help="a shipped face or a file (default: %(default)s)")
    show.add_argument(
        "-o", "--output", type=Path, default=Path("layout.png"), help="the picture (default: %(default)s)"
    )
    suggest.add_argument(
        "-o", "--output", type=Path, default=Path("layout.csv"), help="the layout (default: %(default)s)"
    )
    layout_comparison.add_actions(actions)


def run(arguments: argparse.Namespace) -> int:
    """Do what was asked; 0 when done."""
    own = {"show": _show, "check": _check, "suggest": _suggest}
    own.get(arguments.action, layout_comparison.run_action)(arguments)
    return 0


def _show(arguments: argparse.Namespace) -> None:
    from signface.face.layout_files import read_layout
    from signface.face.reading import read_face
    from signface.render.layout_picture import draw_layout

    if arguments.output.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise SignfaceError("a picture ends in .png, .svg or .pdf", file=arguments.output)
    face = read_face(arguments.face)
    draw_layout(face, read_layout(arguments.layout, face), arguments.output)
    print(arguments.output)


def _check(arguments: argparse.Namespace) -> None:
    from signface.columns import joined_sides
    from signface.face.checking import check_face
    from signface.face.layout_files import read_layout
    from signface.face.reading import read_face
    from signface.solver.observability import unobserved_bases
    from signface.solver.thin_shell import ThinShellSolver

    face = read_face(arguments.face)
    layout = read_layout(arguments.layout, face)
    report = check_face(face, layout)
    print(f"{layout.name}: {len(layout.face_labels)} face markers, {len(layout.head_labels)} head markers")
    try:
        blind = joined_sides(unobserved_bases(ThinShellSolver(face, layout))) or "none"
    except SignfaceError as error:
        blind = f"not known, for it cannot be solved with: {error.problem}"
    print(f"bases that the markers cannot see: {blind}")
    for first, second, cosine in report.alike:
        print(f"nearly the same at the markers: {first} and {second} (cosine {cosine:.3f})")
    if len(layout.head_labels) < 3:
        print("fewer than 3 head markers: solve with --head-fallback least-moving")


def _suggest(arguments: argparse.Namespace) -> None:
    from signface.face.layout_files import write_layout
    from signface.face.reading import read_face
    from signface.face.suggestion import suggest_layout
    from signface.takes.neutral import find_neutral
    from signface.takes.reading import read_take
    from signface.takes.rigid_markers import with_head_markers

    face = read_face(arguments.face)
    take = read_take(arguments.take, unit=arguments.unit)
    seconds = find_neutral(take) if arguments.neutral is None else arguments.neutral
    found = suggest_layout(take.labels, take.positions[take.frame_at(seconds)], face)
    layout = with_head_markers(found.layout, take, seconds, face)
    write_layout(layout, arguments.output, face)
    print(f"{arguments.output}: {len(layout.face_labels)} face markers, {len(layout.head_labels)} head markers")
    if len(layout.head_labels) < 3:
        print("fewer than 3 head markers: mark some in the column role, or solve with --head-fallback least-moving")
    elif layout != found.layout:
        print(f"the head is carried by what moves least and stands apart: {', '.join(layout.head_labels)}")
    print(
        f"neutral frame at {seconds:.3f} s; the face is {found.scale:.2f} times the signer's; "
        f"markers lay {np.median(found.distance):.1f} mm from it (median)"
    )
    print(f"look at it before you use it: signface layout show --layout {arguments.output}")
