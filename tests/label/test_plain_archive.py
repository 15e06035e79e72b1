"""Archives of arrays and plain values are read without skops, and nothing else is."""

import io
import json
import subprocess
import sys
import zipfile

import numpy as np
import pytest
import skops.io
from sklearn.linear_model import LinearRegression

from signface.label.intensity import IntensityClassifier
from signface.label.plain_archive import SCHEMA, read_plain
from signface.sequence.crf import ChainLabeller


def model():
    made = ChainLabeller()
    made.bases_, made.n_features_in_, made.classes_ = ("a", "b"), 2, np.array(["A", "N"])
    made.weights_ = {"left": [np.arange(6.0).reshape(2, 3), np.float32(2.5)], "right": {1: None, 2: True}}
    made.again_ = made.classes_
    return made


def archive(estimator, change=None):
    written = io.BytesIO(skops.io.dumps(estimator))
    if change is not None:
        with zipfile.ZipFile(written) as old:
            parts = {name: old.read(name) for name in old.namelist()}
        schema = json.loads(parts[SCHEMA])
        change(schema)
        written = io.BytesIO()
        with zipfile.ZipFile(written, "w") as new:
            for name, content in (parts | {SCHEMA: json.dumps(schema)}).items():
                new.writestr(name, content)
    return zipfile.ZipFile(written)


def test_a_model_of_arrays_is_read_as_skops_reads_it():
    read = read_plain(archive(model()))
    same = skops.io.loads(skops.io.dumps(model()), trusted=["signface.sequence.crf.ChainLabeller"])
    assert type(read) is ChainLabeller
    assert read.get_params() == same.get_params()
    assert read.bases_ == same.bases_ == ("a", "b")
    np.testing.assert_array_equal(read.classes_, same.classes_)
    assert read.again_ is read.classes_
    np.testing.assert_array_equal(read.weights_["left"][0], same.weights_["left"][0])
    assert type(read.weights_["left"][1]) is np.float32
    assert read.weights_["right"] == same.weights_["right"] == {1: None, 2: True}


def test_labels_and_intensities_are_read_together():
    intensity = IntensityClassifier()
    intensity.bases_, intensity.levels_ = ("a", "b"), np.array([1, 2, 3])
    intensity.lines_ = np.array([[2.0, -1.0], [2.0, -3.0]])
    read = read_plain(archive({"labels": model(), "intensity": intensity}))
    assert type(read["labels"]) is ChainLabeller
    assert type(read["intensity"]) is IntensityClassifier
    np.testing.assert_array_equal(read["intensity"].lines_, intensity.lines_)


def rename(kind, module):
    def change(schema):
        schema["__class__"], schema["__module__"] = kind, module

    return change


def newer(schema):
    schema["protocol"] = 99


@pytest.mark.parametrize(
    "change", [rename("Popen", "subprocess"), rename("HeadMotion", "signface.takes.stabilisation"), newer]
)
def test_an_archive_of_another_type_is_left_to_skops(change):
    assert read_plain(archive(model(), change)) is None


def test_a_model_with_anything_else_in_it_is_left_to_skops():
    assert read_plain(archive(LinearRegression())) is None
    mixed = model()
    mixed.regression_ = LinearRegression()
    assert read_plain(archive(mixed)) is None
    mixed.regression_ = np.add
    assert read_plain(archive(mixed)) is None


def test_arrays_of_objects_are_not_unpickled():
    def change(schema):
        node = schema["content"]["content"]["classes_"]
        node["file"] = "objects.npy"

    content = io.BytesIO()
    np.save(content, np.array([print], dtype=object), allow_pickle=True)
    changed = archive(model(), change)
    written = io.BytesIO()
    with zipfile.ZipFile(written, "w") as new:
        for name in changed.namelist():
            new.writestr(name, changed.read(name))
        new.writestr("objects.npy", content.getvalue())
    with pytest.raises(ValueError, match="allow_pickle"):
        read_plain(zipfile.ZipFile(written))


def test_help_and_solving_import_no_learning():
    code = """
import sys
from signface.cli.main import main
import signface.annotation, signface.solver.solving, signface.takes.formats.c3d, signface.face.layout_files
print([name for name in ("pandas", "sklearn", "scipy.stats", "skops", "torch") if name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
