"""The rest of a signer over all takes: where it is, what does not change it, and what is solved from it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pympi.Elan import Eaf
from scipy.spatial.transform import Rotation

import signface as sf
from signface.channels.rules import read_channels
from signface.face.layout import MarkerLayout
from signface.signer import Signer
from signface.signer_level import SignerRest, signer_level
from signface.solver.measures import BROWS_RAISED, LOWERED, MEASURES, PER_PITCH_DEG, RAISED, FaceMeasures
from signface.solver.signer_rest import learn_signer, signer_rest
from signface.solver.solving import solve
from signface.solver.thin_shell import ThinShellSolver
from signface.takes.reading import open_recording
from signface.takes.rigid import apply, rigid_transforms
from signface.takes.take import Take
from tests.fixtures.third_party import third_party_file

FACE = sf.read_face()
LAYOUT = sf.read_layout("openface", FACE)


def film(raised: np.ndarray, *, turn=(0.0, 0.0, 0.0), place=(0.0, 0.0, 0.0), name="take") -> Take:
    """The landmarks of a face whose brows rise by a weight in each frame, before a camera."""
    weights = np.zeros((len(raised), FACE.n_bases))
    for base in ("browInnerUp", "browOuterUpLeft", "browOuterUpRight"):
        weights[:, FACE.names.index(base)] = raised
    at = LAYOUT.points(FACE, LAYOUT.labels) + np.tensordot(weights, bases_of(LAYOUT), axes=1)
    turned = at @ Rotation.from_euler("XYZ", turn, degrees=True).as_matrix().T + np.array(place)
    return Take(turned, LAYOUT.labels, 25.0, name=name)


def bases_of(layout: MarkerLayout) -> np.ndarray:
    """(N, M, 3) bases at all landmarks, the head's at rest."""
    moved = np.zeros((FACE.n_bases, len(layout.labels), 3))
    moved[:, [label in layout.face_labels for label in layout.labels]] = layout.bases(FACE)
    return moved


def shape_of(rest: SignerRest, other: SignerRest) -> np.ndarray:
    """The other rest, brought onto the first."""
    pose = rigid_transforms(other.places, rest.places[None], np.ones((1, len(rest.places))))
    return apply(pose, other.places[None])[0]


@given(turn=st.tuples(*[st.floats(-30, 30)] * 3), place=st.tuples(*[st.floats(-200, 200)] * 3))
@settings(max_examples=15, deadline=None)
def test_the_rest_is_that_of_the_face_wherever_the_head_is(turn, place):
    still = film(np.zeros(40))
    moved = film(np.zeros(40), turn=turn, place=place)
    first, second = signer_rest([still], LAYOUT), signer_rest([moved], LAYOUT)
    np.testing.assert_allclose(shape_of(first, second), first.places, atol=1e-6)


def test_what_a_signer_does_for_less_than_half_of_the_time_is_not_their_rest():
    calm, busy = film(np.zeros(100)), film(np.repeat([0.0, 1.0], 40), turn=(10, 5, 0))
    rest = signer_rest([calm, busy], LAYOUT)
    assert rest.takes == 2
    np.testing.assert_allclose(
        shape_of(signer_rest([calm], LAYOUT), rest), signer_rest([calm], LAYOUT).places, atol=0.2
    )


@pytest.mark.slow
def test_a_take_that_is_raised_throughout_is_raised_from_the_signers_rest():
    """Alone it has nothing to be measured from but itself."""
    raised = film(np.full(50, 0.8), turn=(8, 0, 0))
    signer = Signer("S", rest=signer_rest([film(np.zeros(200)), raised], LAYOUT))
    alone, known = solve(raised), solve(raised, signer=signer)
    assert np.abs(alone.weight("browInnerUp")).max() < 0.1
    np.testing.assert_allclose(known.weight("browInnerUp"), 0.8, atol=0.2)
    assert "rest of the signer over 2 takes" in " ".join(known.history)


@pytest.mark.slow
def test_landmarks_do_not_creep():
    history = " ".join(solve(film(np.zeros(50))).history)
    assert "creep" not in history
    assert "creep" in " ".join(solve(sf.datasets.mini_take()).history)


@pytest.mark.slow
def test_a_signers_file_keeps_rest_and_level(tmp_path):
    takes = [film(np.repeat([0.0, 0.6], 30)), film(np.zeros(60))]
    signer, solved = learn_signer([lambda take=take: take for take in takes], signer=Signer("S"))
    again = Signer.read(signer.save(tmp_path / "S.json"))
    assert again == signer
    assert again.solving_digest == signer.solving_digest != Signer("S").solving_digest
    assert [one.n_frames for one in solved] == [60, 60]
    assert len(signer.level.frames.weights) == 120


