"""The commands that cut recordings, train on corpora and evaluate on them, from the shell to the files."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from signface.cli.main import main
from signface.corpus.examples import solve_corpus
from signface.corpus.manifest import TakeEntry, read_corpus, write_takes
from signface.descriptors_files import write_weights
from signface.elan.writing import write_eaf
from signface.evaluation.measure import evaluate
from signface.label.persistence import load_model, read_card
from signface.segmentation.segments import Segments
from signface.settings.choices import NAMES
from signface.settings.training import TrainingSettings
from tests.fixtures.hand_made import corpus


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A corpus of weights with reference annotations."""
    folder = tmp_path_factory.mktemp("corpus") / "small"
    entries = []
    for made in corpus():
        path, annotation = folder / made.signer / f"{made.take}.csv", folder / made.signer / f"{made.take}.eaf"
        write_weights(made.descriptors, path)
        write_eaf(made.reference, annotation, signer=made.signer)
        entries.append(TakeEntry(path, made.signer, made.kind, annotation=annotation))
    write_takes(folder, entries)
    return folder


def test_segment_writes_the_table_of_a_weights_file(folder, tmp_path, capsys):
    assert main(["segment", str(folder / "S1" / "S1-IE-J.csv"), "-o", str(tmp_path / "cut.csv")]) == 0
    table = pd.read_csv(tmp_path / "cut.csv")
    assert list(table.columns) == ["start_s", "end_s", "kind"]
    assert table.kind.tolist() == ["stable", "transition"] * 4 + ["stable"]
    np.testing.assert_array_equal(table.start_s[1:], table.end_s[:-1])
    assert "5 stable, 4 transitions" in capsys.readouterr().out


@pytest.mark.parametrize("output", ["cut.txt", "."])
def test_segment_writes_csv_only(folder, tmp_path, output, capsys):
    assert main(["segment", str(folder / "S1" / "S1-IE-J.csv"), "-o", str(tmp_path / output)]) == 2
    assert "csv" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_train_writes_a_model_with_its_card(folder, tmp_path, capsys):
    file = tmp_path / "mine.skops"
    assert main(["train", str(folder), "-o", str(file), "--classifier", "knn3", "--kinds", "IE"]) == 0
    card = read_card(file)
    assert (card.classifier, card.kinds, card.signers, card.corpus) == ("knn3", ("IE",), ("S1", "S2"), "small")
    accuracy, balanced = card.scores.values()
    printed = capsys.readouterr().out
    assert f"accuracy on reference segments of left-out training signers: {accuracy:.2f}" in printed
    assert f"{balanced:.2f}" in printed


@pytest.mark.slow
def test_train_takes_variants_and_chooses_parameters(folder, tmp_path, capsys):
    file = tmp_path / "mine.skops"
    options = ["--features", "weights,windows", "--normalise", "signer", "--aggregate", "frames", "--balanced"]
    search = ["--classifier", "svm-linear", "--search", "--kinds", "IE"]
    assert main(["train", str(folder), "-o", str(file), *options, *search]) == 0
    card = load_model(file).card
    assert (card.features, card.normalise, card.aggregate, card.balanced) == (
        ("weights", "windows"),
        "signer",
        "frames",
        True,
    )
    assert set(card.parameters) == {"C"}
    assert f"chosen: C {card.parameters['C']}" in capsys.readouterr().out


@pytest.mark.slow
def test_train_each_writes_a_model_for_each_signer(folder, tmp_path):
    assert (
        main(["train", str(folder), "-o", str(tmp_path / "m.skops"), "--classifier", "knn1", "--signer", "each"]) == 0
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["m-S1.skops", "m-S2.skops"]
    assert load_model(tmp_path / "m-S2.skops").card.signers == ("S2",)


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        (["--kinds", "XX"], "has no take of the kind XX"),
        (["--signer", "Bob"], "has no take of the signer Bob"),
    ],
)
def test_train_names_what_the_corpus_lacks(folder, tmp_path, capsys, options, problem):
    assert main(["train", str(folder), "-o", str(tmp_path / "m.skops"), *options]) == 2
    assert problem in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_evaluate_writes_and_prints_both_kinds_of_signer(folder, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["evaluate", str(folder), "-o", str(out), "--train-kinds", "IE"]) == 0
    metrics = json.loads((out / "metrics.json").read_text())
    assert set(metrics) >= {"segmentation", "classifiers", "protocol"}
    assert list(metrics["classifiers"]) == list(NAMES)
    assert metrics["protocol"]["name"] == "within"
    across = metrics["also"]["across"]
    for part in (metrics, across):
        for fold in part["protocol"]["folds"]:
            assert not set(fold["train_takes"]) & set(fold["test_takes"])
    assert {f["signer"] for f in across["protocol"]["folds"]} == {"S1", "S2"}
    printed = capsys.readouterr().out
    for word in ("signer trained on", "signer not trained on", "chance", "majority class", *NAMES):
        assert word in printed
    accuracy = metrics["classifiers"]["forest"]["automatic_segments"]["accuracy"]
    assert f"{accuracy:.2f}" in printed
    confusion = pd.read_csv(out / "confusion_across_knn1.csv", keep_default_na=False)
    frames = confusion[confusion["on"] == "frames"].set_index("reference").drop(columns="on").to_numpy(int)
    assert frames.tolist() == across["classifiers"]["knn1"]["frames"]["confusion"]


