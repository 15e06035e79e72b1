"""`signface calibrate`: a signer's own bases, from a take in which named bases are shown."""

from __future__ import annotations

import argparse
from pathlib import Path

from signface.cli.options import add_solve_arguments, settings_from
from signface.errors import SignfaceError
from signface.settings.solve import SolveSettings

EXAMPLE = """  signface calibrate range-of-motion.c3d shown.csv -o signer.csv
  signface solve take.c3d --signer-bases signer.csv -o weights.csv

shown.csv says what is shown when, from rest to rest, nothing of how strongly:
  start_s,end_s,bases
  2.0,3.1,browInnerUp
  3.1,4.3,browDown*
  4.3,5.2,jawOpen"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Fill the parser of this command."""
    parser.add_argument("take", type=Path, metavar="TAKE", help="a recording in which the signer shows named bases")
    parser.add_argument(
        "shown", type=Path, metavar="SHOWN", help="a .csv: start_s, end_s, bases (joined by +, * for Left and Right)"
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="FILE",
        help="the signer's bases, for --signer-file (.csv, .json)",
    )
    parser.add_argument("--signer", default="", metavar="NAME", help="who it is; kept in a .json")
    parser.add_argument(
        "--force", action="store_true", help="keep the bases learnt, even if held-out frames are explained no better"
    )
    add_solve_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Learn the signer's bases and say which, and how far they are from the avatar's."""
    from signface.descriptors import Descriptors
    from signface.solver.range_of_motion import away_from_avatar, calibrate_guarded
    from signface.solver.solving import face_and_layout
    from signface.takes.reading import open_recording
    from signface.takes.selecting import selected

    if arguments.output.suffix.lower() not in (".csv", ".json"):
        raise SignfaceError("a signer's bases are written as .csv, a signer as .json", file=arguments.output)
    settings = settings_from(arguments, SolveSettings)
    recording = selected(open_recording(arguments.take, **settings.reading), settings)
    if isinstance(recording, Descriptors):
        raise SignfaceError("holds weights, not markers", file=arguments.take)
    face, layout = face_and_layout(recording.labels, settings)
    found = calibrate_guarded(
        recording,
        arguments.shown,
        face,
        layout,
        name=arguments.signer,
        settings=settings,
        force=arguments.force,
    )
    signer = found.signer
    signer.save(arguments.output)
    assert signer.bases is not None
    learnt, apart = set(signer.bases.bases), away_from_avatar(signer.bases, face, layout)
    print(f"{arguments.output}: {len(learnt)} of {face.n_bases} bases, {apart:.0%} away from the avatar's")
    says = (
        f"held-out frames are explained to {found.own_mm:.2f} mm, with the avatar's bases to {found.avatar_mm:.2f} mm"
    )
    if found.better:
        print(f"{says}: better calibrated")
    elif arguments.force:
        print(f"{says}: not clearly better, kept because of --force")
    else:
        print(f"{says}: not clearly better, so the avatar's bases are kept (--force keeps the others)")
    return 0
