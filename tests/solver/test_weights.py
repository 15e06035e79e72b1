"""Markers to weights: the optimum, and what it must not depend on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from signface.compiling import on_compiling, tell
from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.layout_files import read_layout
from signface.face.mesh import Mesh
from signface.face.model import FaceModel
from signface.face.subdivision import subdivide
from signface.settings.solve import METHODS
from signface.solver.bounds import AT_REST, SMOOTHING, holding_curvature, holding_energy, holding_slope, released
from signface.solver.methods import make_solver
from signface.solver.newton import Problem, minimise, minimise_damped
from signface.solver.thin_shell import ThinShellSolver

#: The methods that solve for weights, and those that learn the mapping from examples.
EXACT = ("thin-shell", "least-squares", "nnls", "bounded", "direct-shell")


@pytest.fixture(scope="module")
def layout(face: FaceModel) -> MarkerLayout:
    return read_layout("default-40", face)


@pytest.fixture(scope="module")
def solver(face: FaceModel, layout: MarkerLayout) -> ThinShellSolver:
    return ThinShellSolver(face, layout)


@pytest.fixture(scope="module")
def displacements(face: FaceModel, layout: MarkerLayout) -> np.ndarray:
    """Sixty frames of changing expressions, 0.3 mm of noise, and some that no expression explains."""
    rng = np.random.default_rng(4)
    weights = np.clip(rng.normal(-0.3, 0.5, (60, face.n_bases)), 0.0, 1.0)
    marked = np.tensordot(weights, layout.bases(face), axes=1)
    marked[50:] += rng.normal(0.0, 8.0, marked[50:].shape)
    return marked + rng.normal(0.0, 0.3, marked.shape)


def in_metres(face: FaceModel) -> FaceModel:
    return replace(face, mesh=Mesh(face.mesh.vertices / 1000, face.mesh.triangles), bases=face.bases / 1000)


def test_rest_is_no_weight_at_all(solver, face, layout):
    for method in EXACT:
        solution = make_solver(method, face, layout).solve(np.zeros((3, 40, 3)))
        assert np.abs(solution.weights).max() < 1e-9, method
    assert np.abs(solver.stream().push(np.zeros((40, 3))).weights).max() < 1e-9


def test_weights_do_not_depend_on_the_unit_of_length(face, layout, solver, displacements):
    metres = ThinShellSolver(in_metres(face), layout).solve(displacements / 1000)
    millimetres = solver.solve(displacements)
    assert np.abs(metres.weights - millimetres.weights).max() < 1e-6
    assert metres.residual == pytest.approx(millimetres.residual / 1000, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("alpha", "most"), [(0.3, 0.002), (0.9, 0.03)])
def test_weights_hardly_depend_on_how_finely_the_face_is_meshed(face, layout, displacements, alpha, most):
    finer = subdivide(face)
    assert len(finer.mesh.triangles) == 4 * len(face.mesh.triangles)
    coarse = ThinShellSolver(face, layout, alpha=alpha).solve(displacements[:50]).weights
    fine = ThinShellSolver(finer, layout, alpha=alpha).solve(displacements[:50]).weights
    assert np.abs(coarse - fine).max() < most


def test_weights_do_not_depend_on_the_order_of_the_markers(face, layout, solver, displacements):
    order = np.random.default_rng(0).permutation(40)
    labels = [layout.face_labels[i] for i in order]
    rows = [layout.labels.index(label) for label in labels]
    shuffled = MarkerLayout(tuple(labels), ("face",) * 40, layout.corners[rows], layout.barycentric[rows])
    turned = ThinShellSolver(face, shuffled).solve(displacements[:, order]).weights
    assert np.abs(turned - solver.solve(displacements).weights).max() < 1e-6


def test_weights_do_not_depend_on_the_direction_of_time(solver, displacements):
    forward = solver.solve(displacements).weights
    assert np.abs(solver.solve(displacements[::-1]).weights[::-1] - forward).max() < 1e-6


def test_weights_do_not_depend_on_the_number_of_cores(face, layout, displacements):
    many = np.tile(displacements, (20, 1, 1))
    one, two = (ThinShellSolver(face, layout, threads=threads).solve(many).weights for threads in (1, 2))
    assert np.abs(one - two).max() < 1e-6


@pytest.mark.parametrize("head_slack", [0.0, 0.3])
def test_a_general_optimiser_finds_the_same_optimum(face, layout, displacements, head_slack):
    """SciPy solves for weights and head motions together, from the energy's definition; we eliminate the motions."""
    from scipy.optimize import minimize

    solver = ThinShellSolver(face, layout, head_slack=head_slack, slip=0.0)
    once = ThinShellSolver(face, layout, head_slack=head_slack, release=False, slip=0.0)
    observed, scale = solver.markers.observed, solver.markers.scale
    count = int(observed.sum())
    points = layout.points(face) - layout.points(face).mean(axis=0)
    points /= np.sqrt((points**2).sum(axis=1).mean())
    motions = np.zeros((40, 3, 6))
    for axis in range(3):
        motions[:, axis, axis] = 1.0
        motions[:, :, 3 + axis] = np.cross(np.eye(3)[axis], points)
    columns = np.hstack([solver.markers.matrix[:, observed], motions.reshape(120, 6)])
    prior = np.zeros((count + 6, count + 6))
    prior[:count, :count] = solver.shell
    prior[count:, count:] = np.eye(6) / (max(head_slack, 1e-9) * scale)
    normal = 2.0 * (columns.T @ columns / scale + prior)
    for frame, which in ((0, once), (7, once), (52, once), (0, solver), (7, solver)):
        one, row = displacements[frame : frame + 1], displacements[frame].ravel()
        first = once.solve(one).weights
        let_go = solver.sparsity * released(first[0, observed]) * (which is solver)

        def energy(x, row=row, let_go=let_go):
            error = columns @ x - row
            held = holding_energy(x[:count], solver.sparsity) - let_go * x[:count]
            return error @ error / scale + x @ prior @ x + 0.7 * held.sum()

        def slope(x, row=row, let_go=let_go):
            held = np.append(0.7 * (holding_slope(x[:count], solver.sparsity) - let_go), np.zeros(6))
            return normal @ x - 2.0 * columns.T @ row / scale + held

        def curvature(x):
            return normal + np.diag(np.append(0.7 * holding_curvature(x[:count], solver.sparsity), np.zeros(6)))

        found = minimize(
            energy,
            np.zeros(count + 6),
            jac=slope,
            hess=curvature,
            method="trust-exact",
            options={"gtol": 1e-10, "maxiter": 2000},
        )
        ours = which.solve(one).weights
        assert np.abs(ours[0, observed] - found.x[:count]).max() < 1e-6
        assert which.energy(ours, one, first if which is solver else None)[0] == pytest.approx(found.fun, rel=1e-7)


