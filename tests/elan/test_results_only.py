"""Who writes does not compute: elan knows of results and of nothing that finds them, and every door writes the same."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import signface as sf
import signface.elan
from signface.cli.main import main

ROOM = Path(signface.elan.__file__).parent
FINDERS = ("channels.rules", "label.labelling", "segmentation.energy", "segmentation.cutting", "segmentation.curves",
           "solver", "annotation")  # fmt: skip


@pytest.mark.parametrize("module", sorted(ROOM.glob("*.py")), ids=lambda module: module.stem)
def test_elan_imports_nothing_that_finds(module):
    imported = set()
    for node in ast.walk(ast.parse(module.read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            imported |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
    assert not [name for name in imported if name.removeprefix("signface.").startswith(FINDERS)]


@pytest.fixture(scope="module")
def annotation(mini):
    take = sf.read_take(mini.takes[0].path)
    return sf.annotate(take, sf.load_model("default"), signer=sf.Signer("M1"), channels=True)


@pytest.mark.slow
def test_two_annotations_of_one_take_are_equal_and_name_their_solve(annotation, mini):
    again = sf.annotate(
        sf.read_take(mini.takes[0].path), sf.load_model("default"), signer=sf.Signer("M1"), channels=True
    )
    assert again == annotation
    assert hash(again) == hash(annotation)
    assert again != sf.annotate(annotation.descriptors, sf.load_model("default"))
    assert again.settings == sf.SolveSettings()


def same_files(first: Path, second: Path) -> None:
    names = sorted(file.name for file in first.iterdir())
    assert names == sorted(file.name for file in second.iterdir())
    for name in names:
        texts = [(folder / name).read_text("utf-8").replace(str(folder), "") for folder in (first, second)]
        texts = [[line for line in text.splitlines() if "DATE=" not in line and "date=" not in line] for text in texts]
        texts = [[line for line in text if "urn:nl-mpi-tools-elan-eaf" not in line] for text in texts]
        assert texts[0] == texts[1], name


@pytest.mark.slow
@pytest.mark.parametrize("door", ["new", "into"])
def test_annotate_and_write_equals_the_command(door, annotation, mini, tmp_path):
    for folder in ("script", "command"):
        (tmp_path / folder).mkdir()
    script, command = tmp_path / "script" / "take.eaf", tmp_path / "command" / "take.eaf"
    if door == "into":
        for file in (script, command):
            sf.write_eaf(annotation.segments, file, signer="other", date="2026-01-01")
    target = {"path": script} if door == "new" else {"into": script}
    sf.write_eaf(annotation, **target, options=sf.EafOptions(doubtful=0.9))
    place = ["-o", str(command)] if door == "new" else ["--into", str(command)]
    words = [str(mini.takes[0].path), *place, "--signer", "M1", "--channels", "--doubtful", "0.9"]
    assert main(["annotate", *words]) == 0
    same_files(script.parent, command.parent)


@pytest.mark.slow
def test_a_template_of_the_laboratory_does_not_stand_in_the_way_of_into(annotation, mini, tmp_path):
    sf.write_eaf(annotation.segments, tmp_path / "lab.etf", signer="other")
    sf.write_eaf(annotation.segments, tmp_path / "take.eaf", signer="other")
    (tmp_path / "lab.toml").write_text('[eaf]\ntemplate = "lab.etf"\n')
    into = ["annotate", str(mini.takes[0].path), "--into", str(tmp_path / "take.eaf"), "--signer", "M1"]
    assert main([*into, "--settings", str(tmp_path / "lab.toml")]) == 0
    assert {"affect@other", "affect@M1"} <= set(sf.read_tiers(tmp_path / "take.eaf"))
    assert main([*into, "--template", str(tmp_path / "lab.etf")]) == 2


def test_with_a_date_the_same_annotation_gives_the_same_bytes(annotation, tmp_path):
    contents = []
    for _ in range(2):
        files = sf.write_eaf(annotation, tmp_path / "take.eaf", date="2026-01-01")
        contents.append([file.read_bytes() for file in files])
    assert contents[0] == contents[1]
    assert [file.name for file in files] == ["take.eaf", "take.curves.csv", "take_tsconf.xml"]


def test_without_curves_only_the_tiers_are_written(annotation, tmp_path):
    files = sf.write_eaf(annotation, tmp_path / "take.eaf", options=sf.EafOptions(curves=False))
    assert files == [tmp_path / "take.eaf"]
    assert sorted(file.suffix for file in tmp_path.iterdir()) == [".eaf", ".pfsx"]


def test_an_annotation_goes_to_one_place(annotation, tmp_path):
    for places in ({}, {"path": tmp_path / "a.eaf", "into": tmp_path / "b.eaf"}):
        with pytest.raises(sf.SignfaceError, match="one of them"):
            sf.write_eaf(annotation, **places)


def test_pympi_holds_what_the_file_holds(annotation, tmp_path):
    sf.write_eaf(annotation, tmp_path / "take.eaf")
    import pympi

    ours, written = annotation.to_pympi(), pympi.Elan.Eaf(str(tmp_path / "take.eaf"))
    assert list(ours.get_tier_names()) == list(written.get_tier_names())
    for tier in written.get_tier_names():
        assert ours.get_annotation_data_for_tier(tier) == written.get_annotation_data_for_tier(tier)
    assert ours.linked_file_descriptors == []
    assert "brows@M1" in ours.get_tier_names()


def test_a_script_changes_what_it_got_from_pympi_and_reads_it_back(annotation, tmp_path):
    eaf = annotation.to_pympi()
    eaf.add_tier("gloss")
    eaf.add_annotation("gloss", 100, 900, "HAUS")
    eaf.to_file(str(tmp_path / "script.eaf"))
    back = sf.read_tiers(tmp_path / "script.eaf")
    assert back["gloss"].values.tolist() == [[0.1, 0.9, "HAUS"]]
    reference = sf.read_reference(tmp_path / "script.eaf", "M1").table
    assert reference["label"].tolist() == annotation.segments.table["label"].tolist()


def test_the_digest_of_options_follows_the_content_of_their_files(tmp_path):
    file = tmp_path / "mapping.toml"
    file.write_text('[affect]\ntier = "A"\n')
    options = sf.EafOptions(mapping=str(file))
    before = options.content_digest
    assert options.absolute().content_digest == before
    (tmp_path / "same.toml").write_bytes(file.read_bytes())
    assert options.changed(mapping=str(tmp_path / "same.toml")).content_digest == before
    file.write_text('[affect]\ntier = "B"\n')
    assert options.content_digest != before


@pytest.mark.slow
def test_the_script_of_the_manual_runs(mini, tmp_path, monkeypatch, capsys):
    text = (Path(__file__).parents[2] / "docs" / "elan.md").read_text("utf-8")
    script = text.partition("```python\n")[2].partition("```")[0]
    (tmp_path / "take.c3d").write_bytes(mini.takes[0].path.read_bytes())
    (tmp_path / "eva.eaf").write_bytes(mini.takes[0].annotation.read_bytes())
    monkeypatch.chdir(tmp_path)
    exec(compile(script, "docs/elan.md", "exec"), {"__name__": "script"})
    assert "eva.eaf: EAF 3.0" in capsys.readouterr().out


def test_a_channel_of_ones_own_is_written_as_any_other(annotation, tmp_path):
    import dataclasses

    import pandas as pd

    from signface.channels.events import ChannelEvents

    table = pd.DataFrame({"start_s": [0.5], "end_s": [1.0], "value": ["mm"]})
    mouthing = ChannelEvents("mouthing", "Mouthings", {"mm": "effortless"}, table)
    more = dataclasses.replace(annotation, channels={**annotation.channels, "mouthing": mouthing})
    sf.write_eaf(more, tmp_path / "take.eaf")
    assert sf.read_tiers(tmp_path / "take.eaf")["mouthing@M1"].values.tolist() == [[0.5, 1.0, "mm"]]
