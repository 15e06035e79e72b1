"""Reading a recording, whatever its format.

- `open_recording`: any file this room reads: a `TakeFile` or `Take` (markers), or `Descriptors` (weights).
- `read_recording`: the same, all of it in memory.
- `read_take`: the same, when only markers will do.
- `recognise`: which format a file has, found from its content.
"""

from __future__ import annotations

import csv
import struct
from os import PathLike
from pathlib import Path

from signface.descriptors import Descriptors, is_weights_table, read_weights
from signface.errors import SignfaceError
from signface.takes.recording import TakeFile
from signface.takes.take import Take

FORMATS = {
    "c3d": "C3D",
    "trc": "TRC",
    "qtm": "Qualisys TSV",
    "table": "CSV of markers",
    "pose": ".pose",
    "livelink": "Live Link Face CSV",
    "weights": "weights",
}

#: What the endings promise; the content decides.
ENDINGS = {".c3d": "c3d", ".trc": "trc", ".tsv": "qtm", ".csv": "table", ".pose": "pose", ".parquet": "weights"}

READABLE = "C3D, TRC, Qualisys TSV, CSV, .pose and Live Link Face CSV"


def _opening(file: Path, length: int = 65536) -> bytes:
    """The first bytes of a file, or a SignfaceError that says why there are none."""
    if file.is_dir():
        raise SignfaceError("is a folder, not a recording", file=file, hint="name the files in it")
    if not file.exists():
        raise SignfaceError("no such file", file=file)
    if not file.is_file():
        raise SignfaceError("is no regular file", file=file, hint="name a recording")
    try:
        with file.open("rb") as stream:
            opening = stream.read(length)
    except OSError as error:
        raise SignfaceError(
            f"cannot be read ({error.strerror})", file=file, hint="check that you may read it"
        ) from error
    if not opening:
        raise SignfaceError("the file is empty", file=file, hint="export it again")
    return opening


def _recognise_text(opening: bytes) -> str | None:
    encoding = "utf-16" if opening[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    if encoding != "utf-16" and b"\0" in opening:
        return None
    text = opening.decode(encoding, errors="replace").lstrip()
    lines = text.splitlines()
    if not lines:
        return None
    first = lines[0]
    if first.startswith("PathFileType"):
        return "trc"
    if any(line.startswith(("NO_OF_MARKERS\t", "MARKER_NAMES\t")) for line in lines[:40]):
        return "qtm"
    from signface.takes.formats.table import header_cells

    try:
        cells, _ = header_cells(first)
    except csv.Error:  # too long a cell to be a header
        return None
    if [cell.lower() for cell in cells[:2]] == ["timecode", "blendshapecount"]:
        return "livelink"
    if is_weights_table(cells):
        return "weights"
    coordinates = [cell.lower().rpartition("_")[2] in ("x", "y", "z") for cell in cells[1:4]]
    return "table" if len(coordinates) == 3 and all(coordinates) else None


def recognise(path: str | PathLike[str]) -> str:
    """The format of a file (a key of `FORMATS`), found from its content.

    Raises
    ------
    SignfaceError
        The file is missing, empty, a folder, unreadable, or of no format that signface reads.
    """
    file = Path(path)
    opening = _opening(file)
    if len(opening) >= 2 and opening[1] == 0x50 and 2 <= opening[0] < 32 and (len(opening) < 4 or b"\0" in opening):
        return "c3d"
    if opening[:4] == b"PAR1":
        return "weights"
    if len(opening) >= 10:
        (version,) = struct.unpack("<f", opening[:4])
        if round(version, 3) in (0.1, 0.2) or (version == 0 and file.suffix.lower() == ".pose"):
            return "pose"
    found = _recognise_text(opening)
    if found is not None:
        return found
    promised = ENDINGS.get(file.suffix.lower())
    problem = (
        "is of no format that signface reads"
        if promised is None
        else f"is not what its ending says: no {FORMATS[promised]} file"
    )
    raise SignfaceError(problem, file=file, hint=f"signface reads {READABLE}")


def open_recording(path: str | PathLike[str], *, unit: str | None = None) -> Take | TakeFile | Descriptors:
    """Open a recording of any known format; the content says which it is, not the ending.

    Frames of C3D, TRC, TSV and CSV files are read in pieces when they are asked for. A `.pose` file cannot be: it is
    compressed of one piece in memory, and comes as a `Take`.

    Parameters
    ----------
    path : path
    unit : str, optional
        Unit of length of the file ("mm", "m", ...), where it says none or a wrong one.

    Returns
    -------
    Take, TakeFile or Descriptors
        Descriptors for weights: Live Link Face CSV, and the files that `signface solve` writes.

    Raises
    ------
    SignfaceError
        The file cannot be read as a recording; the message says why.

    See Also
    --------
    signface.read_take : all of it in memory.

    Examples
    --------
    >>> import signface as sf
    >>> recording = sf.open_recording(sf.datasets.mini_file())
    >>> recording.n_frames, recording.frames(0, 100).shape
    (1184, (100, 46, 3))
    """
    file = Path(path)
    kind = recognise(file)
    try:
        if kind == "c3d":
            from signface.takes.formats.c3d import open_c3d

            return open_c3d(file, unit=unit)
        if kind == "trc":
            from signface.takes.formats.trc import open_trc

            return open_trc(file, unit=unit)
        if kind == "qtm":
            from signface.takes.formats.qtm import open_qtm

            return open_qtm(file, unit=unit)
        if kind == "pose":
            from signface.takes.formats.pose import read_pose

            return read_pose(file, unit=unit)
        if kind == "table":
            from signface.takes.formats.table import open_table

            return open_table(file, unit=unit)
        if kind == "livelink":
            from signface.takes.formats.livelink import read_livelink

            return read_livelink(file)
        return read_weights(file)
    except SignfaceError as error:
        raise _named(error, file) from error


def read_recording(path: str | PathLike[str], *, unit: str | None = None) -> Take | Descriptors:
    """Read all of a recording into memory; parameters and errors are those of `open_recording`.

    Returns
    -------
    Take or Descriptors

    See Also
    --------
    signface.read_take : markers only.

    Examples
    --------
    >>> import signface as sf
    >>> recording = sf.read_recording(sf.datasets.mini_file())
    >>> type(recording).__name__, recording.duration
    ('Take', 5.92)
    """
    recording = open_recording(path, unit=unit)
    if not isinstance(recording, TakeFile):
        return recording
    try:
        return recording.whole()
    except SignfaceError as error:
        raise _named(error, Path(path)) from error


def _named(error: SignfaceError, file: Path) -> SignfaceError:
    """The error with the file in it, where it is the error of an object."""
    return error if error.file is not None else SignfaceError(error.problem, file=file, hint=error.hint)


def read_take(path: str | PathLike[str], *, unit: str | None = None) -> Take:
    """Read a recording that holds markers.

    Raises
    ------
    SignfaceError
        As `read_recording`, or the file holds weights.

    See Also
    --------
    signface.read_recording : also what a phone captured.
    signface.open_recording : without reading it all into memory.

    Examples
    --------
    >>> import signface as sf
    >>> take = sf.read_take(sf.datasets.mini_file("M1_IE_J"))
    >>> take.n_frames, take.rate, take.labels[:3]
    (2149, 200.0, ('LBROI', 'RBROI', 'LBROM'))
    """
    recording = read_recording(path, unit=unit)
    if isinstance(recording, Descriptors):
        raise SignfaceError("holds weights, not markers", file=path, hint="give a recording of markers")
    return recording
