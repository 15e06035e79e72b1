"""The formats that signface reads, each declared by its own module.

- `register_format`: declare a reader; the decorator of every reader here, and of yours.
- `supported_formats`: what is declared.
- `format_of`: which of them a file has, by its content.
- `Format`, `FileHead`: a declared format, and the beginning of a file that it is recognised by.

A format is declared on the function that opens its files. That function and `recognise` are all there is to a reader;
`docs/recordings.md` shows a whole one. An installed package may bring formats too, without a script that imports it,
by an entry point of the group `signface.formats` that names the module. Of readers that are equally sure of a file a
script's comes first, then an installed package's, then a shipped one.
"""

from __future__ import annotations

import csv
import importlib
import struct
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Literal, TypeVar

from signface.descriptors import Descriptors
from signface.errors import SignfaceError, SignfaceWarning
from signface.takes.formats.foreign import what_to_export
from signface.takes.formats.text import header_cells
from signface.takes.recording import TakeFile
from signface.takes.take import Take

#: The modules of this folder that declare a format, in the order in which formats are listed.
SHIPPED = tuple(
    f"signface.takes.formats.{name}"
    for name in [
        "c3d",
        "trc",
        "qtm",
        "table",
        "capture_csv",
        "pose",
        "livelink",
        "openface",
        "openface_units",
        "kinect",
        "weights",
    ]
)

#: The group of entry points by which installed packages bring formats.
ENTRY_POINTS = "signface.formats"

#: Bytes at a file's beginning by which it is recognised.
HEAD_BYTES = 65536

#: Opens a file of a format: `open(path, unit=unit)`.
Opener = Callable[..., "Take | TakeFile | Descriptors"]
AnyOpener = TypeVar("AnyOpener", bound=Opener)


@dataclass(frozen=True)
class FileHead:
    """The beginning of a file.

    Parameters
    ----------
    path : Path
        Its ending promises little: files are renamed.
    content : bytes
        The first `HEAD_BYTES` bytes, or all of a shorter file.

    Examples
    --------
    >>> head = FileHead(Path("take.csv"), b"time_s,LBRO_x,LBRO_y,LBRO_z\\n0.0,1,2,3\\n")
    >>> head.lines[1], head.cells[0]
    ('0.0,1,2,3', 'time_s')
    """

    path: Path
    content: bytes

    @cached_property
    def text(self) -> str:
        """The content as text (UTF-8, or UTF-16 with a mark), from its first sign that is no space; "" if binary."""
        encoding = "utf-16" if self.content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
        if encoding != "utf-16" and b"\0" in self.content:
            return ""
        return self.content.decode(encoding, errors="replace").lstrip()

    @cached_property
    def lines(self) -> list[str]:
        """The lines of `text`; none if it is binary. The last one may be cut short."""
        return self.text.splitlines()

    @cached_property
    def cells(self) -> list[str]:
        """The cells of the first line, separated by comma, semicolon or tab; none where it is no header."""
        try:
            return header_cells(self.lines[0])[0] if self.lines else []
        except csv.Error:  # too long a cell to be a header
            return []


@dataclass(frozen=True)
class Format:
    """A format that signface reads; made by `register_format`, whose parameters these are.

    Parameters
    ----------
    open : callable
        `open(path, unit=unit)` gives a `TakeFile`, a `Take` or `Descriptors`.
    """

    name: str
    title: str
    written_by: str
    endings: tuple[str, ...]
    recognise: Callable[[FileHead], float]
    open: Opener
    holds: Literal["markers", "weights"] = "markers"
    chooses_subject: bool = False
    timecode: Callable[[str | PathLike[str]], float] | None = None

    def certainty(self, head: FileHead) -> float:
        """How surely a file is of this format, 0 to 1. What `recognise` stumbles over is no file of the format."""
        try:
            return float(self.recognise(head))
        except (ValueError, LookupError, struct.error):
            return 0.0
        except Exception as error:  # a defect in one reader must not keep others from reading their files
            _warn(f"the reader of {self.title} cannot look at {head.path}", error)
            return 0.0


_formats: dict[str, Format] = {}
_installed_imported = False


