"""Names of markers: whose they are, and what they are called without the name of their subject.

- `stripped`, `folded`: a name without its subject's prefix; and without regard to case and separators.
- `by_subject`, `signers_among`: the wanted markers of each subject, and which subjects are signers.
- `subjects_of`, `of_subject`: the subjects that prefixes name, and the markers of one of them.
- `SeveralSigners`: the error where there are several and none was chosen.
"""

from __future__ import annotations

import re
import shlex
from collections import Counter
from collections.abc import Sequence
from os import PathLike

from signface.errors import SignfaceError

#: A take with fewer than this part of a layout's markers is not a take of that layout.
SMALLEST_MATCH = 1 / 3

_SEPARATOR = re.compile(r"\s*:\s*|[_.\-\s]")


def stripped(label: str) -> str:
    """The label without the subject's prefix: `Anna:LBRO` and `Anna:head:LBRO` are `LBRO`."""
    return label.rpartition(":")[2].strip()


def folded(label: str) -> str:
    """The label as compared when case and separators differ: `L_Brow-1` and `lbrow 1` agree."""
    return re.sub(r"[\s_.\-]+", "", stripped(label)).casefold()


def by_subject(take_labels: Sequence[str], labels: Sequence[str]) -> dict[str, dict[str, str]]:
    """For each subject of a take, which of the wanted labels it has, and under which names.

    A subject is what stands before a marker's name: `Anna:LBRO`, `Anna:head:LBRO`, `Anna_LBRO`. Only `:` separates
    for sure; before `_`, `.`, `-` or a blank stands a subject where what follows is a wanted label with a letter in
    it. Names without a prefix are of the subject "".

    Returns
    -------
    dict of str to dict of str to str
        `{subject: {wanted: name in the take}}`, in the order of the take; subjects without a wanted label are not in
        it.

    Examples
    --------
    >>> by_subject(["Anna:LBRO", "Ben_LBRO", "Anna:r_brow"], ["LBRO", "RBROW"])
    {'Anna': {'LBRO': 'Anna:LBRO', 'RBROW': 'Anna:r_brow'}, 'Ben': {'LBRO': 'Ben_LBRO'}}
    """
    exact = set(labels)
    known: dict[str, str] = {}
    for label in labels:
        known.setdefault(folded(label) or label, label)  # a name of separators only is like no other
    placed = [(name, *_placed(name, exact, known)) for name in take_labels]
    placed = [one for one in placed if one[2]]
    prefixes = [tuple(part.strip() for part in prefix.split(":")) for _, prefix, _, _ in placed if prefix]
    common = _common(prefixes)  # of sequences, too: a session's name before all subjects
    found: dict[str, dict[str, str]] = {}
    surest: dict[tuple[str, str], int] = {}
    for name, prefix, label, doubt in placed:
        parts = tuple(part.strip() for part in prefix.split(":"))
        rest = parts[len(common) :] or parts[-1:]
        subject = rest[0]
        if doubt < surest.get((subject, label), 9):  # an exact name before one of another case
            surest[subject, label] = doubt
            found.setdefault(subject, {})[label] = name
    if len(found) > 1 and common and sum(map(len, found.values())) == len(set().union(*found.values())):
        # One subject whose markers stand in several groups: Anna:head:HEADF, Anna:face:LBRO.
        return {common[-1]: {label: name for group in found.values() for label, name in group.items()}}
    return found


