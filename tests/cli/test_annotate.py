"""What `signface annotate` says before the long work."""

from __future__ import annotations

import pytest

from signface.cli.main import main
from signface.datasets import mini_file


@pytest.fixture
def no_solving(monkeypatch):
    """A solve would be the long work: it is not reached."""

    def reached(*arguments, **options):
        raise AssertionError("the solve was begun")

    monkeypatch.setattr("signface.solver.solving.solve", reached)


@pytest.mark.usefixtures("no_solving")
def test_an_annotators_file_is_refused_before_the_solve(tmp_path, capsys):
    theirs = tmp_path / "theirs.eaf"
    theirs.write_text("<ANNOTATION_DOCUMENT/>")
    assert main(["annotate", str(mini_file()), "-o", str(theirs)]) == 2
    assert "exists and holds annotations that signface did not write" in capsys.readouterr().err
    assert theirs.read_text() == "<ANNOTATION_DOCUMENT/>"


@pytest.mark.usefixtures("no_solving")
def test_into_and_output_exclude_each_other(tmp_path, capsys):
    assert main(["annotate", str(mini_file()), "--into", "lab.eaf", "-o", str(tmp_path / "out.eaf")]) == 2
    assert "--into and --output exclude each other" in capsys.readouterr().err


@pytest.mark.usefixtures("no_solving")
def test_a_folder_in_which_nobody_may_write_is_refused_before_the_solve(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("os.access", lambda place, mode: False)  # root may write anywhere
    assert main(["annotate", str(mini_file()), "-o", str(tmp_path / "new" / "out.eaf")]) == 2
    assert "cannot be written" in capsys.readouterr().err
