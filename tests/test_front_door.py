"""`import signface as sf`: light, complete, and the same for Python, type checkers and readers."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import signface as sf

STUB = ast.parse(Path(sf.__file__).with_suffix(".pyi").read_text())

#: name: module of the package that the stub takes it from.
SOURCES = {
    alias.name: f"signface.{node.module}" if node.module else "signface"
    for node in STUB.body
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
}


def test_importing_signface_imports_no_room_and_nothing_heavy():
    loaded = subprocess.run(
        [
            sys.executable,
            "-c",
            "import sys; before = set(sys.modules); import signface; print(*set(sys.modules) - before)",
        ],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    rooms = {name for name in loaded if name.startswith("signface.")}
    third_party = {name.split(".")[0] for name in loaded} - sys.stdlib_module_names - {"signface", "lazy_loader"}
    assert "signface" in loaded
    assert not rooms
    assert not third_party


@pytest.mark.parametrize("name", sf.__all__)
def test_every_name_is_the_one_that_the_stub_promises(name):
    thing = getattr(sf, name)
    if isinstance(thing, type(sf)):
        assert thing.__name__ == f"signface.{name}"
    else:
        assert thing is getattr(sys.modules[SOURCES[name]], name)


def test_stub_and_runtime_have_the_same_names():
    (listed,) = (ast.literal_eval(node.value) for node in STUB.body if isinstance(node, ast.Assign))
    assert sorted(listed) == sorted(sf.__all__) == sorted(SOURCES)


def test_every_name_stands_once_in_the_table_and_the_table_has_no_other():
    assert sf.__doc__ is not None
    names = re.findall(r"`(\w+)`", sf.__doc__)
    assert sorted(names) == sorted(sf.__all__)


@pytest.mark.parametrize("name", sorted({*sf.__all__} - {"datasets"}))
def test_every_name_has_an_example_that_runs(name):
    """It has one here, and `tests/test_docstrings.py` runs it."""
    examples = [line for line in (getattr(sf, name).__doc__ or "").splitlines() if line.lstrip().startswith(">>>")]
    assert examples
    assert not [line for line in examples if "+SKIP" in line]


def test_no_name_is_hidden_by_a_room_or_module():
    folder = Path(sf.__file__).parent
    rooms = {path.stem for path in folder.iterdir() if path.suffix == ".py" or (path / "__init__.py").is_file()}
    assert rooms & set(sf.__all__) == {"datasets"}


def test_a_take_of_the_bundled_corpus_that_is_not_there_is_one_clear_line():
    with pytest.raises(sf.SignfaceError, match="there is no take M3_EU_01") as error:
        sf.datasets.mini_take("M3_EU_01")
    assert "M2_EU_04" in str(error.value)


def test_python_dash_m_signface_is_the_command():
    said = subprocess.run(
        [sys.executable, "-m", "signface", "--help"], capture_output=True, text=True, check=True
    ).stdout
    assert "signface COMMAND --help" in said
