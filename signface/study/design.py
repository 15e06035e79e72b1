"""The description of a study: `study.toml`, read once, checked whole, then trusted.

- `read_study`: read and check a study's folder; every mistake is said in one error.
- `Study`, `Block`, `Stimulus`, `Question`, `Choice`: what the file describes.

The form of the file is in docs/study.md, and the three questionnaires of the thesis (sections 6.3.2 and 6.4.2) lie in
`signface/study/examples`.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from signface.errors import SignfaceError

KINDS = ("choice", "likert", "number", "text")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
_COLUMN = re.compile(r"[a-z][a-z0-9_]{0,40}")
#: Films that every present browser plays.
FILM_ENDINGS = (".mp4", ".webm")

Texts = Mapping[str, str]


@dataclass(frozen=True)
class Choice:
    """One answer of a forced choice: the `value` that is stored, and what participants read, by language."""

    value: str
    text: Texts


@dataclass(frozen=True)
class Question:
    """A question.

    Parameters
    ----------
    column : str
        Its column in the exported csv.
    kind : str
        One of `KINDS`.
    text : mapping of language to str
    choices : tuple of Choice
        For `choice`.
    low, high : int
        For `likert` and `number`, the smallest and largest answer; for `text`, `high` is the longest answer.
    ends : (mapping, mapping)
        For `likert`, what its ends mean.
    optional : bool
        Whether a participant may leave it out.
    """

    column: str
    kind: str
    text: Texts
    choices: tuple[Choice, ...] = ()
    low: int = 1
    high: int = 7
    ends: tuple[Texts, Texts] = ({}, {})
    optional: bool = False


@dataclass(frozen=True)
class Stimulus:
    """One film, or two that play together.

    Parameters
    ----------
    name : str
    expression, method : str
        What was played, and how the film was made.
    intensity : int
        Played intensity, 1 to 3 in the thesis.
    films : tuple of str
        Paths relative to the study's folder.
    """

    name: str
    expression: str
    intensity: int
    method: str
    films: tuple[str, ...]


@dataclass(frozen=True)
class Block:
    """Stimuli shown in a shuffled order, each with the same questions. Its answers become final at its end."""

    title: Texts
    text: Texts
    questions: tuple[Question, ...]
    stimuli: tuple[Stimulus, ...]


@dataclass(frozen=True)
class Study:
    """A perceptual study.

    Parameters
    ----------
    folder : Path
    name : str
        A short name without spaces.
    languages : tuple of str
        The first is shown to those who ask for none of them.
    title, consent, instructions, thanks : mapping of language to str
        Paragraphs are parted by an empty line. Plain text: nothing in it is read as HTML.
    instruction_film : str or None
        A film in sign language that says the same as `consent` and `instructions`, relative to the folder.
    seed : int
        With a participant's own number it gives the order of the stimuli.
    personal : tuple of Question
    blocks : tuple of Block
    words : mapping of language to mapping
        Words of the pages in languages that signface does not ship.
    """

    folder: Path
    name: str
    languages: tuple[str, ...]
    title: Texts
    consent: Texts
    instructions: Texts
    thanks: Texts
    instruction_film: str | None
    seed: int
    personal: tuple[Question, ...]
    blocks: tuple[Block, ...]
    words: Mapping[str, Mapping[str, str]]

    @property
    def stimuli(self) -> dict[str, Stimulus]:
        """Every stimulus by its name."""
        return {stimulus.name: stimulus for block in self.blocks for stimulus in block.stimuli}

    @property
    def films(self) -> tuple[str, ...]:
        """Every film that a page may show, sorted."""
        films = {film for stimulus in self.stimuli.values() for film in stimulus.films}
        return tuple(sorted(films | ({self.instruction_film} if self.instruction_film else set())))

    @property
    def questions(self) -> dict[str, Question]:
        """Every question that is asked after a stimulus, by its column."""
        return {question.column: question for block in self.blocks for question in block.questions}


class _Reader:
    """Takes values out of the parsed file, noting every mistake with its place."""

    def __init__(self, languages: tuple[str, ...]) -> None:
        self.languages = languages
        self.problems: list[str] = []

    def texts(self, table: Mapping, key: str, where: str, *, needed: bool = True) -> Texts:
        """A text in every language of the study; one string stands for all of them."""
        value = table.get(key)
        if value is None and not needed:
            return dict.fromkeys(self.languages, "")
        if isinstance(value, str):
            return dict.fromkeys(self.languages, value.strip())
        if not isinstance(value, Mapping) or not all(isinstance(text, str) for text in value.values()):
            self.problems.append(f"{where} needs {key}, a text for each of {', '.join(self.languages)}")
            return dict.fromkeys(self.languages, "")
        missing = [language for language in self.languages if language not in value]
        if missing:
            self.problems.append(f"{where}: {key} is not given in {', '.join(missing)}")
        return {language: str(value.get(language, "")).strip() for language in self.languages}

    def question(self, table: object, where: str) -> Question | None:
        if not isinstance(table, Mapping):
            self.problems.append(f"{where} is not a table")
            return None
        column, kind = str(table.get("column", "")), table.get("kind")
        where = f"{where} {column}".strip()
        if not _COLUMN.fullmatch(column):
            self.problems.append(f"{where} needs column, a name of small letters, digits and _")
        if kind not in KINDS:
            self.problems.append(f"{where} needs kind, one of {', '.join(KINDS)}")
            return None
        low, high = table.get("low", 1), table.get("high", {"likert": 7, "number": 120, "text": 500}.get(kind, 1))
        if not (_whole(low) and _whole(high) and (low < high or kind == "choice")) or (kind == "likert" and high > 11):
            self.problems.append(f"{where}: low and high must be whole numbers that rise (at most 11 steps)")
            return None
        choices = []
        given = table.get("choices", []) if kind == "choice" else []
        for number, choice in enumerate(given if isinstance(given, list) else [], start=1):
            if not isinstance(choice, Mapping) or not _NAME.fullmatch(str(choice.get("value", ""))):
                self.problems.append(f"{where}: choice {number} needs a value of letters and digits")
                continue
            choices.append(Choice(str(choice["value"]), self.texts(choice, "text", f"{where}, choice {number}")))
        if kind == "choice" and (len(choices) < 2 or len({choice.value for choice in choices}) < len(choices)):
            self.problems.append(f"{where} needs at least two choices with different values")
        ends: tuple[Texts, Texts] = ({}, {})
        if kind == "likert":
            ends = (self.texts(table, "low_end", where), self.texts(table, "high_end", where))
        return Question(
            column=column,
            kind=kind,
            text=self.texts(table, "text", where),
            choices=tuple(choices),
            low=low,
            high=high,
            ends=ends,
            optional=bool(table.get("optional", False)),
        )

    def stimuli(self, table: Mapping, where: str) -> tuple[Stimulus, ...]:
        """Expressions crossed with intensities and methods, and those that are listed one by one."""
        found = []
        crossed = [table.get(key) for key in ("expressions", "intensities", "methods", "films")]
        if any(part is not None for part in crossed):
            if not all(isinstance(part, list) and part for part in crossed):
                self.problems.append(f"{where} needs lists of expressions, intensities, methods and films together")
                return ()
            expressions, intensities, methods, films = crossed
            for method in methods:  # type: ignore[union-attr]
                for expression in expressions:  # type: ignore[union-attr]
                    for intensity in intensities:  # type: ignore[union-attr]
                        cell = {"expression": expression, "intensity": intensity, "method": method}
                        try:
                            paths = [str(film).format(**cell) for film in films]  # type: ignore[union-attr]
                        except (KeyError, IndexError, ValueError):
                            self.problems.append(f"{where}: films may hold {{expression}}, {{intensity}}, {{method}}")
                            return ()
                        found.append({"name": f"{expression}{intensity}_{method}", "films": paths, **cell})
        listed = table.get("stimulus", [])
        found += listed if isinstance(listed, list) else []
        stimuli = []
        for row in found:
            name = str(row.get("name", "")) if isinstance(row, Mapping) else ""
            if not _NAME.fullmatch(name):
                self.problems.append(f"{where}: the stimulus {name!r} needs a name of letters, digits, _ . and -")
                continue
            films = row.get("films", [])
            if not isinstance(films, list) or not 1 <= len(films) <= 2:
                self.problems.append(f"{where}: the stimulus {name} needs one or two films")
                continue
            missing = [key for key in ("expression", "intensity", "method") if key not in row]
            if missing or not _whole(row["intensity"]):
                self.problems.append(f"{where}: the stimulus {name} needs expression, method and a whole intensity")
                continue
            stimuli.append(
                Stimulus(
                    name,
                    str(row["expression"]),
                    row["intensity"],
                    str(row["method"]),
                    tuple(str(film) for film in films),
                )
            )
        if not stimuli:
            self.problems.append(f"{where} has no stimulus")
        return tuple(stimuli)


def _whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def read_study(folder: str | PathLike[str], *, films: bool = True) -> Study:
    """Read `study.toml` of a folder.

    Parameters
    ----------
    folder : path
        The study's folder, or the file itself.
    films : bool
        Whether the films must be there.

    Returns
    -------
    Study

    Raises
    ------
    SignfaceError
        There is no such file, it is not TOML, or something in it is missing or wrong; everything is said at once. A
        film is absent, or lies outside the folder.

    Examples
    --------
    >>> from pathlib import Path
    >>> import signface as sf
    >>> study = read_study(Path(sf.__file__).parent / "study/examples/group-1", films=False)
    >>> len(study.stimuli)
    54
    """
    file = Path(folder)
    file = file / "study.toml" if file.is_dir() else file
    if not file.is_file():
        raise SignfaceError(
            "no such study", file=file, hint="signface study new group-1 FOLDER makes one to begin with"
        )
    try:
        table = tomllib.loads(file.read_text(encoding="utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SignfaceError(f"is not TOML: {error}", file=file) from error
    study, problems = _study(table, file.parent.resolve())
    if study is not None:
        problems += _bad_films(study, films)
    if problems or study is None:
        more = f" (and {len(problems) - 8} more)" if len(problems) > 8 else ""
        raise SignfaceError("; ".join(problems[:8]) + more, file=file)
    return study


def _study(table: Mapping, folder: Path) -> tuple[Study | None, list[str]]:
    """The study and what is wrong with it."""
    languages = table.get("languages")
    if (
        not isinstance(languages, list)
        or not languages
        or not all(re.fullmatch("[a-z]{2,3}", str(x)) for x in languages)
    ):
        return None, ['languages must be a list such as ["fr", "en"]']
    reader = _Reader(tuple(languages))
    name = str(table.get("name", ""))
    if not _NAME.fullmatch(name):
        reader.problems.append("name must be one word of letters, digits, _ . and -")
    seed = table.get("seed", 0)
    if not _whole(seed) or seed < 0:
        reader.problems.append("seed must be a whole number")
        seed = 0
    asked = {}
    for place, row in enumerate(_tables(table, "question", reader), start=1):
        question = reader.question(row, f"question {place}")
        if question is not None:
            if question.column in asked:
                reader.problems.append(f"two questions have the column {question.column}")
            asked[question.column] = question
    personal = [reader.question(row, f"personal {i}") for i, row in enumerate(_tables(table, "personal", reader), 1)]
    known = [question for question in personal if question is not None]
    columns = [question.column for question in known]
    for column in sorted({c for c in columns if columns.count(c) > 1 or c in asked}):
        reader.problems.append(f"two questions have the column {column}")
    blocks = []
    for place, row in enumerate(_tables(table, "block", reader), start=1):
        where = f"block {place}"
        wanted = row.get("questions", list(asked))
        unknown = [str(column) for column in wanted if column not in asked]
        if unknown or not wanted:
            reader.problems.append(f"{where}: no question has the column {', '.join(unknown) or '(none)'}")
        blocks.append(
            Block(
                title=reader.texts(row, "title", where, needed=False),
                text=reader.texts(row, "text", where, needed=False),
                questions=tuple(asked[column] for column in wanted if column in asked),
                stimuli=reader.stimuli(row, where),
            )
        )
    if not blocks:
        reader.problems.append("there is no [[block]] of stimuli")
    names = [stimulus.name for block in blocks for stimulus in block.stimuli]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        reader.problems.append(f"stimuli are named twice: {', '.join(twice[:5])}")
    words = table.get("words", {})
    study = Study(
        folder=folder,
        name=name,
        languages=tuple(languages),
        title=reader.texts(table, "title", "the study"),
        consent=reader.texts(table, "consent", "the study"),
        instructions=reader.texts(table, "instructions", "the study", needed=False),
        thanks=reader.texts(table, "thanks", "the study", needed=False),
        instruction_film=table.get("instruction_film"),
        seed=seed,
        personal=tuple(known),
        blocks=tuple(blocks),
        words=words if isinstance(words, Mapping) else {},
    )
    return study, reader.problems


def _tables(table: Mapping, key: str, reader: _Reader) -> list[Mapping]:
    rows = table.get(key, [])
    if not isinstance(rows, list) or not all(isinstance(row, Mapping) for row in rows):
        reader.problems.append(f"{key} must be written as [[{key}]]")
        return []
    return rows


def _bad_films(study: Study, wanted: bool) -> list[str]:
    """Films that lie outside the folder, are of a kind that browsers do not play, or are missing."""
    problems, missing = [], []
    for film in study.films:
        path = (study.folder / film).resolve()
        if not path.is_relative_to(study.folder):
            problems.append(f"the film {film} lies outside the study's folder")
        elif path.suffix.lower() not in FILM_ENDINGS:
            problems.append(f"the film {film} is neither .mp4 nor .webm")
        elif wanted and not path.is_file():
            missing.append(film)
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        problems.append(f"films are missing: {', '.join(missing[:3])}{more} (signface study render makes them)")
    return problems
