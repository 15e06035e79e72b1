"""Calibrating a signer from a take whose weights are known."""

from __future__ import annotations

import numpy as np
import pytest

from signface.errors import SignfaceError
from signface.face.layout_files import read_layout
from signface.face.reading import read_face
from signface.settings.solve import SolveSettings
from signface.solver.calibration import calibrate
from signface.solver.range_of_motion import Shown, away_from_avatar, calibrate_guarded, calibrate_signer
from signface.solver.thin_shell import ThinShellSolver
from signface.takes.take import Take


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


def _range_of_motion(bases: np.ndarray, names: tuple[str, ...], seed: int) -> tuple[np.ndarray, list[Shown]]:
    """Displacements of a signer with these bases at 50 Hz: one base after the other, others moving along, jitter."""
    rng = np.random.default_rng(seed)
    count, length = len(bases), 40
    weights = one_after_the_other(count, 50.0)
    for base in range(count):
        stretch = weights[base * length : (base + 1) * length]
        stretch *= rng.uniform(0.6, 1.0)
        for other in rng.choice(np.delete(np.arange(count), base), 2, replace=False):
            stretch[:, other] = rng.uniform(0.0, 0.15) * stretch[:, base]
    shown = [Shown(base * 0.8, (base + 1) * 0.8, (name,)) for base, name in enumerate(names)]
    marked = np.tensordot(weights, bases, axes=1)
    return marked + rng.normal(0.0, 0.12, marked.shape), shown


def _take(displacements: np.ndarray, face, layout) -> Take:
    skin = layout.points(face) + displacements
    head = np.repeat(layout.points(face, layout.head_labels)[None], len(skin), axis=0)
    return Take(np.concatenate([skin, head], axis=1), (*layout.face_labels, *layout.head_labels), rate=50.0)


@pytest.mark.parametrize("departure", [0.0, 0.35])
def test_held_out_frames_decide_whether_a_signer_gets_bases_of_their_own(avatar, departure):
    face, layout = avatar
    rng, bases = np.random.default_rng(5), layout.bases(face)
    size = np.sqrt((bases**2).mean(axis=(1, 2)))[:, None, None]
    own = bases + departure * rng.normal(size=bases.shape) * size
    displacements, shown = _range_of_motion(own, face.names, seed=6)
    rest = np.zeros((50, *displacements.shape[1:]))
    take = _take(np.concatenate([rest, displacements]), face, layout)
    later = [Shown(window.start_s + 1.0, window.end_s + 1.0, window.bases) for window in shown]
    how = SolveSettings(neutral=0.3)
    found = calibrate_guarded(take, later, face, layout, settings=how)
    forced = calibrate_guarded(take, later, face, layout, settings=how, force=True)
    assert found.better == (departure > 0.0)
    assert (found.avatar_mm, found.own_mm) == (forced.avatar_mm, forced.own_mm)
    assert away_from_avatar(forced.signer.bases, face, layout) > 0.01
    if found.better:
        assert found.signer == forced.signer
    else:  # solved exactly as without a file
        assert np.array_equal(found.signer.bases.at(face, layout), bases)
    assert calibrate_signer(take, later, face, layout, settings=how) == found.signer
