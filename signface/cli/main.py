"""The command `signface`: finds the command's module, runs it, and turns errors into one line.

Each command is a module of this folder with `EXAMPLE` (shown under its help), `add_arguments(parser)` and
`run(arguments)`. Only the module of the command that was asked for is imported, so that help is instant.
"""

from __future__ import annotations

import argparse
import difflib
import importlib
import os
import re
import sys
import warnings
from collections.abc import Sequence
from typing import NoReturn

from signface.compiling import on_compiling
from signface.errors import SignfaceError, SignfaceWarning

#: command: what it does, in a line. The module has the same name.
COMMANDS = {
    "annotate": "annotate recordings: an ELAN file for each take",
    "take": "look at a recording: frames, rate, markers, gaps",
    "solve": "turn a recording into blendshape weights",
    "calibrate": "learn a signer's own bases from a range-of-motion take",
    "segment": "cut weights or a recording into stable segments and transitions",
    "train": "train a classifier on a corpus",
    "evaluate": "measure segmentation and classifiers on a corpus",
    "corpus": "check, solve and annotate a whole corpus; open its descriptors",
    "face": "look at, check, convert and list faces",
    "layout": "show, check and suggest marker layouts",
    "synth": "make a synthetic corpus",
    "elan": "check, map, compare and learn from EAF files; a button inside ELAN",
    "study": "run a perceptual study: films, questionnaire, statistics",
    "demo": "annotate the takes that ship with signface",
}


class Parser(argparse.ArgumentParser):
    """A parser, and those of its subcommands, that says which word was probably meant."""

    def error(self, message: str) -> NoReturn:
        """Leave with status 2."""
        wrong = re.search(r"invalid choice: '([^']*)' \(choose from (.*)\)", message)
        unknown = re.search(r"unrecognized arguments: (--[^ =]+)", message)
        choices = re.findall(r"[^\s,']+", wrong[2]) if wrong else _options(self) if unknown else []
        found = wrong or unknown
        close = difflib.get_close_matches(found[1], choices, n=1) if found else []
        super().error(f"{message}. Did you mean {close[0]}?" if close else message)


def _options(parser: argparse.ArgumentParser) -> list[str]:
    """The options of a parser and of its subcommands."""
    below = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    return [*parser._option_string_actions, *(o for a in below for p in a.choices.values() for o in _options(p))]


def build_parser(command: str | None) -> argparse.ArgumentParser:
    """The parser; only `command` has its arguments filled in."""
    parser = Parser(
        prog="signface",
        description="Annotate the faces of signers: from a recording to tiers in ELAN.",
        epilog="example: signface annotate take.c3d -o take.eaf\n\nsignface COMMAND --help says more of a command.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="store_true", help="show the version and leave")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    for name, summary in COMMANDS.items():
        if name != command:
            commands.add_parser(name, help=summary, add_help=False)
            continue
        module = importlib.import_module(f"signface.cli.{name}")
        own = commands.add_parser(
            name,
            help=summary,
            description=summary[0].upper() + summary[1:] + ".",
            epilog=f"example:\n{module.EXAMPLE}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(own)
        own.set_defaults(run=module.run)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: 0 done, 2 something to mend, 1 a defect of ours."""
    words = list(sys.argv[1:] if argv is None else argv)
    command = next((word for word in words if word in COMMANDS), None)
    parser = build_parser(command)
    warnings.showwarning = _say_warning
    arguments = parser.parse_args(words)
    if arguments.version:
        from importlib.metadata import version

        print(f"signface {version('signface')}")
        return 0
    if arguments.command is None:
        parser.print_help()
        return 0
    on_compiling(_say_why_it_takes_long)
    try:
        return arguments.run(arguments) or 0
    except SignfaceError as error:
        print(f"signface: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("signface: stopped", file=sys.stderr)
        return 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # `signface ... | head` is no defect
        return 0


def _say_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: object = None,
    line: object = None,
) -> None:
    """Warnings of ours as a line each; those of packages are for programmers."""
    if issubclass(category, SignfaceWarning):
        print(f"signface: note: {message}", file=sys.stderr, flush=True)


def _say_why_it_takes_long(once: bool) -> None:
    often = "once" if once else "every time, as no folder can be written to keep it in: set NUMBA_CACHE_DIR to one"
    print(f"signface: preparing its loops for this machine, {often} (a few seconds)", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
