"""`signface train`: a corpus in, a trained classifier out."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from signface.cli.options import add_settings_arguments, add_solve_arguments, settings_from, words
from signface.errors import SignfaceError, counted
from signface.progress import progress
from signface.settings.solve import SolveSettings
from signface.settings.training import TrainingSettings

EXAMPLE = """  signface train corpora/feel -o mine.skops
  signface train corpora/feel -o mine.skops --classifier svm-rbf --kinds IE,SE --signer each
  signface train corpora/lab -o brows.skops --tier brows --vocabulary brows.txt
  signface train corpora/lab -o brows.skops --tier brows --mapping lab.toml
  signface train corpora/feel -o mine.skops --normalise signer --features weights,windows --search"""


def add_tier_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what commands can be told of the tier that was annotated; see `tier_options`."""
    parser.add_argument(
        "--tier", default="affect", metavar="NAME", help="the tier annotated, without @SIGNER (default: affect)"
    )
    parser.add_argument(
        "--vocabulary",
        type=Path,
        metavar="FILE",
        help="its labels: a .txt with one a line, or the .eaf, .etf or .ecv that has them (default: the tier's own)",
    )
    parser.add_argument(
        "--mapping",
        type=Path,
        metavar="FILE",
        help="annotators' tiers and labels are those of this .toml (signface elan map); --tier is then ours",
    )
    parser.add_argument(
        "--sparse",
        action="store_true",
        help="only if what is not annotated was not looked at; the model then never says none",
    )


def tier_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """The options of `solve_corpus` and `check_corpus` that `add_tier_arguments` asks for."""
    vocabulary = None
    if arguments.vocabulary is not None:
        from signface.elan.vocabularies import read_vocabulary

        vocabulary = read_vocabulary(arguments.vocabulary)
    sparse, mapping = arguments.sparse, arguments.mapping
    return {"tier": arguments.tier, "vocabulary": vocabulary, "sparse": sparse, "mapping": mapping}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Fill the parser of this command."""
    parser.add_argument("corpus", type=Path, metavar="CORPUS", help="folder of a corpus")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="MODEL", help="a .skops file")
    parser.add_argument("--kinds", type=words, metavar="IE,SE", help="kinds of takes to train on (default: all)")
    parser.add_argument(
        "--signer",
        default="all",
        metavar="NAME",
        help="one signer, all of them together (default), or each: one classifier a signer, MODEL-NAME.skops",
    )
    add_settings_arguments(parser, TrainingSettings)
    add_tier_arguments(parser)
    add_solve_arguments(parser)


def run(arguments: argparse.Namespace) -> None:
    """Solve the training takes, train, and write one classifier or one for each signer."""
    from signface.corpus.examples import solve_corpus
    from signface.corpus.manifest import read_corpus
    from signface.label.persistence import save_model
    from signface.learn.examples import label_counts
    from signface.learn.training import train, train_each

    output = arguments.output
    if output.suffix.lower() != ".skops":
        raise SignfaceError("the ending of a classifier is .skops", file=output)
    settings, solve = settings_from(arguments, TrainingSettings), settings_from(arguments, SolveSettings)
    whole = read_corpus(arguments.corpus)
    one = None if arguments.signer in ("all", "each") else [arguments.signer]
    corpus = whole.select(kinds=arguments.kinds, signers=one)
    if not len(corpus):
        raise SignfaceError(
            f"the signer {arguments.signer} has no take of the kind {', '.join(arguments.kinds)}",
            file=whole.folder,
            hint="name other kinds or another signer",
        )
    annotated = sum(take.annotation is not None for take in corpus)
    examples = solve_corpus(
        corpus,
        settings=solve,
        **tier_options(arguments),
        progress=lambda items: progress(items, "solving", total=annotated),
    )
    for label, (segments, takes) in label_counts(examples).items():
        print(f"  {label}: {counted(segments, 'segment')} in {counted(takes, 'take')}")
    training = train_each if arguments.signer == "each" else train
    trained = training(examples, settings, solve=solve, corpus=whole.folder.resolve().name, name=output.stem)
    for model in trained.values() if isinstance(trained, dict) else [trained]:
        file = output.with_name(f"{model.name}{output.suffix}")
        save_model(model, file)
        card = model.card
        print(
            f"{file}: {card.classifier}, {counted(len(card.takes), 'take')} ({', '.join(card.kinds)}) of "
            f"{', '.join(card.signers)}, {card.frames} frames, labels {' '.join(card.labels)}"
        )
        for what, score in card.scores.items():
            print(f"  {what}: {score:.2f}")
        if card.parameters:
            print(f"  chosen: {', '.join(f'{key} {value}' for key, value in card.parameters.items())}")
        if card.calibration:
            before, after = card.calibration["ece_before"], card.calibration["ece_after"]
            print(f"  expected calibration error there: {before:.3f}, calibrated {after:.3f}")
        if model.intensity is not None:
            print(f"  intensity: learnt from {model.intensity.n_segments_} segments")
