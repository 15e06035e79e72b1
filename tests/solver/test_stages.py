"""The solver's stages keep the laws of stages: pieces give what memory gives, and no frame waits for another."""

import numpy as np
import pytest

from signface.face.layout_files import read_layout
from signface.solver.creep import Creep
from signface.solver.displacements import NEUTRAL_WINDOW_S, Displacements, neutral_places
from signface.solver.preparation import Preparation
from signface.takes.reading import read_take
from signface.takes.recording import pieces
from signface.takes.stabilisation import HeadMotion, NeutralAlignment
from signface.takes.stages import Block, View, block_of

NEUTRAL_S = 0.33


@pytest.fixture(scope="module")
def layout(face):
    return read_layout("default-40", face)


@pytest.fixture(scope="module")
def still(mini, face, layout):
    """The view of a take without head motion."""
    take = read_take(mini.takes[1].path)
    return View(take).through(
        NeutralAlignment(layout.face_labels, layout.points(face), NEUTRAL_S),
        HeadMotion(layout.head_labels, neutral_s=NEUTRAL_S),
    )


@pytest.fixture(scope="module", params=["similarity", "rbf"])
def row(request, still, face, layout):
    """The two stages, learnt, and the view behind them."""
    stages = (
        Displacements(layout.face_labels, face, layout, kind=request.param, neutral_s=NEUTRAL_S),
        Creep(face, layout),
    )
    return stages, still.through(*stages)


@pytest.mark.parametrize("length", [7, 250, 1024])
def test_displacements_in_pieces_are_those_in_memory(length, row):
    recording = row[1].recording
    whole = block_of(recording, 0, recording.n_frames)
    parts = [block_of(recording, begin, end) for begin, end in pieces(recording.n_frames, length)]
    for field in ("positions", "head"):
        joined = np.concatenate([getattr(part, field) for part in parts])
        np.testing.assert_allclose(joined, getattr(whole, field), rtol=0, atol=1e-9)


def test_their_reach_is_true(row, still):
    stages, _ = row
    block = block_of(still.recording, 0, 400)
    other = block.positions.copy()
    other[200] += np.random.default_rng(0).normal(0, 5, other[200].shape)
    for stage in stages:
        assert stage.causal
        after, before = stage.apply(block.changed(other)), stage.apply(block)
        others = np.arange(400) != 200
        np.testing.assert_array_equal(after.positions[others], before.positions[others])
        assert not np.array_equal(after.positions[200], before.positions[200])
        alone = stage.apply(Block(block.positions[200:201], range(200, 201)))
        np.testing.assert_allclose(alone.positions[0], before.positions[200], rtol=0, atol=1e-10)
        block, other = before, after.positions


def test_creep_learns_the_same_from_all_frames_and_from_some(row, still, face, layout):
    """A view that knows every fifth frame, as of a long recording, and one that knows all."""
    (displacements, creep), _ = row
    frames = still.recording.n_frames
    spread = block_of(still.recording, 0, frames, 5)
    some = View(still.recording, Block(spread.positions, spread.frames)).through(displacements)
    other = Creep(face, layout)
    other.learn(some)
    assert some.rate == still.recording.rate / 5
    assert other.size_mm == pytest.approx(creep.size_mm, abs=1e-9)
    numbers = np.arange(0, frames / 40, 0.3)
    np.testing.assert_allclose(other.at(numbers), creep.at(numbers), rtol=0, atol=1e-9)


def test_neutral_places_are_medians_of_what_is_seen(mini):
    take = read_take(mini.takes[1].path)
    half = int(NEUTRAL_WINDOW_S * take.rate)
    positions = take.positions.copy()
    positions[100 - half : 100 + half + 1, 4] = np.nan
    positions[100, 5] = 1e4  # one frame's jitter
    seen, places = neutral_places(take.changed("cut", positions=positions), take.labels[3:6], 100 / take.rate)
    assert seen == (take.labels[3], take.labels[5])
    np.testing.assert_allclose(places[0], np.median(take.positions[100 - half : 100 + half + 1, 3], axis=0))
    assert np.linalg.norm(places[1] - take.positions[100, 5]) < 1.0


def test_a_preparation_is_its_stages_one_after_the_other(mini, face, layout):
    take = read_take(mini.takes[1].path)
    preparation = Preparation(take, face, layout, piece=500)
    block = Block(take.positions, range(take.n_frames))
    for stage in preparation.stages:
        block = stage.apply(block)
    displacements, head = preparation.frames(0, take.n_frames)
    np.testing.assert_allclose(block.positions, displacements, rtol=0, atol=1e-9)
    np.testing.assert_allclose(block.head, head, rtol=0, atol=1e-9)
    assert [type(stage).__name__ for stage in preparation.stages if not stage.causal] == [
        "MarkerCheck",
        "GapFiller",
        "Lowpass",
        "HeadMotion",
    ]
