"""The scripts of the documentation run as they stand there."""

from __future__ import annotations

import re

import pytest

from signface.label.persistence import load_model
from tests.conftest import REPOSITORY


def scripts(page="scripting.md"):
    text = (REPOSITORY / "docs" / page).read_text(encoding="utf-8")
    return re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)


@pytest.mark.slow
def test_the_script_of_the_documentation_trains_compares_and_saves(tmp_path, monkeypatch, capsys):
    script, _ = scripts()
    work = [line for line in script.splitlines() if line and not line.startswith(("from ", "import "))]
    assert len(work) <= 20
    monkeypatch.chdir(tmp_path)
    exec(compile(script, "docs/scripting.md", "exec"), {"__name__": "script"})
    card = load_model(tmp_path / "mine.skops").card
    assert (card.classifier, card.normalise, card.signers) == ("knn3", "signer", ("M1", "M2"))
    assert set(card.parameters) == {"metric", "weights"}
    assert str(dict(card.parameters)) in capsys.readouterr().out


def test_the_script_of_stretches_and_tables_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "script"}
    exec(compile(scripts()[1], "docs/scripting.md", "exec"), names)
    assert names["weights"].time[[0, -1]].tolist() == [1.0, 3.995]
    assert [file.name for file in tmp_path.iterdir()] == ["weights.parquet"]


def test_the_script_of_the_data_opens_what_ships():
    (script,) = scripts("data.md")
    names = {"__name__": "script"}
    exec(compile(script, "docs/data.md", "exec"), names)
    assert {names[what].name for what in ("take", "weights", "reference")} == {"M1_EU_11"}
    assert names["model"].card.bases == names["face"].names
    assert set(names["layout"].labels) == set(names["take"].labels)