@pytest.mark.parametrize("release", [False, True])
def test_markers_that_slipped_are_at_the_optimum_of_hubers_estimator(face, layout, release):
    """There, drawing the far markers as near as they count and solving by plain least squares changes nothing."""
    rng = np.random.default_rng(2)
    weights = np.where(rng.random((200, face.n_bases)) < 0.1, rng.random((200, face.n_bases)), 0.0)
    slipped = np.tensordot(weights, layout.bases(face), axes=1) + rng.normal(0.0, 0.1, (200, 40, 3))
    slipped[:, [3, 11]] += [2.4, 2.0, 2.5]
    solver, plain = (ThinShellSolver(face, layout, slip=slip, release=release) for slip in (0.4, 0.0))
    found = solver.solve(slipped).weights
    reach = 0.4 * np.sqrt(solver.markers.scale / solver.markers.n_markers)
    apart = slipped - np.tensordot(found, layout.bases(face), axes=1)
    distance = np.linalg.norm(apart, axis=2, keepdims=True)
    assert (distance > reach).any(axis=(1, 2)).mean() > 0.9
    drawn = slipped - apart * (1.0 - reach / np.maximum(distance, reach))
    assert np.abs(plain.solve(drawn).weights - found).max() < 1.5e-4
    assert np.abs(plain.solve(slipped).weights - found).max() > 0.1


