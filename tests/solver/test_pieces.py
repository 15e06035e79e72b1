"""A recording solved piece by piece: the same weights, little memory, and a whole file or none."""

import tracemalloc

import numpy as np
import pytest

from signface.cli.main import main
from signface.descriptors import Descriptors
from signface.descriptors_files import WeightsWriter, read_weights, write_weights
from signface.errors import SignfaceError
from signface.face.layout_files import read_layout
from signface.settings.solve import SolveSettings
from signface.solver import preparation
from signface.solver.newton import SLIP_TOLERANCE
from signface.solver.solving import solve, solve_pieces
from signface.takes import gaps
from signface.takes.cleaning import Kept, cleaning_stages
from signface.takes.filtering import lowpass
from signface.takes.formats.c3d import open_c3d, write_c3d
from signface.takes.formats.table import open_table, write_table
from signface.takes.gaps import fill_gaps
from signface.takes.labels import rename_to
from signface.takes.reading import read_take
from signface.takes.stages import View
from signface.takes.take import Take


@pytest.fixture(scope="module")
def layout(face):
    return read_layout("default-40", face)


@pytest.fixture(scope="module")
def gappy(mini):
    """A take of 1,195 frames with gaps of all kinds: short, carried, longer than pieces, of the head, at the ends."""
    take = read_take(mini.takes[1].path)
    positions = take.positions.copy()
    for marker, begin, end in (
        (3, 0, 40),  # at the beginning
        (5, 195, 203),  # short, over the boundaries of pieces of 200
        (7, 390, 460),  # from the neighbours
        (11, 500, 900),  # longer than some pieces
        (20, 1150, 1195),  # at the end
    ):
        positions[begin:end, marker] = np.nan
    heads = [take.labels.index(label) for label in take.labels if label in ("LFHD", "RFHD")] or [40, 41, 42, 43]
    positions[595:620, heads] = np.nan
    positions[700:780, 40:46] = np.nan  # blind for longer than is bridged
    return take.changed("gaps cut", positions=positions)


def cleaned(recording, layout):
    return Kept(View(recording).through(*cleaning_stages(layout.labels)).recording)


def joined(parts, field):
    return np.concatenate([getattr(part, field) for part in parts])


@pytest.mark.slow
@pytest.mark.parametrize("piece", [333])
def test_pieces_give_the_weights_of_the_whole(piece, gappy, face, layout):
    whole = solve(gappy, face, layout)
    parts = list(solve_pieces(gappy, face, layout, piece=piece))
    assert [part.n_frames for part in parts][:-1] == [piece] * (len(parts) - 1)
    # The solver starts each frame from the one before, and ends when the gradient is below 1e-8. Where markers slip,
    # each round hands its rounding on to the next, and ends when no weight changes by more than the tolerance.
    for field, tolerance, slipping in (
        ("weights", 2e-8, SLIP_TOLERANCE),
        ("residual", 2e-8, SLIP_TOLERANCE),
        ("head", 1e-6, 1e-6),
    ):
        difference = np.abs(joined(parts, field) - getattr(whole, field))
        assert difference.max() < slipping
        assert np.quantile(difference, 0.99) < tolerance
    np.testing.assert_allclose(np.concatenate([part.time for part in parts]), whole.time, rtol=0, atol=1e-9)
    assert parts[-1].history == whole.history


def test_cleaning_in_pieces_is_cleaning_the_take(gappy, layout):
    whole = lowpass(fill_gaps(rename_to(gappy, layout.labels)))
    clean = cleaned(gappy, layout)
    parts = [clean.frames(begin, min(begin + 170, gappy.n_frames)) for begin in range(0, gappy.n_frames, 170)]
    np.testing.assert_allclose(np.concatenate(parts), whole.positions, rtol=0, atol=1e-9)
    assert clean.history == whole.history


@pytest.mark.slow
def test_a_filter_that_needs_the_whole_take_gets_it(gappy, face, layout):
    options = {"settings": SolveSettings(neutral=0.33, filter_method="raised-sine")}
    whole = solve(gappy, face, layout, **options)
    parts = list(solve_pieces(gappy, face, layout, piece=611, **options))
    np.testing.assert_allclose(joined(parts, "weights"), whole.weights, rtol=0, atol=SLIP_TOLERANCE)


