"""The report of an evaluation: every section, with the numbers of metrics.json, and nothing from outside."""

from __future__ import annotations

import dataclasses
import json
import re
from html.parser import HTMLParser

import numpy as np
import pandas as pd
import pytest
from lxml import etree

from signface.descriptors import Descriptors
from signface.evaluation.measure import evaluate
from signface.face.reading import read_face
from signface.label.vocabulary import AFFECT
from signface.report.evaluation.evaluated import Evaluated
from signface.report.evaluation.importance import draw_importance, skin_values
from signface.report.evaluation.report import draw_all, write_files
from signface.report.evaluation.words import headline, limits, training_words
from signface.segmentation.segments import Segments
from tests.fixtures.hand_made import corpus

#: What all of them share takes long to make.
pytestmark = pytest.mark.slow

SECTIONS = (
    "summary", "contents", "done", "accuracy", "segmentation", "confusions", "signers", "comparison", "confidence",
    "curve", "importance", "worst", "reading", "provenance",
)  # fmt: skip


def facts(examples, *, synthetic=True):
    """What `corpus_facts` says of a corpus, for examples that have no files."""
    rows = [{"take": e.take, "signer": e.signer, "kind": e.kind, "recording": "a" * 64, "annotation": "b" * 64}
            for e in examples]  # fmt: skip
    return {
        "name": "hand<made>",
        "synthetic": synthetic,
        "signers": sorted({e.signer for e in examples}),
        "kinds": {kind: sum(e.kind == kind for e in examples) for kind in sorted({e.kind for e in examples})},
        "digest": "c" * 64,
        "faces": [{"name": "default", "sha256": "d" * 64}],
        "layouts": [],
        "solvers": [],
        "versions": {"signface": "0.1.0"},
        "recordings": rows,
    }


def evaluated(examples, *, protocols=("within", "across"), classifiers=("knn1", "knn3"), date=None):
    metrics, found = evaluate(
        examples, protocols=protocols, train_kinds=["IE"], test_kinds=["EU"], classifiers=classifiers
    )
    return Evaluated(metrics, facts(examples), examples, found, read_face("default"), date)


def some(signers=("S1", "S2"), labels=("J", "A", "Su")):
    return [e for e in corpus(signers) if e.take.rpartition("-")[2] in labels]


@pytest.fixture(scope="module")
def both():
    return evaluated(some(), date="22 November 2026")


