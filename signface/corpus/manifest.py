"""The manifest of a corpus: `takes.csv`, one row a take.

- `read_corpus`: read and validate it; every problem is reported at once. A folder of recordings that needs none said
  about it (`signface.corpus.found`) gets one.
- `write_takes`: write it, for whoever makes a corpus.
- `TakeEntry`, `Corpus`: a row, and all of them with filters by kind and by signer.

The columns are `take`, `signer`, `kind` (required) and `annotation`, `neutral_s`, `video`, `start_s`, `intensity`,
`face`, `layout`, `sentence`, `subject` (optional). Paths are relative to the csv. Other columns are left alone.
"""

from __future__ import annotations

import csv
import difflib
import math
import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

from signface.corpus.found import UNKNOWN, found_takes
from signface.errors import SignfaceError, SignfaceWarning, counted
from signface.files import whole_file

MANIFEST = "takes.csv"
REQUIRED = ("take", "signer", "kind")
OPTIONAL = ("annotation", "neutral_s", "video", "start_s", "intensity", "face", "layout", "sentence", "subject")
INTENSITIES = (1, 2, 3)

#: How many problems one error spells out; the rest are counted.
SPELT_OUT = 20


@dataclass(frozen=True)
class TakeEntry:
    """One row of `takes.csv`.

    Parameters
    ----------
    path : Path
        The recording.
    signer : str
        Who signs.
    kind : str
        `IE` isolated expressions, `SE` sequences of expressions, `EU` expressive utterances, or any other word.
    annotation : Path, optional
        The reference annotation (.eaf).
    neutral_s : float, optional
        Time of a neutral frame in seconds; None leaves it to be found.
    video : Path, optional
        A film of the take.
    start_s : float, optional
        Time of the first frame in the video, seconds.
    intensity : int, optional
        1, 2 or 3, where the whole take was acted with one intensity.
    face, layout : str, optional
        A shipped name or a path, where this take needs others than the default.
    sentence : str, optional
        What is signed: takes of one sentence by one signer are never trained on and tested at once.
    subject : str, optional
        Whose markers in the recording, where it holds those of several; then it may have a row for each. The signer's
        where the markers are named after them.
    """

    path: Path
    signer: str
    kind: str
    annotation: Path | None = None
    neutral_s: float | None = None
    video: Path | None = None
    start_s: float | None = None
    intensity: int | None = None
    face: str | None = None
    layout: str | None = None
    sentence: str | None = None
    subject: str | None = None

    @property
    def name(self) -> str:
        """Name of the take: the stem of its file."""
        return self.path.stem


