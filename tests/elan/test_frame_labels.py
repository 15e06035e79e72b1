"""Labels of single frames are annotations like others."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import signface as sf
from signface.elan.frame_labels import frame_label_document
from signface.elan.reference import reference_vocabulary
from signface.errors import SignfaceError
from tests.fixtures.takes_files import write_kinect
from tests.takes.test_kinect import flat_face, times_of


def labelled(folder, shown, name="a_topics"):
    """Frame labels beside points at 16 Hz."""
    seconds = np.round(np.arange(len(shown)) / 16, 3)
    write_kinect(folder / f"{name}_datapoints.txt", flat_face(len(shown)), times_of(seconds))
    targets = folder / f"{name}_targets.txt"
    targets.write_text("".join(f"{int(one)}\n" for one in shown))
    return targets, seconds


@given(shown=st.lists(st.booleans(), min_size=2, max_size=40))
@settings(max_examples=30, deadline=None)
def test_every_row_has_its_label_again(shown, tmp_path_factory):
    file, seconds = labelled(tmp_path_factory.mktemp("gfe"), shown)
    table = sf.read_reference(file, tier="expression").table
    inside = (seconds[:, None] >= table["start_s"].to_numpy()) & (seconds[:, None] <= table["end_s"].to_numpy())
    np.testing.assert_array_equal(inside.any(axis=1), shown)
    assert set(table["label"]) <= {"topics"}


def test_the_vocabulary_is_that_of_the_folder(tmp_path):
    files = [labelled(tmp_path, [0, 1, 1, 0], name)[0] for name in ("a_topics", "a_wh_question", "b_topics")]
    assert reference_vocabulary([(file, "a") for file in files], "expression").values == ("topics", "wh_question")
    assert list(sf.read_tiers(files[1])) == ["expression"]


def test_what_does_not_fit_is_refused(tmp_path):
    file, _ = labelled(tmp_path, [0, 1, 1, 0])
    file.write_text("0\n1\n")
    with pytest.raises(SignfaceError, match="2 rows for the 4 of a_topics_datapoints"):
        frame_label_document(file)
    file.write_text("0\n1\n2\n0\n")
    with pytest.raises(SignfaceError, match="row 3 is neither 0 nor 1: '2'"):
        frame_label_document(file)
    (tmp_path / "a_topics_datapoints.txt").unlink()
    file.write_text("0\n")
    with pytest.raises(SignfaceError, match=r"has no a_topics_datapoints\.txt beside it"):
        sf.read_reference(file, tier="expression")
