"""Further channels: brows, eyes, blinks, gaze, nose, mouth, cheeks, head, and the intensity of the affect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from signface.channels.head import swings
from signface.channels.rules import (
    bridge,
    find_channels,
    find_intensities,
    hysteresis,
    long_enough,
    read_channels,
    signer_signal,
)
from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.head import head_angles
from signface.label.vocabulary import UNKNOWN
from signface.segmentation.segments import Segments
from signface.signer_level import signer_level

BASES = (
    *("browInnerUp", "browOuterUpLeft", "browOuterUpRight", "browDownLeft", "browDownRight", "eyeBlinkLeft"),
    *("eyeBlinkRight", "eyeWideLeft", "eyeWideRight", "eyeSquintLeft", "eyeSquintRight", "eyeLookOutLeft"),
    *("eyeLookInRight", "noseSneerLeft", "noseSneerRight", "jawOpen", "mouthClose", "mouthSmileLeft"),
    *("mouthSmileRight", "mouthPucker", "mouthFunnel", "cheekPuff"),
)


def moving(rate=100.0, seconds=4.0, residual=0.5, head=None, start=0.0, **spans) -> Descriptors:
    """A face at rest whose bases hold a weight over spans: `jawOpen=[(from_s, to_s, weight)]`."""
    time = np.arange(round(seconds * rate)) / rate
    weights = np.zeros((len(time), len(BASES)))
    for base, stretches in spans.items():
        for begin, end, weight in stretches:
            weights[(time >= begin - 1e-9) & (time < end - 1e-9), BASES.index(base)] = weight
    return Descriptors(weights, BASES, rate, start=start, residual=np.full(len(time), residual), head=head, name="take")


def events(descriptors: Descriptors, channel: str) -> list[tuple]:
    table = next(found.table for found in find_channels(descriptors) if found.channel == channel)
    return [(round(row.start_s, 3), round(row.end_s, 3), row.value) for row in table.itertuples()]


def turning(rate: float, seconds: float, **angles) -> np.ndarray:
    """(F, 4, 4) head poses from functions of time (s) to degrees: yaw, pitch, roll."""
    time = np.arange(round(seconds * rate)) / rate
    euler = np.column_stack([angles.get(name, lambda t: 0 * t)(time) for name in ("yaw", "pitch", "roll")])
    poses = np.tile(np.eye(4), (len(time), 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("YXZ", euler, degrees=True).as_matrix()
    return poses


BROWS_UP = {base: [(1.0, 2.0, 0.8)] for base in ("browInnerUp", "browOuterUpLeft", "browOuterUpRight")}
LIDS = ("eyeBlinkLeft", "eyeBlinkRight")


def test_raised_brows_last_as_long_as_they_are_raised():
    assert events(moving(**BROWS_UP), "brows") == [(1.0, 2.0, "raised")]


def test_times_are_those_of_the_recording():
    assert events(moving(start=10.0, **BROWS_UP), "brows") == [(11.0, 12.0, "raised")]


def test_brows_raised_and_lowered_together_are_their_own_value():
    both = BROWS_UP | {"browDownLeft": [(1.5, 2.5, 0.8)], "browDownRight": [(1.5, 2.5, 0.8)]}
    assert events(moving(**both), "brows") == [
        (1.0, 1.5, "raised"),
        (1.5, 2.0, "raised and lowered"),
        (2.0, 2.5, "lowered"),
    ]


def test_values_that_do_not_begin_and_end_together_leave_no_slivers():
    both = BROWS_UP | {"browDownLeft": [(0.97, 2.03, 0.8)], "browDownRight": [(0.97, 2.03, 0.8)]}
    assert events(moving(**both), "brows") == [(0.97, 2.03, "raised and lowered")]


def test_a_flicker_is_no_event():
    assert events(moving(jawOpen=[(1.0, 1.05, 0.9)]), "mouth") == []


def test_a_short_pause_does_not_split_an_event():
    assert events(moving(jawOpen=[(1.0, 1.5, 0.9), (1.54, 2.0, 0.9)]), "mouth") == [(1.0, 2.0, "open")]


def test_a_blink_is_no_closed_eye_and_a_closed_eye_is_no_blink():
    take = moving(**{lid: [(1.0, 1.15, 1.0), (2.0, 3.0, 1.0)] for lid in LIDS})
    assert events(take, "blinks") == [(1.0, 1.15, "blink")]
    assert events(take, "eyes") == [(2.0, 3.0, "closed")]


def test_a_jaw_that_drops_behind_closed_lips_opens_no_mouth():
    assert events(moving(jawOpen=[(1.0, 2.0, 0.8)], mouthClose=[(1.0, 2.0, 0.8)]), "mouth") == []


def test_an_open_smile_is_one_value_and_the_stronger_of_two_others_wins():
    smile = {"mouthSmileLeft": [(1.0, 2.0, 0.9)], "mouthSmileRight": [(1.0, 2.0, 0.9)]}
    assert events(moving(**smile, jawOpen=[(1.0, 2.0, 0.5)]), "mouth") == [(1.0, 2.0, "open, corners up")]
    assert events(moving(**smile, mouthPucker=[(1.0, 2.0, 0.5)]), "mouth") == [(1.0, 2.0, "corners up")]


def test_gaze_is_annotated_only_where_it_was_measured():
    look = {base: [(1.0, 2.0, 0.8)] for base in ("eyeLookOutLeft", "eyeLookInRight")}
    assert "gaze" not in [found.channel for found in find_channels(moving(**look))]
    assert events(moving(residual=np.nan, **look), "gaze") == [(1.0, 2.0, "left")]


def test_frames_without_weights_hold_nothing():
    take = moving(jawOpen=[(1.0, 3.0, 0.9)])
    weights = take.weights.copy()
    weights[150:250] = np.nan
    assert events(take.changed("gap", weights=weights), "mouth") == [(1.0, 1.5, "open"), (2.5, 3.0, "open")]


@pytest.mark.parametrize("rate", [30.0, 60.0, 120.0, 200.0])
def test_results_do_not_depend_on_the_rate_by_more_than_a_frame(rate):
    found = events(moving(rate, **BROWS_UP), "brows")
    assert len(found) == 1
    assert abs(found[0][0] - 1.0) <= 1 / 30
    assert abs(found[0][1] - 2.0) <= 1 / 30


def test_every_value_is_in_the_channels_closed_vocabulary():
    take = moving(**BROWS_UP, jawOpen=[(1.0, 2.0, 0.9)], head=turning(100, 4, yaw=lambda t: 20 * np.sin(9 * t)))
    for found in find_channels(take):
        assert set(found.table["value"]) <= set(found.values)


def test_signs_of_the_angles_are_those_of_the_signers_own_left_and_right():
    # The face looks along +z, y is up: the nose (0, 0, 1) of a head turned to its left points to +x.
    left = Descriptors(np.zeros((1, 1)), ("a",), 100, head=turning(100, 0.01, yaw=lambda t: t + 20))
    assert (left.head[0, :3, :3] @ [0, 0, 1])[0] > 0
    assert head_angles(left)["yaw"][0] == pytest.approx(20)
    down = Descriptors(np.zeros((1, 1)), ("a",), 100, head=turning(100, 0.01, pitch=lambda t: t + 20))
    assert (down.head[0, :3, :3] @ [0, 0, 1])[1] < 0
    right = Descriptors(np.zeros((1, 1)), ("a",), 100, head=turning(100, 0.01, roll=lambda t: t + 20))
    assert (right.head[0, :3, :3] @ [0, 1, 0])[0] < 0  # the crown leans to the signer's right, -x


def pulse(begin, end, wave):
    return lambda t: np.where((t >= begin) & (t < end), wave(t - begin), 0.0)


@pytest.mark.parametrize("rate", [30.0, 100.0, 200.0])
@pytest.mark.parametrize("cycles", [1, 2, 3])
def test_nods_are_counted(rate, cycles):
    nod = pulse(1.0, 1.0 + 0.5 * cycles, lambda t: 5 * (1 - np.cos(2 * np.pi * t / 0.5)))
    take = moving(rate, head=turning(rate, 4, pitch=nod))
    table = next(found.table for found in find_channels(take) if found.channel == "head")
    assert list(table["value"]) == ["nod"]
    assert table["cycles"][0] == cycles
    assert table["amplitude_deg"][0] == pytest.approx(10, abs=1.0)
    assert abs(table["start_s"][0] - 1.0) < 0.12
    assert abs(table["end_s"][0] - (1.0 + 0.5 * cycles)) < 0.12


def test_a_shake_is_no_turn_and_a_turn_is_no_shake():
    shake = pulse(1.0, 2.5, lambda t: 12 * np.sin(2 * np.pi * t / 0.5))
    take = moving(head=turning(100, 4, yaw=shake))
    assert [value for *_, value in events(take, "head")] == ["shake"]
    turn = pulse(1.0, 3.0, lambda t: 25 * np.clip(t / 0.3, 0, 1) * np.clip((2 - t) / 0.3, 0, 1))
    take = moving(head=turning(100, 4, yaw=turn))
    assert [value for *_, value in events(take, "head")] == ["turn left"]


@pytest.mark.parametrize(
    ("angle", "sign", "value"), [("roll", 1, "tilt right"), ("roll", -1, "tilt left"), ("yaw", -1, "turn right")]
)
def test_postures_are_named_by_the_signers_side(angle, sign, value):
    hold = pulse(1.0, 3.0, lambda t: sign * 20 * np.clip(t / 0.3, 0, 1) * np.clip((2 - t) / 0.3, 0, 1))
    take = moving(head=turning(100, 4, **{angle: hold}))
    assert [found for *_, found in events(take, "head")] == [value]


def test_a_still_head_has_no_channel():
    assert "head" not in [found.channel for found in find_channels(moving())]


def test_noise_of_a_degree_is_no_movement():
    rng = np.random.default_rng(0)
    take = moving(
        head=turning(100, 4, yaw=lambda t: rng.normal(0, 0.5, len(t)), pitch=lambda t: rng.normal(0, 0.5, len(t)))
    )
    assert events(take, "head") == []


@settings(deadline=None, max_examples=60)
@given(st.lists(st.floats(-1, 2, allow_nan=False), min_size=1, max_size=80))
def test_hysteresis_changes_only_at_the_thresholds(signal):
    curve = np.array(signal)
    on = hysteresis(curve, 0.5, 0.2)
    assert on[curve >= 0.5].all()
    assert not on[curve < 0.2].any()
    between = (curve >= 0.2) & (curve < 0.5)
    for frame in np.flatnonzero(between):
        assert on[frame] == (on[frame - 1] if frame else False)


@settings(deadline=None, max_examples=60)
@given(st.lists(st.booleans(), min_size=1, max_size=60), st.integers(1, 6))
def test_what_is_kept_is_long_enough_and_was_there(states, shortest):
    active = np.array(states)
    kept = long_enough(active, shortest)
    assert (active | ~kept).all()
    lengths = np.diff(np.flatnonzero(np.diff(np.r_[0, kept.astype(int), 0]))).tolist()[::2]
    assert all(length >= shortest for length in lengths)
    assert (bridge(active, shortest) | ~active).all()


@settings(deadline=None, max_examples=60)
@given(st.lists(st.floats(-30, 30), min_size=1, max_size=60), st.floats(0.5, 10))
def test_swings_are_wide_enough_and_go_back_and_forth(angle, smallest):
    curve = np.array(angle)
    turns = swings(curve, smallest)
    steps = np.diff(curve[turns])
    assert (np.abs(steps) >= smallest - 1e-9).all()
    assert (steps[1:] * steps[:-1] < 0).all()


def test_what_a_model_did_not_know_has_no_intensity():
    take = moving(mouthSmileLeft=[(0.0, 1.0, 0.9)])
    table = pd.DataFrame([(0.0, 1.0, "stable", UNKNOWN)], columns=["start_s", "end_s", "kind", "label"])
    assert find_intensities(take, Segments(table, name="take")).table["intensity"].isna().all()


def test_intensity_grows_with_the_strength_of_the_face():
    spans = [(0.0, 1.0, "J", 0.3), (1.0, 2.0, "J", 0.6), (2.0, 3.0, "J", 0.9), (3.0, 4.0, "N", 0.0)]
    take = moving(
        mouthSmileLeft=[(a, b, w) for a, b, _, w in spans], mouthSmileRight=[(a, b, w) for a, b, _, w in spans]
    )
    table = pd.DataFrame(
        [(a, b, "stable", label) for a, b, label, _ in spans], columns=["start_s", "end_s", "kind", "label"]
    )
    found = find_intensities(take, Segments(table, name="take")).table["intensity"]
    assert found.tolist()[:3] == [1, 2, 3]
    assert found.isna().tolist() == [False, False, False, True]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("brows = 1", "brows is no table"),
        ("[brows.raised]\non = 1", "has no bases"),
        ('[brows.raised]\nbases = ["a"]\non = 0.2\noff = 0.4\nmin_ms = 1', "off is above on"),
        ('[brows.raised]\nbases = ["a"]\non = 0.2\noff = 0.1\nmin_ms = 1\ncolour = 1', "unknown key colour"),
        ("[brows", "is no TOML"),
    ],
)
def test_a_broken_file_of_thresholds_is_explained(tmp_path, text, message):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(SignfaceError, match=message):
        read_channels(path)


def test_ones_own_thresholds_are_used(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('[jaw]\n[jaw.dropped]\nbases = ["jawOpen"]\non = 0.1\noff = 0.05\nmin_ms = 20\n')
    found = find_channels(moving(jawOpen=[(1.0, 1.1, 0.2)]), read_channels(path))
    assert [(events.channel, list(events.table["value"])) for events in found] == [("jaw", ["dropped"])]


RULE = {
    **{"bases": ["browInnerUp"], "on": 0.35, "off": 0.2, "min_ms": 100},
    "signer": {"on": 0.9, "off": 0.75, "take": 0.5, "smooth_ms": 200, "minus": ["browDownLeft"]},
}


@given(scale=st.floats(0.2, 5), shift=st.floats(-1, 1))
@settings(max_examples=25, deadline=None)
def test_a_signers_signal_does_not_depend_on_how_strong_or_where_their_weights_are(scale, shift):
    """Scaled and shifted, take and level alike, brows are as high as before."""
    rng = np.random.default_rng(3)
    take = moving(rate=25.0, browInnerUp=[(1.0, 2.0, 0.8)])
    take = replace(take, weights=take.weights + rng.normal(0, 0.1, take.weights.shape))
    other = replace(take, weights=scale * take.weights + shift * (np.array(BASES) == "browInnerUp"))
    first, second = (signer_signal(one, RULE, signer_level([one])) for one in (take, other))
    np.testing.assert_allclose(first, second, atol=0.02)


def test_where_the_signer_is_known_their_range_decides():
    """A raise of half the usual strength is one for a signer who never raises brows higher, and none otherwise."""
    weak = moving(rate=25.0, seconds=6.0, **{base: [(1.0, 2.5, 0.2)] for base in BROWS_UP})
    level = signer_level([weak])
    by_level = {e.channel: e.table["value"].tolist() for e in find_channels(weak, level=level)}
    assert by_level["brows"] == ["raised"]
    assert events(weak, "brows") == []
    low = {base: [(1.0, 2.5, 0.9)] for base in BROWS_UP}
    strong = signer_level([weak, moving(rate=25.0, seconds=6.0, **low)])
    assert {e.channel: len(e) for e in find_channels(weak, level=strong)}["brows"] == 0


def test_a_signers_table_is_checked(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('[b]\n[b.up]\nbases = ["a"]\non = 1.0\noff = 0.5\nmin_ms = 9\n[b.up.signer]\non = 1.0\n')
    with pytest.raises(SignfaceError, match=r"b\.up\.signer"):
        read_channels(path)
