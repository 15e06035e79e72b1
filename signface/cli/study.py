"""`signface study`: a perceptual study from its films to its statistics."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from signface.cli import study_analysis, study_render
from signface.errors import SignfaceError

if TYPE_CHECKING:
    from signface.study.questionnaire.store import Store

EXAMPLE = """  signface study new group-1 my-study
  signface study render my-study
  signface study serve my-study
  signface study export my-study -o responses.csv
  signface study analyse responses.csv"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the steps of a study."""
    steps = parser.add_subparsers(dest="step", metavar="STEP", required=True, title="steps")

    def step(name: str, summary: str, example: str) -> argparse.ArgumentParser:
        return steps.add_parser(
            name,
            help=summary,
            description=summary[0].upper() + summary[1:] + ".",
            epilog=f"example:\n{example}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )

    new = step("new", "begin a study from one that ships", "  signface study new group-1 my-study")
    new.add_argument("example", metavar="EXAMPLE", help="group-1, group-2a or group-2b, the studies of the thesis")
    new.add_argument("folder", metavar="FOLDER", type=Path, help="where; new or empty")
    new.set_defaults(work=run_new)

    render = step("render", "make films and sheets of stills", study_render.EXAMPLE)
    study_render.add_render_arguments(render)
    render.set_defaults(work=study_render.run_render)

    serve = step("serve", "put a questionnaire on the web", "  signface study serve my-study --port 8000")
    serve.add_argument("study", metavar="STUDY_FOLDER", type=Path, help="a folder with study.toml and its films")
    serve.add_argument("--host", default="127.0.0.1", help="address to listen on (default: this machine alone)")
    serve.add_argument("--port", type=int, default=8000, help="port (default %(default)s)")
    serve.add_argument("--behind-proxy", action="store_true", help="a server on this machine forwards to us over HTTPS")
    _add_database(serve)
    serve.set_defaults(work=run_serve)

    export = step("export", "write the answers as csv", "  signface study export my-study -o responses.csv")
    export.add_argument("study", metavar="STUDY_FOLDER", type=Path)
    export.add_argument("-o", "--output", metavar="FILE.csv", type=Path, help="default: responses.csv in the folder")
    export.add_argument("--finished", action="store_true", help="only participants who came to the end")
    _add_database(export)
    export.set_defaults(work=run_export)

    erase = step("erase", "erase a participant", "  signface study erase my-study --participant P7KQ2MZA")
    erase.add_argument("study", metavar="STUDY_FOLDER", type=Path)
    erase.add_argument("--participant", required=True, metavar="CODE", help="the participant's code")
    _add_database(erase)
    erase.set_defaults(work=run_erase)

    analyse = step("analyse", "analyse answers: tables and a report", study_analysis.ANALYSE_EXAMPLE)
    study_analysis.add_analyse_arguments(analyse)
    analyse.set_defaults(work=study_analysis.run_analyse)

    simulate = step("simulate", "make answers of participants who do not exist", study_analysis.SIMULATE_EXAMPLE)
    study_analysis.add_simulate_arguments(simulate)
    simulate.set_defaults(work=study_analysis.run_simulate)


def _add_database(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--database",
        metavar="URL",
        help="postgresql://user:password@host/name (default: answers.sqlite in the study's folder)",
    )


def run(arguments: argparse.Namespace) -> int | None:
    """Run one step."""
    return arguments.work(arguments)


def run_new(arguments: argparse.Namespace) -> None:
    """Copy an example."""
    from signface.study.examples import copy_example

    copy_example(arguments.example, arguments.folder)
    print(
        f"{arguments.folder / 'study.toml'}: describe your study there, then: signface study render {arguments.folder}"
    )


def run_serve(arguments: argparse.Namespace) -> None:
    """Serve until interrupted."""
    from signface.study.design import read_study
    from signface.study.questionnaire.server import organiser_token, serve

    study = read_study(arguments.study)
    store = _store(arguments, study.folder)
    site = f"http://{arguments.host}:{arguments.port}"
    print(f"participants begin at {site}/")
    print(f"organisers look at    {site}/organiser/{organiser_token(study.folder)}", flush=True)
    try:
        serve(study, store, host=arguments.host, port=arguments.port, behind_proxy=arguments.behind_proxy)
    finally:
        store.close()


def run_export(arguments: argparse.Namespace) -> None:
    """Write the csv."""
    from signface.study.design import read_study
    from signface.study.questionnaire.export import write_export

    study = read_study(arguments.study, films=False)
    store = _store(arguments, study.folder, existing=True)
    output = arguments.output or study.folder / "responses.csv"
    people, rows = write_export(study, store, output, finished_only=arguments.finished)
    store.close()
    print(f"{output}: {rows} answers of {people} participants")


def run_erase(arguments: argparse.Namespace) -> None:
    """Forget a participant."""
    from signface.study.design import read_study

    study = read_study(arguments.study, films=False)
    store = _store(arguments, study.folder, existing=True)
    count = store.erase(arguments.participant.strip().upper())
    store.close()
    print(f"{arguments.participant}: erased, with {count} answers; erase them from exported files too")


def _store(arguments: argparse.Namespace, folder: Path, *, existing: bool = False) -> Store:
    from signface.study.questionnaire.store import open_store

    file = folder / "answers.sqlite"
    if arguments.database is None and existing and not file.is_file():
        raise SignfaceError("no answers yet", file=file, hint="signface study serve collects them")
    return open_store(arguments.database or file)
