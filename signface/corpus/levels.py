"""Where the faces of a corpus's signers rest, from all of their takes.

- `learn_signers`: each signer with the level of all takes, for whoever annotates one take of theirs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from signface.corpus.describing import recipe_of, stored_or_solved
from signface.corpus.manifest import Corpus, TakeEntry
from signface.corpus.origin import Recipe, find_origin, make_recipe
from signface.corpus.signers import find_signer
from signface.corpus.store import open_store
from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.settings.solve import SolveSettings
from signface.signer import Signer


def learn_signers(
    corpus: Corpus,
    settings: SolveSettings | None = None,
    *,
    progress: Callable[[Iterable[TakeEntry]], Iterable[TakeEntry]] = iter,
) -> Iterator[Signer]:
    """Each signer of a corpus with the level of all of their takes; bases stay those of the folder `signers`.

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
    known: dict[tuple[str, str | None], Recipe] = {}
    by_signer: dict[str, list[Descriptors]] = {name: [] for name in corpus.signers}
    errors: dict[str, SignfaceError] = {}
    for entry in progress(corpus):
        try:
            origin = find_origin(entry, corpus.folder, recipe_of(entry, recipe, known))
            by_signer[entry.signer].append(stored_or_solved(entry, origin, store, corpus.folder)[0])
        except SignfaceError as error:
            errors[entry.signer] = error
    for name, takes in by_signer.items():
        if not takes:
            raise errors[name]
        yield find_signer(corpus.folder, name).with_level(takes)
