"""`signface annotate`: recordings in, ELAN files out."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
import warnings
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from signface.cli.options import (
    add_clause_argument,
    add_settings_arguments,
    add_signer_arguments,
    add_solve_arguments,
    output_files,
    read_face_and_layout,
    settings_from,
    signer_from,
)
from signface.cli.threads import one_thread_for_matrices
from signface.errors import SignfaceError, SignfaceWarning
from signface.marker_names import SeveralSigners
from signface.progress import progress
from signface.settings.choices import BY_SIGNER
from signface.settings.eaf import EafOptions
from signface.settings.solve import SolveSettings

if TYPE_CHECKING:
    from signface.annotation import Annotation, Clause
    from signface.descriptors import Descriptors
    from signface.face.model import FaceModel
    from signface.label.model import TrainedModel
    from signface.signer import Signer

EXAMPLE = """  signface annotate take.c3d -o take.eaf
  signface annotate recordings/*.c3d -o annotated/ --signer S1
  signface annotate take.c3d --into corrected.eaf --channels
  signface annotate dialogue.c3d -o dialogue.eaf
  signface annotate dialogue.c3d --subject Anna --from 0:10 --to 1:30
  signface annotate phone.csv --timecode 10:23:11:00@25 --video film.mp4
  signface annotate openface/*.csv -o annotated/ --signer S1 --channels --clause lse-questions"""


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
    add_clause_argument(parser)
    parser.add_argument("--signer", default="", metavar="NAME", help="names the tiers: affect@NAME")
    parser.add_argument("--video", type=Path, metavar="FILE", help="film of the take, linked in the .eaf")
    parser.add_argument(
        "--into", type=Path, metavar="EAF", help="add our tiers to this .eaf, and touch nothing else in it"
    )
    add_settings_arguments(parser, EafOptions)
    add_signer_arguments(parser)
    parser.add_argument(
        "--figure", action="store_true", help="also draw the face and the timeline of each take (TAKE.png)"
    )
    parser.add_argument(
        "--replace", action="store_true", help="overwrite .eaf files that were worked in (the old one is kept)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Annotate every take; those that cannot be are named, and the others still are."""
    one_thread_for_matrices()
    from signface.annotation import annotate
    from signface.segmentation.noise import warn_of_jitter
    from signface.solver.solving import solve
    from signface.takes.reading import open_recording

    takes = arguments.takes
    if arguments.video is not None and len(takes) > 1:
        raise SignfaceError("--video belongs to one take", hint="annotate the takes one by one")
    if arguments.video is not None and not arguments.video.is_file():
        raise SignfaceError("no such video", file=arguments.video)
    if arguments.into is not None and len(takes) > 1:
        raise SignfaceError("--into names one file", hint="annotate the takes one by one")
    if arguments.into is not None and arguments.output is not None:
        raise SignfaceError("--into and --output exclude each other", hint="--into writes into the file that it names")
    options = settings_from(arguments, EafOptions)
    if arguments.into is not None and getattr(arguments, "eaf_template", None) is not None:
        raise SignfaceError("--into and --template exclude each other", hint="the file of --into has its own tiers")
    files = [arguments.into] if arguments.into is not None else output_files(takes, arguments.output, ".eaf")
    _check_files(arguments.into, options)
    if arguments.into is None and len(files) == 1:  # of several, each says it, and the others are annotated
        _check_place(files[0], replace=arguments.replace)
    channels: bool | Mapping[str, Any] = False
    if options.channels is not None:  # pandas comes with it, which is otherwise imported beside the solve
        from signface.channels.rules import read_channels

        channels = read_channels(options.channels)
    signer, settings = signer_from(arguments), settings_from(arguments, SolveSettings)
    signer = signer if signer.name or not settings.subject else replace(signer, name=settings.subject)
    _warn_of_affect(takes, arguments.classifier)
    _import_shared()
    failed = 0
    with ThreadPoolExecutor(1) as beside:
        model = beside.submit(_load_model, arguments.classifier)
        face, layout = read_face_and_layout(settings)

        @cache
        def whose(subject: str | None) -> _Whose:
            """What is known of the one signer, or of one of those whom the takes show."""
            named = signer if subject is None else replace(signer, name=subject)
            its = settings if subject is None else settings.changed(subject=subject)
            return _Whose(takes, named, its, model.result, arguments.clause)

        def annotated(take: Path, subject: str | None = None) -> Annotation:
            """What is found in a take of one signer."""
            one = whose(subject)
            descriptors = one.known.get(take) or solve(
                open_recording(take, **one.settings.reading), face, layout, settings=one.settings, signer=one.signer
            )
            clauses = [further.found(take) for further in one.further]
            return annotate(descriptors, model.result(), signer=one.signer, channels=channels, clauses=clauses)

        for take, file in progress(list(zip(takes, files, strict=True)), "annotating"):
            path, into = (file, None) if arguments.into is None else (None, file)
            try:
                try:
                    results = [annotated(take)]
                except SeveralSigners as several:  # a dialogue: each with tiers of their own
                    results = [annotated(take, one) for one in _chosen(several, arguments.signer)]
                from signface.elan.tiers import clean_name
                from signface.elan.writing import write_eaf  # imported beside the solve, by _load_model

                write_eaf(results, path, into=into, options=options, video=arguments.video, replace=arguments.replace)
                for result in results:
                    of = f".{clean_name(result.signer.name)}" if len(results) > 1 else ""
                    if arguments.figure:
                        save_picture(result, face, file.with_suffix(f"{of}.png"))
                    print(f"{file}{f' ({result.signer.name})' if of else ''}: {result}")
                    warn_of_jitter(result.descriptors, result.jitter)
            except SignfaceError as error:
                if len(takes) == 1 or error is model.exception():
                    raise
                failed += 1
                print(f"signface: {error}", file=sys.stderr)
    if failed:
        print(f"signface: {failed} of {len(takes)} takes could not be annotated", file=sys.stderr)
    return 2 if failed else 0


def _check_files(into: Path | None, options: EafOptions) -> None:
    """Say before anything is solved what is wrong with the files that the result goes into."""
    if options.mapping is not None:
        from signface.elan.mapping import read_mapping

        read_mapping(options.mapping)
    there = into if into is not None else options.template
    if there is not None:
        from signface.elan.checking import check_document
        from signface.elan.document import read_document

        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SignfaceWarning)  # what is harmless is said when the file is written
            check_document(read_document(there).getroot(), Path(there))


def _check_place(file: Path, *, replace: bool) -> None:
    """Say before anything is solved that the result cannot be written."""
    if file.exists():
        from signface.elan.writing import check_writable

        check_writable(file, replace=replace)
    there = next(place for place in (file, *file.absolute().parents) if place.exists())  # folders are made
    if not os.access(there, os.W_OK):
        raise SignfaceError("cannot be written", file=file, hint="choose a folder you may write to")


def _warn_of_affect(takes: list[Path], classifier: str) -> None:
    """Say, in one line, what the shipped classifier of affect has met, where real people were filmed."""
    from signface.corpus.signers import TRACKED
    from signface.takes.formats.registry import format_of

    for take in takes if classifier == "default" else ():
        with contextlib.suppress(SignfaceError):  # said when its turn comes
            if format_of(take).name in TRACKED:
                warnings.warn(
                    "the classifier default has met synthetic signers only: on people do not trust the tier affect "
                    "(channels and --clause lse-questions have met some)",
                    SignfaceWarning,
                    stacklevel=2,
                )
                return


def _of_all(
    takes: list[Path], settings: SolveSettings, signer: Signer, *, wanted: bool
) -> tuple[Signer, dict[Path, Descriptors]]:
    """The signer with the rest and level of all takes, and the takes solved.

    Where it is not `wanted`, only for landmarks: a short take of them says little of where the face rests.
    """
    from signface.descriptors import Descriptors
    from signface.face.layout_files import choose_layout
    from signface.face.reading import read_face
    from signface.solver.signer_rest import learn_signer
    from signface.takes.reading import open_recording

    openers = [partial(open_recording, take, **settings.reading) for take in takes]
    try:
        first = openers[0]()
        of_landmarks = not isinstance(first, Descriptors) and choose_layout(first.labels, read_face()).of_landmarks
    except SignfaceError:
        of_landmarks = False
    if not (wanted or of_landmarks):
        return signer, {}
    try:
        signer, solved = learn_signer(progress(openers, "solving"), settings, signer)
    except SignfaceError:  # said of each take when its turn comes
        return signer, {}
    return signer, {take: one for take, one in zip(takes, solved, strict=True) if one is not None}


def _chosen(several: SeveralSigners, signer: str) -> tuple[str, ...]:
    """The signers of a take who are annotated: the one whom `--signer` names, or all of them."""
    if (signer and signer not in several.signers) or "" in several.signers:
        raise several
    return (signer,) if signer else several.signers


class _Whose:
    """What is known of a signer over all takes: level, takes solved, and the further models for them."""

    def __init__(
        self,
        takes: list[Path],
        signer: Signer,
        settings: SolveSettings,
        model: Callable[[], TrainedModel],
        clauses: list[str],
    ) -> None:
        from signface.label.persistence import load_model

        self.signer, self.settings = signer, settings
        self.known: dict[Path, Descriptors] = {}
        if len(takes) > 1 and signer.level is None:
            wanted = model().card.normalise in BY_SIGNER
            self.signer, self.known = _of_all(takes, settings, signer, wanted=wanted)
        self.further = [_Further(load_model(name, quickly=True), takes, self.signer, settings) for name in clauses]


class _Further:
    """A model of `--clause`, with the takes solved and the signer's level as its own takes were."""

    def __init__(self, model: TrainedModel, takes: list[Path], signer: Signer, settings: SolveSettings) -> None:
        self.model = model
        self.settings = SolveSettings.from_dict(model.card.solve).for_take_of(settings)
        self.signer = signer
        self.known: dict[Path, Descriptors] = {}
        fits = signer.level is not None and set(model.card.bases) <= set(signer.level.names)
        if len(takes) > 1 and model.card.normalise in BY_SIGNER and not fits:
            self.signer, self.known = _of_all(takes, self.settings, replace(signer, level=None), wanted=True)

    def found(self, take: Path) -> Clause:
        """What the model finds in a take."""
        from signface.annotation import find_clause
        from signface.takes.reading import open_recording

        if take in self.known:
            return find_clause(self.known[take], self.model, signer=self.signer)
        recording = open_recording(take, **self.settings.reading)
        return find_clause(recording, self.model, signer=self.signer, settings=self.settings)


def _import_shared() -> None:
    """Import what both threads need: two that import one package at a time can meet each other's half-made modules."""
    import scipy.ndimage
    import scipy.sparse.linalg
    import scipy.spatial.transform  # noqa: F401

    import signface.descriptors  # noqa: F401


def _load_model(name: str) -> TrainedModel:
    """The classifier, and what labelling and writing import: a second's work, done while the first take is solved."""
    import signface.elan.writing
    import signface.label.labelling  # noqa: F401
    from signface.label.persistence import load_model

    return load_model(name, quickly=True)


def save_picture(annotation: Annotation, face: FaceModel, path: Path) -> None:
    """Draw a take in one picture; its timeline only, where its weights are not this face's."""
    from signface.report.overview import draw_overview
    from signface.report.timeline import draw_timeline, save_figure

    if annotation.descriptors.names == face.names:
        save_figure(
            draw_overview(annotation.descriptors, annotation.segments, face, vocabulary=annotation.vocabulary), path
        )
    else:
        save_figure(draw_timeline(annotation.descriptors, annotation.segments, vocabulary=annotation.vocabulary), path)
