"""Intensities 1 to 3, learnt from annotations."""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.base import clone
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import cohen_kappa_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from signface.annotation import annotate
from signface.cli.main import main
from signface.corpus.manifest import TakeEntry, write_takes
from signface.descriptors_files import write_weights
from signface.elan.reference import read_reference
from signface.elan.writing import write_eaf
from signface.evaluation.protocol import evaluate_folds, folds_of
from signface.label.intensity import INTENSITIES
from signface.label.persistence import load_model, save_model
from signface.label.spans import segment_means
from signface.learn.examples import Example
from signface.learn.intensity import train_intensity
from signface.learn.ordinal import OrdinalClassifier, ordinal_metrics
from signface.learn.training import train
from signface.segmentation.segments import Segments
from tests.fixtures.hand_made import BASES, FACES, moving_face
from tests.fixtures.training import quick

SHOWN = ("J", "A", "Su")


def graded(take: str, seed: int, *, signer: str = "S1", kind: str = "IE") -> Example:
    """A take with expressions of known intensity: 0.35, 0.65 and 1 of the face."""
    rng = np.random.default_rng(seed)
    levels = [int(level) for level in rng.permutation(INTENSITIES)]
    labels = ["N"]
    for label in rng.permutation(SHOWN):
        labels += [str(label), "N"]
    strength = iter(levels)
    rows, faces, known = [], [], []
    for label in labels:
        level = next(strength) if label != "N" else None
        faces.append(np.zeros(len(BASES)) if level is None else FACES[label] * (0.35, 0.65, 1.0)[level - 1])
        known.append(level)
    descriptors, moves = moving_face(faces, hold=0.6, noise=0.01, seed=seed, name=take)
    marks = [0.0, *(mark for move in moves for mark in move), descriptors.duration]
    for i in range(len(marks) - 1):
        name = labels[i // 2] if i % 2 == 0 else labels[i // 2] + labels[i // 2 + 1]
        rows.append(
            (marks[i], marks[i + 1], "transition" if i % 2 else "stable", name, None if i % 2 else known[i // 2])
        )
    table = pd.DataFrame(rows, columns=["start_s", "end_s", "kind", "label", "intensity"]).astype(
        {"intensity": "Int64"}
    )
    return Example(take, signer, kind, descriptors, Segments(table, name=take))


@pytest.fixture(scope="module")
def takes() -> list[Example]:
    return [graded(f"t{n}", n) for n in range(8)]


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 1000))
def test_ordered_probabilities_are_shares_that_add_up(seed):
    rng = np.random.default_rng(seed)
    X, y = rng.normal(size=(60, 3)), rng.integers(1, 4, 60)
    probability = OrdinalClassifier(LogisticRegression()).fit(X, y).predict_proba(rng.normal(size=(40, 3)))
    assert (probability >= -1e-12).all()
    np.testing.assert_allclose(probability.sum(axis=1), 1)


def test_an_ordinal_classifier_is_an_estimator_and_follows_the_order():
    model = OrdinalClassifier(LogisticRegression())
    assert str(clone(model).get_params()) == str(model.get_params())
    x = np.linspace(0, 3, 300)[:, None]
    found = model.fit(x, 1 + x[:, 0].astype(int).clip(max=2)).predict(x)
    assert (np.diff(found) >= 0).all()
    assert set(found) == {1, 2, 3}
    with pytest.raises(ValueError, match="two or more"):
        model.fit(x, np.ones(300))


def test_intensities_of_takes_not_trained_on_are_found(takes):
    model = train_intensity(takes)
    unseen = graded("new", 99)
    found = model.annotate(unseen.descriptors, unseen.reference).table
    expressed = (found["kind"] == "stable") & (found["label"] != "N")
    assert found.loc[expressed, "intensity"].tolist() == unseen.reference.table.loc[expressed, "intensity"].tolist()
    assert found.loc[~expressed, "intensity"].isna().all()


def test_the_lines_kept_say_what_the_classifiers_behind_them_say(takes):
    model = train_intensity(takes)
    rows, levels = [], []
    for take in takes:
        table = take.stable[take.stable["label"] != "N"]
        means = segment_means(take.descriptors, table[["start_s", "end_s"]].to_numpy(float))
        rows.append(np.linalg.norm(means, axis=1))
        levels.append(table["intensity"].to_numpy(int))
    X, y = np.concatenate(rows)[:, None], np.concatenate(levels)
    whole = OrdinalClassifier(make_pipeline(StandardScaler(), LogisticRegression(max_iter=500))).fit(X, y)
    odds = X * model.lines_[:, 0] + model.lines_[:, 1]
    for step, line in zip(whole.steps_, odds.T, strict=True):
        np.testing.assert_allclose(step.decision_function(X), line, atol=1e-9)
    np.testing.assert_array_equal(model.levels_, whole.classes_)


def test_without_enough_intensities_there_is_none_to_learn(takes):
    plain = [dataclasses.replace(e, reference=Segments(e.reference.table.drop(columns="intensity"))) for e in takes]
    assert train_intensity(plain) is None
    assert train(plain, quick("knn1")).intensity is None
    assert train_intensity(takes[:3]) is None
    flat = [dataclasses.replace(e, reference=Segments(e.reference.table.assign(intensity=2))) for e in takes]
    assert train_intensity(flat) is None


def test_a_model_keeps_its_intensities_on_disk_and_annotates_them(takes, tmp_path):
    model = train(takes, quick("knn3"))
    save_model(model, tmp_path / "m.skops")
    loaded = load_model(tmp_path / "m.skops")
    unseen = graded("new", 98).descriptors
    one, other = (annotate(unseen, m).segments.table for m in (model, loaded))
    pd.testing.assert_frame_equal(one, other)
    assert set(one["intensity"].dropna()) == {1, 2, 3}


@pytest.mark.slow
def test_annotate_writes_what_the_classifier_has_learnt_into_the_tier_of_intensities(takes, tmp_path):
    entries = []
    for e in takes:
        write_weights(e.descriptors, tmp_path / "feel" / f"{e.take}.csv")
        write_eaf(e.reference, tmp_path / "feel" / f"{e.take}.eaf", signer=e.signer)
        entries.append(
            TakeEntry(tmp_path / "feel" / f"{e.take}.csv", "S1", "IE", annotation=tmp_path / "feel" / f"{e.take}.eaf")
        )
    write_takes(tmp_path / "feel", entries)
    model, out = tmp_path / "m.skops", tmp_path / "new.eaf"
    assert main(["train", str(tmp_path / "feel"), "-o", str(model), "--classifier", "knn3", "--no-calibrate"]) == 0
    unseen = graded("new", 97)
    write_weights(unseen.descriptors, tmp_path / "new.csv")
    for options in ([], ["--channels"]):  # learnt ones go before those of the channels' rule
        call = ["annotate", str(tmp_path / "new.csv"), "-o", str(out), "--classifier", str(model), "--signer", "S1"]
        assert main([*call, *options]) == 0
        written = read_reference(out, "S1").table
        truth = unseen.reference.table
        kept = truth["intensity"].notna()
        middles = truth.loc[kept, ["start_s", "end_s"]].mean(axis=1)
        rows = np.searchsorted(written["start_s"], middles, side="right") - 1
        assert written["intensity"].iloc[rows].tolist() == truth.loc[kept, "intensity"].tolist()


def test_an_evaluation_holds_what_was_learnt_beside_the_rule(takes):
    tested = [graded(f"e{n}", 50 + n, kind="EU") for n in range(3)]
    folds = folds_of([*takes, *tested], protocol="within", train_kinds=["IE"], test_kinds=["EU"])
    scores = evaluate_folds(folds, classifiers=["knn1"]).metrics["intensity"]
    assert scores["learnt"]["n"] == scores["rule"]["n"] == 9
    assert scores["learnt"]["exact"] == 1
    assert scores["rule"]["exact"] < 1


@settings(deadline=None, max_examples=30)
@given(st.lists(st.tuples(st.integers(1, 3), st.integers(1, 3)), min_size=1, max_size=40))
def test_ordinal_measures_agree_with_those_of_scikit_learn(pairs):
    truth, found = (list(part) for part in zip(*pairs, strict=True))
    scores = ordinal_metrics(truth, found)
    assert scores["exact"] <= scores["within_one"] <= 1
    if len({*truth, *found}) > 1:
        expected = cohen_kappa_score(truth, found, weights="quadratic", labels=[1, 2, 3])
        assert scores["quadratic_kappa"] == pytest.approx(expected)
    assert ordinal_metrics([], [])["exact"] is None
