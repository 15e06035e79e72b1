"""`signface synth`: make a synthetic corpus."""

from __future__ import annotations

import argparse

from signface.errors import SignfaceError

EXAMPLE = """  signface synth corpora/feel
  signface synth corpora/utterances --signers 3 --seed 7 --kinds EU
  signface synth corpora/other --generator other"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("folder", metavar="FOLDER", help="where to write; new or empty, or made by the same command")
    parser.add_argument("--signers", type=int, metavar="N", help="how many signers (default 2)")
    parser.add_argument("--seed", type=int, metavar="S", help="the same seed gives the same corpus (default 0)")
    parser.add_argument(
        "--kinds",
        metavar="KINDS",
        help="isolated expressions (IE), sequences (SE), utterances (EU), joined by commas (default all)",
    )
    parser.add_argument(
        "--generator",
        choices=("usual", "other"),
        default="usual",
        help="other: other faces, grammar, timing and a tracker's noise (IE, EU), to test on and never to train on",
    )
    parser.add_argument("--mini", action="store_true", help="make the four short takes that ship in corpora/mini")


def run(arguments: argparse.Namespace) -> int:
    """Make the corpus and say what was made."""
    from signface.progress import progress
    from signface.synth.corpus import synthesise

    settings = {key: getattr(arguments, key) for key in ("signers", "seed") if getattr(arguments, key) is not None}
    if arguments.kinds is not None:
        settings["kinds"] = [kind.strip() for kind in arguments.kinds.split(",") if kind.strip()]
    if arguments.mini and settings:
        raise SignfaceError(f"--mini has its own {' and '.join(settings)}", hint="leave them out")
    if arguments.mini and arguments.generator == "other":
        raise SignfaceError("--mini is of the usual generator", hint="leave out --generator or --mini")
    if arguments.generator == "other":
        from signface.synth.other.corpus import synthesise_other

        corpus = synthesise_other(arguments.folder, show=lambda jobs: progress(jobs, "making takes"), **settings)
    else:
        corpus = synthesise(
            arguments.folder, mini=arguments.mini, show=lambda jobs: progress(jobs, "making takes"), **settings
        )
    print(f"{corpus.folder}: {len(corpus)} takes of {len(corpus.signers)} signers, described in takes.csv")
    return 0
