"""Tables as the programs of motion-capture systems and people write them, read with their labels, times and units."""

from __future__ import annotations

import numpy as np
import pytest

from signface.errors import SignfaceError, SignfaceWarning
from signface.takes.formats.registry import format_of
from signface.takes.reading import read_recording, read_take
from tests.fixtures.takes_files import write_livelink

LABELS = ("LBRO", "RBRO", "NOSE", "CHIN")
PLACES = np.random.default_rng(3).normal(0, 60, (8, len(LABELS), 3)).round(3)


def rows(before) -> list[str]:
    return [",".join([*before(n), *(f"{value:.3f}" for value in row.ravel())]) for n, row in enumerate(PLACES)]


def nexus(subject: str = "Anna:", frames=range(1, 9), *, ahead=(), behind=()) -> str:
    names = ",," + ",,,".join(f"{subject}{label}" for label in LABELS)
    header = ["Trajectories", "200", names, "Frame,Sub Frame" + ",X,Y,Z" * 4, ",," + ",".join(["mm"] * 12)]
    return "\n".join([*ahead, *header, *rows(lambda n: (str(frames[n]), "0")), *behind]) + "\n"


def motive(units: str = "Millimeters") -> str:
    types = ["Rigid Body"] * 4 + ["Marker"] * 12
    names = ["Head"] * 4 + [label for label in LABELS for _ in "xyz"]
    fields = "Format Version,1.23,Take Name,T,Capture Frame Rate,200.0,Export Frame Rate,200.0,Length Units," + units
    kinds = ["Rotation"] * 4 + ["Position"] * 12
    header = [fields, "", ",Type," + ",".join(types), ",Name," + ",".join(names), ",ID" + ",1" * 16]
    header += [",," + ",".join(kinds), "Frame,Time (Seconds),X,Y,Z,W" + ",X,Y,Z" * 4]
    return "\n".join([*header, *rows(lambda n: (str(n), f"{n / 200:.6f}", "0", "0", "0", "1"))]) + "\n"


def trc(separator: str, blanks: str) -> str:
    names = blanks.join(LABELS)
    lines = [
        f"PathFileType{separator}4{separator}(X/Y/Z){separator}a.trc",
        separator.join(["DataRate", "CameraRate", "NumFrames", "NumMarkers", "Units"]),
        separator.join(["200", "200", "8", "4", "mm"]),
        f"Frame#{separator}Time{separator}{names}",
        separator * 2 + separator.join(f"{axis}{n}" for n in range(1, 5) for axis in "XYZ"),
        "",
    ]
    lines += [row.replace(",", separator) for row in rows(lambda n: (str(n + 1), f"{n / 200:.4f}"))]
    return "\n".join(lines) + "\n"


def table(before: str) -> str:
    columns = ",".join(f"{label}_{axis}" for label in LABELS for axis in "xyz")
    return "\n".join([f"{before},time_s,{columns}", *rows(lambda n: (str(n), f"{n / 200:.4f}"))]) + "\n"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("nexus.csv", nexus("")),
        ("motive.csv", motive()),
        ("tabs.trc", trc("\t", "\t\t\t")),
        ("commas.trc", trc(",", ",,,")),
        ("commas-names-together.trc", trc(",", ",")),
        ("blanks.trc", trc("  ", "  ")),
        ("frames.csv", table("frame")),
        ("frame-numbers.csv", table("Frame Number")),
    ],
)
def test_a_table_keeps_its_markers_times_and_places(name, text, tmp_path):
    (tmp_path / name).write_text(text)
    take = read_take(tmp_path / name, unit="mm" if name.startswith("frame") else None)
    assert take.labels == LABELS
    assert (take.rate, take.start, take.n_frames) == (200.0, 0.0, 8)
    np.testing.assert_allclose(take.positions, PLACES, atol=1e-9)


def test_metres_of_motive_become_millimetres(tmp_path):
    (tmp_path / "take.csv").write_text(motive("Meters"))
    with pytest.warns(SignfaceWarning, match="too large for a face"):  # the numbers are those of millimetres
        take = read_take(tmp_path / "take.csv")
    np.testing.assert_allclose(take.positions, 1000 * PLACES, atol=1e-6)


def test_frames_that_nexus_left_out_are_gaps_and_the_first_gives_the_start(tmp_path):
    (tmp_path / "take.csv").write_text(nexus("", (101, 102, 103, 104, 107, 108, 109, 110)))
    take = read_take(tmp_path / "take.csv")
    assert take.n_frames == 10
    assert take.start == pytest.approx(0.5)
    assert np.isnan(take.positions[4:6]).all()
    np.testing.assert_allclose(take.positions[6:], PLACES[4:], atol=1e-9)


def test_sections_of_nexus_before_the_trajectories_are_passed_over_and_later_ones_refused(tmp_path):
    outputs = ("Model Outputs", "200", ",,Anna:Angle,,", "Frame,Sub Frame,X,Y,Z", ",,deg,deg,deg", "1,0,1,2,3", "")
    (tmp_path / "take.csv").write_text(nexus("", ahead=outputs))
    assert read_take(tmp_path / "take.csv").labels == LABELS
    (tmp_path / "take.csv").write_text(nexus("", behind=("", *outputs)))
    with pytest.raises(SignfaceError, match="a section model outputs after the trajectories"):
        read_take(tmp_path / "take.csv")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("a.tak", "Motive's own take. Export C3D"),
        ("a.MP4", "is a film. Track"),
        ("a.bvh", "skeleton"),
        ("a.xlsx", "CSV"),
    ],
)
def test_what_is_not_read_is_named_with_what_to_export(name, said, tmp_path):
    (tmp_path / name).write_bytes(b"\0\1\2\3 something of a program")
    with pytest.raises(SignfaceError) as error:
        format_of(tmp_path / name)
    assert said in str(error.value)


@pytest.mark.parametrize("rate", [10, 12, 15, 20])
def test_a_slow_phone_keeps_its_rate(rate, tmp_path):
    weights = np.repeat(np.linspace(0, 1, 3 * rate)[:, None], 52, axis=1)
    recording = write_livelink(tmp_path / "p.csv", weights, np.zeros((3 * rate, 9)), rate=rate)
    found = read_recording(recording)
    assert (found.rate, found.n_frames) == (rate, 3 * rate)
    np.testing.assert_allclose(found.weights[:, 0], weights[:, 0], atol=1e-6)


def test_a_phone_that_lost_the_last_frames_of_a_second_keeps_its_usual_rate(tmp_path):
    frames = np.delete(np.arange(90), [58, 59])
    weights = np.repeat(frames[:, None] / 90.0, 52, axis=1)
    found = read_recording(write_livelink(tmp_path / "p.csv", weights, np.zeros((88, 9)), frames=frames))
    assert (found.rate, found.n_frames) == (60.0, 90)


def test_a_phone_records_past_midnight(tmp_path):
    weights = np.repeat(np.linspace(0, 1, 120)[:, None], 52, axis=1)
    file = write_livelink(tmp_path / "p.csv", weights, np.zeros((120, 9)))
    lines = file.read_text().splitlines()
    for row in range(120):
        second, frame = divmod(row, 60)
        code = f"{'23:59:59' if second == 0 else '00:00:00'}:{frame:02d}.000"
        lines[row + 1] = ",".join([code, *lines[row + 1].split(",")[1:]])
    file.write_text("\n".join(lines))
    found = read_recording(file)
    assert (found.rate, found.n_frames) == (60.0, 120)
    np.testing.assert_allclose(found.weights[:, 0], weights[:, 0], atol=1e-6)
