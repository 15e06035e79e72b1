"""The benchmark of generalisation: its rows are what they say; the shipped classifier does better than no answer."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.generalisation import (
    CONDITIONS,
    SEED,
    everything_neutral,
    make_example,
    measure,
    requests,
    table,
)
from signface.label.persistence import load_model
from signface.synth.other.corpus import OtherRequest

BY_NAME = {condition.name: condition for condition in CONDITIONS}


def test_its_signers_are_of_no_training():
    from models.build_classifier import SEED as TRAINED
    from models.build_classifier import TEST_SEED

    assert SEED not in (TRAINED, TEST_SEED)


def test_every_utterance_is_signed_once_and_by_three_signers():
    own = requests(BY_NAME["30 Hz"])
    assert sorted(request.number for request in own) == list(range(18))
    assert {request.signer for request in own} == {0, 1, 2}
    assert all(isinstance(request, OtherRequest) for request in requests(BY_NAME["another generator, true weights"]))


def test_who_calls_everything_neutral_is_right_as_often_as_neutral_is():
    example = make_example(BY_NAME["another generator, true weights"], OtherRequest(SEED, 0, "EU", 0))
    stable = example.stable
    values = everything_neutral([example])
    assert values["reference"] == pytest.approx((stable["label"] == "N").mean())
    lengths = stable["end_s"] - stable["start_s"]
    end = example.reference.table["end_s"].max()
    assert values["frames"] == pytest.approx(lengths[stable["label"] == "N"].sum() / end, abs=1e-6)


@pytest.mark.slow
def test_the_shipped_classifier_holds_on_landmarks_of_a_film():
    """On its own generator's utterances at 30 Hz with 2 mm of jitter: the signers are of no training."""
    condition = BY_NAME["30 Hz and 2 mm"]
    examples = [make_example(condition, request) for request in requests(condition)[::5]]
    measured = measure(load_model("default"), examples)
    neutral = everything_neutral(examples)
    assert measured["reference"] > neutral["reference"] + 0.1
    assert measured["frames"] > neutral["frames"] + 0.1
    assert np.isfinite(list(measured.values())).all()
    assert "30 Hz and 2 mm" in table({condition.name: {"default": measured, "everything neutral": neutral}})
