"""The takes of a corpus, solved, with their reference annotations: what training and evaluation work on.

- `solve_examples`: one `Example` for each annotated take.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from signface.corpus.manifest import Corpus, TakeEntry
from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.label.training import Example

#: Takes solved at the same time.
WORKERS = 2


def solve_examples(
    corpus: Corpus,
    *,
    face: str = "default",
    layout: str | None = None,
    alpha: float | None = None,
    workers: int = WORKERS,
    progress: Callable[[Iterable[Example]], Iterable[Example]] = iter,
) -> list[Example]:
    """Solve the annotated takes of a corpus, several at a time, and read their reference annotations.

    Parameters
    ----------
    corpus : Corpus
        Takes without an annotation are left out.
    face, layout : str, optional
        For the takes whose row names none: a shipped name or a path. By default the shipped face, and the shipped
        layout that fits the markers of the take.
    alpha : float, optional
        Weight of the thin shell; the solver's own default when not given.
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
        No take is annotated, or a recording or annotation cannot be used.
    """
    from joblib import Parallel, delayed

    entries = [entry for entry in corpus if entry.annotation is not None]
    if not entries:
        raise SignfaceError(
            "none of the takes asked for has a reference annotation",
            file=corpus.folder,
            hint="fill in the column annotation of takes.csv",
        )
    jobs = (delayed(solve_example)(entry, corpus.folder, face, layout, alpha) for entry in entries)
    solved: Iterator[Example] = Parallel(n_jobs=min(workers, len(entries)), return_as="generator")(jobs)
    return list(progress(solved))


def solve_example(
    entry: TakeEntry, folder: Path, face: str = "default", layout: str | None = None, alpha: float | None = None
) -> Example:
    """Solve one annotated take of a corpus; see `solve_examples`. Weights (from a phone, or solved before) are kept.

    `start_s` of the row, the time of the first frame in the video, places the take on the time line of its
    annotation; `neutral_s` is on that time line too.
    """
    from signface.annotation import describe
    from signface.elan.reference import read_reference
    from signface.takes.reading import read_recording

    if entry.annotation is None:
        raise SignfaceError("has no reference annotation", file=entry.path)
    recording = read_recording(entry.path)
    if entry.start_s is not None:
        recording = recording.changed(f"start at {entry.start_s:g} s", start=entry.start_s)
    if isinstance(recording, Descriptors):
        descriptors = recording
    else:
        from signface.face.layout_files import read_layout
        from signface.face.reading import read_face

        own_face = read_face(entry.face or face)
        own_layout = entry.layout or layout
        try:
            descriptors = describe(
                recording,
                face=own_face,
                layout=None if own_layout is None else read_layout(own_layout, own_face),
                neutral="auto" if entry.neutral_s is None else entry.neutral_s,
                alpha=alpha,
            )
        except SignfaceError as error:
            raise error if error.file else SignfaceError(error.problem, file=entry.path, hint=error.hint) from error
    return Example(
        take=entry.path.relative_to(folder).with_suffix("").as_posix(),
        signer=entry.signer,
        kind=entry.kind,
        descriptors=descriptors,
        reference=read_reference(entry.annotation, entry.signer),
    )
