"""The films of a study: excerpts of takes, solved by each method and drawn.

- `parse_method`: `LSTS30` is the thin shell with alpha 0.3; the solvers' own names stand for themselves.
- `solve_methods`: weights of one take by several methods, the take cleaned and adapted once.
- `plan_films`: what `[render]` of a study asks for.
- `render_study`: make the films.
- `make_synthetic_takes`: takes of a signer who does not exist, for the studies that ship.
"""

from __future__ import annotations

import csv
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from signface.descriptors import Descriptors
from signface.descriptors_files import read_weights
from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.files import whole_file
from signface.render.still import SKIN, SKINS
from signface.settings.solve import METHODS, SolveSettings
from signface.signer import Signer
from signface.study.design import Study

#: Seconds of rest shown before an expression's onset and after its end.
AROUND_S = 0.5
#: Extra seconds for the transition to and from it.
CHANGE_S = 0.6


def parse_method(name: str, settings: SolveSettings | None = None) -> SolveSettings:
    """How a method solves, by its name in the thesis (`LSTS30`: least squares, thin shell, alpha 0.30) or a solver's.

    Parameters
    ----------
    name : str
    settings : SolveSettings, optional
        Everything else; a rival of the thin shell is told nothing that only the thin shell knows.

    Raises
    ------
    SignfaceError
        No method has this name.

    Examples
    --------
    >>> parse_method("LSTS30").alpha
    0.3
    """
    settings = SolveSettings() if settings is None else settings
    match = re.fullmatch(r"LSTS(\d{2,3})", name)
    if match and int(match[1]) <= 100:
        return settings.changed(method="thin-shell", alpha=int(match[1]) / 100)
    if name == "thin-shell":
        return settings.changed(method=name, alpha=None)
    if name in METHODS:
        return settings.changed(method=name, alpha=None, sparsity=None, head_slack=None, slip=None)
    raise SignfaceError(
        f"no method is called {name!r}", hint=f"write LSTS30 for alpha 0.3, or one of {', '.join(METHODS)}"
    )


def solve_methods(
    take: Any,
    face: FaceModel,
    layout: MarkerLayout,
    methods: Mapping[str, SolveSettings],
    *,
    signer: Signer | None = None,
) -> dict[str, Descriptors]:
    """Weights of a take by each method; the take is cleaned and adapted once.

    Parameters
    ----------
    take : Take
    face, layout
    methods : mapping of name to SolveSettings
        They differ in how displacements become weights; what comes before is as the first of them says. Creep is taken
        away only where it says so: rivals are compared on the same displacements.
    signer : Signer, optional
        Whose take it is; their own bases serve the thin shell.

    Raises
    ------
    SignfaceError
        As `signface.solver.solving.solve`.
    """
    from signface.solver.methods import make_solver
    from signface.solver.solving import prepare_take

    first = next(iter(methods.values()))
    prepared = prepare_take(take, face, layout, settings=first.changed(creep=bool(first.creep)), signer=signer)
    results = {}
    for name, how in methods.items():
        bases = prepared.preparation.signer_bases if how.method == "thin-shell" else None
        solver = make_solver(how.method, face, prepared.layout, signer_bases=bases, **how.solver_options)
        solution = solver.solve(prepared.displacements)
        results[name] = prepared.described(face, solution, prepared.note, f"solve {name}")
    return results


@dataclass(frozen=True)
class Excerpt:
    """Seconds of a recording that become a stimulus."""

    name: str
    take: Path
    start_s: float
    end_s: float


@dataclass(frozen=True)
class Look:
    """Where one method's films come from, and how they look (`[render.methods.NAME]`).

    Parameters
    ----------
    method : SolveSettings or None
        Solve the take; or
    weights : Path or None
        a folder of weights files, named by excerpt or by take; or
    videos : Path or None
        a folder of films, named by excerpt.
    colour : (float, float, float) or None
        Skin of one colour.
    """

    method: SolveSettings | None = None
    weights: Path | None = None
    videos: Path | None = None
    colour: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class FilmPlan:
    """One film to be made."""

    excerpt: Excerpt
    method: str
    look: Look
    output: Path


@dataclass(frozen=True)
class StudyFilms:
    """Everything that `[render]` of a study says.

    `head`: whether it moves; stimuli of the thesis keep it still, so that only the face tells expressions apart.
    `skin`: the tone of the avatar's skin; synthetic signers are not all alike.
    """

    plans: tuple[FilmPlan, ...]
    rate: float
    size: tuple[int, int]
    face: str
    layout: str | None
    head: bool = False
    skin: str = SKIN


