"""Takes of a corpus with their reference annotations, ready for training."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from signface.corpus.examples import solve_corpus
from signface.corpus.manifest import Corpus, TakeEntry, read_corpus
from signface.descriptors_files import write_weights
from signface.elan.writing import write_eaf
from signface.errors import SignfaceError
from signface.files import bundled_corpus
from tests.fixtures.hand_made import example


@pytest.fixture
def entry(tmp_path):
    made = example(["N", "J", "N"], take="laugh", signer="S1", kind="EU")
    path, annotation = tmp_path / "S1" / "laugh.csv", tmp_path / "S1" / "laugh.eaf"
    write_weights(made.descriptors, path)
    write_eaf(made.reference, annotation, signer="S1")
    return made, TakeEntry(path, "S1", "EU", annotation=annotation)


def test_an_example_has_the_weights_and_the_reference_of_its_take(entry, tmp_path):
    made, row = entry
    (found,) = solve_corpus(Corpus(tmp_path, (row,)))
    assert (found.take, found.signer, found.kind) == ("S1/laugh", "S1", "EU")
    np.testing.assert_allclose(found.descriptors.weights, made.descriptors.weights, atol=1e-6)
    assert found.reference.table.label.tolist() == made.reference.table.label.tolist()
    np.testing.assert_allclose(found.reference.table.start_s, made.reference.table.start_s, atol=1e-3)


def test_a_take_is_placed_on_the_time_line_of_its_video(entry, tmp_path):
    _, row = entry
    later = TakeEntry(row.path, "S1", "EU", annotation=row.annotation, start_s=12.5)
    (found,) = solve_corpus(Corpus(tmp_path, (later,)))
    assert found.descriptors.start == 12.5


def test_takes_without_annotation_are_left_out(entry, tmp_path):
    _, row = entry
    bare = TakeEntry(row.path, "S1", "IE")
    assert len(solve_corpus(Corpus(tmp_path, (bare, row)))) == 1
    with pytest.raises(SignfaceError, match="none of the takes"):
        solve_corpus(Corpus(tmp_path, (bare,)))


def test_what_is_wrong_in_one_of_several_takes_is_said(entry, tmp_path):
    _, row = entry
    broken = tmp_path / "S1" / "broken.c3d"
    broken.write_bytes(b"nonsense")
    with pytest.raises(SignfaceError, match=r"broken\.c3d"):
        solve_corpus(Corpus(tmp_path, (row, TakeEntry(broken, "S1", "EU", annotation=row.annotation))))


@pytest.mark.slow
def test_a_corpus_named_from_another_folder_than_the_one_before_is_solved(tmp_path, monkeypatch):
    for name in ("one", "two"):
        shutil.copytree(bundled_corpus(), tmp_path / name / f"mini-{name}")
        monkeypatch.chdir(tmp_path / name)
        takes = solve_corpus(read_corpus(f"mini-{name}").select(kinds=["EU"]))
        assert [example.take for example in takes] == ["M1_EU_11", "M2_EU_04"]
