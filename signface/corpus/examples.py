"""The takes of a corpus, solved, with their reference annotations: what training and evaluation work on.

- `solve_corpus`: one `Example` for each annotated take.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from signface.corpus.describing import recipe_of, stored_or_solved
from signface.corpus.manifest import Corpus, TakeEntry
from signface.corpus.origin import Origin, Recipe, find_origin, make_recipe
from signface.corpus.signers import find_signer, warn_of_unknown_rests
from signface.corpus.store import DescriptorStore, open_store
from signface.descriptors import Descriptors
from signface.elan.translation import MappingOrFile, as_mapping
from signface.errors import SignfaceError, SignfaceWarning
from signface.label.vocabulary import NONE, Vocabulary
from signface.learn.examples import Example
from signface.segmentation.segments import Segments
from signface.settings.solve import SolveSettings

#: Takes solved at the same time.
WORKERS = 2


def solve_corpus(
    corpus: Corpus,
    *,
    settings: SolveSettings | None = None,
    tier: str = "affect",
    vocabulary: Vocabulary | None = None,
    sparse: bool = False,
    mapping: MappingOrFile | None = None,
    workers: int = WORKERS,
    progress: Callable[[Iterable[Descriptors]], Iterable[Descriptors]] = iter,
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
    tier : str
        What was annotated: the part of a tier's name before `@`, or the whole name of a tier of one signer.
    vocabulary : Vocabulary, optional
        The labels allowed; by default as `signface.elan.reference.reference_vocabulary` finds them.
    sparse : bool
        What is not annotated was not looked at, and takes in which nothing is annotated are passed over with a
        `SignfaceWarning`. Otherwise, on a tier whose vocabulary has no transitions, it is `none`, which is added to the
        vocabulary: an empty tier is a take in which nothing happened.
    mapping : mapping or path, optional
        Of our channels and labels to the laboratory's tiers and values (`signface.elan.mapping`): `tier` is then ours,
        and so are the labels that are learnt.
    workers : int
        Takes solved at the same time, each in a process of its own.
    progress : callable, optional
        Wraps the iterator of descriptors, to show how far it is.

    Returns
    -------
    list of Example
        In the order of the manifest; `take` is the path of the recording in the corpus, without its ending.

    Raises
    ------
    SignfaceError
        No take is annotated, a recording or annotation cannot be used, or the store was written by a newer signface.

    See Also
    --------
    signface.train, signface.evaluate : what they are for.

    Examples
    --------
    >>> from shutil import copytree
    >>> import signface as sf
    >>> corpus = sf.read_corpus(copytree(sf.datasets.mini_file().parent, "feel"))
    >>> examples = sf.solve_corpus(corpus.select(kinds=["EU"]), settings=sf.SolveSettings(alpha=0.3))
    >>> [(example.take, len(example.stable)) for example in examples]
    [('M1_EU_11', 4), ('M2_EU_04', 3)]
    """
    entries = [entry for entry in corpus if entry.annotation is not None]
    if not entries:
        raise SignfaceError(
            "none of the takes asked for has a reference annotation",
            file=corpus.folder,
            hint="fill in the column annotation of takes.csv",
        )
    warn_of_unknown_rests(entries, corpus.folder, read_as=None if settings is None else settings.read_as)
    store = open_store(corpus.folder)
    recipe = make_recipe(settings)
    known: dict[tuple[str | None, ...], Recipe] = {}
    rules = None if mapping is None else as_mapping(mapping)
    entries, references, vocabulary = _references(entries, tier, vocabulary, sparse, rules)
    origins = [find_origin(entry, corpus.folder, recipe_of(entry, recipe, known)) for entry in entries]
    named = tier.partition("@")[0]
    blank = not (sparse or vocabulary.transitions)
    if blank:
        vocabulary = vocabulary.with_blank()
    solved = progress(_described(entries, origins, store, workers, corpus.folder))
    examples = []
    for entry, origin, reference, descriptors in zip(entries, origins, references, solved, strict=True):
        end = descriptors.start + descriptors.duration
        examples.append(
            Example(
                take=origin.take,
                signer=entry.signer,
                kind=entry.kind,
                descriptors=descriptors,
                reference=reference.filled(descriptors.start, end, NONE) if blank else reference,
                sentence=entry.sentence,
                vocabulary=vocabulary,
                tier=named,
                level=find_signer(corpus.folder, entry.signer).level,
            )
        )
    return examples


def _references(
    entries: list[TakeEntry],
    tier: str,
    vocabulary: Vocabulary | None,
    sparse: bool,
    mapping: MappingOrFile | None,
) -> tuple[list[TakeEntry], list[Segments], Vocabulary]:
    """The takes that say something, the reference of each, and their vocabulary."""
    from signface.elan.reference import read_reference, reference_vocabulary

    files = [(entry.annotation, entry.signer) for entry in entries if entry.annotation is not None]
    if vocabulary is None:
        vocabulary = reference_vocabulary(files, tier, mapping=mapping)
    blank = not (sparse or vocabulary.transitions)
    readable = vocabulary.including(NONE) if blank else vocabulary
    kept = []
    for entry, (file, signer) in zip([entry for entry in entries if entry.annotation is not None], files, strict=True):
        reference = read_reference(file, signer, tier=tier, vocabulary=readable, mapping=mapping, video=entry.video)
        if blank:  # what is called none is what is not annotated: one segment with the gaps beside it
            shown = reference.table[reference.table["label"] != NONE].reset_index(drop=True)
            kept.append(
                (entry, reference if len(shown) == len(reference) else reference.changed(f"left {NONE} out", shown))
            )
        elif len(reference):
            kept.append((entry, reference))
        elif sparse and not vocabulary.transitions:
            note = f"{file}: nothing is annotated on the tier {tier} of {signer}: the take is passed over"
            warnings.warn(note, SignfaceWarning, stacklevel=3)
        else:
            raise SignfaceError(
                f"its reference annotation is empty (signer {signer})",
                file=file,
                hint="annotate the take, or leave out its annotation in takes.csv",
            )
    if not kept:
        raise SignfaceError(f"nothing is annotated on the tier {tier}")
    return [entry for entry, _ in kept], [reference for _, reference in kept], vocabulary


def _described(
    entries: list[TakeEntry], origins: list[Origin], store: DescriptorStore | None, workers: int, folder: Path
) -> Iterator[Descriptors]:
    """The descriptors in order: those of the store at once, the others as they are solved."""
    from joblib import Parallel, delayed

    stored = [None if store is None else store.read(origin) for origin in origins]
    missing = [(e, o) for e, o, descriptors in zip(entries, origins, stored, strict=True) if descriptors is None]
    jobs = (delayed(_solved)(os.getcwd(), entry, origin, store, folder) for entry, origin in missing)
    solved = iter(())
    if missing:
        solved = Parallel(n_jobs=min(workers, len(missing)), return_as="generator")(jobs)
    for descriptors in stored:
        yield next(solved)[0] if descriptors is None else descriptors


def _solved(
    here: str, entry: TakeEntry, origin: Origin, store: DescriptorStore | None, folder: Path
) -> tuple[Descriptors, bool]:
    """`stored_or_solved` in a process that may have been started in another folder than this one, `here`."""
    os.chdir(here)
    return stored_or_solved(entry, origin, store, folder)
