"""Laws of stages: the way frames are asked for changes nothing, and no stage looks further than it says."""

import numpy as np
import pytest

from signface.errors import SignfaceError
from signface.face.layout_files import read_layout
from signface.takes.cleaning import Kept, cleaning_stages
from signface.takes.filtering import Lowpass, lowpass
from signface.takes.formats.c3d import open_c3d, write_c3d
from signface.takes.formats.table import write_table
from signface.takes.gaps import GapFiller, fill_gaps
from signface.takes.labels import Renaming, rename_to
from signface.takes.marker_check import MarkerCheck
from signface.takes.reading import open_recording, read_take
from signface.takes.recording import pieces
from signface.takes.stabilisation import HeadMotion, NeutralAlignment, align_neutral, stabilise
from signface.takes.stages import Block, Stage, View, block_of, run
from signface.takes.take import Take

NEUTRAL_S = 0.33


@pytest.fixture(scope="module")
def layout(face):
    return read_layout("default-40", face)


@pytest.fixture(scope="module")
def gappy(mini, layout):
    """A take of 600 frames with gaps of all kinds, wrong markers, and a head that is out of sight for a while."""
    take = read_take(mini.takes[1].path)
    positions = take.positions[:600].copy()
    for marker, begin, end in ((3, 0, 40), (5, 195, 203), (7, 330, 400), (11, 420, 560), (20, 570, 600)):
        positions[begin:end, marker] = np.nan
    positions[100:160, [0, 2]] = positions[100:160, [2, 0]]  # swapped
    positions[[222, 223, 584], 12] += (9.0, 40.0, 9.0)  # ghosts
    positions[350:420, 14] = positions[350, 14]  # frozen
    heads = [take.labels.index(label) for label in layout.head_labels if label in take.labels]
    positions[250:270, heads[:4]] = np.nan  # bridged
    positions[450:530, heads] = np.nan  # blind for longer than is bridged
    return take.changed("gaps cut", positions=positions)


@pytest.fixture
def stages(face, layout):
    """One of each, unlearnt, by name."""
    return {
        "names": Renaming(layout.labels),
        "check": MarkerCheck(),
        "gaps": GapFiller(),
        "butterworth": Lowpass(),
        "raised-sine": Lowpass(method="raised-sine"),
        "no filter": Lowpass(cutoff_hz=99.0),
        "alignment": NeutralAlignment(layout.face_labels, layout.points(face), NEUTRAL_S),
        "head motion": HeadMotion(layout.head_labels, neutral_s=NEUTRAL_S),
    }


STAGES = ["names", "check", "gaps", "butterworth", "raised-sine", "no filter", "alignment", "head motion"]


def in_pieces(recording, length):
    """All frames of a recording and the head's poses, asked for in pieces."""
    blocks = [block_of(recording, begin, end) for begin, end in pieces(recording.n_frames, length)]
    heads = [block.head for block in blocks]
    return np.concatenate([block.positions for block in blocks]), None if heads[0] is None else np.concatenate(heads)


@pytest.mark.slow
@pytest.mark.parametrize("name", STAGES)
@pytest.mark.parametrize("length", [1, 7, 83, 250, 599])
def test_a_stage_in_pieces_of_any_length_is_the_stage_in_memory(name, length, stages, gappy):
    if name == "raised-sine" and length < 83:
        pytest.skip("every piece costs the whole take")
    whole = run(gappy, stages[name])
    view = View(gappy).through(stages[name])
    positions, _ = in_pieces(view.recording, length)
    np.testing.assert_allclose(positions, whole.positions, rtol=0, atol=1e-9)
    assert view.recording.history == whole.history
    assert view.recording.labels == whole.labels


@pytest.mark.parametrize("length", [61, 250, 10000])
def test_a_row_of_stages_in_pieces_is_the_script_functions_one_after_the_other(length, gappy, face, layout, tmp_path):
    points = layout.points(face)
    script = lowpass(fill_gaps(rename_to(gappy, layout.labels)))
    script = align_neutral(script, layout.face_labels, points, NEUTRAL_S)
    script, poses = stabilise(script, head=layout.head_labels, neutral_s=NEUTRAL_S)
    row = (
        Renaming(layout.labels),
        GapFiller(),
        Lowpass(),
        NeutralAlignment(layout.face_labels, points, NEUTRAL_S),
        HeadMotion(layout.head_labels, neutral_s=NEUTRAL_S),
    )
    staged = View(gappy).through(*row).recording
    positions, head = in_pieces(staged, length)
    np.testing.assert_allclose(positions, script.positions, rtol=0, atol=1e-9)
    np.testing.assert_allclose(head, poses, rtol=0, atol=1e-9)
    assert staged.history == script.history


def test_a_file_behind_stages_is_the_take_behind_them(gappy, layout, tmp_path):
    write_c3d(gappy, tmp_path / "take.c3d")
    in_memory = read_take(tmp_path / "take.c3d")
    clean = View(open_c3d(tmp_path / "take.c3d")).through(*cleaning_stages(layout.labels)).recording
    expected = lowpass(fill_gaps(rename_to(in_memory, layout.labels)))
    np.testing.assert_allclose(in_pieces(clean, 170)[0], expected.positions, rtol=0, atol=1e-9)
    assert clean.history == expected.history


def perturbed(positions, frame, rng):
    """The positions with a frame's markers moved by up to a centimetre, one of them gone and a missing one back."""
    other = positions.copy()
    other[frame] += rng.uniform(-10, 10, other[frame].shape)
    other[frame, rng.integers(0, other.shape[1])] = np.nan
    gone = np.flatnonzero(np.isnan(positions[frame, :, 0]))
    other[frame, gone[:1]] = 100.0
    return other


