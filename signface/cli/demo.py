"""`signface demo`: annotate the takes that ship with signface, and say what was found."""

from __future__ import annotations

import argparse
from pathlib import Path

from signface.errors import SignfaceError

EXAMPLE = "  signface demo -o demo-output"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Fill the parser of this command."""
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("demo-output"), metavar="FOLDER", help="default: %(default)s"
    )


def run(arguments: argparse.Namespace) -> int:
    """Annotate the bundled takes into a folder, with a figure of each."""
    from signface.annotation import annotate
    from signface.cli.annotate import save_picture
    from signface.corpus.manifest import read_corpus
    from signface.elan.writing import write_eaf
    from signface.face.reading import read_face
    from signface.files import bundled_corpus
    from signface.label.persistence import load_model
    from signface.progress import progress
    from signface.settings.solve import SolveSettings
    from signface.signer import Signer
    from signface.takes.reading import read_recording

    corpus = read_corpus(bundled_corpus())
    model, face = load_model("default", quickly=True), read_face("default")
    results = []
    for entry in progress(corpus.takes, "annotating"):
        file = arguments.output / f"{entry.path.stem}.eaf"
        annotation = annotate(
            read_recording(entry.path),
            model,
            signer=Signer(entry.signer),
            face=face,
            settings=SolveSettings() if entry.neutral_s is None else SolveSettings(neutral=entry.neutral_s),
        )
        written = write_eaf(annotation, file, replace=True)
        save_picture(annotation, face, file.with_suffix(".png"))
        results.append((written[0], annotation))
    if not results:
        raise SignfaceError("no take ships with this copy of signface", hint="use a checkout of the project")
    print("\nThe bundled takes are synthetic: no person was recorded. What signface found in them:\n")
    for file, annotation in results:
        print(f"  {file}\n      {annotation}")
    print(f"\nOpen one of the .eaf files above in ELAN, or look at the pictures: {arguments.output}/*.png")
    return 0
