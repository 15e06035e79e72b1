"""Nothing of a tested take, or of a tested signer, reaches what it is tested by."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from sklearn.ensemble import RandomForestClassifier
from sklearn.model_selection import GroupKFold, LeaveOneGroupOut, StratifiedKFold, cross_val_score
from sklearn.neighbors import KNeighborsClassifier

from signface.descriptors import Descriptors
from signface.evaluation.protocol import PROTOCOLS, evaluate_folds, folds_of
from signface.label.vocabulary import AFFECT
from signface.learn.examples import Example, frame_table
from signface.learn.folds import groups_of, inner_folds
from signface.learn.training import train
from tests.fixtures.hand_made import BASES, corpus, example
from tests.fixtures.training import quick

#: Labels that are drawn at random, in which nothing can be learnt but by leakage.
DRAWN = ("J", "A", "Su")

#: Three standard deviations of the 36 segments tested above chance: a leak gives nearly 1.
BY_CHANCE = 1 / 3 + 3 * (2 / 9 / 36) ** 0.5


def fingerprinted(signers: int = 2, takes: int = 6, seed: int = 0) -> list[Example]:
    """Takes with labels drawn at random that do not show in the face, and a fingerprint in it that tells the take.

    Each take has one label, its own value of every base, and noise. Who has seen a frame of a take knows its label.
    """
    rng = np.random.default_rng(seed)
    made = []
    for s in range(signers):
        for kind in ("IE", "SE", "EU"):
            for n in range(takes):
                label = DRAWN[rng.integers(len(DRAWN))]
                other = DRAWN[(DRAWN.index(label) + 1) % len(DRAWN)]
                one = example(
                    [label, other, label], take=f"S{s}-{kind}-{n}", signer=f"S{s}", kind=kind, hold=0.8, rate=25
                )
                shape = one.descriptors.weights.shape
                # Each label of each take is a point of its own: the nearest neighbour knows all that was seen.
                prints = {name: rng.uniform(0, 1, len(BASES)) for name in (label, other)}
                weights = rng.normal(0, 0.01, shape)
                time = one.descriptors.time
                for row in one.reference.table.itertuples(index=False):
                    inside = (time >= row.start_s) & (time < row.end_s)
                    weights[inside] += prints.get(row.label, np.full(len(BASES), 0.5))
                made.append(dataclasses.replace(one, descriptors=Descriptors(weights, BASES, one.descriptors.rate)))
    return made


@pytest.fixture(scope="module")
def prints():
    return fingerprinted()


def protocol_folds(examples, protocol, train_kinds):
    return folds_of(examples, protocol=protocol, train_kinds=train_kinds, test_kinds=["EU"], turns=2)


def test_a_fingerprint_gives_a_take_away_to_who_has_seen_a_frame_of_it(prints):
    """The trap works: split frame by frame, as it must not be done, random labels are found."""
    X, y, takes, _ = frame_table(prints)
    assert (
        cross_val_score(KNeighborsClassifier(1), X, y, cv=StratifiedKFold(4, shuffle=True, random_state=0)).mean()
        > 0.95
    )
    assert cross_val_score(KNeighborsClassifier(1), X, y, groups=takes, cv=GroupKFold(4)).mean() < 0.55


@pytest.mark.parametrize(
    ("protocol", "kinds", "options"),
    [
        ("within", ["IE", "SE"], {}),
        ("within", ["IE", "SE", "EU"], {"features": ("weights", "derivatives", "windows"), "normalise": "signer"}),
        pytest.param(
            "within",
            ["IE", "SE", "EU"],
            {"search": True, "calibrate": True, "folds": 2, "balanced": True},
            marks=pytest.mark.slow,
        ),
        ("across", ["IE", "SE", "EU"], {"normalise": "signer", "aggregate": "frames"}),
    ],
)
def test_random_labels_are_found_by_chance_only(prints, protocol, kinds, options):
    folds = protocol_folds(prints, protocol, kinds)
    scores = evaluate_folds(folds, quick(**options), classifiers=["knn1"]).metrics["classifiers"]["knn1"]
    assert scores["manual_segments"]["n"] == 36
    assert scores["manual_segments"]["accuracy"] < BY_CHANCE


@pytest.mark.slow
@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_random_labels_are_found_by_chance_only_by_sequence_models(prints, protocol):
    metrics = evaluate_folds(protocol_folds(prints, protocol, ["EU"]), classifiers=["hmm"]).metrics
    assert metrics["classifiers"]["hmm"]["manual_segments"]["accuracy"] < BY_CHANCE


def test_what_is_learnt_of_random_labels_is_not_thought_well_of(prints):
    """Scores that stand in a card come from takes left out."""
    one = [e for e in prints if e.signer == "S0"]
    scores = train(one, quick("knn1", calibrate=True, folds=3)).card.scores
    assert max(scores.values()) < BY_CHANCE


def test_inner_folds_part_signers_takes_and_sentences():
    several = corpus()
    for kept, left_out in inner_folds(several):
        assert not {e.signer for e in kept} & {e.signer for e in left_out}
    one = [e for e in several if e.signer == "S1"]
    assert sorted(e.take for _, left_out in inner_folds(one) for e in left_out) == sorted(e.take for e in one)
    named = [dataclasses.replace(e, sentence=str(n % 4)) for n, e in enumerate(one)]
    assert set(groups_of(named)) == {f"sentence {n}" for n in range(4)}
    for kept, left_out in inner_folds(named):
        assert not {e.sentence for e in kept} & {e.sentence for e in left_out}
    assert inner_folds(one[:1]) == []


def test_every_frame_of_a_table_knows_its_take_and_its_signer():
    examples = corpus()
    X, y, takes, signers = frame_table(examples, features=("weights", "windows"))
    assert len(X) == len(y) == len(takes) == len(signers)
    assert X.shape[1] == 3 * len(BASES)
    assert set(y) == set(AFFECT.values)
    where = {e.take: e.signer for e in examples}
    assert [where[take] for take in takes] == signers.tolist()
    forest = RandomForestClassifier(10, random_state=0)
    for trained, tested in LeaveOneGroupOut().split(X, y, signers):
        assert not set(takes[trained]) & set(takes[tested])  # thinned neighbours stand on one side
    assert cross_val_score(forest, X, y, groups=signers, cv=LeaveOneGroupOut()).min() > 0.9


def test_normalising_a_signer_looks_at_no_label_and_no_other_signer():
    examples = corpus()
    X, _, _, signers = frame_table(examples, normalise="signer")
    alone = frame_table([e for e in examples if e.signer == "S1"], normalise="signer").X
    np.testing.assert_array_equal(X[signers == "S1"], alone)
    swapped = dict(zip(AFFECT.values, [*list(AFFECT.values)[1:], "N"], strict=True))
    turned = [
        dataclasses.replace(
            e,
            reference=e.reference.changed(
                "turned", e.reference.table.assign(label=[swapped.get(x, x) for x in e.reference.table["label"]])
            ),
        )
        for e in examples
    ]
    np.testing.assert_array_equal(frame_table(turned, normalise="signer").X, X)
