"""Calibrating a signer from a take whose weights are known."""

from __future__ import annotations

import numpy as np
import pytest

from signface.errors import SignfaceError
from signface.face.layout_files import read_layout
from signface.face.reading import read_face
from signface.solver.calibration import calibrate
from signface.solver.thin_shell import ThinShellSolver


@pytest.fixture(scope="module")
def avatar():
    face = read_face("default")
    return face, read_layout("default-40", face)


def one_after_the_other(count: int, rate: float) -> np.ndarray:
    length = int(0.8 * rate)
    weights = np.zeros((count * length, count))
    for base in range(count):
        weights[base * length : (base + 1) * length, base] = np.sin(np.linspace(0, np.pi, length)) ** 2
    return weights


def test_the_bases_that_were_shown_are_found_despite_creeping_markers(avatar):
    face, layout = avatar
    rng = np.random.default_rng(0)
    bases = layout.bases(face)
    own = (
        bases * rng.uniform(0.8, 1.2, (len(bases), 1, 1))
        + rng.normal(0.0, 0.1, bases.shape) * bases.std((1, 2))[:, None, None]
    )
    weights = one_after_the_other(len(bases), 50.0)
    shown = np.tensordot(weights, own, axes=1)
    creep = np.linspace(-0.5, 0.5, len(shown))[:, None, None] * rng.normal(size=(1, 40, 3))
    found = calibrate(shown + creep + rng.normal(0.0, 0.05, shown.shape), weights, bases, rate=50.0)
    before, after = (np.sqrt(((guess - own) ** 2).mean()) for guess in (bases, found))
    assert after < 0.3 * before


def test_what_is_not_shown_stays_the_avatars(avatar):
    face, layout = avatar
    bases = layout.bases(face)
    weights = one_after_the_other(len(bases), 50.0)
    weights[:, 7] = 0.0
    found = calibrate(np.tensordot(weights, 1.2 * bases, axes=1), weights, bases, rate=50.0)
    assert found[7] == pytest.approx(bases[7])
    assert np.abs(found[24] - 1.2 * bases[24]).max() < np.abs(0.05 * bases[24]).max()


def test_a_calibrated_solver_finds_the_signers_weights(avatar):
    face, layout = avatar
    rng = np.random.default_rng(1)
    bases = layout.bases(face)
    own = bases * rng.uniform(0.7, 1.3, (len(bases), 1, 1))
    weights = one_after_the_other(len(bases), 50.0)
    found = calibrate(np.tensordot(weights, own, axes=1), weights, bases, rate=50.0)
    truth = rng.uniform(0.0, 1.0, (200, len(bases))) * (rng.random((200, len(bases))) < 0.15)
    marked = np.tensordot(truth, own, axes=1)
    plain, calibrated = (
        _error(ThinShellSolver(face, layout, alpha=0.01, sparsity=0.0, signer_bases=signer), marked, truth)
        for signer in (None, found)
    )
    assert calibrated < 0.6 * plain


def _error(solver: ThinShellSolver, marked: np.ndarray, truth: np.ndarray) -> float:
    """RMS error of the weights that the markers observe, where no gaze drags the lids."""
    observed = solver.markers.observed
    calm = ~(truth[:, ~observed] > 0.0).any(axis=1)
    return float(np.sqrt(((solver.solve(marked[calm]).weights - truth[calm])[:, observed] ** 2).mean()))


def test_unusable_calibrations_are_refused(avatar):
    face, layout = avatar
    bases = layout.bases(face)
    weights = one_after_the_other(len(bases), 10.0)
    shown = np.tensordot(weights, bases, axes=1)
    with pytest.raises(SignfaceError, match="do not correspond"):
        calibrate(shown[:, :39], weights, bases, rate=10.0)
    with pytest.raises(SignfaceError, match="show all markers"):
        calibrate(np.where(np.arange(len(shown))[:, None, None] > 4, np.nan, shown), weights, bases, rate=10.0)
    with pytest.raises(SignfaceError, match="positive"):
        calibrate(shown, weights, bases, rate=0.0)
    with pytest.raises(SignfaceError, match="Calibrate the signer"):
        ThinShellSolver(face, layout, signer_bases=bases[:, :39])
