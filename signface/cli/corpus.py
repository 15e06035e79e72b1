"""`signface corpus`: check a corpus, solve and annotate all of it, look into its descriptors."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from pathlib import Path

from signface.cli.options import add_clause_argument, add_settings_arguments, add_solve_arguments, settings_from
from signface.cli.train import add_tier_arguments, tier_options
from signface.errors import SignfaceError, counted
from signface.progress import progress
from signface.settings.eaf import EafOptions
from signface.settings.solve import SolveSettings

EXAMPLE = """  signface corpus check corpora/feel
  signface corpus check corpora/lab --tier brows --vocabulary brows.txt
  signface corpus run corpora/feel
  signface corpus run corpora/feel --channels --template lab.etf
  signface corpus run corpora/feel --scheduler tcp://10.0.0.1:8786
  signface corpus info corpora/feel
  signface corpus query corpora/feel "SELECT signer, avg(jawOpen) FROM descriptors GROUP BY signer" """


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Fill the parser of this command."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)

    check = actions.add_parser("check", help="find every problem of a corpus at once")
    _add_corpus(check)
    check.add_argument("--all", action="store_true", help="tell equal problems of several takes one by one")
    _add_workers(check)
    add_tier_arguments(check)
    add_solve_arguments(check)

    run_ = actions.add_parser("run", help="solve and annotate every take; goes on where it was stopped")
    _add_corpus(run_)
    run_.add_argument(
        "-o", "--output", type=Path, metavar="FOLDER", help="for the .eaf files and logs (default: CORPUS/annotated)"
    )
    _add_workers(run_)
    run_.add_argument(
        "--scheduler", metavar="ADDRESS", help="run on a Dask cluster that sees the same files (tcp://HOST:8786)"
    )
    add_solve_arguments(run_)
    run_.add_argument(
        "--classifier", default="default", metavar="NAME_OR_FILE", help="a shipped classifier or a .skops file"
    )
    add_clause_argument(run_)
    add_settings_arguments(run_, EafOptions)

    signers = actions.add_parser(
        "signers", help="learn where each signer's face rests, from all of their takes: CORPUS/signers/NAME.json"
    )
    _add_corpus(signers)
    signers.add_argument("-o", "--output", type=Path, metavar="FOLDER", help="default: CORPUS/signers")
    add_solve_arguments(signers)

    info = actions.add_parser("info", help="what is in a corpus and in its store, and how to open it")
    _add_corpus(info)

    query = actions.add_parser("query", help="ask the stored descriptors with SQL; csv on standard output")
    _add_corpus(query)
    query.add_argument("sql", metavar="SQL", help="the table is called descriptors")
    query.add_argument("--recipe", metavar="NAME", help="which descriptors, where there are several (corpus info)")


def _add_corpus(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("corpus", type=Path, metavar="CORPUS", help="folder of a corpus")


def _add_workers(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--workers", type=_count, metavar="N", help="takes at a time (default: one for each core)")


def _count(text: str) -> int:
    """A number from 1; for argparse."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of processes")
    return int(text)


def run(arguments: argparse.Namespace) -> int:
    """Do what was asked for."""
    return {"check": check, "run": run_all, "signers": learn, "info": info, "query": query}[arguments.action](arguments)


def check(arguments: argparse.Namespace) -> int:
    """Print every problem, equal ones on one line."""
    from signface.corpus.checking import check_corpus, grouped

    found = check_corpus(
        arguments.corpus,
        settings=settings_from(arguments, SolveSettings),
        **tier_options(arguments),
        workers=arguments.workers,
        progress=lambda items, total: progress(items, "checking", total=total),
    )
    for problem in found.problems if arguments.all else grouped(found.problems):
        print(f"signface: {problem}", file=sys.stderr)
    count = len(found.problems)
    print(f"{found.summary}: {counted(count, 'problem') if count else 'no problem'}")
    return 2 if count else 0


