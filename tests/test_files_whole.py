"""Output files appear whole or not at all."""

import os

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


@pytest.mark.skipif(os.name == "nt", reason="there are no such modes")
@pytest.mark.parametrize("mode", [0o600, 0o664, 0o640])
def test_a_file_that_is_there_keeps_its_mode(tmp_path, mode):
    target = tmp_path / "a.eaf"
    target.write_text("old")
    target.chmod(mode)
    with whole_file(target) as temporary:
        temporary.write_text("new")
    assert (target.read_text(), target.stat().st_mode & 0o777) == ("new", mode)


@pytest.mark.skipif(os.name == "nt", reason="links want a privilege there")
def test_a_symbolic_link_stays_one_and_leads_to_what_was_written(tmp_path):
    (tmp_path / "store").mkdir()
    (tmp_path / "work").mkdir()
    link = tmp_path / "work" / "a.eaf"
    link.symlink_to("../store/a.eaf")
    for text in ("first", "second"):  # it leads nowhere yet, then to a file
        with whole_file(link) as temporary:
            temporary.write_text(text)
        assert link.is_symlink()
        assert (tmp_path / "store" / "a.eaf").read_text() == text
    ring = tmp_path / "ring"
    ring.symlink_to(ring)
    with pytest.raises(SignfaceError, match="ring: cannot be written"), whole_file(ring):
        pass