def test_landmarks_that_are_all_too_far_off_are_solved_to_the_optimum_too(face, layout):
    """As in films; by three hundred plain rounds of Huber's, to which momentum is added to need fewer."""
    rng = np.random.default_rng(3)
    off = rng.normal(0.0, 2.0, (60, 40, 3))
    solver, plain = (ThinShellSolver(face, layout, slip=slip) for slip in (0.4, 0.0))
    found, slow = solver.solve(off).weights, plain.solve(off).weights
    reach = 0.4 * np.sqrt(solver.markers.scale / solver.markers.n_markers)
    for _ in range(300):
        apart = off - np.tensordot(slow, layout.bases(face), axes=1)
        distance = np.linalg.norm(apart, axis=2, keepdims=True)
        slow = plain.solve(off - apart * (1.0 - reach / np.maximum(distance, reach))).weights
    assert (distance > reach).mean() > 0.8
    assert np.quantile(np.abs(slow - found).max(axis=1), [0.5, 0.9]).tolist() == pytest.approx([0.0, 0.0], abs=2e-3)


def test_a_marker_that_has_slipped_hardly_bends_the_face(face, layout, displacements):
    slipped = displacements[:50].copy()
    slipped[:, layout.face_labels.index("RBROI")] += [3.0, 2.0, 0.0]
    bent = []
    for slip in (0.4, 0.0):
        solver = ThinShellSolver(face, layout, slip=slip)
        apart = solver.solve(slipped).weights - solver.solve(displacements[:50]).weights
        bent.append(np.sqrt((apart**2).mean()))
    assert bent[0] < 0.6 * bent[1]


def test_expressions_keep_their_strength(face, layout, displacements):
    """The rest energy weakens what it holds; the second solve gives it back."""
    truth = np.zeros(face.n_bases)
    truth[[face.names.index(name) for name in ("mouthSmileLeft", "mouthSmileRight", "browInnerUp")]] = 0.7
    row = np.tensordot(truth, layout.bases(face), axes=1)[None]
    weak, strong = (ThinShellSolver(face, layout, release=release).solve(row).weights[0] for release in (False, True))
    assert np.abs(strong - truth).max() < 0.6 * np.abs(weak - truth).max()


def test_a_head_pose_that_is_a_little_off_makes_no_expression(face, layout):
    shifted = np.tile([0.0, 0.0, 0.5], (1, 40, 1))
    loose, strict = (
        np.abs(ThinShellSolver(face, layout, head_slack=slack).solve(shifted).weights).sum() for slack in (0.3, 0.0)
    )
    assert loose < 0.5 * strict


@pytest.mark.slow
def test_the_quick_and_the_sure_method_agree_on_wild_frames():
    """Frames that have nothing to do with one another, far out of bounds, and bases that are nearly dependent."""
    rng = np.random.default_rng(1)
    root = rng.normal(size=(60, 30)) * np.logspace(0, -3, 30)
    normal = root.T @ root / 60 + 1e-7 * np.eye(30)
    right = rng.normal(0.0, 3.0, (200, 30)) @ normal
    problem = Problem(
        normal, np.linalg.inv(normal), np.eye(30), np.eye(30), count=10, places=np.arange(30)[::-1] + 1, width=32
    )
    for bounds, sparsity in ((0.7, 0.0), (0.7, 0.01), (1e-4, 0.1), (50.0, 0.0)):
        how = {"bounds": bounds, "sparsity": sparsity}
        quick, residual = minimise(right, problem, tolerance=1e-9, **how)
        assert not quick[:, [0, 31]].any()
        quick = quick[:, 30:0:-1]
        sure = minimise_damped(normal, right, tolerance=1e-10, **how)

        def energy(c, how=how):
            held = holding_energy(c, how["sparsity"]).sum(axis=1)
            return np.einsum("fi,fi->f", c @ normal - 2 * right, c) + how["bounds"] * held

        assert np.abs(energy(quick) - energy(sure)).max() < 1e-9
        assert residual == pytest.approx(np.sqrt(((quick - right) ** 2).sum(axis=1) / 10))


