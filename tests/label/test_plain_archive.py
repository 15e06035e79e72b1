"""Models of arrays and plain values are written and read without skops, and nothing else is."""

import io
import json
import subprocess
import sys
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from sklearn.linear_model import LinearRegression

from signface.label.intensity import IntensityClassifier
from signface.label.plain_archive import TREE, is_plain, plain_entries, read_plain
from signface.sequence.crf import ChainLabeller


def model():
    made = ChainLabeller()
    made.bases_, made.n_features_in_, made.classes_ = ("a", "b"), 2, np.array(["A", "N"])
    made.weights_ = {"left": [np.arange(6.0).reshape(2, 3), np.float32(2.5)], "right": {1: None, 2: True}}
    made.again_ = made.classes_
    return made


def archive(entries):
    written = io.BytesIO()
    with zipfile.ZipFile(written, "w") as new:
        for name, content in entries.items():
            new.writestr(name, content)
    return zipfile.ZipFile(written)


def test_a_model_of_arrays_comes_back_as_it_was():
    read = read_plain(archive(plain_entries({"labels": model()})))["labels"]
    assert type(read) is ChainLabeller
    assert read.get_params() == model().get_params()
    assert read.bases_ == ("a", "b")
    np.testing.assert_array_equal(read.classes_, model().classes_)
    assert read.again_ is read.classes_
    np.testing.assert_array_equal(read.weights_["left"][0], model().weights_["left"][0])
    assert type(read.weights_["left"][1]) is np.float32
    assert read.weights_["right"] == {1: None, 2: True}


plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | arrays.arrays("<f8", (2, 3)),
    lambda parts: (
        st.lists(parts, max_size=3)
        | st.lists(parts, max_size=3).map(tuple)
        | st.dictionaries(st.integers() | st.text(max_size=3), parts, max_size=3)
    ),
    max_leaves=8,
)


@given(plain)
@settings(deadline=None, max_examples=60)
def test_any_plain_value_comes_back_with_its_type(value):
    holder = ChainLabeller()
    holder.value_ = value
    read = read_plain(archive(plain_entries({"labels": holder})))["labels"]
    np.testing.assert_equal(read.value_, value)
    assert repr(read.value_) == repr(value)
    again = plain_entries({"labels": read})
    assert again == plain_entries({"labels": holder})


def test_labels_and_intensities_are_read_together():
    intensity = IntensityClassifier()
    intensity.bases_, intensity.levels_ = ("a", "b"), np.array([1, 2, 3])
    intensity.lines_ = np.array([[2.0, -1.0], [2.0, -3.0]])
    read = read_plain(archive(plain_entries({"labels": model(), "intensity": intensity})))
    assert type(read["labels"]) is ChainLabeller
    assert type(read["intensity"]) is IntensityClassifier
    np.testing.assert_array_equal(read["intensity"].lines_, intensity.lines_)


@pytest.mark.parametrize(
    "node", [{"model": ["Popen", {}]}, {"model": ["HeadMotion", {}]}, {"call": []}, {"array": "absent.npy"}, {}]
)
def test_nothing_but_our_models_is_made(node):
    with pytest.raises((KeyError, ValueError)):
        read_plain(archive({TREE: json.dumps({"labels": node})}))


def test_a_model_with_anything_else_in_it_is_not_written():
    assert not is_plain(LinearRegression())
    mixed = model()
    for other in (LinearRegression(), np.add):
        mixed.regression_ = other
        with pytest.raises(TypeError, match=r"labels\.regression_"):
            plain_entries({"labels": mixed})


def test_arrays_of_objects_are_not_unpickled():
    content = io.BytesIO()
    np.save(content, np.array([print], dtype=object), allow_pickle=True)
    entries = plain_entries({"labels": model()})
    with pytest.raises(ValueError, match="allow_pickle"):
        read_plain(archive(entries | {"labels.classes_.npy": content.getvalue()}))


@pytest.mark.slow
def test_help_and_solving_import_no_learning():
    code = """
import sys
from signface.cli.main import main
import signface.annotation, signface.solver.solving, signface.takes.formats.c3d, signface.face.layout_files
print([name for name in ("pandas", "sklearn", "scipy.stats", "skops", "torch") if name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
