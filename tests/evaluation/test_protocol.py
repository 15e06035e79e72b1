"""The evaluation of the thesis: nothing that is tested was trained on."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.evaluation import protocol as protocol_module
from signface.evaluation.protocol import PROTOCOLS, Fold, evaluate_folds, folds_of, most_overlapping
from signface.label.vocabulary import AFFECT
from signface.learn.training import train
from signface.settings.choices import NAMES
from tests.fixtures.hand_made import BASES, corpus, example


@pytest.fixture(scope="module")
def examples():
    return corpus()


def folds(examples, protocol="within"):
    return folds_of(examples, protocol=protocol, train_kinds=["IE"], test_kinds=["EU"])


@settings(deadline=None, max_examples=30)
@given(
    rows=st.lists(
        st.tuples(st.sampled_from(["S1", "S2", "S3"]), st.sampled_from(["IE", "SE", "EU"])), min_size=1, max_size=20
    ),
    protocol=st.sampled_from(list(PROTOCOLS)),
)
def test_no_fold_tests_a_take_it_trains_on(rows, protocol):
    one = example(["N", "J"])
    examples = [
        dataclasses.replace(one, take=f"take{i}", signer=signer, kind=kind) for i, (signer, kind) in enumerate(rows)
    ]
    try:
        found = folds_of(examples, protocol=protocol, train_kinds=["IE", "SE"], test_kinds=["EU"])
    except SignfaceError:
        return
    for fold in found:
        assert not {e.take for e in fold.train} & {e.take for e in fold.test}
        assert {e.signer for e in fold.test} == {fold.signer}
        assert {e.kind for e in fold.test} == {"EU"}
        assert ({e.signer for e in fold.train} == {fold.signer}) == (protocol == "within")


def test_training_is_given_the_training_takes_and_nothing_else(examples, monkeypatch):
    trained_on = []

    def noting(takes, settings, **options):
        trained_on.extend(takes)
        return train(takes, settings, **options)

    monkeypatch.setattr(protocol_module, "train", noting)
    evaluate_folds(folds(examples), classifiers=["knn1"])
    assert {e.kind for e in trained_on} == {"IE"}
    assert not {e.take for e in trained_on} & {e.take for e in examples if e.kind == "EU"}


@pytest.mark.slow
def test_answers_do_not_depend_on_the_references_of_the_test_takes(examples):
    """Were a test reference seen in training, turning all of them round would change what is found."""
    other = dict(zip(AFFECT.values, [*list(AFFECT.values)[1:], "N"], strict=True))

    def turned(e):
        table = e.reference.table.assign(label=[other.get(label, label) for label in e.reference.table.label])
        return dataclasses.replace(e, reference=e.reference.changed("turned", table))

    turned_round = [turned(e) if e.kind == "EU" else e for e in examples]
    right, wrong = (
        evaluate_folds(folds(takes), classifiers=["forest"]).metrics["classifiers"]["forest"]["manual_segments"]
        for takes in (examples, turned_round)
    )
    assert np.sum(right["confusion"], axis=0).tolist() == np.sum(wrong["confusion"], axis=0).tolist()
    assert right["accuracy"] > 0.95
    assert wrong["accuracy"] < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_metrics_have_the_agreed_form(examples, protocol):
    metrics = evaluate_folds(folds(examples, protocol)).metrics
    assert set(metrics["segmentation"]) >= {"boundary_f1", "mean_iou", "frame_agreement"}
    assert "0.10" in metrics["segmentation"]["boundary_f1"]
    assert list(metrics["classifiers"]) == list(NAMES)
    for sections in metrics["classifiers"].values():
        assert set(sections) == {"manual_segments", "automatic_segments", "frames"}
        for scores in sections.values():
            assert set(scores) >= {"accuracy", "macro_f1", "n", "labels", "confusion", "chance", "majority"}
            assert np.sum(scores["confusion"]) == scores["n"] > 0
            assert 0.8 < scores["accuracy"] <= 1  # distinct faces, well held


def test_noise_in_place_of_faces_is_not_told_apart(examples):
    rng = np.random.default_rng(0)
    noisy = [
        dataclasses.replace(
            e, descriptors=Descriptors(rng.normal(size=e.descriptors.weights.shape), BASES, e.descriptors.rate)
        )
        for e in examples
    ]
    scores = evaluate_folds(folds(noisy), classifiers=["knn3"]).metrics["classifiers"]["knn3"]["manual_segments"]
    assert scores["accuracy"] < scores["majority"] + 0.1


def test_signers_are_scored_one_by_one(examples):
    found = evaluate_folds(folds(examples), classifiers=["knn1"])
    counts = [found.by_signer[s]["knn1"]["manual_segments"]["n"] for s in ("S1", "S2")]
    assert sum(counts) == found.metrics["classifiers"]["knn1"]["manual_segments"]["n"]


def test_an_automatic_segment_should_have_the_label_of_most_of_it():
    reference = example(["N", "J", "A"], hold=1.0, duration=0.4).stable  # 0-1 N, 1.4-2.4 J, 2.8-3.8 A
    spans = np.array([[0.0, 1.6], [0.9, 2.0], [1.1, 1.3], [2.0, 9.0]])
    assert most_overlapping(spans, reference) == ["N", "J", "", "A"]


def test_a_take_in_both_sets_is_refused(examples):
    with pytest.raises(SignfaceError, match="both trained on and tested"):
        Fold("S1", tuple(examples[:2]), tuple(examples[1:3]))


@pytest.mark.slow
def test_a_kind_that_is_trained_on_and_tested_is_tested_in_turns(examples):
    found = folds_of(examples, protocol="within", train_kinds=["IE", "EU"], test_kinds=["EU"], turns=3)
    tested = [e.take for fold in found for e in fold.test]
    assert sorted(tested) == sorted(e.take for e in examples if e.kind == "EU")  # each once
    for fold in found:
        assert not {e.take for e in fold.train} & {e.take for e in fold.test}
        assert {e.signer for e in (*fold.train, *fold.test)} == {fold.signer}
        assert {e.take for e in fold.train if e.kind == "IE"} == {
            e.take for e in examples if e.kind == "IE" and e.signer == fold.signer
        }
    scores = evaluate_folds(found, classifiers=["knn1"]).metrics["classifiers"]["knn1"]["manual_segments"]
    assert scores["n"] == sum(len(e.stable) for e in examples if e.kind == "EU")


def test_takes_of_one_sentence_are_never_apart(examples):
    named = [dataclasses.replace(e, sentence=f"{n % 3}" if e.kind == "EU" else None) for n, e in enumerate(examples)]
    for fold in folds_of(named, protocol="within", train_kinds=["IE", "EU"], test_kinds=["EU"]):
        assert not {e.sentence for e in fold.train} & {e.sentence for e in fold.test}
    alike = [dataclasses.replace(e, sentence="1") for e in examples[:2]]
    with pytest.raises(SignfaceError, match="sentences would be both"):
        Fold("S1", tuple(alike[:1]), tuple(alike[1:]))


@pytest.mark.parametrize(
    ("protocol", "kinds", "problem"),
    [("between", "EU", "no protocol"), ("within", "XX", "no annotated take of the kind XX")],
)
def test_what_cannot_be_evaluated_is_said(examples, protocol, kinds, problem):
    with pytest.raises(SignfaceError, match=problem):
        folds_of(examples, protocol=protocol, train_kinds=["IE"], test_kinds=[kinds])


def test_one_signer_cannot_be_unseen(examples):
    alone = [e for e in examples if e.signer == "S1"]
    with pytest.raises(SignfaceError, match="two signers"):
        folds(alone, "across")
