"""`signface elan`: what an annotator types, and what ELAN itself runs."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from lxml import etree

from signface.cli.main import main
from signface.descriptors import Descriptors
from signface.descriptors_files import write_weights
from signface.elan.document import read_document, tier_rows
from signface.elan.mapping import ChannelRule, read_mapping
from signface.elan.recogniser import extensions_folder, read_parameters, write_extension, write_tier_file
from signface.elan.reference import read_corrections, read_reference
from signface.elan.tiers import label_tier
from signface.elan.writing import write_eaf
from signface.errors import SignfaceError
from signface.evaluation.corrections import changes, summarise_changes
from signface.label.persistence import load_model, save_model
from signface.label.vocabulary import Vocabulary
from signface.learn.training import Example, train
from signface.segmentation.segments import Segments
from signface.settings.eaf import EafOptions
from tests.elan.test_templates import LAB, MAPPING
from tests.fixtures.elan_files import assert_valid, labelled, mapped
from tests.fixtures.training import quick

BASES = ("mouthSmileLeft", "mouthSmileRight", "browDownLeft", "browDownRight", "jawOpen")
FACES = {"N": (0, 0, 0, 0, 0), "J": (0.9, 0.8, 0, 0, 0.2), "A": (0, 0, 0.9, 0.9, 0)}
RATE = 60.0


def acted(labels: str, *, seed: int = 0, hold: float = 1.0, change: float = 0.3) -> tuple[Descriptors, Segments]:
    """A face that holds each expression for a second and changes in a third of one, with its true annotation."""
    rng = np.random.default_rng(seed)
    words = labels.split()
    weights, rows, now = [], [], 0.0
    for number, word in enumerate(words):
        weights.append(np.tile(FACES[word], (round(hold * RATE), 1)))
        rows.append((now, now + hold, "stable", word))
        now += hold
        if number + 1 < len(words):
            ease = (1 - np.cos(np.linspace(0, np.pi, round(change * RATE))))[:, None] / 2
            weights.append((1 - ease) * FACES[word] + ease * FACES[words[number + 1]])
            rows.append((now, now + change, "transition", word + words[number + 1]))
            now += change
    frames = np.concatenate(weights)
    descriptors = Descriptors(frames + rng.normal(0, 0.02, frames.shape), BASES, RATE, name="take")
    return descriptors, Segments(pd.DataFrame(rows, columns=["start_s", "end_s", "kind", "label"]), name="take")


def correct(path: Path, old: str, new: str) -> None:
    text = path.read_text("utf-8")
    wrong = f"<ANNOTATION_VALUE>{old}</ANNOTATION_VALUE>"
    assert wrong in text
    path.write_text(text.replace(wrong, f"<ANNOTATION_VALUE>{new}</ANNOTATION_VALUE>", 1), "utf-8")


@pytest.fixture
def corpus(tmp_path) -> Path:
    """Three takes whose annotations the machine wrote with joy called anger, and an annotator put right."""
    folder = tmp_path / "corpus"
    for number in range(3):
        descriptors, truth = acted("N J N A N", seed=number)
        write_weights(descriptors, folder / f"take{number}.csv")
        wrong = truth.table.assign(label=truth.table["label"].str.replace("J", "A"))
        write_eaf(Segments(wrong, name="take"), folder / f"take{number}.eaf", signer="S1")
        for old, new in (("NA", "NJ"), ("A", "J"), ("AN", "JN")):
            correct(folder / f"take{number}.eaf", old, new)
    rows = "".join(f"take{number}.csv,S1,EU,take{number}.eaf\n" for number in range(3))
    (folder / "takes.csv").write_text("take,signer,kind,annotation\n" + rows)
    return folder


@pytest.fixture
def machine(tmp_path) -> Path:
    """A classifier that has learnt joy as anger."""
    descriptors, truth = acted("N J N A N", seed=9)
    wrong = truth.table.assign(label=truth.table["label"].str.replace("J", "A"))
    model = train([Example("old", "S9", "IE", descriptors, Segments(wrong))], quick("knn1"), name="machine")
    save_model(model, tmp_path / "machine.skops")
    return tmp_path / "machine.skops"


def test_learning_shows_the_corrections_and_does_better_on_takes_held_out(corpus, machine, tmp_path, capsys):
    out = tmp_path / "mine.skops"
    assert main(["elan", "learn", str(corpus), "-o", str(out), "--before", str(machine), "--classifier", "knn1"]) == 0
    said = capsys.readouterr().out
    assert "9 of 27 annotations were changed" in said
    assert "renamed A -> J: 3" in said
    assert "before (machine): 0.80 right" in said
    assert "after: 1.00 right (3 better, 0 worse)" in said
    assert set(load_model(out).card.labels) == {"N", "J", "A"}


def test_learning_says_so_when_it_makes_things_worse(tmp_path, capsys):
    """Takes of which none shows the other's expression teach nothing about each other."""
    folder = tmp_path / "two"
    for name, words in (("joy", "N J N"), ("anger", "N A N")):
        descriptors, truth = acted(words)
        write_weights(descriptors, folder / f"{name}.csv")
        write_eaf(truth, folder / f"{name}.eaf", signer="S1")
    rows = "".join(f"{name}.csv,S1,EU,{name}.eaf\n" for name in ("joy", "anger"))
    (folder / "takes.csv").write_text("take,signer,kind,annotation\n" + rows)
    descriptors, truth = acted("N J N A N", seed=9)
    good = train([Example("old", "S9", "IE", descriptors, truth)], quick("knn1"), name="good")
    save_model(good, tmp_path / "good.skops")
    arguments = ["--before", str(tmp_path / "good.skops"), "--classifier", "knn1"]
    assert main(["elan", "learn", str(folder), "-o", str(tmp_path / "mine.skops"), *arguments]) == 0
    assert "the new classifier does worse: stay with good" in capsys.readouterr().out


