"""The face that ships: clean, named, symmetric, and what it says about itself is so."""

import numpy as np
import pytest

from signface.face.checking import check_face
from signface.face.layout_files import choose_layout, read_layout
from signface.face.reading import read_identities, read_parts


def test_the_default_face_is_one_clean_skin(face):
    report = check_face(face)
    assert report.clean
    assert (report.duplicate_vertices, report.unreferenced_vertices, report.degenerate_triangles) == (0, 0, 0)
    assert report.components == 1
    assert report.boundaries == 4  # two eyes, the mouth, the neck


def test_it_has_the_51_arkit_bases_and_all_of_them_move_skin(face):
    assert face.n_bases == 51
    assert "tongueOut" not in face.names
    assert face.names[:2] == ("eyeBlinkLeft", "eyeLookDownLeft")
    assert check_face(face).still_on_skin == ()


def test_it_has_the_size_of_an_adult_head_in_millimetres(face):
    assert face.unit == "mm"
    width, height, _ = np.ptp(face.mesh.vertices, axis=0)
    assert 140 < width < 190
    assert 230 < height < 300


def test_left_is_the_signers_left_which_is_positive_x(face):
    for name, base in zip(face.names, face.bases):
        size = np.linalg.norm(base, axis=1)
        centre = (size @ face.mesh.vertices[:, 0]) / size.sum()
        if name in ("jawLeft", "jawRight", "mouthLeft", "mouthRight"):
            centre = base[:, 0].sum()
        if name.endswith("Left"):
            assert centre > 0
        if name.endswith("Right"):
            assert centre < 0


def test_triangles_face_outwards(face):
    centroids = face.mesh.vertices[face.mesh.triangles].mean(axis=1)
    front = centroids[:, 2] > 60
    assert (face.mesh.triangle_normals[front, 2] > 0).mean() > 0.85


def test_head_shapes_and_parts_fit_the_face(face):
    shapes, names = read_identities()
    assert shapes.shape == (len(names), len(face.mesh.vertices), 3)
    assert len(set(names)) == len(names) > 100
    assert (np.abs(shapes).max(axis=(1, 2)) >= 0.1).all()
    assert read_parts().names == face.names


@pytest.mark.parametrize("name", ["default-40", "mediapipe"])
def test_shipped_layouts_stand_on_the_skin_symmetrically_and_see_every_base(face, name):
    layout = read_layout(name, face)
    assert check_face(face, layout).still_at_markers == ()
    points = layout.points(face, layout.labels)
    gap = np.linalg.norm(points[:, None] * (-1, 1, 1) - points[None], axis=2).min(axis=1)
    assert (gap < 0.5).mean() > 0.95
    rigid = np.linalg.norm(layout.interpolate(face.bases, layout.head_labels), axis=2)
    assert len(layout.head_labels) >= 6
    assert rigid.max() < 2.0


def test_the_forty_markers_and_six_on_the_head(face):
    layout = read_layout("default-40", face)
    assert (len(layout.face_labels), len(layout.head_labels)) == (40, 6)


def test_a_take_of_landmark_numbers_gets_the_mediapipe_layout(face):
    contours = ["0", "7", "10", "13", "14", "17", "21", "33", "37", "46", "52", "61", "105", "127", "152", "263"]
    assert choose_layout(contours, face).name == "mediapipe"
    assert choose_layout(read_layout("default-40", face).labels, face).name == "default-40"


def test_landmarks_stand_on_the_lip_and_lid_they_are_named_for(face):
    layout = read_layout("mediapipe", face)
    moved = layout.interpolate(face.bases, layout.labels)

    def along(base, label):
        return moved[face.names.index(base), layout.labels.index(label), 1]

    assert along("jawOpen", "14") < 4 * along("jawOpen", "13") - 5  # the lower lip drops, the upper stays
    assert along("eyeBlinkLeft", "386") < -5 < along("eyeBlinkLeft", "374")
    assert along("browInnerUp", "55") > 2
    assert along("eyeBlinkRight", "159") < -5