def register_format(
    name: str,
    *,
    recognise: Callable[[FileHead], float],
    title: str | None = None,
    written_by: str = "",
    endings: Sequence[str] = (),
    holds: Literal["markers", "weights"] = "markers",
    chooses_subject: bool = False,
    timecode: Callable[[str | PathLike[str]], float] | None = None,
) -> Callable[[AnyOpener], AnyOpener]:
    """Declare that a function opens files of a format; `open_recording` and every command then read them.

    Parameters
    ----------
    name : str
        A short word by which `signface.takes.reading.recognise` names it. A name that is there already is replaced.
    recognise : callable
        `recognise(head)` says how surely a file with this `FileHead` is of the format: 1 (or True) where it bears a
        sign that no other format has, less where it may be another, 0 (or False) where it is not. The surest format
        opens the file; among equals the one declared last, which is a script's rather than an installed package's,
        and that rather than a shipped one.
    title : str, optional
        As errors and lists name it; `name` by default.
    written_by : str
        The programs that write it.
    endings : sequence of str
        The endings (`.c3d`) that its files usually have. They only serve for a better error.
    holds : str
        `markers`, or `weights` where files hold blendshape weights: then `open` gives `Descriptors`.
    chooses_subject : bool
        Whether `open` is also given `subject`: whose weights, of several people in a file. Readers of markers need not:
        they name them `Anna:LBRO` and `Ben:LBRO`.
    timecode : callable, optional
        `timecode(path)` gives the time of the day of the first frame, in seconds.

    Returns
    -------
    callable
        A decorator, which gives back the function it is put on: `open(path, *, unit=None)`. It raises `SignfaceError`
        for what a user can mend, and need not name the file.

    See Also
    --------
    supported_formats : what is declared.
    signface.takes.formats.text : rows of numbers in pieces, for readers of text.

    Examples
    --------
    >>> @register_format("still", recognise=lambda head: head.text.startswith("STILL"))
    ... def open_still(path, *, unit=None):
    ...     x, y, z = (float(word) for word in Path(path).read_text().split()[1:])
    ...     return Take([[[x, y, z]]], ("NOSE",), rate=1.0)
    >>> [format.name for format in supported_formats()][-1]
    'still'
    >>> _ = _formats.pop("still")  # only an example
    """

    def register(open: AnyOpener) -> AnyOpener:
        if open.__module__ not in SHIPPED:
            _import_all()  # so that they do not replace or precede it later
        _formats[name] = Format(
            name, title or name, written_by, tuple(endings), recognise, open, holds, chooses_subject, timecode
        )
        return open

    return register


def _import_all() -> None:
    """Import the shipped modules, then, once, those that installed packages name as formats."""
    global _installed_imported
    for module in SHIPPED:
        importlib.import_module(module)
    if _installed_imported:
        return
    _installed_imported = True  # before they are imported: declaring a format leads here
    from importlib.metadata import entry_points

    for point in entry_points(group=ENTRY_POINTS):
        try:
            importlib.import_module(point.module)
        except Exception as error:  # whatever is wrong with it, other files can be read
            package = point.dist.name if point.dist else point.name
            _warn(f"the reader {point.name} of the installed package {package} cannot be imported", error)


def _warn(problem: str, error: Exception) -> None:
    message = f"{problem} ({type(error).__name__}: {error}): its files are not read"
    warnings.warn(" ".join(message.split()), SignfaceWarning, stacklevel=2)


def supported_formats() -> tuple[Format, ...]:
    """The formats that signface reads: those it ships with, then installed packages', then those declared elsewhere.

    Examples
    --------
    >>> [format.name for format in supported_formats()][:4]
    ['c3d', 'trc', 'qtm', 'table']
    """
    _import_all()
    shipped = {module: number for number, module in enumerate(SHIPPED)}
    return tuple(sorted(_formats.values(), key=lambda format: shipped.get(format.open.__module__, len(shipped))))


def format_of(path: str | PathLike[str], read_as: str | None = None) -> Format:
    """The format of a file, told by its content.

    Parameters
    ----------
    path : path
    read_as : str, optional
        The name of the format wanted, for files that may be read in several ways: `aus` for an OpenFace table that
        holds landmarks and action units.

    Raises
    ------
    SignfaceError
        The file is missing, empty, a folder, unreadable, or of no format that signface reads; or not of the one
        wanted.

    See Also
    --------
    signface.takes.reading.open_recording : open it.
    """
    head = _head(Path(path))
    formats = supported_formats()
    certainties = [(format.certainty(head), number, format) for number, format in enumerate(formats)]
    if read_as is not None:
        wanted = [format for certainty, _, format in certainties if format.name == read_as and certainty > 0]
        if not wanted:
            raise SignfaceError(f"cannot be read as {read_as}", file=path, hint="read it as what it is: leave out --as")
        return wanted[0]
    certainty, _, surest = max(certainties, key=lambda entry: entry[:2])
    if certainty > 0:
        return surest
    if foreign := what_to_export(head.path.suffix):
        raise SignfaceError(foreign[0], file=head.path, hint=foreign[1])
    promised = [format.title for format in formats if head.path.suffix.lower() in format.endings]
    hint = f"signface reads {', '.join(format.title for format in formats)}"
    if promised:
        problem = f"is not what its ending says: no {' or '.join(promised)} file"
        raise SignfaceError(problem, file=head.path, hint=hint)
    raise SignfaceError(
        "is of no format that signface reads",
        file=head.path,
        hint=f"{hint}; a reader of your own must be installed (see docs/recordings.md, Adding a reader)",
    )


def _head(file: Path) -> FileHead:
    """The beginning of a file, or a SignfaceError that says why there is none."""
    if file.is_dir():
        raise SignfaceError("is a folder, not a recording", file=file, hint="name the files in it")
    if not file.exists():
        raise SignfaceError("no such file", file=file)
    if not file.is_file():
        raise SignfaceError("is no regular file", file=file, hint="name a recording")
    try:
        with file.open("rb") as stream:
            content = stream.read(HEAD_BYTES)
    except OSError as error:
        raise SignfaceError(
            f"cannot be read ({error.strerror})", file=file, hint="check that you may read it"
        ) from error
    if not content:
        raise SignfaceError("the file is empty", file=file, hint="export it again")
    return FileHead(file, content)