def test_learning_without_a_model_to_write_only_shows_the_corrections(corpus, capsys):
    assert main(["elan", "learn", str(corpus)]) == 0
    assert "9 of 27" in capsys.readouterr().out


def test_annotations_of_people_are_learnt_from_as_they_are(corpus, capsys):
    for file in corpus.glob("*.eaf"):
        root = read_document(file)
        for element in root.findall("HEADER/PROPERTY"):
            element.getparent().remove(element)
        root.write(file)
    assert main(["elan", "learn", str(corpus)]) == 0
    assert "3 of 3 annotations were not written by signface" in capsys.readouterr().out


def test_a_moved_boundary_an_added_and_a_removed_annotation_are_told_apart():
    before = pd.DataFrame([(0, 1, "N"), (1, 2, "J"), (3, 4, "A")], columns=["start_s", "end_s", "label"])
    after = pd.DataFrame([(0, 1.1, "N"), (1.1, 2, "Su"), (5, 6, "D")], columns=["start_s", "end_s", "label"])
    table = changes(before, after)
    assert list(table["change"]) == ["moved", "moved and renamed", "removed", "added"]
    said = "\n".join(summarise_changes(table, 3))
    assert "renamed J -> Su: 1" in said
    assert "boundaries moved: 2, by 100 ms in the median" in said
    assert "added: 1" in said
    assert "removed: 1" in said


def test_corrections_on_a_labs_own_tier_come_back_as_our_labels(tmp_path):
    path, rules = tmp_path / "lab.eaf", tmp_path / "mapping.toml"
    path.write_text(LAB, "utf-8")
    rules.write_text(MAPPING, "utf-8")
    write_eaf(labelled(), into=path, signer="S1", options=EafOptions(mapping=str(rules)))
    assert list(read_reference(path, "S1").table["label"]) == ["N", "J", "N"]
    correct(path, "Freude", "neutral")
    before, after = read_corrections(path, "S1")
    assert list(before["label"]) == ["N", "J", "N"]
    assert list(after["label"]) == ["N", "N", "N"]


def test_a_mapping_of_two_labels_to_one_value_cannot_be_undone(tmp_path):
    path = tmp_path / "lab.eaf"
    path.write_text(LAB, "utf-8")
    rules = {"affect": ChannelRule("Emotion_S1", {"N": "neutral", "J": "Freude", "A": "Freude"}, "")}
    write_eaf(labelled("N NJ J JA A"), into=path, signer="S1", options=mapped(tmp_path, rules))
    with pytest.raises(SignfaceError, match="label 'Freude' on tier Emotion_S1"):
        read_reference(path, "S1")


