"""The commands that cut recordings, train on corpora and evaluate on them, from the shell to the files."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

from signface.cli.main import main
from signface.corpus.manifest import TakeEntry, write_takes
from signface.descriptors import write_weights
from signface.elan.export import write_eaf
from signface.label.labellers import NAMES
from signface.label.persistence import load_model, read_card
from tests.hand_made import corpus


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A corpus of weights with reference annotations."""
    folder = tmp_path_factory.mktemp("corpus") / "small"
    entries = []
    for made in corpus():
        path, annotation = folder / made.signer / f"{made.take}.csv", folder / made.signer / f"{made.take}.eaf"
        write_weights(made.descriptors, path)
        write_eaf(annotation, made.reference, signer=made.signer)
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


def test_train_writes_a_model_with_its_card(folder, tmp_path, capsys):
    file = tmp_path / "mine.skops"
    assert main(["train", str(folder), "-o", str(file), "--classifier", "knn3", "--kinds", "IE"]) == 0
    card = read_card(file)
    assert (card.classifier, card.kinds, card.signers, card.corpus) == ("knn3", ("IE",), ("S1", "S2"), "small")
    (score,) = card.scores.values()
    assert f"{score:.2f}" in capsys.readouterr().out


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


def test_the_report_needs_nothing_outside_itself_and_is_the_same_each_time(folder, tmp_path):
    pages = []
    for name in ("one", "other"):
        out = tmp_path / name
        assert main(["evaluate", str(folder), "-o", str(out), "--train-kinds", "IE", "--protocol", "within"]) == 0
        pages.append((out / "report.html").read_bytes())
    assert pages[0] == pages[1]
    page = pages[0].decode()
    assert "<svg" in page
    assert 'src="http' not in page
    assert "signer not trained on" not in page
    assert "<link" not in page


def test_evaluate_refuses_to_test_what_it_trains_on(folder, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["evaluate", str(folder), "-o", str(out), "--train-kinds", "IE,EU", "--test-kinds", "EU"]) == 2
    assert "EU would be both trained on and tested" in capsys.readouterr().err
    assert not out.exists()
