"""`signface solve`: recordings to blendshape weights."""

from __future__ import annotations

import argparse
import contextlib
import sys
from dataclasses import replace
from pathlib import Path

from signface.cli.options import (
    add_signer_arguments,
    add_solve_arguments,
    output_files,
    read_face_and_layout,
    settings_from,
    signer_from,
)
from signface.cli.threads import one_thread_for_matrices
from signface.errors import SignfaceError
from signface.progress import progress
from signface.settings.solve import SolveSettings

EXAMPLE = """  signface solve take.c3d -o weights.csv
  signface solve recordings/*.c3d -o weights/ --format parquet"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Fill the parser of this command."""
    parser.add_argument("takes", nargs="+", type=Path, metavar="TAKE", help="recordings")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FILE", help=".csv or .parquet; a folder for several takes"
    )
    parser.add_argument(
        "--format", choices=("csv", "parquet"), default="csv", help="ending in a folder (default: %(default)s)"
    )
    parser.add_argument(
        "--uncertainty",
        action="store_true",
        help="also write the weights' standard deviations, beside the weights: NAME.sd.csv or NAME.sd.parquet",
    )
    add_solve_arguments(parser)
    add_signer_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Solve every take; those that cannot be are named, and the others still are."""
    one_thread_for_matrices()
    import numpy as np

    from signface.columns import joined_sides
    from signface.descriptors_files import WeightsWriter
    from signface.solver.solving import solve_pieces
    from signface.takes.reading import open_recording
    from signface.trust import residual_words

    ending = arguments.output.suffix.lower()
    suffix = ending if ending in (".csv", ".parquet") else f".{arguments.format}"
    if ending and ending not in (".csv", ".parquet") and not arguments.output.is_dir() and len(arguments.takes) == 1:
        raise SignfaceError("the ending of a weights file is .csv or .parquet", file=arguments.output)
    files = output_files(arguments.takes, arguments.output, suffix)
    settings, signer = settings_from(arguments, SolveSettings), signer_from(arguments)
    face, layout = read_face_and_layout(settings)
    failed = 0
    for take, file in progress(list(zip(arguments.takes, files, strict=True)), "solving"):
        try:
            residuals: list[np.ndarray] = []
            with contextlib.ExitStack() as open_files:
                writer = open_files.enter_context(WeightsWriter(file))
                doubts = (
                    open_files.enter_context(WeightsWriter(file.with_suffix(f".sd{file.suffix}")))
                    if arguments.uncertainty
                    else None
                )
                for piece in solve_pieces(
                    open_recording(take, **settings.reading),
                    face,
                    layout,
                    settings=settings,
                    signer=signer,
                    uncertainty=arguments.uncertainty,
                    progress=progress,
                ):
                    writer.append(piece)
                    if doubts is not None:
                        if piece.deviation is None:
                            raise SignfaceError("holds weights already: how sure they are is not known", file=take)
                        doubts.append(replace(piece, weights=piece.deviation, deviation=None))
                    assert piece.residual is not None
                    residuals.append(piece.residual)
        except SignfaceError as error:
            if len(files) == 1:
                raise
            failed += 1
            print(f"signface: {error}", file=sys.stderr)
            continue
        for note in piece.history:
            if note.startswith("warning: "):
                print(f"signface: {file}: {note}", file=sys.stderr)
        residual = np.concatenate(residuals)
        start = piece.start - (len(residual) - piece.n_frames) / piece.rate
        fit = residual_words(residual, piece.rate, start)
        wrong = f"; {piece.wrong_markers}" if piece.wrong_markers else ""
        blind = f"; no marker shows {joined_sides(piece.unobserved)}" if piece.unobserved else ""
        print(f"{file}: {writer.frames} frames, {len(piece.names)} bases, {fit}{wrong}{blind}")
    return 2 if failed else 0