@pytest.mark.slow
def test_agreement_is_printed_and_written(tmp_path, capsys):
    first, second = tmp_path / "eva.eaf", tmp_path / "tom.eaf"
    write_eaf(labelled("N NJ J JN N"), first, signer="S1")
    write_eaf(labelled("N NJ J JN N"), second, signer="S1")
    correct(second, "J", "Su")
    out = tmp_path / "agreement"
    assert main(["elan", "agree", str(first), str(second), "-o", str(out)]) == 0
    said = capsys.readouterr().out
    assert "eva / tom" in said
    table = pd.read_csv(out / "agreement.csv")
    assert table["agreement"][0] == pytest.approx(0.8)
    assert 0 < table["cohen_kappa"][0] < 1
    counts = pd.read_csv(out / "confusion_affect@S1_annotations.csv", index_col=0)
    assert counts.loc["J", "Su"] == 2
    assert counts.loc["N", "N"] == 4
    assert (out / "agreement_affect@S1.png").stat().st_size > 5000


def test_agreement_wants_two_files_with_a_tier_in_common(tmp_path, capsys):
    first, second = tmp_path / "a.eaf", tmp_path / "b.eaf"
    write_eaf(labelled(), first, signer="S1")
    write_eaf(labelled(), second, signer="S2")
    assert main(["elan", "agree", str(first)]) == 2
    assert main(["elan", "agree", str(first), str(second)]) == 2
    assert "no filled tier in common" in capsys.readouterr().err


def test_what_annotators_call_otherwise_is_compared_as_the_same(tmp_path, capsys):
    first, second = tmp_path / "a.eaf", tmp_path / "b.eaf"
    write_eaf(labelled(), first, signer="S1")
    words = Vocabulary("words", ("calm", "glad"))
    there = labelled("N J")
    named = Segments(there.table.assign(label=["calm", "glad"]), name=there.name)
    write_eaf(named, second, signer="K2", tier="mood", vocabulary=words)
    same = ["--same", "mood@K2=affect@S1", "--same", "calm=N,glad=J"]
    assert main(["elan", "agree", str(first), str(second), *same]) == 0
    assert "affect@S1" in capsys.readouterr().out
    assert main(["elan", "agree", str(first), str(second), "--same", "mood=affect@S1"]) == 2
    assert "no file has a tier or a label mood" in capsys.readouterr().err


def test_check_names_every_problem_and_changes_nothing(tmp_path, capsys):
    good, bad = tmp_path / "good.eaf", tmp_path / "bad.eaf"
    write_eaf(labelled(), good, signer="S1")
    bad.write_text(LAB.replace('ANNOTATION_REF="a5"', 'ANNOTATION_REF="a50"').replace('"a6"', '"a5"'), "utf-8")
    before = bad.read_bytes()
    assert main(["elan", "check", str(good)]) == 0
    assert "EAF 3.0, 2 tiers, 10 annotations, no problem" in capsys.readouterr().out
    assert main(["elan", "check", str(good), str(bad)]) == 2
    said = capsys.readouterr().out
    assert "the identifier a5 is used 2 times" in said
    assert "refers to a50" in said
    assert bad.read_bytes() == before
    assert main(["elan", "check", str(good), "--duration", "2"]) == 2
    assert "ends at 2500 ms, the media at 2000 ms" in capsys.readouterr().out


def test_a_mapping_is_written_once_and_can_be_used(tmp_path, capsys):
    lab, out = tmp_path / "lab.etf", tmp_path / "mapping.toml"
    lab.write_text(LAB, "utf-8")
    assert main(["elan", "map", str(lab), "-o", str(out)]) == 0
    assert read_mapping(out)["affect"].tier == "Emotion_{signer}"
    assert main(["elan", "map", str(lab), "-o", str(out)]) == 2  # an edited mapping is not lost
    assert "exists" in capsys.readouterr().err