@pytest.mark.parametrize("scale", [1.0, 5.0])
def test_no_frame_is_too_far_from_the_one_before_for_the_quick_method(solver, displacements, scale):
    """The quick method says of each frame how many steps it took, or that it gave up (-2)."""
    rows = scale * np.tile(displacements.reshape(len(displacements), -1), (5, 1))
    rows = rows[np.random.default_rng(3).permutation(len(rows))]
    pull = solver.holding * solver.sparsity
    stiffness = solver.holding * AT_REST / SMOOTHING
    for frames in (rows, *rows[:60, None]):
        steps = solver._whole.solve(frames, None, stiffness, pull, True, 1e-9)[3]
        assert (steps > 0).all()


def test_rounding_does_not_gather_over_a_long_take(face, layout, solver):
    """The kept inverse is corrected thousands of times; the first frame, solved again at the end, is still the same."""
    rng = np.random.default_rng(5)
    path = np.cumsum(rng.normal(0.0, 0.05, (3000, face.n_bases)), axis=0)
    moved = np.tensordot(np.clip(np.sin(path) ** 2 - 0.4, 0.0, 1.0), layout.bases(face), axes=1)
    moved[-1] = moved[0]
    one = ThinShellSolver(face, layout, threads=1)
    weights = one.solve(moved).weights
    assert np.abs(weights[-1] - weights[0]).max() < 1e-7
    assert np.abs(weights[1500] - solver.solve(moved[1500:1501]).weights[0]).max() < 1e-7


def test_whoever_asks_is_told_once_that_the_solver_is_compiled():
    heard: list[bool] = []
    on_compiling(heard.append)
    tell(once=True)
    tell(once=True)
    assert heard == [True]


@given(st.floats(-1.0, 2.0), st.floats(0.0, 0.1))
@settings(deadline=None, max_examples=200)
def test_the_holding_energy_is_convex_and_its_slope_is_its_own(weight, sparsity):
    step = 1e-6
    low, high = holding_energy(np.array([weight - step, weight + step]), sparsity)
    slope = holding_slope(np.array([weight]), sparsity)[0]
    assert (high - low) / (2 * step) == pytest.approx(slope, rel=1e-3, abs=1e-3)
    slopes = holding_slope(np.array([weight - step, weight + step]), sparsity)
    assert slopes[1] >= slopes[0]
    assert holding_curvature(np.array([weight]), sparsity)[0] >= 0.0


def test_weights_in_their_range_are_not_pushed():
    inside = np.linspace(0.0, 1.0, 101)
    assert not holding_slope(inside, 0.0).any()
    assert holding_slope(np.zeros(1), 0.01)[0] == 0.0


def test_no_weight_leaves_the_bounds_even_on_nonsense(solver, displacements):
    weights = solver.solve(displacements).weights
    assert weights.min() > -0.1
    assert weights.max() < 1.1
    wild = solver.solve(displacements * 50.0).weights
    assert np.isfinite(wild).all()


def test_a_missing_marker_is_as_if_it_had_never_been_there(face, layout, solver, displacements):
    gone = [3, 17, 30]
    holes = displacements.copy()
    holes[10:20, gone] = np.nan
    holes[15:25, 5] = np.nan
    batch = solver.solve(holes).weights
    alone = np.concatenate([solver.solve(frame[None]).weights for frame in holes])
    assert np.abs(batch - alone).max() < 1e-6
    better = np.concatenate([batch[12:13] + step for step in np.random.default_rng(0).normal(0.0, 1e-3, (50, 51))])
    better[:, ~solver.markers.observed] = 0.0
    at = solver.energy(batch[12:13], holes[12:13])[0]
    assert (solver.energy(better, np.repeat(holes[12:13], 50, axis=0)) > at).all()


def test_most_markers_may_be_missing_but_not_all(solver, displacements):
    holes = displacements[:3].copy()
    holes[0, 4:] = np.nan
    holes[1] = np.nan
    solution = solver.solve(holes)
    assert np.isfinite(solution.weights[[0, 2]]).all()
    assert np.isnan(solution.weights[1]).all()
    assert np.isnan(solution.residual[1])


