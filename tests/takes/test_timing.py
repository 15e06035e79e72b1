"""Times that a file states: their unit, their beginning, how evenly they rise, and what it declares besides."""

import struct

import numpy as np
import pytest

from signface.errors import SignfaceError, SignfaceWarning
from signface.takes.formats.c3d import write_c3d
from signface.takes.formats.table import write_table
from signface.takes.reading import read_take
from tests.fixtures.takes_files import moving_face, write_pose, write_qtm, write_trc

TAKE, _ = moving_face(0.5, 100.0, face_markers=4, seed=5)


def timed(folder, times, heading="Time"):
    """The take as a CSV with these times, of as many rows."""
    file = folder / "take.csv"
    write_table(TAKE, file)
    rows = [line.partition(",")[2] for line in file.read_text().splitlines()]
    lines = [f"{heading},{rows[0]}", *(f"{time!r},{row}" for time, row in zip(times, rows[1:]))]
    file.write_text("\n".join(lines) + "\n")
    return file


COUNT = range(TAKE.n_frames)
UNEVEN = [0.01 * (k + 0.45 * (k % 2)) for k in COUNT]


@pytest.mark.parametrize(
    ("times", "rate", "start", "said"),
    [
        ([10 * k for k in COUNT], 100.0, 0.0, "milliseconds"),
        ([10000 * k for k in COUNT], 100.0, 0.0, "microseconds"),
        ([1714564800 + k / 100 for k in COUNT], 100.0, 0.0, "count from a date"),
        ([1714564800000 + 10 * k for k in COUNT], 100.0, 0.0, "count from a date"),
        ([1714564800000000000 + 10000000 * k for k in COUNT], 100.0, 0.0, "count from a date"),
        ([round((86399.9 + k / 100) % 86400, 6) for k in COUNT], 100.0, 86399.9, "midnight"),
    ],
)
@pytest.mark.filterwarnings("ignore::signface.SignfaceWarning")
def test_times_in_other_units_and_from_other_clocks_are_made_seconds(times, rate, start, said, tmp_path):
    take = read_take(timed(tmp_path, times))
    assert take.rate == pytest.approx(rate, rel=1e-4)
    assert take.start == pytest.approx(start)
    assert any(said in entry for entry in take.history)
    np.testing.assert_allclose(take.positions, TAKE.positions, atol=1e-5)


@pytest.mark.parametrize("times", [list(COUNT), [3 * k for k in COUNT][::-1], [0.5 * k for k in COUNT][::-1]])
def test_times_of_no_camera_are_refused_and_a_given_rate_has_the_last_word(times, tmp_path):
    file = timed(tmp_path, times)
    with pytest.raises(SignfaceError, match="--rate"):
        read_take(file)
    take = read_take(file, rate=50, start=2.0)
    assert (take.rate, take.start, take.n_frames) == (50.0, 2.0, TAKE.n_frames)


def test_rows_of_uneven_times_are_resampled_and_it_is_said(tmp_path):
    with pytest.warns(SignfaceWarning, match="uneven"):
        take = read_take(timed(tmp_path, UNEVEN))
    wanted = np.interp(take.time, UNEVEN, TAKE.positions[:, 0, 0])
    np.testing.assert_allclose(take.positions[:, 0, 0], wanted, atol=1e-4)


def test_dropped_rows_leave_a_gap_and_shift_nothing(tmp_path):
    times = [k / 100 + (0.2 if k >= 20 else 0.0) for k in COUNT]
    with pytest.warns(SignfaceWarning, match="20 of 70 frames are missing"):
        take = read_take(timed(tmp_path, times))
    assert (take.n_frames, take.rate) == (70, 100.0)
    np.testing.assert_allclose(take.positions[40:], TAKE.positions[20:], atol=1e-5)
    assert np.isnan(take.positions[20:40]).all()