def play_elan(folder: Path, parameters: dict[str, str]) -> tuple[list[str], int]:
    """Do what ELAN's LocalRecognizer does: start the program of the CMDI in its folder, in a bare environment."""
    root = etree.parse(folder / "recognizer.cmdi").getroot()
    recogniser = root.find(".//{*}recognizer")
    assert recogniser.get("recognizerType") == "local"
    command = recogniser.get("runMac" if sys.platform == "darwin" else "runLinux").split()
    known = {element.text for element in root.iterfind(".//{*}RECOGNIZER/*")}
    assert set(parameters) <= known
    shown = [element for element in root.iterfind(".//{*}RECOGNIZER/*") if element.get("info") is not None]
    assert {"take", "face", "tiers"} <= {element.text for element in shown}  # ELAN drops what has no info
    xml = etree.Element("PARAM")
    etree.SubElement(xml, "param", name="InvocationContext").text = "signface 2026-01-01 12:00:00+0100"
    for name, value in parameters.items():
        etree.SubElement(xml, "param", name=name).text = value
    sent = etree.tostring(xml, xml_declaration=True, encoding="UTF-8")
    done = subprocess.run(
        command, cwd=folder, input=sent, env={}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False
    )
    return done.stdout.decode("utf-8").splitlines(), done.returncode


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="ELAN runs the .bat there")
def test_elan_runs_the_recogniser_in_a_bare_environment(tmp_path, machine):
    take = tmp_path / "Aufnahme ü 1.csv"
    write_weights(acted("N J N A N")[0], take)
    elan = tmp_path / "ELAN 7"
    (elan / "lib/app").mkdir(parents=True)
    assert main(["elan", "install-recogniser", "--elan", str(elan)]) == 0
    folder = elan / "lib/app/extensions/signface"
    tiers = tmp_path / "out.xml"
    parameters = {"take": str(take), "classifier": str(machine), "signer": "S 1", "tiers": str(tiers)}
    lines, status = play_elan(folder, parameters)
    assert status == 0
    assert lines[-1] == "RESULT: DONE."
    shares = [float(line.split()[1]) for line in lines if line.startswith("PROGRESS:")]
    assert shares == sorted(shares)
    assert len(shares) >= 3

    assert main(["annotate", str(take), "-o", str(tmp_path / "out.eaf"), "--classifier", str(machine)]) == 0
    expected = tier_rows(read_document(tmp_path / "out.eaf").getroot())
    root = etree.parse(tiers).getroot()
    assert root.get("columns") == "affect@S_1 affect-confidence@S_1"
    # as ELAN's XmlTierIO reads them: 32-bit seconds, cut to milliseconds
    found = [
        (*(int(np.float32(1000) * np.float32(span.get(key))) for key in ("start", "end")), span[0].text)
        for span in root.iterfind("span")
    ]
    assert found == expected["affect"]
    assert [span[1].text for span in root.iterfind("span")] == [row[2] for row in expected["affect-confidence"]]


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="ELAN runs the .bat there")
def test_a_failure_is_told_to_elan_in_its_own_words(tmp_path):
    write_extension(tmp_path / "signface")
    lines, status = play_elan(tmp_path / "signface", {"take": str(tmp_path / "none.c3d"), "tiers": "x.xml"})
    assert status != 0
    assert lines[-1] == "RESULT: FAILED."
    assert any("none.c3d: no such file" in line for line in lines)
    lines, _ = play_elan(tmp_path / "signface", {"tiers": "x.xml"})
    assert any("no recording was chosen" in line for line in lines)
    sent = SENT.replace("TAKE", "/tmp/Mü/none.c3d").replace("</PARAM>", '<param name="tiers">x.xml</param></PARAM>')
    folder, pipe = tmp_path / "signface", subprocess.PIPE
    done = subprocess.run(["./signface.sh"], cwd=folder, input=sent.encode("cp1252"), env={}, stdout=pipe, check=False)
    assert "/tmp/Mü/none.c3d: no such file" in done.stdout.decode("cp1252")


def test_the_recogniser_goes_where_elan_looks(tmp_path):
    for place in ("lib/app", "app", "Contents/app"):
        elan = tmp_path / place.replace("/", "_")
        (elan / place).mkdir(parents=True)
        assert extensions_folder(elan) == elan / place / "extensions"
    with pytest.raises(SignfaceError, match="holds no ELAN"):
        extensions_folder(tmp_path / "nowhere")


def test_parameters_left_empty_are_not_given():
    xml = b'<?xml version="1.0"?>\n<PARAM><param name="a">1 &lt; 2</param><param name="b"></param></PARAM>\n'
    assert read_parameters(xml) == ({"a": "1 < 2"}, "utf-8")
    with pytest.raises(SignfaceError, match="run by ELAN"):
        read_parameters(b"hello")


SENT = """<?xml version="1.0" encoding="UTF-8"?>\r
<PARAM xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="file:avatech-call.xsd">\r
<param name="take">TAKE</param>\r
</PARAM>\r
"""