def test_a_stream_gives_the_weights_of_the_batch(face, layout, displacements):
    solver = ThinShellSolver(face, layout)
    holes = displacements.copy()
    holes[20:30, 7] = np.nan
    holes[40] = np.nan
    batch = solver.solve(holes)
    live = solver.stream()
    stream = [live.push(frame) for frame in holes]
    weights = np.concatenate([solution.weights for solution in stream])
    residual = np.concatenate([solution.residual for solution in stream])
    np.testing.assert_allclose(weights, batch.weights, atol=1e-6)
    np.testing.assert_allclose(residual, batch.residual, atol=1e-6)


def test_two_streams_of_one_solver_do_not_know_of_one_another(solver, displacements):
    one, other = displacements.copy(), displacements[::-1].copy()
    one[20:30, 7] = np.nan
    other[10:15, 3] = np.nan
    alone = []
    for frames in (one, other):
        stream = solver.stream()
        alone.append([stream.push(frame) for frame in frames])
    first, second = solver.stream(), solver.stream()
    together = [(first.push(a), second.push(b)) for a, b in zip(one, other, strict=True)]
    solver.solve(one)  # nor does a batch
    for apart, beside in zip(alone, zip(*together, strict=True), strict=True):
        for a, b in zip(apart, beside, strict=True):
            np.testing.assert_array_equal(a.weights, b.weights)
            np.testing.assert_array_equal(a.residual, b.residual)


def test_the_residual_is_the_distance_to_the_solved_markers(face, layout, solver, displacements):
    solution = solver.solve(displacements)
    placed = layout.interpolate(face.pose(solution.weights)) - layout.points(face)
    distance = np.sqrt(((placed - displacements) ** 2).sum(axis=2).mean(axis=1))
    assert solution.residual == pytest.approx(distance, abs=1e-9)


def test_gaze_that_moves_no_marker_stays_at_rest(solver, displacements):
    unseen = ~solver.markers.observed
    assert {face for face, no in zip(solver.names, unseen) if no} >= {"eyeLookInLeft", "eyeLookOutRight"}
    assert not solver.solve(displacements).weights[:, unseen].any()


def test_a_greater_alpha_bends_the_skin_less(face, layout, solver, displacements):
    bent = []
    for alpha in (0.0, 0.3, 0.9):
        weights = ThinShellSolver(face, layout, alpha=alpha, sparsity=0.0).solve(displacements[:50]).weights
        own = weights[:, solver.markers.observed]
        bent.append(np.einsum("fi,ij,fj->", own, solver.shell, own))
    assert bent[0] > bent[1] > bent[2]


def test_uncertainty_grows_with_marker_error_and_missing_information(solver, displacements):
    weights = solver.solve(displacements).weights
    small, large = solver.uncertainty(weights, 0.1), solver.uncertainty(weights, 0.2)
    observed = solver.markers.observed
    np.testing.assert_allclose(large[:, observed], 2 * small[:, observed])
    assert np.isnan(small[:, ~observed]).all()
    jaw, lid = solver.names.index("jawOpen"), solver.names.index("eyeSquintRight")
    free = ((weights[:, [jaw, lid]] > 0.1) & (weights[:, [jaw, lid]] < 1.0)).all(axis=1)
    assert free.any()
    assert (small[free][:, jaw] < small[free][:, lid]).all()


def test_uncertainty_is_the_spread_under_jitter(face, layout):
    """Where no weight is at its bounds, the solver is linear, and the formula can be held to a simulation."""
    solver = ThinShellSolver(face, layout, sparsity=0.0)
    rng = np.random.default_rng(2)
    weights = np.where(solver.markers.observed, 0.5, 0.0)
    rows = np.tensordot(weights, layout.bases(face), axes=1)
    solved = solver.solve(rows + rng.normal(0.0, 0.02, (4000, 40, 3))).weights
    said = solver.uncertainty(solved[:1] * 0 + weights, 0.02)[0]
    spread = solved.std(axis=0)
    seen = solver.markers.observed & (said < 0.15)
    # The shell also shrinks the spread of what it holds; the formula counts it as knowledge, so it is an upper bound.
    assert (spread[seen] < 1.15 * said[seen]).all()
    sharp = solver.markers.observed & (said < 0.03)
    assert sharp.any()
    assert (spread[sharp] > 0.5 * said[sharp]).all()