@pytest.mark.parametrize(("write", "name"), [(write_trc, "DataRate"), (write_qtm, "FREQUENCY")])
def test_times_are_believed_before_a_rate_that_contradicts_them(write, name, tmp_path):
    file = write(TAKE, tmp_path / "take.any")
    plain = "FREQUENCY\t100" if name == "FREQUENCY" else "\n100\t100\t"
    assert plain in file.read_text()
    file.write_text(file.read_text().replace(plain, plain.replace("100", "200")))
    with pytest.warns(SignfaceWarning, match=name):
        assert read_take(file).rate == 100.0


@pytest.mark.parametrize(("write", "name"), [(write_trc, "NumFrames"), (write_qtm, "NO_OF_FRAMES")])
def test_a_file_with_fewer_rows_than_it_declares_says_so(write, name, tmp_path):
    file = write(TAKE, tmp_path / "take.any")
    file.write_text("\n".join(file.read_text().splitlines()[:-10]) + "\n")
    with pytest.warns(SignfaceWarning, match=f"{TAKE.n_frames - 10} frames and {name}"):
        assert read_take(file).n_frames == TAKE.n_frames - 10


def test_a_cell_before_the_coordinates_of_a_tsv_is_the_time(tmp_path):
    file = write_qtm(TAKE, tmp_path / "take.tsv", columns=False)
    lines = file.read_text().splitlines()
    head = next(number for number, line in enumerate(lines) if line.startswith("MARKER_NAMES"))
    rows = [f"{k / 100:.5f}\t{line}" for k, line in enumerate(lines[head + 1 :])]
    file.write_text("\n".join([*lines[: head + 1], *rows]) + "\n")
    np.testing.assert_allclose(read_take(file).positions, TAKE.positions, atol=1e-2)


def test_more_names_than_a_trc_declares_are_read_with_a_word(tmp_path):
    file = write_trc(TAKE, tmp_path / "take.trc")
    lines = file.read_text().splitlines()
    lines[2] = lines[2].replace(f"\t{len(TAKE.labels)}\t", "\t5\t")
    file.write_text("\n".join(lines) + "\n")
    with pytest.warns(SignfaceWarning, match="NumMarkers says 5"):
        assert read_take(file).labels == TAKE.labels


@pytest.mark.parametrize("stale", [3, 3000])
def test_the_frames_of_a_c3d_are_those_that_its_size_bears_out(stale, tmp_path):
    file = tmp_path / "take.c3d"
    write_c3d(TAKE, file)
    content = bytearray(file.read_bytes())
    at = content.index(b"FRAMES") + len(b"FRAMES") + 2
    kind, dimensions = struct.unpack_from("<bB", content, at)
    struct.pack_into("<f" if kind == 4 else "<H", content, at + 2 + dimensions, stale)
    file.write_bytes(content)
    with pytest.warns(SignfaceWarning, match=f"{stale} frames; by its size there are {TAKE.n_frames}"):
        take = read_take(file)
    np.testing.assert_allclose(take.positions, TAKE.positions, atol=1e-3)


def test_a_film_of_a_thousand_frames_a_second_is_doubted_in_the_history(tmp_path):
    names = ["33", "263", "133", "362", "1"]
    rest = np.array([[250.0, 200, 0], [390, 200, 0], [290, 200, -0.01], [350, 200, -0.01], [320, 250, -0.1]])
    file = write_pose(tmp_path / "take.pose", np.tile(rest, (12, 1, 1)), names, rate=1000.0)
    with pytest.warns(SignfaceWarning, match="1000 frames a second"):
        assert any("--rate" in entry for entry in read_take(file).history)
    assert read_take(file, rate=30).rate == 30


def test_a_face_of_a_third_of_a_millimetre_is_doubted(tmp_path):
    file = write_trc(TAKE, tmp_path / "take.trc", scale=0.001)
    with pytest.warns(SignfaceWarning, match="too small for a face"):
        read_take(file)
    np.testing.assert_allclose(read_take(file, unit="m").positions, TAKE.positions, atol=0.01)