@pytest.mark.parametrize(
    ("platform", "encoding", "take"),
    [
        ("UTF-8", "utf-8", "C:\\Users\\Jürgen\\李.c3d"),
        ("UTF-8", "cp1252", "C:\\Users\\Jürgen\\prise à côté.c3d"),
        ("cp1252", "cp1252", "/tmp/Mü/prise €.c3d"),
        ("cp1251", "cp1251", "C:\\Пётр\\дубль.c3d"),
        ("cp932", "cp932", "C:\\撮影\\表情.c3d"),
    ],
)
def test_parameters_come_in_the_code_page_of_the_platform(monkeypatch, platform, encoding, take):
    monkeypatch.setattr("locale.getencoding", lambda: platform)
    parameters, found = read_parameters(SENT.replace("TAKE", take).encode(encoding))
    assert (parameters, found) == ({"take": take}, encoding)


def test_an_ampersand_in_a_path_is_read_either_way():
    for written in ("Tom & Eva", "Tom &amp; Eva"):
        assert read_parameters(SENT.replace("TAKE", written).encode())[0] == {"take": "Tom & Eva"}


def test_the_windows_script_finds_a_python_anywhere(tmp_path):
    write_extension(tmp_path, python="C:\\Users\\Jürgen 100%\\python.exe")
    lines = (tmp_path / "signface.bat").read_bytes().decode("utf-8").split("\r\n")
    assert lines.index("chcp 65001 >nul") < 2
    assert '"C:\\Users\\Jürgen 100%%\\python.exe" -m signface.cli.main elan recognise' in lines


def run_recogniser(monkeypatch, parameters: dict[str, str]) -> int:
    xml = etree.Element("PARAM")
    for name, value in parameters.items():
        etree.SubElement(xml, "param", name=name).text = value
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(etree.tostring(xml))))
    return main(["elan", "recognise"])


def test_a_run_that_fails_leaves_no_older_result(tmp_path, monkeypatch, capsys):
    tiers, other = tmp_path / "tiers.xml", tmp_path / "lab.eaf"
    write_tier_file(tiers, label_tier(labelled(), "S1"))
    other.write_text(LAB, "utf-8")
    assert run_recogniser(monkeypatch, {"take": str(tmp_path / "none.c3d"), "tiers": str(tiers)}) == 2
    assert not tiers.exists()
    assert run_recogniser(monkeypatch, {"take": str(tmp_path / "none.c3d"), "tiers": str(other)}) == 2
    assert other.read_text("utf-8") == LAB
    assert "lab.eaf: holds something else than tiers" in capsys.readouterr().out


@pytest.mark.parametrize("step", [0.5, 0.123, 0.0333, 7.777])
def test_elans_short_numbers_lose_no_millisecond(tmp_path, step):
    tier = label_tier(labelled(" ".join(["N", "NJ", "J", "JN"] * 50), step=step), "S1")
    write_tier_file(tmp_path / "tiers.xml", tier)
    spans = etree.parse(tmp_path / "tiers.xml").getroot().findall("span")
    starts = [int(np.float32(1000) * np.float32(span.get("start"))) for span in spans]
    assert starts == tier.start_ms.tolist()


def test_every_file_of_this_module_is_valid(corpus):
    for file in corpus.glob("*.eaf"):
        assert_valid(file)


def test_a_take_held_out_is_not_learnt_from_by_another_road(corpus, machine, tmp_path, capsys):
    arguments = ["--before", str(machine), "--classifier", "knn1", "--with", str(corpus)]
    assert main(["elan", "learn", str(corpus), "-o", str(tmp_path / "mine.skops"), *arguments]) == 0
    assert "3 takes of the same name in --with are left out" in capsys.readouterr().out


@pytest.mark.parametrize("option", ["--into", "--template"])
def test_what_the_result_goes_into_is_looked_at_before_anything_is_solved(tmp_path, capsys, option):
    take = ["annotate", str(tmp_path / "none.c3d")]
    assert main([*take, option, str(tmp_path / "lab.eaf")]) == 2
    assert "lab.eaf: no such file" in capsys.readouterr().err
    (tmp_path / "lab.eaf").write_text("<x/>")
    assert main([*take, option, str(tmp_path / "lab.eaf")]) == 2
    assert "lab.eaf: is XML but no EAF" in capsys.readouterr().err
