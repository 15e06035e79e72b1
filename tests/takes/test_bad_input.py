"""Whatever a file holds, a reader gives a valid take or one clear line that names it; nothing else escapes."""

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from signface.cli.main import main
from signface.descriptors import Descriptors
from signface.descriptors_files import write_weights
from signface.errors import SignfaceError
from signface.takes.formats.c3d import write_c3d
from signface.takes.formats.table import write_table
from signface.takes.reading import read_recording, read_take
from signface.takes.take import Take
from tests.fixtures.takes_files import moving_face, with_gaps, write_livelink, write_pose, write_qtm, write_trc
from tests.takes.test_reading import LANDMARKS, c3d_parts, pictured

TAKE, _ = moving_face(0.2, 60.0, face_markers=3, seed=1)
TAKE = with_gaps(TAKE, {1: (2, 5)})
ENDINGS = [".c3d", ".trc", ".tsv", ".csv", ".pose", ".parquet", ".txt"]


def refusal(file, capsys):
    """The one line with which reading and the command line both refuse a file."""
    with pytest.raises(SignfaceError) as refused:
        read_recording(file)
    assert main(["take", "info", str(file)]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err == f"signface: {refused.value}\n"
    assert shown.err.count("\n") == 1
    assert str(file) in shown.err
    return shown.err


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_missing_an_empty_and_a_foreign_file_are_refused_under_any_ending(ending, tmp_path, capsys):
    file = tmp_path / f"take{ending}"
    assert "no such file" in refusal(file, capsys)
    file.write_bytes(b"")
    assert "empty" in refusal(file, capsys)
    file.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256)))
    assert "signface reads" in refusal(file, capsys).lower() or "is not what its ending says" in refusal(file, capsys)
    file.write_text("Dear diary,\ntoday I recorded a face.\n")
    refusal(file, capsys)


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_folder_is_refused(ending, tmp_path, capsys):
    (tmp_path / f"take{ending}").mkdir()
    assert "is a folder" in refusal(tmp_path / f"take{ending}", capsys)


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="needs a file that nobody can read from its start")
def test_a_file_that_cannot_be_read_is_refused(capsys):
    assert "cannot be read" in refusal(Path("/proc/self/mem"), capsys)


def test_a_c3d_file_without_points_is_refused(tmp_path, capsys):
    file = tmp_path / "none.c3d"
    write_c3d(TAKE, file)
    content = bytearray(file.read_bytes())
    struct.pack_into("<H", content, 2, 0)  # the header's number of points
    struct.pack_into("<H", content, content.index(b"USED") + 4 + 2 + 2, 0)
    file.write_bytes(content)
    assert "no points" in refusal(file, capsys)


@pytest.mark.parametrize(
    ("parameter", "offset", "value"),
    [
        (b"LABELS", 3, 0),  # text without a dimension
        (b"USED", 2, 255),  # a number declared as text
        (b"USED", 2, 1),  # a number of one byte
        (b"RATE", 3, 200),  # two hundred dimensions
        (b"SCALE", 2, 9),  # no type
        (b"UNITS", 0, 255),  # the next parameter lies elsewhere
    ],
)
def test_a_c3d_file_whose_parameters_contradict_themselves_is_refused_before_it_can_do_harm(
    parameter, offset, value, tmp_path, capsys
):
    file = tmp_path / "harm.c3d"
    write_c3d(TAKE, file)
    content = bytearray(file.read_bytes())
    content[content.index(parameter) + len(parameter) + offset] = value
    file.write_bytes(content)
    assert "damaged C3D file" in refusal(file, capsys)


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan])
def test_a_c3d_file_without_a_rate_is_refused(rate, tmp_path, capsys):
    file = tmp_path / "rate.c3d"
    write_c3d(TAKE, file)
    content = bytearray(file.read_bytes())
    struct.pack_into("<f", content, 20, rate)  # the header's rate
    at = content.index(b"RATE") + 4 + 2 + 2
    struct.pack_into("<f", content, at, rate)
    file.write_bytes(content)
    line = refusal(file, capsys)
    assert "rate" in line


def test_a_c3d_file_in_an_unknown_unit_is_refused(tmp_path, capsys):
    file = tmp_path / "unit.c3d"
    c3d_parts(TAKE.positions, TAKE.labels, units=["volts"]).write(str(file))
    assert "'volts'" in refusal(file, capsys)


def test_a_c3d_file_with_only_unlabelled_points_is_refused(tmp_path, capsys):
    file = tmp_path / "unlabelled.c3d"
    c3d_parts(TAKE.positions, [f"*{number}" for number in range(len(TAKE.labels))]).write(str(file))
    assert "none of the points in the C3D file has a label" in refusal(file, capsys)


