"""`signface segment`: weights or a recording in, a table of segments out."""

from __future__ import annotations

import argparse
from pathlib import Path

from signface.cli.options import add_signer_arguments, add_solve_arguments, settings_from, signer_from
from signface.errors import SignfaceError
from signface.settings.solve import SolveSettings

EXAMPLE = """  signface segment weights.csv -o segments.csv
  signface segment take.c3d -o segments.csv"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Fill the parser of this command."""
    parser.add_argument("recording", type=Path, metavar="WEIGHTS_OR_TAKE", help="weights (.csv, .parquet) or markers")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="a .csv file")
    add_solve_arguments(parser)
    add_signer_arguments(parser)


def run(arguments: argparse.Namespace) -> None:
    """Cut the recording and write its segments."""
    from signface.segmentation.cutting import segment
    from signface.segmentation.noise import jitter, warn_of_jitter
    from signface.segmentation.segments import write_segments
    from signface.solver.solving import solve
    from signface.takes.reading import open_recording

    if arguments.output.suffix.lower() != ".csv":
        raise SignfaceError("segments are written as .csv", file=arguments.output)
    settings, signer = settings_from(arguments, SolveSettings), signer_from(arguments)
    descriptors = solve(open_recording(arguments.recording, **settings.reading), settings=settings, signer=signer)
    segments = segment(descriptors)
    write_segments(segments, arguments.output)
    stable = int((segments.table["kind"] == "stable").sum())
    found = jitter(descriptors) if descriptors.n_frames >= 3 else None
    said = "" if found is None else f"; {found}"
    cut = f"{stable} stable, {len(segments) - stable} transitions in {descriptors.duration:.1f} s"
    print(f"{arguments.output}: {cut}{said}")
    warn_of_jitter(descriptors, found)
