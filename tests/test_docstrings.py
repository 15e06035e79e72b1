"""The examples in docstrings run, each module's in an empty folder, and say what they say they say."""

import doctest
import importlib
from pathlib import Path

import pytest

import signface as sf

PACKAGE = Path(sf.__file__).parent

#: Examples may leave out what of an output is of no interest with "...".
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE

#: Modules that have examples which run.
MODULES = sorted(
    ".".join(("signface", *file.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__")
    for file in PACKAGE.rglob("*.py")
    if any(">>>" in line and "+SKIP" not in line for line in file.read_text(encoding="utf-8").splitlines())
)


@pytest.mark.parametrize("name", MODULES)
def test_examples_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = doctest.testmod(importlib.import_module(name), optionflags=OPTIONS)
    assert found.attempted
    assert not found.failed