def test_files_are_read_in_the_same_pieces_as_takes(gappy, tmp_path):
    write_c3d(gappy, tmp_path / "take.c3d")
    write_table(gappy, tmp_path / "take.csv")
    for recording in (open_c3d(tmp_path / "take.c3d"), open_table(tmp_path / "take.csv")):
        whole = recording.whole()
        np.testing.assert_allclose(whole.positions, gappy.positions, rtol=1e-6, atol=1e-5)
        np.testing.assert_array_equal(recording.frames(100, 300), whole.positions[100:300])
        np.testing.assert_array_equal(recording.frames(7, 1195, 100), whole.positions[7:1195:100])


@pytest.mark.slow
def test_memory_does_not_grow_with_the_recording(gappy, face, layout, tmp_path, monkeypatch):
    monkeypatch.setattr(preparation, "VIEW_FRAMES", 500)
    monkeypatch.setattr(gaps, "SAMPLE_FRAMES", 100)
    solve(gappy, face, layout, settings=SolveSettings(neutral=0.33))  # what is computed once for a face
    recordings = {}
    for repeats in (4, 12):
        positions = np.tile(gappy.positions, (repeats, 1, 1))
        write_c3d(Take(positions, gappy.labels, gappy.rate), tmp_path / f"{repeats}.c3d")
        recordings[repeats] = open_c3d(tmp_path / f"{repeats}.c3d"), positions.nbytes
    del positions
    tracemalloc.start()
    recording, size = recordings[12]
    cleaned(recording, layout).glance(500, piece=600)
    assert tracemalloc.get_traced_memory()[1] < 0.7 * size
    recording, size = recordings[4]
    solved = solve_pieces(recording, face, layout, settings=SolveSettings(neutral=0.33), piece=300)
    held = [tracemalloc.get_traced_memory()[0] for _ in solved]
    tracemalloc.stop()
    assert len(held) == 16
    assert held[-1] - held[0] < 0.1 * size


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_a_file_written_in_pieces_reads_as_one_written_at_once(ending, tmp_path):
    random = np.random.default_rng(0)
    weights, residual = random.random((1000, 3)), random.random(1000)
    weights[5] = residual[5] = np.nan
    whole = Descriptors(weights, ("a", "b", "c"), 60.0, start=1.5, residual=residual)
    write_weights(whole, tmp_path / f"whole{ending}")
    with WeightsWriter(tmp_path / f"pieces{ending}") as writer:
        for begin in range(0, 1000, 300):
            own = slice(begin, begin + 300)
            start = 1.5 + begin / 60
            writer.append(Descriptors(weights[own], ("a", "b", "c"), 60.0, start=start, residual=residual[own]))
    one, other = (read_weights(tmp_path / f"{name}{ending}") for name in ("whole", "pieces"))
    np.testing.assert_array_equal(one.weights, other.weights)
    np.testing.assert_array_equal(one.time, other.time)
    if ending == ".csv":
        assert (tmp_path / "whole.csv").read_bytes() == (tmp_path / "pieces.csv").read_bytes()


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_a_solve_that_is_interrupted_leaves_the_file_that_was_there(ending, tmp_path):
    target = tmp_path / f"weights{ending}"
    target.write_text("mine")
    piece = Descriptors(np.zeros((10, 2)), ("a", "b"), 50.0)
    other = Descriptors(np.zeros((10, 2)), ("a", "c"), 50.0)

    def interrupted():
        yield piece
        raise KeyboardInterrupt

    def write(pieces):
        with WeightsWriter(target) as writer:
            for own in pieces:
                writer.append(own)

    with pytest.raises(KeyboardInterrupt):
        write(interrupted())
    with pytest.raises(SignfaceError, match="different bases"):
        write([piece, other])
    with pytest.raises(SignfaceError, match="no weights"):
        write([])
    assert target.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [target]


def test_a_recording_damaged_in_the_middle_leaves_no_file(gappy, tmp_path, capsys):
    write_table(gappy, tmp_path / "take.csv")
    lines = (tmp_path / "take.csv").read_text().splitlines()
    cells = lines[900].split(",")
    cells[40] = "words"
    lines[900] = ",".join(cells)
    (tmp_path / "take.csv").write_text("\n".join(lines) + "\n")
    assert main(["solve", str(tmp_path / "take.csv"), "-o", str(tmp_path / "weights.csv")]) == 2
    assert "take.csv: line 901 has a cell that is no number: 'words'" in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["take.csv"]