@dataclass(frozen=True, repr=False)
class Corpus:
    """The takes of a corpus, in the order of the manifest.

    Parameters
    ----------
    folder : Path
        Where the manifest lies.
    takes : tuple of TakeEntry

    See Also
    --------
    signface.read_corpus : where it comes from.

    Examples
    --------
    >>> import signface as sf
    >>> corpus = sf.datasets.mini_corpus()
    >>> len(corpus.takes), corpus.signers
    (4, ('M1', 'M2'))
    """

    folder: Path
    takes: tuple[TakeEntry, ...]

    def __len__(self) -> int:
        return len(self.takes)

    def __repr__(self) -> str:
        return f"<Corpus {self.folder.name}: {len(self)} takes of {len(self.signers)} signers>"

    def __iter__(self) -> Iterator[TakeEntry]:
        return iter(self.takes)

    @property
    def signers(self) -> tuple[str, ...]:
        """Who signs, sorted."""
        return tuple(sorted({take.signer for take in self.takes}))

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of takes there are, sorted."""
        return tuple(sorted({take.kind for take in self.takes}))

    def select(self, *, kinds: Sequence[str] | None = None, signers: Sequence[str] | None = None) -> Corpus:
        """The takes of some kinds and some signers; None means all.

        Raises
        ------
        SignfaceError
            A kind or a signer is not in the corpus.

        Examples
        --------
        >>> import signface as sf
        >>> corpus = sf.datasets.mini_corpus()
        >>> [take.name for take in corpus.select(kinds=["IE", "SE"], signers=["M1"])]
        ['M1_IE_J']
        """
        for word, wanted, present in (("kind", kinds, self.kinds), ("signer", signers, self.signers)):
            unknown = sorted(set(wanted or ()) - set(present))
            if unknown:
                raise SignfaceError(
                    f"has no take of the {word} {', '.join(unknown)}",
                    file=self.folder,
                    hint=f"its {word}s are {', '.join(present)}",
                )
        kept = (
            take
            for take in self.takes
            if (kinds is None or take.kind in kinds) and (signers is None or take.signer in signers)
        )
        return replace(self, takes=tuple(kept))


def read_corpus(path: str | PathLike[str]) -> Corpus:
    """Read the manifest of a corpus and make sure that everything it names is there.

    Parameters
    ----------
    path : path
        The folder of the corpus or its `takes.csv`. Where a folder has none and holds recordings whose names say
        enough (`signface.corpus.found`), it is written, with a `SignfaceWarning`.

    Raises
    ------
    SignfaceError
        There is no manifest and none can be made, it is no table, or some of its rows are wrong; the message lists
        every problem.

    Examples
    --------
    >>> import signface as sf
    >>> corpus = sf.read_corpus(sf.datasets.mini_file().parent)
    >>> [take.name for take in corpus.select(kinds=["EU"])]
    ['M1_EU_11', 'M2_EU_04']
    """
    file = find_manifest(path)
    takes, problems = read_rows(file)
    if problems:
        more = len(problems) - SPELT_OUT
        spelt = "; ".join(problems[:SPELT_OUT]) + (f"; and {more} more" if more > 0 else "")
        raise SignfaceError(f"{counted(len(problems), 'problem')}: {spelt}", file=file, hint="mend the table")
    return Corpus(file.parent, tuple(takes))


def find_manifest(path: str | PathLike[str]) -> Path:
    """The `takes.csv` of a corpus, from the path of its folder or of the file itself; made where it can be."""
    file = Path(path)
    if not file.is_dir():
        if not file.exists() and file.suffix.lower() != ".csv":
            raise SignfaceError("no such folder", file=path, hint="name the folder of a corpus")
        return file
    if not (file / MANIFEST).is_file():
        _make_manifest(file)
    return file / MANIFEST


def _make_manifest(folder: Path) -> None:
    """Write `takes.csv` from what the names of files say, and say so."""
    found = found_takes(folder)
    if not found:
        raise SignfaceError(
            f"has no {MANIFEST}",
            file=folder,
            hint=f"name the folder of a corpus, or write one: its columns are {', '.join(REQUIRED + OPTIONAL)}",
        )
    write_takes(folder, [TakeEntry(one.path, one.signer, one.kind, one.annotation) for one in found])
    strangers = sum(one.signer == UNKNOWN for one in found)
    unknown = f"; the signer of {counted(strangers, 'take')} is not known: fill in its column signer" * bool(strangers)
    warnings.warn(
        f"{folder}: had no {MANIFEST}; one that lists {counted(len(found), 'take')} was written from the names of files"
        + unknown,
        SignfaceWarning,
        stacklevel=4,
    )


def read_rows(file: Path) -> tuple[list[TakeEntry], list[str]]:
    """Rows of a manifest and the problems found in them, each as a clause that opens with its line.

    Raises
    ------
    SignfaceError
        The file cannot be read as a table at all.
    """
    table = _read_table(file)
    header, rows = table[0][1], table[1:]
    problems = _problems_of_header(header)
    if any(column not in header for column in REQUIRED):
        return [], problems
    if not rows:
        problems.append("it has no take")
    takes = []
    first_line: dict[tuple[Path, str | None], int] = {}
    for line, cells in rows:
        if len(cells) > len(header):
            problems.append(f"line {line}: has {len(cells)} cells for {len(header)} columns")
        row = dict(zip(header, cells))
        take, wrong = _read_row(row, file.parent)
        problems.extend(f"line {line}: {problem}" for problem in wrong)
        if take is None:
            continue
        recording = (take.path.resolve(), take.subject)
        if recording in first_line:
            problems.append(f"line {line}: the take {row['take']} is already on line {first_line[recording]}")
            continue
        first_line[recording] = line
        takes.append(take)
    return takes, problems


def _read_table(file: Path) -> list[tuple[int, list[str]]]:
    """Line numbers and stripped cells of the rows that are not blank; at least the header."""
    if not file.is_file():
        raise SignfaceError("no such file", file=file)
    try:
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise SignfaceError("cannot be read as a table", file=file, hint="save it as CSV, UTF-8") from error
    head = text.partition("\n")[0]
    # Spreadsheets of many countries separate with a semicolon and call it CSV.
    delimiter = ";" if head.count(";") > head.count(",") else ","
    reader = csv.reader(text.splitlines(), delimiter=delimiter)
    try:
        rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader]
    except csv.Error as error:
        raise SignfaceError(f"cannot be read as a table ({error})", file=file, hint="save it as CSV") from error
    rows = [(line, cells) for line, cells in rows if any(cells)]
    if not rows:
        raise SignfaceError("is empty", file=file, hint=f"its columns are {', '.join(REQUIRED + OPTIONAL)}")
    return rows


def _problems_of_header(header: list[str]) -> list[str]:
    problems = [f"the column {column} is missing" for column in REQUIRED if column not in header]
    problems += [f"the column {name} stands twice" for name in sorted({n for n in header if n and header.count(n) > 1})]
    for column in header:
        if column in REQUIRED + OPTIONAL:
            continue
        # A column of the user's own is welcome; one letter wrong in a known name would silently lose its content.
        meant = difflib.get_close_matches(column, [name for name in OPTIONAL if name not in header], n=1, cutoff=0.8)
        if meant:
            problems.append(f"the column {column} is unknown, {meant[0]} seems meant")
    return problems


def _read_row(row: dict[str, str], folder: Path) -> tuple[TakeEntry | None, list[str]]:
    """One entry (None where it names no take) and what is wrong with it."""
    problems = [f"{column} is empty" for column in REQUIRED if not row.get(column)]
    if not row.get("take"):
        return None, problems

    def existing(column: str) -> Path | None:
        if not row.get(column):
            return None
        path = folder / row[column]
        if not path.is_file():
            problems.append(f"no such file: {row[column]} ({column})")
        return path

    def number(column: str) -> float | None:
        if not row.get(column):
            return None
        try:
            value = float(row[column])
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            problems.append(f"{column} is no number of seconds: {row[column]}")
            return None
        return value

    def name_or_path(column: str) -> str | None:
        if not row.get(column):
            return None
        path = folder / row[column]
        return str(path) if path.exists() else row[column]

    intensity = row.get("intensity") or None
    if intensity is not None and intensity not in map(str, INTENSITIES):
        problems.append(f"intensity is 1, 2 or 3, not {intensity}")
        intensity = None
    take = TakeEntry(
        path=existing("take") or folder,
        signer=row.get("signer", ""),
        kind=row.get("kind", ""),
        annotation=existing("annotation"),
        neutral_s=number("neutral_s"),
        video=existing("video"),
        start_s=number("start_s"),
        intensity=None if intensity is None else int(intensity),
        face=name_or_path("face"),
        layout=name_or_path("layout"),
        sentence=row.get("sentence") or None,
        subject=row.get("subject") or None,
    )
    return take, problems


def write_takes(folder: str | PathLike[str], takes: Iterable[TakeEntry]) -> Path:
    """Write `takes.csv` into a folder, paths relative to it; columns that no take uses are left out.

    Returns
    -------
    Path
        The manifest.

    Raises
    ------
    SignfaceError
        A take lies outside the folder, or the folder cannot be written.
    """
    file = Path(folder) / MANIFEST
    rows = [_cells(take, Path(folder)) for take in takes]
    columns = [column for column in REQUIRED + OPTIONAL if column in REQUIRED or any(row[column] for row in rows)]
    with whole_file(file) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, columns, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return file


def _cells(take: TakeEntry, folder: Path) -> dict[str, str]:
    def relative(path: Path | None) -> str:
        if path is None:
            return ""
        try:
            return path.resolve().relative_to(folder.resolve()).as_posix()
        except ValueError as error:
            raise SignfaceError("lies outside the corpus", file=path, hint=f"move it under {folder}") from error

    return {
        "take": relative(take.path),
        "signer": take.signer,
        "kind": take.kind,
        "annotation": relative(take.annotation),
        "neutral_s": "" if take.neutral_s is None else f"{take.neutral_s:.3f}",
        "video": relative(take.video),
        "start_s": "" if take.start_s is None else f"{take.start_s:.3f}",
        "intensity": "" if take.intensity is None else str(take.intensity),
        "face": take.face or "",
        "layout": take.layout or "",
        "sentence": take.sentence or "",
        "subject": take.subject or "",
    }
