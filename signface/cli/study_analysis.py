"""`signface study analyse` and `signface study simulate`: from answers to statistics, and answers to try them on."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from signface.errors import SignfaceError
from signface.files import whole_file

if TYPE_CHECKING:
    from signface.study.responses import Responses

ANALYSE_EXAMPLE = "  signface study analyse responses.csv -o results --screenshots screenshots"
SIMULATE_EXAMPLE = "  signface study simulate group-1 -o responses.csv --effect LSTS70:intensity=-0.3 --seed 1"


def add_analyse_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `analyse`."""
    parser.add_argument(
        "responses",
        metavar="RESPONSES",
        nargs="+",
        help="a csv of answers, one row per answer, or a study's folder with answers.sqlite; several make one study",
    )
    parser.add_argument(
        "-o", "--output", metavar="FOLDER", help="where to write (default: RESPONSES-analysis beside it)"
    )
    parser.add_argument("--title", help="title of the report")
    parser.add_argument("--screenshots", metavar="FOLDER", help="pictures of the questionnaire, shown in the report")
    parser.add_argument("--alpha", type=float, default=0.05, help="significance level (default 0.05)")
    parser.add_argument("--resamples", type=int, default=2000, help="bootstrap samples of participants (default 2000)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the bootstrap (default 0)")


def run_analyse(arguments: argparse.Namespace) -> int:
    """Print the tables; write the report and the tables as CSV and LaTeX."""
    from signface.report.study.report import write_report
    from signface.study.responses import combine
    from signface.study.statistics.analysis import analyse
    from signface.study.statistics.tables import as_text

    if not 0 < arguments.alpha < 1:
        raise SignfaceError(f"--alpha {arguments.alpha:g} is no significance level", hint="choose one between 0 and 1")
    if arguments.resamples < 100:
        raise SignfaceError(f"--resamples {arguments.resamples} is too few", hint="ask for at least 100")
    source = Path(arguments.responses[0])
    source = source.resolve() if source.is_dir() else source  # "." has no name
    folder = Path(arguments.output) if arguments.output else source.with_name(f"{source.stem}-analysis")
    responses = combine([_responses(file) for file in arguments.responses])
    for warning in responses.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    analysis = analyse(responses, alpha=arguments.alpha, resamples=arguments.resamples, seed=arguments.seed)
    report = write_report(analysis, folder, title=arguments.title, screenshots=arguments.screenshots)
    for table in analysis.tables:
        if responses.simulated:
            print("SIMULATED ANSWERS")
        print(as_text(table), end="\n\n")
    print(f"{report}: report; tables as CSV and LaTeX beside it")
    return 0


def _responses(source: str) -> Responses:
    """The answers of a csv, or of a study's folder as `study export` would write them."""
    from signface.study.reading import read_responses, validate

    if not Path(source).is_dir():
        return read_responses(source)
    import pandas as pd

    from signface.study.design import read_study
    from signface.study.questionnaire.export import export_table
    from signface.study.questionnaire.store import open_store

    study = read_study(source, films=False)
    file = study.folder / "answers.sqlite"
    if not file.is_file():
        raise SignfaceError("no answers yet", file=file, hint="signface study serve collects them")
    store = open_store(file)
    try:
        columns, rows = export_table(study, store)
    finally:
        store.close()
    return validate(pd.DataFrame(rows, columns=columns), name=source)


def add_simulate_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `simulate`."""
    parser.add_argument(
        "study",
        metavar="STUDY_OR_DESIGN",
        help="a study's folder, or a design of the thesis: group-1, group-2a, group-2b",
    )
    parser.add_argument("-o", "--output", metavar="RESPONSES.csv", required=True, help="where to write the answers")
    parser.add_argument("--participants", type=int, metavar="N", help="how many (default: the design's own number)")
    parser.add_argument(
        "--effect",
        action="append",
        default=[],
        metavar="METHOD[:QUESTION]=SHIFT",
        help="shift of a method's answers, in standard deviations (logits for accuracy); may be repeated",
    )
    parser.add_argument(
        "--spread", type=float, default=0.5, help="standard deviation between participants (default 0.5)"
    )
    parser.add_argument(
        "--reactions",
        type=float,
        default=0.0,
        help="standard deviation of participants' own reactions to methods (default 0)",
    )
    parser.add_argument("--seed", type=int, default=0, help="seed (default 0)")


def run_simulate(arguments: argparse.Namespace) -> int:
    """Write the answers of participants who do not exist."""
    from signface.study.statistics.simulation import Effects, simulate, study_design

    design = study_design(arguments.study)
    if min(arguments.spread, arguments.reactions) < 0:
        raise SignfaceError("a standard deviation is negative", hint="--spread and --reactions are 0 or more")
    effects = Effects(dict(map(_effect, arguments.effect)), arguments.spread, arguments.reactions)
    table = simulate(design, effects, participants=arguments.participants, seed=arguments.seed)
    with whole_file(arguments.output) as path:
        table.to_csv(path, index=False)
    people = table["participant"].nunique()
    print(f"{arguments.output}: {len(table)} SIMULATED answers of {people} participants who do not exist")
    return 0


def _effect(word: str) -> tuple[tuple[str, str], float]:
    """`METHOD:QUESTION=SHIFT` as a key and a number; the question may be its name in tables or its column."""
    from signface.study.responses import QUESTIONS

    where, _, shift = word.rpartition("=")
    method, _, question = where.partition(":")
    columns = (
        {name: column for column, name in QUESTIONS.items()} | {column: column for column in QUESTIONS} | {"": "*"}
    )
    try:
        value = float(shift)
    except ValueError:
        method = ""
    if not method or question not in columns:
        raise SignfaceError(
            f"--effect {word!r} is not METHOD:QUESTION=SHIFT", hint=f"the questions are {', '.join(QUESTIONS.values())}"
        )
    return (method, columns[question]), value
