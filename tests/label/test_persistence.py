"""Classifiers on disk: the same bytes, the same answers, and nothing of a stranger's is run."""

from __future__ import annotations

import io
import json
import subprocess
import sys
import zipfile
from dataclasses import asdict, replace

import numpy as np
import pytest
import skops.io
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.preprocessing import FunctionTransformer

from signface.errors import SignfaceError
from signface.files import shipped
from signface.label.intensity import IntensityClassifier
from signface.label.labelling import find_segments
from signface.label.persistence import CARD, load_model, read_card, save_model
from signface.label.skops_archive import RENAMED_ATTRIBUTES, RENAMED_MODULES, without_padding
from signface.label.vocabulary import AFFECT
from signface.learn.training import train
from signface.settings.choices import NAMES
from tests.fixtures.hand_made import corpus, example
from tests.fixtures.training import quick


@pytest.fixture(scope="module")
def takes():
    return [e for e in corpus(("S1",)) if e.kind == "IE"]


@pytest.fixture(scope="module")
def saved(takes, tmp_path_factory):
    file = tmp_path_factory.mktemp("models") / "toy.skops"
    save_model(train(takes, quick("knn1"), corpus="toy", scores={"of a test": 0.5}), file)
    return file


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_loaded_model_answers_like_the_saved_one(name, takes, tmp_path):
    model = train(takes, quick(name), corpus="toy", scores={"of a test": 0.5})
    file = tmp_path / f"{name}.skops"
    save_model(model, file)
    loaded = load_model(file)
    unseen = example(["N", "J", "A"], seed=4).descriptors.weights
    np.testing.assert_array_equal(loaded.probabilities(unseen), model.probabilities(unseen))
    assert loaded.card == model.card == read_card(file)
    assert loaded.name == name


TRAIN = """
import sys
from signface.label.persistence import save_model
from signface.learn.training import train
from signface.label.vocabulary import AFFECT
from tests.fixtures.hand_made import corpus
from tests.fixtures.training import quick
takes = [e for e in corpus(("S1",)) if e.kind == "IE"]
for name in ("knn3", "svm-linear", "svm-rbf", "forest"):
    save_model(train(takes, quick(name, seed=1)), f"{sys.argv[1]}/{name}.skops")
"""


@pytest.mark.slow
def test_two_trainings_with_one_seed_write_the_same_bytes(tmp_path):
    for folder in ("one", "other"):
        (tmp_path / folder).mkdir()
        subprocess.run([sys.executable, "-c", TRAIN, str(tmp_path / folder)], check=True)
    files = sorted((tmp_path / "one").iterdir())
    assert len(files) == 4
    for file in files:
        assert file.read_bytes() == (tmp_path / "other" / file.name).read_bytes(), file.name


@settings(deadline=None, max_examples=10)
@given(dirt=st.integers(1, 255), count=st.integers(0, 5))
def test_what_memory_holds_between_fields_is_not_written(dirt, count):
    kind = np.dtype({"names": ["a", "b"], "formats": ["<i8", "u1"], "itemsize": 16})
    entries = []
    for filling in (0, dirt):
        nodes = np.full(16 * count, filling, dtype=np.uint8).view(kind)
        nodes["a"], nodes["b"] = np.arange(count), 7
        written = io.BytesIO()
        np.save(written, nodes)
        entries.append(without_padding(written.getvalue()))
    assert entries[0] == entries[1]
    np.testing.assert_array_equal(np.load(io.BytesIO(entries[1]))["a"], np.arange(count))


def test_the_card_is_plain_json_in_the_archive(saved):
    with zipfile.ZipFile(saved) as archive:
        card = json.loads(archive.read(CARD))
    assert card["corpus"] == "toy"
    assert card["scores"] == {"of a test": 0.5}


def test_no_pickle_is_in_the_archive(saved):
    with zipfile.ZipFile(saved) as archive:
        for name in archive.namelist():
            assert name.endswith((".json", ".npy")), name
            if name.endswith(".npy"):
                with archive.open(name) as stream:
                    np.lib.format.read_magic(stream)
                    assert not np.lib.format.read_array_header_1_0(stream)[2].hasobject


@settings(deadline=None, max_examples=30)
@given(share=st.floats(0, 0.999))
def test_a_cut_off_file_is_refused(saved, tmp_path_factory, share):
    data = saved.read_bytes()
    file = tmp_path_factory.mktemp("cut") / "cut.skops"
    file.write_bytes(data[: int(share * len(data))])
    with pytest.raises(SignfaceError, match=r"cut\.skops"):
        load_model(file)


@settings(deadline=None, max_examples=40)
@given(place=st.integers(0, 10**9), value=st.integers(0, 255))
def test_a_damaged_file_is_refused_or_loads_as_the_same_model(saved, tmp_path_factory, place, value):
    data = bytearray(saved.read_bytes())
    data[place % len(data)] = value
    file = tmp_path_factory.mktemp("damaged") / "damaged.skops"
    file.write_bytes(data)
    try:
        loaded = load_model(file)
    except SignfaceError:
        return
    unseen = example(["N", "J"], seed=4).descriptors.weights
    np.testing.assert_array_equal(loaded.probabilities(unseen), load_model(saved).probabilities(unseen))


@pytest.mark.parametrize("content", [b"", b"not a model", b"PK\x03\x04" + bytes(100), bytes(1000)])
def test_a_foreign_file_is_refused(content, tmp_path):
    file = tmp_path / "foreign.skops"
    file.write_bytes(content)
    with pytest.raises(SignfaceError, match="no classifier of signface"):
        load_model(file)


