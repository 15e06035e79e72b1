"""Recordings are read from every format, whatever their ending, unit and quirks."""

import struct

import ezc3d
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from signface.descriptors import Descriptors
from signface.descriptors_files import write_weights
from signface.errors import SignfaceError
from signface.marker_names import SeveralSigners
from signface.takes.formats.c3d import open_c3d, write_c3d
from signface.takes.formats.table import write_table
from signface.takes.formats.text import TextFile, TextRows
from signface.takes.reading import read_recording, read_take, recognise
from signface.takes.take import Take
from tests.fixtures.takes_files import (
    LIVELINK_BASES,
    moving_face,
    with_gaps,
    write_livelink,
    write_pose,
    write_qtm,
    write_trc,
)

RECORDED, _ = moving_face(0.5, 100.0, face_markers=6, seed=3)
RECORDED = with_gaps(RECORDED, {0: (3, 9), 4: (0, 5), 7: (40, 50)})

WRITERS = {
    "c3d": (write_c3d, 1e-3),
    "trc": (write_trc, 1e-4),
    "qtm": (write_qtm, 1e-3),
    "table": (write_table, 1e-5),
}


def c3d_parts(points=RECORDED.positions, labels=RECORDED.labels, rate=100.0, units=("mm",)):
    """A C3D as ezc3d holds it, to be bent into the shape a test needs."""
    content = ezc3d.c3d()
    point = content["parameters"]["POINT"]
    point["RATE"]["value"] = [rate]
    point["LABELS"]["value"] = list(labels)
    point["UNITS"]["value"] = list(units)
    data = np.ones((4, points.shape[1], points.shape[0]))
    data[:3] = points.transpose(2, 1, 0)
    content["data"]["points"] = data
    return content


@pytest.mark.parametrize("kind", WRITERS)
def test_what_is_written_is_read_back(kind, tmp_path):
    write, precision = WRITERS[kind]
    file = tmp_path / "take.any"
    write(RECORDED, tmp_path / "take.c3d")
    (tmp_path / "take.c3d").rename(file)  # the content must do
    take = read_take(file)
    assert recognise(file) == kind
    assert take.labels == RECORDED.labels
    assert take.rate == RECORDED.rate
    assert take.name == "take"
    assert "take.any" in " ".join(take.history)
    np.testing.assert_array_equal(np.isnan(take.positions), np.isnan(RECORDED.positions))
    np.testing.assert_allclose(take.positions, RECORDED.positions, atol=precision)


@pytest.mark.parametrize("ending", [".c3d", ".csv", ".pose", ".txt", ""])
def test_the_content_decides_not_the_ending(ending, tmp_path):
    file = tmp_path / f"take{ending}"
    write_trc(RECORDED, file)
    assert recognise(file) == "trc"
    write_c3d(RECORDED, tmp_path / "t.c3d")
    file.write_bytes((tmp_path / "t.c3d").read_bytes())
    assert recognise(file) == "c3d"


@given(
    frames=st.integers(1, 12),
    markers=st.integers(1, 5),
    rate=st.sampled_from([25.0, 29.97, 60.0, 120.0, 200.0]),
    first=st.integers(0, 100000),
    seed=st.integers(0, 2**31),
)
@settings(max_examples=25, deadline=None)
def test_a_c3d_file_keeps_positions_gaps_rate_and_start(frames, markers, rate, first, seed, tmp_path_factory):
    random = np.random.default_rng(seed)
    positions = random.normal(size=(frames, markers, 3)) * 100 + 500
    positions[random.random((frames, markers)) < 0.2] = np.nan
    take = Take(positions, [f"M{number}" for number in range(markers)], rate, start=first / rate)
    file = tmp_path_factory.mktemp("c3d") / "take.c3d"
    write_c3d(take, file)
    back = open_c3d(file).whole()
    np.testing.assert_allclose(back.positions, take.positions, rtol=1e-6)
    assert back.rate == pytest.approx(rate, rel=1e-6)
    assert back.start == pytest.approx(take.start, abs=0.5 / rate)


def test_the_same_take_gives_the_same_bytes(tmp_path):
    for name in ("a.c3d", "b.c3d"):
        write_c3d(RECORDED, tmp_path / name)
    assert (tmp_path / "a.c3d").read_bytes() == (tmp_path / "b.c3d").read_bytes()


