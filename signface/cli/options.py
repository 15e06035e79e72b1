"""Arguments that several commands share, and what they stand for."""

from __future__ import annotations

import argparse
import json
import warnings
from collections.abc import Collection, Mapping
from dataclasses import MISSING, Field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from signface.errors import SignfaceError, SignfaceWarning
from signface.settings.base import Settings
from signface.settings.solve import SolveSettings

if TYPE_CHECKING:
    from signface.face.layout import MarkerLayout
    from signface.face.model import FaceModel
    from signface.signer import Signer


Decision = TypeVar("Decision", bound=Settings)


def words(text: str) -> list[str]:
    """The words of a list with commas; for argparse."""
    return [word.strip() for word in text.split(",") if word.strip()]


def neutral_time(text: str) -> float | str:
    """`auto` or a number of seconds; for argparse."""
    if text == "auto":
        return text
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is neither a time in seconds nor auto") from None


def parameters(text: str) -> dict[str, Any]:
    """`NAME=VALUE,...` with numbers, true and false as such; for argparse."""
    values: dict[str, Any] = {}
    for word in words(text):
        name, sign, value = word.partition("=")
        if not sign:
            raise argparse.ArgumentTypeError(f"{word!r} is not NAME=VALUE")
        try:
            values[name.strip()] = json.loads(value)
        except ValueError:
            values[name.strip()] = value.strip()
    return values


#: What a word on the command line becomes, by the kind of a setting.
READERS: dict[Any, Any] = {float: float, int: int, tuple: words, Mapping: parameters, object: neutral_time, str: str}


def add_settings_arguments(
    parser: argparse.ArgumentParser, kind: type[Settings], *, without: Collection[str] = (), title: str | None = None
) -> None:
    """Add every field of a `Settings` as an option, and `--settings` for a laboratory's TOML; see `settings_from`.

    Parameters
    ----------
    parser : ArgumentParser
    kind : type of Settings
    without : collection of str
        Fields that make no sense for this command.
    title : str, optional
        Heading of a group of their own in the help.
    """
    if "--settings" not in parser._option_string_actions:
        parser.add_argument(
            "--settings",
            type=Path,
            metavar="TOML",
            help="a laboratory's settings: [solve], [train], [eaf]",
        )
    group = parser if title is None else parser.add_argument_group(title)
    for item in fields(kind):  # type: ignore[arg-type]
        if item.name in without:
            continue
        about = item.metadata
        flag = about["flag"] or f"--{item.name.replace('_', '-')}"
        if flag in parser._option_string_actions:  # `train --rate` is another's; of a take it is `--take-rate` there
            flag = f"--take-{flag.removeprefix('--')}"
        common: dict[str, Any] = {"dest": f"{kind.TABLE}_{item.name}", "default": argparse.SUPPRESS}
        common["help"] = about["help"] + _default_words(item)
        if about["kind"] is bool:
            if flag.startswith("--keep-"):
                group.add_argument(flag, action="store_const", const=False, **common)
            else:
                group.add_argument(flag, action=argparse.BooleanOptionalAction, **common)
        elif about["bare"] is not None:
            group.add_argument(flag, nargs="?", const=about["bare"], metavar=about["metavar"], **common)
        else:
            # Where a metavar stands for many choices, the settings say what is close to a wrong one.
            common |= {"metavar": about["metavar"]} if about["metavar"] else {"choices": about["choices"] or None}
            group.add_argument(flag, type=READERS[about["kind"]], **common)


def _default_words(item: Field[Any]) -> str:
    default = item.default
    if "(default" in item.metadata["help"] or default is None or default is MISSING or isinstance(default, bool):
        return ""
    return f" (default: {','.join(default) if isinstance(default, tuple) else default})"


def settings_from(arguments: argparse.Namespace, kind: type[Decision], usual: Decision | None = None) -> Decision:
    """The settings that the command line asked for: its options over the laboratory's TOML over what is usual.

    Raises
    ------
    SignfaceError
        The TOML is missing or wrong, or a value is outside its range.
    """
    given = {item.name: f"{kind.TABLE}_{item.name}" for item in fields(kind)}  # type: ignore[arg-type]
    chosen = {name: getattr(arguments, option) for name, option in given.items() if hasattr(arguments, option)}
    base: Any = kind() if usual is None else usual
    if getattr(arguments, "settings", None) is not None:
        from signface.settings.laboratory import Laboratory, read_settings

        laboratory = read_settings(arguments.settings, replace(Laboratory(), **{kind.TABLE: base}))
        base = getattr(laboratory, kind.TABLE)
    return base.changed(**chosen)


def add_solve_arguments(parser: argparse.ArgumentParser) -> None:
    """Add how markers become weights, in two groups; see `settings_from`."""
    plain = ("face", "layout", "neutral", "method", "alpha")
    fine = [item.name for item in fields(SolveSettings) if item.name not in plain]
    add_settings_arguments(parser, SolveSettings, without=fine)
    add_settings_arguments(parser, SolveSettings, without=plain, title="fine points of the solve (docs/solver.md)")


def add_signer_arguments(parser: argparse.ArgumentParser) -> None:
    """Add `--signer-file`; see `signer_from`."""
    parser.add_argument(
        "--signer-file",
        "--signer-bases",
        type=Path,
        metavar="FILE",
        help="what is known of the signer: made by signface calibrate (.csv, .json) or signface corpus signers (.json)",
    )


def signer_from(arguments: argparse.Namespace) -> Signer:
    """The signer that the command line names: `--signer-file`, called `--signer` where the command has that."""
    from signface.signer import Signer

    name = getattr(arguments, "signer", None) or None
    if arguments.signer_file is None:
        return Signer(name or "")
    signer = Signer.read(arguments.signer_file)
    if name and signer.name not in ("", name):
        message = f"{arguments.signer_file} is of {signer.name}, and the tiers will be called after {name}"
        warnings.warn(message, SignfaceWarning, stacklevel=2)
    return replace(signer, name=name) if name else signer


def read_face_and_layout(settings: SolveSettings) -> tuple[FaceModel, MarkerLayout | None]:
    """The face and layout that the settings name; no layout stands for the one that fits the take best."""
    from signface.face.layout_files import read_layout
    from signface.face.reading import read_face

    face = read_face(settings.face)
    return face, None if settings.layout is None else read_layout(settings.layout, face)


def add_clause_argument(parser: argparse.ArgumentParser) -> None:
    """Add the further models of a take."""
    parser.add_argument(
        "--clause",
        action="append",
        default=[],
        metavar="NAME_OR_FILE",
        help="a further model, of any tier, whose segments get a tier of their own; may be given several times",
    )


def output_files(takes: list[Path], output: Path | None, suffix: str) -> list[Path]:
    """Where the results of several takes go.

    One take and an `output` with an ending is that file; otherwise `output` is a folder (the present one when not
    given), and each take is written there under its own stem.

    Raises
    ------
    SignfaceError
        Two takes would be written to the same file, or a single file was named for several takes.
    """
    named = output is not None and output.suffix.lower() == suffix and not output.is_dir()
    if named and len(takes) == 1:
        assert output is not None
        return [output]
    if named or (output is not None and output.is_file()):
        raise SignfaceError(f"one file cannot hold {len(takes)} takes", file=output, hint="name a folder")
    folder = Path() if output is None else output
    files = [folder / f"{take.stem}{suffix}" for take in takes]
    twice = sorted({file.name for file in files if files.count(file) > 1})
    if twice:
        raise SignfaceError(f"several takes would be written to {twice[0]}", hint="annotate them into two folders")
    return files
