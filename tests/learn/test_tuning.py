"""What is chosen and calibrated within the training takes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from signface.errors import SignfaceError
from signface.label.calibration import brier_score, calibrated, expected_calibration_error, fit_calibration
from signface.label.labellers import make_labeller
from signface.label.labelling import find_segments
from signface.learn.training import train
from signface.learn.tuning import GRIDS
from signface.settings.choices import NAMES, SEQUENCE_NAMES
from tests.fixtures.hand_made import corpus, example
from tests.fixtures.training import quick


def overconfident(rng: np.random.Generator, size: int) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Confidences whose log odds are twice what they should be, whether each was right, and the take."""
    raw = rng.uniform(0.3, 0.99, size)
    true = 1 / (1 + np.sqrt((1 - raw) / raw))
    return raw, rng.uniform(size=size) < true, [f"take{n % 12}" for n in range(size)]


def test_overconfidence_is_taken_back():
    raw, hits, takes = overconfident(np.random.default_rng(0), 3000)
    line = fit_calibration(raw, hits, takes)
    assert line["slope"] == pytest.approx(0.5, abs=0.1)
    assert line["ece_after"] < 0.4 * line["ece_before"]
    assert line["brier_after"] < line["brier_before"]
    unseen, right, _ = overconfident(np.random.default_rng(1), 3000)
    assert expected_calibration_error(calibrated(unseen, line), right) < 0.04


def test_what_is_calibrated_already_is_left_alone():
    rng = np.random.default_rng(0)
    kept = 0
    for _ in range(10):
        raw = rng.uniform(0.2, 0.95, 60)
        kept += bool(fit_calibration(raw, rng.uniform(size=60) < raw, [f"take{n % 6}" for n in range(60)]))
    assert kept < 8


@pytest.mark.parametrize("hits", [[True] * 6, [False] * 6])
def test_nothing_is_learnt_where_all_is_right_or_all_wrong(hits):
    assert fit_calibration(np.linspace(0.5, 0.9, 6), np.array(hits), list("abcdef")) == {}
    assert fit_calibration(np.array([0.5, 0.9]), np.array([True, False]), ["a", "a"]) == {}


@settings(deadline=None, max_examples=30)
@given(slope=st.floats(0.05, 5), offset=st.floats(-3, 3))
def test_surer_stays_surer_and_confidences_stay_shares(slope, offset):
    raw = np.linspace(0, 1, 50)
    made = calibrated(raw, {"slope": slope, "offset": offset})
    assert (np.diff(made) >= 0).all()
    assert ((made > 0) & (made < 1)).all()
    np.testing.assert_array_equal(calibrated(raw, {}), raw)


@settings(deadline=None, max_examples=30)
@given(st.lists(st.tuples(st.floats(0, 1), st.booleans()), min_size=1, max_size=60))
def test_errors_of_confidences_are_shares_and_do_not_depend_on_the_order(items):
    sure, hits = (np.array(part) for part in zip(*items, strict=True))
    for measure in (expected_calibration_error, brier_score):
        assert 0 <= measure(sure, hits) <= 1
        assert measure(sure[::-1], hits[::-1]) == pytest.approx(measure(sure, hits))
    assert expected_calibration_error(hits.astype(float), hits) == 0


def test_labels_do_not_change_when_confidences_are_calibrated():
    takes = [e for e in corpus() if e.kind == "IE"]
    model = train(takes, quick("forest"))
    unseen = example(["N", "J", "A", "Su", "N"], seed=9).descriptors
    line = dataclasses.replace(model.card, calibration={"slope": 0.5, "offset": -0.5})
    before, after = (find_segments(unseen, m).table for m in (model, dataclasses.replace(model, card=line)))
    assert before["label"].tolist() == after["label"].tolist()
    assert (after["confidence"] < before["confidence"]).all()
    stable = after["kind"] == "stable"
    between = after["confidence"].to_numpy()
    np.testing.assert_allclose(between[~stable], (between[:-2] * between[2:])[~stable[1:-1]])


@pytest.mark.parametrize("name", NAMES)
def test_every_parameter_of_a_grid_exists(name):
    for parameter, values in GRIDS[name].items():
        for value in values:
            make_labeller(name, parameters={parameter: value})
    with pytest.raises(SignfaceError, match="no parameter named depth"):
        make_labeller(name, parameters={"depth": 3})


def test_the_grid_of_sequence_models_exists():
    from signface.sequence.hsmm import make_sequence_labeller

    for name in SEQUENCE_NAMES:
        grid = GRIDS.get(name, GRIDS["sequence"])
        assert set(grid) <= set(make_sequence_labeller(name).get_params())


def test_a_search_finds_the_parameter_that_works(monkeypatch):
    """At C = 0.0001 a machine calls everything neutral; a search must not choose it."""
    takes = [e for e in corpus(hold=0.4) if e.kind == "IE"]
    monkeypatch.setitem(GRIDS, "svm-linear", {"C": [0.0001, 1.0]})
    model = train(takes, quick("svm-linear", search=True, folds=2))
    assert model.card.parameters == {"C": 1.0}


@pytest.mark.slow
def test_a_sequence_model_is_searched_too():
    takes = [e for e in corpus(("S1",), hold=0.6) if e.kind == "IE"]
    model = train(takes, quick("hmm", search=True, folds=2))
    assert set(model.card.parameters) == set(GRIDS["sequence"])
    assert model.estimator.get_params()["rarity"] == model.card.parameters["rarity"]


def test_one_take_cannot_be_searched_over():
    with pytest.raises(SignfaceError, match="too few training takes"):
        train([example(["N", "J", "A"])], quick(search=True))


@pytest.mark.slow
def test_balanced_training_finds_more_of_what_is_rare():
    """Two expressions of one kind, of which one is rare: weighted alike, the rare one is called more often."""
    rng = np.random.default_rng(0)
    takes = []
    for n in range(6):
        one = example(["N", "J", "N", "J", "N", "A"] if n == 0 else ["N", "J", "N"], take=f"t{n}", hold=0.8)
        weights = 0.4 * one.descriptors.weights + rng.normal(0, 0.15, one.descriptors.weights.shape)
        takes.append(dataclasses.replace(one, descriptors=dataclasses.replace(one.descriptors, weights=weights)))
    frames = np.random.default_rng(1).normal(0.1, 0.15, (400, 12))
    for name in ("svm-linear", "forest", "knn3"):
        share = [np.mean(train(takes, quick(name, balanced=b)).estimator.predict(frames) == "A") for b in (False, True)]
        assert share[1] > share[0]