def test_a_take_too_long_for_c3d_is_refused_and_nothing_is_written(tmp_path):
    take = Take(np.ones((65536, 1, 3)), ["A"], 200.0)
    with pytest.raises(SignfaceError, match="too many for a C3D file"):
        write_c3d(take, tmp_path / "long.c3d")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("unit", "millimetres"), [("m", 1000.0), ("cm", 10.0), ("mm", 1.0), ("M", 1000.0), ("in", 25.4)]
)
def test_a_c3d_file_in_any_unit_becomes_millimetres(unit, millimetres, tmp_path):
    file = tmp_path / "take.c3d"
    c3d_parts(RECORDED.positions / millimetres, units=[unit]).write(str(file))
    np.testing.assert_allclose(read_take(file).positions, RECORDED.positions, rtol=1e-5, atol=1e-3)


def test_a_c3d_file_may_name_a_unit_for_each_point(tmp_path):
    file = tmp_path / "take.c3d"
    markers = len(RECORDED.labels)
    factors = np.where(np.arange(markers) % 2, 1000.0, 1.0)
    units = ["m" if factor > 1 else "mm" for factor in factors]
    c3d_parts(RECORDED.positions / factors[:, None], units=units).write(str(file))
    take = read_take(file)
    np.testing.assert_allclose(take.positions, RECORDED.positions, rtol=1e-5, atol=1e-3)
    assert "one per marker" in " ".join(take.history)


@pytest.mark.parametrize(("factor", "unit"), [(1000.0, "m"), (10.0, "cm"), (1.0, "mm")])
@pytest.mark.parametrize("kind", ["c3d", "table"])
def test_a_unit_nobody_names_is_inferred_from_the_width_of_the_face(kind, factor, unit, tmp_path):
    file = tmp_path / "take.c3d"
    scaled = RECORDED.changed("scaled", positions=RECORDED.positions / factor)
    if kind == "c3d":
        c3d_parts(scaled.positions, units=()).write(str(file))
    else:
        write_table(scaled, file)
    take = read_take(file)
    assert f"unit {unit} (not in the file" in " ".join(take.history)
    np.testing.assert_allclose(take.positions, RECORDED.positions, rtol=1e-4, atol=0.01)


def test_the_unit_a_user_gives_has_the_last_word(tmp_path):
    write_c3d(RECORDED, tmp_path / "take.c3d")
    take = read_take(tmp_path / "take.c3d", unit="cm")
    np.testing.assert_allclose(take.positions, RECORDED.positions * 10, rtol=1e-5, atol=1e-2)
    with pytest.raises(SignfaceError, match=r"take\.c3d: the unit of length 'parsec' is unknown"):
        read_take(tmp_path / "take.c3d", unit="parsec")


def test_points_at_exactly_zero_are_missing(tmp_path):
    content = c3d_parts(np.nan_to_num(RECORDED.positions))
    content.write(str(tmp_path / "zeros.c3d"))
    np.testing.assert_array_equal(np.isnan(read_take(tmp_path / "zeros.c3d").positions), np.isnan(RECORDED.positions))


def test_unlabelled_points_are_ignored_with_a_note_and_repeated_labels_numbered(tmp_path):
    labels = ["Anna:A", "*12", "A", "U_4", "A", "", *RECORDED.labels[6:]]
    c3d_parts(labels=labels).write(str(tmp_path / "take.c3d"))
    take = read_take(tmp_path / "take.c3d")
    assert take.labels == ("Anna:A", "A", "A~2", *RECORDED.labels[6:])
    assert "ignored 3 unlabelled points" in " ".join(take.history)
    assert "numbered repeated labels: A" in " ".join(take.history)
    np.testing.assert_allclose(take.positions[:, 1], RECORDED.positions[:, 2], rtol=1e-5)


def test_a_c3d_file_may_hold_more_than_255_markers(tmp_path):
    positions = np.random.default_rng(0).normal(size=(3, 600, 3)) * 100
    take = Take(positions, [f"marker{number}" for number in range(600)], 60.0)
    write_c3d(take, tmp_path / "many.c3d")
    back = read_take(tmp_path / "many.c3d")
    assert back.labels == take.labels
    np.testing.assert_allclose(back.positions, positions, atol=1e-3)


def test_a_c3d_file_of_16_bit_integers_is_read(tmp_path):
    content = c3d_parts(np.nan_to_num(RECORDED.positions))
    content.write(str(tmp_path / "float.c3d"))
    floats = (tmp_path / "float.c3d").read_bytes()
    frames, markers = RECORDED.positions.shape[:2]
    scale = 0.1
    header = bytearray(floats)
    (block,) = struct.unpack_from("<H", header, 16)
    struct.pack_into("<f", header, 12, scale)
    at = header.index(b"SCALE") + 5 + 2 + 1 + 1
    struct.pack_into("<f", header, at, scale)
    words = np.zeros((frames, markers, 4), dtype="<i2")
    words[..., :3] = np.round(np.nan_to_num(RECORDED.positions) / scale)
    words[..., 3] = np.where(np.isnan(RECORDED.positions[..., 0]), -1, 0)
    (tmp_path / "integer.c3d").write_bytes(bytes(header[: (block - 1) * 512]) + words.tobytes() + bytes(512))
    take = read_take(tmp_path / "integer.c3d")
    np.testing.assert_allclose(take.positions, RECORDED.positions, atol=scale)
    np.testing.assert_array_equal(np.isnan(take.positions), np.isnan(RECORDED.positions))


