"""OpenFace tables: what is read of them, however they are written, and the perspective that is undone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from signface.descriptors import Descriptors
from signface.errors import SignfaceError, SignfaceWarning
from signface.marker_names import SeveralSigners
from signface.takes.formats.openface import read_openface, true_positions
from signface.takes.formats.openface_units import read_action_units
from signface.takes.reading import open_recording, read_recording, recognise
from signface.takes.rigid import apply, inverse, rigid_transforms
from signface.takes.take import Take
from tests.fixtures.third_party import third_party_file

SAMPLES = [
    f"real/samples/{name}.csv"
    for name in ("K01_part_q_tel_slom", "K02_gen_q_dom_post", "B01_nod_1", "p0003_c02s0014w0042")
]
RIGID = [27, 28, 29, 30, 36, 39, 42, 45]


def table(times, *, success=None, faces=None, landmarks=(0, 1, 2), units=(), blanks=False, times_column=True):
    """Text of a table whose landmark k is at (k, frame, 1000 + k)."""
    count = len(times)
    header = ["frame", "face_id", *(["timestamp"] if times_column else []), "confidence", "success"]
    header += [f"{axis}_{number}" for axis in "XYZ" for number in landmarks] + list(units)
    rows = []
    for row in range(count):
        ok = 1 if success is None else success[row]
        face = 0 if faces is None else faces[row]
        cells = [row + 1, face, *([f"{times[row]:.3f}"] if times_column else []), 0.98 if ok else 0.1, ok]
        cells += [*landmarks, *([row] * len(landmarks)), *(1000 + number for number in landmarks)]
        cells += [2.5 if unit.endswith("_r") else 1 for unit in units]
        rows.append(cells)
    return "\n".join((", " if blanks else ",").join(map(str, cells)) for cells in [header, *rows]) + "\n"


@given(
    angles=st.tuples(*[st.floats(-40, 40)] * 3),
    place=st.tuples(st.floats(-300, 300), st.floats(-300, 300), st.floats(400, 1500)),
)
@settings(max_examples=40, deadline=None)
def test_a_rigid_face_stays_rigid_when_the_perspective_is_undone(angles, place):
    """Points are written along the rays of a weak-perspective fit; distances are those of the fit again."""
    shape = np.random.default_rng(1).normal(size=(68, 3)) * (40, 50, 20)
    shape -= shape.mean(axis=0)
    turned = Rotation.from_euler("XYZ", angles, degrees=True).apply(shape)
    true = turned + place
    depth = true[:, 2:]
    written = np.concatenate([true[:, :2] * depth / place[2], depth], axis=1)[None]
    np.testing.assert_allclose(true_positions(written)[0], true, atol=1e-9)


@pytest.mark.parametrize("sample", SAMPLES)
def test_real_landmarks_are_more_rigid_than_they_are_written(sample):
    """Nose and eye corners of real heads keep their shape better once the perspective is undone."""
    take = read_openface(third_party_file(sample))
    raw = np.loadtxt(third_party_file(sample), delimiter=",", skiprows=1, ndmin=2)
    names = [name.strip() for name in third_party_file(sample).open().readline().split(",")]
    written = np.stack([raw[:, [names.index(f"{axis}_{k}") for k in RIGID]] for axis in "XYZ"], axis=-1) * (1, -1, -1)
    undone = take.select([f"L{number}" for number in RIGID])

    def spread(points):
        poses = rigid_transforms(points[0], points, np.ones(points.shape[:2]))
        return np.sqrt(((apply(inverse(poses), points) - points[0]) ** 2).sum(axis=2).mean())

    # A head that hardly turns is hardly sheared: then rounding to 0.1 mm is all that differs.
    assert spread(undone) < spread(written) * 1.05 + 0.02


@pytest.mark.parametrize("sample", SAMPLES)
def test_the_signers_left_is_x_and_the_nose_is_nearest(sample):
    places = np.nanmean(read_openface(third_party_file(sample)).positions, axis=0)
    assert places[45, 0] > places[36, 0]  # the outer corners of the left and the right eye
    assert places[19, 1] > places[37, 1] > places[57, 1]  # brow, lid, lip
    assert places[30, 2] > places[2, 2]  # tip of the nose, contour


def test_blanks_after_commas_change_nothing(tmp_path):
    times = np.arange(20) / 25
    takes = []
    for blanks in (False, True):
        file = tmp_path / f"{blanks}.csv"
        file.write_text(table(times, blanks=blanks))
        assert recognise(file) == "openface"
        takes.append(read_recording(file))
    np.testing.assert_array_equal(takes[0].positions, takes[1].positions)
    assert takes[0].rate == 25.0
    assert takes[0].labels == ("L0", "L1", "L2")


def test_frames_without_a_face_are_missing(tmp_path):
    file = tmp_path / "take.csv"
    file.write_text(table(np.arange(10) / 30, success=[1, 1, 0, 0, 1, 1, 1, 1, 1, 1]))
    take = read_openface(file)
    assert np.isnan(take.positions[2:4]).all()
    assert np.isfinite(take.positions[[0, 1, 4, 9]]).all()
    assert "no face in 2 of 10 frames" in " ".join(take.history)


def test_of_several_faces_the_one_seen_most_is_taken(tmp_path):
    times = np.repeat(np.arange(10) / 30, 2)[:15]
    file = tmp_path / "two.csv"
    file.write_text(table(times, faces=[0, 1] * 7 + [0]))
    take = read_openface(file)
    assert take.n_frames == 8
    assert "took face 0 of 2" in " ".join(take.history)


def test_uneven_times_come_to_an_even_grid(tmp_path):
    """Landmark 0 rises with the frame number; on the grid it rises with the time."""
    times = np.cumsum([0.0, *([0.02, 0.06] * 20)])
    file = tmp_path / "uneven.csv"
    file.write_text(table(times, landmarks=(0,)))
    take = read_openface(file)
    expected = np.interp(take.time, times, -np.arange(len(times)))
    np.testing.assert_allclose(take.positions[:, 0, 1], expected, atol=0.05)
    assert "uneven" in " ".join(take.history)


def test_dropped_frames_leave_a_gap_at_their_place(tmp_path):
    times = np.delete(np.arange(30) / 25, [10, 11, 12])
    file = tmp_path / "gap.csv"
    file.write_text(table(times))
    take = read_openface(file)
    assert take.n_frames == 30
    assert np.isnan(take.positions[10:13]).all()
    assert np.isfinite(np.delete(take.positions, [10, 11, 12], axis=0)).all()


def test_a_table_without_times_says_what_it_assumes(tmp_path):
    file = tmp_path / "pictures.csv"
    file.write_text(table(range(10), times_column=False))
    with pytest.warns(SignfaceWarning, match="30 frames a second are assumed"):
        assert read_openface(file).rate == 30.0


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (table(np.arange(5) / 25, success=[0] * 5), "found no face"),
        (table(np.arange(5) / 25).replace("Z_1", "Q_1"), "landmark 1 has not all"),
        (table(np.zeros(5)).replace("frame,", "fr,"), "do not rise"),
        (table([0.0]), "one frame"),
        (table(np.arange(5) / 25, landmarks=()), "neither 3-D landmarks"),
        (table(np.arange(5) / 25)[:-8], "cut short"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(tmp_path, text, problem):
    file = tmp_path / "bad.csv"
    file.write_text(text)
    with pytest.raises(SignfaceError, match=problem) as refused:
        read_recording(file)
    assert "bad.csv" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_table_of_action_units_alone_holds_weights(tmp_path):
    file = tmp_path / "units.csv"
    file.write_text(table(np.arange(9) / 30, landmarks=(), units=("AU01_r", "AU01_c", "AU28_c"), blanks=True))
    found = open_recording(file)
    assert isinstance(found, Descriptors)
    assert found.names == ("AU01", "AU28")
    np.testing.assert_array_equal(found.weights[0], [0.5, 1.0])
    assert np.array_equal(found.head, np.tile(np.eye(4), (9, 1, 1)))


def test_of_two_faces_seen_at_once_one_is_chosen(tmp_path):
    rows = table([0.0, 0.0, 0.1, 0.1, 0.2, 0.2], faces=[0, 1] * 3, units=("AU01_r",)).splitlines()
    rows[1:] = [",".join([str(number // 2 + 1), *row.split(",")[1:]]) for number, row in enumerate(rows[1:])]
    file = tmp_path / "two.csv"
    file.write_text("\n".join(rows) + "\n")
    for read_as in (None, "aus"):
        with pytest.raises(SeveralSigners, match=r"2 signers: 0, 1"):
            open_recording(file, read_as=read_as)
        one = open_recording(file, read_as=read_as, subject="1")
        assert one.n_frames == 3
        assert "face 1 of 2" in one.history
    with pytest.raises(SignfaceError, match=r"no face '7'.*0, 1"):
        open_recording(file, subject="7")


def test_a_table_with_both_is_read_as_asked_for():
    file = third_party_file("real/samples/B01_nod_1.csv")
    assert isinstance(open_recording(file), Take)
    assert isinstance(open_recording(file, read_as="aus"), Descriptors)
    with pytest.raises(SignfaceError, match="cannot be read as pose"):
        open_recording(file, read_as="pose")


@pytest.mark.parametrize("sample", SAMPLES[2:])
def test_the_heads_pose_is_that_of_the_landmarks(sample):
    """Two ways to one motion: OpenFace's angles in our axes, and the rigid motion of all its landmarks.

    OpenFace corrects its angles for where the head is in the picture, so that they are not equal.
    """
    file = third_party_file(sample)
    poses, points = read_action_units(file).head, read_openface(file).positions
    moved = rigid_transforms(points[0], points, np.ones(points.shape[:2]))
    told, found = (
        Rotation.from_matrix(m @ m[0].T).as_rotvec(degrees=True) for m in (poses[:, :3, :3], moved[:, :3, :3])
    )
    widest = int(np.argmax(np.ptp(found, axis=0)))
    assert np.ptp(found, axis=0)[widest] > 10
    assert np.corrcoef(told[:, widest], found[:, widest])[0, 1] > 0.99
    assert 0.8 < np.polyfit(found[:, widest], told[:, widest], 1)[0] < 1.1