def test_a_c3d_file_with_half_its_points_missing_is_read(tmp_path):
    positions = TAKE.positions.copy()
    positions[:, ::2] = np.nan
    positions[::2, 1] = np.nan
    write_c3d(Take(positions, TAKE.labels, TAKE.rate), tmp_path / "half.c3d")
    take = read_take(tmp_path / "half.c3d")
    np.testing.assert_array_equal(np.isnan(take.positions), np.isnan(positions))


def test_infinite_and_absurd_coordinates_are_missing_points(tmp_path):
    positions = np.nan_to_num(TAKE.positions)
    positions[0, 0], positions[1, 1, 2], positions[2, 2, 0] = np.inf, -np.inf, np.nan
    c3d_parts(positions, TAKE.labels).write(str(tmp_path / "inf.c3d"))
    take = read_take(tmp_path / "inf.c3d")
    missing = np.isnan(take.positions[..., 0])
    assert missing[0, 0]
    assert missing[1, 1]
    assert missing[2, 2]
    np.testing.assert_array_equal(np.isnan(take.positions).any(axis=2), missing)


def test_a_take_of_one_frame_is_read_where_the_file_tells_its_rate(tmp_path, capsys):
    one = Take(TAKE.positions[:1], TAKE.labels, TAKE.rate)
    write_c3d(one, tmp_path / "one.c3d")
    write_trc(one, tmp_path / "one.trc")
    write_qtm(one, tmp_path / "one.tsv")
    write_table(one, tmp_path / "one.csv")
    for name in ("one.c3d", "one.trc", "one.tsv"):
        assert read_take(tmp_path / name).n_frames == 1
    assert "a rate needs two" in refusal(tmp_path / "one.csv", capsys)


def test_a_c3d_file_cut_short_says_how_many_frames_are_left(tmp_path, capsys):
    file = tmp_path / "cut.c3d"
    long = Take(np.ones((200, 9, 3)), [f"M{number}" for number in range(9)], 60.0)
    write_c3d(long, file)
    file.write_bytes(file.read_bytes()[:-20000])
    assert "of 200 frames" in refusal(file, capsys)


def test_a_text_cut_short_names_its_line(tmp_path, capsys):
    for write, name in ((write_trc, "t.trc"), (write_qtm, "t.tsv"), (write_table, "t.csv")):
        file = tmp_path / name
        write(TAKE, file)
        text = file.read_text().rstrip()
        file.write_text(text[: text.rindex("\t" if name != "t.csv" else ",") - 40])
        assert "cells instead of" in refusal(file, capsys)


def test_words_among_the_numbers_are_refused(tmp_path, capsys):
    for write, name in ((write_trc, "t.trc"), (write_qtm, "t.tsv"), (write_table, "t.csv")):
        file = tmp_path / name
        write(TAKE, file)
        lines = file.read_text().splitlines()
        separator = "," if name == "t.csv" else "\t"
        cells = lines[-2].split(separator)
        cells[-1] = "oops"
        lines[-2] = separator.join(cells)
        file.write_text("\n".join(lines))
        assert f"line {len(lines) - 1} has a cell that is no number: 'oops'" in refusal(file, capsys)


@pytest.mark.parametrize(
    ("header", "problem"),
    [
        ("time_s,A_x,A_y,A_z,B_x,B_y", "not all of x, y and z are there for B"),
        ("frame,A_x,A_y,A_z", "its first column is not time_s"),
        ("time_s,A_x,A_y,A_z,volume", "'volume' is no coordinate"),
    ],
)
def test_a_csv_with_other_columns_is_refused(header, problem, tmp_path, capsys):
    file = tmp_path / "t.csv"
    rows = "\n".join(",".join([str(row / 10), *"12345678"[: header.count(",")]]) for row in range(5))
    file.write_text(f"{header}\n{rows}\n")
    assert problem in refusal(file, capsys)


def test_times_that_do_not_rise_are_refused(tmp_path, capsys):
    file = tmp_path / "t.csv"
    file.write_text("time_s,A_x,A_y,A_z\n0,1,2,3\n0.2,1,2,3\n0.1,1,2,3\n")
    assert "do not rise" in refusal(file, capsys)


