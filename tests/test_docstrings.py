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


#: Modules whose examples solve several takes, train, or compile.
SLOW = {
    "signface.annotation",
    "signface.corpus.checking",
    "signface.corpus.examples",
    "signface.corpus.running",
    "signface.evaluation.measure",
    "signface.label.persistence",
    "signface.render.film",
    "signface.report.evaluation.report",
    "signface.solver.solving",
    "signface.solver.thin_shell",
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else []) for name in MODULES]
)
def test_examples_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    module = importlib.import_module(name)
    runner = doctest.DocTestRunner(optionflags=OPTIONS)
    for test in doctest.DocTestFinder().find(module):
        if at_front_door(module, test.name.removeprefix(name).lstrip(".").partition(".")[0]):
            test.globs = {"sf": sf}  # what a reader of that page has, who pastes the example
        runner.run(test)
    assert runner.tries
    assert not runner.failures


def at_front_door(module, name):
    return module is sf.datasets or (bool(name) and name in sf.__all__ and getattr(sf, name) is getattr(module, name))
