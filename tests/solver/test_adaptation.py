"""Carrying marker positions from the signer's face to the avatar's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from signface.errors import SignfaceError
from signface.solver.adaptation import ADAPTATIONS, MorphologicalAdaptation, SimilarityAdaptation, make_adaptation


def cloud(seed: int, count: int = 20) -> np.ndarray:
    return np.random.default_rng(seed).normal(0.0, 40.0, (count, 3))


@given(st.integers(0, 1000), st.integers(6, 60))
@settings(deadline=None, max_examples=25)
def test_the_neutral_markers_fall_on_the_avatars(seed, count):
    source = cloud(seed, count)
    target = 1.1 * source + cloud(seed + 1, count) / 30
    adaptation = MorphologicalAdaptation(source, target)
    assert adaptation.smoothing > 0 or np.abs(adaptation.transform(source) - target).max() < 1e-8


@given(st.integers(0, 1000))
@settings(deadline=None, max_examples=25)
def test_affine_changes_of_shape_are_reproduced_everywhere(seed):
    rng = np.random.default_rng(seed)
    source, matrix, shift = cloud(seed), np.eye(3) + 0.2 * rng.normal(size=(3, 3)), rng.normal(0, 100, 3)
    points = rng.normal(0.0, 60.0, (7, 5, 3))
    adapted = MorphologicalAdaptation(source, source @ matrix + shift).transform(points)
    assert np.abs(adapted - (points @ matrix + shift)).max() < 1e-7


@given(st.integers(0, 1000))
@settings(deadline=None, max_examples=25)
def test_similarities_are_reproduced_by_both(seed):
    rng = np.random.default_rng(seed)
    source, points = cloud(seed), rng.normal(0.0, 60.0, (9, 3))
    turn, scale, shift = Rotation.random(random_state=seed), rng.uniform(0.5, 2.0), rng.normal(0, 100, 3)
    for name in ADAPTATIONS:
        adapted = make_adaptation(name, source, scale * turn.apply(source) + shift).transform(points)
        assert np.abs(adapted - (scale * turn.apply(points) + shift)).max() < 1e-7, name


@pytest.mark.parametrize("name", ADAPTATIONS)
def test_the_unit_of_length_plays_no_part(name):
    source, target, points = cloud(0), cloud(0) + cloud(1) / 20, cloud(2)
    metres = make_adaptation(name, source / 1000, target / 1000).transform(points / 1000)
    assert np.abs(1000 * metres - make_adaptation(name, source, target).transform(points)).max() < 1e-8


@pytest.mark.parametrize("name", ADAPTATIONS)
def test_the_signers_place_in_the_room_plays_no_part(name):
    source, target, points = cloud(0), cloud(0) + cloud(1) / 20, cloud(2)
    turn = Rotation.from_rotvec([0.3, -1.0, 0.2])
    moved = make_adaptation(name, turn.apply(source) + 5000.0, target).transform(turn.apply(points) + 5000.0)
    assert np.abs(moved - make_adaptation(name, source, target).transform(points)).max() < 1e-6


@pytest.mark.parametrize("name", ADAPTATIONS)
def test_missing_markers_stay_missing(name):
    source = cloud(0)
    points = np.stack([source, source])
    points[1, 4] = np.nan
    adapted = make_adaptation(name, source, source).transform(points)
    assert np.isnan(adapted[1, 4]).all()
    assert np.isnan(adapted).sum() == 3


def test_markers_in_a_plane_move_out_of_it_as_the_face_is_scaled():
    flat = cloud(0) * [1.0, 1.0, 0.0]
    adapted = MorphologicalAdaptation(flat, 2.0 * flat).transform(flat + np.array([0.0, 0.0, 3.0]))
    assert np.isfinite(adapted).all()
    assert adapted[:, 2] == pytest.approx(6.0, abs=0.5)


def test_markers_on_a_line_give_numbers():
    line = np.outer(np.arange(8.0), [1.0, 2.0, -1.0])
    assert np.isfinite(MorphologicalAdaptation(line, 1.5 * line).transform(cloud(3))).all()


def test_coincident_markers_are_named():
    source = cloud(0)
    source[7] = source[2]
    with pytest.raises(SignfaceError, match="3 and 8 stand on one point"):
        MorphologicalAdaptation(source, cloud(1))


@pytest.mark.parametrize("name", ADAPTATIONS)
def test_unusable_neutral_markers_are_refused(name):
    with pytest.raises(SignfaceError, match="at least 4"):
        make_adaptation(name, cloud(0, 3), cloud(1, 3))
    with pytest.raises(SignfaceError, match="one point"):
        make_adaptation(name, np.ones((5, 3)), cloud(1, 5))
    with pytest.raises(SignfaceError, match="1 of 5 neutral markers are missing"):
        make_adaptation(name, np.where(np.arange(5)[:, None] == 2, np.nan, cloud(0, 5)), cloud(1, 5))
    with pytest.raises(SignfaceError, match="correspond"):
        make_adaptation(name, cloud(0, 5), cloud(1, 6))


def test_a_face_is_not_turned_inside_out():
    source = cloud(0) * [1.0, 1.0, 1e-3]
    mirrored = source * [1.0, 1.0, -1.0]
    moved = SimilarityAdaptation(source, mirrored)
    assert np.linalg.det(moved._similarity[:3]) > 0


def test_unknown_adaptations_are_refused():
    with pytest.raises(SignfaceError, match="similarity and rbf"):
        make_adaptation("affine", cloud(0), cloud(1))