@pytest.mark.parametrize("alpha", [-0.1, 1.1, np.nan, np.inf])
def test_alpha_lies_between_0_and_1(face, layout, alpha):
    with pytest.raises(SignfaceError, match="alpha"):
        ThinShellSolver(face, layout, alpha=alpha)


@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_either_regularisation_can_stand_alone(face, layout, displacements, alpha):
    assert np.isfinite(ThinShellSolver(face, layout, alpha=alpha).solve(displacements).weights).all()


def test_too_few_markers_are_refused(face, layout):
    with pytest.raises(SignfaceError, match="at least 4"):
        ThinShellSolver(face, layout.restricted(layout.face_labels[:3]))
    with pytest.raises(SignfaceError, match="cannot tell apart"):
        ThinShellSolver(face, layout.restricted(layout.face_labels[::4]), alpha=0.0)


def test_a_shell_makes_do_with_few_markers(face, layout):
    """Ten markers have 30 coordinates for some 46 bases: what they leave open, the least bending decides."""
    few = layout.restricted(layout.face_labels[::4])
    smile = 0.8 * few.bases(face)[[face.names.index("mouthSmileLeft")]]
    solution = ThinShellSolver(face, few).solve(smile)
    assert np.isfinite(solution.weights).all()
    assert solution.residual[0] < 0.5


def test_bases_that_markers_cannot_tell_apart_are_named(face, layout):
    twin = replace(
        face, bases=np.concatenate([face.bases, 0.5 * face.bases[[24]]]), names=(*face.names, "yawn"), identities=None
    )
    with pytest.raises(SignfaceError, match="linearly dependent") as caught:
        ThinShellSolver(twin, layout)
    assert "yawn" in str(caught.value)
    assert face.names[24] in str(caught.value)
    assert "noseSneer" not in str(caught.value)


def test_opposed_bases_are_told_apart_by_their_sign(face, layout):
    """As an eye turned in and out: what one does, the other undoes."""
    jaw = face.names.index("jawLeft")
    keep = [i for i, name in enumerate(face.names) if name != "jawRight"]
    opposed = replace(
        face,
        bases=np.concatenate([face.bases[keep], -face.bases[[jaw]]]),
        names=(*(face.names[i] for i in keep), "jawRight"),
    )
    solver = ThinShellSolver(opposed, layout)
    left = solver.solve(0.5 * layout.bases(opposed)[[opposed.names.index("jawLeft")]]).weights[0]
    assert left[opposed.names.index("jawLeft")] > 0.4
    assert abs(left[opposed.names.index("jawRight")]) < 0.02


def test_wrong_shapes_are_refused(solver):
    with pytest.raises(SignfaceError, match="shape"):
        solver.solve(np.zeros((2, 39, 3)))


@pytest.mark.parametrize("method", [method for method in METHODS if method != "measures"])
def test_every_method_finds_a_plain_smile(face, layout, method):
    smile = [face.names.index(name) for name in ("mouthSmileLeft", "mouthSmileRight")]
    truth = np.zeros(face.n_bases)
    truth[smile] = 0.7
    rng = np.random.default_rng(0)
    rows = np.tensordot(truth, layout.bases(face), axes=1) + rng.normal(0.0, 1e-4, (2, 40, 3))
    rows[1, 3] = np.nan
    solution = make_solver(method, face, layout).solve(rows)
    assert solution.weights[:, smile] == pytest.approx(
        0.7, abs={"direct-shell": 0.55}.get(method, 0.1 if method in EXACT else 0.25)
    )
    assert (solution.residual < 2.0).all()


def test_unknown_methods_are_answered_with_a_near_one(face, layout):
    with pytest.raises(SignfaceError, match="thin-shell"):
        make_solver("thinshell", face, layout)
    with pytest.raises(SignfaceError, match="has no alpha"):
        make_solver("nnls", face, layout, alpha=0.5)