def plan_films(study: Study, *, takes_made: Callable[[Path, int], None] | None = None) -> StudyFilms:
    """What films the study needs, and how each is made.

    Parameters
    ----------
    study : Study
    takes_made : callable, optional
        Makes synthetic takes in a folder for a signer's number, where the study asks for them and the folder is
        missing.

    Raises
    ------
    SignfaceError
        `[render]` is missing or wrong, an excerpt or a method is not described.
    """
    file = study.folder / "study.toml"
    table = tomllib.loads(file.read_text(encoding="utf-8-sig")).get("render")
    if not isinstance(table, dict) or not isinstance(table.get("methods"), dict):
        raise SignfaceError("says nothing of films under [render] and [render.methods]", file=file)
    size = table.get("size", [640, 480])
    if not (isinstance(size, list) and len(size) == 2 and all(isinstance(side, int) for side in size)):
        raise SignfaceError("render.size must be [width, height]", file=file)
    rate = table.get("rate", 25)
    if not isinstance(rate, (int, float)) or not 1 <= rate <= 120:
        raise SignfaceError("render.rate must be a number from 1 to 120", file=file)
    head = table.get("head", False)
    if not isinstance(head, bool):
        raise SignfaceError("render.head must be true or false", file=file)
    folder = study.folder / str(table.get("takes", "takes"))
    signer = table.get("synthetic_signer", -1)
    skin = table.get(
        "skin", list(SKINS)[(1 + signer) % len(SKINS)] if isinstance(signer, int) and signer >= 0 else SKIN
    )
    if skin not in SKINS:
        raise SignfaceError(f"render.skin must be one of {', '.join(SKINS)}", file=file)
    if not folder.is_dir() and isinstance(signer, int) and signer >= 0 and takes_made is not None:
        takes_made(folder, signer)
    excerpts = read_excerpts(folder / "excerpts.csv")
    looks = {name: _look(study.folder, name, row) for name, row in table["methods"].items()}
    plans: dict[Path, FilmPlan] = {}
    for stimulus in study.stimuli.values():
        for film in stimulus.films:
            name, _, method = Path(film).stem.rpartition("_")
            if name not in excerpts or method not in looks:
                raise SignfaceError(
                    f"does not say how to make {film}",
                    file=file,
                    hint=f"name films EXCERPT_METHOD.mp4, with {name or film} in {folder.name}/excerpts.csv and "
                    f"[render.methods.{method}]",
                )
            output = study.folder / film
            plans[output] = FilmPlan(excerpts[name], method, looks[method], output)
    return StudyFilms(
        tuple(plans.values()),
        float(rate),
        (size[0], size[1]),
        str(table.get("face", "default")),
        table.get("layout"),
        head,
        skin,
    )


def read_excerpts(file: Path) -> dict[str, Excerpt]:
    """`excerpts.csv`: excerpt, take (beside the file), start_s, end_s.

    Raises
    ------
    SignfaceError
        The file is missing, or a column or a number in it.
    """
    if not file.is_file():
        raise SignfaceError(
            "no such file", file=file, hint="it has the columns excerpt, take, start_s, end_s, one row per excerpt"
        )
    excerpts = {}
    with open(file, newline="", encoding="utf-8-sig") as lines:
        for number, row in enumerate(csv.DictReader(lines), start=2):
            try:
                times = float(row["start_s"]), float(row["end_s"])
                excerpt = Excerpt(row["excerpt"], file.parent / row["take"], *times)
            except (KeyError, TypeError, ValueError) as error:
                raise SignfaceError(
                    f"line {number} is no excerpt", file=file, hint="the columns are excerpt, take, start_s, end_s"
                ) from error
            if not times[0] < times[1]:
                raise SignfaceError(f"line {number}: the excerpt ends before it begins", file=file)
            if excerpt.name in excerpts:
                raise SignfaceError(f"line {number}: the excerpt {excerpt.name} is named twice", file=file)
            excerpts[excerpt.name] = excerpt
    return excerpts


def _look(folder: Path, name: str, row: Mapping) -> Look:
    where = f"[render.methods.{name}]"
    colour = row.get("colour")
    if colour is not None and not (isinstance(colour, list) and len(colour) == 3):
        raise SignfaceError(f"{where}: colour must be three numbers from 0 to 1", file=folder / "study.toml")
    skin = None if colour is None else (float(colour[0]), float(colour[1]), float(colour[2]))
    given = [key for key in ("solver", "weights", "videos") if key in row]
    if len(given) != 1:
        raise SignfaceError(f"{where} needs one of solver, weights, videos", file=folder / "study.toml")
    if given == ["solver"]:
        alpha = row.get("alpha")
        how = SolveSettings.from_dict({"method": row["solver"], "alpha": alpha}, file=folder / "study.toml")
        return Look(method=how, colour=skin)
    place = folder / str(row[given[0]])
    return Look(weights=place, colour=skin) if given == ["weights"] else Look(videos=place)


def _under(settings: SolveSettings | None, method: SolveSettings) -> SolveSettings:
    """What a study says of a method, and for everything else what the laboratory says."""
    return method if settings is None else settings.changed(method=method.method, alpha=method.alpha)


