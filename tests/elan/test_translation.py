"""Annotators' own tiers and values read as ours, by the mapping that writes ours as theirs."""

import pandas as pd
import pytest
from pympi.Elan import Eaf

from signface.channels.rules import closed_vocabularies, read_channels
from signface.cli.main import main
from signface.elan.mapping import ChannelRule, read_mapping
from signface.elan.mapping_draft import write_mapping
from signface.elan.reference import read_corrections, read_reference, reference_vocabulary
from signface.elan.translation import tier_meanings, translated
from signface.elan.writing import write_eaf
from signface.errors import SignfaceError
from signface.label.vocabulary import AFFECT
from signface.segmentation.segments import Segments

ROWS = [(200, 900, "br_raise"), (1500, 2100, "br_low"), (2400, 2900, "br_raise")]


def annotated(path, tier, rows=ROWS):
    eaf = Eaf()
    eaf.remove_tier("default")
    for name, these in ({tier: rows} if isinstance(tier, str) else tier).items():
        eaf.add_tier(name)
        for start, end, value in these:
            eaf.add_annotation(name, start, end, value)
    eaf.to_file(str(path))
    return path


@pytest.fixture
def mapping(tmp_path):
    file = tmp_path / "lab.toml"
    file.write_text(
        '[brows]\ntier = "Brauen {signer}"\n[brows.labels]\nraised = "br_raise"\nlowered = "br_low"\n', "utf-8"
    )
    return file


def test_a_mapping_is_drafted_from_what_annotators_wrote(tmp_path):
    folder = tmp_path / "annotated"
    folder.mkdir()
    annotated(folder / "a.eaf", {"brows@K01": ROWS, "head@K01": [(0, 500, "chin_up"), (600, 900, "turn_forward")]})
    annotated(folder / "b.eaf", {"brows@K02": ROWS[:1], "CNM_tipo": [(0, 500, "i.parcial"), (600, 900, "n.no")]})
    file = write_mapping(folder, tmp_path / "m.toml", channels=closed_vocabularies(read_channels()))
    rules = read_mapping(file)
    assert rules["brows"].tier == "brows@{signer}"
    assert (rules["brows"].value("raised"), rules["brows"].value("lowered")) == ("br_raise", "br_low")
    assert (rules["head"].value("chin up"), rules["head"].value("forward")) == ("chin_up", "turn_forward")
    assert rules["head"].value("nod") is None
    assert rules["clause"].tier == "CNM_tipo"
    assert (rules["clause"].value("wh"), rules["clause"].value("negation")) == ("i.parcial", "n.no")
    assert "br_raise (3)" in file.read_text("utf-8")  # how often, over all files


def test_an_annotation_is_read_with_our_labels_and_back(tmp_path, mapping):
    file = annotated(tmp_path / "a.eaf", "Brauen K01")
    found = read_reference(file, "K01", tier="brows", mapping=mapping).table
    assert found["label"].tolist() == ["raised", "lowered", "raised"]
    rule = read_mapping(mapping)["brows"]
    assert [rule.value(label) for label in found["label"]] == [value for _, _, value in ROWS]
    assert found["start_s"].tolist() == [0.2, 1.5, 2.4]
    assert reference_vocabulary([(file, "K01")], "brows", mapping=mapping).values == ("lowered", "raised")
    with pytest.raises(SignfaceError, match="no tier brows"):
        read_reference(file, "K01", tier="brows")


def test_the_signer_of_a_tier_is_known_by_its_name(tmp_path, mapping):
    file = annotated(tmp_path / "a.eaf", {"Brauen K01": ROWS, "Brauen K02": ROWS[:1]})
    assert len(read_reference(file, "K02", tier="brows", mapping=mapping).table) == 1
    assert len(read_reference(file, "K01", tier="brows", mapping=mapping).table) == 3


