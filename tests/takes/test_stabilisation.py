"""Head motion is taken away by proper rotations, whatever markers are missing or have slipped."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from signface.errors import SignfaceError
from signface.takes.rigid import apply, inverse
from signface.takes.stabilisation import align_neutral, rigid_transform, stabilise
from signface.takes.take import Take
from tests.fixtures.takes_files import HEAD, moving_face, with_gaps

SKIN = [f"M{number:02d}" for number in range(20)]


def angle(poses, truth):
    """Degrees between the rotations of poses."""
    return np.degrees(Rotation.from_matrix((poses @ np.linalg.inv(truth))[..., :3, :3]).magnitude())


@given(seed=st.integers(0, 2**31), points=st.integers(3, 12))
@settings(max_examples=30, deadline=None)
def test_a_rigid_motion_is_found_again(seed, points):
    random = np.random.default_rng(seed)
    source = random.normal(size=(points, 3)) * 50
    pose = np.eye(4)
    pose[:3, :3] = Rotation.random(random_state=seed % 2**32).as_matrix()
    pose[:3, 3] = random.normal(size=3) * 500
    found = rigid_transform(source, apply(pose, source))
    np.testing.assert_allclose(apply(found, source), apply(pose, source), atol=1e-6)
    assert np.linalg.det(found[:3, :3]) == pytest.approx(1.0)


def test_a_mirrored_face_is_never_reflected():
    source = np.random.default_rng(0).normal(size=(8, 3)) * (50, 50, 5)
    found = rigid_transform(source, source * (-1, 1, 1))
    assert np.linalg.det(found[:3, :3]) == pytest.approx(1.0)


def test_points_in_a_plane_give_a_proper_rotation():
    source = np.random.default_rng(1).normal(size=(6, 3)) * (50, 50, 0)
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", (2.0, 1.0, -0.5)).as_matrix()
    np.testing.assert_allclose(rigid_transform(source, apply(pose, source)), pose, atol=1e-9)


def test_weights_say_which_points_count():
    source = np.random.default_rng(2).normal(size=(5, 3)) * 50
    target = source + np.array([10, 0, 0])
    target[0] += 40
    found = rigid_transform(source, target, weights=np.array([0, 1, 1, 1, 1]))
    np.testing.assert_allclose(found[:3, 3], (10, 0, 0), atol=1e-9)


def test_too_few_points_or_points_on_a_line_are_refused():
    line = np.arange(5)[:, None] * np.array([[1.0, 2.0, 3.0]])
    with pytest.raises(SignfaceError, match="on one line"):
        rigid_transform(line, line + 1)
    gappy = np.random.default_rng(0).normal(size=(4, 3))
    gappy[:2] = np.nan
    with pytest.raises(SignfaceError, match="needs 3 common points, and there are 2"):
        rigid_transform(gappy, gappy)


def test_the_neutral_frame_is_laid_on_the_avatar():
    take, _ = moving_face(2.0, 60.0, start=3.0)
    avatar = take.select(SKIN)[30] @ Rotation.from_euler("y", 90, degrees=True).as_matrix().T - (50, 1600, 0)
    aligned = align_neutral(take, SKIN, avatar, 3.5)
    np.testing.assert_allclose(aligned.select(SKIN)[30], avatar, atol=1e-8)
    shape = np.linalg.norm(aligned.positions[:, 0] - aligned.positions[:, 1], axis=1)
    np.testing.assert_allclose(shape, np.linalg.norm(take.positions[:, 0] - take.positions[:, 1], axis=1))
    with pytest.raises(SignfaceError, match="outside the take"):
        align_neutral(take, SKIN, avatar, 0.5)
    with pytest.raises(SignfaceError, match="cannot be aligned"):
        align_neutral(with_gaps(take, {number: (30, 31) for number in range(18)}), SKIN, avatar, 3.5)


@pytest.mark.parametrize(("jitter", "degrees", "millimetres"), [(0.0, 1e-6, 1e-6), (0.2, 0.8, 1.0)])
def test_head_motion_is_taken_away(jitter, degrees, millimetres):
    take, poses = moving_face(4.0, 100.0, jitter=jitter)
    exact, _ = moving_face(4.0, 100.0)
    still, found = stabilise(take, head=HEAD, neutral_s=0.0)
    assert angle(found, poses).max() < degrees
    expected = apply(inverse(poses), exact.positions)
    assert np.linalg.norm(still.positions - expected, axis=2).max() < 1.5 * millimetres
    np.testing.assert_allclose(apply(found, still.positions), take.positions, atol=1e-6)


def test_the_poses_map_the_neutral_head_to_the_recording():
    take, _ = moving_face(2.0, 100.0, expression=0.0)
    _, poses = stabilise(take, head=HEAD, neutral_s=1.0)
    np.testing.assert_allclose(poses[100], np.eye(4), atol=1e-9)
    np.testing.assert_allclose(apply(poses, take.positions[100]), take.positions, atol=1e-6)


def test_missing_head_markers_do_not_matter_while_three_remain():
    take, poses = moving_face(3.0, 100.0)
    gappy = with_gaps(take, {20: (50, 200), 22: (100, 300), 25: (150, 180)})
    _, found = stabilise(gappy, head=HEAD, neutral_s=0.0)
    assert angle(found, poses).max() < 1e-6


def test_a_slipped_head_marker_is_outvoted_and_named():
    take, poses = moving_face(4.0, 100.0, jitter=0.1)
    slipped = take.positions.copy()
    slipped[150:, 22] += (8, -5, 3)
    still, found = stabilise(take.changed("slipped", positions=slipped), head=HEAD, neutral_s=0.0)
    assert angle(found, poses)[150:].max() < 1.0
    assert angle(found, poses)[150:].mean() < 0.3
    assert "slipped: HEAD3 (" in still.history[-1]


def test_a_short_blind_stretch_is_interpolated_and_a_long_one_stays_unknown():
    take, poses = moving_face(4.0, 100.0)
    gaps = {number: (100, 120) for number in range(20, 24)}
    still, found = stabilise(with_gaps(take, gaps), head=HEAD, neutral_s=0.0)
    assert angle(found, poses).max() < 1.0
    assert "20 frames interpolated" in still.history[-1]
    gaps = {number: (100, 160) for number in range(20, 24)}
    still, found = stabilise(with_gaps(take, gaps), head=HEAD, neutral_s=0.0)
    assert np.isnan(found[100:160]).all()
    assert np.isnan(still.positions[100:160]).all()
    assert np.isfinite(found[:100]).all()
    assert "60 frames without a pose" in still.history[-1]


def test_fewer_than_three_head_markers_are_refused_or_replaced_by_the_least_moving():
    take, poses = moving_face(4.0, 100.0)
    few = Take(take.positions[:, :22], take.labels[:22], take.rate)
    with pytest.raises(SignfaceError, match="shows 2 of 6 head markers, and 3 are needed"):
        stabilise(few, head=HEAD, neutral_s=0.0)
    with pytest.raises(SignfaceError, match="no fallback named guess"):
        stabilise(few, head=HEAD, neutral_s=0.0, fallback="guess")
    positions = take.positions.copy()
    rigid, _ = moving_face(4.0, 100.0, expression=0.0)
    positions[:, :7] = rigid.positions[:, :7]  # seven points of the skin that do not move on the head
    still, found = stabilise(take.changed("", positions=positions), head=(), neutral_s=0.0, fallback="least-moving")
    assert angle(found, poses).max() < 2.0
    assert "least-moving" in still.history[-1]


def test_head_markers_that_a_tracker_jitters_alike_have_not_slipped():
    """Millimetres of jitter that comes and goes, as trackers of pictures have it, are no slip of single markers."""
    take, _ = moving_face(4.0, 100.0)
    noise = np.random.default_rng(3).normal(size=(len(take.time) // 20 + 1, 6, 3)).repeat(20, axis=0)[: take.n_frames]
    jittered = take.positions.copy()
    jittered[:, 20:] += noise * np.array([1.0, 1.5, 1.0, 2.0, 1.5, 1.0])[:, None]
    still, _ = stabilise(take.changed("jitter", positions=jittered), head=HEAD, neutral_s=0.0)
    assert "slipped" not in still.history[-1]


def test_head_markers_on_one_line_are_refused():
    take, _ = moving_face(1.0, 100.0)
    positions = take.positions.copy()
    positions[:, 20:] = positions[:, 20:21] + np.arange(6)[:, None] * np.array([10.0, 5.0, 2.0])
    with pytest.raises(SignfaceError, match="they lie on one line"):
        stabilise(take.changed("", positions=positions), head=HEAD, neutral_s=0.0)


def test_a_neutral_frame_without_head_markers_is_refused():
    take, _ = moving_face(1.0, 100.0)
    with pytest.raises(SignfaceError, match="Choose another neutral frame"):
        stabilise(with_gaps(take, {number: (0, 5) for number in range(20, 25)}), head=HEAD, neutral_s=0.0)


@given(seed=st.integers(0, 1000))
@settings(max_examples=10, deadline=None)
def test_stabilising_does_not_depend_on_where_the_camera_stands(seed):
    take, _ = moving_face(0.5, 60.0, jitter=0.2, seed=seed)
    camera = np.eye(4)
    camera[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    camera[:3, 3] = (100, -300, 50)
    moved = take.changed("", positions=apply(camera, take.positions))
    here, _ = stabilise(take, head=HEAD, neutral_s=0.1)
    there, _ = stabilise(moved, head=HEAD, neutral_s=0.1)
    np.testing.assert_allclose(there.positions, apply(camera, here.positions), atol=1e-5)
