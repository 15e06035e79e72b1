"""What is evaluated where nothing is named: it follows from the takes at hand, before any of them is solved.

- `usual_kinds`: the kinds trained on and tested.
- `usual_protocols`: the protocols that the takes suffice for.
- `Row`: what is known of a take without solving it.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from typing import Protocol

from signface.errors import SignfaceError, SignfaceWarning
from signface.evaluation.protocol import PROTOCOLS, TURNS_HINT

#: Kinds of takes trained on and tested, as in the thesis.
TRAIN_KINDS, TEST_KINDS = ("IE", "SE"), ("EU",)


class Row(Protocol):
    """A row of a manifest, or an `Example`."""

    @property
    def signer(self) -> str:
        """Who signs."""

    @property
    def kind(self) -> str:
        """The kind of the take."""

    @property
    def sentence(self) -> str | None:
        """What is signed, where that is known."""


def usual_kinds(
    kinds: Iterable[str], train_kinds: Sequence[str] | None = None, test_kinds: Sequence[str] | None = None
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Kinds to train on and to test: those named, else those of the thesis.

    Where none is named and no take is of the thesis's kinds, both are all kinds that there are, and a `SignfaceWarning`
    says so.

    Parameters
    ----------
    kinds : iterable of str
        Those of the takes at hand.
    train_kinds, test_kinds : sequence of str, optional
        Those named.

    Examples
    --------
    >>> usual_kinds(["EU", "IE"])
    (('IE', 'SE'), ('EU',))
    """
    present = tuple(sorted(set(kinds)))
    if train_kinds is None and test_kinds is None and present and not {*TRAIN_KINDS, *TEST_KINDS} & {*present}:
        note = f"no take is of the kind {', '.join((*TRAIN_KINDS, *TEST_KINDS))}: trained on and tested in turns is "
        warnings.warn(note + f"all there is, {', '.join(present)}", SignfaceWarning, stacklevel=2)
        return present, present
    return (
        TRAIN_KINDS if train_kinds is None else tuple(train_kinds),
        TEST_KINDS if test_kinds is None else tuple(test_kinds),
    )


def usual_protocols(
    takes: Iterable[Row],
    protocols: Sequence[str] | None = None,
    *,
    train_kinds: Sequence[str],
    test_kinds: Sequence[str],
) -> list[str]:
    """The protocols named, else those that the takes suffice for; rows of a manifest are enough to know.

    `across` needs two signers. `within` needs two takes (or sentences) of each signer where it tests in turns; where it
    is not named and `across` remains, it is left out, and a `SignfaceWarning` says so.

    Raises
    ------
    SignfaceError
        A signer has too few takes for turns, and no other protocol remains.

    Examples
    --------
    >>> import signface as sf
    >>> usual_protocols(sf.datasets.mini_corpus(), train_kinds=["IE", "SE"], test_kinds=["EU"])
    ['within', 'across']
    """
    takes = list(takes)
    signers = sorted({take.signer for take in takes})
    chosen = list(protocols or (PROTOCOLS if len(signers) > 1 else ["within"]))
    if "within" not in chosen or not {*train_kinds} & {*test_kinds}:
        return chosen
    for signer in signers:
        tested = [take for take in takes if take.signer == signer and take.kind in test_kinds]
        once = len({take.sentence or number for number, take in enumerate(tested)}) < 2
        if not once or not any(take.kind in train_kinds for take in tested):
            continue
        error = SignfaceError(f"the signer {signer} has too few takes to test in turns", hint=TURNS_HINT)
        if protocols is not None or len(chosen) < 2:
            raise error
        note = f"{error.problem}: the protocol within is left out"
        warnings.warn(note, SignfaceWarning, stacklevel=2)
        return [protocol for protocol in chosen if protocol != "within"]
    return chosen
