"""`signface elan`: check files, map a template, learn from corrections, compare annotators, install the recogniser."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING

from signface.cli.options import add_settings_arguments, add_solve_arguments, parameters, settings_from
from signface.errors import SignfaceError
from signface.progress import progress
from signface.settings.solve import SolveSettings
from signface.settings.training import TrainingSettings

if TYPE_CHECKING:
    pass

EXAMPLE = """  signface elan check corrected/*.eaf
  signface elan map lab.etf -o mapping.toml
  signface elan map annotated/*.eaf -o mapping.toml
  signface elan learn corpora/mine -o mine.skops
  signface elan agree eva.eaf tom.eaf -o agreement/
  signface elan agree both.eaf --tier brows_R1 --tier brows_R2
  signface elan table annotated/*.eaf -o annotations.csv
  signface elan install-recogniser --elan /opt/ELAN_7-0"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Fill the parser of this command."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)

    def action(name: str, summary: str, example: str) -> argparse.ArgumentParser:
        return actions.add_parser(
            name, help=summary, description=summary[0].upper() + summary[1:] + ".", epilog=f"example: {example}"
        )

    def add_mapping(parser: argparse.ArgumentParser) -> None:
        words = "annotators' tiers and labels are those of this .toml, and are read as ours"
        parser.add_argument("--mapping", type=Path, metavar="FILE", help=words)

    check = action("check", "say what is wrong with EAF files", "signface elan check corrected/*.eaf")
    check.add_argument("files", nargs="+", type=Path, metavar="EAF")
    check.add_argument(
        "--duration", type=float, metavar="SECONDS", help="length of the film; annotations after it are named"
    )

    mapping = action(
        "map",
        "write a first mapping file for a lab's template or annotations",
        "signface elan map annotated/*.eaf -o mapping.toml",
    )
    mapping.add_argument("templates", nargs="+", type=Path, metavar="ETF_OR_EAF", help="or a folder of them")
    mapping.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="a .toml file")

    learn = action(
        "learn",
        "show what annotators corrected, and train on it",
        "signface elan learn corpora/mine -o mine.skops --with corpora/feel",
    )
    learn.add_argument("corpus", type=Path, metavar="CORPUS", help="a corpus whose annotations were corrected")
    learn.add_argument("-o", "--output", type=Path, metavar="MODEL", help="a .skops file; nothing is trained without")
    learn.add_argument(
        "--before",
        default="default",
        metavar="NAME_OR_FILE",
        help="the classifier in use so far (default: %(default)s)",
    )
    learn.add_argument(
        "--with", dest="others", action="append", default=[], type=Path, metavar="CORPUS",
        help="train on this corpus as well; may be repeated",
    )  # fmt: skip
    add_mapping(learn)
    add_settings_arguments(learn, TrainingSettings)
    add_solve_arguments(learn)

    agree = action(
        "agree",
        "agreement between annotators, or between one and the machine",
        "signface elan agree eva.eaf tom.eaf machine.eaf -o agreement/",
    )
    agree.add_argument(
        "files", nargs="+", type=Path, metavar="EAF", help="files of one take, or one that holds all annotators"
    )
    agree.add_argument(
        "--tier", action="append", default=[], metavar="NAME",
        help="a tier of every file, or one of several of one file; may be repeated (default: all independent ones "
        "that every file has)",
    )  # fmt: skip
    agree.add_argument(
        "--match", choices=("name", "prefix", "suffix", "participant"), default="name",
        help="where the annotator stands in the names of tiers; name: an annotator is a file (default: %(default)s)",
    )  # fmt: skip
    agree.add_argument(
        "--separator", default="_", metavar="TEXT",
        help="what parts prefix or suffix from the rest of a tier's name (default: %(default)s)",
    )  # fmt: skip
    agree.add_argument(
        "--video",
        type=Path,
        metavar="FILE",
        help="the film whose clock counts, where those linked begin at other times",
    )
    agree.add_argument(
        "--overlap", type=float, default=0.6, metavar="SHARE",
        help="share of the longer annotation that must overlap for a match (default: %(default)s)",
    )  # fmt: skip
    agree.add_argument(
        "--same", action="append", default=[], type=parameters, metavar="OLD=NEW,...",
        help="tiers and labels that mean the same: br_raise=raised,brows@K01=brows@S1; may be repeated",
    )  # fmt: skip
    add_mapping(agree)
    agree.add_argument("--gamma", action="store_true", help="compute gamma too (slow)")
    agree.add_argument("-o", "--output", type=Path, metavar="FOLDER", help="also write tables (.csv) and pictures")

    table = action(
        "table",
        "write every annotation as a row of one table, with its parents' values",
        "signface elan table annotated/*.eaf -o annotations.csv",
    )
    table.add_argument("files", nargs="+", type=Path, metavar="EAF", help="or folders of them")
    table.add_argument(
        "--tier", action="append", default=[], metavar="NAME",
        help="only this tier, or those with this name before @; may be repeated (default: all)",
    )  # fmt: skip
    table.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="a .csv or .parquet file")

    install = action(
        "install-recogniser",
        "write the recogniser that ELAN itself runs",
        "signface elan install-recogniser --elan /opt/ELAN_7-0",
    )
    install.add_argument("--elan", type=Path, metavar="FOLDER", help="where ELAN is installed")
    install.add_argument(
        "-o", "--output", type=Path, default=Path("signface-recogniser"), metavar="FOLDER",
        help="where to write it when --elan is not given (default: %(default)s)",
    )  # fmt: skip

    actions.add_parser("recognise", help="annotate a take for ELAN, which runs this itself")


def run(arguments: argparse.Namespace) -> int | None:
    """Run one action."""
    actions = {
        "check": check_files,
        "map": map_template,
        "learn": learn_corrections,
        "agree": compare_annotators,
        "table": write_annotations,
        "install-recogniser": install_recogniser,
        "recognise": recognise,
    }
    return actions[arguments.action](arguments)


def check_files(arguments: argparse.Namespace) -> int:
    """Name every problem of every file; exit status 2 when there is any."""
    from signface.elan.checking import check_file

    bad = 0
    for file in arguments.files:
        try:
            result = check_file(file, media_s=arguments.duration)
        except SignfaceError as error:
            print(error)
            bad += 1
        else:
            print(result)
            bad += bool(result.problems)
    return 2 if bad else 0


def map_template(arguments: argparse.Namespace) -> None:
    """Write a first mapping file."""
    from signface.channels.rules import closed_vocabularies, read_channels
    from signface.elan.mapping_draft import write_mapping

    write_mapping(arguments.templates, arguments.output, channels=closed_vocabularies(read_channels()))
    print(f"{arguments.output}: written; look through it before it is used")


def learn_corrections(arguments: argparse.Namespace) -> None:
    """Show the corrections, compare before and after on takes held out, train on all and save."""
    from signface.corpus.examples import solve_corpus
    from signface.corpus.manifest import read_corpus
    from signface.elan.reference import corpus_corrections
    from signface.evaluation.corrections import compare_corrections
    from signface.label.persistence import load_model, read_card, save_model

    card = read_card(arguments.before)
    vocabulary = card.vocabulary.without_blank()
    corpus = read_corpus(arguments.corpus)
    files = [(entry.annotation, entry.signer, entry.video) for entry in corpus if entry.annotation is not None]
    tables = corpus_corrections(files, tier=card.tier, vocabulary=vocabulary, mapping=arguments.mapping)
    for line in compare_corrections(tables):
        print(line)
    if arguments.output is None:
        return
    if arguments.output.suffix.lower() != ".skops":
        raise SignfaceError("the ending of a classifier is .skops", file=arguments.output)

    from signface.learn.relearning import learn_corrections

    solve = settings_from(arguments, SolveSettings)

    def solved(folder: Path) -> list:
        takes = read_corpus(folder)
        count = sum(entry.annotation is not None for entry in takes)
        shown = partial(progress, what="solving", total=count)
        sparse = not card.vocabulary.blank
        return solve_corpus(
            takes,
            settings=solve,
            tier=card.tier,
            vocabulary=vocabulary,
            sparse=sparse,
            mapping=arguments.mapping,
            progress=shown,
        )

    learnt = learn_corrections(
        solved(arguments.corpus),
        load_model(arguments.before),
        settings_from(arguments, TrainingSettings, TrainingSettings(calibrate=False)),
        others=[example for folder in arguments.others for example in solved(folder)],
        solve=solve,
        corpus=" + ".join(folder.resolve().name for folder in (arguments.corpus, *arguments.others)),
        name=arguments.output.stem,
    )
    print("\n".join(learnt.words))
    save_model(learnt.model, arguments.output)
    print(f"{arguments.output}: {learnt.model.card.classifier} trained on {len(learnt.model.card.takes)} takes")


def compare_annotators(arguments: argparse.Namespace) -> None:
    """Print the agreement on every tier; write tables and pictures when asked."""
    from signface.elan.annotators import read_annotators
    from signface.metrics.tiers import compare_tiers, explained, renamed

    same = {old: str(new) for pairs in arguments.same for old, new in pairs.items()}
    asked = [*arguments.tier, *(old for old, new in same.items() if new in arguments.tier)]
    annotators = read_annotators(
        arguments.files,
        mapping=arguments.mapping,
        tiers=asked,
        match=arguments.match,
        separator=arguments.separator,
        video=arguments.video,
    )
    if same:
        annotators = renamed(annotators, same)
    in_one = arguments.match == "name" and len(arguments.files) == 1  # each tier is an annotator's
    agreements = compare_tiers(
        annotators, tiers=() if in_one else arguments.tier, overlap=arguments.overlap, gamma=arguments.gamma
    )
    first, second = list(annotators)[:2]
    for agreement in agreements:
        columns = agreement.table.drop(columns="tier")
        if not arguments.gamma:
            columns = columns.drop(columns=["gamma", "gamma_low", "gamma_high"])
        numbers = columns.select_dtypes("float").columns
        columns[numbers] = columns[numbers].round(2) + 0.0  # no -0.00
        print(agreement.tier)
        print(columns.to_string(index=False, float_format=lambda number: f"{number:.2f}", na_rep="undefined"))
        for line in explained(agreement):
            print(line)
        print(f"seconds, {first} down, {second} across:")
        print(agreement.seconds.to_string(float_format=lambda number: f"{number:.1f}" if number else "."))
        print()
    if arguments.output is not None:
        from signface.report.agreement import write_agreement

        write_agreement(agreements, arguments.output)
        print(f"{arguments.output}: tables and pictures")


def write_annotations(arguments: argparse.Namespace) -> None:
    """Write one table of all annotations, and say how many there are."""
    from signface.elan.table import annotation_table, check_table_file, write_table

    check_table_file(arguments.output)
    files: list[Path] = []
    for name in arguments.files:
        found = sorted(name.glob("*.eaf")) if name.is_dir() else [name]
        if not found:
            raise SignfaceError("holds no .eaf", file=name)
        files += found
    if arguments.output.suffix.lower() not in (".csv", ".parquet"):
        raise SignfaceError(
            "is no table that can be written", file=arguments.output, hint="name a .csv or .parquet file"
        )
    table = annotation_table(files, tiers=arguments.tier)
    write_table(table, arguments.output)
    print(f"{arguments.output}: {len(table)} annotations on {table['tier'].nunique()} tiers of {len(files)} files")


def install_recogniser(arguments: argparse.Namespace) -> None:
    """Write the extension folder and say what to do with it."""
    from signface.elan.recogniser import extensions_folder, write_extension

    folder = arguments.output if arguments.elan is None else extensions_folder(arguments.elan) / "signface"
    write_extension(folder)
    print(f"{folder}: written for {sys.executable}")
    if arguments.elan is None:
        print("Copy this folder into ELAN's extensions folder:")
        print("  Linux    ELAN_x-x/lib/app/extensions")
        print("  macOS    ELAN_x-x.app/Contents/app/extensions")
        print("  Windows  ELAN_x-x\\app\\extensions")
    print("Start ELAN again; on the tab Recognizers, choose signface.")


def recognise(arguments: argparse.Namespace) -> int:
    """Annotate one take for ELAN: parameters from standard input, progress to standard output, a tier file."""
    from signface.elan.recogniser import DONE, FAILED

    try:
        _recognise(sys.stdin.buffer.read())
    except SignfaceError as error:
        print(f"signface: {error}", flush=True)
        print(FAILED, flush=True)
        return 2
    except Exception:
        print(FAILED, flush=True)  # ELAN waits for this line; the trace that follows goes into its report
        raise
    print(DONE, flush=True)
    return 0


def _recognise(xml: bytes) -> None:
    from signface.annotation import annotate
    from signface.elan.recogniser import discard_tier_file, progress_line, read_parameters, write_tier_file
    from signface.elan.tiers import label_tier
    from signface.label.persistence import load_model
    from signface.settings.laboratory import read_settings
    from signface.signer import Signer
    from signface.takes.reading import read_recording

    chosen, encoding = read_parameters(xml)
    if encoding != "utf-8" and isinstance(sys.stdout, TextIOWrapper):  # ELAN reads as it writes
        sys.stdout.reconfigure(encoding=encoding, errors="backslashreplace")
    if "tiers" in chosen:
        discard_tier_file(chosen["tiers"])
    for name, what in (("take", "recording"), ("tiers", "file for the tiers")):
        if name not in chosen:
            raise SignfaceError(f"no {what} was chosen", hint=f"choose it in the panel ({name})")
    settings = read_settings(chosen["settings"]).solve if "settings" in chosen else SolveSettings()
    given = {name: chosen[name] for name in ("face", "layout", "neutral") if chosen.get(name)}
    settings = settings.changed(**given)
    name = chosen.get("signer", "")
    signer = Signer.read(chosen["signer_file"], name=name or None) if "signer_file" in chosen else Signer(name)
    print(progress_line(0.05, "reading"), flush=True)
    recording = read_recording(Path(chosen["take"]), **settings.reading)
    model = load_model(chosen.get("classifier", "default"), quickly=True)
    print(progress_line(0.2, "solving"), flush=True)
    annotation = annotate(recording, model, settings=settings, signer=signer)
    print(progress_line(0.9, "writing"), flush=True)
    channel, vocabulary = annotation.tier, annotation.vocabulary
    tier = label_tier(annotation.segments, annotation.signer.name, channel=channel, vocabulary=vocabulary)
    write_tier_file(chosen["tiers"], tier, with_dependents=(f"{channel}-confidence",))
    print(f"INFO: {annotation}", flush=True)