def _common(prefixes: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
    """The parts that all prefixes begin with."""
    alike = 0
    for parts in zip(*prefixes, strict=False):
        if len(set(parts)) > 1:
            break
        alike += 1
    return prefixes[0][:alike] if prefixes else ()


def _placed(name: str, exact: set[str], alike: dict[str, str]) -> tuple[str, str, int]:
    """Prefix, wanted label ("" where there is none) and how doubtful that is, of a marker's name."""
    if name in exact:
        return "", name, 0
    splits = [(name[: match.start()].strip(), match[0], name[match.end() :]) for match in _SEPARATOR.finditer(name)]
    last = name.rpartition(":")
    certain = [split for split in splits if split[1].strip() == ":"]
    for doubt, known in ((1, {label: label for label in exact}), (2, alike)):
        for prefix, _, rest in certain:
            label = known.get(rest.strip() if doubt == 1 else folded(rest))
            if label:
                return prefix, label, doubt
        if not certain and (label := known.get(name.strip() if doubt == 1 else folded(name))):
            return "", label, doubt
    for doubt, known in ((3, {label: label for label in exact}), (4, alike)):
        for prefix, _, rest in splits:
            label = known.get(rest.strip() if doubt == 3 else folded(rest))
            if label and prefix and any(map(str.isalpha, label)):
                return prefix, label, doubt
    return last[0], "", 9


def signers_among(take_labels: Sequence[str], labels: Sequence[str]) -> tuple[str, ...]:
    """The subjects of a take that have as many of a layout's labels as a signer must; in the order of the take.

    Examples
    --------
    >>> signers_among(["Anna:LBRO", "Anna:RBRO", "Ben:LBRO", "Ben:RBRO", "Wand:TIP"], ["LBRO", "RBRO"])
    ('Anna', 'Ben')
    """
    subjects = by_subject(take_labels, labels)
    least = max(min(3, len(labels)), min(SMALLEST_MATCH * len(labels), max(map(len, subjects.values()), default=0) / 2))
    return tuple(subject for subject, found in subjects.items() if len(found) >= least)


class SeveralSigners(SignfaceError):
    """A recording shows several signers, and none was chosen.

    Parameters
    ----------
    problem, file, hint
        As of `SignfaceError`.
    signers : tuple of str
        Who they are, as `--subject` takes them.
    """

    def __init__(
        self,
        problem: str,
        *,
        file: str | PathLike[str] | None = None,
        hint: str | None = None,
        signers: Sequence[str] = (),
    ) -> None:
        super().__init__(problem, file=file, hint=hint)
        self.signers = tuple(signers)

    def at(self, file: str | PathLike[str]) -> SeveralSigners:
        """The same error, naming this file where it names none."""
        if self.file is not None:
            return self
        return SeveralSigners(self.problem, file=file, hint=self.hint, signers=self.signers)

    @classmethod
    def named(cls, signers: Sequence[str], file: str) -> SeveralSigners:
        """The error for these signers."""
        names = ", ".join(signer or "one without a name" for signer in signers)
        first = next((signer for signer in signers if signer), "NAME")
        hint = f"choose one of them: --subject {shlex.quote(first)} (annotate without it annotates them all)"
        return cls(f"shows {len(signers)} signers: {names}", file=file, hint=hint, signers=signers)


def subjects_of(labels: Sequence[str]) -> tuple[str, ...]:
    """The subjects that prefixes name: those before `:`, or else what stands before `_` in three markers or more."""
    certain = [tuple(part.strip() for part in label.split(":")[:-1]) for label in labels if ":" in label]
    common = _common(certain)
    named = [(parts[len(common) :] or parts[-1:])[0] for parts in certain]
    if not named:
        counts = Counter(label.partition("_")[0] for label in labels if "_" in label)
        named = [subject for subject, number in counts.items() if number >= 3]
    return tuple(dict.fromkeys(named))


def of_subject(labels: Sequence[str], subject: str) -> list[int]:
    """Which markers are a subject's: numbers in `labels`. "" are those without a prefix.

    Raises
    ------
    SignfaceError
        None is; the hint says who there is.

    Examples
    --------
    >>> of_subject(["Anna:LBRO", "Ben:LBRO", "anna_CHIN"], "Anna")
    [0]
    """
    for case in (str, str.casefold):
        wanted = case(subject)
        parts = [[case(part.strip()) for part in label.split(":")] for label in labels]
        found = [number for number, own in enumerate(parts) if (wanted in own[:-1] if wanted else len(own) == 1)]
        if not found and wanted:
            found = [n for n, label in enumerate(labels) if re.match(re.escape(wanted) + r"[_.\-\s]", case(label))]
        if found:
            return found
    there = ", ".join(subjects_of(labels)[:12])
    hint = f"its subjects are {there}" if there else "its markers bear no subject's name: leave out --subject"
    raise SignfaceError(f"has no subject called {subject!r}", hint=hint)
