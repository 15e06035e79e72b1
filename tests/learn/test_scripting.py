"""The script of the documentation runs as it stands there."""

from __future__ import annotations

import re
import shutil

from signface.label.persistence import load_model
from tests.conftest import REPOSITORY


def test_the_script_of_the_documentation_trains_compares_and_saves(tmp_path, monkeypatch, capsys):
    text = (REPOSITORY / "docs" / "scripting.md").read_text(encoding="utf-8")
    (script,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    work = [line for line in script.splitlines() if line and not line.startswith(("from ", "import "))]
    assert len(work) <= 20
    shutil.copytree(REPOSITORY / "corpora" / "mini", tmp_path / "corpora" / "mini")
    monkeypatch.chdir(tmp_path)
    exec(compile(script, "docs/scripting.md", "exec"), {"__name__": "script"})
    card = load_model(tmp_path / "mine.skops").card
    assert (card.classifier, card.normalise, card.signers) == ("knn3", "signer", ("M1", "M2"))
    assert set(card.parameters) == {"metric", "weights"}
    assert str(dict(card.parameters)) in capsys.readouterr().out
