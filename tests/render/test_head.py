"""The motion of the head in films: its direction, between frames, on disk, and on the command line."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from signface.descriptors import Descriptors
from signface.descriptors_files import read_weights, write_weights
from signface.face.layout_files import read_layout
from signface.face.mesh import Mesh
from signface.face.model import FaceModel
from signface.render.film import Avatar, at_rate, head_at_rate, pictures_of
from signface.render.head import Neck, moving_part, rotations_at
from signface.settings.solve import SolveSettings
from signface.solver.solving import solve
from signface.takes.take import Take
from tests.fixtures.takes_files import write_trc

RATE = 50.0
SIZE = (160, 120)
#: A room with Z up, in which the signer does not face along an axis.
ROOM = Rotation.from_euler("z", 25, degrees=True) * Rotation.from_euler("x", 90, degrees=True)


def poses_from(rotations: Rotation) -> np.ndarray:
    poses = np.tile(np.eye(4), (len(rotations), 1, 1))
    poses[:, :3, :3] = rotations.as_matrix()
    return poses


def moving_head(face, axis: str, degrees: float) -> Take:
    """A face at rest on a head that turns about an axis of its own (x to its left, y up, z ahead) and comes back."""
    layout = read_layout("default-40", face)
    cap = np.random.default_rng(0).uniform(-1, 1, (len(layout.head_labels), 3)) * (80, 30, 80) + (0, 110, 0)
    points = np.concatenate([layout.points(face), cap])
    angles = degrees * np.concatenate([np.zeros(20), np.sin(np.linspace(0, np.pi, 41)), np.zeros(20)])
    turned = (ROOM * Rotation.from_euler(axis, angles[:, None], degrees=True)).as_matrix()
    recorded = points @ turned.transpose(0, 2, 1) + (300.0, -200.0, 1600.0)
    return Take(recorded, (*layout.face_labels, *layout.head_labels), RATE, name=f"head-{axis}")


def solved(face, axis: str, degrees: float) -> Descriptors:
    return solve(moving_head(face, axis, degrees), face, settings=SolveSettings(neutral="0.1"))


@pytest.fixture(scope="module")
def nod(face):
    return solved(face, "x", 20.0)


def dot(face, marker: str, yaw: float, take: Descriptors, frame: int) -> np.ndarray:
    """(row, column) of the middle of one marker's dot in the picture of one frame."""
    layout = read_layout("default-40", face).restricted([marker])
    weights, head = at_rate(take, RATE), head_at_rate(take, RATE)
    pictures = [
        Avatar(face, size=SIZE, yaw=yaw, layout=dots).picture(weights[frame], head[frame]).astype(int)
        for dots in (layout, None)
    ]
    return np.argwhere(np.abs(pictures[0] - pictures[1]).max(axis=2) > 40).mean(axis=0)


def test_a_nod_takes_the_chin_down_and_back(face, nod):
    rest, down = (dot(face, "CHINM", 0, nod, frame) for frame in (0, 40))
    assert down[0] - rest[0] > 8  # rows run downwards
    assert abs(down[1] - rest[1]) < 1
    rest, down = (dot(face, "CHINM", 80, nod, frame) for frame in (0, 40))  # the nose points to the left edge
    assert down[0] - rest[0] > 8
    assert down[1] - rest[1] > 2
    assert np.array_equal(dot(face, "CHINM", 0, nod, 80), dot(face, "CHINM", 0, nod, 0))


def test_a_turn_to_the_signers_left_goes_to_the_right_in_the_picture_and_a_tilt_leans(face):
    turn = solved(face, "y", 30.0)
    rest, left = (dot(face, "NTIP", 0, turn, frame) for frame in (0, 40))
    assert left[1] - rest[1] > 15
    tilt = solved(face, "z", 20.0)  # to the signer's right shoulder, the left of the picture
    rest, leaning = (dot(face, "FOREM", 0, tilt, frame) for frame in (0, 40))
    assert leaning[1] - rest[1] < -8


def test_a_still_head_gives_the_pictures_without_a_head(face):
    weights = np.random.default_rng(0).random((20, face.n_bases)) * 0.3
    avatar = Avatar(face, size=(64, 64))
    still = pictures_of(avatar, weights)
    for picture, same in zip(still, pictures_of(avatar, weights, np.tile(np.eye(3), (20, 1, 1)))):
        assert picture.tobytes() == same.tobytes()
    assert head_at_rate(Descriptors(weights, face.names, RATE), 25) is None


