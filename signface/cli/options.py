"""Arguments that several commands share, and what they stand for."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from signface.errors import SignfaceError

if TYPE_CHECKING:
    from signface.elan.options import EafOptions
    from signface.face.layout import MarkerLayout
    from signface.face.model import FaceModel


def add_face_arguments(parser: argparse.ArgumentParser) -> None:
    """Add `--face` and `--layout`."""
    parser.add_argument(
        "--face",
        default="default",
        metavar="FACE",
        help="a shipped face or a file (.glb, .wfm) or folder of .obj (default: %(default)s)",
    )
    parser.add_argument(
        "--layout",
        metavar="LAYOUT",
        help="a shipped layout or a .csv (default: the shipped layout that fits the markers best)",
    )


def add_neutral_argument(parser: argparse.ArgumentParser) -> None:
    """Add `--neutral`."""
    parser.add_argument(
        "--neutral",
        default="auto",
        type=neutral_time,
        metavar="SECONDS",
        help="time of a frame with a neutral face, or auto (default: %(default)s)",
    )


def add_solve_arguments(parser: argparse.ArgumentParser) -> None:
    """Add `--face`, `--layout`, `--neutral`, and how markers become weights; see `solve_options`."""
    add_face_arguments(parser)
    add_neutral_argument(parser)
    parser.add_argument("--method", default="thin-shell", help="how weights are solved (default: %(default)s)")
    parser.add_argument(
        "--alpha", type=float, metavar="A", help="weight of the thin shell, 0 to 1 (default: the method's own)"
    )
    how = parser.add_argument_group("fine points of the solve (docs/solver.md)")
    how.add_argument(
        "--adaptation",
        choices=("similarity", "rbf"),
        default="similarity",
        help="how displacements are carried to the avatar (default: %(default)s)",
    )
    how.add_argument("--sparsity", type=float, metavar="S", help="pull towards rest, 0 or more (default: 0.006)")
    how.add_argument(
        "--head-slack", type=float, metavar="H", help="how far head markers may creep, 0 trusts them (default: 0.3)"
    )
    how.add_argument(
        "--slip",
        type=float,
        metavar="D",
        help="how far off a marker counts in full, beside a typical displacement; 0 trusts all (default: 0.4)",
    )
    how.add_argument("--keep-creep", action="store_true", help="do not take away what the markers creep on the skin")
    how.add_argument(
        "--signer-bases", type=Path, metavar="FILE", help="the signer's own bases, made by signface calibrate"
    )


def add_writing_arguments(parser: argparse.ArgumentParser) -> None:
    """Add `--template`, `--mapping`, `--channels` and `--doubtful`."""
    parser.add_argument(
        "--template", type=Path, metavar="ETF_OR_EAF", help="a lab's template, whose tiers and vocabularies are used"
    )
    parser.add_argument(
        "--mapping", type=Path, metavar="FILE", help="which channel goes to which tier (signface elan map writes one)"
    )
    parser.add_argument(
        "--channels",
        nargs="?",
        const="default",
        metavar="FILE",
        help="also brows, eyes, gaze, nose, mouth, cheeks, head and intensity; FILE holds other thresholds",
    )
    parser.add_argument(
        "--doubtful",
        type=float,
        metavar="CONFIDENCE",
        help="also a tier with the segments whose confidence is below this, 0 to 1",
    )


def writing_options(arguments: argparse.Namespace) -> EafOptions:
    """What `add_writing_arguments` asked for."""
    from signface.elan.options import EafOptions

    return EafOptions(arguments.template, arguments.mapping, arguments.channels, arguments.doubtful)


def solve_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """What `add_solve_arguments` asked for, as keywords of `signface.solver.solving.solve_take`."""
    return {
        "neutral": arguments.neutral,
        "method": arguments.method,
        "alpha": arguments.alpha,
        "adaptation": arguments.adaptation,
        "sparsity": arguments.sparsity,
        "head_slack": arguments.head_slack,
        "slip": arguments.slip,
        "creep": False if arguments.keep_creep else None,
        "signer": arguments.signer_bases,
    }


def neutral_time(text: str) -> float | str:
    """`auto` or a number of seconds; for argparse."""
    if text == "auto":
        return text
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is neither a time in seconds nor auto") from None


def read_face_and_layout(arguments: argparse.Namespace) -> tuple[FaceModel, MarkerLayout | None]:
    """The face and layout that were asked for; no layout stands for the one that fits the take best."""
    from signface.face.layout_files import read_layout
    from signface.face.reading import read_face

    face = read_face(arguments.face)
    return face, None if arguments.layout is None else read_layout(arguments.layout, face)


def output_files(takes: list[Path], output: Path | None, suffix: str) -> list[Path]:
    """Where the results of several takes go.

    One take and an `output` with an ending is that file; otherwise `output` is a folder (the present one when not
    given), and each take is written there under its own stem.

    Raises
    ------
    SignfaceError
        Two takes would be written to the same file, or a single file was named for several takes.
    """
    named = output is not None and output.suffix.lower() == suffix and not output.is_dir()
    if named and len(takes) == 1:
        assert output is not None
        return [output]
    if named or (output is not None and output.is_file()):
        raise SignfaceError(f"one file cannot hold {len(takes)} takes", file=output, hint="name a folder")
    folder = Path() if output is None else output
    files = [folder / f"{take.stem}{suffix}" for take in takes]
    twice = sorted({file.name for file in files if files.count(file) > 1})
    if twice:
        raise SignfaceError(f"several takes would be written to {twice[0]}", hint="annotate them into two folders")
    return files
