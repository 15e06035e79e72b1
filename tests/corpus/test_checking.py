"""Every problem of a corpus is found at once, each on a line that names the file, what is wrong and what to do."""

from __future__ import annotations

import shutil
from dataclasses import replace

import pandas as pd
import pytest

from signface.cli.main import main
from signface.corpus.checking import TakeCheck, check_corpus, check_take
from signface.corpus.manifest import TakeEntry, write_takes
from signface.corpus.origin import make_recipe
from signface.descriptors_files import write_weights
from signface.elan.writing import write_eaf
from signface.errors import SignfaceError
from signface.segmentation.segments import Segments
from tests.fixtures.hand_made import example


@pytest.fixture
def joy(tmp_path):
    """A take of weights with a reference annotation that fits, and its row."""
    made = example(["N", "J", "N"], take="joy", signer="S1", kind="EU")
    entry = TakeEntry(tmp_path / "joy.csv", "S1", "EU", annotation=tmp_path / "joy.eaf")
    write_weights(made.descriptors, entry.path)
    write_eaf(made.reference, entry.annotation, signer="S1")
    return made, entry


def problems(entry, *signers) -> list[str]:
    """Problems of one take, looked at in this process."""
    return list(check_take(TakeCheck(0, entry, make_recipe(), frozenset(signers or [entry.signer]))).problems)


def labelled(rows, name="joy") -> Segments:
    table = pd.DataFrame(rows, columns=["start_s", "end_s", "label"])
    table.insert(2, "kind", ["stable" if len(label) == 1 else "transition" for label in table["label"]])
    return Segments(table, name=name)


def test_a_corpus_without_problems_has_none(joy):
    assert problems(joy[1]) == []


@pytest.mark.parametrize(
    ("content", "said"),
    [(b"", "is empty"), (b"nonsense", "joy.csv"), (b"time_s,a,residual_mm\n0,x,0\n1,1,1\n", "not numbers")],
)
def test_an_unreadable_recording(joy, content, said):
    joy[1].path.write_bytes(content)
    (problem,) = problems(joy[1])
    assert said in problem
    assert str(joy[1].path) in problem


def test_a_damaged_annotation_and_an_unreadable_recording_are_both_told(joy):
    _, entry = joy
    entry.path.write_bytes(b"")
    entry.annotation.write_text("<ANNOTATION_DOCUMENT")
    found = problems(entry)
    assert len(found) == 2
    assert any("not well-formed" in problem for problem in found)


def test_an_annotation_without_the_reference_tier(joy):
    made, entry = joy
    write_eaf(made.reference, entry.annotation, signer="S2", replace=True)
    found = problems(entry, "S1", "S2")
    assert len(found) == 1
    assert "no tier affect@S1 or affect" in found[0]


def test_an_annotation_of_a_signer_whom_the_table_does_not_know(joy):
    made, entry = joy
    write_eaf(made.reference, entry.annotation, signer="S9", replace=True)
    assert any("affect@S9" in problem and "not in takes.csv" in problem for problem in problems(entry, "S1", "S2"))


def test_all_labels_outside_the_vocabulary_are_named_and_the_rest_is_still_checked(joy):
    _, entry = joy
    text = entry.annotation.read_text()
    entry.annotation.write_text(text.replace(">J<", ">Joy<").replace(">NJ<", ">N-J<"))
    entry = replace(entry, start_s=30.0)
    found = problems(entry)
    assert any("'N-J', 'Joy'" in problem for problem in found)
    assert any("lasts from 30.000" in problem for problem in found)


@pytest.mark.parametrize("start_s", [-2.0, 2.0])
def test_an_annotation_that_reaches_beyond_its_take(joy, start_s):
    found = problems(replace(joy[1], start_s=start_s))
    assert any("annotates 0.000 to 3.800 s, but the take joy.csv lasts" in problem for problem in found)


def test_a_frame_or_two_beyond_the_take_is_no_problem(joy):
    assert problems(replace(joy[1], start_s=-0.1)) == []


