"""Markers that carry a head keep their places and stand apart."""

from __future__ import annotations

import numpy as np
import pytest

import signface as sf
from signface.face.suggestion import suggest_layout
from signface.takes.neutral import find_neutral
from signface.takes.rigid import flatness
from signface.takes.rigid_markers import SPREAD_MM, carriers_of_head, movements, with_head_markers
from tests.fixtures.takes_files import moving_face
from tests.fixtures.third_party import third_party_file


def test_what_moves_on_the_head_is_told_from_what_does_not():
    take, _ = moving_face(3.0, 60.0, jitter=0.1)
    moves = movements(take.positions[0], take.positions)
    assert moves[20:].max() < np.median(moves[:20])


def test_of_equally_still_markers_those_that_stand_apart_are_taken():
    random = np.random.default_rng(0)
    ear = random.normal(size=(20, 3)) * 3 + (70, 0, 0)
    apart = np.array([[-70.0, 0, 0], [0, 80, 40], [0, -60, 60], [0, 10, 100]])
    places = np.vstack([ear, apart])
    assert set(range(20, 24)) < set(carriers_of_head(places, np.ones(24), range(24), 6))
    moves = np.r_[np.ones(20), 1, 1, 50, np.inf]  # the chin moves, the last one is never seen
    chosen = carriers_of_head(places, moves, range(24), 6)
    assert {20, 21} < set(chosen)
    assert not {22, 23} & set(chosen)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["B01_nod_1", "K02_gen_q_dom_post", "p0003_c02s0014w0042"])
def test_suggested_head_markers_of_real_landmarks_span_the_face(name):
    face, take = sf.read_face(), sf.read_take(third_party_file(f"real/samples/{name}.csv"))
    time = find_neutral(take)
    neutral = take.positions[take.frame_at(time)]
    layout = with_head_markers(suggest_layout(take.labels, neutral, face).layout, take, time, face)
    head = np.isin(take.labels, layout.head_labels)
    assert head.sum() == 8
    assert flatness(neutral, head[None].astype(float))[0] > SPREAD_MM
    across = neutral[head, 0]
    assert across.min() < neutral[27, 0] - 15 < neutral[27, 0] + 15 < across.max()  # both sides of the nose
    lips = {f"L{number}" for number in range(48, 68)}
    assert not lips & set(layout.head_labels)
