"""What more training takes and signers bring is measured on what is never trained on."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from signface.evaluation.importance import mirrored_groups, permutation_importance
from signface.evaluation.learning_curve import learning_curve, remembering
from signface.evaluation.protocol import folds_of
from signface.learn.training import train
from tests.fixtures.hand_made import BASES, corpus
from tests.fixtures.training import quick


@pytest.fixture(scope="module")
def examples():
    return corpus(("S1", "S2", "S3"))


def folds(examples, protocol):
    return folds_of(examples, protocol=protocol, train_kinds=["IE"], test_kinds=["EU"])


@pytest.mark.slow
def test_a_curve_grows_by_whole_takes_of_the_training_set_only(examples):
    trained_on = []

    def noting(takes, settings, **options):
        trained_on.append({e.take for e in takes})
        return train(takes, settings, **options)

    curve = learning_curve(folds(examples, "within"), classifiers=["knn1"], train=noting)
    assert {take for takes in trained_on for take in takes} == {e.take for e in examples if e.kind == "IE"}
    assert sorted({len(takes) for takes in trained_on}) == sorted(set(curve["size"]))
    assert curve["size"].max() == 6
    by_size = curve.groupby("size")["accuracy"].mean()
    assert by_size[1] < 0.85  # one take shows one expression and neutral
    assert by_size[6] > 0.95
    assert set(curve.n) == {sum(len(e.stable) for e in examples if e.kind == "EU")}


def test_signers_are_added_with_all_their_takes(examples):
    curve = learning_curve(folds(examples, "across"), classifiers=["knn1"], by="signers", whole={"knn1": 0.5})
    assert sorted(set(curve["size"])) == [1, 2]
    assert curve.loc[curve["size"] == 2, "accuracy"].tolist() == [0.5]  # what is known is not trained again
    assert set(curve["by"]) == {"signers"}


@pytest.mark.slow
def test_the_cost_of_a_curve_is_bounded(examples):
    counted = []

    def noting(takes, settings, **options):
        counted.append(len(takes))
        return train(takes, settings, **options)

    known = {"knn1": 1.0}
    learning_curve(folds(examples, "within"), classifiers=["knn1"], whole=known, most_takes=60, train=noting)
    assert sum(counted) <= 60


@pytest.mark.slow
def test_a_curve_repeats_with_its_seed(examples):
    drawn, curves = [], []
    for seed in (1, 1, 2):
        parts = set()

        def noting(takes, settings, parts=parts, **options):
            parts.add(frozenset(e.take for e in takes))
            return train(takes, settings, **options)

        curves.append(learning_curve(folds(examples, "within"), quick(seed=seed), classifiers=["knn1"], train=noting))
        drawn.append(parts)
    assert curves[0].equals(curves[1])
    assert drawn[0] == drawn[1] != drawn[2]


def test_the_same_takes_are_trained_on_once(examples):
    calls = []

    def noting(takes, settings, **options):
        calls.append(1)
        return train(takes, settings, **options)

    remembered = remembering(noting)
    takes = [e for e in examples if e.kind == "IE"]
    assert remembered(takes, quick("knn1", seed=0)) is remembered(takes[::-1], quick("knn1", seed=0))
    remembered(takes, quick("knn3", seed=0))
    assert len(calls) == 2


def test_left_and_right_are_one_and_slopes_belong_to_their_base():
    names = ["jawOpen", "jawLeft", "jawRight", "browDownLeft", "slope(jawOpen)", "smile_L", "smile_R"]
    assert mirrored_groups(names) == {
        "jawOpen": [0, 4],
        "jaw": [1, 2],
        "browDownLeft": [3],
        "smile": [5, 6],
    }


def test_a_base_that_tells_the_labels_apart_matters_and_noise_does_not(examples):
    rng = np.random.default_rng(0)

    def noisy(e):  # the last base says nothing: it moves at random from segment to segment
        weights = e.descriptors.weights.copy()
        weights[:, -1] = rng.normal(0, 0.05)
        return dataclasses.replace(e, descriptors=dataclasses.replace(e.descriptors, weights=weights))

    parts = folds([noisy(e) for e in examples], "within")
    models = [train(fold.train, quick("knn1")) for fold in parts]
    table = permutation_importance(parts, models)
    lost = table.set_index("group")["accuracy_lost"]
    assert set(lost.index) == set(BASES)
    assert abs(lost[BASES[-1]]) < 0.02 < lost.max()
    assert lost.is_monotonic_decreasing
    assert permutation_importance(parts, models).equals(table)


def test_only_what_labels_segments_by_their_means_is_asked(examples):
    parts = folds(examples, "within")
    models = [train(fold.train, quick("knn1", aggregate="frames")) for fold in parts]
    with pytest.raises(ValueError, match="by their means"):
        permutation_importance(parts, models)
