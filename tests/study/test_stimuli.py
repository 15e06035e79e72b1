"""The films of a study, from its takes."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from signface.cli.main import main
from signface.descriptors import Descriptors
from signface.descriptors_files import write_weights
from signface.errors import SignfaceError
from signface.render.film import read_film
from signface.study.design import read_study
from signface.study.examples import copy_example
from signface.study.films.stimuli import parse_method, plan_films, read_excerpts
from tests.fixtures.study_site import SMALL

RENDER = """
[render]
rate = 10
size = [64, 64]
takes = "takes"
[render.methods.LSTS30]
solver = "thin-shell"
alpha = 0.3
[render.methods.pair]
solver = "least-squares"
[render.methods.video]
weights = "weights"
colour = [0.6, 0.6, 0.7]
"""


@pytest.fixture
def study_folder(tmp_path, mini, face):
    """The small study, its films to be made of a bundled take."""
    (tmp_path / "study.toml").write_text(SMALL + RENDER, encoding="utf-8")
    (tmp_path / "takes").mkdir()
    take = next(iter(mini)).path
    with open(tmp_path / "takes" / "excerpts.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["excerpt", "take", "start_s", "end_s"])
        for number, name in enumerate(("A1", "A2", "A3", "J1", "J2", "J3")):
            writer.writerow([name, take, 0.5 + number, 1.0 + number])
    for name in ("A3", "J3"):
        rest = Descriptors(np.zeros((11, face.n_bases)), face.names, 20.0)
        write_weights(rest, tmp_path / "weights" / f"{name}.csv")
    return tmp_path


@pytest.mark.slow
def test_one_command_makes_every_film_of_a_study(study_folder, capsys):
    assert main(["study", "render", str(study_folder)]) == 0
    study = read_study(study_folder)  # no film is missing
    assert len(study.films) == 8
    lengths = {film: len(list(read_film(study_folder / film, rate=10, size=(64, 64)))) for film in study.films}
    assert set(lengths.values()) <= {5, 6}
    assert "8 films" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        (RENDER, "", "says nothing of films"),
        ("[64, 64]", '"64x64"', "render.size"),
        ("rate = 10", "rate = 0", "render.rate"),
        ("rate = 10", "rate = 10\nhead = 1", "render.head"),
        ("[render.methods.pair]", "[render.methods.paar]", "how to make"),
        ('solver = "least-squares"', "", "needs one of"),
        ("[0.6, 0.6, 0.7]", "7", "colour must"),
    ],
)
def test_a_mistake_in_how_films_are_made_is_said(study_folder, before, after, said):
    text = (study_folder / "study.toml").read_text(encoding="utf-8")
    (study_folder / "study.toml").write_text(text.replace(before, after), encoding="utf-8")
    with pytest.raises(SignfaceError, match=said):
        plan_films(read_study(study_folder, films=False))


@pytest.mark.slow
def test_stimuli_keep_the_head_still_unless_the_study_lets_it_move(study_folder, face, capsys):
    def films() -> dict[str, bytes]:
        assert main(["study", "render", str(study_folder)]) == 0
        return {file.name: file.read_bytes() for file in (study_folder / "films").iterdir()}

    still = films()
    text = (study_folder / "study.toml").read_text(encoding="utf-8")
    (study_folder / "study.toml").write_text(text.replace("rate = 10", "rate = 10\nhead = true"), encoding="utf-8")
    assert main(["study", "render", str(study_folder)]) == 2  # the weights files know no head
    assert "how the head moves is unknown" in capsys.readouterr().err
    head = np.tile(np.eye(4), (11, 1, 1))
    head[5:, :3, :3] = Rotation.from_euler("x", 20, degrees=True).as_matrix()
    for name in ("A3", "J3"):
        nod = Descriptors(np.zeros((11, face.n_bases)), face.names, 20.0, head=head)
        write_weights(nod, study_folder / "weights" / f"{name}.csv")
    moving = films()
    assert {name for name in still if still[name] != moving[name]} == set(still)
    assert main(["study", "render", str(study_folder), "--no-head"]) == 2
    assert "[render]" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("A1,take.c3d,2,1", "ends before"),
        ("A1,take.c3d,x,1", "no excerpt"),
        ("A1,take.c3d,0,1\nA1,b.c3d,0,1", "twice"),
    ],
)
def test_a_mistake_in_the_excerpts_is_said_with_its_line(tmp_path, row, said):
    file = tmp_path / "excerpts.csv"
    file.write_text(f"excerpt,take,start_s,end_s\n{row}\n")
    with pytest.raises(SignfaceError, match=said):
        read_excerpts(file)


def test_the_names_of_the_thesis_are_methods():
    assert (parse_method("LSTS30").method, parse_method("LSTS30").alpha) == ("thin-shell", 0.3)
    assert parse_method("LSTS70").alpha == 0.7
    assert parse_method("nnls").alpha is None
    for name in ("LSTS", "LSTS300", "FS"):
        with pytest.raises(SignfaceError, match="no method"):
            parse_method(name)


def test_the_studies_that_ship_say_how_each_of_their_films_is_made(tmp_path):
    for name in ("group-1", "group-2a", "group-2b"):
        copy_example(name, tmp_path / name)
        study = read_study(tmp_path / name, films=False)

        def takes_made(folder, signer):
            folder.mkdir()
            rows = [
                f"{expression}{n},take.c3d,0,1" for expression in ("A", "D", "F", "J", "Sa", "Su") for n in (1, 2, 3)
            ]
            (folder / "excerpts.csv").write_text("excerpt,take,start_s,end_s\n" + "\n".join(rows) + "\n")

        films = plan_films(study, takes_made=takes_made)
        assert {plan.output.relative_to(study.folder).as_posix() for plan in films.plans} == set(study.films)
    with pytest.raises(SignfaceError, match="not empty"):
        copy_example("group-1", tmp_path / "group-1")
    with pytest.raises(SignfaceError, match="no example"):
        copy_example("group-9", tmp_path / "x")
