"""Training and evaluating on any tier, with any vocabulary."""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd
import pytest

from signface.errors import SignfaceError
from signface.evaluation.measure import evaluate
from signface.label.labellers import SEQUENCE_NAMES
from signface.label.labelling import find_segments, without_transitions
from signface.label.persistence import load_model, read_card, save_model
from signface.label.vocabulary import AFFECT, Vocabulary
from signface.learn.examples import Example, common_vocabulary
from signface.learn.training import train
from signface.segmentation.segments import Segments, value_at
from tests.fixtures.hand_made import corpus
from tests.fixtures.training import quick

#: The hand-made faces under other names: neutral is nothing, three are raised brows, and three are lowered ones.
BROWS = Vocabulary("brows", ("raised", "lowered", "none"), {"none": "nothing annotated"})
RENAMED = dict(zip(AFFECT.values, ("none", "raised", "raised", "raised", "lowered", "lowered", "lowered"), strict=True))


def on_brows(example: Example, *, sparse: bool = False, vocabulary: Vocabulary = BROWS) -> Example:
    """The example as an annotator of brows has it: each value with half of the movements beside it, the rest empty."""
    table = without_transitions(example.reference.table)
    table = table.assign(label=table["label"].map(RENAMED))
    shown = Segments(table[table["label"] != "none"])
    end = example.descriptors.start + example.descriptors.duration
    reference = shown if sparse else shown.filled(example.descriptors.start, end, "none")
    return dataclasses.replace(example, reference=reference, vocabulary=vocabulary, tier="brows")


@pytest.fixture(scope="module")
def examples():
    return [on_brows(example) for example in corpus()]


@pytest.mark.slow
@pytest.mark.parametrize("classifier", ["knn3", "forest", *(name for name in SEQUENCE_NAMES if name != "gru")])
def test_every_classifier_learns_a_tier_without_transitions(examples, classifier, tmp_path):
    parameters = {"iterations": 25} if classifier == "crf" else {}
    model = train([e for e in examples if e.signer == "S1"], quick(classifier, parameters=parameters))
    assert set(model.card.labels) == set(BROWS.values)
    assert (model.card.vocabulary, model.card.tier) == (BROWS, "brows")
    right = total = 0
    for example in (e for e in examples if e.signer == "S2"):
        table = find_segments(example.descriptors, model).table
        assert set(table["kind"]) == {"stable"}
        assert table["label"].tolist()[1:] != table["label"].tolist()[:-1] or len(table) == 1
        np.testing.assert_allclose(table["start_s"][1:], table["end_s"][:-1], atol=1e-9)  # one ends where one begins
        assert table["confidence"].between(0, 1).all()
        times = np.arange(example.descriptors.start + 0.02, table["end_s"].iloc[-1], 0.04)
        right += int((value_at(table, "label", times) == value_at(example.reference.table, "label", times)).sum())
        total += len(times)
    assert right / total > 0.85
    save_model(model, tmp_path / "brows.skops")
    assert read_card(tmp_path / "brows.skops") == model.card
    assert load_model(tmp_path / "brows.skops").card.vocabulary == BROWS


@pytest.mark.slow
def test_chance_and_labels_are_those_of_the_vocabulary(examples):
    metrics = evaluate(examples, quick(), protocols=["within"], train_kinds=["IE"], classifiers=["knn1"]).metrics
    scores = metrics["classifiers"]["knn1"]
    for section in ("manual_segments", "automatic_segments", "frames"):
        assert scores[section]["labels"] == list(BROWS.values)
        assert scores[section]["chance"] == pytest.approx(1 / 3)
        assert np.shape(scores[section]["confusion"]) == (3, 3)
    assert scores["manual_segments"]["accuracy"] > 0.9
    assert scores["frames"]["accuracy"] > 0.8


@pytest.mark.slow
def test_the_order_of_the_vocabulary_changes_only_the_order(examples):
    turned = dataclasses.replace(BROWS, values=BROWS.values[::-1])
    other = [dataclasses.replace(example, vocabulary=turned) for example in examples]
    one, two = (evaluate(e, quick(), protocols=["within"], classifiers=["forest"]).metrics for e in (examples, other))
    for section in ("manual_segments", "automatic_segments", "frames"):
        first, second = (metrics["classifiers"]["forest"][section] for metrics in (one, two))
        assert np.array_equal(first["confusion"], np.array(second["confusion"])[::-1, ::-1])
        assert first["labels"] == second["labels"][::-1]
        assert {k: v for k, v in first.items() if k not in ("confusion", "labels")} == {
            k: v for k, v in second.items() if k not in ("confusion", "labels")
        }


@pytest.mark.slow
def test_what_is_not_annotated_is_unknown_where_annotation_is_sparse():
    vocabulary = Vocabulary("brows", ("raised", "lowered"))
    sparse = [on_brows(example, sparse=True, vocabulary=vocabulary) for example in corpus()]
    model = train(sparse, quick("knn3"))
    assert model.card.labels == ("lowered", "raised")
    metrics = evaluate(sparse, quick(), protocols=["within"], classifiers=["knn3"]).metrics
    frames = metrics["classifiers"]["knn3"]["frames"]
    annotated = sum(e.stable.eval("end_s - start_s").sum() for e in sparse if e.kind == "EU")
    assert frames["n"] == pytest.approx(25 * annotated, rel=0.1)
    assert frames["chance"] == 0.5


def test_gaps_are_filled_and_nothing_else_changes():
    table = pd.DataFrame({"start_s": [0.5, 1.01], "end_s": [1.0, 2.0], "kind": "stable", "label": ["a", "b"]})
    filled = Segments(table).filled(0.0, 3.0, "none").table
    assert filled["label"].tolist() == ["none", "a", "b", "none"]  # 10 ms between two annotations are none
    assert filled["start_s"].tolist() == [0.0, 0.5, 1.01, 2.0]
    assert filled["end_s"].tolist() == [0.5, 1.0, 2.0, 3.0]
    assert Segments(table).filled(0.5, 2.0, "none").table["label"].tolist() == ["a", "b"]
    empty = Segments(table.iloc[:0]).filled(0.0, 1.0, "none").table
    assert empty[["start_s", "end_s", "label"]].to_numpy().tolist() == [[0.0, 1.0, "none"]]


def test_transitions_made_of_moments_lie_around_them_and_leave_the_labels(examples):
    for example in examples:
        moving = example.moving.table
        assert [
            label for label, kind in zip(moving["label"], moving["kind"]) if kind == "stable"
        ] == example.reference.table["label"].tolist()
        np.testing.assert_allclose(moving["start_s"][1:], moving["end_s"][:-1], atol=1e-9)
        back = without_transitions(moving)
        np.testing.assert_allclose(back[["start_s", "end_s"]], example.reference.table[["start_s", "end_s"]], atol=1e-9)


def test_takes_of_two_tiers_are_not_mixed(examples):
    with pytest.raises(SignfaceError, match="other vocabularies"):
        common_vocabulary([examples[0], corpus()[1]])
    with pytest.raises(SignfaceError, match="other vocabularies"):
        train([examples[0], corpus()[1]], quick("knn1"))


def test_a_label_outside_the_vocabulary_is_refused(examples):
    with pytest.raises(SignfaceError, match="unknown label none"):
        dataclasses.replace(examples[0], vocabulary=Vocabulary("brows", ("raised", "lowered")))
