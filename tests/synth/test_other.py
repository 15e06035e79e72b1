"""The second synthetic corpus: readable like the first, repeatable, and written apart from it."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

from signface.cli.main import main
from signface.corpus.examples import solve_corpus
from signface.corpus.manifest import read_corpus
from signface.face.layout_files import read_layout
from signface.label.persistence import read_card
from signface.label.vocabulary import AFFECT
from signface.synth.other.acting import follow, wander
from signface.synth.other.corpus import OtherRequest, make_other_take, plan_other
from signface.synth.other.people import draw_person
from tests.conftest import REPOSITORY

ROOM = REPOSITORY / "signface" / "synth" / "other"


def test_it_borrows_nothing_of_the_first_generator_but_the_writing_of_files():
    borrowed = set()
    for path in ROOM.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("signface.synth."):
                borrowed.add(node.module)
    assert {name for name in borrowed if not name.startswith("signface.synth.other")} == {"signface.synth.corpus"}


def test_no_classifier_that_ships_was_trained_on_it():
    made = {request.name for request in plan_other(signers=30)}
    for path in (REPOSITORY / "models" / "classifiers").glob("*.skops"):
        assert not made & {take[: len("P1_EU_01")] for take in read_card(path).takes}, path
    assert "synth.other" not in (REPOSITORY / "signface" / "synth" / "variety.py").read_text(encoding="utf-8")


def test_a_take_depends_on_its_seed_and_name_only():
    two, three = plan_other(signers=2), plan_other(signers=3)
    assert set(two) < set(three)
    request = OtherRequest(5, 1, "IE", 2)
    first, again = make_other_take(request), make_other_take(request)
    np.testing.assert_array_equal(first.take.positions, again.take.positions)
    assert first.reference == again.reference
    other = make_other_take(OtherRequest(6, 1, "IE", 2))
    assert other.take.n_frames != first.take.n_frames


@pytest.mark.parametrize("kind", ["IE", "EU"])
def test_the_reference_says_when_the_face_shows_what(kind, face):
    made = make_other_take(OtherRequest(11, 0, kind, 3))
    table = made.boundaries.table
    assert set(table.loc[table.kind == "stable", "label"]) <= set(AFFECT.values)
    assert table["end_s"].to_numpy()[:-1] == pytest.approx(table["start_s"].to_numpy()[1:])
    if kind == "IE":  # joy: lip corners are pulled in the middle of its segments, and not before the first
        smile = made.weights.weights[:, face.names.index("mouthSmileLeft")]
        time = made.weights.time
        shown = table[table.label == "J"]
        middle = [
            smile[np.argmin(np.abs(time - (start + end) / 2))] for start, end in shown[["start_s", "end_s"]].values
        ]
        before = smile[time < table["end_s"].iloc[0] - 0.1].max()
        assert min(middle) > before + 0.05


def test_landmarks_jitter_by_one_to_three_millimetres_in_space():
    for signer in range(3):
        take = make_other_take(OtherRequest(21, signer, "IE", signer)).take
        still = take.positions[: round(0.8 * take.rate)]
        head = still[:, -6:] - still[:, -6:].mean(axis=1, keepdims=True)
        spread = np.sqrt((head.std(axis=0) ** 2).sum(axis=1).mean())
        assert 0.4 < spread < 3.2, signer
        assert 25.0 <= take.rate <= 60.0


def test_some_people_show_everything_with_half_the_strength(face):
    layout = read_layout("default-40", face)
    strength = [draw_person(face, layout, np.random.default_rng(seed)).strength for seed in range(60)]
    reserved = np.mean(np.array(strength) < 0.6)
    assert 0.15 < reserved < 0.55


def test_a_face_is_drawn_to_what_is_meant_and_stays_there():
    command = np.zeros((240, 2))
    command[60:] = 1.0
    way = follow(command, np.array([0.05, 0.1]), 240.0)
    assert (way[:60] == 0).all()
    assert (np.diff(way, axis=0) >= 0).all()
    assert way[-1] == pytest.approx(1.0, abs=1e-2)
    assert (way[80] > way[80][1]).tolist() == [True, False]  # the longer lag is later


def test_wandering_lasts_as_long_as_it_says():
    values = wander(6000, 60.0, 0.2, 20, np.random.default_rng(0))
    alike = np.mean(values[12:] * values[:-12])  # 0.2 s later
    assert values.std() == pytest.approx(1.0, abs=0.06)
    assert alike == pytest.approx(np.exp(-1), abs=0.06)


@pytest.mark.slow
def test_the_command_writes_a_corpus_that_is_read_and_solved(tmp_path, capsys):
    folder = tmp_path / "other"
    assert main(["synth", str(folder), "--generator", "other", "--signers", "1", "--seed", "2", "--kinds", "IE"]) == 0
    corpus = read_corpus(folder)
    assert [entry.kind for entry in corpus] == ["IE"] * 6
    assert (folder / "truth" / "P1_IE_J.parquet").exists()
    examples = solve_corpus(corpus.select(kinds=["IE"]))
    assert len(examples) == 6
    assert {e.vocabulary.name for e in examples} == {AFFECT.name}
    before = {path: path.read_bytes() for path in folder.glob("*.c3d")}
    assert main(["synth", str(folder), "--generator", "other", "--signers", "1", "--seed", "2", "--kinds", "IE"]) == 0
    assert {path: path.read_bytes() for path in folder.glob("*.c3d")} == before


@pytest.mark.parametrize(
    ("arguments", "said"),
    [(["--kinds", "SE"], "IE, EU"), (["--signers", "0"], "holds nothing"), (["--mini"], "--mini")],
)
def test_what_it_cannot_make_is_said(arguments, said, tmp_path: Path, capsys):
    assert main(["synth", str(tmp_path / "x"), "--generator", "other", *arguments]) == 2
    assert said in capsys.readouterr().err
