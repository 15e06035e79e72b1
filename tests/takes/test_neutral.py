"""The neutral frame is found where the face rests."""

import numpy as np
import pytest

from signface.errors import SignfaceError
from signface.takes.neutral import find_neutral
from signface.takes.take import Take
from tests.fixtures.takes_files import HEAD, moving_face, with_gaps

RATE = 100.0


def expressions(rests, *, motion=1.0, jitter=0.1, start=0.0, seed=0):
    """Twenty seconds in which the face rests during `rests` (seconds) and else shows one of several expressions."""
    random = np.random.default_rng(seed)
    take, _ = moving_face(20.0, RATE, expression=0.0, motion=motion, start=start, seed=seed)
    _, poses = moving_face(20.0, RATE, expression=0.0, motion=motion, seed=seed)
    time = np.arange(take.n_frames) / RATE
    rest = np.zeros(take.n_frames)
    for begin, end in rests:
        inside = np.minimum(time - begin, end - time)
        rest = np.maximum(rest, np.clip(inside / 0.15 + 0.5, 0, 1))
    displacement = np.zeros_like(take.positions)
    for number, begin in enumerate(np.arange(0, 20, 2.5)):
        own = (time >= begin) & (time < begin + 2.5)
        held = random.normal(size=(20, 3)) * 4
        wobble = 1 + 0.2 * np.sin(2 * np.pi * 1.5 * time[own] + number)
        displacement[own, :20] = ((1 - rest[own]) * wobble)[:, None, None] * held
    turned = np.einsum("fij,fmj->fmi", poses[:, :3, :3], displacement)
    positions = take.positions + turned + random.normal(size=take.positions.shape) * jitter
    return Take(positions, take.labels, RATE, start=start)


RESTS = [(2.0, 3.0), (4.7, 5.3), (9.2, 11.8), (14.6, 15.4)]


@pytest.mark.parametrize("motion", [0.0, 1.0])
@pytest.mark.parametrize("head", [None, HEAD])
@pytest.mark.parametrize("start", [0.0, 7.5])
def test_the_neutral_frame_lies_in_a_rest(motion, head, start):
    take = expressions(RESTS, motion=motion, start=start)
    skin = take.labels[:20]
    found = find_neutral(take, skin, head=head) - start
    assert any(begin <= found <= end for begin, end in RESTS)


def test_the_longest_of_several_rests_is_taken():
    take = expressions(RESTS)
    assert 9.2 <= find_neutral(take, head=HEAD) <= 11.8


def test_the_time_found_is_a_frame_of_the_take():
    take = expressions(RESTS, start=2.0)
    assert 0 <= take.frame_at(find_neutral(take)) < take.n_frames


def test_frames_with_few_markers_are_not_neutral():
    take = with_gaps(expressions(RESTS), {number: (900, 1200) for number in range(15)})
    found = find_neutral(take, head=HEAD)
    assert not 9.0 <= found < 12.0


def test_frames_that_lack_a_head_marker_are_not_neutral_while_others_show_them_all():
    take = with_gaps(expressions(RESTS), {22: (800, 1300)})
    found = find_neutral(take, head=HEAD)
    assert not 8.0 <= found < 13.0
    assert any(begin <= found <= end for begin, end in RESTS)


def test_a_take_of_one_frame_is_its_own_neutral():
    take, _ = moving_face(1.0, 50.0)
    assert find_neutral(Take(take.positions[:1], take.labels, 50.0, start=4.0)) == 4.0


def test_a_take_that_never_shows_three_markers_is_refused():
    take, _ = moving_face(1.0, 50.0)
    empty = Take(np.full_like(take.positions, np.nan), take.labels, 50.0)
    with pytest.raises(SignfaceError, match="no frame shows three markers"):
        find_neutral(empty)


def test_a_real_signer_has_a_neutral_frame(signer_pose):
    from signface.takes.reading import read_take

    take = read_take(signer_pose)
    assert 0 <= take.frame_at(find_neutral(take)) < 130