@pytest.fixture(scope="module")
def folder(both, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    write_files(both, folder)
    return folder


@pytest.fixture(scope="module")
def page(folder):
    return (folder / "report.html").read_text(encoding="utf-8")


class Elements(HTMLParser):
    """Every element with its attributes, and whether tags are closed in order."""

    VOID = ("meta", "link", "img", "br", "hr", "input")

    def __init__(self, page):
        super().__init__()
        self.found, self.open, self.wrong = [], [], []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.wrong.append(tag)


@pytest.mark.slow
def test_every_section_is_there_and_is_reached_from_the_contents(page):
    elements = Elements(page)
    assert elements.wrong == elements.open == []
    names = [attrs["id"] for _, attrs in elements.found if "id" in attrs]
    assert set(SECTIONS) <= set(names)
    assert len(names) == len(set(names))  # pictures do not share identifiers either
    links = {attrs["href"][1:] for tag, attrs in elements.found if tag == "a"}
    assert links <= set(names)
    assert set(SECTIONS) - {"summary", "contents"} <= links


def test_the_numbers_are_those_of_the_metrics(page, folder):
    metrics = json.loads((folder / "metrics.json").read_text())
    assert set(metrics) >= {"segmentation_by_kind", "learning_curve", "importance", "reliability"}
    text = re.sub(r"<[^>]+>", " ", page)
    for part in (metrics, metrics["also"]["across"]):
        for sections in part["classifiers"].values():
            for section in ("manual_segments", "automatic_segments", "frames"):
                for key in ("accuracy", "balanced_accuracy", "macro_f1", "majority"):
                    assert f"{sections[section][key]:.2f}" in text
            low, high = sections["frames"]["accuracy_interval"]
            assert f"{low:.2f} to {high:.2f}" in text
    for methods in metrics["segmentation_by_kind"].values():
        for kinds in methods.values():
            for scores in kinds.values():
                assert f"{scores['mean_iou']:.2f}" in text
                assert f"{scores['edit_score']:.2f}" in text
    results = pd.read_csv(folder / "results.csv")
    row = results[(results.protocol == "across") & (results.classifier == "knn3") & (results.section == "frames")]
    assert row.accuracy.item() == pytest.approx(metrics["also"]["across"]["classifiers"]["knn3"]["frames"]["accuracy"])


def test_the_page_needs_nothing_outside_itself(page):
    for tag, attrs in Elements(page).found:
        assert tag not in ("script", "link", "iframe", "object")
        for key in ("src", "href", "xlink:href", "action"):
            assert attrs.get(key, "#").startswith(("#", "data:")), attrs
    assert not re.search(r"url\((?!['\"]?(#|data:))", page)
    assert "@import" not in page


def test_what_it_is_made_of_is_escaped_and_said(page):
    assert "hand&lt;made&gt;" in page
    assert "hand<made>" not in page
    assert "Synthetic corpus: no person was recorded" in page
    assert "22 November 2026" in page
    assert "c" * 64 in page


def test_pictures_have_descriptions_and_are_files_too(page, folder):
    pictures = [attrs for tag, attrs in Elements(page).found if tag == "svg"]
    assert len(pictures) >= 9
    assert all(attrs["role"] == "img" and len(attrs["aria-label"]) > 20 for attrs in pictures)
    drawn = sorted(path.stem for path in (folder / "figures").glob("*.svg"))
    assert sorted(path.stem for path in (folder / "figures").glob("*.pdf")) == drawn
    assert len(drawn) == len(pictures)
    for path in (folder / "figures").iterdir():
        if path.suffix == ".svg":
            assert etree.parse(str(path)).getroot().tag.endswith("svg")
        else:
            content = path.read_bytes()
            assert content.startswith(b"%PDF")
            assert len(content) > 2000


@pytest.mark.slow
def test_the_same_evaluation_gives_the_same_bytes(both, folder, tmp_path):
    again = evaluated(both.examples, date="22 November 2026")
    write_files(again, tmp_path)
    written = sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    assert written == sorted(path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file())
    assert [path for path in written if (folder / path).read_bytes() != (tmp_path / path).read_bytes()] == []


def test_the_headline_has_the_accuracies_and_what_they_are_held_against(both):
    best = both.metrics["classifiers"][both.best]
    said = " ".join(headline(both.metrics, both.facts, both.vocabulary))
    for value in (best["automatic_segments"]["accuracy"], best["manual_segments"]["majority"]):
        assert f"{100 * value:.0f}\u202f%" in said
    assert "synthetic corpus" in said
    real = facts(both.examples, synthetic=False)
    assert "synthetic" not in " ".join([*headline(both.metrics, real, both.vocabulary), *limits(both.metrics, real)])


@pytest.mark.slow
def test_one_signer_and_a_take_in_which_nothing_is_found(tmp_path):
    one = evaluated(some(("S1",)), protocols=("within",), classifiers=("knn1",))
    found = one.found["within"]["knn1"]
    empty = next(iter(found))
    found[empty] = Segments(found[empty].table.iloc[:0], name=empty)
    short = next(e for e in one.examples if e.take == list(found)[1])
    cut = dataclasses.replace(
        short, descriptors=Descriptors(np.zeros((2, 12)), short.descriptors.names, 100.0)
    )  # too short for an energy curve
    one = dataclasses.replace(one, examples=[cut if e is short else e for e in one.examples])
    page = write_files(one, tmp_path).read_text(encoding="utf-8")
    assert "One signer was tested" in page
    assert "no stable segment found for 3 in the reference" in page
    assert "There is one classifier only" in page
    assert Elements(page).wrong == []


@pytest.mark.slow
def test_a_classifier_without_importance_or_curve_is_named(both):
    metrics = json.loads(json.dumps(both.metrics))
    metrics["importance"], metrics["learning_curve"] = {}, {"within": [], "across": []}
    plain = dataclasses.replace(both, metrics=metrics)
    drawn = draw_all(plain)
    assert drawn["curve"] == drawn["importance"] == []
    metrics["importance"] = {"knn1": both.metrics["importance"]["knn1"]}
    from signface.report.evaluation.page import evaluation_page

    page = evaluation_page(dataclasses.replace(both, metrics=metrics), draw_all(plain) | {"importance": []})
    assert "Not asked of knn3" in page


def test_skin_is_painted_where_the_bases_that_matter_move_it():
    face = read_face("default")
    table = pd.DataFrame(
        {
            "group": ["browDown", "jawOpen"],
            "bases": ["browDownLeft browDownRight", "jawOpen"],
            "accuracy_lost": [0.2, -0.1],
            "low": [0.1, np.nan],
            "high": [0.3, np.nan],
        }
    )
    values = skin_values(face, table)
    moved = np.linalg.norm(face.bases[face.names.index("browDownLeft")], axis=1)
    assert values.max() == 1.0
    assert values[moved.argmax()] > 0.9
    jaw = np.linalg.norm(face.bases[face.names.index("jawOpen")], axis=1)
    assert values[jaw.argmax()] < 0.05  # what matters less than nothing is not painted
    assert len(draw_importance(table, face, title="x").axes) > len(draw_importance(table, None, title="x").axes)


def test_how_it_was_trained_is_said_where_it_is_not_as_in_the_thesis():
    assert training_words({"features": ["weights"], "normalise": "none", "search": False}) == ""
    said = training_words({"features": ["weights", "windows"], "normalise": "signer", "search": True})
    assert said.startswith("Classifiers of segments saw weights and windows;")
    assert "searched within the training takes" in said


def test_labels_are_spelt_out(page):
    for label, name in AFFECT.descriptions.items():
        assert f"{label} {name}" in page
