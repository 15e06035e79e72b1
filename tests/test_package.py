"""What `pip install` puts on a machine: the package, its data, and nothing that only the checkout needs."""

import os
import subprocess
import sys
import zipfile

import pytest

from signface.errors import SignfaceError
from signface.label import persistence
from tests.conftest import REPOSITORY

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    build = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--no-deps",
        "--no-build-isolation",
        "--wheel-dir",
        folder,
    ]
    subprocess.run([*build, REPOSITORY], check=True)
    (file,) = folder.glob("signface-*.whl")
    return file


@pytest.fixture(scope="module")
def names(wheel):
    with zipfile.ZipFile(wheel) as archive:
        return [name.removeprefix("signface/") for name in archive.namelist()]


def test_the_wheel_holds_every_module_and_what_types_the_front_door(names):
    modules = {path.relative_to(REPOSITORY / "signface").as_posix() for path in (REPOSITORY / "signface").rglob("*.py")}
    assert modules <= set(names)
    assert {"__init__.pyi", "py.typed"} <= set(names)


def test_the_wheel_holds_data_and_no_build_scripts(names):
    models = {name for name in names if name.startswith("models/")}
    kinds = {name.split("/")[1] for name in models}
    assert kinds == {"README.md", "channels", "classifiers", "faces", "heads", "layouts"}
    assert not [name for name in models if name.endswith(".py")]
    assert {"corpora/mini/takes.csv", "models/faces/default.glb", "models/layouts/default-40.csv"} <= set(names)


def test_the_wheel_holds_what_annotates_and_stays_small(wheel, names):
    classifiers = [name for name in names if name.endswith(".skops")]
    assert classifiers == ["models/classifiers/default.skops", "models/classifiers/lse-questions.skops"]
    assert wheel.stat().st_size < 8e6


def test_the_wheel_alone_runs_the_demo_outside_the_checkout(wheel, tmp_path):
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "site")}
    command = [sys.executable, "-m", "signface"]
    subprocess.run(
        [*command, "demo", "-o", "out"], cwd=tmp_path, env=environment, check=True, stdout=subprocess.DEVNULL
    )
    assert len(list((tmp_path / "out").glob("*.eaf"))) == 4
    absent = subprocess.run(
        [
            *command,
            "annotate",
            "site/signface/corpora/mini/M2_EU_04.c3d",
            "--classifier",
            "thesis-forest",
            "-o",
            "x.eaf",
        ],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert absent.returncode == 2
    assert "models/classifiers/thesis-forest.skops from a checkout" in absent.stderr
    assert absent.stderr.count("\n") == 1


def test_classifiers_said_to_stay_in_the_checkout_are_there_and_not_in_the_wheel(names):
    for name in persistence.ONLY_IN_CHECKOUTS:
        assert persistence.load_model(name).name == name
        assert f"models/classifiers/{name}.skops" not in names


def test_a_name_of_neither_is_no_classifier():
    with pytest.raises(SignfaceError, match="no such classifier"):
        persistence.load_model("thesis-tree")