def test_an_annotation_that_covers_a_part_of_its_take(joy):
    write_eaf(labelled([(0.0, 1.0, "N")]), joy[1].annotation, signer="S1", replace=True)
    (problem,) = problems(joy[1])
    assert "annotates 26% of the take" in problem


def test_a_reference_tier_without_annotations(joy):
    write_eaf(labelled([]), joy[1].annotation, signer="S1", replace=True)
    (problem,) = problems(joy[1])
    assert "is empty" in problem


def test_markers_that_no_layout_knows_and_a_neutral_time_outside_the_take(mini, face, tmp_path):
    from signface.face.layout_files import read_layout
    from signface.takes.formats.c3d import write_c3d
    from signface.takes.reading import read_take

    take = read_take(mini.takes[1].path)
    foreign = replace(take, labels=tuple(f"P{number}" for number in range(len(take.labels))))
    write_c3d(foreign, tmp_path / "foreign.c3d")
    (problem,) = problems(TakeEntry(tmp_path / "foreign.c3d", "M1", "EU"))
    assert "foreign.c3d" in problem
    assert "no shipped layout knows the markers" in problem
    (problem,) = problems(replace(mini.takes[1], neutral_s=99.0))
    assert "neutral_s of 99 s is outside the take" in problem
    heads = read_layout("default-40", face).head_labels[2:]
    faces = [label for label in take.labels if label not in heads]
    headless = replace(take, labels=tuple(faces), positions=take.select(faces))
    write_c3d(headless, tmp_path / "headless.c3d")
    (problem,) = problems(TakeEntry(tmp_path / "headless.c3d", "M1", "EU"))
    assert "has 2 of the 6 head markers of default-40, 3 are needed" in problem


def test_the_bundled_corpus_has_no_problem(mini):
    found = check_corpus(mini.folder, workers=2)
    assert found.problems == ()
    assert "4 takes of 2 signers, 4 annotated" in found.summary


def test_all_problems_of_a_corpus_are_told_at_once(joy, tmp_path, capsys):
    made, entry = joy
    for name in ("copy", "cut", "twin"):
        shutil.copy(entry.path, tmp_path / f"{name}.csv")
    (tmp_path / "cut.csv").write_bytes(b"")
    write_weights(replace(made.descriptors, weights=made.descriptors.weights / 2), tmp_path / "twin.parquet")
    rows = [
        "take,signer,kind,annotation,neutral_s,face",
        "joy.csv,S1,EU,joy.eaf,,",
        "copy.csv,s1,EU,joy.eaf,,",
        "cut.csv,S1,EU,,,",
        "gone.csv,S1,EU,,soon,",
        "twin.parquet,S1,,,,",
        "twin.csv,S1,EU,,,nobody",
    ]
    (tmp_path / "takes.csv").write_text("\n".join(rows) + "\n")
    assert main(["corpus", "check", str(tmp_path), "--workers", "1"]) == 2
    shown = capsys.readouterr()
    lines = [line for line in shown.err.splitlines() if line.startswith("signface: ")]
    for said in (
        "line 5: no such file: gone.csv (take)",
        "line 5: neutral_s is no number of seconds: soon",
        "line 6: kind is empty",
        "S1 and s1 differ in their case only",
        "twin.parquet, twin.csv would share the name twin",
        "cut.csv: the file is empty",
        "nobody: no such face",
        "no tier affect@s1",
        "joy.csv: holds the same recording as",
    ):
        assert any(said in line for line in lines), said
    assert f"{len(lines)} problems" in shown.out
    assert len(lines) == 9


def test_what_is_no_corpus_is_one_clear_error(tmp_path):
    with pytest.raises(SignfaceError, match=r"has no takes\.csv"):
        check_corpus(tmp_path)
    write_takes(tmp_path, [])
    (problem,) = check_corpus(tmp_path).problems
    assert "it has no take" in problem
