"""Marker labels: making them clean and unique in a reader, and matching them with a layout's.

- `clean_labels`: what a reader does: which points have a name, and unique names for them.
- `match_labels`, `rename_to`: the markers of a layout found in a take, all of one signer.
- `Renaming`: the same as a stage, for any recording.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from pathlib import Path

from signface.errors import SignfaceError
from signface.marker_names import SMALLEST_MATCH, SeveralSigners, by_subject, folded, signers_among, stripped
from signface.takes.recording import Recording
from signface.takes.stages import Block, Stage, View, run
from signface.takes.take import Take

#: Names that tracking software gives to points nobody has labelled: `*12`, `U_3`, `Unlabeled 7`, or nothing at all.
UNLABELLED = re.compile(r"^$|^\*\d*$|^U_?\d+$|^(un(labell?ed|named|identified))[\s_-]*\d*$", re.IGNORECASE)

#: Or else the layout must know half of the take's markers (the 128 contour points of MediaPipe's 468).
KNOWN_MARKERS = 1 / 2


def clean_labels(labels: Sequence[str]) -> tuple[list[int], list[str], list[str]]:
    """Which points of a file are markers, under which unique names.

    Unlabelled points (`*12`) are left out. A repeated label gets a number (`LBRO`, `LBRO~2`): which of the two is
    right cannot be known here, and the first is the one that layouts find.

    Returns
    -------
    (list of int, list of str, list of str)
        Indices of the points kept, their labels, and notes for the take's history.
    """
    bare = [label.strip() for label in labels]
    kept = [index for index, name in enumerate(bare) if not UNLABELLED.match(stripped(name))]
    names: list[str] = []
    taken, repeated = set(bare), set()
    for index in kept:
        name, number = bare[index], 2
        if name in names:
            repeated.add(name)
            while f"{name}~{number}" in taken:
                number += 1
            name = f"{name}~{number}"
            taken.add(name)
        names.append(name)
    notes = []
    if len(kept) < len(bare):
        unlabelled = len(bare) - len(kept)
        notes.append(f"ignored {unlabelled} unlabelled point{'s' * (unlabelled > 1)}")
    if repeated:
        notes.append(f"numbered repeated labels: {', '.join(sorted(repeated)[:5])}")
    return kept, names, notes


def kept_labels(labels: Sequence[str], file: Path, *, what: str = "markers") -> tuple[list[int], list[str], list[str]]:
    """As `clean_labels`, of a file in which something must have a label.

    Raises
    ------
    SignfaceError
        Nothing has one.
    """
    kept, names, notes = clean_labels(labels)
    if not kept:
        raise SignfaceError(f"none of the {what} has a label", file=file, hint="label the markers")
    return kept, names, notes


def match_labels(take_labels: Sequence[str], labels: Sequence[str]) -> dict[str, str]:
    """For each wanted label that the take has, the take's own name for it; all of one subject.

    An exact name wins over one without regard to case, spaces and `_`, `-`, `.`. Of several subjects (`by_subject`) the
    one with the most matches is taken, never markers of two; names without a subject go with a single one.

    Returns
    -------
    dict of str to str
        `{wanted: name in the take}`, in the order of `labels`.

    See Also
    --------
    rename_to : the take with these markers under the wanted names.
    signers_among : whether there are several signers.

    Examples
    --------
    >>> match_labels(["Anna:LBRO", "Anna:r_brow", "Ben:LBRO", "Ben:CHIN"], ["LBRO", "RBROW", "CHIN"])
    {'LBRO': 'Anna:LBRO', 'RBROW': 'Anna:r_brow'}
    """
    subjects = by_subject(take_labels, labels)
    if not subjects:
        return {}
    most = max(subjects, key=lambda subject: len(subjects[subject]))  # the first of several
    matches = dict(subjects[most])
    if set(subjects) == {most, ""}:
        matches = {**subjects[""], **matches}
    return {label: matches[label] for label in labels if label in matches}


def close_names(missing: Sequence[str], spare: Sequence[str], most: int = 5) -> list[str]:
    """Pairs "LBRO1 (close: LBRW1)" for the first few missing labels, with the take's spare names that resemble them."""
    alike = {folded(name): name for name in spare}
    pairs = []
    for label in missing[:most]:
        close = difflib.get_close_matches(folded(label), alike, n=2, cutoff=0.6)
        pairs.append(f"{label} (close: {', '.join(alike[name] for name in close)})" if close else label)
    if len(missing) > most:
        pairs.append(f"and {len(missing) - most} more")
    return pairs


