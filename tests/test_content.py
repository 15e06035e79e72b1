"""Equality of the data objects: by what they hold."""

import ast
import copy
import pickle
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import signface as sf
from signface.descriptors import Descriptors
from signface.face.layout import MarkerLayout
from signface.face.mesh import Mesh
from signface.face.model import FaceModel
from signface.segmentation.energy import energies
from signface.segmentation.segments import Segments
from signface.signer import Signer, SignerBases
from signface.signer_level import SignerLevel
from signface.takes.take import Take

WEIGHTS = np.array([[0.0, np.nan], [0.5, 1.0], [0.2, 0.3], [0.1, 0.4]])
MESH = Mesh(np.eye(3), np.array([[0, 1, 2]]))
BASES = SignerBases(("jawOpen",), ("CHIN",), np.ones((1, 3)))
LEVEL = SignerLevel(("jawOpen",), np.array([np.nan]), np.ones(1))
TABLE = pd.DataFrame({"start_s": [0.0, 1.0], "end_s": [1.0, 2.0], "kind": "stable", "label": ["J", None]})

#: An object, and one that differs in a single value.
PAIRS = [
    (Descriptors(WEIGHTS, ("a", "b"), 50.0), {"weights": WEIGHTS * 2}),
    (Descriptors(WEIGHTS, ("a", "b"), 50.0), {"deviation": WEIGHTS}),
    (Descriptors(WEIGHTS, ("a", "b"), 50.0), {"start": 1.0}),
    (Take(np.ones((3, 2, 3)), ("a", "b"), 50.0), {"labels": ("a", "c")}),
    (MESH, {"vertices": 2 * np.eye(3)}),
    (FaceModel(MESH, np.ones((1, 3, 3)), ("jawOpen",)), {"mesh": replace(MESH, vertices=2 * np.eye(3))}),
    (FaceModel(MESH, np.ones((1, 3, 3)), ("jawOpen",)), {"colours": np.ones((3, 3))}),
    (MarkerLayout.on_vertices({"CHIN": 1}, ["HEAD"]), {"roles": ("head", "head")}),
    (Segments(TABLE), {"table": TABLE.assign(label=["J", "N"])}),
    (BASES, {"displacements": np.zeros((1, 3))}),
    (LEVEL, {"spread": np.zeros(1)}),
    (Signer("Eva", BASES, LEVEL), {"level": replace(LEVEL, spread=np.zeros(1))}),
    (energies(Descriptors(WEIGHTS, ("a", "b"), 50.0)), {"velocity": np.zeros(8)}),
]


@pytest.mark.parametrize(("thing", "change"), PAIRS, ids=lambda value: type(value).__name__)
def test_equal_is_what_holds_the_same(thing, change):
    for twin in (copy.deepcopy(thing), pickle.loads(pickle.dumps(thing)), replace(thing)):
        assert thing == twin
        assert hash(thing) == hash(twin)
        assert {thing: 1}[twin] == 1
    other = replace(thing, **change)
    assert thing != other
    assert other != thing
    assert thing != "another thing"


@pytest.mark.parametrize(
    ("thing", "shown"),
    [
        (sf.datasets.mini_take(), "<Take M2_EU_04: 1184 frames at 200 Hz, 46 markers>"),
        (sf.open_recording(sf.datasets.mini_file()), "<TakeFile M2_EU_04: 1184 frames at 200 Hz, 46 markers, on disk>"),
        (sf.datasets.mini_weights(), "<Descriptors M2_EU_04: 1184 frames at 200 Hz, 51 bases>"),
        (sf.datasets.mini_reference(), "<Segments M2_EU_04: 3 stable, 2 transitions, with labels>"),
        (sf.datasets.mini_corpus(), "<Corpus mini: 4 takes of 2 signers>"),
        (sf.load_model(), "<TrainedModel default: gru of 51 bases, for affect>"),
        (sf.read_face(), "<FaceModel default: 51 bases, 3411 vertices>"),
        (
            sf.choose_layout(sf.datasets.mini_take().labels, sf.read_face()),
            "<MarkerLayout default-40: 40 face markers, 6 head markers>",
        ),
    ],
    ids=lambda value: None if isinstance(value, str) else type(value).__name__,
)
def test_an_object_prints_as_a_few_words(thing, shown):
    assert str(thing) == repr(thing) == shown


def test_how_it_came_about_does_not_count():
    take = Descriptors(WEIGHTS, ("a", "b"), 50.0)
    assert take == take.changed("looked at")
    assert hash(take) == hash(take.changed("looked at"))
    assert replace(BASES, source="eva.csv") == BASES
    assert take != Descriptors(WEIGHTS, ("a", "b"), 50.0, name="another")


def test_an_array_is_nothing_and_nothing_is_an_array():
    with_deviation = Descriptors(WEIGHTS, ("a", "b"), 50.0, deviation=WEIGHTS)
    assert (with_deviation == replace(with_deviation, deviation=None)) is False


@pytest.mark.slow
def test_every_frozen_object_over_arrays_compares_by_content():
    """No dataclass keeps an equality that raises."""
    package = Path(sf.__file__).parent
    others = []
    for file in package.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if not isinstance(node, ast.ClassDef) or node.name.startswith("_"):
                continue
            made = " ".join(ast.unparse(decorator) for decorator in node.decorator_list)
            fields = " ".join(ast.unparse(item.annotation) for item in node.body if isinstance(item, ast.AnnAssign))
            over_arrays = re.search("ndarray|NDArray|DataFrame", fields) and "Callable" not in fields
            by_content = "eq=False" in made and "Content" in [ast.unparse(base) for base in node.bases]
            if "frozen=True" in made and over_arrays and not by_content:
                others.append(f"{file.relative_to(package)}: {node.name}")
    assert others == []
