"""A laboratory's own tier, from the annotator's files to the machine's: read, learnt, measured and written."""

from __future__ import annotations

import dataclasses
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from signface.annotation import annotate
from signface.cli.main import main
from signface.corpus.examples import solve_corpus
from signface.corpus.manifest import read_corpus, write_takes
from signface.elan.annotators import read_tiers
from signface.elan.document import read_document
from signface.elan.reference import read_reference
from signface.elan.vocabularies import read_vocabulary, write_vocabulary
from signface.elan.writing import write_eaf
from signface.errors import SignfaceError, SignfaceWarning
from signface.files import bundled_corpus
from signface.label.labelling import without_transitions
from signface.label.persistence import load_model, read_card
from signface.label.vocabulary import Vocabulary
from signface.learn.training import train
from signface.segmentation.segments import Segments
from tests.conftest import REPOSITORY
from tests.fixtures.elan_files import assert_valid
from tests.fixtures.training import quick

#: What all of them share takes long to make.
pytestmark = pytest.mark.slow

BROWS = Vocabulary("brows", ("up", "down"), {"up": "raised", "down": "lowered"}, {"up": (1, 2, 3), "down": (4, 5, 6)})


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The bundled corpus, with a tier of brows beside that of affect: anything shown is up, anger and disgust down."""
    folder = tmp_path_factory.mktemp("lab") / "mini"
    shutil.copytree(bundled_corpus(), folder, ignore=shutil.ignore_patterns("*.pfsx"))
    for entry in read_corpus(folder):
        table = without_transitions(read_reference(entry.annotation, entry.signer).table)
        shown = table[table["label"] != "N"]
        labels = np.where(shown["label"].isin(["A", "D"]), "down", "up")
        segments = Segments(shown.assign(label=labels)[["start_s", "end_s", "kind", "label"]], name=entry.path.stem)
        write_eaf(segments, into=entry.annotation, signer=entry.signer, tier="brows", vocabulary=BROWS)
    return folder


@pytest.fixture(scope="module")
def examples(folder):
    return solve_corpus(read_corpus(folder), tier="brows")


def test_the_rest_of_the_take_is_none(examples):
    for example in examples:
        assert example.vocabulary == BROWS.with_blank("none")
        assert example.tier == "brows"
        table = example.reference.table
        assert set(table["label"]) <= {"up", "down", "none"}
        assert table["start_s"].iloc[0] == example.descriptors.start
        assert table["end_s"].iloc[-1] == example.descriptors.start + example.descriptors.duration
        np.testing.assert_allclose(table["start_s"][1:], table["end_s"][:-1], atol=1e-9)


def test_the_rest_of_the_take_is_unknown_where_annotation_is_sparse(folder, examples):
    for sparse, whole in zip(solve_corpus(read_corpus(folder), tier="brows", sparse=True), examples, strict=True):
        assert sparse.vocabulary == BROWS
        shown = whole.reference.table.query("label != 'none'").reset_index(drop=True)
        assert sparse.reference.table[list(shown)].equals(shown)


def test_a_vocabulary_can_be_named_or_is_found_in_the_annotations(folder, tmp_path):
    corpus = read_corpus(folder)
    (tmp_path / "mine.txt").write_text("down\nup\nsideways\n")
    named = solve_corpus(corpus, tier="brows", vocabulary=read_vocabulary(tmp_path / "mine.txt"))
    assert named[0].vocabulary.values == ("down", "up", "sideways", "none")
    with pytest.raises(SignfaceError, match="not in the vocabulary"):
        solve_corpus(corpus, tier="brows", vocabulary=Vocabulary("brows", ("up",)))
    with pytest.raises(SignfaceError, match=r"no tier nose@M\d or nose"):
        solve_corpus(corpus, tier="nose")
    with pytest.raises(SignfaceError, match="Did you mean brows"):
        solve_corpus(corpus, tier="borws")
    with pytest.raises(SignfaceError, match="Name the tier without @SIGNER: brows"):
        solve_corpus(corpus, tier="brows@M1")
    assert read_reference(next(iter(corpus)).annotation, tier="brows").table["kind"].eq("stable").all()


@pytest.fixture
def lab(folder, tmp_path):
    """A copy of the corpus that a test may spoil, and a vocabulary file of what its brows do."""
    (tmp_path / "brows.txt").write_text("up\ndown\n")
    return Path(shutil.copytree(folder, tmp_path / "lab"))


def annotated(folder, number, rows, vocabulary=None):
    """Give a take of the corpus a tier of brows with other annotations; what was on it is gone."""
    entry = list(read_corpus(folder))[number]
    table = pd.DataFrame(rows, columns=["start_s", "end_s", "label"]).astype({"label": object}).assign(kind="stable")
    vocabulary = vocabulary or Vocabulary("brows", tuple({row[2]: 0 for row in rows}) or ("up",))
    entry.annotation.unlink()
    write_eaf(Segments(table), entry.annotation, signer=entry.signer, tier="brows", vocabulary=vocabulary)
    return entry


def test_a_take_in_which_nothing_happens_is_none_or_passed_over(lab, examples, recwarn):
    quiet = annotated(lab, 1, [])
    found = solve_corpus(read_corpus(lab), tier="brows", vocabulary=BROWS)
    assert [example.take for example in found] == [example.take for example in examples]
    take = found[1].descriptors
    rows = found[1].reference.table[["start_s", "end_s", "label"]].to_numpy().tolist()
    assert rows == [[take.start, take.start + take.duration, "none"]]
    assert not [warning for warning in recwarn if issubclass(warning.category, SignfaceWarning)]
    with pytest.warns(SignfaceWarning, match=f"{quiet.annotation.name}: nothing is annotated.*passed over"):
        sparse = solve_corpus(read_corpus(lab), tier="brows", vocabulary=BROWS, sparse=True)
    assert [example.take for example in sparse] == [e.take for e in examples if e.take != found[1].take]
    assert read_reference(quiet.annotation, quiet.signer, tier="brows").table.empty
    for number in (0, 2, 3):
        annotated(lab, number, [])
    with pytest.warns(SignfaceWarning), pytest.raises(SignfaceError, match="nothing is annotated on the tier brows"):
        solve_corpus(read_corpus(lab), tier="brows", vocabulary=BROWS, sparse=True)


def test_none_may_be_written_where_the_vocabulary_lacks_it(lab):
    annotated(lab, 0, [(0.0, 1.0, "none"), (1.0, 1.4, "up"), (1.4, 1.8, "none")])
    example = solve_corpus(read_corpus(lab), tier="brows", vocabulary=BROWS)[0]
    end = example.descriptors.start + example.descriptors.duration
    assert example.vocabulary == BROWS.with_blank()
    assert example.reference.table[["end_s", "label"]].to_numpy().tolist() == [
        [1.0, "none"],
        [1.4, "up"],
        [end, "none"],
    ]
    with pytest.raises(SignfaceError, match=r"label 'none' .* is not in the vocabulary"):
        solve_corpus(read_corpus(lab), tier="brows", vocabulary=BROWS, sparse=True)


def test_check_looks_at_the_tier_that_is_named(lab, tmp_path, capsys):
    def check(*options):
        status = main(["corpus", "check", str(lab), "--workers", "1", *options])
        shown = capsys.readouterr()
        return status, [line for line in shown.err.splitlines() if "checking" not in line], shown.out

    brows = ("--tier", "brows", "--vocabulary", str(tmp_path / "brows.txt"))
    annotated(lab, 1, [])  # without a tier of affect
    assert check(*brows)[:2] == check("--tier", "brows")[:2] == (0, [])
    status, lines, _ = check()
    assert status == 2
    assert any("another tier: --tier NAME" in line for line in lines)
    annotated(lab, 1, [(0.0, 1.0, "none"), (1.0, 2.0, "raiset")])
    assert check("--tier", "brows")[:2] == (0, [])
    status, lines, _ = check(*brows)
    assert (status, len(lines)) == (2, 1)
    assert "the labels 'raiset' on the tier" in lines[0]
    assert "the labels 'none', 'raiset'" in check(*brows, "--sparse")[1][0]
    assert "Did you mean brows" in check("--tier", "borws")[1][0]


def test_a_slip_of_the_pen_is_noted_where_no_vocabulary_is_named(lab, tmp_path, capsys):
    for number, rows in enumerate(
        [[(0.0, 1.0, "up"), (2.0, 3.0, "down")]] * 3 + [[(0.0, 1.0, "up"), (2.0, 3.0, "dwon")]]
    ):
        annotated(lab, number, rows)
    words = [
        "train",
        str(lab),
        "-o",
        str(tmp_path / "m.skops"),
        "--tier",
        "brows",
        "--classifier",
        "knn1",
        "--no-calibrate",
    ]
    assert main(words) == 0
    shown = capsys.readouterr()
    (note,) = [line for line in shown.err.splitlines() if "note: " in line]
    assert "the label 'dwon' on the tier brows is in this take only" in note
    assert "--vocabulary FILE" in note
    for line in ("  up: 4 segments in 4 takes", "  down: 3 segments in 3 takes", "  dwon: 1 segment in 1 take"):
        assert line in shown.out.splitlines()


def with_kinds(folder, kinds):
    """Give the takes of the corpus other kinds."""
    kinds = iter(kinds)
    write_takes(folder, [dataclasses.replace(entry, kind=next(kinds)) for entry in read_corpus(folder)])


def evaluated(folder, tmp_path, capsys, *options):
    """Status, notes and errors of an evaluation of brows, and what metrics.json says of it."""
    report = tmp_path / "report"
    words = ["evaluate", str(folder), "-o", str(report), "--tier", "brows", "--classifiers", "knn1", *options]
    status = main(words)
    shown = capsys.readouterr().err.splitlines()
    file = report / "metrics.json"
    return status, shown, json.loads(file.read_text())["protocol"] if file.exists() else None


def test_kinds_of_ones_own_are_trained_on_and_tested_in_turns(lab, tmp_path, capsys):
    with_kinds(lab, ["talk", "talk", "story", "story"])
    status, shown, protocol = evaluated(lab, tmp_path, capsys)
    assert status == 0
    assert (protocol["train_kinds"], protocol["test_kinds"]) == (["story", "talk"], ["story", "talk"])
    assert [line for line in shown if "note: no take is of the kind IE, SE, EU" in line and "all there is" in line]
    status, shown, _ = evaluated(lab, tmp_path, capsys, "--train-kinds", "talk")
    assert status == 2
    assert (
        "has no take of the kind EU. Its kinds are story, talk: name some, --train-kinds K --test-kinds K" in shown[-1]
    )


def test_a_signer_of_one_take_leaves_the_other_protocol(lab, tmp_path, capsys):
    takes = list(read_corpus(lab))
    signer = takes[0].signer
    others = [take for take in takes if take.signer != signer]
    write_takes(lab, [dataclasses.replace(take, kind="talk") for take in (takes[0], *others)])
    named = evaluated(lab, tmp_path, capsys, "--protocol", "within")
    assert named[0] == 2
    assert f"the signer {signer} has too few takes to test in turns" in named[1][-1]
    assert "or --protocol across" in named[1][-1]
    assert not [line for line in named[1] if "solving" in line]  # it is known from the manifest
    status, shown, protocol = evaluated(lab, tmp_path, capsys)
    assert (status, protocol["name"]) == (0, "across")
    assert sum("the protocol within is left out" in line for line in shown) == 1


def test_equal_annotations_that_touch_are_one(tmp_path):
    rows = [(0.0, 0.5, "up"), (0.5, 0.9, "up"), (0.9, 1.2, "down"), (1.4, 1.6, "down")]
    table = pd.DataFrame(rows, columns=["start_s", "end_s", "label"]).assign(kind="stable")
    write_eaf(Segments(table), tmp_path / "take.eaf", tier="brows", vocabulary=BROWS)
    reference = read_reference(tmp_path / "take.eaf", tier="brows")
    assert reference.table["end_s"].tolist() == [0.9, 1.2, 1.6]
    assert "merged 4 annotations into 3" in reference.history[-1]


def test_a_model_of_a_tier_writes_that_tier_and_no_affect(examples, tmp_path):
    model = train(examples, quick("knn3"))
    annotation = annotate(examples[1].descriptors, model, channels=True)
    assert annotation.tier == "brows"
    assert "none" in set(annotation.segments.table["label"])
    assert "raised" in str(annotation) or "lowered" in str(annotation)
    file = write_eaf(annotation, tmp_path / "take.eaf", signer="M1")[0]
    assert_valid(file)
    root = read_document(file).getroot()
    names = [tier.get("TIER_ID") for tier in root.iterfind("TIER")]
    assert names[:2] == ["brows@M1", "brows-confidence@M1"]
    assert names.count("brows@M1") == 1  # the channel of that name is not written too
    assert not [name for name in names if name.startswith(("affect", "intensity"))]
    assert read_vocabulary(file, tier="brows@M1") == BROWS
    written = read_tiers(file)["brows@M1"]
    found = annotation.segments.table.query("label != 'none'")
    assert written["label"].tolist() == found["label"].tolist()
    np.testing.assert_allclose(written["start_s"], found["start_s"], atol=0.001)


def test_the_commands_train_and_evaluate_on_a_tier(folder, tmp_path, capsys):
    model = tmp_path / "brows.skops"
    assert not main(["train", str(folder), "-o", str(model), "--tier", "brows", "--classifier", "knn1"])
    card = read_card(model)
    assert (card.tier, card.vocabulary) == ("brows", BROWS.with_blank())
    report = tmp_path / "report"
    kinds = ["--train-kinds", "IE,SE,EU", "--test-kinds", "IE,SE,EU", "--protocol", "across"]
    assert not main(
        ["evaluate", str(folder), "-o", str(report), "--tier", "brows", "--classifiers", "knn1,hmm", *kinds]
    )
    metrics = json.loads((report / "metrics.json").read_text())
    for section in ("manual_segments", "automatic_segments", "frames"):
        scores = metrics["classifiers"]["knn1"][section]
        assert scores["labels"] == ["up", "down", "none"]
        assert scores["chance"] == pytest.approx(1 / 3)
    assert "raised" in (report / "report.html").read_text()
    take = next(iter(read_corpus(folder)))
    assert not main(["annotate", str(take.path), "-o", str(tmp_path / "out.eaf"), "--classifier", str(model)])
    assert [name for name in read_tiers(tmp_path / "out.eaf")] == ["brows"]
    assert load_model(model).card == card


def test_the_script_of_the_documentation_learns_a_tier(folder, tmp_path, monkeypatch, capsys):
    text = (REPOSITORY / "docs" / "segments-and-labels.md").read_text(encoding="utf-8")
    (script,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    shutil.copytree(folder, tmp_path / "corpora" / "lab")
    write_vocabulary(BROWS, tmp_path / "brows.txt")
    monkeypatch.chdir(tmp_path)
    exec(compile(script, "docs/segments-and-labels.md", "exec"), {"__name__": "script"})
    assert 0 <= float(capsys.readouterr().out) <= 1
    assert set(read_tiers(tmp_path / "take.eaf")["brows@Eva"]["label"]) <= {"up", "down"}
