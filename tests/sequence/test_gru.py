"""The recurrent network: trained by PyTorch, applied by NumPy."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from signface.errors import SignfaceError
from signface.label.labelling import find_segments
from signface.label.persistence import load_model
from signface.sequence.gru import RecurrentLabeller, boundary_marks, recurrent_outputs
from signface.sequence.gru_training import make_network, weights_of
from tests.fixtures.hand_made import corpus, example


@pytest.fixture(scope="module")
def takes():
    return corpus()


def barely_trained(takes, *, seed: int = 0) -> RecurrentLabeller:
    labeller = RecurrentLabeller(networks=1, units=8, effort=6.0, seed=seed)
    return labeller.fit([e.descriptors for e in takes], [e.reference for e in takes])


def test_numpy_says_what_pytorch_says():
    torch = pytest.importorskip("torch")
    torch.manual_seed(4)
    networks = [make_network(7, 5, 6).eval() for _ in range(2)]
    weights = [weights_of(network) for network in networks]
    stacked = {name: np.stack([one[name] for one in weights]) for name in weights[0]}
    features = np.random.default_rng(4).normal(size=(23, 7)).astype(np.float32)
    with torch.no_grad():
        theirs = [network(torch.from_numpy(features)[None])[0].numpy() for network in networks]
    assert recurrent_outputs(stacked, features) == pytest.approx(np.array(theirs), abs=1e-5)


@pytest.mark.slow
def test_one_seed_gives_one_network_and_another_seed_another(takes):
    pytest.importorskip("torch")
    first, second, other = (barely_trained(takes[:6], seed=seed).weights_ for seed in (1, 1, 2))
    assert all(np.array_equal(values, second[name]) for name, values in first.items())
    assert not any(np.array_equal(values, other[name]) for name, values in first.items())


def test_a_face_and_its_mirror_image_are_two_lessons_of_one_kind():
    model = RecurrentLabeller()
    model.bases_, model.mean_ = ("jawOpen", "smileLeft", "smileRight"), np.zeros(3 * 10 + 4)
    mirrored = model._mirrored()
    assert mirrored[:6].tolist() == [0, 2, 1, 3, 5, 4]
    assert mirrored[-4:].tolist() == [30, 31, 32, 33]
    assert mirrored[mirrored].tolist() == list(range(34))


def test_a_boundary_weighs_one_wherever_it_lies_and_most_at_its_place():
    one = example(["N", "J", "N"])
    marks = boundary_marks(one.descriptors, one.reference, 200)
    moving = one.reference.table.query("kind == 'transition'")
    assert marks.sum(axis=0) == pytest.approx([len(moving), len(moving)], rel=1e-3)
    middles = one.descriptors.start + (np.arange(200) + 0.5) * one.descriptors.duration / 200
    at = middles[marks[:100, 0].argmax()]
    assert abs(at - moving["start_s"].iloc[0]) <= one.descriptors.duration / 200


def test_without_pytorch_a_model_annotates_but_none_is_trained(takes, monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(SignfaceError, match="needs PyTorch") as refused:
        barely_trained(takes[:6])
    assert "signface[deep]" in str(refused.value.hint)
    shipped = load_model("default")
    assert shipped.sequential
    weights = np.zeros((100, len(shipped.card.bases)))
    rest = example(["N"]).descriptors
    one = type(rest)(weights, shipped.card.bases, 50.0, name="rest")
    assert len(find_segments(one, shipped).table) >= 1
