"""Output files appear whole or not at all."""

import pytest

from signface.errors import SignfaceError
from signface.files import whole_file


def test_a_file_appears_when_the_block_ends_well(tmp_path):
    with whole_file(tmp_path / "deep" / "a.csv") as temporary:
        assert temporary.suffix == ".csv"
        temporary.write_text("all of it")
        assert not (tmp_path / "deep" / "a.csv").exists()
    assert (tmp_path / "deep" / "a.csv").read_text() == "all of it"


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path):
    target = tmp_path / "a.csv"
    target.write_text("old")

    def fail_halfway():
        with whole_file(target) as temporary:
            temporary.write_text("half")
            raise RuntimeError("the disk is full")

    with pytest.raises(RuntimeError, match="the disk is full"):
        fail_halfway()
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_new_file_has_the_usual_permissions(tmp_path):
    with whole_file(tmp_path / "a.csv") as temporary:
        temporary.write_text("x")
    (tmp_path / "b.csv").write_text("x")
    assert (tmp_path / "a.csv").stat().st_mode == (tmp_path / "b.csv").stat().st_mode


def test_a_folder_in_the_way_of_the_folder_is_a_clear_error(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(SignfaceError, match="cannot be written"), whole_file(tmp_path / "file" / "a.csv"):
        pass


def test_a_folder_in_the_way_of_the_file_is_a_clear_error(tmp_path):
    (tmp_path / "a.csv").mkdir()
    with pytest.raises(SignfaceError, match="is a folder"), whole_file(tmp_path / "a.csv") as temporary:
        temporary.write_text("x")
    assert [file.name for file in tmp_path.iterdir()] == ["a.csv"]


def test_the_error_says_file_problem_and_hint_on_one_line():
    error = SignfaceError("has no\npoints", file="take.c3d", hint="export it again")
    assert str(error) == "take.c3d: has no points. Export it again"
