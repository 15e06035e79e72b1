"""Creep of the markers, told apart from expressions."""

from __future__ import annotations

import numpy as np
import pytest

from signface.face.layout_files import read_layout
from signface.solver.creep import RATE_HZ, Creep
from signface.solver.thin_shell import ThinShellSolver
from signface.solver.uncertainty import deviations


@pytest.fixture(scope="module")
def layout(face):
    return read_layout("default-40", face)


@pytest.fixture(scope="module")
def shown(face, layout):
    """A minute at 5 Hz of faces that come and go, with rest between them; weights and displacements."""
    rng = np.random.default_rng(0)
    weights = np.zeros((round(60 * RATE_HZ), face.n_bases))
    observed = np.flatnonzero(ThinShellSolver(face, layout).markers.observed)
    for begin in range(10, len(weights) - 10, 20):
        which = rng.choice(observed, 4, replace=False)
        weights[begin : begin + 10, which] = np.sin(np.linspace(0.0, np.pi, 10))[:, None] * rng.uniform(0.3, 0.9, 4)
    return weights, np.tensordot(weights, layout.bases(face), axes=1)


def test_most_of_the_creep_is_found_and_no_expression_is_taken_for_it(face, layout, shown):
    rng = np.random.default_rng(1)
    weights, moved = shown
    slow = np.sin(np.linspace(0.0, 3.0, len(moved)))[:, None, None]
    crept = slow * rng.normal(0.0, 0.3, (1, 40, 3))
    given = moved + crept + rng.normal(0.0, 0.05, moved.shape)
    creep = Creep(face, layout).fit(given, RATE_HZ)
    found = creep.at(np.arange(len(given)))
    assert np.sqrt(((found - crept) ** 2).mean()) < 0.5 * np.sqrt((crept**2).mean())
    solver = ThinShellSolver(face, layout)
    before, after = (np.sqrt(((solver.solve(d).weights - weights) ** 2).mean()) for d in (given, given - found))
    assert after < 0.7 * before
    assert creep.size_mm == pytest.approx(np.sqrt((found**2).sum(axis=2).mean()))


def test_where_nothing_creeps_nothing_is_taken_away(face, layout, shown):
    _, moved = shown
    assert Creep(face, layout).fit(moved, RATE_HZ).size_mm < 0.05


def test_an_expression_held_for_long_is_kept(face, layout):
    weights = np.zeros((150, face.n_bases))
    weights[25:125, [face.names.index(name) for name in ("mouthSmileLeft", "mouthSmileRight")]] = 0.8
    moved = np.tensordot(weights, layout.bases(face), axes=1)
    solved = (
        ThinShellSolver(face, layout).solve(moved - Creep(face, layout).fit(moved, RATE_HZ).at(np.arange(150))).weights
    )
    assert solved[75, face.names.index("mouthSmileLeft")] > 0.7


def test_creep_between_two_frames_lies_between_and_gaps_do_no_harm(face, layout, shown):
    _, moved = shown
    gone = moved.copy()
    gone[20:40, 3] = np.nan
    gone[200] = np.nan
    creep = Creep(face, layout).fit(gone + 0.2, RATE_HZ)
    steps = creep.at(np.array([10.0, 10.25, 11.0, 1e6]))
    assert np.isfinite(creep.at(np.arange(len(gone)))).all()
    np.testing.assert_allclose(steps[1], 0.75 * steps[0] + 0.25 * steps[2])
    np.testing.assert_array_equal(steps[3], creep.at(np.array([len(gone) - 1]))[0])


def test_deviations_say_how_far_weights_are_off(face, layout, shown):
    """A signer whose bases are a tenth stronger or weaker, with markers that jitter."""
    rng = np.random.default_rng(2)
    weights, _ = shown
    bases = layout.bases(face) * rng.normal(1.0, 0.1, (face.n_bases, 1, 1))
    moved = np.tensordot(weights, bases, axes=1) + rng.normal(0.0, 0.15, (len(weights), 40, 3))
    solver = ThinShellSolver(face, layout)
    solution = solver.solve(moved)
    within = np.abs(solution.weights - weights) < 2 * deviations(solver, solution)
    assert within[solution.weights > 0.05].mean() > 0.85
    moved[3] = np.nan
    assert np.isnan(deviations(solver, solver.solve(moved))[3]).all()
