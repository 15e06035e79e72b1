"""The scripts of the gallery, and those of the README and the guides, run as they stand."""

import re
import runpy
import shutil
from pathlib import Path

import matplotlib as mpl
import pytest

from tests.conftest import REPOSITORY

SCRIPTS = sorted((REPOSITORY / "examples").glob("*.py"))

#: What solves or trains more than once.
SLOW = {"02", "03", "05", "06", "07", "08"}


def _script(path: Path):
    slow = path.name[:2] in SLOW
    return pytest.param(path, id=path.stem, marks=[pytest.mark.slow] if slow else [])


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """An empty folder to work in, and figures that nobody sees."""
    from matplotlib import pyplot as plt

    monkeypatch.chdir(tmp_path)
    with mpl.rc_context({"backend": "Agg"}):
        yield tmp_path
        plt.close("all")


@pytest.mark.parametrize("script", [_script(path) for path in SCRIPTS])
def test_a_script_of_the_gallery_runs(script, elsewhere, capsys):
    runpy.run_path(str(script), run_name="__main__")
    assert capsys.readouterr().out.strip()


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_of_the_gallery_is_short_and_uses_the_front_door(script):
    text = script.read_text(encoding="utf-8")
    assert "import signface as sf\n" in text
    assert not re.search(r"^from signface", text, flags=re.MULTILINE)
    assert sum(1 for line in text.splitlines() if line.strip() and not line.startswith("#")) <= 60


@pytest.mark.slow
def test_the_script_of_the_readme_runs(elsewhere, capsys):
    text = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    shutil.copytree(REPOSITORY / "corpora" / "mini", elsewhere / "corpora" / "mini")
    names = {"__name__": "script"}
    for script in re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL):
        exec(compile(script, "README.md", "exec"), names)
    assert capsys.readouterr().out.strip()
