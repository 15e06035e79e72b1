"""The synthetic signers: heads, skin, markers and movement are those of faces, and not the avatar's."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from signface.face.layout_files import read_layout
from signface.face.reading import read_face
from signface.synth.corpus import TakeRequest, make_plan, make_signer, make_take
from signface.synth.expressions import (
    AFFECTS,
    MIXTURES,
    PROTOTYPES,
    UNITS,
    Spread,
    draw_face,
    draw_habits,
)
from signface.synth.heads import SHAPE_RMS_MM, local_maps
from signface.synth.motion import minimum_jerk, pulse, saturate, smooth_noise
from signface.synth.performance import perform


@pytest.fixture(scope="module")
def avatar():
    return read_face("default")


@pytest.fixture(scope="module")
def signer():
    return make_signer(11, 0, Spread())


def test_every_unit_of_the_prototypes_moves_a_base_of_the_face(avatar):
    used = {unit for variants in PROTOTYPES.values() for variant in variants for unit in variant}
    assert used <= set(UNITS)
    for shape in UNITS.values():
        for name in shape:
            for side in ("Left", "Right"):
                assert name.replace("*", side) in avatar.names
    assert set(MIXTURES) == set(PROTOTYPES) == set(AFFECTS)


def test_no_two_realisations_of_an_affect_are_the_same(avatar):
    rng = np.random.default_rng(0)
    habits = draw_habits(rng, Spread())
    for affect in AFFECTS:
        faces = np.array([draw_face(affect, 2, habits, Spread(), avatar.names, rng) for _ in range(12)])
        differences = np.abs(faces[:, None] - faces[None]).max(axis=2)[np.triu_indices(12, 1)]
        assert differences.min() > 1e-3


def test_a_higher_intensity_moves_the_face_further(avatar):
    rng = np.random.default_rng(1)
    effort = np.zeros(3)
    for _ in range(30):
        habits = draw_habits(rng, Spread())
        for affect in AFFECTS:
            for level in range(3):
                effort[level] += draw_face(affect, level + 1, habits, Spread(), avatar.names, rng).sum()
    assert effort[0] < 0.8 * effort[1] < 0.64 * effort[2]


def test_a_signer_has_another_head_than_the_avatar(avatar, signer):
    mask = avatar.moving
    difference = (signer.head.face.mesh.vertices - avatar.mesh.vertices)[mask]
    rms = np.sqrt((difference**2).sum(axis=1).mean())
    assert SHAPE_RMS_MM[0] - 0.1 < rms < SHAPE_RMS_MM[1] + 0.1
    np.testing.assert_allclose(difference.mean(axis=0), 0.0, atol=1e-6)


def test_the_skin_of_a_signer_is_not_the_avatars_but_near_it(avatar, signer):
    request = TakeRequest(11, 0, "EU", 9)
    weights = make_take(request).weights.weights[::40]
    moving = np.flatnonzero(avatar.moving)
    own = signer.head.skin(weights, moving) - signer.head.face.mesh.vertices[moving]
    shown = avatar.pose(signer.head.avatar_weights(weights))[:, moving] - avatar.mesh.vertices[moving]
    gap = np.sqrt(((own - shown) ** 2).sum(axis=2).mean())
    size = np.sqrt((own**2).sum(axis=2).mean())
    assert 0.05 * size < gap < 0.5 * size


def test_the_jaw_swings_on_an_arc_that_ends_where_the_base_says(signer):
    face = signer.head.face
    jaw = face.names.index("jawOpen")
    chin = int(np.argmax(np.linalg.norm(face.bases[jaw], axis=1)))
    weights = np.zeros((3, face.n_bases))
    weights[:, jaw] = [0.0, 0.5, 1.0]
    closed, half, opened = signer.head.skin(weights, np.array([chin]))[:, 0]
    np.testing.assert_allclose(opened - closed, face.bases[jaw, chin], atol=1e-9)
    chord = (opened - closed) / np.linalg.norm(opened - closed)
    away = (half - closed) - ((half - closed) @ chord) * chord
    assert np.linalg.norm(away) > 0.5


def test_an_affine_change_of_shape_is_recovered_at_every_vertex(avatar):
    # The normal's stretch is only known on average, so the map is compared on the directions of the skin.
    matrix = np.array([[1.1, 0.1, 0.0], [0.0, 0.95, 0.05], [0.0, 0.0, 1.05]])
    maps = local_maps(avatar.mesh, avatar.mesh.vertices @ matrix.T, rings=0)
    edges = avatar.mesh.triangles[:, :2]
    along = avatar.mesh.vertices[edges[:, 1]] - avatar.mesh.vertices[edges[:, 0]]
    mapped = np.einsum("eij,ej->ei", maps[edges[:, 0]], along)
    error = np.linalg.norm(mapped - along @ matrix.T, axis=1) / np.linalg.norm(along, axis=1)
    assert np.median(error) < 0.03


def test_markers_are_glued_one_to_three_millimetres_off(avatar, signer):
    layout = read_layout("default-40", avatar)
    vertices = signer.head.face.mesh.vertices
    wanted = layout.interpolate(vertices, layout.face_labels)
    rows = [signer.glued.labels.index(label) for label in layout.face_labels]
    glued = np.einsum("mcd,mc->md", vertices[signer.glued.corners[rows]], signer.glued.barycentric[rows])
    distance = np.linalg.norm(glued - wanted, axis=1)
    assert distance.max() < 3.2
    assert np.mean(distance > 0.7) > 0.9
    on_a_vertex = signer.glued.barycentric[rows].max(axis=1) > 0.999
    assert on_a_vertex.mean() < 0.1


@pytest.mark.slow
def test_markers_jitter_by_tenths_of_a_millimetre():
    take = make_take(TakeRequest(11, 0, "IE", 3)).take
    still = take.positions[20:120]
    # Second differences leave noise and take slow movement away; white noise grows by sqrt(6) in them.
    jitter = np.sqrt(np.nanmean(np.diff(still, 2, axis=0) ** 2, axis=0).sum(axis=1) / 6.0)
    assert jitter.min() > 0.07
    assert jitter.max() < 0.40


@pytest.mark.slow
def test_lost_markers_come_back_within_some_tenths_of_a_second():
    lengths = []
    for number in range(4):
        take = make_take(TakeRequest(11, 0, "EU", number)).take
        missing = np.isnan(take.positions[:, :, 0])
        assert 0.0 < missing.mean() < 0.05
        for marker in missing.T:
            edges = np.diff(np.concatenate([[0], marker.astype(int), [0]]))
            lengths.extend((np.flatnonzero(edges < 0) - np.flatnonzero(edges > 0)) / take.rate)
    assert np.median(lengths) < 0.15
    assert np.quantile(lengths, 0.95) < 0.33


@pytest.mark.slow
def test_weights_stay_between_nothing_and_everything(avatar):
    for seed, number in ((0, 3), (1, 16)):
        habits = make_signer(seed, 0, Spread()).habits
        plan = make_plan(TakeRequest(seed, 0, "EU", number), habits)
        time = np.arange(round(plan.duration * 100)) / 100
        weights = perform(plan, time, habits, Spread(), avatar.names, np.random.default_rng(seed))
        assert weights.min() >= 0.0
        assert weights.max() <= 1.0
        assert np.abs(np.diff(weights, axis=0)).max() < 0.5  # no base jumps within 10 ms


@pytest.mark.slow
def test_utterances_move_the_mouth_and_the_head_more_than_isolated_expressions():
    uttered, isolated = make_take(TakeRequest(11, 0, "EU", 9)), make_take(TakeRequest(11, 0, "IE", 3))
    jaw = uttered.weights.names.index("jawOpen")
    speed = [np.abs(np.gradient(made.weights.weights[:, jaw], 1 / 200)).mean() for made in (uttered, isolated)]
    assert speed[0] > 2 * speed[1]
    travel = [np.linalg.norm(made.weights.head[:, :3, 3].std(axis=0)) for made in (uttered, isolated)]
    assert travel[0] > travel[1]


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-2, 3), min_size=2, max_size=20))
def test_easing_never_turns_back(moments):
    eased = minimum_jerk(np.sort(moments))
    assert (np.diff(eased) >= -1e-12).all()
    assert ((eased >= 0) & (eased <= 1)).all()


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(0, 5), min_size=2, max_size=20))
def test_muscles_that_add_up_never_pass_full_activity(weights):
    weights = np.sort(weights)
    bent = saturate(weights)
    assert (np.diff(bent) >= 0).all()
    assert (bent <= 1).all()
    small = weights < 0.7
    np.testing.assert_array_equal(bent[small], weights[small])


def test_a_pulse_comes_and_goes():
    time = np.linspace(0, 4, 401)
    curve = pulse(time, 1.0, 3.0, 0.3, 0.5)
    assert curve[time <= 1.0].max() == curve[time >= 3.0].max() == 0.0
    np.testing.assert_allclose(curve[(time > 1.31) & (time < 2.49)], 1.0)


def test_noise_is_as_strong_and_as_slow_as_asked():
    noise = smooth_noise(np.random.default_rng(0), 20_000, 200.0, 0.5, 40)
    assert abs(noise.std() - 1.0) < 0.05
    power = (np.abs(np.fft.rfft(noise, axis=0)) ** 2).mean(axis=1)
    frequency = np.fft.rfftfreq(len(noise), 1 / 200.0)
    low, half = (
        power[(frequency > 0.02) & (frequency < 0.1)].mean(),
        power[(frequency > 0.45) & (frequency < 0.55)].mean(),
    )
    assert 0.4 < half / low < 0.6