def test_a_card_of_before_vocabularies_is_of_affect(saved, tmp_path):
    today = read_card(saved)
    card = {k: v for k, v in asdict(today).items() if k not in ("vocabulary", "tier", "training", "solve")}
    file = tmp_path / "old.skops"
    with zipfile.ZipFile(saved) as old, zipfile.ZipFile(file, "w") as new:
        for name in old.namelist():
            new.writestr(name, json.dumps(card) if name == CARD else old.read(name))
    assert read_card(file) == load_model(file).card == replace(today, training={}, solve={})
    assert (read_card(file).vocabulary, read_card(file).tier) == (AFFECT, "affect")


def test_a_skops_file_of_another_tool_is_refused(takes, tmp_path):
    file = tmp_path / "other.skops"
    skops.io.dump(train(takes, quick("knn1")).estimator, file)
    with pytest.raises(SignfaceError, match="has no card"):
        load_model(file)


def test_a_file_with_untrusted_types_is_not_loaded(saved, tmp_path):
    file = tmp_path / "malicious.skops"
    skops.io.dump(FunctionTransformer(func=subprocess.getoutput), file)
    with zipfile.ZipFile(saved) as archive, zipfile.ZipFile(file, "a") as forged:
        forged.writestr(CARD, archive.read(CARD))
    with pytest.raises(SignfaceError, match="holds types that a classifier of signface does not"):
        load_model(file)


def test_a_card_of_another_model_is_noticed(saved, takes, tmp_path):
    file = tmp_path / "swapped.skops"
    card = asdict(read_card(saved))
    with zipfile.ZipFile(saved) as archive, zipfile.ZipFile(file, "w") as forged:
        for name in archive.namelist():
            content = json.dumps({**card, "labels": ["A", "B"]}).encode() if name == CARD else archive.read(name)
            forged.writestr(name, content)
    with pytest.raises(SignfaceError, match="do not belong together"):
        load_model(file)


def test_other_endings_and_missing_files_are_refused(saved, tmp_path):
    with pytest.raises(SignfaceError, match=r"\.skops"):
        save_model(load_model(saved), tmp_path / "model.pkl")
    with pytest.raises(SignfaceError, match="no such classifier"):
        load_model(tmp_path / "absent.skops")
    assert list(tmp_path.iterdir()) == []


def test_the_shipped_classifier_fits_the_default_face_and_says_what_it_has_not_met(face):
    file = shipped("classifiers", ".skops")["default"]
    card = load_model("default").card
    assert set(card.bases) == set(face.names)
    assert card.labels == tuple(sorted(AFFECT.values))
    assert file.stat().st_size < 3e6
    text = file.with_suffix(".md").read_text(encoding="utf-8")
    assert "It has met no real signer." in text
    for score in card.scores.values():
        assert f"{score:.2f}" in text


def as_before(model, file):
    """Write a model as version 0.1 did: all of it by skops, under the names of then."""
    both = {"labels": model.estimator, "intensity": model.intensity}
    written = io.BytesIO(skops.io.dumps(model.estimator if model.intensity is None else both))
    then = {name: old for table in (RENAMED_MODULES, RENAMED_ATTRIBUTES) for old, name in table.items()}
    with zipfile.ZipFile(written) as archive, zipfile.ZipFile(file, "w") as old:
        for name in archive.namelist():
            content = archive.read(name)
            if name == "schema.json":
                text = content.decode()
                for today, former in then.items():
                    text = text.replace(json.dumps(today), json.dumps(former))
                content = text.encode()
            old.writestr(name, content)
        old.writestr(CARD, json.dumps(asdict(model.card)))


@pytest.mark.slow
@pytest.mark.parametrize("classifier", ["knn1", "crf", "net-hsmm"])
def test_a_file_of_an_older_version_answers_like_todays(classifier, tmp_path):
    takes = corpus(("S1", "S2"))
    intensity = IntensityClassifier()
    intensity.bases_, intensity.levels_ = tuple(takes[0].descriptors.names), np.array([1, 2, 3])
    intensity.lines_ = np.array([[2.0, -1.0], [2.0, -3.0]])
    model = replace(train(takes, quick(classifier)), intensity=intensity)
    as_before(model, tmp_path / "old.skops")
    save_model(model, tmp_path / "today.skops")
    old, today = load_model(tmp_path / "old.skops"), load_model(tmp_path / "today.skops")
    for take in takes[:3]:
        tables = [find_segments(take.descriptors, loaded).table for loaded in (old, today, model)]
        assert tables[0].equals(tables[2])
        assert tables[1].equals(tables[2])
    save_model(old, tmp_path / "again.skops")
    assert (tmp_path / "again.skops").read_bytes() == (tmp_path / "today.skops").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize(("name", "classifier"), [("default", "gru"), ("thesis-forest", "forest")])
def test_the_shipped_classifiers_are_written_as_save_model_writes_them(name, classifier, tmp_path):
    file = shipped("classifiers", ".skops")[name]
    model = load_model(name)
    assert model.card.classifier == classifier
    with zipfile.ZipFile(file) as archive:
        assert ("schema.json" in archive.namelist()) == (name != "default")
    save_model(model, tmp_path / file.name)
    with zipfile.ZipFile(file) as one, zipfile.ZipFile(tmp_path / file.name) as other:
        assert {n: one.read(n) for n in one.namelist() if n.endswith(".npy")} == {
            n: other.read(n) for n in other.namelist() if n.endswith(".npy")
        }
