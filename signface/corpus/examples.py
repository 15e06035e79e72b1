"""The takes of a corpus, solved, with their reference annotations: what training and evaluation work on.

- `solve_examples`: one `Example` for each annotated take.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from signface.corpus.describing import recipe_of, stored_or_solved
from signface.corpus.manifest import Corpus, TakeEntry
from signface.corpus.origin import Origin, Recipe, find_origin, make_recipe
from signface.corpus.store import DescriptorStore, open_store
from signface.errors import SignfaceError
from signface.learn.examples import Example
from signface.settings.solve import SolveSettings

#: Takes solved at the same time.
WORKERS = 2


def solve_examples(
    corpus: Corpus,
    *,
    settings: SolveSettings | None = None,
    workers: int = WORKERS,
    progress: Callable[[Iterable[Example]], Iterable[Example]] = iter,
) -> list[Example]:
    """Descriptors of the annotated takes of a corpus, with their reference annotations.

    What the store of the corpus has is taken from there; the rest is solved, several takes at a time, and put there.

    Parameters
    ----------
    corpus : Corpus
        Takes without an annotation are left out.
    settings : SolveSettings, optional
        How takes are solved; rows that name a face, a layout or a neutral frame have their own, and signers with a
        file in the folder `signers` their own bases.
    workers : int
        Takes solved at the same time, each in a process of its own.
    progress : callable, optional
        Wraps the iterator of examples, to show how far it is.

    Returns
    -------
    list of Example
        In the order of the manifest; `take` is the path of the recording in the corpus, without its ending.

    Raises
    ------
    SignfaceError
        No take is annotated, a recording or annotation cannot be used, or the store was written by a newer signface.
    """
    entries = [entry for entry in corpus if entry.annotation is not None]
    if not entries:
        raise SignfaceError(
            "none of the takes asked for has a reference annotation",
            file=corpus.folder,
            hint="fill in the column annotation of takes.csv",
        )
    store = open_store(corpus.folder)
    recipe = make_recipe(settings)
    known: dict[tuple[str, str | None], Recipe] = {}
    origins = [find_origin(entry, corpus.folder, recipe_of(entry, recipe, known)) for entry in entries]
    return list(progress(_examples(entries, origins, store, workers, corpus.folder)))


def _examples(
    entries: list[TakeEntry], origins: list[Origin], store: DescriptorStore | None, workers: int, folder: Path
) -> Iterator[Example]:
    """The examples in order: those of the store at once, the others as they are solved."""
    from joblib import Parallel, delayed

    from signface.elan.reference import read_reference

    found = [None if store is None else store.read(origin) for origin in origins]
    missing = [(e, o) for e, o, descriptors in zip(entries, origins, found, strict=True) if descriptors is None]
    jobs = (delayed(stored_or_solved)(entry, origin, store, folder) for entry, origin in missing)
    solved = iter(())
    if missing:
        solved = Parallel(n_jobs=min(workers, len(missing)), return_as="generator")(jobs)
    for entry, origin, stored in zip(entries, origins, found, strict=True):
        descriptors = next(solved)[0] if stored is None else stored
        assert entry.annotation is not None
        reference = read_reference(entry.annotation, entry.signer)
        if reference.table.empty:
            raise SignfaceError(
                f"its reference annotation is empty (signer {entry.signer})",
                file=entry.annotation,
                hint="annotate the take, or leave out its annotation in takes.csv",
            )
        yield Example(
            take=origin.take,
            signer=entry.signer,
            kind=entry.kind,
            descriptors=descriptors,
            reference=reference,
            sentence=entry.sentence,
        )