def test_annotators_and_the_machine_agree_through_a_mapping(tmp_path, mapping, capsys):
    ours = [(start, end, {"br_raise": "raised", "br_low": "lowered"}[value]) for start, end, value in ROWS]
    person = annotated(tmp_path / "person.eaf", "Brauen K01")
    machine = annotated(tmp_path / "machine.eaf", "brows@K01", ours)
    assert main(["elan", "agree", str(person), str(machine), "--mapping", str(mapping)]) == 0
    said = capsys.readouterr().out
    assert "brows@K01" in said
    assert "1.00" in said
    assert main(["elan", "agree", str(person), str(machine)]) == 2  # no tier in common


def test_a_value_of_two_labels_can_be_written_and_not_read():
    lossy = {"brows": ChannelRule("b", {"raised": "moved", "lowered": "moved"})}
    with pytest.raises(SignfaceError, match="raised and lowered of brows"):
        tier_meanings(lossy, ["b"])


def test_a_mapping_that_names_no_tier_is_no_mapping_of_these_files():
    table = pd.DataFrame({"start_s": [0.0], "end_s": [1.0], "label": ["x"]})
    with pytest.raises(SignfaceError, match="no file has a tier") as caught:
        translated({"eva": {"Kopf": table}}, {"brows": ChannelRule("Brauen", {})})
    assert "Kopf" in str(caught.value)


def test_an_empty_tier_stays_a_tier_of_words():
    table = pd.DataFrame({"start_s": [], "end_s": [], "label": pd.Series([], dtype=object)})
    found = translated({"eva": {"Brauen": table}}, {"brows": ChannelRule("Brauen", {"raised": "up"})})["eva"]["brows"]
    assert found["label"].str.strip().tolist() == []


def test_tiers_that_become_one_are_refused():
    table = pd.DataFrame({"start_s": [0.0], "end_s": [1.0], "label": ["x"]})
    with pytest.raises(SignfaceError, match="two tiers brows@K01"):
        translated({"eva": {"Brauen@K01": table, "brows@K01": table}}, {"brows": ChannelRule("Brauen@{signer}", {})})


@pytest.mark.parametrize("tier", ["Brauen", "Brauen@{signer}"])
def test_a_tier_is_named_with_or_without_its_signer(tier):
    assert tier_meanings({"brows": ChannelRule(tier, {"raised": "up"})}, ["Brauen@K01", "Kopf@K01", "Braue@K01"]) == {
        "Brauen@K01": ("brows", "K01", {"up": "raised"})
    }


def test_an_empty_folder_has_nothing_to_map(tmp_path, capsys):
    assert main(["elan", "map", str(tmp_path), "-o", str(tmp_path / "m.toml")]) == 2
    assert "holds no .eaf" in capsys.readouterr().err
    assert not (tmp_path / "m.toml").exists()


def test_what_a_model_did_not_know_is_no_annotation_and_can_be_corrected(tmp_path):
    table = pd.DataFrame(
        [(0.0, 0.6, "stable", "N"), (0.6, 0.8, "transition", "Nunknown"), (0.8, 2.0, "stable", "unknown")],
        columns=["start_s", "end_s", "kind", "label"],
    )
    file = tmp_path / "a.eaf"
    write_eaf(Segments(table, name="a"), file, signer="S1", vocabulary=AFFECT.including("unknown"))
    assert read_reference(file, "S1").table["label"].tolist() == ["N"]
    file.write_text(file.read_text("utf-8").replace("ANNOTATION_VALUE>unknown<", "ANNOTATION_VALUE>J<"), "utf-8")
    file.write_text(file.read_text("utf-8").replace("ANNOTATION_VALUE>Nunknown<", "ANNOTATION_VALUE>NJ<"), "utf-8")
    assert read_reference(file, "S1").table["label"].tolist() == ["N", "NJ", "J"]
    before, after = read_corrections(file, "S1")
    assert before["label"].tolist() == ["N", "Nunknown", "unknown"]
    assert after["label"].tolist() == ["N", "NJ", "J"]
