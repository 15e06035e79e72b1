"""Where markers may stand, and the layouts that laboratories use."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from signface.errors import SignfaceError
from signface.face.layout_files import read_layout, write_layout
from signface.face.mesh import Mesh
from signface.face.reading import read_identities
from signface.placement.empirical import EMPIRICAL, find_landmarks, place_layout
from signface.placement.sites import Board, Rules, find_sites, forbidden
from signface.synth.heads import draw_head


@pytest.fixture(scope="module")
def sites(face):
    return find_sites(face)


@pytest.mark.parametrize("name", EMPIRICAL)
def test_an_empirical_layout_has_as_many_markers_as_its_name_says(face, name):
    layout = place_layout(name, face)
    own = len(layout.head_labels) if name == "face-robot-35" else 0  # three of its markers carry the head
    assert len(layout.face_labels) + own == int(name.rsplit("-", 1)[1])
    assert len(layout.head_labels) >= 3


@pytest.mark.parametrize("name", EMPIRICAL)
def test_an_empirical_layout_is_symmetric(face, name):
    points = place_layout(name, face).points(face)
    apart = np.linalg.norm(points[:, None] - points[None] * (-1, 1, 1), axis=2).min(axis=1)
    assert apart.max() < 0.6


@pytest.mark.slow
def test_the_manual_layouts_lie_within_one_another(face):
    families = [set(place_layout(f"man-{size}", face).face_labels) for size in (15, 30, 46, 62)]
    assert all(small < large for small, large in itertools.pairwise(families))


def test_an_empirical_layout_can_be_written_and_read_back(face, tmp_path):
    layout = place_layout("signcom-41", face)
    write_layout(layout, tmp_path / "signcom.csv", face)
    again = read_layout(tmp_path / "signcom.csv", face)
    assert np.abs(again.points(face) - layout.points(face)).max() < 0.01


def test_landmarks_follow_the_shape_of_another_head(face):
    identities, names = read_identities()
    other = draw_head(face, identities, names, np.random.default_rng(3)).face
    here, there = find_landmarks(face), find_landmarks(other)
    moved = np.array([np.linalg.norm(here[name] - there[name]) for name in here])
    assert 1.0 < moved.mean() < 15.0


@pytest.mark.slow
def test_landmarks_are_found_on_a_face_of_another_topology(face):
    """The same head with its vertices in another order, seen from another origin."""
    order = np.random.default_rng(0).permutation(len(face.mesh.vertices))
    place = np.argsort(order)
    other = replace(
        face,
        mesh=Mesh(1.05 * face.mesh.vertices[order] + np.array([0.0, 5.0, -3.0]), place[face.mesh.triangles]),
        bases=1.05 * face.bases[:, order],
        identities=None,
        identity_names=(),
        colours=None,
        name="shuffled",
    )
    here, there = find_landmarks(face), find_landmarks(other)
    apart = [np.linalg.norm(1.05 * here[name] + (0.0, 5.0, -3.0) - there[name]) for name in here]
    assert np.median(apart) < 4.0


def test_an_unknown_empirical_layout_is_named(face):
    with pytest.raises(SignfaceError, match="man-99"):
        place_layout("man-99", face)


@pytest.mark.slow
def test_sites_are_allowed_moving_and_mirrored(face, sites):
    rules = Rules()
    out = forbidden(face, rules)
    for group in sites.groups:
        assert face.moving[group].all()
        assert not out[group].any()
        points = face.mesh.vertices[group]
        mirrored = points[::-1] * (-1, 1, 1)
        assert np.abs(points - mirrored).max() < 1.0


def test_no_site_lies_behind_the_lids(face, sites):
    """Skin inside the sockets moves with a blink, but nobody glues a marker there."""
    for hidden in ((29.0, 34.0, 85.0), (33.0, 42.0, 85.0), (20.0, 35.0, 84.0)):
        assert np.linalg.norm(face.mesh.vertices[face.moving] - hidden, axis=1).min() < 1.0
        assert np.linalg.norm(sites.vertices[sites.union] - hidden, axis=1).min() > 1.0


def test_chosen_markers_keep_their_distance(sites, face):
    board = Board(sites, 20)
    while board.left:
        board.take(int(np.flatnonzero(board.free)[0]))
    points = face.mesh.vertices[board.chosen]
    apart = np.linalg.norm(points[:, None] - points[None], axis=2) + 1e9 * np.eye(20)
    assert len(board.chosen) == 20
    assert apart.min() >= sites.rules.apart_mm


def test_more_markers_than_moving_vertices_are_refused(sites):
    with pytest.raises(SignfaceError, match="move"):
        sites.check_count(10_000)


def test_markers_that_do_not_fit_apart_are_refused(face):
    board = Board(find_sites(face, Rules(apart_mm=400.0)), 40)
    board.take(int(np.flatnonzero(board.free)[0]))
    with pytest.raises(SignfaceError, match="400 mm apart"):
        _ = board.free


def test_zones_that_leave_no_place_are_refused(face):
    everything = ((np.zeros(3), 1000.0),)
    with pytest.raises(SignfaceError, match="leave no place"):
        find_sites(face, Rules(spheres=everything))


def test_a_face_without_symmetry_is_refused_for_symmetric_layouts(face):
    aside = face.mesh.vertices + np.array([30.0, 0.0, 0.0])
    skewed = replace(face, mesh=Mesh(aside, face.mesh.triangles), name="skewed")
    with pytest.raises(SignfaceError, match="not symmetric"):
        find_sites(skewed)


def test_an_unknown_zone_is_named():
    with pytest.raises(SignfaceError, match="ears"):
        Rules(forbidden=("ears",))


def test_a_fixed_marker_must_stand_on_moving_skin(face):
    still = int(np.flatnonzero(~face.moving)[0])
    with pytest.raises(SignfaceError, match=str(still)):
        find_sites(face, Rules(fixed=(still,)))
