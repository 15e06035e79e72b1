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

#: Parts of one marker that are seen at once are nearer than this (mm): else they are two markers.
SAME_MM = 5.0

AnyRecording = TypeVar("AnyRecording", bound="Recording | Descriptors")


def selected(recording: AnyRecording, settings: SolveSettings | None) -> AnyRecording:
    """A recording with the markers of the subject, moved by the offset, between the times of the cut.

    Times of the cut are those of the annotation, after the offset. Each step is a line of the history.

    Parameters
    ----------
    recording : Take, TakeFile or Descriptors
        Weights are one signer's.
    settings : SolveSettings, optional
        Of which `subject`, `join`, `offset_s`, `cut_from` and `cut_to` count.

    Raises
    ------
    SignfaceError
        There is no such subject or marker to join, two parts are seen apart at once, or no frame lies between these
        times.

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
    if settings.join and isinstance(chosen, Descriptors):
        raise SignfaceError("holds weights, not markers", file=chosen.name, hint="leave out --join")
    for rule in settings.join:
        chosen = _joined(chosen, rule)
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


def _joined(recording: Take | TakeFile, rule: str) -> Take | TakeFile:
    """The recording with the parts of one marker under one name, in the place of the first of them."""
    name, _, rest = (word.strip() for word in rule.partition("="))
    parts = [part.strip() for part in rest.split("+")]
    absent = [part for part in parts if part not in recording.labels]
    if absent:
        raise SignfaceError(
            f"has no marker {absent[0]} to join as {name}",
            file=recording.name,
            hint="its markers are listed by: signface take info",
        )
    columns = [recording.labels.index(part) for part in parts]
    kept = [number for number in range(len(recording.labels)) if number not in columns[1:]]
    labels = tuple(name if number == columns[0] else recording.labels[number] for number in kept)
    if len(set(labels)) < len(labels):
        raise SignfaceError(
            f"has a marker {name} that is not among the parts", file=recording.name, hint=f"add +{name}"
        )

    def joined(positions: np.ndarray) -> np.ndarray:
        own = positions[:, columns]
        seen = np.isfinite(own).all(axis=2)
        apart = np.ptp(np.where(seen[..., None], own, own[np.arange(len(own)), seen.argmax(axis=1)][:, None]), axis=1)
        if (seen.any(axis=1) & (np.linalg.norm(apart, axis=1) > SAME_MM)).any():
            raise SignfaceError(
                f"{' and '.join(parts)} are seen at once in different places: two markers, not parts of {name}",
                file=recording.name,
                hint="leave one of them out of --join",
            )
        one = own[np.arange(len(own)), seen.argmax(axis=1)]
        out = positions[:, kept].copy()
        out[:, kept.index(columns[0])] = one
        return out

    history = (*recording.history, f"joined {' and '.join(parts)} as {name}")
    if isinstance(recording, Take):
        return replace(recording, positions=joined(recording.positions), labels=labels, history=history)
    read = recording.read
    return replace(recording, read=lambda *span: joined(read(*span)), labels=labels, history=history)
