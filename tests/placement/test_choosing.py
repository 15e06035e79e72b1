"""Markers chosen by clusters, by reconstruction, by design and by a thin shell."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from signface.errors import SignfaceError
from signface.placement.choosing import METHODS, Material, choose, unseen_bases
from signface.placement.clusters import trajectories
from signface.placement.evaluation import skin_metric
from signface.placement.selection import Reconstruction, ThinShell
from signface.placement.sites import Rules


@pytest.fixture(scope="module")
def material(face, actors):
    return Material(face, actors, Rules())


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_every_method_gives_the_number_asked_for_symmetric_and_apart(face, material, method):
    layout = choose(material, method, 15)
    points = layout.points(face)
    assert len(points) == 15
    mirrored = np.linalg.norm(points[:, None] - points[None] * (-1, 1, 1), axis=2).min(axis=1)
    assert mirrored.max() < 1.0
    apart = np.linalg.norm(points[:, None] - points[None], axis=2) + 1e9 * np.eye(15)
    assert apart.min() >= material.rules.apart_mm
    assert len(layout.head_labels) == 6


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_fixed_markers_stay(face, material, actors, method):
    nose = int(np.argmax(face.mesh.vertices[:, 2]))
    fixed = Material(face, actors, Rules(fixed=(nose,)))
    fixed.__dict__.update(skins=material.skins)
    points = choose(fixed, method, 15).points(face)
    assert len(points) == 15
    assert np.linalg.norm(points - face.mesh.vertices[nose], axis=1).min() < 1e-9


def test_rows_of_trajectories_keep_the_distances_of_the_normalised_ones(actors, face):
    some = np.flatnonzero(face.moving)[::40]
    skin = actors[0].head.skin(actors[0].range_of_motion[::6], some)
    rows = trajectories([skin])
    plain = ((skin - skin.mean(axis=0)) / np.maximum(skin.std(axis=0), 0.02)).transpose(1, 0, 2).reshape(len(some), -1)
    near = np.linalg.norm(rows[:, None] - rows[None], axis=2)
    true = np.linalg.norm(plain[:, None] - plain[None], axis=2)
    assert np.abs(near - true).max() < 0.02 * true.max()


@pytest.mark.slow
def test_a_marker_stands_within_its_own_cluster(face, material):
    found = material.clusters(20)
    place = {int(vertex): row for row, vertex in enumerate(material.sites.clustered)}
    for number, vertex in enumerate(found.markers):
        assert found.members[place[vertex]] == number


@pytest.mark.slow
def test_one_seed_gives_one_layout(material):
    assert material.clusters(12, seed=3).markers == material.clusters(12, seed=3).markers


def test_the_clusters_do_not_depend_on_the_scale_of_a_motion(actors, face):
    """Eq. 3.6 divides every trajectory by its own deviation."""
    lively = np.flatnonzero(np.linalg.norm(face.bases, axis=2).max(axis=0) > 4.0)[::15]
    skin = actors[0].head.skin(actors[0].range_of_motion[::6], lively)
    skin = skin[:, (skin.std(axis=0) > 0.05).all(axis=1)]
    rest = skin.mean(axis=0)
    own, larger = trajectories([skin]), trajectories([rest + 10.0 * (skin - rest)])
    assert len(own) > 10
    assert np.allclose(own @ own.T, larger @ larger.T, atol=1e-6 * (own @ own.T).max())


@pytest.mark.slow
def test_each_marker_lowers_the_reconstruction_error_by_what_was_promised(material):
    criterion = material.criterion("greedy", 10)
    for _ in range(4):
        gains, before = criterion.gains(), criterion.error
        best = int(np.argmax(gains))
        criterion.add(material.sites.groups[best])
        assert before - criterion.error == pytest.approx(gains[best], rel=1e-6)
        assert criterion.gains()[best] < 0.7 * gains[best]


def test_the_reconstruction_error_is_that_of_linear_regression(face, material, actors):
    """The running update equals ridge regression on the same markers, solved at once."""
    criterion = material.criterion("greedy", 10)
    assert isinstance(criterion, Reconstruction)
    sites = material.sites
    groups = sites.groups[5:60:13]
    noise = criterion._noise.copy()
    for group in groups:
        criterion.add(group)
    union = sites.union
    flat = np.concatenate([skin[:, union] - skin[:, union].mean(axis=0) for skin in material.skins])
    flat = flat.reshape(len(flat), -1)
    shown = np.concatenate(
        [own - own.mean(axis=0) for own in (a.shown(w) for a, w in zip(material.actors, material.weights))]
    )
    values, vectors = np.linalg.eigh(skin_metric(face))
    target = shown @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    rows = np.concatenate([criterion.rows(group) for group in groups])
    x, count = flat[:, rows], len(flat)
    inner = x.T @ x / count + np.diag(noise[rows])
    cross = x.T @ target / count
    expected = (target**2).sum() / count - np.trace(cross.T @ np.linalg.solve(inner, cross))
    assert criterion.error == pytest.approx(expected, rel=1e-8)


@pytest.mark.slow
def test_a_thin_shell_passes_through_its_handles(material):
    criterion = material.criterion("thin-shell", 10)
    assert isinstance(criterion, ThinShell)
    before = criterion.error
    vertices = [int(group[0]) for group in material.sites.groups[3:200:40]]
    criterion.add(vertices)
    rows = np.searchsorted(material.sites.union, vertices)
    assert np.abs(criterion._residual[criterion._rows[rows]]).max() < 1e-6 * np.sqrt(before)
    assert criterion.error < before


@pytest.mark.slow
@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10_000))
def test_information_only_grows(material, seed):
    """No marker takes information away, whichever come first."""
    rng = np.random.default_rng(seed)
    for method in ("a-optimal", "d-optimal"):
        criterion = material.criterion(method, 20)
        for site in rng.choice(len(material.sites.groups), 3, replace=False):
            before = criterion.gains()
            criterion.add(material.sites.groups[site])
            after = criterion.gains()
            assert (after > -1e-9).all()
            if method == "d-optimal":  # submodular: what is known already tells less
                assert (after <= before + 1e-9).all()


def test_a_base_that_never_moves_is_named(face, actors):
    from dataclasses import replace

    still = actors[0].range_of_motion.copy()
    still[:, face.names.index("cheekPuff")] = 0.0
    never, _ = unseen_bases(face, [replace(actors[0], range_of_motion=still)])
    assert "cheekPuff" in never


def test_too_many_markers_are_refused(material):
    with pytest.raises(SignfaceError, match="10000 markers"):
        choose(material, "greedy", 10_000)


def test_an_unknown_method_is_named(material):
    with pytest.raises(SignfaceError, match="genetic"):
        choose(material, "genetic", 20)
