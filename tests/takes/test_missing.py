"""A marker that was not seen is missing, however a program writes it."""

import numpy as np
import pytest

from signface.takes.formats.c3d import write_c3d
from signface.takes.formats.missing import mark_missing
from signface.takes.formats.table import write_table
from signface.takes.reading import read_take
from signface.takes.take import Take
from tests.fixtures.takes_files import moving_face, write_pose, write_qtm, write_trc
from tests.takes.test_reading import c3d_parts

TAKE, _ = moving_face(0.3, 100.0, face_markers=6, seed=3)
UNSEEN = np.zeros((TAKE.n_frames, len(TAKE.labels)), dtype=bool)
UNSEEN[4:7, 2] = True
WRITERS = {"trc": write_trc, "tsv": write_qtm, "csv": lambda take, file: write_table(take, file)}


def read_with(value, ending, folder):
    """What is missing of the take read from a file in which missing markers are written as `value`."""
    positions = TAKE.positions.copy()
    positions[UNSEEN] = value
    file = folder / f"take.{ending}"
    if ending == "c3d":
        c3d_parts(positions, TAKE.labels, rate=TAKE.rate).write(str(file))
    else:
        WRITERS[ending](Take(positions, TAKE.labels, TAKE.rate), file)
    return np.isnan(read_take(file).positions).any(axis=2)


@pytest.mark.parametrize("ending", ["c3d", "trc", "tsv", "csv"])
@pytest.mark.parametrize("value", [0.0, -9999.0, 99999.0, -999.0, 1e10])
def test_zeros_and_sentinels_in_all_three_coordinates_are_missing_markers_in_every_format(value, ending, tmp_path):
    np.testing.assert_array_equal(read_with(value, ending, tmp_path), UNSEEN)


@pytest.mark.parametrize("word", ["NaN", "nan", "NAN", "-nan(ind)", "N/A", "#VALUE!", "NULL", "-", "?", "inf", ""])
def test_words_for_nothing_are_missing_markers(word, tmp_path):
    file = tmp_path / "take.csv"
    write_table(TAKE, file)
    lines = file.read_text().splitlines()
    for frame in range(4, 7):
        cells = lines[1 + frame].split(",")
        cells[1 + 6 : 1 + 9] = [word] * 3
        lines[1 + frame] = ",".join(cells)
    file.write_text("\n".join(lines) + "\n")
    np.testing.assert_array_equal(np.isnan(read_take(file).positions).any(axis=2), UNSEEN)


def test_landmarks_at_zero_are_missing_however_sure_the_file_is(tmp_path):
    names = ["33", "263", "133", "362", "1"]
    rest = np.array([[250, 200, 0.0], [390, 200, 0], [290, 200, -0.01], [350, 200, -0.01], [320, 250, -0.1]])
    landmarks = np.tile(rest, (12, 1, 1)).astype(np.float64)
    landmarks[3:6] = 0
    take = read_take(write_pose(tmp_path / "take.pose", landmarks, names))
    np.testing.assert_array_equal(np.isnan(take.positions[..., 0]).all(axis=1), np.isin(np.arange(12), [3, 4, 5]))


def test_places_that_resemble_a_sentinel_in_one_coordinate_are_places():
    places = np.array([[0.0, 0, 1], [999, 0, 0], [-9999, 9999, 9998], [12, 12, 12]])
    assert np.isfinite(mark_missing(places.copy())).all()


def test_a_marker_kept_by_c3d_as_missing_stays_so(tmp_path):
    positions = TAKE.positions.copy()
    positions[UNSEEN] = np.nan
    write_c3d(Take(positions, TAKE.labels, TAKE.rate), tmp_path / "take.c3d")
    np.testing.assert_array_equal(np.isnan(read_take(tmp_path / "take.c3d").positions).any(axis=2), UNSEEN)
