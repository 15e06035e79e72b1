"""Folders whose files' names say enough become a corpus; equal problems of many takes are told once."""

from __future__ import annotations

import pytest

import signface as sf
from signface.corpus.checking import check_corpus, grouped
from signface.corpus.manifest import MANIFEST
from signface.errors import SignfaceError, SignfaceWarning
from tests.elan.test_frame_labels import labelled


def openface(folder, *names):
    """Tables as OpenFace leaves them, empty: a manifest does not open them."""
    for name in names:
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.with_suffix(".csv").touch()
        file.with_name(f"{file.name}_of_details.txt").touch()


def test_a_folder_of_openface_gets_a_manifest(tmp_path):
    openface(tmp_path, "ask", "anna/tell", "anna/day2/tell")
    (tmp_path / "ask.eaf").touch()
    (tmp_path / "notes.csv").touch()  # no recording: nothing of OpenFace's lies beside it
    with pytest.warns(SignfaceWarning, match=r"lists 3 takes .* the signer of 1 take is not known"):
        corpus = sf.read_corpus(tmp_path)
    rows = {take.path.relative_to(tmp_path).as_posix(): take for take in corpus}
    assert {path: take.signer for path, take in rows.items()} == {
        "ask.csv": "unknown",
        "anna/tell.csv": "anna",
        "anna/day2/tell.csv": "anna",
    }
    assert rows["ask.csv"].annotation == tmp_path / "ask.eaf"
    written = (tmp_path / MANIFEST).read_bytes()
    assert sf.read_corpus(tmp_path) == corpus  # without a warning, which would be an error here
    assert (tmp_path / MANIFEST).read_bytes() == written


@pytest.mark.slow
def test_points_of_kinect_and_their_frame_labels_are_a_corpus(tmp_path):
    for name in ("a_topics", "b_wh_question"):
        labelled(tmp_path, [0, 1, 1, 0] * 20, name)
    with pytest.warns(SignfaceWarning, match="lists 2 takes"):
        corpus = sf.read_corpus(tmp_path)
    assert [(take.signer, take.kind, take.annotation.name) for take in corpus] == [
        ("a", "topics", "a_topics_targets.txt"),
        ("b", "wh_question", "b_wh_question_targets.txt"),
    ]
    checked = check_corpus(tmp_path, tier="expression", workers=1)
    assert not any("_targets.txt" in problem.partition(":")[0] for problem in checked.problems)


def test_a_folder_of_nothing_is_refused_and_stays_empty(tmp_path):
    (tmp_path / "notes.csv").touch()
    with pytest.raises(SignfaceError, match=f"has no {MANIFEST}"):
        sf.read_corpus(tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["notes.csv"]


def test_equal_problems_are_told_once_and_others_stay():
    equal = [f"lab/S{number}.eaf: no tier affect@S{number} or affect" for number in range(270)]
    other = ["lab/takes.csv: line 3: signer is empty", "lab/S4.csv: is empty"]
    assert grouped([*equal, *other]) == [f"in 270 files, first {equal[0]}", *other]
    assert grouped(equal[:2]) == equal[:2]
