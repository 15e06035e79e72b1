"""`signface segment`: weights or a recording in, a table of segments out."""

from __future__ import annotations

import argparse
from pathlib import Path

from signface.cli.options import add_solve_arguments, read_face_and_layout, solve_options
from signface.errors import SignfaceError

EXAMPLE = """  signface segment weights.csv -o segments.csv
  signface segment take.c3d -o segments.csv"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Fill the parser of this command."""
    parser.add_argument("recording", type=Path, metavar="WEIGHTS_OR_TAKE", help="weights (.csv, .parquet) or markers")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="a .csv file")
    add_solve_arguments(parser)


def run(arguments: argparse.Namespace) -> None:
    """Cut the recording and write its segments."""
    from signface.annotation import describe
    from signface.descriptors import Descriptors
    from signface.segmentation.cutting import segment
    from signface.segmentation.segments import write_segments
    from signface.takes.reading import open_recording

    if arguments.output.suffix.lower() != ".csv":
        raise SignfaceError("segments are written as .csv", file=arguments.output)
    descriptors = open_recording(arguments.recording)
    if not isinstance(descriptors, Descriptors):
        face, layout = read_face_and_layout(arguments)
        descriptors = describe(
            descriptors,
            face=face,
            layout=layout,
            **solve_options(arguments),
        )
    segments = segment(descriptors)
    write_segments(segments, arguments.output)
    stable = int((segments.table["kind"] == "stable").sum())
    print(f"{arguments.output}: {stable} stable, {len(segments) - stable} transitions in {descriptors.duration:.1f} s")