def test_a_level_is_of_all_frames_alike():
    """Two takes or one cut in two: the same sample but for where it is cut."""
    whole = sf.datasets.mini_weights()
    middle = whole.start + whole.duration / 2
    parts = [whole.between(whole.start, middle), whole.between(middle, whole.start + whole.duration + 1)]
    one, two = signer_level([whole]), signer_level(parts)
    np.testing.assert_allclose(np.sort(one.sample, axis=0).mean(0), np.sort(two.sample, axis=0).mean(0), atol=2e-3)
    assert abs(len(one.sample) - len(two.sample)) <= 1


@given(raised=st.floats(0.1, 1.0))
@settings(max_examples=10, deadline=None)
def test_measures_in_millimetres_are_linear_and_zero_at_rest(raised):
    measures = FaceMeasures(FACE, LAYOUT)
    assert measures.names == (*MEASURES, BROWS_RAISED)
    base = LAYOUT.bases(FACE)[FACE.names.index("browInnerUp")][None]
    one, scaled = measures.solve(base).weights, measures.solve(raised * base).weights
    np.testing.assert_allclose(scaled[:, :-1], raised * one[:, :-1], atol=1e-12)
    np.testing.assert_allclose(measures.solve(0 * base).weights, 0.0, atol=1e-6)
    assert one[0, measures.names.index("browInnerHeight")] > 3
    assert np.abs(one[0, measures.names.index("mouthWidth")]) < 0.2


def test_raised_brows_are_measured_as_weights_solve_them():
    measures, solver = FaceMeasures(FACE, LAYOUT), ThinShellSolver(FACE, LAYOUT)
    for sign, names in ((1.0, RAISED), (-1.0, LOWERED)):
        place = sum(LAYOUT.bases(FACE)[FACE.names.index(name)] for name in names)[None]
        weights = dict(zip(solver.names, solver.solve(place).weights[0], strict=True))
        expected = np.mean([weights[name] for name in RAISED]) - np.mean([weights[name] for name in LOWERED])
        assert measures.solve(place).weights[0, -1] == pytest.approx(expected, abs=1e-9)
        assert sign * expected > 0.5


def test_brows_are_corrected_by_pitch_as_the_rule_of_the_channel_does():
    assert read_channels()["brows"]["raised"]["signer"]["per_pitch_deg"] == PER_PITCH_DEG


def test_without_brow_markers_raised_brows_are_no_measure():
    brows = {f"L{number}" for number in range(17, 27)}
    blind = LAYOUT.restricted([label for label in LAYOUT.labels if label not in brows])
    names = FaceMeasures(FACE, blind).names
    assert BROWS_RAISED not in names
    assert "mouthWidth" in names


def test_a_missing_landmark_takes_only_its_own_measures():
    measures = FaceMeasures(FACE, LAYOUT)
    places = np.zeros((1, len(LAYOUT.face_labels), 3))
    places[0, LAYOUT.face_labels.index("L51")] = np.nan
    missing = [name for name, value in zip(measures.names, measures.solve(places).weights[0]) if np.isnan(value)]
    assert missing == ["mouthHeight", "upperLipHeight", "cornerHeight"]


@pytest.mark.slow
@pytest.mark.parametrize("settings_", [sf.SolveSettings(), sf.SolveSettings(method="measures")])
def test_a_real_question_has_raised_brows_where_it_is_annotated(settings_):
    """K02's yes/no question: brows are higher within the raise that the annotator marked than outside."""
    files = [third_party_file(f"real/samples/{n}.csv") for n in ("K02_gen_q_dom_post", "K01_part_q_tel_slom")]
    signer, (take, _) = learn_signer([lambda file=file: open_recording(file) for file in files], settings_)
    name = "browInnerHeight" if settings_.method == "measures" else "browInnerUp"
    spans = Eaf(str(third_party_file("real/samples/K02_gen_q_dom_post.eaf"))).get_annotation_data_for_tier("brows@K02")
    raised = np.zeros(take.n_frames, dtype=bool)
    for begin, end, value, *_ in spans:
        raised |= (value == "br_raise") & (take.time >= begin / 1000) & (take.time < end / 1000)
    assert 0.1 < raised.mean() < 0.9
    brows = take.weight(name)
    higher = np.mean(brows[raised][:, None] > brows[~raised])  # of a frame inside and one outside, the one inside
    assert higher > 0.85
    assert signer.rest.takes == 2
