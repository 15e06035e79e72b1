"""What descriptors come from: everything that would change them, and the key that stands for it.

- `Recipe`: how a corpus is solved; face, layout, method, alpha, and the solver itself.
- `Origin`: the recipe, one recording and its row of `takes.csv`; its `key` is what the store compares.
- `make_recipe`, `find_origin`: read the files and make them.
- `content_digest`, `shipped_digest`, `code_digest`: of files and folders, of shipped data, of our own modules.
- `take_name`: the name of a take within its corpus.

Descriptors are asked for by content, never by date or by name: a recording that is exported again, a layout with one
marker moved, or another version of the solver gives another key.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from signface.corpus.manifest import TakeEntry
from signface.corpus.signers import find_signer
from signface.errors import SignfaceError
from signface.files import reading, shipped
from signface.settings.solve import SolveSettings

#: The modules between a recording and its descriptors.
SOLVING_CODE = (
    *("takes", "face", "solver", "corpus/describing.py", "descriptors.py", "descriptors_files.py"),
    *(
        "marker_names.py",
        "timecode.py",
        "columns.py",
        "frames.py",
        "settings/base.py",
        "settings/solve.py",
        "signer.py",
    ),
)


@dataclass(frozen=True)
class Recipe:
    """How the takes of a corpus are solved.

    Parameters
    ----------
    settings : SolveSettings, optional
        None for recordings that hold weights: nothing is solved.
    face_digest, layout_digest : str
        SHA-256 of the content of the face and of the layout (of all shipped layouts where one is chosen).
    solver : str
        SHA-256 of the modules that read and solve, so that no change of ours passes unseen.
    """

    settings: SolveSettings | None
    face_digest: str
    layout_digest: str
    solver: str

    @property
    def digest(self) -> str:
        """SHA-256 of what matters of it: contents, not names."""
        how = None
        if self.settings is not None:
            how = {key: value for key, value in self.settings.as_dict().items() if key not in ("face", "layout")}
        return _digest_of([how, self.face_digest, self.layout_digest, self.solver])

    @property
    def name(self) -> str:
        """Short name, for a folder: the face's and ten digits of the digest."""
        face = "weights" if self.settings is None else Path(self.settings.face).stem
        return f"{face}-{self.digest[:10]}"


@dataclass(frozen=True)
class Origin:
    """One recording with all that its descriptors depend on.

    Parameters
    ----------
    take : str
        Name of the take within its corpus (`take_name`).
    file : str
        The recording's own name, with its ending.
    signer, kind : str
        As in `takes.csv`; they stand in the stored table.
    recording : str
        SHA-256 of the recording.
    neutral_s, start_s : float, optional
        As in `takes.csv`.
    recipe : Recipe
    bases : str
        SHA-256 of what is known of the signer's own bases; empty where the avatar's serve.
    """

    take: str
    file: str
    signer: str
    kind: str
    recording: str
    neutral_s: float | None
    start_s: float | None
    recipe: Recipe
    bases: str = ""

    @property
    def key(self) -> str:
        """SHA-256 of all of it."""
        row = [self.take, self.file, self.signer, self.kind, self.recording, self.neutral_s, self.start_s]
        return _digest_of([*row, self.recipe.digest, self.bases])

    def as_dict(self) -> dict[str, Any]:
        """For the provenance of a stored file."""
        return asdict(self)


def make_recipe(settings: SolveSettings | None = None) -> Recipe:
    """The recipe of some settings, whose face and layout are each a shipped name or a path.

    Raises
    ------
    SignfaceError
        There is no such face or layout.

    Examples
    --------
    >>> make_recipe(SolveSettings(layout="default-40")).name
    'default-...'
    """
    settings = SolveSettings() if settings is None else settings
    if settings.layout is None:
        layouts = shipped("layouts", ".csv")
        layout_digest = _digest_of([[name, content_digest(file)] for name, file in layouts.items()])
    else:
        layout_digest = shipped_digest("layouts", ".csv", settings.layout)
    face_digest = shipped_digest("faces", ".glb", settings.face)
    return Recipe(settings, face_digest, layout_digest, code_digest(*SOLVING_CODE))