def test_a_trc_file_in_metres_becomes_millimetres(tmp_path):
    take = read_take(write_trc(RECORDED, tmp_path / "t.trc", units="m", scale=0.001))
    np.testing.assert_allclose(take.positions, RECORDED.positions, atol=0.02)


def test_a_qtm_file_is_read_with_and_without_its_line_of_columns(tmp_path):
    for columns in (True, False):
        take = read_take(write_qtm(RECORDED, tmp_path / "t.tsv", columns=columns))
        np.testing.assert_allclose(take.positions, RECORDED.positions, atol=1e-3)


@pytest.mark.parametrize("separator", [";", "\t"])
def test_a_csv_of_another_country_is_read(separator, tmp_path):
    write_table(RECORDED, tmp_path / "t.csv")
    text = (tmp_path / "t.csv").read_text().replace(",", separator).replace(".", ",")
    (tmp_path / "t.csv").write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    np.testing.assert_allclose(read_take(tmp_path / "t.csv").positions, RECORDED.positions, atol=1e-5)


@pytest.mark.parametrize("digits", [3, 6])
@pytest.mark.parametrize("rate", [25.0, 29.97, 59.94, 120.0, 200.0])
def test_the_rate_of_a_csv_is_told_from_rounded_times(rate, digits, tmp_path):
    times = np.arange(round(20 * rate)) / rate
    rows = "".join(f"{time:.{digits}f},1,2,3\n" for time in times)
    (tmp_path / "t.csv").write_text(f"time_s,A_x,A_y,A_z\n{rows}")
    assert read_take(tmp_path / "t.csv").rate == pytest.approx(rate, rel=1e-4 if digits == 3 else 1e-6)


def test_the_start_of_a_csv_is_its_first_time(tmp_path):
    later = RECORDED.changed("later", start=12.34)
    write_table(later, tmp_path / "t.csv")
    assert read_take(tmp_path / "t.csv").start == pytest.approx(12.34)


# --- .pose ---------------------------------------------------------------------------------------------------------

#: A face in millimetres at a few of MediaPipe's landmarks: x to the signer's left, y up, z towards the camera.
LANDMARKS = {
    "33": (-44.5, 26.6, 31.7),
    "263": (44.5, 26.6, 31.7),
    "1": (0.0, -11.3, 74.8),
    "152": (0.0, -94.0, 42.6),
    "10": (0.0, 82.6, 44.8),
}


def pictured(scale=0.5, width=640.0, frames=4, turn=0.0):
    """(F, 5, 3) landmarks as MediaPipe gives them: pixels with y down, depth in picture widths, smaller is nearer."""
    face = np.array(list(LANDMARKS.values()))
    turned = face @ np.array([[np.cos(turn), 0, -np.sin(turn)], [0, 1, 0], [np.sin(turn), 0, np.cos(turn)]])
    pixels = turned * (scale, -scale, -scale) + (320.0, 240.0, 0.0)
    return np.tile(pixels / (1, 1, width), (frames, 1, 1))


@pytest.mark.parametrize("turn", [0.0, 0.5])
def test_a_pose_file_becomes_a_right_handed_face_in_millimetres(turn, tmp_path):
    file = write_pose(tmp_path / "face.pose", pictured(turn=turn), list(LANDMARKS))
    take = read_take(file)
    assert take.labels == tuple(LANDMARKS)
    assert take.rate == 25.0
    face = dict(zip(take.labels, take.positions[0]))
    outer = face["263"] - face["33"]
    assert np.linalg.norm(outer) == pytest.approx(89.5, rel=1e-4)
    up = face["10"] - face["152"]
    assert up[1] == pytest.approx(176.6 * 89.5 / 89.0, rel=1e-3)
    assert outer[0] > 0
    nose = face["1"] - (face["33"] + face["263"]) / 2
    assert np.dot(np.cross(outer, up), nose) > 0, "mirrored"
    assert "263 are 89.5 mm apart" in " ".join(take.history)