def render_study(
    films: StudyFilms,
    *,
    settings: SolveSettings | None = None,
    signer: Signer | None = None,
    show: Callable[[Iterable], Iterable] = iter,
) -> int:
    """Make every film; the number of films.

    Parameters
    ----------
    films : StudyFilms
    settings : SolveSettings, optional
        How takes are solved, but for the face, layout, method and alpha, which the study states.
    signer : Signer, optional
        Whose takes they are.
    show : callable
        Wraps the list of films, for a progress bar.

    Raises
    ------
    SignfaceError
        A take, a weights file or a video is missing or cannot be used, or heads shall move and one's pose is unknown.
    """
    from signface.face.layout_files import choose_layout, read_layout
    from signface.face.reading import read_face
    from signface.render.film import Avatar, at_rate, head_at_rate, pictures_of, read_film, write_film
    from signface.takes.reading import read_take

    face = read_face(films.face)
    methods = {plan.method: _under(settings, plan.look.method) for plan in films.plans if plan.look.method is not None}

    @cache
    def solved(file: Path) -> dict[str, Descriptors]:
        take = read_take(file)
        layout = choose_layout(take.labels, face) if films.layout is None else read_layout(films.layout, face)
        return solve_methods(take, face, layout, methods, signer=signer)

    @cache
    def avatar(colour: tuple[float, float, float] | None) -> Avatar:
        return Avatar(face, size=films.size, colour=colour, skin=films.skin)

    @cache
    def weights_file(folder: Path, excerpt: Excerpt) -> tuple[Descriptors, bool]:
        for name, whole in ((excerpt.name, False), (excerpt.take.stem, True)):
            for ending in (".csv", ".parquet"):
                if (folder / f"{name}{ending}").is_file():
                    return read_weights(folder / f"{name}{ending}"), whole
        raise SignfaceError("no such file", file=folder / f"{excerpt.name}.csv", hint="one weights file an excerpt")

    plans = sorted(films.plans, key=lambda plan: (str(plan.excerpt.take), str(plan.output)))
    count = 0
    for plan in show(plans):
        excerpt, look = plan.excerpt, plan.look
        if look.videos is not None:
            file = next(
                (
                    look.videos / f"{excerpt.name}{end}"
                    for end in (".mp4", ".webm", ".mov", ".avi")
                    if (look.videos / f"{excerpt.name}{end}").is_file()
                ),
                look.videos / f"{excerpt.name}.mp4",
            )
            write_film(plan.output, read_film(file, rate=films.rate, size=films.size), films.rate)
        else:
            if look.weights is not None:
                descriptors, whole = weights_file(look.weights, excerpt)
            else:
                descriptors, whole = solved(excerpt.take)[plan.method], True
            _same_bases(descriptors, face)
            times = {"start_s": excerpt.start_s, "end_s": excerpt.end_s} if whole else {}
            weights = at_rate(descriptors, films.rate, **times)
            head = head_at_rate(descriptors, films.rate, **times) if films.head else None
            if films.head and head is None:  # beside films that nod, a still head would be a difference of methods
                hint = "leave head = true out of [render], or give weights with head poses"
                raise SignfaceError(f"{descriptors.name}: how the head moves is unknown", hint=hint)
            write_film(plan.output, pictures_of(avatar(look.colour), weights, head), films.rate)
        count += 1
    return count


def _same_bases(descriptors: Descriptors, face: FaceModel) -> None:
    if descriptors.names != face.names:
        raise SignfaceError(
            f"{descriptors.name}: its bases are not those of the face {face.name}", hint="name its face"
        )


def make_synthetic_takes(folder: Path, signer: int, *, show: Callable[[Iterable], Iterable] = iter) -> None:
    """Takes of each expression in three intensities, by a signer who does not exist, and their excerpts.

    `weights/` holds the weights that the signer truly had, on the default face.

    Parameters
    ----------
    folder : Path
        New; takes, `excerpts.csv` and `weights/` are written there.
    signer : int
        Which signer, from 0.
    show : callable
        Wraps the list of takes, for a progress bar.
    """
    from signface.descriptors_files import write_weights
    from signface.synth.corpus import make_take, plan_corpus
    from signface.takes.formats.c3d import write_c3d

    requests = [
        request for request in plan_corpus(signers=signer + 1, seed=6, kinds=["IE"]) if request.signer == signer
    ]
    rows = []
    for request in show(requests):
        made = make_take(request)
        write_c3d(made.take, folder / f"{request.name}.c3d")
        write_weights(made.avatar_weights, folder / "weights" / f"{request.name}.parquet")
        table = made.boundaries.table
        for intensity in (1, 2, 3):
            held = table[(table["kind"] == "stable") & (table["intensity"] == intensity)]
            if held.empty:
                continue
            first = held.iloc[0]
            start = max(0.0, float(first["start_s"]) - AROUND_S - CHANGE_S)
            end = min(made.take.time[-1], float(first["end_s"]) + AROUND_S + CHANGE_S)
            rows.append((f"{first['label']}{intensity}", f"{request.name}.c3d", f"{start:.3f}", f"{end:.3f}"))
    with whole_file(folder / "excerpts.csv") as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([("excerpt", "take", "start_s", "end_s"), *rows])
