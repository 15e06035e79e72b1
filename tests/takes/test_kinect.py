"""Kinect's face points: pixels and depths come to millimetres, uneven rows to an even grid."""

from __future__ import annotations

import tarfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import signface as sf
from signface.errors import SignfaceError
from signface.solver.layout_fit import misfit
from signface.takes.formats.kinect import CENTRE, FOCAL, clock, face_depth, in_space, read_kinect
from signface.takes.formats.uneven import even_frames, usual_rate
from signface.takes.reading import recognise
from tests.fixtures.takes_files import write_kinect
from tests.fixtures.third_party import third_party_file


def flat_face(frames: int, depth: float = 1200.0) -> np.ndarray:
    """A still grid of 12 points."""
    points = np.stack(np.meshgrid(np.arange(300.0, 340, 10), np.arange(200.0, 230, 10)), axis=-1).reshape(-1, 2)
    return np.tile(np.column_stack([points, np.full(12, depth)]), (frames, 1, 1))


def times_of(seconds: np.ndarray) -> list[str]:
    """As the format writes them: milliseconds without zeros in front."""
    return [f"{1390385453 + int(second)}.{round(1000 * (second % 1)) % 1000}" for second in seconds]


@given(st.integers(0, 10**9), st.integers(0, 999))
def test_milliseconds_are_not_padded(second, millisecond):
    assert clock(f"{second}.{millisecond}") == pytest.approx(second + millisecond / 1000, abs=1e-6)


@given(st.lists(st.tuples(*[st.floats(-300, 300)] * 2, st.floats(500, 3000)), min_size=1, max_size=20))
def test_points_are_seen_by_the_camera_where_they_were(places):
    """The camera is asked again: what it would show of the positions are the pixels they came from."""
    pixels = np.add(places, (*CENTRE, 0))
    x, y, z = np.moveaxis(in_space(pixels[None])[0], -1, 0)
    np.testing.assert_allclose(CENTRE[0] - FOCAL * x / -z, pixels[:, 0], atol=1e-9)
    np.testing.assert_allclose(CENTRE[1] - FOCAL * y / -z, pixels[:, 1], atol=1e-9)
    np.testing.assert_array_equal(-z, pixels[:, 2])


def test_depths_of_other_things_and_none_are_missing():
    depth = flat_face(40)[..., 2]
    depth[5, 0], depth[6, 1], depth[7, 2], depth[:, 3] = 0, 1540, 1120, 1540
    found = face_depth(depth)
    assert np.isnan(found[[5, 6, 7], [0, 1, 2]]).all()
    assert np.isnan(found[:, 3]).all()
    assert np.isfinite(found).sum() == depth.size - 3 - 40
    np.testing.assert_array_equal(found[np.isfinite(found)], 1200.0)


def test_a_file_becomes_an_even_take(tmp_path):
    seconds = np.round(np.concatenate([np.arange(0, 1, 0.062), 2.005 + np.arange(0, 1, 0.062)]), 3)
    file = write_kinect(tmp_path / "a_topics_datapoints.txt", flat_face(len(seconds)), times_of(seconds))
    assert recognise(file) == "kinect"
    take = sf.read_take(file)
    assert (take.rate, take.labels[0], take.labels[-1], take.start) == (16.0, "K0", "K11", 0.0)
    assert take.duration == pytest.approx(seconds[-1], abs=0.13)
    known = np.isfinite(take.positions[:, 0, 0])
    assert not known[17:31].any()
    assert known[:15].all()
    assert known[33:].all()
    np.testing.assert_allclose(take.positions[known], np.broadcast_to(take.positions[0], take.positions[known].shape))
    assert take.positions[0, 0, 0] > take.positions[0, 3, 0]  # the picture's left is the signer's
    assert take.positions[0, 0, 1] > take.positions[0, 8, 1]


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda lines: [*lines[:-1], lines[-1][:50]], "cells instead of 36"),
        (lambda lines: [lines[0], lines[2], lines[1]], "do not rise"),
        (lambda lines: [*lines[:2], "noon" + lines[2][14:]], "line 3 begins with no time: 'noon"),
        (lambda lines: [lines[0], lines[1].replace("1200", "deep"), lines[2]], "is no number: 'deep"),
        (lambda lines: [line.replace("1200.000", "0") for line in lines], "no point has a depth"),
        (lambda lines: lines[:1], "no frames, only a header"),
        (lambda lines: lines[:2], "one frame, and a rate needs two"),
    ],
)
def test_broken_files_are_refused_in_one_line(tmp_path, change, problem):
    file = write_kinect(tmp_path / "a_x_datapoints.txt", flat_face(3), times_of(np.arange(3) / 16))
    file.write_text("\n".join(change(file.read_text().splitlines())) + "\n")
    with pytest.raises(SignfaceError, match=problem) as refused:
        sf.read_take(file)
    assert str(file) in str(refused.value)


@given(st.integers(0, 1000))
@settings(max_examples=30, deadline=None)
def test_straight_motion_is_kept_on_the_grid(seed):
    random = np.random.default_rng(seed)
    times = np.cumsum(random.uniform(0.03, 0.15, 60))
    values, missing = even_frames(times, np.column_stack([3 * times, 1 - times]), usual_rate(times))
    grid = times[0] + np.arange(len(values)) / usual_rate(times)
    assert not missing.any()
    np.testing.assert_allclose(values, np.column_stack([3 * grid, 1 - grid]), atol=1e-9)


@pytest.mark.slow
def test_real_points_are_a_face_and_are_solved(tmp_path):
    name = "gfe/a_affirmative_datapoints.txt"
    points = tmp_path / Path(name).name
    with tarfile.open(third_party_file("real/gfe.tar.xz")) as archive:
        member = archive.extractfile(name)
        assert member is not None
        points.write_bytes(member.read())
    take = read_kinect(points)
    assert (take.n_frames, take.rate, len(take.labels)) == (1105, 16.0, 100)
    face = sf.read_face()
    layout = sf.choose_layout(take.labels, face)
    assert layout.name == "kinect"
    middle = np.nanmedian(take.select(layout.labels), axis=0)
    straight, mirrored = misfit(middle, layout.points(face, layout.labels))
    assert straight < 0.25 < mirrored
    solved = sf.solve(take)
    assert np.nanmedian(solved.residual) < 6.0
    assert np.isfinite(solved.weights).all(axis=1).mean() > 0.95
