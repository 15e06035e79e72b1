"""Brows, lashes, tones of skin, and the shade of wrinkles."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from signface.errors import SignfaceError
from signface.face.reading import read_face, read_hair
from signface.render.film import Avatar
from signface.render.still import SKINS, whole_face
from signface.synth.expressions import PROTOTYPES, Spread, unit_weights


@pytest.fixture(scope="module")
def face():
    return read_face("default")


def weights_of(face, **bases):
    weights = np.zeros(face.n_bases)
    for name, weight in bases.items():
        weights[face.names.index(name)] = weight
    return weights


def brow_hairs(face):
    """Which vertices of the hair belong to a brow: above the eyes."""
    return read_hair().mesh.vertices[:, 1] > 47.0


def test_the_skin_that_is_solved_has_no_hair(face):
    whole = whole_face(face)
    assert len(face.mesh.vertices) == 3411
    np.testing.assert_array_equal(whole.mesh.vertices[:3411], face.mesh.vertices)
    np.testing.assert_array_equal(whole.bases[:, :3411], face.bases)


@pytest.mark.parametrize(
    "bases",
    [{"browDownLeft": 1.0, "browDownRight": 1.0}, {"browInnerUp": 1.0}, {"browOuterUpLeft": 1.0}, {"noseSneerLeft": 1}],
)
def test_brows_lie_on_the_skin_and_go_where_it_goes(face, bases):
    from scipy.spatial import cKDTree

    from signface.face.subdivision import subdivide

    fine = subdivide(subdivide(face))  # so that a vertex is never far from a hair

    weights = weights_of(face, **bases)
    brows = brow_hairs(face)
    nearest = cKDTree(fine.mesh.vertices).query(read_hair().mesh.vertices[brows])[1]
    moved_skin = np.tensordot(weights, fine.bases, axes=1)[nearest]
    moved_hair = np.tensordot(weights, read_hair().bases, axes=1)[brows]
    assert np.linalg.norm(moved_hair, axis=1).max() > 3.0
    assert np.linalg.norm(moved_hair - moved_skin, axis=1).max() < 0.8


def test_upper_lashes_come_down_with_the_lid(face):
    hair = read_hair()
    lashes = ~brow_hairs(face) & (hair.mesh.vertices[:, 0] > 0)
    blink = np.tensordot(weights_of(face, eyeBlinkLeft=1.0), hair.bases, axes=1)[lashes]
    assert blink[:, 1].min() < -4.0
    other = np.tensordot(weights_of(face, eyeBlinkRight=1.0), hair.bases, axes=1)[lashes]
    assert np.abs(other).max() < 0.1


def test_raised_brows_are_higher_in_the_picture(face):
    avatar = Avatar(face, size=(320, 320), yaw=0)

    def row(weights):
        """Mean row of dark pixels above the eyes."""
        dark = avatar.picture(weights).max(axis=2)[: 320 // 2] < 62
        assert dark.sum() > 50
        return np.nonzero(dark)[0].mean()

    low, rest, high = (
        row(weights_of(face, **bases))
        for bases in (
            {"browDownLeft": 1, "browDownRight": 1},
            {},
            {"browInnerUp": 1, "browOuterUpLeft": 1, "browOuterUpRight": 1},
        )
    )
    assert high < rest - 1
    assert rest < low - 1


def test_skin_that_is_pressed_together_is_darker(face):
    """Between lowered brows, where wrinkles stand."""
    avatar = Avatar(face, size=(480, 480))
    frown = weights_of(face, browDownLeft=0.8, browDownRight=0.8)
    plain = avatar.pose(np.zeros(face.n_bases))
    column, row, _ = avatar._scene.camera.project(plain[:3411])[
        np.argmin(np.linalg.norm(face.mesh.vertices - (0, 56, 102), axis=1))
    ].astype(int)
    patch = (slice(row - 3, row + 4), slice(column - 3, column + 4))
    assert avatar.picture(frown)[patch].mean() < 0.9 * avatar.picture(np.zeros(face.n_bases))[patch].mean()


def test_prototypes_at_full_intensity_differ_from_each_other_and_from_rest(face):
    avatar = Avatar(face, size=(320, 320))
    pictures = {"N": avatar.picture(np.zeros(face.n_bases)).astype(float)}
    for affect, variants in PROTOTYPES.items():
        strengths = {unit: strength * Spread().amplitude[2] for unit, strength in variants[0].items()}
        pictures[affect] = avatar.picture(unit_weights(strengths, face.names)).astype(float)
    names = list(pictures)
    for a in names:
        for b in names[: names.index(a)]:
            changed = np.abs(pictures[a] - pictures[b]).max(axis=2) > 25
            assert changed.sum() > 150, f"{a} and {b} look alike"


def test_tones_of_skin_are_told_apart_and_lips_from_skin(face):
    lightness = [whole_face(face, skin=name).colours[:3411].mean() for name in SKINS]
    assert all(a > b + 0.05 for a, b in itertools.pairwise(lightness))
    colours = whole_face(face).colours[:3411]
    assert np.ptp(colours[:, 1] / colours[:, 0]) > 0.1
    with pytest.raises(SignfaceError, match="no tone of skin"):
        Avatar(face, size=(64, 64), skin="green")
