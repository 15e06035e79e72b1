"""`signface take info` says what a recording holds, to people and to scripts."""

import json

import numpy as np
import pytest

from signface.cli.main import main
from signface.descriptors import Descriptors
from signface.descriptors_files import write_weights
from signface.takes.formats.c3d import write_c3d
from signface.takes.reading import read_take
from signface.takes.take import Take
from tests.fixtures.takes_files import moving_face, with_gaps

TAKE, _ = moving_face(2.0, 100.0, start=1.0)
TAKE = with_gaps(TAKE, {3: (10, 30), 5: (0, 5)})


def test_info_tells_frames_rate_duration_unit_markers_and_gaps(tmp_path, capsys):
    write_c3d(TAKE, tmp_path / "take.c3d")
    assert main(["take", "info", str(tmp_path / "take.c3d")]) == 0
    shown = capsys.readouterr().out
    assert "200 frames at 100 Hz: 2.000 s from 1.000 s" in shown
    assert "unit found: mm" in shown
    assert "26 markers: M00, M01" in shown
    assert "gaps of M03: 1, 0.200 s in all, the longest 0.200 s" in shown
    assert "history: read take.c3d (C3D)" in shown


def test_info_as_json_is_one_list_for_all_takes(tmp_path, capsys):
    write_c3d(TAKE, tmp_path / "a.c3d")
    write_weights(Descriptors(np.zeros((4, 2)), ("jawOpen", "cheekPuff"), 50.0), tmp_path / "w.csv")
    assert main(["take", "info", str(tmp_path / "a.c3d"), str(tmp_path / "w.csv"), "--json"]) == 0
    take, weights = json.loads(capsys.readouterr().out)
    assert take["frames"] == 200
    assert take["rate_hz"] == 100
    assert take["unit_found"] == "mm"
    assert take["gaps"]["M05"] == {"gaps": 1, "missing_s": 0.05, "longest_s": 0.05}
    assert list(take["gaps"]) == ["M03", "M05"]
    assert weights["kind"] == "weights"
    assert weights["bases"] == ["jawOpen", "cheekPuff"]


@pytest.mark.parametrize("prefix", ["", "Anna:"])
def test_info_recognises_the_layout_and_its_head_markers(prefix, face, tmp_path, capsys):
    from signface.face.layout_files import read_layout

    layout = read_layout("default-40", face)
    labels = [prefix + label for label in layout.labels if label != layout.head_labels[0]]
    positions = np.random.default_rng(0).normal(size=(4, len(labels), 3)) * 60
    write_c3d(Take(positions, labels, 100.0), tmp_path / "take.c3d")
    assert main(["take", "info", str(tmp_path / "take.c3d"), "--json"]) == 0
    (content,) = json.loads(capsys.readouterr().out)
    assert content["layout"] == "default-40"
    assert content["face_markers"] == len(layout.face_labels)
    assert content["head_markers"] == list(layout.head_labels[1:])
    assert content["missing"] == [layout.head_labels[0]]


def test_info_names_ghosts_and_swapped_markers_and_when(mini, tmp_path, capsys):
    take = read_take(mini.takes[2].path)
    positions = take.positions.copy()
    lip, left, right = (take.labels.index(label) for label in ("LIPUM", "HEADL", "HEADR"))
    positions[500, lip] += (300, 200, 100)
    positions[600:700, [left, right]] = positions[600:700, [right, left]]
    write_c3d(take.changed("spoiled", positions=positions), tmp_path / "take.c3d")
    assert main(["take", "info", str(tmp_path / "take.c3d")]) == 0
    said = capsys.readouterr().out
    assert "LIPUM a ghost at 2.500 s (left out)" in said
    assert "HEADL and HEADR swapped 3.000 to 3.495 s (swapped back)" in said
    assert main(["take", "info", "--json", str(tmp_path / "take.c3d"), str(mini.takes[2].path)]) == 0
    spoiled, clean = json.loads(capsys.readouterr().out)
    assert [(one["kind"], one["markers"]) for one in spoiled["wrong_markers"]] == [
        ("ghost", ["LIPUM"]),
        ("swapped", ["HEADL", "HEADR"]),
    ]
    assert clean["wrong_markers"] == []


def test_the_unit_can_be_given(tmp_path, capsys):
    write_c3d(TAKE, tmp_path / "take.c3d")
    assert main(["take", "info", str(tmp_path / "take.c3d"), "--unit", "m"]) == 0
    assert "unit found: m (given)" in capsys.readouterr().out
    assert main(["take", "info", str(tmp_path / "take.c3d"), "--unit", "furlong"]) == 2
    assert "'furlong' is unknown" in capsys.readouterr().err
