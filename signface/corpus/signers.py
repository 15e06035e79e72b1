"""The signers of a corpus: what is known of each, from the folder `signers` beside `takes.csv`.

- `find_signer`: one of them, from `signers/NAME.json` (bases, level) or `signers/NAME.csv` (bases alone).
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from signface.signer import Signer

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