def test_a_pose_file_without_a_face_is_refused(tmp_path, capsys):
    file = write_pose(tmp_path / "p.pose", pictured(), list(LANDMARKS), confidence=np.zeros((4, 5)))
    assert "no face is seen" in refusal(file, capsys)
    file = write_pose(tmp_path / "q.pose", pictured(), ["1", "2", "3", "4", "5"])
    assert "corners of the eyes are never seen" in refusal(file, capsys)
    content = (tmp_path / "q.pose").read_bytes().replace(b"FACE_LANDMARKS", b"FACE_LANDMERKS")
    (tmp_path / "r.pose").write_bytes(content)
    assert "no component FACE_LANDMARKS, only POSE_LANDMARKS, FACE_LANDMERKS" in refusal(tmp_path / "r.pose", capsys)


# --- laws ----------------------------------------------------------------------------------------------------------


def specimens(folder):
    """One good file of every format."""
    random = np.random.default_rng(0)
    write_c3d(TAKE, folder / "c3d.c3d")
    write_trc(TAKE, folder / "trc.trc")
    write_qtm(TAKE, folder / "qtm.tsv")
    write_table(TAKE, folder / "table.csv")
    write_pose(folder / "pose.pose", pictured(), list(LANDMARKS))
    write_livelink(folder / "livelink.csv", random.random((9, 52)), random.random((9, 9)))
    write_weights(Descriptors(random.random((5, 2)), ("a", "b"), 50.0), folder / "weights.csv")
    write_weights(Descriptors(random.random((5, 2)), ("a", "b"), 50.0), folder / "weights.parquet")
    analog = c3d_parts(TAKE.positions, TAKE.labels)
    analog["parameters"]["ANALOG"]["RATE"]["value"] = [200]
    analog["parameters"]["ANALOG"]["LABELS"]["value"] = ["voice"]
    analog["data"]["analogs"] = np.ones((1, 1, 2 * TAKE.n_frames))
    analog.write(str(folder / "analog.c3d"))
    return {file.name: file.read_bytes() for file in folder.iterdir()}


KINDS = [
    "c3d.c3d",
    "analog.c3d",
    "trc.trc",
    "qtm.tsv",
    "table.csv",
    "pose.pose",
    "livelink.csv",
    "weights.csv",
    "weights.parquet",
]


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return specimens(tmp_path_factory.mktemp("specimens"))


def gives_a_take_or_a_clear_line(content, file):
    """The law: a valid recording, or a SignfaceError of one line that names the file."""
    file.write_bytes(content)
    refused = None
    try:
        recording = read_recording(file)
    except SignfaceError as error:
        refused = str(error)
    if refused is not None:
        assert str(file) in refused
        assert "\n" not in refused
        return None
    if isinstance(recording, Take):
        known = np.isfinite(recording.positions)
        assert (known.all(axis=2) | ~known.any(axis=2)).all()
    assert recording.n_frames >= 1
    assert np.isfinite(recording.rate)
    return recording


SOON = settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.mark.parametrize("kind", KINDS)
def test_every_specimen_is_whole(kind, good, tmp_path):
    assert gives_a_take_or_a_clear_line(good[kind], tmp_path / kind) is not None


@pytest.mark.parametrize("kind", KINDS)
@given(share=st.floats(0, 1))
@SOON
def test_a_file_cut_anywhere_gives_a_take_or_a_clear_line(kind, share, good, tmp_path):
    gives_a_take_or_a_clear_line(good[kind][: int(share * len(good[kind]))], tmp_path / kind)


@pytest.mark.parametrize("kind", KINDS)
@given(
    places=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=8),
    early=st.sampled_from([64, 1024, 10**6]),
)
@SOON
def test_a_file_damaged_anywhere_gives_a_take_or_a_clear_line(kind, places, early, good, tmp_path):
    content = bytearray(good[kind])
    for share, value in places:
        content[int(share * (min(early, len(content)) - 1))] = value
    gives_a_take_or_a_clear_line(bytes(content), tmp_path / kind)


@given(
    opening=st.sampled_from(
        [
            *(b"", b"\x02\x50", b"\xcd\xcc\x4c\x3e", b"\0\0\0\0", b"PAR1", b"\xff\xfe"),
            *(b"PathFileType\t4\n", b"time_s,A_x,A_y,A_z\n", b"NO_OF_MARKERS\t1\nMARKER_NAMES\tA\n"),
            b"Timecode,BlendshapeCount,EyeBlinkLeft\n",
        ]
    ),
    rest=st.one_of(st.binary(max_size=1500), st.text(max_size=300).map(str.encode)),
    ending=st.sampled_from(ENDINGS),
)
@settings(max_examples=250, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_random_bytes_give_a_take_or_a_clear_line(opening, rest, ending, tmp_path):
    gives_a_take_or_a_clear_line(opening + rest, tmp_path / f"random{ending}")
