"""`signface evaluate`: how good segmentation and classifiers are on an annotated corpus."""

from __future__ import annotations

import argparse
from pathlib import Path

from signface.cli.options import add_settings_arguments, add_solve_arguments, settings_from, words
from signface.cli.train import add_tier_arguments, tier_options
from signface.errors import SignfaceError
from signface.progress import progress
from signface.settings.choices import NAMES, SEQUENCE_NAMES
from signface.settings.solve import SolveSettings
from signface.settings.training import TrainingSettings

EXAMPLE = """  signface evaluate corpora/feel -o reports/feel
  signface evaluate corpora/feel -o reports/feel --train-kinds IE,SE,EU --protocol across --classifiers net-hsmm"""


#: What is printed of manual segments besides the accuracy, by its key in metrics.json; and of intensities.
RELIABILITY = {
    "balanced_accuracy": "balanced accuracy of manual segments",
    "calibration_error": "expected calibration error of manual segments",
}
INTENSITY = {
    "exact": "exact",
    "within_one": "within one",
    "mean_absolute_error": "mean error",
    "quadratic_kappa": "kappa",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Fill the parser of this command."""
    parser.add_argument("corpus", type=Path, metavar="CORPUS", help="folder of a corpus")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="FOLDER",
        help="for report.html, metrics.json, tables as CSV, figures as SVG and PDF",
    )
    parser.add_argument(
        "--train-kinds",
        type=words,
        metavar="IE,SE",
        help="kinds trained on (default: IE,SE; all kinds where none of IE, SE and EU is there)",
    )
    parser.add_argument(
        "--test-kinds", type=words, metavar="EU", help="kinds tested (default: EU; all kinds where none of these is)"
    )
    parser.add_argument(
        "--protocol",
        choices=("within", "across"),
        help="train on the same signer, or on all others (default: both, where signers and takes suffice); a kind that "
        "is both trained on and tested is tested in turns, whole takes left out",
    )
    parser.add_argument(
        "--classifiers",
        type=words,
        metavar="NAMES",
        default=list(NAMES),
        help=f"those of the thesis ({','.join(NAMES)}, the default) or sequence models ({','.join(SEQUENCE_NAMES)})",
    )
    add_settings_arguments(parser, TrainingSettings, without=("classifier",))
    parser.add_argument(
        "--learning-curve",
        action="store_true",
        help="draw learning curves of all classifiers (sequence models: minutes); by default those of the thesis "
        "on the tier affect, and none on others",
    )
    parser.add_argument(
        "--date", metavar="WORDS", help="date to print on the report (default: none, so that its bytes repeat)"
    )
    add_tier_arguments(parser)
    add_solve_arguments(parser)


def run(arguments: argparse.Namespace) -> None:
    """Solve, train, compare, write and print."""
    from signface.corpus.examples import solve_corpus
    from signface.corpus.manifest import read_corpus
    from signface.evaluation.measure import evaluate
    from signface.evaluation.usual import usual_kinds, usual_protocols
    from signface.report.evaluation.report import write_report

    unknown = [name for name in arguments.classifiers if name not in NAMES | SEQUENCE_NAMES]
    if unknown or not arguments.classifiers:
        raise SignfaceError(
            f"there is no classifier named {unknown[0]}" if unknown else "no classifier is named",
            hint=f"choose among {', '.join(NAMES | SEQUENCE_NAMES)}",
        )
    # Calibrating trains five times more: here it is asked for, not usual.
    settings = settings_from(arguments, TrainingSettings, TrainingSettings(calibrate=False))
    solve = settings_from(arguments, SolveSettings)
    if arguments.output.exists() and not arguments.output.is_dir():
        raise SignfaceError("is a file, not a folder", file=arguments.output, hint="name a folder for the report")
    whole = read_corpus(arguments.corpus)
    train_kinds, test_kinds = usual_kinds(whole.kinds, arguments.train_kinds, arguments.test_kinds)
    try:
        corpus = whole.select(kinds=[*train_kinds, *test_kinds])
    except SignfaceError as error:
        hint = f"{error.hint}: name some, --train-kinds K --test-kinds K"
        raise SignfaceError(error.problem, file=error.file, hint=hint) from None
    annotated = [take for take in corpus if take.annotation is not None]
    protocols = [arguments.protocol] if arguments.protocol else None
    possible = usual_protocols(annotated, protocols, train_kinds=train_kinds, test_kinds=test_kinds)
    examples = solve_corpus(
        corpus,
        settings=solve,
        **tier_options(arguments),
        progress=lambda items: progress(items, "solving", total=len(annotated)),
    )
    measured = evaluate(
        examples,
        settings,
        protocols=protocols if "within" in possible else possible,
        train_kinds=train_kinds,
        test_kinds=test_kinds,
        classifiers=arguments.classifiers,
        curves_of=arguments.classifiers if arguments.learning_curve else None if arguments.tier == "affect" else (),
        progress=progress,
    )
    page = write_report(measured, examples, corpus, arguments.output, settings=solve, date=arguments.date)
    print_results(measured.metrics)
    print(f"report: {page}")


def print_results(metrics: dict) -> None:
    """Print accuracies beside chance and the majority class, and how the segments agree."""
    from signface.report.evaluation.tables import PROTOCOL_TITLES, SECTIONS, by_protocol
    from signface.report.pages import spelt as number

    for protocol, part in by_protocol(metrics).items():
        classifiers = part["classifiers"]
        sections = next(iter(classifiers.values()))
        rows = [["accuracy, " + PROTOCOL_TITLES[protocol], *SECTIONS.values()]]
        rows += [[name, *(number(scores[key]["accuracy"]) for key in SECTIONS)] for name, scores in classifiers.items()]
        rows.append(["chance", *(number(sections[key]["chance"]) for key in SECTIONS)])
        rows.append(
            ["majority class"]
            + [f"{number(sections[key]['majority'])} ({sections[key]['majority_label']})" for key in SECTIONS]
        )
        rows.append(["n", *(str(sections[key]["n"]) for key in SECTIONS)])
        width = max(len(row[0]) for row in rows)
        for row in rows:
            print(row[0].ljust(width) + "".join(cell.rjust(20) for cell in row[1:]))
        print()
    for part in (metrics, *metrics.get("also", {}).values()):
        title = PROTOCOL_TITLES[part["protocol"]["name"]]
        for key, what in RELIABILITY.items():
            scores = {name: sections["manual_segments"][key] for name, sections in part["classifiers"].items()}
            print(f"{what}, {title}: {', '.join(f'{name} {number(score)}' for name, score in scores.items())}")
        for how, scores in part.get("intensity", {}).items():
            numbers = ", ".join(f"{what} {number(scores[key])}" for key, what in INTENSITY.items())
            print(f"intensity, {how}, {title}: {numbers}")
    print()
    cut = metrics["segmentation"]
    f1 = ", ".join(f"{value:.2f} within {tolerance} s" for tolerance, value in cut["boundary_f1"].items())
    print(f"segments: boundary F1 {f1}; mean IoU {cut['mean_iou']:.2f}; frame agreement {cut['frame_agreement']:.2f}")
    for part in (metrics, *metrics.get("also", {}).values()):
        for name, scores in part["segmentation_by_classifier"].items():
            f1 = ", ".join(f"{value:.2f} within {tolerance} s" for tolerance, value in scores["boundary_f1"].items())
            print(f"segments of {name}, {PROTOCOL_TITLES[part['protocol']['name']]}: boundary F1 {f1}")
