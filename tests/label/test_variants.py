"""Descriptor variants: what they show, and that they show it of one take and one signer at a time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.base import clone

from signface.cli.main import main
from signface.descriptors import Descriptors
from signface.descriptors_files import read_weights, write_weights
from signface.elan.reference import read_reference
from signface.errors import SignfaceError
from signface.evaluation.protocol import evaluate_folds, folds_of
from signface.label.labelling import find_segments, label_spans
from signface.label.persistence import load_model, save_model
from signface.label.variants import DescriptorVariant
from signface.learn.training import train
from signface.signer import signer_level
from tests.fixtures.hand_made import BASES, corpus, example
from tests.fixtures.training import quick


def ramp(slope: float, rate: float, seconds: float = 3.0) -> Descriptors:
    time = np.arange(round(seconds * rate)) / rate
    return Descriptors(np.column_stack([slope * time, np.full(len(time), 0.3)]), ("jawOpen", "browDown"), rate)


def test_a_variant_is_a_transformer_that_clones():
    variant = DescriptorVariant(features=("weights", "windows"), normalise="signer")
    assert clone(variant).get_params() == variant.get_params()
    (made,) = variant.fit_transform([ramp(0.1, 100)])
    assert made.names == variant.names(("jawOpen", "browDown"))


def test_weights_as_they_are_stay_as_they_are():
    take = ramp(0.1, 100)
    assert DescriptorVariant().transform([take]) == [take]


@settings(deadline=None, max_examples=20)
@given(slope=st.floats(-0.3, 0.3), rate=st.sampled_from([25.0, 60.0, 200.0]))
def test_the_derivative_of_a_steady_movement_is_its_speed_at_every_rate(slope, rate):
    made = DescriptorVariant(features=("derivatives",)).of(ramp(slope, rate))
    inside = made.weights[round(0.3 * rate) : -round(0.3 * rate)]
    np.testing.assert_allclose(inside, np.tile([slope, 0.0], (len(inside), 1)), atol=1e-9)


@settings(deadline=None, max_examples=20)
@given(slope=st.floats(-0.3, 0.3), rate=st.sampled_from([25.0, 60.0, 200.0]))
def test_windows_show_the_mean_and_how_unsteady_a_second_is(slope, rate):
    made = DescriptorVariant(features=("windows",)).of(ramp(slope, rate))
    assert made.names == ("mean(jawOpen)", "mean(browDown)", "deviation(jawOpen)", "deviation(browDown)")
    middle = made.weights[len(made.weights) // 2]
    time = (len(made.weights) // 2) / rate
    np.testing.assert_allclose(middle[:2], [slope * time, 0.3], atol=1e-9)
    np.testing.assert_allclose(middle[2:], [abs(slope) / np.sqrt(12), 0], atol=0.05 * abs(slope) + 1e-6)


@settings(deadline=None, max_examples=10)
@given(offset=st.floats(-0.2, 0.2), factor=st.floats(0.5, 2.0))
def test_a_signer_who_rests_and_moves_otherwise_is_hardly_otherwise_when_normalised(offset, factor):
    take = example(["N", "J", "A", "N"]).descriptors
    other = Descriptors(offset + factor * take.weights, BASES, take.rate)
    one, same = (DescriptorVariant(normalise="signer").of(item).weights for item in (take, other))
    assert np.corrcoef(one.ravel(), same.ravel())[0, 1] > 0.98
    assert np.abs(same.mean(axis=0)).max() < 1e-9


def test_a_base_that_hardly_moves_is_not_blown_up():
    rng = np.random.default_rng(0)
    weights = np.column_stack([np.sin(np.arange(500) / 50), rng.normal(0, 1e-4, 500)])
    made = DescriptorVariant(normalise="signer").of(Descriptors(weights, ("moves", "still"), 100))
    assert made.weights[:, 0].std() > 0.9
    assert made.weights[:, 1].std() < 0.01


def test_frames_without_weights_stay_without_and_harm_no_others():
    weights = np.tile(np.linspace(0, 1, 300)[:, None], 2)
    weights[100:120] = np.nan
    take = Descriptors(weights, ("a", "b"), 100)
    made = DescriptorVariant(("weights", "derivatives", "windows"), "signer").of(take)
    assert np.isnan(made.weights[100:120]).all()
    assert np.isfinite(np.delete(made.weights, slice(100, 120), axis=0)).all()


def test_signers_are_told_apart_and_the_length_of_a_take_counts():
    takes = [ramp(0.1, 100, 1), ramp(0.1, 50, 3), ramp(0.3, 100, 3)]
    made = DescriptorVariant(normalise="signer").transform(takes, ["A", "A", "B"])
    np.testing.assert_allclose(made[2].weights, DescriptorVariant(normalise="signer").of(takes[2]).weights)
    level = signer_level(takes[:2])
    assert level.mean[0] == pytest.approx((1 * 0.05 + 3 * 0.15) / 4, abs=0.002)
    with pytest.raises(SignfaceError, match="no frame has weights"):
        signer_level([Descriptors(np.full((5, 1), np.nan), ("a",), 100)])


@pytest.mark.parametrize(
    ("features", "normalise", "problem"),
    [
        (("weight",), "none", "no features named weight"),
        ((), "none", "no features are named"),
        (("windows", "windows"), "none", "twice"),
        (("weights",), "take", "no normalisation named take"),
    ],
)
def test_unknown_variants_are_refused(features, normalise, problem):
    with pytest.raises(SignfaceError, match=problem):
        DescriptorVariant(features, normalise).check()


@pytest.mark.parametrize("aggregate", ["mean", "frames"])
def test_a_saved_model_makes_its_variant_of_what_it_annotates(tmp_path, aggregate):
    takes = [e for e in corpus() if e.kind == "IE"]
    options = {"features": ("weights", "windows"), "normalise": "signer", "aggregate": aggregate, "balanced": True}
    model = train(takes, quick("knn3", **options))
    save_model(model, tmp_path / "m.skops")
    loaded = load_model(tmp_path / "m.skops")
    assert loaded.card == model.card
    unseen = example(["N", "J", "A", "Su", "N"], seed=9)
    spans = unseen.stable[["start_s", "end_s"]].to_numpy()
    labels, _ = label_spans(unseen.descriptors, spans, loaded)
    assert labels == unseen.stable["label"].tolist()
    level = signer_level([e.descriptors for e in takes if e.signer == "S1"])
    found = find_segments(unseen.descriptors, loaded, level=level).table
    assert found.loc[found["kind"] == "stable", "label"].tolist() == labels
    by_take, by_signer = (loaded.seen(unseen.descriptors, one).weights for one in (None, level))
    assert by_take.shape == by_signer.shape == (unseen.descriptors.n_frames, 3 * len(BASES))
    assert np.abs(by_take - by_signer).max() > 0.1


def test_a_sequence_model_takes_no_other_features():
    takes = [e for e in corpus() if e.kind == "IE"]
    with pytest.raises(SignfaceError, match="its own features"):
        train(takes, quick("hmm", features=("weights", "windows")))


@pytest.mark.slow
def test_an_evaluation_normalises_signers_by_their_test_takes():
    examples = corpus()
    folds = folds_of(examples, protocol="across", train_kinds=["IE"], test_kinds=["EU"])
    training = {"normalise": "signer", "aggregate": "frames"}
    table = evaluate_folds(folds, quick(**training), classifiers=["forest"]).tables["forest"]["manual_segments"]
    model = train(folds[0].train, quick("forest", **training))
    level = signer_level([e.descriptors for e in folds[0].test])
    tested = folds[0].test[0]
    spans = tested.stable[["start_s", "end_s"]].to_numpy()
    _, sure = label_spans(tested.descriptors, spans, model, level=level)
    assert table.loc[table["take"] == tested.take, "confidence"].tolist() == sure
    assert sure != label_spans(tested.descriptors, spans, model)[1]


@pytest.mark.slow
def test_annotate_normalises_by_all_takes_that_it_is_given(tmp_path):
    takes = [e for e in corpus() if e.kind == "IE"]
    save_model(train(takes, quick("forest", normalise="signer")), tmp_path / "m.skops")
    unseen = [
        example(labels, seed=n, take=f"t{n}") for n, labels in enumerate((["N", "J", "N"], ["N", "A", "N", "Su"]))
    ]
    files = [tmp_path / f"{e.take}.csv" for e in unseen]
    for e, file in zip(unseen, files, strict=True):
        write_weights(e.descriptors, file)
    call = ["annotate", *map(str, files), "-o", str(tmp_path / "out"), "--classifier", str(tmp_path / "m.skops")]
    assert main(call) == 0
    read = [read_weights(file) for file in files]
    level = signer_level(read)
    for take in read:
        wanted = find_segments(take, load_model(tmp_path / "m.skops"), level=level).table
        written = read_reference(tmp_path / "out" / f"{take.name}.eaf").table
        assert written["label"].tolist() == wanted["label"].tolist()
        np.testing.assert_allclose(written["start_s"], wanted["start_s"], atol=0.001)
