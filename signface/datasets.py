"""Recordings to try things on: the synthetic corpus of four takes that ships with signface. No person was recorded.

- `mini_corpus`: all of it, with its reference annotations.
- `mini_take`: one of its recordings; `mini_file`, its file.
- `mini_weights`: the weights that the recording was made from, which a solve should find.
- `mini_reference`: its reference annotation.
- `mini_examples`: weights and references of all takes, to train on without solving.

The takes are `M1_IE_J` (isolated expressions of joy), `M1_EU_11` and `M2_EU_04` (utterances) and `M2_SE_A` (a sequence
of expressions), by two signers, `M1` and `M2`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from signface.errors import SignfaceError
from signface.files import bundled_corpus

if TYPE_CHECKING:
    from signface.corpus.manifest import Corpus
    from signface.descriptors import Descriptors
    from signface.learn.examples import Example
    from signface.segmentation.segments import Segments
    from signface.takes.take import Take

__all__ = ["mini_corpus", "mini_examples", "mini_file", "mini_reference", "mini_take", "mini_weights"]


def mini_corpus() -> Corpus:
    """The synthetic corpus of two signers and four takes.

    See Also
    --------
    signface.read_corpus : any corpus.

    Examples
    --------
    >>> import signface as sf
    >>> [entry.name for entry in sf.datasets.mini_corpus()]
    ['M1_IE_J', 'M1_EU_11', 'M2_SE_A', 'M2_EU_04']
    """
    from signface.corpus.manifest import read_corpus

    return read_corpus(bundled_corpus())


def mini_file(name: str = "M2_EU_04") -> Path:
    """The C3D file of a take of the corpus.

    Raises
    ------
    SignfaceError
        There is no take of that name.

    Examples
    --------
    >>> import signface as sf
    >>> sf.datasets.mini_file("M1_IE_J").name
    'M1_IE_J.c3d'
    """
    return _file(name, f"{name}.c3d")


def mini_take(name: str = "M2_EU_04") -> Take:
    """A recording of the corpus: 46 markers at 200 Hz, in millimetres.

    Raises
    ------
    SignfaceError
        There is no take of that name.

    See Also
    --------
    signface.read_take : any recording.

    Examples
    --------
    >>> import signface as sf
    >>> take = sf.datasets.mini_take()
    >>> take.n_frames, len(take.labels), take.rate
    (1184, 46, 200.0)
    """
    from signface.takes.reading import read_take

    return read_take(mini_file(name))


def mini_weights(name: str = "M2_EU_04") -> Descriptors:
    """The weights that moved the avatar when the take was made: what a solve should find, on the default face.

    Raises
    ------
    SignfaceError
        There is no take of that name.

    See Also
    --------
    signface.solve : the weights of a recording.

    Examples
    --------
    >>> import signface as sf
    >>> weights = sf.datasets.mini_weights()
    >>> weights.n_frames, len(weights.names)
    (1184, 51)
    """
    from signface.descriptors_files import read_weights

    return read_weights(_file(name, f"truth/{name}.parquet"))


def mini_reference(name: str = "M2_EU_04") -> Segments:
    """The reference annotation of a take: when the signer was neutral, and when the face showed what.

    Raises
    ------
    SignfaceError
        There is no take of that name.

    See Also
    --------
    signface.read_reference : the annotation of any EAF.

    Examples
    --------
    >>> import signface as sf
    >>> sf.datasets.mini_reference().table["label"].tolist()
    ['N', 'ND', 'D', 'DN', 'N']
    """
    from signface.elan.reference import read_reference

    return read_reference(_file(name, f"reference/{name}.eaf"))


def mini_examples() -> list[Example]:
    """The four takes as training wants them, with the weights that they were made from: nothing is solved.

    See Also
    --------
    signface.solve_corpus : the same of any corpus, solved.

    Examples
    --------
    >>> import signface as sf
    >>> [(example.signer, example.kind, len(example.stable)) for example in sf.datasets.mini_examples()]
    [('M1', 'IE', 5), ('M1', 'EU', 4), ('M2', 'SE', 5), ('M2', 'EU', 3)]
    """
    from signface.learn.examples import Example

    return [
        Example(
            take=entry.name,
            signer=entry.signer,
            kind=entry.kind,
            descriptors=mini_weights(entry.name),
            reference=mini_reference(entry.name),
            sentence=entry.sentence,
        )
        for entry in mini_corpus()
    ]


def _file(name: str, inside: str) -> Path:
    file = bundled_corpus() / inside
    if not file.is_file():
        names = sorted(take.stem for take in bundled_corpus().glob("*.c3d"))
        raise SignfaceError(f"there is no take {name}", hint=f"the takes are {', '.join(names)}")
    return file