def test_the_scale_of_a_pose_file_is_one_for_the_whole_take(tmp_path):
    landmarks = pictured(frames=9)
    landmarks[-2:] = pictured(scale=0.6, frames=2)  # nearer to the camera
    take = read_take(write_pose(tmp_path / "face.pose", landmarks, list(LANDMARKS)))
    apart = np.linalg.norm(take.select(["263"]) - take.select(["33"]), axis=2).ravel()
    np.testing.assert_allclose(apart, [89.5] * 7 + [89.5 * 1.2] * 2, rtol=1e-4)


def test_depth_that_is_already_in_pixels_is_left_so(tmp_path):
    landmarks = pictured() * (1, 1, 640)
    take = read_take(write_pose(tmp_path / "face.pose", landmarks, list(LANDMARKS)))
    reference = read_take(write_pose(tmp_path / "other.pose", pictured(), list(LANDMARKS)))
    np.testing.assert_allclose(take.positions, reference.positions, atol=1e-3)


def test_landmarks_without_confidence_are_missing_and_the_person_seen_most_is_taken(tmp_path):
    landmarks = np.stack((pictured(frames=12) + np.array([5, 5, 0]), pictured(frames=12)), axis=1)
    confidence = np.ones(landmarks.shape[:3])
    confidence[1:, 0] = 0
    confidence[2, 1, 3] = 0
    take = read_take(write_pose(tmp_path / "two.pose", landmarks, list(LANDMARKS), confidence=confidence))
    assert np.argwhere(np.isnan(take.positions[..., 0])).tolist() == [[2, 3]]
    assert "person 1 of 2" in " ".join(take.history)


