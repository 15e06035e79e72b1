"""The classifiers and their training."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.label.labellers import make_labeller
from signface.label.labelling import label_spans
from signface.learn.examples import Example, training_frames
from signface.learn.training import train
from signface.segmentation.segments import Segments
from signface.settings.choices import NAMES, SEQUENCE_NAMES
from signface.settings.solve import SolveSettings
from signface.settings.training import TrainingSettings
from tests.fixtures.hand_made import BASES, corpus, example
from tests.fixtures.training import quick


@pytest.fixture(scope="module")
def takes() -> list[Example]:
    return [e for e in corpus() if e.kind == "IE"]


@pytest.mark.parametrize("name", NAMES)
def test_labellers_are_estimators_that_clone(name):
    labeller = make_labeller(name, seed=3)
    assert str(clone(labeller).get_params()) == str(labeller.get_params())


@pytest.mark.parametrize("name", NAMES)
def test_labellers_tell_distinct_faces_apart_and_say_how_sure_they_are(name, takes):
    model = train(takes, quick(name))
    unseen = example(["N", "J", "A", "Su", "Sa", "F", "D"], seed=999)
    labels, confidences = label_spans(unseen.descriptors, unseen.stable[["start_s", "end_s"]].to_numpy(), model)
    assert labels == unseen.stable["label"].tolist()
    assert all(0.3 < confidence <= 1 for confidence in confidences)
    probabilities = model.probabilities(unseen.descriptors.weights)
    np.testing.assert_allclose(probabilities.sum(axis=1), 1)


def test_labellers_work_in_a_search_of_scikit_learn(takes):
    weights, labels = (np.concatenate(part) for part in zip(*(training_frames(e, BASES, rate=3) for e in takes)))
    search = GridSearchCV(make_labeller("knn3"), {"n_neighbors": [1, 3]}, cv=2).fit(weights, labels)
    assert search.best_score_ > 0.9


def test_an_unknown_classifier_is_refused_with_the_known_ones():
    with pytest.raises(SignfaceError, match="svm-rbf"):
        make_labeller("perceptron")


@settings(deadline=None, max_examples=20)
@given(rate=st.sampled_from([25.0, 60.0, 200.0]), hold=st.floats(0.3, 2.0))
def test_training_frames_are_as_many_per_second_at_every_rate(rate, hold):
    one = example(["N", "J", "N"], rate=rate, hold=hold)
    weights, labels = training_frames(one, BASES, rate=10)
    expected = 3 * hold * 10
    assert len(weights) == len(labels) == pytest.approx(expected, abs=3)
    assert set(labels) == {"N", "J"}


def test_training_frames_come_from_stable_segments_only():
    one = example(["N", "J"], rate=100, noise=0.0)
    weights, labels = training_frames(one, BASES, rate=100)
    assert len(labels) == pytest.approx(200, abs=2)
    for label in ("N", "J"):  # held faces do not move; a frame of the transition would
        np.testing.assert_allclose(np.ptp(weights[labels == label], axis=0), 0, atol=1e-3)


def test_frames_without_weights_are_not_trained_on():
    one = example(["N", "J"])
    weights = one.descriptors.weights.copy()
    weights[20:60] = np.nan
    holed = Descriptors(weights, BASES, one.descriptors.rate)
    frames, _ = training_frames(Example("t", "S", "IE", holed, one.reference), BASES)
    assert np.isfinite(frames).all()


@pytest.mark.slow
def test_the_order_of_the_takes_does_not_matter(takes):
    unseen = example(["N", "J", "A", "Su"], seed=5).descriptors.weights
    one, other = train(takes, quick()), train(takes[::-1], quick())
    np.testing.assert_array_equal(one.probabilities(unseen), other.probabilities(unseen))
    assert one.card == other.card


def test_takes_may_list_their_bases_in_other_orders(takes):
    order = np.random.default_rng(0).permutation(len(BASES))
    shuffled = [
        Example(
            e.take,
            e.signer,
            e.kind,
            Descriptors(e.descriptors.weights[:, order], [BASES[i] for i in order], e.descriptors.rate),
            e.reference,
        )
        for e in takes[1:]
    ]
    unseen = example(["N", "J", "A", "Su"], seed=5).descriptors.weights
    one, other = train(takes, quick("knn1")), train([takes[0], *shuffled], quick("knn1"))
    np.testing.assert_array_equal(one.probabilities(unseen), other.probabilities(unseen))


def test_takes_of_other_faces_are_not_mixed(takes):
    stranger = Descriptors(takes[0].descriptors.weights, [f"other{i}" for i in range(len(BASES))], 100)
    with pytest.raises(SignfaceError, match="other bases"):
        train([*takes, Example("x", "S3", "IE", stranger, takes[0].reference)], quick())


def test_the_card_says_what_the_model_was_trained_on(takes):
    card = train(takes, quick("knn3", seed=7), corpus="toy", solve=SolveSettings(alpha=0.3)).card
    assert (card.classifier, card.corpus, card.face, card.seed) == ("knn3", "toy", "default", 7)
    assert SolveSettings.from_dict(card.solve) == SolveSettings(alpha=0.3)
    assert (card.signers, card.kinds, card.bases) == (("S1", "S2"), ("IE",), BASES)
    assert len(card.takes) == len(takes)
    assert card.labels == tuple(sorted(card.labels))


@pytest.mark.parametrize(("labels", "problem"), [([], "no annotated take"), (["N"], "1 label,")])
def test_too_little_to_train_on_is_said(labels, problem):
    with pytest.raises(SignfaceError, match=problem):
        train([example(labels)] if labels else [], quick())


def test_a_label_outside_the_vocabulary_is_named():
    one = example(["N", "J"])
    table = one.reference.table.assign(label=["N", "NJ", "Joy"])
    with pytest.raises(SignfaceError, match="unknown label Joy"):
        Example("t", "S", "IE", one.descriptors, Segments(table))


def test_a_reference_without_labels_is_refused():
    one = example(["N", "J"])
    unlabelled = Segments(pd.DataFrame({"start_s": [0.0], "end_s": [1.0], "kind": ["stable"]}))
    with pytest.raises(SignfaceError, match="no labels"):
        Example("t", "S", "IE", one.descriptors, unlabelled)


def test_left_out_takes_are_scored_and_noise_scores_near_chance(takes):
    score, _ = train(takes, quick("knn3", calibrate=True)).card.scores.values()
    assert score > 0.95
    rng = np.random.default_rng(0)
    noisy = [
        Example(
            e.take,
            e.signer,
            e.kind,
            Descriptors(rng.normal(size=e.descriptors.weights.shape), BASES, e.descriptors.rate),
            e.reference,
        )
        for e in takes
    ]
    score, _ = train(noisy, quick("knn3", calibrate=True)).card.scores.values()
    assert score < 0.75  # neutral is 60 % of the segments


def test_the_card_says_the_settings_as_they_were_chosen(takes):
    settings = quick("knn3", normalise="signer", seed=3)
    card = train(takes, settings).card
    assert TrainingSettings.from_dict(card.training) == settings
    assert (card.classifier, card.normalise, card.seed) == ("knn3", "signer", 3)


def test_settings_for_another_classifier_change_nothing_but_what_it_cannot_use():
    settings = TrainingSettings(features=("windows", "weights"))
    for name in (*NAMES, *SEQUENCE_NAMES):
        one = settings.for_classifier(name)
        assert one.classifier == name
        assert one.features == (("weights",) if name in SEQUENCE_NAMES else ("windows", "weights"))
        assert one.changed(classifier="forest", features=settings.features) == settings


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({"features": ("smell",)}, "no features named smell"),
        ({"features": ()}, "no features are named"),
        ({"features": ("weights", "weights")}, "named twice"),
        ({"classifier": "hmm", "features": ("windows",)}, "makes its own features"),
        ({"classifier": "oracle"}, "oracle"),
        ({"folds": 1}, "two or more"),
        ({"aggregate": "median"}, "median"),
    ],
)
def test_settings_that_cannot_be_are_refused_when_they_are_made(values, problem):
    with pytest.raises(SignfaceError, match=problem):
        TrainingSettings(**values)
