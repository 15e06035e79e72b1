"""Accuracy and its company."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.metrics import confusion_matrix, f1_score

from signface.label.vocabulary import AFFECT
from signface.metrics.classification import accuracy_interval, classification_metrics, mcnemar

LABELS = list(AFFECT.values)
pairs = st.lists(st.tuples(st.sampled_from(LABELS), st.sampled_from(LABELS)), min_size=1, max_size=60)


@pytest.mark.slow
@settings(deadline=None)
@given(pairs=pairs)
def test_metrics_agree_with_those_of_scikit_learn(pairs):
    truth, found = zip(*pairs, strict=True)
    scores = classification_metrics(truth, found, LABELS)
    assert scores["accuracy"] == pytest.approx(np.mean([a == b for a, b in pairs]))
    assert scores["macro_f1"] == pytest.approx(f1_score(truth, found, average="macro"))
    np.testing.assert_array_equal(scores["confusion"], confusion_matrix(truth, found, labels=LABELS))


@settings(deadline=None)
@given(truth=st.lists(st.sampled_from(LABELS), min_size=1))
def test_perfect_labels_score_1_and_the_majority_class_what_it_must(truth):
    scores = classification_metrics(truth, truth, LABELS)
    assert scores["accuracy"] == scores["macro_f1"] == 1
    constant = classification_metrics(truth, [scores["majority_label"]] * len(truth), LABELS)
    assert constant["accuracy"] == pytest.approx(scores["majority"])
    assert scores["majority"] >= max(truth.count(label) for label in LABELS) / len(truth) - 1e-12


def test_chance_is_a_guess_among_the_vocabulary():
    assert classification_metrics(["N"], ["N"], LABELS)["chance"] == pytest.approx(1 / 7)


def test_without_items_nothing_is_claimed():
    scores = classification_metrics([], [], LABELS)
    assert (scores["n"], scores["accuracy"], scores["majority"]) == (0, None, None)


def test_labels_outside_the_vocabulary_are_a_defect():
    with pytest.raises(ValueError, match="unknown"):
        classification_metrics(["X"], ["N"], LABELS)


def test_the_interval_is_wider_when_errors_come_by_whole_takes():
    scattered = accuracy_interval([True, False] * 50, np.repeat(range(10), 10).astype(str))
    bundled = accuracy_interval([True] * 50 + [False] * 50, np.repeat(range(10), 10).astype(str))
    assert bundled[1] - bundled[0] > 0.4
    assert scattered[1] - scattered[0] < 0.01
    assert bundled[0] < 0.5 < bundled[1]


def test_one_take_has_no_interval():
    assert accuracy_interval([True, False], ["a", "a"]) is None


def test_balanced_accuracy_gives_each_label_the_same_weight():
    scores = classification_metrics(["N"] * 9 + ["J"], ["N"] * 10, ["N", "J"])
    assert scores["accuracy"] == 0.9
    assert scores["balanced_accuracy"] == 0.5


def test_mcnemar_looks_at_the_items_on_which_two_differ():
    first, second = [True] * 10 + [False] * 5, [True] * 2 + [False] * 8 + [False] * 5
    assert mcnemar(first, second) == {"only_first": 8, "only_second": 0, "p": pytest.approx(2 * 0.5**8)}
    assert mcnemar(first, first)["p"] == 1