def two_people(frames=40):
    """(F, 2, N, 3) landmarks of two people who sit apart and smile differently, who change their index half-way."""
    one = np.concatenate([pictured()] * frames)[:frames]
    other = one + np.array([260, 10, 0])
    other[:, -1] += np.linspace(0, 9, frames)[:, None] * (1, 0, 0)
    landmarks = np.stack((one, other), axis=1)
    landmarks[frames // 2 :] = landmarks[frames // 2 :, ::-1].copy()
    return landmarks, one, other


def test_people_who_change_their_index_stay_themselves(tmp_path):
    landmarks, one, other = two_people()
    file = write_pose(tmp_path / "two.pose", landmarks, list(LANDMARKS))
    with pytest.raises(SeveralSigners, match=r"2 signers: 1, 2"):
        read_take(file)
    for subject, alone in (("1", one), ("2", other)):
        reference = read_take(write_pose(tmp_path / "alone.pose", alone, list(LANDMARKS)))
        np.testing.assert_allclose(read_take(file, subject=subject).positions, reference.positions, atol=1e-4)
    with pytest.raises(SignfaceError, match=r"no person '3'.*1, 2"):
        read_take(file, subject="3")


def test_someone_who_passes_by_is_no_signer(tmp_path):
    landmarks, one, _ = two_people()
    confidence = np.ones(landmarks.shape[:3])
    confidence[:20, 1] = 0
    confidence[24:, 0] = 0  # the other is seen in four frames, under the first index
    take = read_take(write_pose(tmp_path / "two.pose", landmarks, list(LANDMARKS), confidence=confidence))
    reference = read_take(write_pose(tmp_path / "alone.pose", one, list(LANDMARKS)))
    np.testing.assert_allclose(take.positions, reference.positions, atol=1e-4)


def test_a_pose_file_without_depth_is_a_flat_face(tmp_path):
    take = read_take(write_pose(tmp_path / "flat.pose", pictured()[..., :2], list(LANDMARKS)))
    assert np.ptp(take.positions[..., 2]) == 0
    assert "the face is flat" in " ".join(take.history)


def test_a_real_signer_has_a_human_face(signer_pose):
    take = read_take(signer_pose)
    assert (take.n_frames, len(take.labels), take.rate) == (130, 468, 30.0)
    shape = np.ptp(np.nanmedian(take.positions, axis=0), axis=0)
    assert 110 < shape[0] < 170, "width of the face in mm"
    assert 150 < shape[1] < 210, "height of the face in mm"
    assert 60 < shape[2] < 130, "depth of the face in mm"
    face = dict(zip(take.labels, np.nanmedian(take.positions, axis=0)))
    assert face["1"][2] > face["234"][2], "the nose is nearer to the camera than the ear"
    assert face["10"][1] > face["152"][1], "the forehead is above the chin"


# --- weights -------------------------------------------------------------------------------------------------------


def test_a_live_link_recording_gives_weights_with_arkit_names(tmp_path):
    random = np.random.default_rng(0)
    weights, angles = random.random((70, 52)), random.normal(size=(70, 9)) * 0.2
    recording = read_recording(write_livelink(tmp_path / "phone.csv", weights, angles, first=50))
    assert isinstance(recording, Descriptors)
    assert recording.rate == 60.0
    assert "tongueOut" not in recording.names
    assert len(recording.names) == 51
    assert recording.names[:2] == ("eyeBlinkLeft", "eyeLookDownLeft")
    np.testing.assert_allclose(recording.weights, weights[:, :51], atol=1e-8)
    yaw = np.degrees(np.arctan2(recording.head[:, 0, 2], recording.head[:, 2, 2]))
    np.testing.assert_allclose(yaw, np.degrees(angles[:, 0]), atol=1e-5)
    assert LIVELINK_BASES[-1] == "TongueOut"


def test_frames_that_the_phone_dropped_are_filled_so_that_the_rate_is_even(tmp_path):
    frames = np.delete(np.arange(130), [10, 11, 64])
    weights = np.repeat(frames[:, None] / 130.0, 52, axis=1)
    recording = read_recording(write_livelink(tmp_path / "p.csv", weights, np.zeros((127, 9)), frames=frames))
    assert recording.n_frames == 130
    assert recording.duration == pytest.approx(130 / 60)
    np.testing.assert_allclose(recording.weights[:, 0], np.arange(130) / 130.0, atol=1e-6)
    assert "filled 3 dropped frames" in " ".join(recording.history)


def test_a_phone_that_records_at_twice_the_rate_of_its_timecode_keeps_its_own_rate(tmp_path):
    weights = np.linspace(0, 1, 120)[:, None] * np.ones(52)
    file = write_livelink(tmp_path / "p.csv", weights, np.zeros((120, 9)), rate=30)
    lines = file.read_text().splitlines()
    for row in range(120):
        cells = lines[row + 1].split(",")
        second, half = divmod(row, 60)
        cells[0] = f"14:00:{second:02d}:{half // 2:02d}.{500 * (half % 2):03d}"
        lines[row + 1] = ",".join(cells)
    file.write_text("\n".join(lines))
    recording = read_recording(file)
    assert recording.rate == 60.0
    np.testing.assert_allclose(recording.weights[:, 0], weights[:, 0], atol=1e-6)


@pytest.mark.parametrize("rate", [24, 25, 30, 60])
def test_the_rate_of_a_live_link_recording_comes_from_its_timecode(rate, tmp_path):
    frames = 3 * rate
    file = write_livelink(tmp_path / "p.csv", np.zeros((frames, 52)), np.zeros((frames, 9)), rate=rate)
    recording = read_recording(file)
    assert recording.rate == rate
    assert recording.n_frames == frames


def test_a_weights_file_is_recognised_under_any_ending(tmp_path):
    weights = Descriptors(np.random.default_rng(0).random((5, 3)), ("a_x", "b", "c_z"), 50.0, start=2.0)
    for name in ("w.csv", "w.parquet"):
        write_weights(weights, tmp_path / name)
        (tmp_path / "w.txt").write_bytes((tmp_path / name).read_bytes())
        back = read_recording(tmp_path / "w.txt")
        assert isinstance(back, Descriptors)
        assert back.names == weights.names
        assert back.start == 2.0
    with pytest.raises(SignfaceError, match="holds weights, not markers"):
        read_take(tmp_path / "w.csv")


def test_any_white_space_separates_and_blank_lines_do_not_count(tmp_path):
    file = tmp_path / "rows.txt"
    file.write_text("\nNAMES\n\n  1  2 \t -  \n\n4 5 nan\n")
    for separator in (" ", None):
        rows = TextRows(TextFile(file), 1, 3, separator)
        np.testing.assert_array_equal(rows.values(0, 2), [[1, 2, np.nan], [4, 5, np.nan]])
        np.testing.assert_array_equal(rows.column(1), [2, 5])
    file.write_text("NAMES\n\n1 2 3\n\n 4  high 6\n")
    rows = TextRows(TextFile(file), 1, 3, None)
    for read in (lambda: rows.values(0, 2), lambda: rows.column(1)):
        with pytest.raises(SignfaceError, match="line 5 has a cell that is no number: 'high'"):
            read()
    file.write_text("NAMES\n1 2 3\n4 5 nan 7\n")
    with pytest.raises(SignfaceError, match="line 3 has 4 cells instead of 3"):
        TextRows(TextFile(file), 1, 3, None).values(0, 2)
    file.write_text("NAMES\n1 2  \n")
    with pytest.raises(SignfaceError, match="line 2 has 2 cells instead of 3"):
        TextRows(TextFile(file), 1, 3, None).values(0, 1)
