"""Bases that the markers cannot see: laws of the criterion, and how files, summaries and channels say it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import signface as sf
from signface.channels.rules import find_channels, read_channels, unseen_values
from signface.columns import joined_sides
from signface.face.mesh import Mesh
from signface.solver.observability import LET_THROUGH, unobserved_bases
from signface.solver.thin_shell import ThinShellSolver

LIDS = {f"eye{what}{side}" for what in ("Blink", "Wide", "LookUp", "LookDown") for side in ("Left", "Right")}


@pytest.fixture(scope="module")
def face():
    return sf.read_face()


@pytest.fixture(scope="module")
def layout(face):
    return sf.read_layout("default-40", face)


@pytest.fixture(scope="module")
def blind(layout):
    return layout.restricted([label for label in layout.labels if "LID" not in label])


def test_without_markers_on_the_lids_what_the_lids_show_is_named(face, layout, blind):
    assert set(unobserved_bases(ThinShellSolver(face, blind))) >= LIDS
    seen = LIDS - set(unobserved_bases(ThinShellSolver(face, layout)))
    assert {"eyeBlinkLeft", "eyeBlinkRight", "eyeWideLeft", "eyeWideRight"} <= seen


@pytest.mark.parametrize("name", ["default-40", "openface", "kinect"])
def test_a_base_that_is_not_named_is_recovered_and_one_that_is_named_is_not(face, name):
    own = sf.read_layout(name, face)
    solver = ThinShellSolver(face, own)
    given = np.diag(solver.solve(own.bases(face)).weights)
    named = np.isin(face.names, unobserved_bases(solver))
    assert given[~named].min() > 0.9
    assert given[named].max(initial=0.0) < LET_THROUGH


def test_a_base_that_moves_no_marker_is_always_named(face, layout):
    rng = np.random.default_rng(3)
    usual = set(unobserved_bases(ThinShellSolver(face, layout)))
    for base in rng.choice(face.n_bases, 6, replace=False):
        bases = layout.bases(face)
        bases[base] = 0.0
        named = set(unobserved_bases(ThinShellSolver(face, layout, signer_bases=bases)))
        assert face.names[base] in named
        assert len(named - usual) <= 3  # the median base, and who is explained by whom, may change a little


def test_the_unit_of_length_changes_nothing(face, blind):
    metres = replace(
        face,
        mesh=Mesh(face.mesh.vertices / 1000, face.mesh.triangles),
        bases=face.bases / 1000,
        identities=None if face.identities is None else face.identities / 1000,
    )
    assert unobserved_bases(ThinShellSolver(metres, blind)) == unobserved_bases(ThinShellSolver(face, blind))


def test_weights_carry_what_was_not_seen_into_their_file_and_through_a_choice_of_bases(blind, tmp_path):
    solved = sf.solve(sf.datasets.mini_take(), layout=blind)
    assert set(solved.unobserved) >= LIDS
    sf.write_weights(solved, tmp_path / "weights.parquet")
    assert sf.read_weights(tmp_path / "weights.parquet").unobserved == solved.unobserved
    assert solved.between(1.0, 2.0).unobserved == solved.unobserved
    assert solved.on(["jawOpen", "eyeBlinkLeft"]).unobserved == ("eyeBlinkLeft",)
    with pytest.raises(sf.SignfaceError, match="unobserved"):
        solved.changed("wrong", unobserved=("nobody",))


def test_channels_that_need_them_are_left_out_and_said_to_be(blind):
    take = sf.datasets.mini_take()
    annotation = sf.annotate(take, sf.load_model("default"), layout=blind, channels=True)
    assert annotation.unseen == {"eyes": ("wide", "closed"), "blinks": ("blink",)}
    assert "blinks" not in annotation.channels
    assert "eyes" in annotation.channels  # squinting is seen
    assert "cannot be seen: eyes (wide, closed); blinks" in str(annotation)
    assert annotation.facts["unseen"] == "eyes (wide, closed); blinks"
    assert annotation.facts["unobserved"] == joined_sides(annotation.descriptors.unobserved)
    whole = sf.annotate(take, sf.load_model("default"), channels=True)
    assert not whole.unseen
    assert "blinks" in whole.channels
    assert "cannot be seen" not in str(whole)


def test_one_blind_side_leaves_the_channel_to_the_other():
    weights = np.zeros((200, 2))
    weights[50:150, 1] = 0.9
    names = ("eyeBlinkLeft", "eyeBlinkRight")
    take = sf.Descriptors(weights, names, rate=100, unobserved=names[:1])
    rules = read_channels()
    assert not unseen_values(take, rules)
    values = {events.channel: events.table["value"].tolist() for events in find_channels(take, rules)}
    assert values["eyes"] == ["closed"]
    told_nothing = replace(take, unobserved=())
    values = {events.channel: events.table["value"].tolist() for events in find_channels(told_nothing, rules)}
    assert values["eyes"] == []  # as 0 the blind side halves the mean
