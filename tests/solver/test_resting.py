"""The neutral frame that a solve starts from."""

import numpy as np
import pytest

from signface.face.layout_files import read_layout
from signface.solver.displacements import neutral_places, steady_places
from signface.solver.resting import resting_time
from signface.takes.neutral import neutral_candidates
from signface.takes.reading import read_take
from signface.takes.take import Take


@pytest.fixture(scope="module")
def layout(face):
    return read_layout("default-40", face)


def held_smile(face, layout, smile_s):
    """Rest, a smile held for a while, rest, a frown, rest: at 50 Hz, on the avatar's own face."""
    course = np.concatenate([np.zeros(50), np.linspace(0, 1, 15), np.ones(round(50 * smile_s)), np.linspace(1, 0, 15)])
    smile = np.concatenate([course, np.zeros(130)])
    frown = np.concatenate([np.zeros(len(course) + 50), np.linspace(0, 1, 15), np.ones(50), np.linspace(1, 0, 15)])
    weights = np.zeros((len(smile), face.n_bases))
    for name in ("mouthSmileLeft", "mouthSmileRight", "cheekSquintLeft", "cheekSquintRight"):
        weights[:, face.names.index(name)] = smile
    for name in ("browDownLeft", "browDownRight", "mouthFrownLeft", "mouthFrownRight"):
        weights[: len(frown), face.names.index(name)] = frown
    skin = layout.points(face) + np.tensordot(weights, layout.bases(face), axes=1)
    head = np.repeat(layout.points(face, layout.head_labels)[None], len(weights), axis=0)
    noise = np.random.default_rng(0).normal(0, 0.1, (len(weights), 46, 3))
    positions = np.concatenate([skin, head], axis=1) + noise
    return Take(positions, (*layout.face_labels, *layout.head_labels), 50.0), weights


@pytest.mark.parametrize("smile_s", [1.0, 4.0, 8.0])
def test_a_smile_held_longer_than_rest_is_not_taken_for_neutral(face, layout, smile_s):
    take, weights = held_smile(face, layout, smile_s)
    assert np.abs(weights[take.frame_at(resting_time(take, face, layout))]).max() < 0.05


def test_every_resting_pose_is_a_candidate(face, layout):
    take, weights = held_smile(face, layout, 4.0)
    found = weights[[take.frame_at(time) for time in neutral_candidates(take, layout.face_labels)]]
    smile, frown = face.names.index("mouthSmileLeft"), face.names.index("browDownLeft")
    assert (found[:, smile] > 0.9).any()
    assert (np.abs(found[:, [smile, frown]]).max(axis=1) < 0.05).any()


def test_the_bundled_takes_rest_where_they_are_known_to(mini, face, layout):
    from signface.descriptors_files import read_weights

    for entry in mini.takes:
        take = read_take(entry.path)
        truth = read_weights(entry.path.parent / "truth" / f"{entry.path.stem}.parquet")
        at = truth.weights[take.frame_at(resting_time(take, face, layout))]
        moved = np.tensordot(at, face.bases[:, face.moving], axes=1)
        assert np.sqrt((moved**2).sum(axis=1).mean()) < 0.7


def test_without_head_markers_the_still_stretch_near_the_median_pose_is_taken(face, layout):
    from signface.takes.neutral import find_neutral

    take, _ = held_smile(face, layout, 1.0)
    bare = Take(take.select(layout.face_labels), layout.face_labels, take.rate)
    assert resting_time(bare, face, layout) == find_neutral(bare, layout.face_labels)


def rest_and_smile(face, layout, jitter_mm, seed):
    """Nearly two seconds of rest, then a smile, at 30 Hz: displacements from the true rest, and the take."""
    smile = np.concatenate([np.zeros(55), np.linspace(0, 1, 12), np.ones(40)])
    weights = np.zeros((len(smile), face.n_bases))
    for name in ("mouthSmileLeft", "mouthSmileRight", "jawOpen"):
        weights[:, face.names.index(name)] = smile
    skin = layout.points(face) + np.tensordot(weights, layout.bases(face), axes=1)
    noise = np.random.default_rng(seed).normal(0, jitter_mm / np.sqrt(3), skin.shape)
    return Take(skin + noise, layout.face_labels, 30.0)


@pytest.mark.parametrize("neutral_s", [0.6, 1.2, 1.7])
def test_neutral_places_of_landmarks_that_jitter_are_means_of_a_longer_rest(face, layout, neutral_s):
    def off(places):
        return np.sqrt(((places - layout.points(face)) ** 2).sum(axis=1).mean())

    short, steady = [], []
    for seed in range(5):
        take = rest_and_smile(face, layout, 2.0, seed)
        short.append(off(neutral_places(take, layout.face_labels, neutral_s)[1]))
        steady.append(off(steady_places(take, layout.face_labels, neutral_s)))
    assert np.mean(short) > 1.0
    assert np.mean(steady) < 0.75 * np.mean(short)


def test_neutral_places_of_markers_that_keep_still_stay_what_they_are(face, layout):
    take = rest_and_smile(face, layout, 0.3, 0)
    short = neutral_places(take, layout.face_labels, 1.0)[1]
    np.testing.assert_array_equal(steady_places(take, layout.face_labels, 1.0), short)


@pytest.mark.parametrize("label", ["LIPUM", "HEADF"])
def test_one_wrong_marker_in_one_frame_does_not_choose_the_neutral_frame(face, layout, label):
    from signface.datasets import mini_take
    from signface.takes.cleaning import cleaning_stages
    from signface.takes.stages import run

    take = mini_take("M2_EU_04")
    clean = resting_time(run(take, *cleaning_stages(layout.labels)), face, layout)
    for by in ((300, 200, 100), (60, 0, 0), (0, 0, -900)):
        positions = take.positions.copy()
        positions[500, take.labels.index(label)] += by
        spoiled = run(take.changed("spoiled", positions=positions), *cleaning_stages(layout.labels))
        assert resting_time(spoiled, face, layout) == clean
