"""Ghosts, swapped, misnamed, doubled and frozen markers are found and mended; what a face does is none of them."""

import time

import numpy as np
import pytest

from signface.face.layout_files import read_layout
from signface.takes.marker_check import check_markers, summary
from signface.takes.reading import read_take
from signface.takes.take import Take
from tests.fixtures.takes_files import moving_face


@pytest.fixture(scope="module", params=[1, 3])
def take(request, mini):
    return read_take(mini.takes[request.param].path)


@pytest.fixture(scope="module")
def known(face):
    layout = read_layout("default-40", face)
    return dict(zip(layout.labels, layout.points(face, layout.labels), strict=True))


def spoiled(take, *changes):
    """The take with `change(positions, column of a label)` done to it."""
    positions = take.positions.copy()
    for change in changes:
        change(positions, take.labels.index)
    return Take(positions, take.labels, take.rate, take.start)


def moved(label, frames, by):
    def change(positions, column):
        positions[frames, column(label)] += by

    return change


def exchanged(labels, frames, turn=1):
    def change(positions, column):
        columns = [column(label) for label in labels]
        positions[frames, columns] = positions[frames, columns[turn:] + columns[:turn]]

    return change


STRETCH = slice(400, 700)


def assert_mended(mended, take, lost):
    """Every marker is where it was, or missing; so many points were lost."""
    both = np.isfinite(mended.positions)
    np.testing.assert_array_equal(mended.positions[both], take.positions[both])
    assert np.isnan(mended.positions[..., 0]).sum() - np.isnan(take.positions[..., 0]).sum() == lost


@pytest.mark.parametrize(
    ("label", "frames", "by"),
    [
        ("LIPUM", 500, (300, 200, 100)),
        ("LIPUM", [500, 501, 502], (6, 6, 0)),
        ("HEADF", 500, (30, 60, 0)),
        ("CHINM", slice(500, 503), (0, 0, 60)),
        ("HEADB", slice(500, 900), (130, 60, 0)),
        ("RBROM", slice(0, 3), (0, 30, 0)),
    ],
)
def test_a_ghost_becomes_a_gap(take, label, frames, by):
    mended, found = check_markers(spoiled(take, moved(label, frames, by)))
    lost = np.isfinite(take.positions[frames, take.labels.index(label), 0]).sum()
    assert_mended(mended, take, lost)
    assert [(one.kind, one.markers, one.done) for one in found] == [("ghost", (label,), "left out")]
    first = np.atleast_1d(np.arange(take.n_frames)[frames])
    assert (found[0].start_s, found[0].end_s) == pytest.approx((first[0] / take.rate, first[-1] / take.rate))


@pytest.mark.parametrize(
    "labels",
    [("LBROI", "LBROM"), ("HEADL", "HEADR"), ("HEADF", "HEADB"), ("LIPUM", "LIPDM"), ("LBROI", "LBROM", "LBROO")],
)
@pytest.mark.parametrize("frames", [STRETCH, slice(400, 401)])
def test_swapped_markers_are_swapped_back(take, labels, frames):
    mended, found = check_markers(spoiled(take, exchanged(labels, frames)))
    assert_mended(mended, take, 0)
    assert [(one.kind, set(one.markers), one.done) for one in found] == [("swapped", set(labels), "swapped back")]
    assert found[0].start_s == pytest.approx(400 / take.rate)


@pytest.mark.parametrize("frames", [slice(300, None), slice(None)])
def test_who_is_wrong_for_most_of_a_take_is_told_by_the_layout(take, known, frames):
    mended, found = check_markers(spoiled(take, exchanged(("LIPUM", "LIPDM"), frames)), known)
    assert_mended(mended, take, 0)
    assert [one.kind for one in found] == ["swapped"]
    assert found[0].end_s == pytest.approx((take.n_frames - 1) / take.rate)


def test_a_frozen_marker_is_left_out(take):
    def frozen(positions, column):
        positions[STRETCH, column("LBROI")] = positions[400, column("LBROI")]

    mended, found = check_markers(spoiled(take, frozen))
    assert_mended(mended, take, 300)
    assert [(one.kind, one.markers) for one in found] == [("frozen", ("LBROI",))]


def test_a_marker_in_the_place_of_a_missing_neighbour_is_left_out(take):
    def misnamed(positions, column):
        positions[STRETCH, column("LBROI")] = positions[STRETCH, column("LBROM")]
        positions[STRETCH, column("LBROM")] = np.nan

    mended, found = check_markers(spoiled(take, misnamed))
    assert_mended(mended, take, 600)
    assert [(one.kind, one.markers) for one in found] == [("misnamed", ("LBROI",))]


def test_a_marker_in_the_place_of_a_neighbour_is_left_out(take):
    def doubled(positions, column):
        positions[STRETCH, column("LBROI")] = positions[STRETCH, column("LBROM")]

    mended, found = check_markers(spoiled(take, doubled))
    assert_mended(mended, take, 300)
    assert [(one.kind, one.markers) for one in found] == [("doubled", ("LBROI",))]


