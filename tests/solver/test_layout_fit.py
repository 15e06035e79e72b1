"""Markers of the right names in the wrong places, and mirrored takes, are refused; good ones never are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import signface as sf
from signface.errors import SignfaceError
from signface.solver.layout_fit import check_take, misfit
from signface.solver.recognition import recognise_layout
from tests.fixtures.third_party import third_party_file

FACE = sf.read_face()
SAMPLE = "real/samples/B01_nod_1.csv"


@given(seed=st.integers(0, 1000), scale=st.floats(0.1, 10))
@settings(max_examples=30, deadline=None)
def test_turning_moving_and_scaling_change_nothing(seed, scale):
    random = np.random.default_rng(seed)
    points = random.normal(size=(12, 3)) * (50, 60, 20)
    places = points + random.normal(size=points.shape) * 5
    moved = scale * Rotation.random(random_state=seed).apply(places) + random.normal(size=3) * 1000
    np.testing.assert_allclose(misfit(moved, points), misfit(places, points), atol=1e-9)
    np.testing.assert_allclose(misfit(places * (-1, 1, 1), points), misfit(places, points)[::-1], atol=1e-9)


@pytest.mark.parametrize("name", ["M1_IE_J", "M2_EU_04"])
def test_takes_of_markers_fit_and_mirrored_ones_do_not(name):
    take = sf.read_take(sf.datasets.mini_file(name))
    layout = sf.choose_layout(take.labels, FACE)
    check_take(take, layout, FACE)
    mirrored = take.changed("mirrored", positions=take.positions * (1, 1, -1))
    with pytest.raises(SignfaceError, match="is a mirror image"):
        check_take(mirrored, layout, FACE)
    with pytest.raises(SignfaceError, match=f"{name}: is a mirror image"):
        sf.solve(mirrored.between(0, 1))


@pytest.mark.slow
def test_numbered_landmarks_of_openface_are_not_taken_for_those_of_mediapipe():
    take = sf.read_take(third_party_file(SAMPLE))
    check_take(take, sf.choose_layout(take.labels, FACE), FACE)
    numbered = take.changed("numbered", labels=tuple(label[1:] for label in take.labels))
    assert "lie elsewhere" in recognise_layout(numbered, FACE)["note"]
    with pytest.raises(SignfaceError, match=r"names of the layout mediapipe and lie elsewhere.*OpenFace's L0 to L67"):
        sf.solve(numbered)


def test_landmarks_of_mediapipe_fit_their_layout():
    take = sf.read_take(third_party_file("dgs_example.pose"))
    assert "note" not in recognise_layout(take, FACE)