def rename_to(take: Take, labels: Sequence[str]) -> Take:
    """The take with only the markers of `labels`, under those names and in that order.

    Markers that the take does not have are left out (the solver works with those that remain) and named in the
    history, with the names in the take that resemble them.

    Parameters
    ----------
    take : Take
    labels : sequence of str
        A layout's labels.

    Raises
    ------
    SignfaceError
        Fewer than three of the labels are in the take, or fewer than a third of them and fewer than half of the
        take's own: it was recorded with another set.

    Examples
    --------
    >>> import signface as sf
    >>> take = sf.datasets.mini_take()
    >>> layout = sf.choose_layout(take.labels, sf.read_face())
    >>> rename_to(take, layout.labels).labels == take.labels
    True
    """
    return run(take, Renaming(labels))


class Renaming(Stage):
    """The markers of a layout, under its names and in its order; see `rename_to`."""

    def __init__(self, labels: Sequence[str]) -> None:
        self._labels = list(labels)

    def learn(self, view: View) -> None:
        """Which markers of the recording are meant."""
        matches, self._note = _find_labels(view.recording, self._labels)
        self._names = tuple(matches)
        self._columns = [view.recording.labels.index(name) for name in matches.values()]

    def labels_of(self, labels: tuple[str, ...]) -> tuple[str, ...]:
        """Those of the layout's labels that the recording has."""
        return self._names

    def apply(self, block: Block) -> Block:
        """The block with these markers only."""
        return block.changed(block.positions[:, self._columns])

    @property
    def note(self) -> str:
        """Which markers were found, under other names, or not."""
        return self._note


def _find_labels(take: Recording, labels: list[str]) -> tuple[dict[str, str], str]:
    """For each of `labels` that a recording has, its name there, and a note for the history; raises as `rename_to`."""
    signers = signers_among(take.labels, labels)
    if len(signers) > 1:
        raise SeveralSigners.named(signers, take.name)
    twice = {label.rpartition("~")[0] for label in take.labels if re.search(r"~\d+$", label)}
    if len(match_labels(sorted(twice), labels)) >= max(3, SMALLEST_MATCH * len(labels)):
        raise SignfaceError(
            f"has two markers each of the names {', '.join(sorted(twice)[:3])} ...: two signers without names",
            file=take.name,
            hint="give the subjects names where it was recorded (Anna:LBROI), or export one signer to a file",
        )
    matches = match_labels(take.labels, labels)
    missing = [label for label in labels if label not in matches]
    spare = [label for label in take.labels if label not in set(matches.values())]
    enough = min(SMALLEST_MATCH * len(labels), KNOWN_MARKERS * len(take.labels))
    if len(matches) < max(min(3, len(labels)), enough):
        names = ", ".join(spare[:5]) + (" ..." if len(spare) > 5 else "")
        raise SignfaceError(
            f"only {len(matches)} of the layout's {len(labels)} markers are in the take: "
            f"no {', '.join(close_names(missing, spare))}; the take also has {names or 'nothing else'}",
            file=take.name,
            hint="choose the layout of this marker set or rename the markers",
        )
    notes = [f"rename_to {len(matches)} of {len(labels)} markers"]
    renamed = [f"{name} is {label}" for label, name in matches.items() if name != label and stripped(name) != label]
    if renamed:
        notes.append(f"renamed: {', '.join(renamed[:5])}{' ...' * (len(renamed) > 5)}")
    if missing:
        notes.append(f"missing: {', '.join(close_names(missing, spare))}")
    used = set(matches.values())
    groups = by_subject(take.labels, labels)
    others = [
        f"{len(found)} of {subject or 'no subject'}"
        for subject, found in groups.items()
        if used.isdisjoint(found.values())
    ]
    if others:
        notes.append(f"left out markers of other subjects: {', '.join(others[:5])}")
    if spare:
        notes.append(f"not in the layout: {', '.join(spare[:5])}{' ...' * (len(spare) > 5)}")
    return matches, "; ".join(notes)
