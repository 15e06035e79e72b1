"""The error of layouts, the Gaussian processes behind it, and the study that can be resumed."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from signface.cli.main import main
from signface.errors import SignfaceError
from signface.face.layout_files import read_layout
from signface.placement.comparison import ComparisonPlan, load_cell, save_cell
from signface.placement.empirical import place_layout
from signface.placement.evaluation import error_map, evaluate_layout, skin_metric
from signface.placement.findings import against, flattening
from signface.render.layout_sheet import distances, numbering
from signface.solver.rivals.gaussian_process import GaussianProcess, SparseOnlineGaussianProcess
from signface.synth.actors import Virtual, draw_actors


def test_the_skin_metric_is_the_error_of_eq_3_5(face):
    rng = np.random.default_rng(0)
    true, found = rng.random((2, 7, face.n_bases))
    apart = (face.pose(true) - face.pose(found))[:, face.moving]
    eq_3_5 = np.sqrt((apart**2).sum(axis=(1, 2)).mean())
    error = true - found
    mine = np.sqrt(np.einsum("fi,ij,fj->f", error, skin_metric(face), error).mean())
    assert mine * np.sqrt(face.moving.sum()) == pytest.approx(eq_3_5)


def test_an_error_map_adds_up_to_the_error(face):
    error = np.random.default_rng(1).normal(size=(9, face.n_bases))
    moment = error.T @ error / len(error)
    painted = error_map(face, moment)[face.moving]
    assert np.sqrt((painted**2).mean()) == pytest.approx(np.sqrt((skin_metric(face) * moment).sum()))


def test_an_actor_does_not_depend_on_how_many_there_are(face, actors):
    alone = draw_actors(face, 1, seconds=12.0, seed=5)[0]
    assert np.array_equal(alone.range_of_motion, actors[0].range_of_motion)
    assert np.array_equal(alone.head.face.mesh.vertices, actors[0].head.face.mesh.vertices)


def test_the_avatars_own_bases_do_not_explain_an_actors_skin(face, actors):
    """Else every solve would invert the program that made the data."""
    actor = actors[0]
    layout = read_layout("default-40", face)
    positions = Virtual.clean(layout).record(actor, actor.takes[::6], np.random.default_rng(0))
    moved = positions - Virtual.clean(layout).record(actor, np.zeros((1, face.n_bases)), np.random.default_rng(0))
    predicted = np.tensordot(actor.shown(actor.takes[::6]), layout.bases(face), axes=1)
    assert np.sqrt(((moved - predicted) ** 2).sum(axis=2).mean()) > 0.3


def test_glued_markers_stand_aside(face, actors):
    layout = read_layout("default-40", face)
    rng = np.random.default_rng(0)
    glued = Virtual.glued(layout, actors[0], rng)
    places = actors[0].head.face.mesh.vertices
    here = np.einsum("pkd,pk->pd", places[glued.corners], glued.barycentric)
    apart = np.linalg.norm(here - layout.points(actors[0].head.face), axis=1)
    assert 0.8 < np.median(apart) < 3.2


def test_every_mapping_is_tested_on_somebody_else_and_the_solve_tells_most_of_the_face(face, actors):
    layout = read_layout("default-40", face)
    truth = actors[1].shown(actors[1].takes[::3])
    rest = np.sqrt(np.einsum("fi,ij,fj->f", truth, skin_metric(face), truth).mean())
    found = evaluate_layout(face, layout, actors, ["B"], condition="glued")
    assert {own.mapping for own in found} == {"gp", "sogp", "thin-shell"}
    for own in found:
        assert own.test == "B"
        assert own.train in ("A", "-")
        assert np.isfinite(own.rms_mm)  # twelve seconds teach a Gaussian process nothing to compare
    solved = next(own for own in found if own.mapping == "thin-shell")
    assert solved.rms_mm < 0.6 * rest


def test_fifteen_markers_are_enough_for_the_thin_shell(face, actors):
    found = evaluate_layout(face, place_layout("man-15", face), actors, ["B"], mappings=["thin-shell"])
    assert np.isfinite(found[0].rms_mm)


def test_a_gaussian_process_interpolates_a_smooth_function():
    rng = np.random.default_rng(0)
    x = rng.uniform(-2, 2, (160, 2))
    y = np.column_stack([np.sin(x[:, 0]), x[:, 1] ** 2])
    new = rng.uniform(-1.5, 1.5, (50, 2))
    truth = np.column_stack([np.sin(new[:, 0]), new[:, 1] ** 2])
    assert np.abs(GaussianProcess().fit(x, y).predict(new) - truth).max() < 0.05
    assert np.abs(SparseOnlineGaussianProcess(100).fit(x, y).predict(new) - truth).max() < 0.15


def test_the_online_process_with_room_for_all_is_the_exact_one():
    rng = np.random.default_rng(2)
    x = rng.uniform(-2, 2, (60, 3))
    y = np.sin(x).sum(axis=1, keepdims=True) + 0.05 * rng.standard_normal((60, 1))
    new = rng.uniform(-2, 2, (30, 3))
    exact, online = GaussianProcess().fit(x, y), SparseOnlineGaussianProcess(60).fit(x, y)
    assert (exact.length_, exact.noise_) == (online.length_, online.noise_)
    assert np.abs(exact.predict(new) - online.predict(new)).max() < 0.02


def test_fewer_basis_vectors_never_exceed_the_budget():
    x = np.random.default_rng(3).normal(size=(200, 4))
    model = SparseOnlineGaussianProcess(25).fit(x, x[:, :2] ** 2)
    assert len(model.vectors_) <= 25
    assert np.isfinite(model.predict(x)).all()


def test_a_cell_is_read_back_as_it_was_kept_and_a_damaged_one_is_done_again(face, actors, tmp_path):
    found = evaluate_layout(face, read_layout("default-40", face), actors, ["B"], mappings=["thin-shell"])
    save_cell(found, tmp_path / "cell.npz")
    again = load_cell(tmp_path / "cell.npz")
    assert again is not None
    assert again[0].rms_mm == found[0].rms_mm
    assert np.array_equal(again[0].moment, found[0].moment)
    (tmp_path / "cell.npz").write_bytes(b"PK\x03\x04 torn")
    assert load_cell(tmp_path / "cell.npz") is None


def test_a_study_needs_somebody_to_test_on():
    with pytest.raises(SignfaceError, match="test on"):
        ComparisonPlan(actors=2, selection=2)


def _errors(layout, family, markers, values):
    return pd.DataFrame(
        {
            "layout": layout,
            "family": family,
            "markers": markers,
            "condition": "glued",
            "draw": range(len(values)),
            "mapping": "gp",
            "train": "A",
            "test": "B",
            "rms_mm": values,
        }
    )


def test_a_curve_flattens_where_five_per_cent_of_its_least_is_reached():
    table = pd.concat([_errors(f"m-{k}", "m", k, [e]) for k, e in ((15, 2.0), (30, 1.04), (40, 1.0), (60, 1.01))])
    found = flattening(table).iloc[0]
    assert (found["enough"], found["at"]) == (30, 40)


def test_layouts_are_compared_pair_by_pair():
    table = pd.concat([_errors("one", "m", 40, [1.0, 2.0]), _errors("other", "n", 40, [1.5, 1.9])])
    found = against(table, "one", "other").iloc[0]
    assert found["pairs"] == 2
    assert found["better"] == 0.5
    assert found["change"] == pytest.approx(1 - 3.0 / 3.4)


def test_the_sheet_numbers_every_marker_once_and_measures_as_a_calliper(face):
    layout = read_layout("default-40", face)
    numbers = numbering(layout, face)
    assert sorted(numbers.values()) == list(range(1, 41))
    table = distances(layout, face)
    first, near = table.iloc[0], int(table.iloc[0]["nearest"]) - 1
    here, there = layout.points(face, [first["marker"], table.iloc[near]["marker"]])
    assert abs(np.linalg.norm(here - there) - first["nearest_mm"]) <= 0.5


@pytest.mark.slow
def test_one_command_makes_the_report_and_a_second_run_resumes(tmp_path, capsys, face):
    command = ["layout", "study", "-o", str(tmp_path), "--seconds", "6", "--actors", "3", "--sizes", "15"]
    command += ["--methods", "a-optimal", "--layouts", "man-15,default-40", "--draws", "1", "--recommended", "15"]
    assert main([*command, "--jobs", "1"]) == 0
    page = (tmp_path / "report.html").read_text()
    assert "<svg" in page
    assert "data:image/png" in page
    assert read_layout(tmp_path / "recommended-15.csv", face).head_labels
    for ending in ("pdf", "svg", "png"):
        assert (tmp_path / f"recommended-15-sheet.{ending}").stat().st_size > 10_000
    table = pd.read_csv(tmp_path / "errors.csv")
    assert set(table["test"]) == {"C"}
    capsys.readouterr()
    first = next((tmp_path / "cells").glob("*.npz"))
    first.unlink()
    assert main([*command, "--jobs", "1"]) == 0
    assert "were done before" in capsys.readouterr().out
    assert (tmp_path / "report.html").read_text() == page


@pytest.mark.slow
def test_the_command_says_in_a_line_what_cannot_be(tmp_path, capsys):
    command = ["layout", "optimise", "--seconds", "6", "--actors", "1", "--method", "d-optimal"]
    assert main([*command, "--markers", "5000", "-o", str(tmp_path / "x.csv")]) == 2
    assert "5000 markers" in capsys.readouterr().err
    assert main(["layout", "place", "nobody-12", "-o", str(tmp_path / "x.csv")]) == 2
    assert "nobody-12" in capsys.readouterr().err
