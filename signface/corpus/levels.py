"""Where the faces of a corpus's signers rest, from all of their takes.

- `learn_signers`: each signer with the rest and level of all takes, for whoever annotates one take of theirs.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from signface.corpus.describing import describe_entry, layout_for, read_entry, recipe_of, stored_or_solved
from signface.corpus.manifest import Corpus, TakeEntry
from signface.corpus.origin import Recipe, find_origin, make_recipe
from signface.corpus.signers import find_signer
from signface.corpus.store import open_store
from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.settings.solve import SolveSettings
from signface.signer import Signer
from signface.signer_level import SignerRest
from signface.solver.signer_rest import signer_rest
from signface.takes.take import Take


def learn_signers(
    corpus: Corpus,
    settings: SolveSettings | None = None,
    *,
    progress: Callable[[Iterable[TakeEntry]], Iterable[TakeEntry]] = iter,
) -> Iterator[Signer]:
    """Each signer of a corpus with the rest and level of all of their takes; bases stay those of the folder `signers`.

    Landmarks have a rest. Markers, which are glued on anew each time, and weights have a level only.

    No annotation is looked at. What the store of the corpus has is taken from there, the rest is solved and put there.

    Parameters
    ----------
    corpus : Corpus
    settings : SolveSettings, optional
    progress : callable, optional
        Wraps the rows, to show how far it is.

    Yields
    ------
    Signer
        To be saved as `signers/NAME.json` in the corpus, where every door finds them.

    Raises
    ------
    SignfaceError
        None of a signer's takes can be solved.

    Examples
    --------
    >>> from signface.corpus.manifest import read_corpus
    >>> from signface.files import bundled_corpus
    >>> [signer.name for signer in learn_signers(read_corpus(bundled_corpus()))]
    ['M1', 'M2']
    """
    store, recipe = open_store(corpus.folder), make_recipe(settings)
    known: dict[tuple[str | None, ...], Recipe] = {}
    errors: dict[str, SignfaceError] = {}
    by_signer: dict[str, list[Descriptors]] = {}
    signers: dict[str, Signer] = {}
    for entry in progress(sorted(corpus, key=lambda entry: entry.signer)):
        name = entry.signer
        if name not in signers:
            mine = [other for other in corpus if other.signer == name]
            signers[name] = replace(find_signer(corpus.folder, name), rest=_rest(mine, recipe, known))
            by_signer[name] = []
        try:
            of_entry = recipe_of(entry, recipe, known)
            if signers[name].rest is None:
                origin = find_origin(entry, corpus.folder, of_entry)
                by_signer[name].append(stored_or_solved(entry, origin, store, corpus.folder)[0])
            else:  # the store knows takes by the rest that the corpus has on disk, which is not this one yet
                by_signer[name].append(describe_entry(entry, of_entry, signers[name]))
        except SignfaceError as error:
            errors[name] = error
    for name in corpus.signers:
        if not by_signer[name]:
            raise errors[name]
        yield signers[name].with_level(by_signer[name])


def _rest(entries: list[TakeEntry], recipe: Recipe, known: dict[tuple[str | None, ...], Recipe]) -> SignerRest | None:
    """The rest of a signer whose takes are of landmarks; None where they are of markers or hold weights."""
    recordings: list[Take] = []
    layout = None
    for entry in entries:
        with contextlib.suppress(SignfaceError):  # said when it is solved
            own = recipe_of(entry, recipe, known)
            recording = read_entry(entry, own)
            if isinstance(recording, Take):
                found = layout_for(own, recording.labels)
                if found.of_landmarks:
                    recordings.append(recording)
                    layout = found
    return None if layout is None else signer_rest(recordings, layout)