def test_several_faults_at_once_are_told_apart(take):
    def frozen(positions, column):
        positions[600:640, column("LBROI")] = positions[600, column("LBROI")]

    wrong = spoiled(take, exchanged(("HEADL", "HEADR"), STRETCH), moved("LIPUM", 450, 50), frozen)
    mended, found = check_markers(wrong)
    assert_mended(mended, take, 41)
    assert [one.kind for one in found] == ["swapped", "ghost", "frozen"]
    assert mended.history[-1] == f"check_markers: {summary(found)}"


def test_where_many_markers_are_wrong_nothing_is_done_and_it_is_said(take):
    def scattered(positions, column):
        positions[400:410, :20] += np.random.default_rng(0).normal(size=(10, 20, 3)) * 200

    wrong = spoiled(take, scattered)
    mended, found = check_markers(wrong)
    np.testing.assert_array_equal(mended.positions, wrong.positions)
    assert [str(one) for one in found] == ["many markers wrong 2.000 to 2.045 s (left as they are)"]


def test_nothing_is_found_in_takes_where_nothing_is_wrong(mini, known):
    for entry in mini.takes:
        take = read_take(entry.path)
        mended, found = check_markers(take, known)
        assert found == []
        np.testing.assert_array_equal(mended.positions, take.positions)
        assert mended.history[-1] == "check_markers: nothing wrong"


@pytest.mark.parametrize("rate", [25.0, 60.0, 200.0])
@pytest.mark.parametrize("jitter", [0.0, 1.0, 2.5])
@pytest.mark.parametrize("step", [None, 1.0])
def test_jitter_of_a_tracker_and_whole_pixels_are_no_faults(rate, jitter, step):
    take, _ = moving_face(10.0, rate, jitter=jitter)
    positions = take.positions if step is None else np.round(take.positions / step) * step
    assert check_markers(Take(positions, take.labels, rate))[1] == []


def test_a_face_that_does_not_move_is_not_frozen(mini):
    take = read_take(mini.takes[1].path)
    still = Take(np.repeat(take.positions[:1], 400, axis=0), take.labels, take.rate)
    assert check_markers(still)[1] == []


def test_markers_of_a_head_that_is_held_still_are_not_frozen_and_filled_ones_are(take, face):
    heads = [label for label in take.labels if label.startswith("HEAD")]

    layout = read_layout("default-40", face)
    rest = np.repeat(layout.points(face, layout.labels)[None], 600, axis=0)
    skin = len(layout.face_labels)
    rest[:, :skin] += np.random.default_rng(0).normal(size=(600, skin, 3)) * 0.2
    assert check_markers(Take(rest, layout.labels, 200.0))[1] == []
    rising = np.linspace(0, 60, take.n_frames)[:, None] * (0.0, 1.0, 0.0)
    positions = take.positions + rising[:, None]
    columns = [take.labels.index(label) for label in heads[:3]]
    positions[STRETCH, columns] = positions[400, columns]
    found = check_markers(Take(positions, take.labels, take.rate))[1]
    assert {one.markers[0] for one in found if one.kind == "frozen"} == set(heads[:3])


def test_lips_that_roll_over_one_another_are_not_swapped(take):
    upper, lower = (take.labels.index(label) for label in ("LIPUM", "LIPDM"))
    share = np.clip(np.minimum(np.arange(take.n_frames) - 400, 700 - np.arange(take.n_frames)) / 20, 0, 1)[:, None]
    positions = take.positions.copy()
    across = take.positions[:, lower] - take.positions[:, upper]
    positions[:, upper] += share * across + share * (1 - share) * (0.0, 0.0, 8.0)  # before the other
    positions[:, lower] -= share * across
    assert check_markers(Take(positions, take.labels, take.rate))[1] == []


def test_a_mirrored_face_is_not_a_face_of_swapped_markers(take, known):
    mirrored = Take(take.positions * (1, 1, -1), take.labels, take.rate)
    assert check_markers(mirrored, known)[1] == []


@pytest.mark.parametrize("frames", [1, 2, 3])
@pytest.mark.parametrize("markers", [1, 4, 46])
def test_short_takes_of_few_markers_pass(take, frames, markers):
    short = Take(take.positions[:frames, :markers], take.labels[:markers], take.rate)
    assert check_markers(short)[1] == []


def test_takes_without_any_point_pass(take):
    assert check_markers(Take(np.full_like(take.positions, np.nan), take.labels, take.rate))[1] == []


def test_a_real_signer_has_no_wrong_markers(signer_pose):
    assert check_markers(read_take(signer_pose))[1] == []


@pytest.mark.slow
def test_a_minute_takes_little_time(take, known):
    """Less than the solve itself: 0.3 s; ten times that only where something hangs."""
    minute = Take(np.tile(take.positions, (12, 1, 1))[:12000], take.labels, take.rate)
    begun = time.process_time()
    check_markers(minute, known)
    assert time.process_time() - begun < 3.0
