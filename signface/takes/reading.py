"""Reading a recording, whatever its format.

- `open_recording`: any file of a supported format: a `TakeFile` or `Take` (markers), or `Descriptors` (weights).
- `read_recording`: the same, all of it in memory.
- `read_take`: the same, when only markers will do.
- `recognise`: which format a file has, found from its content.

The formats are those of `signface.takes.formats.registry`, which also says how to add one.
"""

from __future__ import annotations

import inspect
import math
from dataclasses import replace
from os import PathLike
from typing import Any

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.settings.solve import SolveSettings
from signface.takes.formats.registry import format_of
from signface.takes.recording import TakeFile
from signface.takes.selecting import selected
from signface.takes.take import Take
from signface.timecode import seconds_apart, seconds_of_timecode


def recognise(path: str | PathLike[str]) -> str:
    """The name of a file's format, found from its content.

    Raises
    ------
    SignfaceError
        The file is missing, empty, a folder, unreadable, or of no format that signface reads.

    See Also
    --------
    signface.takes.formats.registry.supported_formats : all of them.

    Examples
    --------
    >>> import signface as sf
    >>> recognise(sf.datasets.mini_file())
    'c3d'
    """
    return format_of(path).name


def open_recording(
    path: str | PathLike[str],
    *,
    unit: str | None = None,
    rate: float | None = None,
    start: float | None = None,
    read_as: str | None = None,
    subject: str | None = None,
    film_timecode: str | None = None,
) -> Take | TakeFile | Descriptors:
    """Open a recording of any supported format; the content says which it is, not the ending.

    Frames of C3D, TRC, TSV and CSV files are read in pieces when they are asked for. A `.pose` file cannot be: it is
    compressed of one piece in memory, and comes as a `Take`.

    Parameters
    ----------
    path : path
    unit : str, optional
        Unit of length of the file ("mm", "m", ...), where it says none or a wrong one.
    rate : float, optional
        Frames per second (Hz), where it says none or a wrong one: every row is then a frame, whatever its time.
    start : float, optional
        Time of the first frame (s), where the file says another.
    read_as : str, optional
        `aus`: the action units of an OpenFace table that holds landmarks too.
    subject : str, optional
        Whose markers, or weights, where the file holds those of several people; `Anna` of markers `Anna:LBROI`.
    film_timecode : str, optional
        The timecode of the first frame of the film (`signface.timecode.seconds_of_timecode`): the recording starts
        where its own timecode says. Only where the file has one.

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
    signface.takes.formats.registry.register_format : add a format.

    Examples
    --------
    >>> import signface as sf
    >>> recording = sf.open_recording(sf.datasets.mini_file())
    >>> recording.n_frames, recording.frames(0, 100).shape
    (1184, (100, 46, 3))
    """
    try:
        kind = format_of(path, read_as)
        options: dict[str, Any] = {"subject": subject} if kind.chooses_subject else {}
        if rate is not None and "rate" in inspect.signature(kind.open).parameters:
            options["rate"] = rate
        recording = _retimed(kind.open(path, unit=unit, **options), rate, start)
        if subject is not None and not kind.chooses_subject:
            if isinstance(recording, Descriptors):
                raise SignfaceError("holds weights of one person, who has no name", hint="leave out --subject")
            recording = selected(recording, SolveSettings(subject=subject))
        if film_timecode is None:
            return recording
        if kind.timecode is None:
            raise SignfaceError(
                f"{kind.title} files have no timecode", hint="say when the take began: --offset SECONDS"
            )
        start = seconds_apart(kind.timecode(path), seconds_of_timecode(film_timecode))
        return recording.changed(
            f"start at {start:.3f} s by its timecode, the film's being {film_timecode}", start=start
        )
    except SignfaceError as error:
        raise error.at(path) from error


def _retimed(
    recording: Take | TakeFile | Descriptors, rate: float | None, start: float | None
) -> Take | TakeFile | Descriptors:
    """The recording at the rate and from the start that are given."""
    history = recording.history
    if rate is not None:
        if not 0 < rate < math.inf:
            raise SignfaceError(f"the rate must be positive, not {rate:g}", hint="give its frames per second")
        history = (*history, f"rate {rate:g} Hz (given)")
    if start is not None:
        if not math.isfinite(start):
            raise SignfaceError(f"the start is no time: {start}", hint="give seconds")
        history = (*history, f"start {start:g} s (given)")
    if history == recording.history:
        return recording
    rate, start = recording.rate if rate is None else rate, recording.start if start is None else start
    return replace(recording, rate=rate, start=start, history=history)


def read_recording(
    path: str | PathLike[str],
    *,
    unit: str | None = None,
    rate: float | None = None,
    start: float | None = None,
    read_as: str | None = None,
    subject: str | None = None,
    film_timecode: str | None = None,
) -> Take | Descriptors:
    """Read all of a recording into memory; parameters and errors are those of `open_recording`.

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
    recording = open_recording(
        path, unit=unit, rate=rate, start=start, read_as=read_as, subject=subject, film_timecode=film_timecode
    )
    if not isinstance(recording, TakeFile):
        return recording
    try:
        return recording.whole()
    except SignfaceError as error:
        raise error.at(path) from error


def read_take(
    path: str | PathLike[str],
    *,
    unit: str | None = None,
    rate: float | None = None,
    start: float | None = None,
    subject: str | None = None,
) -> Take:
    """Read a recording that holds markers; of one `subject`, where it holds those of several.

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
    recording = read_recording(path, unit=unit, rate=rate, start=start, subject=subject)
    if isinstance(recording, Descriptors):
        raise SignfaceError("holds weights, not markers", file=path, hint="give a recording of markers")
    return recording
