"""Several signers in one recording, and parts of takes: what every command makes of them."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from lxml import etree

from signface.cli.main import main
from signface.corpus.describing import describe_entry, recipe_of
from signface.corpus.manifest import read_corpus
from signface.corpus.origin import make_recipe, take_name
from signface.datasets import mini_take
from signface.descriptors_files import read_weights
from signface.elan.reference import read_reference
from signface.errors import SignfaceError
from signface.settings.solve import SolveSettings
from signface.solver.solving import solve
from signface.takes.formats.table import write_table
from signface.takes.reading import open_recording, read_recording
from signface.takes.take import Take
from signface.timecode import seconds_of_clock, seconds_of_timecode
from tests.fixtures.takes_files import write_livelink

#: What each of the signers lacks: what the other has must not fill it.
LACKING = {"Anna": ("CHINM", "LIPDM"), "Ben": ("LBROI", "RBROI", "LIPUM")}


@pytest.fixture(scope="module")
def dialogue(tmp_path_factory):
    """A file with two signers, and one of each alone."""
    folder = tmp_path_factory.mktemp("dialogue")
    anna, ben = mini_take("M1_IE_J"), mini_take("M2_EU_04")
    frames = min(anna.n_frames, ben.n_frames)
    positions, labels = [], []
    for name, take, aside in (("Anna", anna, 0.0), ("Ben", ben, 800.0)):
        own = [label for label in take.labels if label not in LACKING[name]]
        places = take.select(own)[:frames] + np.array([aside, 0, 0])
        write_table(Take(places, own, take.rate), folder / f"{name}.csv")
        positions.append(places)
        labels += [f"{name}:{label}" for label in own]
    write_table(Take(np.concatenate(positions, axis=1), labels, anna.rate), folder / "two.csv")
    return folder


def segments(file, signer):
    return read_reference(file, signer).table[["start_s", "end_s", "label"]]


@pytest.mark.slow
def test_every_signer_of_a_dialogue_is_annotated_as_alone(dialogue, tmp_path, capsys):
    both = tmp_path / "both.eaf"
    for _ in range(2):  # our own file may be written again
        assert main(["annotate", str(dialogue / "two.csv"), "-o", str(both)]) == 0
    root = etree.parse(str(both)).getroot()
    assert {tier.get("PARTICIPANT") for tier in root.iter("TIER")} == {"Anna", "Ben"}
    assert main(["elan", "check", str(both)]) == 0
    curves = pd.read_csv(tmp_path / "both.curves.csv")
    assert {"velocity_energy@Anna", "velocity_energy@Ben"} <= set(curves.columns)
    for signer in ("Anna", "Ben"):
        alone, chosen = tmp_path / f"{signer}.eaf", tmp_path / f"{signer}-chosen.eaf"
        assert main(["annotate", str(dialogue / f"{signer}.csv"), "-o", str(alone), "--signer", signer]) == 0
        assert main(["annotate", str(dialogue / "two.csv"), "-o", str(chosen), "--signer", signer]) == 0
        pd.testing.assert_frame_equal(segments(both, signer), segments(alone, signer))
        pd.testing.assert_frame_equal(segments(chosen, signer), segments(alone, signer))
    capsys.readouterr()
    assert main(["annotate", str(dialogue / "two.csv"), "-o", str(tmp_path / "c.eaf"), "--signer", "Cleo"]) == 2
    assert "2 signers: Anna, Ben" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["solve", "segment"])
def test_other_commands_ask_which_signer(dialogue, tmp_path, capsys, command):
    assert main([command, str(dialogue / "two.csv"), "-o", str(tmp_path / "out.csv")]) == 2
    error = capsys.readouterr().err
    assert "shows 2 signers: Anna, Ben. Choose one of them: --subject Anna" in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize("signer", ["Anna", "Ben"])
def test_a_chosen_signer_has_the_weights_of_a_file_of_their_own(dialogue, signer):
    chosen = solve(open_recording(dialogue / "two.csv"), settings=SolveSettings(subject=signer))
    alone = solve(open_recording(dialogue / f"{signer}.csv"))
    np.testing.assert_allclose(chosen.weights, alone.weights, atol=1e-9)


def test_take_info_names_the_signers(dialogue, capsys):
    assert main(["take", "info", str(dialogue / "two.csv")]) == 0
    assert "2 signers: Anna, Ben" in capsys.readouterr().out
    assert main(["take", "info", str(dialogue / "two.csv"), "--subject", "Ben", "--json"]) == 0
    (said,) = json.loads(capsys.readouterr().out)
    assert said["signers"] == ["Ben"]
    assert set(said["missing"]) == set(LACKING["Ben"])


@pytest.mark.parametrize("column", ["subject", "signer"])
def test_a_corpus_has_a_row_for_each_signer_of_a_dialogue(dialogue, tmp_path, column):
    (tmp_path / "two.csv").write_bytes((dialogue / "two.csv").read_bytes())
    rows = [("two.csv", "A", "EU", "Anna"), ("two.csv", "B", "EU", "Ben")]
    rows = rows if column == "subject" else [("two.csv", "Ben", "EU", "")]
    pd.DataFrame(rows, columns=["take", "signer", "kind", "subject"]).to_csv(tmp_path / "takes.csv", index=False)
    corpus = read_corpus(tmp_path)
    recipe = make_recipe()
    for entry in corpus:
        found = describe_entry(entry, recipe_of(entry, recipe, {}))
        alone = solve(open_recording(dialogue / f"{entry.subject or entry.signer}.csv"))
        np.testing.assert_allclose(found.weights, alone.weights, atol=1e-9)
    if column == "subject":
        assert [take_name(entry, tmp_path) for entry in corpus] == ["two@Anna", "two@Ben"]


def test_a_cut_take_keeps_the_times_of_its_film(tmp_path, dialogue):
    file = tmp_path / "w.csv"
    cut = ["--from", "11", "--to", "0:13.5", "--offset", "10"]
    assert main(["solve", str(dialogue / "Ben.csv"), "-o", str(file), *cut]) == 0
    weights = read_weights(file)
    assert weights.time[[0, -1]] == pytest.approx([11.0, 13.495])
    history = " ".join(
        solve(read_recording(dialogue / "Ben.csv"), settings=SolveSettings(cut_from=1, cut_to=2)).history
    )
    assert "between 1 and 2 s" in history


@pytest.mark.parametrize(
    "cut", [{"cut_from": 3, "cut_to": "0:02"}, {"cut_from": "noon"}, {"film_timecode": "1:2:3:4:5"}]
)
def test_times_that_are_none_are_refused(cut):
    with pytest.raises(SignfaceError):
        SolveSettings(**cut)


def test_a_phones_take_lies_where_its_timecode_says(tmp_path):
    file = write_livelink(tmp_path / "p.csv", np.zeros((120, 52)), np.zeros((120, 9)), rate=60)
    first = file.read_text().splitlines()[1].split(",")[0]
    hours, minutes, seconds, frame = first.replace(";", ":").split(":")
    own = 3600 * int(hours) + 60 * int(minutes) + int(seconds) + float(frame) / 60
    film = own - 4.5
    clock = f"{int(film // 3600):02d}:{int(film // 60 % 60):02d}:{int(film % 60):02d}.{round(film % 1 * 1000):03d}"
    assert open_recording(file, film_timecode=clock).start == pytest.approx(4.5, abs=2e-3)
    with pytest.raises(SignfaceError, match="unknown rate"):
        open_recording(file, film_timecode="10:00:00:12")


def test_a_file_without_timecode_is_not_placed_by_it(dialogue):
    with pytest.raises(SignfaceError, match="have no timecode"):
        open_recording(dialogue / "Anna.csv", film_timecode="10:00:00")


def test_timecodes_and_clock_times():
    assert seconds_of_clock("1:00:02.5") == 3602.5
    assert seconds_of_timecode("10:00:00;15@29.97") == 36000.5
    with pytest.raises(SignfaceError, match="frame 25 of 25"):
        seconds_of_timecode("10:00:00:25@25")