def test_take_and_its_weights_files_give_one_film(face, nod, tmp_path):
    avatar = Avatar(face, size=(96, 96))
    films = [list(pictures_of(avatar, at_rate(nod, 10), head_at_rate(nod, 10)))]
    for ending in (".parquet", ".csv"):
        write_weights(nod, tmp_path / f"nod{ending}")
        back = read_weights(tmp_path / f"nod{ending}")
        np.testing.assert_allclose(head_at_rate(back, 10), head_at_rate(nod, 10), atol=1e-8)
        films.append(list(pictures_of(avatar, at_rate(back, 10), head_at_rate(back, 10))))
    assert np.array_equal(films[0], films[1])
    # A csv rounds weights to six decimals: no channel of a pixel changes by more than the last step.
    assert np.abs(np.array(films[0], int) - np.array(films[2], int)).max() <= 1


@given(st.integers(0, 10**6), st.integers(1, 30), st.floats(-2, 2))
@settings(deadline=None, max_examples=40)
def test_rotations_go_by_slerp_and_unknown_poses_are_held(seed, frames, start):
    rng = np.random.default_rng(seed)
    poses = poses_from(Rotation.from_rotvec(rng.uniform(-0.6, 0.6, (frames, 3))))
    unknown = rng.random(frames) < 0.3
    unknown[rng.integers(frames)] = False
    last = poses[np.flatnonzero(~unknown)[0]]
    held = []
    for pose, missing in zip(poses, unknown):
        last = last if missing else pose
        held.append(last)
    poses[unknown] = np.nan
    take = Descriptors(np.zeros((frames, 1)), ("a",), RATE, start=start, head=poses)
    matrices = np.array(held)[:, :3, :3]
    np.testing.assert_allclose(rotations_at(take, take.time), matrices, atol=1e-6)
    if frames > 1:
        times = np.sort(rng.uniform(take.time[0], take.time[-1], 20))
        between = Slerp(take.time, Rotation.from_matrix(matrices))(times).as_matrix()
        np.testing.assert_allclose(rotations_at(take, times), between, atol=1e-6)


def test_poses_in_a_room_turn_the_head_on_its_own_axes():
    nods = Rotation.from_euler("x", 15 * np.sin(np.linspace(0, 4 * np.pi, 101))[:, None], degrees=True)
    take = Descriptors(np.zeros((101, 1)), ("a",), RATE, head=poses_from(ROOM * nods))
    np.testing.assert_allclose(rotations_at(take, take.time), nods.as_matrix(), atol=1e-6)


def test_a_head_of_unknown_pose_is_none():
    for head in (None, np.full((5, 4, 4), np.nan)):
        assert rotations_at(Descriptors(np.zeros((5, 1)), ("a",), RATE, head=head), np.zeros(3)) is None


def test_the_face_turns_as_a_whole_and_the_necks_end_stays(face):
    neck = Neck(face)
    moving = moving_part(face)
    share = neck.share[:, 0]
    height = face.mesh.vertices[:, 1]
    assert share[height > moving[:, 1].mean()].min() == 1
    chin = np.argmin(np.where(face.mesh.vertices[:, 2] > 85, height, np.inf))
    assert share[chin] > 0.99
    assert share[height < height.min() + 5].max() < 0.05
    kept = np.flatnonzero((height > -60) & (face.mesh.vertices[:, 2] > 20))
    number = np.full(len(height), -1)
    number[kept] = np.arange(len(kept))
    triangles = number[face.mesh.triangles]
    triangles = triangles[(triangles >= 0).all(axis=1)]
    mask = FaceModel(Mesh(face.mesh.vertices[kept], triangles), face.bases[:, kept], face.names)
    assert (Neck(mask).share == 1).all()


@pytest.mark.slow
def test_the_command_nods_unless_told_otherwise(face, nod, tmp_path, monkeypatch, capsys):
    from signface.cli.main import main

    monkeypatch.chdir(tmp_path)
    write_trc(moving_head(face, "x", 20.0), tmp_path / "take.trc")
    write_weights(nod, "nod.parquet")
    write_weights(nod, "nod.csv")
    still = Descriptors(nod.weights, nod.names, nod.rate)
    write_weights(still, "still.parquet")

    def film(source: str, *options: str) -> bytes:
        assert main(["study", "render", source, "--size", "64x64", "-o", "films", *options]) == 0
        (file,) = (tmp_path / "films").iterdir()
        content = file.read_bytes()
        file.unlink()
        return content

    nodding = film("nod.parquet")
    assert film("nod.parquet", "--head") == nodding
    assert film("nod.parquet", "--no-head") == film("still.parquet") != nodding
    assert film("nod.csv") != film("nod.csv", "--no-head")
    assert film("take.trc", "--neutral", "0.1") != film("take.trc", "--neutral", "0.1", "--no-head")
    sheet = ["--still", "--every", "0.4"]
    assert film("nod.csv", *sheet) != film("nod.csv", *sheet, "--no-head")
    assert main(["study", "render", "still.parquet", "--head"]) == 2
    assert "how the head moves is unknown" in capsys.readouterr().err
