"""The part of a recording that is asked for: one signer's markers, a stretch of time, on the film's clock.

- `selected`: all that settings say of it; every door that solves goes through it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.marker_names import of_subject
from signface.settings.solve import SolveSettings
from signface.takes.recording import Recording, TakeFile
from signface.takes.take import Take

AnyRecording = TypeVar("AnyRecording", bound="Recording | Descriptors")


def selected(recording: AnyRecording, settings: SolveSettings | None) -> AnyRecording:
    """A recording with the markers of the subject, moved by the offset, between the times of the cut.

    Times of the cut are those of the annotation, after the offset. Each step is a line of the history.

    Parameters
    ----------
    recording : Take, TakeFile or Descriptors
        Weights are one signer's.
    settings : SolveSettings, optional
        Of which `subject`, `offset_s`, `cut_from` and `cut_to` count.

    Raises
    ------
    SignfaceError
        There is no such subject, or no frame lies between these times.

    Examples
    --------
    >>> import signface as sf
    >>> part = selected(sf.datasets.mini_take(), sf.SolveSettings(cut_from="1", cut_to="0:02", offset_s=0.5))
    >>> part.start, part.duration, part.history[-2:]
    (1.0, 1.0, ('0.5 s later, as the take began after its film', 'between 1 and 2 s'))
    """
    if settings is None or not isinstance(recording, (Take, TakeFile, Descriptors)):
        return recording
    chosen: Any = recording
    if settings.subject is not None and not isinstance(recording, Descriptors):
        chosen = _of_subject(recording, settings.subject)
    if settings.offset_s:
        moved = f"{abs(settings.offset_s):g} s {'later' if settings.offset_s > 0 else 'earlier'}"
        note = f"{moved}, as the take began {'after' if settings.offset_s > 0 else 'before'} its film"
        chosen = chosen.changed(note, start=chosen.start + settings.offset_s)
    begin, end = settings.cut_s
    if np.isfinite(begin) or np.isfinite(end):
        chosen = chosen.between(begin, end)
    return chosen


def _of_subject(recording: Take | TakeFile, subject: str) -> Take | TakeFile:
    try:
        columns = of_subject(recording.labels, subject)
    except SignfaceError as error:
        raise error.at(recording.name) from error
    if len(columns) == len(recording.labels):
        return recording
    labels = tuple(recording.labels[column] for column in columns)
    history = (
        *recording.history,
        f"subject {subject or '(without a name)'}: {len(labels)} of {len(recording.labels)} markers",
    )
    if isinstance(recording, Take):
        return replace(recording, positions=recording.positions[:, columns], labels=labels, history=history)
    read = recording.read
    return replace(recording, read=lambda *span: read(*span)[:, columns], labels=labels, history=history)