def run_all(arguments: argparse.Namespace) -> int:
    """Run, show how far it is, and say at the end what became of the takes."""
    from signface.corpus.jobs import BEFORE, CORRECTED, DONE, FAILED, LOGS
    from signface.corpus.manifest import read_corpus
    from signface.corpus.running import ANNOTATED, run_corpus

    corpus = read_corpus(arguments.corpus)
    output = arguments.output or corpus.folder / ANNOTATED
    outcomes = run_corpus(
        corpus,
        output=output,
        settings=settings_from(arguments, SolveSettings),
        classifier=arguments.classifier,
        clauses=arguments.clause,
        workers=arguments.workers,
        scheduler=arguments.scheduler,
        options=settings_from(arguments, EafOptions),
    )
    count = dict.fromkeys((DONE, BEFORE, CORRECTED, FAILED), 0)
    solved = 0
    wrong, kept = [], []
    for outcome in progress(outcomes, "annotating", total=len(corpus)):
        count[outcome.state] += 1
        solved += outcome.solved
        if outcome.state == FAILED:
            wrong.append(outcome)
        elif outcome.state == CORRECTED:
            kept.append(outcome)
    print(
        f"{len(corpus)} takes: {count[DONE]} annotated ({solved} solved), {count[BEFORE]} done before, "
        f"{count[CORRECTED]} corrected by hand and left alone, {count[FAILED]} failed"
    )
    print(f"annotations: {output}\nlogs: {output / LOGS}")
    for outcome in sorted(kept, key=lambda outcome: outcome.take):
        print(outcome.message)
    for outcome in sorted(wrong, key=lambda outcome: outcome.take):
        print(f"signface: {outcome.message}", file=sys.stderr)
    return 2 if wrong else 0


def learn(arguments: argparse.Namespace) -> int:
    """Write what is known of each signer, with the level of all of their takes."""
    from signface.corpus.levels import learn_signers
    from signface.corpus.manifest import read_corpus
    from signface.corpus.signers import SIGNERS

    corpus = read_corpus(arguments.corpus)
    output = arguments.output or corpus.folder / SIGNERS
    takes = partial(progress, what="solving", total=len(corpus))
    for signer in learn_signers(corpus, settings_from(arguments, SolveSettings), progress=takes):
        file = signer.save(output / f"{signer.name}.json")
        bases = "the avatar's bases" if signer.bases is None else f"{len(set(signer.bases.bases))} bases of their own"
        rest = "" if signer.rest is None else f"rest of {counted(signer.rest.takes, 'take')}, "
        print(f"{file}: {bases}, {rest}level of all takes")
    return 0


def info(arguments: argparse.Namespace) -> int:
    """Print takes by signer and kind, and each recipe of the store with the line that opens it."""
    from collections import Counter

    from signface.corpus.manifest import read_corpus
    from signface.corpus.origin import SOLVING_CODE, code_digest
    from signface.corpus.store import DescriptorStore, read_provenance, stored_files

    corpus = read_corpus(arguments.corpus)
    print(f"{corpus.folder}: {len(corpus)} takes, {sum(take.annotation is not None for take in corpus)} annotated")
    for (signer, kind), number in sorted(Counter((take.signer, take.kind) for take in corpus).items()):
        print(f"  {signer} {kind}: {number}")
    store = DescriptorStore(corpus.folder)
    if not store.recipes():
        print("no descriptors are stored yet: signface corpus run, train and evaluate store what they solve")
    for recipe in store.recipes():
        files = list(stored_files(recipe))
        size = sum(file.stat().st_size for file in files) / 1e6
        current = bool(files) and (
            read_provenance(files[0])["origin"]["recipe"]["solver"] == code_digest(*SOLVING_CODE)
        )
        note = "" if current else ", of another version of signface: it may be deleted"
        print(f"{recipe}: {len(files)} takes, {size:.1f} MB{note}")
        print(f'  pandas: pandas.read_parquet("{recipe}")')
        print(f"  DuckDB: duckdb.sql(\"FROM '{recipe}/**/*.parquet'\")")
    return 0


def query(arguments: argparse.Namespace) -> int:
    """Print the answer of a query as csv."""
    from signface.corpus.manifest import read_corpus
    from signface.corpus.store import DescriptorStore

    if not arguments.sql.strip():
        raise SignfaceError("the query is empty")
    folder = read_corpus(arguments.corpus).folder
    answer = DescriptorStore(folder).query(arguments.sql, arguments.recipe)
    answer.to_csv(sys.stdout, index=False)
    return 0