@pytest.mark.parametrize("name", STAGES)
def test_no_stage_looks_further_than_its_reach(name, stages, gappy):
    stage = stages[name]
    View(gappy).through(stage)
    everything = Block(gappy.positions, range(gappy.n_frames))
    before = stage.apply(everything)
    rng = np.random.default_rng(5)
    for frame in (0, 199, 260, 380, 500, 599):
        after = stage.apply(everything.changed(perturbed(gappy.positions, frame, rng)))
        distance = np.abs(np.arange(gappy.n_frames) - frame)
        beyond = distance > (gappy.n_frames if stage.reach is None else stage.reach)
        np.testing.assert_allclose(after.positions[beyond], before.positions[beyond], rtol=0, atol=1e-10)
        if after.head is not None:
            np.testing.assert_allclose(after.head[beyond], before.head[beyond], rtol=0, atol=1e-10)


@pytest.mark.parametrize(("name", "markers"), [("gaps", [7]), ("butterworth", [0]), ("head motion", [0])])
def test_a_reach_is_needed(name, markers, stages, gappy):
    """Stages that say they look beside a frame do: a block without the frames beside it comes out otherwise."""
    stage = stages[name]
    View(gappy).through(stage)
    assert not stage.causal
    whole = stage.apply(Block(gappy.positions, range(gappy.n_frames))).positions
    for begin, end in ((350, 380), (255, 265)):
        alone = stage.apply(Block(gappy.positions[begin:end], range(begin, end))).positions
        if not np.allclose(alone[:, markers], whole[begin:end, markers], rtol=0, atol=1e-6, equal_nan=True):
            return
    pytest.fail("nothing depends on the frames beside a block")


def test_stages_that_wait_for_no_frame_work_frame_by_frame(stages, gappy):
    for name in ("names", "alignment", "no filter"):
        stage = stages[name]
        whole = run(gappy, stage)
        assert stage.causal
        for frame in (0, 300, 599):
            block = Block(gappy.positions[frame : frame + 1], range(frame, frame + 1))
            np.testing.assert_allclose(stage.apply(block).positions[0], whole.positions[frame], rtol=0, atol=1e-12)


@pytest.mark.parametrize("step", [2, 7, 40])
def test_spread_frames_are_those_of_the_whole(step, gappy, layout):
    whole = lowpass(fill_gaps(rename_to(gappy, layout.labels)))
    staged = View(gappy).through(Renaming(layout.labels), GapFiller(), Lowpass()).recording
    for begin, end in ((0, 600), (13, 577)):
        np.testing.assert_allclose(staged.frames(begin, end, step), whole.positions[begin:end:step], rtol=0, atol=1e-9)


def test_asking_twice_counts_once(stages, gappy):
    for name in ("check", "gaps", "head motion"):
        staged = View(gappy).through(stages[name]).recording
        staged.frames(0, gappy.n_frames)
        history = staged.history
        for begin, end in ((200, 460), (0, 600), (251, 252)):
            staged.frames(begin, end)
        assert staged.history == history


def test_frames_asked_for_again_cost_nothing(gappy):
    class Counted(Stage):
        note = "counted"
        blocks = 0

        def apply(self, block):
            self.blocks += 1
            return block

    stage = Counted()
    kept = Kept(View(gappy).through(stage).recording)
    first = kept.frames(100, 500)
    np.testing.assert_array_equal(kept.frames(150, 450, 3), gappy.positions[150:450:3])
    assert stage.blocks == 1
    with pytest.raises(ValueError, match="read-only"):
        first[0] = 0.0
    kept.frames(99, 101)
    assert stage.blocks == 2


def test_parameters_are_checked_before_anything_is_read():
    for wrong in (
        lambda: GapFiller(short_s=-1.0),
        lambda: Lowpass(cutoff_hz=0.0),
        lambda: Lowpass(method="magic"),
        lambda: HeadMotion(["a"], neutral_s=0.0, fallback="hope"),
    ):
        with pytest.raises(SignfaceError):
            wrong()


def test_stages_leave_what_they_are_given_untouched(stages, gappy):
    for stage in stages.values():
        given = Take(gappy.positions, gappy.labels, gappy.rate)
        run(given, stage)
        np.testing.assert_array_equal(given.positions, gappy.positions)


def test_frames_beyond_the_ends_are_left_out_by_every_recording(gappy, stages, tmp_path):
    write_c3d(gappy, tmp_path / "take.c3d")
    write_table(gappy, tmp_path / "take.csv")
    files = [open_recording(tmp_path / name, unit="mm") for name in ("take.c3d", "take.csv")]
    behind = [View(gappy).through(stage).recording for stage in stages.values()]
    cuts = [file.between(0.5, 2.5) for file in files]
    for recording in (gappy, *files, *cuts, *behind, Kept(behind[1])):
        last, markers = recording.n_frames, len(recording.labels)
        np.testing.assert_array_equal(recording.frames(last - 5, last + 70), recording.frames(last - 5, last))
        np.testing.assert_array_equal(recording.frames(-7, 3), recording.frames(0, 3))
        np.testing.assert_array_equal(recording.frames(last - 9, last + 70, 4), recording.frames(last - 9, last, 4))
        for begin, end in ((100_000, 100_200), (-20, -10), (last, last + 1), (30, 20)):
            assert recording.frames(begin, end).shape == (0, markers, 3)
