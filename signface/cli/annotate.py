"""`signface annotate`: recordings in, ELAN files out."""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

from signface.cli.options import add_solve_arguments, output_files, read_face_and_layout
from signface.cli.progress import progress
from signface.errors import SignfaceError

if TYPE_CHECKING:
    from signface.annotation import Annotation
    from signface.face.layout import MarkerLayout
    from signface.face.model import FaceModel
    from signface.label.model import TrainedModel

EXAMPLE = """  signface annotate take.c3d -o take.eaf
  signface annotate recordings/*.c3d -o annotated/ --signer S1
  signface annotate take.c3d --into corrected.eaf --channels"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Fill the parser of this command."""
    parser.add_argument("takes", nargs="+", type=Path, metavar="TAKE", help="recordings")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FILE_OR_FOLDER", help="an .eaf, or a folder (default: this folder)"
    )
    add_solve_arguments(parser)
    parser.add_argument(
        "--classifier", default="default", metavar="NAME_OR_FILE", help="a shipped classifier or a .skops file"
    )
    parser.add_argument("--signer", default="", metavar="NAME", help="names the tiers: affect@NAME")
    parser.add_argument("--video", type=Path, metavar="FILE", help="film of the take, linked in the .eaf")
    parser.add_argument(
        "--into", type=Path, metavar="EAF", help="add our tiers to this .eaf, and touch nothing else in it"
    )
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
    parser.add_argument(
        "--figure", action="store_true", help="also draw the face and the timeline of each take (TAKE.png)"
    )
    parser.add_argument(
        "--replace", action="store_true", help="overwrite .eaf files that were worked in (the old one is kept)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Annotate every take; those that cannot be are named, and the others still are."""
    takes = arguments.takes
    if arguments.video is not None and len(takes) > 1:
        raise SignfaceError("--video belongs to one take", hint="annotate the takes one by one")
    if arguments.video is not None and not arguments.video.is_file():
        raise SignfaceError("no such video", file=arguments.video)
    if arguments.into is not None and len(takes) > 1:
        raise SignfaceError("--into names one file", hint="annotate the takes one by one")
    if arguments.into is not None and arguments.template is not None:
        raise SignfaceError("--into and --template exclude each other", hint="the file of --into has its own tiers")
    files = [arguments.into] if arguments.into is not None else output_files(takes, arguments.output, ".eaf")
    options = _writing_options(arguments)
    _import_for_solving()
    failed = 0
    with ThreadPoolExecutor(1) as beside:
        model = beside.submit(_load_model, arguments.classifier)
        face, layout = read_face_and_layout(arguments)
        for take, file in progress(list(zip(takes, files, strict=True)), "annotating"):
            try:
                annotate_file(take, file, arguments, options, face=face, layout=layout, model=model)
            except SignfaceError as error:
                if len(takes) == 1 or error is model.exception():
                    raise
                failed += 1
                print(f"signface: {error}", file=sys.stderr)
    if failed:
        print(f"signface: {failed} of {len(takes)} takes could not be annotated", file=sys.stderr)
    return 2 if failed else 0


def _import_for_solving() -> None:
    """Import what reading and solving need, before a thread imports other things beside them.

    Two threads that import packages which import one another can meet each other's half-made modules.
    """
    import scipy.ndimage
    import scipy.sparse.linalg
    import scipy.spatial.transform  # noqa: F401

    import signface.annotation
    import signface.face.layout_files
    import signface.solve.solving
    import signface.takes.reading  # noqa: F401


def _load_model(name: str) -> TrainedModel:
    """The classifier, and what labelling and writing import: a second's work, done while the first take is solved."""
    import signface.elan.output
    import signface.label.labelling  # noqa: F401
    from signface.label.persistence import hasten, load_model

    hasten()
    return load_model(name)


def _writing_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """What `signface.elan.output.write_take` is told, read before anything is solved."""
    from signface.elan.mapping import read_mapping
    from signface.label.channels import read_channels

    if arguments.doubtful is not None and not 0 <= arguments.doubtful <= 1:
        raise SignfaceError(f"--doubtful is a confidence from 0 to 1, not {arguments.doubtful:g}")
    return {
        "signer": arguments.signer,
        "video": arguments.video,
        "channels": None if arguments.channels is None else read_channels(arguments.channels),
        "doubtful_below": arguments.doubtful,
        "template": arguments.template,
        "into": arguments.into,
        "mapping": None if arguments.mapping is None else read_mapping(arguments.mapping),
        "replace": arguments.replace,
    }


def annotate_file(
    take: Path,
    file: Path,
    arguments: argparse.Namespace,
    options: dict[str, Any],
    *,
    face: FaceModel,
    layout: MarkerLayout | None,
    model: Future[TrainedModel],
) -> None:
    """Annotate one recording into one .eaf and say what was found."""
    from signface.annotation import annotate, describe, summarise, write_annotation
    from signface.takes.reading import open_recording

    descriptors = describe(
        open_recording(take),
        face=face,
        layout=layout,
        neutral=arguments.neutral,
        method=arguments.method,
        alpha=arguments.alpha,
    )
    found = annotate(descriptors, model=model.result())
    write_annotation(found, file, **options)
    if arguments.figure:
        save_picture(found, face, file.with_suffix(".png"))
    print(f"{file}: {summarise(found)}")


def save_picture(found: Annotation, face: FaceModel, path: Path) -> None:
    """Draw a take in one picture; its timeline only, where its weights are not this face's."""
    from signface.report.overview import draw_overview
    from signface.report.timeline import draw_timeline, save_figure

    if found.descriptors.names == face.names:
        save_figure(draw_overview(found.descriptors, found.segments, face), path)
    else:
        save_figure(draw_timeline(found.descriptors, found.segments), path)
