"""Takes in a folder that has no `takes.csv`, where the names that programs give to files say enough.

- `found_takes`: OpenFace's tables, and the points of UCI's Grammatical Facial Expressions, with their annotations.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from signface.elan.frame_labels import POINTS, TARGETS, signer_and_expression

#: The signer of whom nothing is said.
UNKNOWN = "unknown"

#: OpenFace writes a file of this name beside each table.
DETAILS = "_of_details.txt"


class FoundTake(NamedTuple):
    """A recording, and what its name and folder say of it."""

    path: Path
    signer: str
    kind: str
    annotation: Path | None


def found_takes(folder: Path) -> list[FoundTake]:
    """The recordings in a folder and the folders in it, in the order of their paths.

    - OpenFace: `NAME.csv` where there is a `NAME_of_details.txt`; `NAME.eaf` is its annotation. Of the kind `openface`.
    - UCI's Grammatical Facial Expressions: `SIGNER_EXPRESSION_datapoints.txt`; `SIGNER_EXPRESSION_targets.txt` is its
      annotation and the expression its kind.

    The signer is the folder in `folder` that a recording lies in; beside it, the one in its name, else `unknown`.

    Examples
    --------
    >>> for name in ("anna/ask.csv", "anna/ask_of_details.txt", "b_topics_datapoints.txt"):
    ...     file = Path("films") / name
    ...     file.parent.mkdir(parents=True, exist_ok=True)
    ...     file.touch()
    >>> [(take.path.name, take.signer, take.kind) for take in found_takes(Path("films"))]
    [('ask.csv', 'anna', 'openface'), ('b_topics_datapoints.txt', 'b', 'topics')]
    """
    takes = []
    for details in folder.rglob(f"*{DETAILS}"):
        table = details.with_name(details.name.removesuffix(DETAILS) + ".csv")
        if table.is_file():
            annotation = table.with_suffix(".eaf")
            signer = _folder_of(table, folder) or UNKNOWN
            takes.append(FoundTake(table, signer, "openface", annotation if annotation.is_file() else None))
    for points in folder.rglob(f"*{POINTS}"):
        targets = points.with_name(points.name.removesuffix(POINTS) + TARGETS)
        signer, expression = signer_and_expression(points)
        signer = _folder_of(points, folder) or signer
        takes.append(FoundTake(points, signer, expression, targets if targets.is_file() else None))
    return sorted(takes)


def _folder_of(file: Path, folder: Path) -> str:
    """The first folder on the way from a folder to a file in it; nothing where it lies in the folder itself."""
    return next(iter(file.relative_to(folder).parts[:-1]), "")
