"""A layout proposed for markers whose names say nothing."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from signface.errors import SignfaceError
from signface.face.layout_files import read_layout, write_layout
from signface.face.reading import read_face, read_identities
from signface.face.suggestion import suggest_layout


@pytest.mark.slow
def test_markers_of_another_head_in_another_frame_come_near_their_places():
    face = read_face("default")
    layout = read_layout("default-40", face)
    shapes, _ = read_identities()
    rng = np.random.default_rng(2)
    change = np.tensordot(
        np.where(rng.random(len(shapes)) < 0.3, np.abs(rng.normal(0, 0.4, len(shapes))), 0), shapes, 1
    )
    change *= 5 / np.sqrt((change[face.moving] ** 2).sum(axis=1).mean())
    turn = Rotation.random(random_state=2).as_matrix()
    points = layout.interpolate(face.mesh.vertices + change, layout.labels) @ turn.T + (500.0, 20.0, 1200.0)
    found = suggest_layout(layout.labels, points, face)
    error = np.linalg.norm(found.layout.points(face, layout.labels) - layout.points(face, layout.labels), axis=1)
    on_face = np.array(layout.roles) == "face"
    assert np.median(error[on_face]) < 6.0
    assert np.percentile(error[on_face], 90) < 12.0
    assert set(layout.head_labels) <= set(found.layout.head_labels)


def test_too_few_markers_are_refused():
    with pytest.raises(SignfaceError, match="only 3 markers"):
        suggest_layout(["a", "b", "c"], np.eye(3), read_face("default"))


@pytest.mark.slow
def test_a_written_layout_is_read_back(tmp_path):
    face = read_face("default")
    layout = read_layout("mediapipe", face)
    write_layout(layout, tmp_path / "copy.csv", face)
    copy = read_layout(tmp_path / "copy.csv", face)
    assert copy.roles == layout.roles
    assert np.abs(copy.points(face, copy.labels) - layout.points(face, layout.labels)).max() < 1e-3


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "csv"),
        ("name,where\na,1\n", "columns"),
        ("marker,role,vertex\nA,nose,1\n", "role"),
        ("marker,role,vertex\nA,face,1\nA,face,2\n", "repeated"),
        ("marker,role,vertex\nA,face,99999\n", "99999"),
        ("marker,role,x,y,z\nA,face,0,0,900\n", "from the skin"),
        ("marker,role,vertex\nA,face,\n", "without a vertex"),
    ],
)
def test_a_faulty_layout_is_refused_in_a_clear_line(tmp_path, content, said):
    file = tmp_path / "layout.csv"
    file.write_text(content)
    with pytest.raises(SignfaceError, match=said) as caught:
        read_layout(file, read_face("default"))
    assert "layout.csv" in str(caught.value)