def weights_recipe(settings: SolveSettings | None = None) -> Recipe:
    """The recipe of recordings that hold weights already, or that are read as weights: how they are read and cut."""
    read = None if settings is None else SolveSettings(read_as=settings.read_as).for_take_of(settings)
    return Recipe(None if read == SolveSettings() else read, "", "", code_digest(*SOLVING_CODE))


def find_origin(entry: TakeEntry, folder: Path, recipe: Recipe) -> Origin:
    """The origin of a row of `takes.csv`; reads the whole recording for its digest.

    Parameters
    ----------
    entry : TakeEntry
    folder : Path
        The corpus.
    recipe : Recipe
        For a recording of markers; one that holds weights has its own.

    Raises
    ------
    SignfaceError
        The recording cannot be read, or is of no known format.
    """
    from signface.takes.formats.registry import format_of

    read_as = None if recipe.settings is None else recipe.settings.read_as
    holds_weights = (
        format_of(entry.path, read_as).holds == "weights"
    )  # nothing to solve: neither face nor layout matter
    return Origin(
        take=take_name(entry, folder),
        file=entry.path.name,
        signer=entry.signer,
        kind=entry.kind,
        recording=content_digest(entry.path),
        neutral_s=None if holds_weights else entry.neutral_s,
        start_s=entry.start_s,
        recipe=weights_recipe(recipe.settings) if holds_weights else recipe,
        bases="" if holds_weights else find_signer(folder, entry.signer).solving_digest,
    )


def take_name(entry: TakeEntry, folder: Path) -> str:
    """Path of a recording within its corpus, without its ending, with `/`; `..` of one outside becomes `up`.

    `@SUBJECT` follows where the row names one of several.

    Examples
    --------
    >>> take_name(TakeEntry(Path("corpus/S1/laugh.c3d"), "S1", "EU"), Path("corpus"))
    'S1/laugh'
    """
    relative = Path(os.path.relpath(entry.path, folder)).with_suffix("")
    subject = "" if entry.subject is None else f"@{entry.subject.replace('/', '_')}"
    return "/".join("up" if step == os.pardir else step for step in relative.parts) + subject


def content_digest(path: Path) -> str:
    """SHA-256 of a file, or of the names and contents of the files of a folder.

    Raises
    ------
    SignfaceError
        There is no such file, or it cannot be read.
    """
    with reading(path):
        if path.is_dir():
            files = sorted(file for file in path.rglob("*") if file.is_file())
            return _digest_of([[file.relative_to(path).as_posix(), content_digest(file)] for file in files])
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()


def shipped_digest(kind: str, suffix: str, name: str) -> str:
    """SHA-256 of shipped data (`signface.files.shipped`) by its name, or of a file or folder by its path.

    Raises
    ------
    SignfaceError
        There is nothing of that name.
    """
    ours = shipped(kind, suffix)
    path = ours.get(name, Path(name))
    if not path.exists():
        one = kind.removesuffix("s")
        raise SignfaceError(f"no such {one}", file=path, hint=f"name a file or a shipped {one}: {', '.join(ours)}")
    return content_digest(path)


@lru_cache
def code_digest(*modules: str) -> str:
    """SHA-256 of the sources of some of our modules and folders of modules, named from the package's own folder."""
    package = Path(__file__).resolve().parents[1]
    files = []
    for module in modules:
        path = package / module
        files += sorted(path.rglob("*.py")) if path.is_dir() else [path]
    return _digest_of([[file.relative_to(package).as_posix(), content_digest(file)] for file in files])


def _digest_of(content: Any) -> str:
    return hashlib.sha256(json.dumps(content, ensure_ascii=False).encode()).hexdigest()
