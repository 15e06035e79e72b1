"""The signers of a corpus: what is known of each, from the folder `signers` beside `takes.csv`.

- `find_signer`: one of them, from `signers/NAME.json` (bases, rest, level) or `signers/NAME.csv` (bases alone).
- `warn_of_unknown_rests`: a line where takes of landmarks have signers whose rest nobody has learnt.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from signface.errors import SignfaceError, SignfaceWarning, counted
from signface.signer import Signer

if TYPE_CHECKING:
    from signface.corpus.manifest import TakeEntry

#: Formats of what a tracker finds in pictures.
TRACKED = ("openface", "pose", "kinect")

SIGNERS = "signers"


def find_signer(folder: Path, name: str) -> Signer:
    """A signer of the corpus in a folder; only the name is known where the folder has no file of theirs.

    Raises
    ------
    SignfaceError
        The file is no signer's.

    See Also
    --------
    signface.signer.Signer.read : of any file.
    """
    for ending in (".json", ".csv"):
        file = folder / SIGNERS / f"{name}{ending}"
        # A name is a word of takes.csv: it must not lead out of the folder.
        if Path(name).name == name and file.is_file():
            return _read(file, name, file.stat().st_mtime_ns)
    return Signer(name)


@lru_cache(maxsize=64)
def _read(file: Path, name: str, changed: int) -> Signer:
    return Signer.read(file, name=name)


def warn_of_unknown_rests(entries: Iterable[TakeEntry], folder: Path, *, read_as: str | None = None) -> None:
    """Warn, in one line, of signers of landmarks whose rest is unknown: each take is then measured from itself alone.

    Parameters
    ----------
    entries : iterable of TakeEntry
    folder : Path
        The corpus.
    read_as : str, optional
        See `signface.settings.solve.SolveSettings`.
    """
    from signface.takes.formats.registry import format_of

    first = {entry.signer: entry for entry in reversed(list(entries))}
    unknown = []
    for name, entry in sorted(first.items()):
        try:
            tracked = format_of(entry.path, read_as).name in TRACKED
        except SignfaceError:  # said when the take is read
            continue
        if tracked and entry.neutral_s is None and find_signer(folder, name).rest is None:
            unknown.append(name)
    if unknown:
        names = ", ".join(unknown[:5]) + " ..." * (len(unknown) > 5)
        warnings.warn(
            f"where the face of {counted(len(unknown), 'signer')} rests is not known ({names}), so that each take is "
            "measured from itself alone: signface corpus signers learns it from all takes",
            SignfaceWarning,
            stacklevel=3,
        )