@pytest.mark.slow
def test_the_report_needs_nothing_outside_itself(folder, tmp_path):
    options = ["--train-kinds", "IE", "--protocol", "within", "--classifiers", "knn1", "--date", "some day"]
    assert main(["evaluate", str(folder), "-o", str(tmp_path / "out"), *options]) == 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "some day" in page
    assert "<svg" in page
    assert 'src="http' not in page
    assert "signer not trained on" not in page
    assert "<link" not in page


@pytest.mark.slow
def test_metrics_say_what_was_chosen_in_each_fold_and_how_reliable_it_is(folder):
    examples = solve_corpus(read_corpus(folder))
    settings = TrainingSettings(search=True, folds=2)
    metrics, _ = evaluate(examples, settings, protocols=["within"], train_kinds=["IE", "EU"], classifiers=["knn1"])
    tested = [take for fold in metrics["protocol"]["folds"] for take in fold["test_takes"]]
    assert len(tested) == len(set(tested)) == 12
    for fold in metrics["protocol"]["folds"]:
        assert not set(fold["train_takes"]) & set(fold["test_takes"])
        assert set(fold["trained"]["knn1"]["parameters"]) == {"weights", "metric"}
    scores = metrics["classifiers"]["knn1"]["manual_segments"]
    assert 0 <= scores["calibration_error"] < 0.5
    assert 0 <= scores["brier"] < 0.5


@pytest.fixture
def copied(folder, tmp_path):
    """A copy of the corpus that a test may spoil."""
    shutil.copytree(folder, tmp_path / "spoilt")
    return tmp_path / "spoilt"


def one_class(folder):
    for e in corpus():
        table = e.reference.table[e.reference.table["label"] == "N"].reset_index(drop=True)
        write_eaf(Segments(table), folder / e.signer / f"{e.take}.eaf", signer=e.signer, replace=True)


def untrained_signer(folder):
    lines = (folder / "takes.csv").read_text().splitlines()
    (folder / "takes.csv").write_text("\n".join(line for line in lines if ",S2,IE," not in line) + "\n")


def empty_annotation(folder):
    e = corpus()[0]
    write_eaf(Segments(e.reference.table[:0]), folder / e.signer / f"{e.take}.eaf", signer=e.signer, replace=True)


def foreign_labels(folder):
    file = folder / "S1" / "S1-IE-J.eaf"
    file.write_text(file.read_text().replace(">J<", ">Wonder<"))


def foreign_signer(folder):
    file = folder / "S1" / "S1-IE-J.eaf"
    file.write_text(file.read_text().replace("@S1", "@Maria"))


def newer_store(folder):
    assert (
        main(["train", str(folder), "-o", str(folder / "first.skops"), "--classifier", "knn1", "--no-calibrate"]) == 0
    )
    for file in (folder / "descriptors").rglob("*.parquet"):
        table = pq.read_table(file, partitioning=None)
        about = json.loads(pq.read_metadata(file).metadata[b"signface"]) | {"format": 99}
        pq.write_table(table.replace_schema_metadata({"signface": json.dumps(about)}), file)


SPOILT = {
    one_class: "the training takes show 1 label, a classifier needs two or more",
    untrained_signer: "no annotated take of the kind IE to train on for the signer S2",
    empty_annotation: "S1-IE-A.eaf: its reference annotation is empty",
    foreign_labels: "S1-IE-J.eaf: label 'Wonder' on tier affect@S1",
    foreign_signer: "S1-IE-J.eaf: no tier affect@S1 or affect",
    newer_store: "newer signface",
}


@pytest.mark.slow
@pytest.mark.parametrize("spoil", SPOILT, ids=lambda spoil: spoil.__name__)
@pytest.mark.parametrize("command", ["train", "evaluate"])
def test_a_corpus_that_cannot_be_used_is_one_clear_error_and_nothing_is_lost(copied, tmp_path, capsys, spoil, command):
    if spoil is untrained_signer and command == "train":
        pytest.skip("a classifier of everybody can be trained without one of them")
    out = tmp_path / ("m.skops" if command == "train" else "report")
    if command == "train":
        out.write_bytes(b"a classifier of before")
    else:
        out.mkdir()
        (out / "metrics.json").write_text("results of before")
    spoil(copied)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    capsys.readouterr()
    options = ["--classifier", "knn1"] if command == "train" else ["--train-kinds", "IE", "--classifiers", "knn1"]
    assert main([command, str(copied), "-o", str(out), *options]) == 2
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("signface: ")]
    assert len(errors) == 1
    assert SPOILT[spoil] in errors[0]
    assert {path: path.read_bytes() for path in before} == before


def test_a_signer_without_training_takes_is_named(copied, tmp_path, capsys):
    untrained_signer(copied)
    options = ["-o", str(tmp_path / "m.skops"), "--classifier", "knn1", "--signer", "S2", "--kinds", "IE"]
    assert main(["train", str(copied), *options]) == 2
    assert "the signer S2 has no take of the kind IE" in capsys.readouterr().err
    assert not (tmp_path / "m.skops").exists()
