"""What a model abstains from: takes unlike its training, and only those."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from signface.annotation import annotate
from signface.elan.writing import write_eaf
from signface.evaluation.protocol import score_model
from signface.label.familiarity import (
    NAMES,
    abstained,
    familiarity,
    fit_familiarity,
    measures,
)
from signface.label.labelling import find_segments
from signface.label.persistence import load_model, save_model
from signface.label.vocabulary import UNKNOWN
from signface.segmentation.segments import Segments

#: Of these slopes a take is known or not by its offset alone.
FLAT = {name: {"mean": 0.0, "scale": 1.0, "slope": 0.0} for name in NAMES}
KNOWN, STRANGE = ({**FLAT, "limit": {"offset": offset, "least": 0.5}} for offset in (3.0, -3.0))


def with_familiarity(model, learnt):
    return replace(model, card=replace(model.card, familiarity=learnt))


@pytest.fixture(scope="module")
def mini_weights():
    import signface as sf

    return sf.datasets.mini_weights()


@pytest.fixture(scope="module")
def model():
    return with_familiarity(load_model("default"), {})


def rows(centre, count, seed):
    rng = np.random.default_rng(seed)
    return [dict(zip(NAMES, rng.normal(centre, 1.0, len(NAMES)), strict=True)) for _ in range(count)]


def test_what_is_learnt_tells_takes_apart_that_it_has_not_seen():
    learnt = fit_familiarity(rows(0.0, 60, 0), rows(2.0, 30, 1))
    like = [familiarity(row, learnt) for row in rows(0.0, 200, 2)]
    unlike = [familiarity(row, learnt) for row in rows(2.0, 200, 3)]
    assert np.mean(np.array(like) > 0.5) > 0.9
    assert np.mean(np.array(unlike) < 0.5) > 0.9
    assert np.mean(np.array(like) < learnt["limit"]["least"]) < 0.1


def test_the_limit_loses_few_of_the_known_takes():
    known = rows(0.0, 100, 0)
    learnt = fit_familiarity(known, rows(0.5, 100, 1))
    assert sum(familiarity(row, learnt) < learnt["limit"]["least"] for row in known) <= 3


def test_one_measure_alone_tells_too_and_what_is_not_known_says_nothing():
    known = [{**row, "residual": float("nan")} for row in rows(0.0, 60, 0)]
    learnt = fit_familiarity(known, [{**row, "residual": 1.0} for row in rows(2.0, 60, 1)])
    nothing = familiarity({}, learnt)
    assert nothing == pytest.approx(familiarity(dict.fromkeys(NAMES, float("nan")), learnt))
    assert familiarity({"confidence": 0.0}, learnt) > nothing > familiarity({"confidence": 2.0}, learnt)


def test_a_known_take_keeps_its_labels(mini_weights, model):
    plain = find_segments(mini_weights, model)
    pd.testing.assert_frame_equal(find_segments(mini_weights, with_familiarity(model, KNOWN)).table, plain.table)


def test_in_a_strange_take_what_is_not_neutral_is_unknown(mini_weights, model):
    plain = find_segments(mini_weights, model).table
    found = find_segments(mini_weights, with_familiarity(model, STRANGE)).table
    stable = found[found["kind"] == "stable"]
    assert set(stable["label"]) == {"N", UNKNOWN}
    neutral = [frame[frame["label"] == "N"][["start_s", "end_s"]].to_numpy() for frame in (plain, found)]
    np.testing.assert_allclose(*neutral)
    assert (found["start_s"].to_numpy()[1:] >= found["end_s"].to_numpy()[:-1] - 1e-9).all()
    assert found["end_s"].max() == pytest.approx(plain["end_s"].max())
    assert found["intensity"].isna().all()


def test_neighbours_that_are_unknown_are_one(mini_weights, model):
    parts = [("J", 0.0, 1.0), ("JA", 1.0, 1.2), ("A", 1.2, 2.0), ("AN", 2.0, 2.3), ("N", 2.3, 3.0)]
    table = pd.DataFrame(
        [(start, end, "stable" if len(label) == 1 else "transition", label, 0.8) for label, start, end in parts],
        columns=["start_s", "end_s", "kind", "label", "confidence"],
    )
    found = abstained(mini_weights, Segments(table), with_familiarity(model, STRANGE)).table
    assert found[["label", "start_s", "end_s"]].to_numpy().tolist() == [
        [UNKNOWN, 0.0, 2.0],
        [f"{UNKNOWN}N", 2.0, 2.3],
        ["N", 2.3, 3.0],
    ]


def test_the_summary_and_the_eaf_say_so(mini_weights, model, tmp_path):
    strange = annotate(mini_weights, with_familiarity(model, STRANGE))
    assert "unlike what default knows" in str(strange)
    assert "unknown" in str(strange)
    written = tmp_path / "take.eaf"
    write_eaf(strange, written)
    text = written.read_text(encoding="utf-8")
    assert ">unknown<" in text
    assert "unlike what default knows" in text
    assert "unlike" not in str(annotate(mini_weights, with_familiarity(model, KNOWN)))


def test_the_file_of_a_model_keeps_it(model, tmp_path):
    save_model(with_familiarity(model, STRANGE), tmp_path / "strange.skops")
    assert load_model(tmp_path / "strange.skops").card.familiarity == STRANGE
    save_model(model, tmp_path / "plain.skops")
    assert load_model(tmp_path / "plain.skops").card.familiarity == {}


def test_an_evaluation_counts_what_is_unknown_as_not_right(model):
    import signface as sf

    examples = [e for e in sf.datasets.mini_examples() if e.kind == "IE"]
    scores = score_model(with_familiarity(model, STRANGE), examples)["automatic_segments"]
    assert scores["labels"][-1] == UNKNOWN
    assert scores["accuracy"] < score_model(model, examples)["automatic_segments"]["accuracy"]


def test_measures_of_a_take_are_numbers(mini_weights, model):
    told = measures(mini_weights, find_segments(mini_weights, model), model)
    assert tuple(told) == NAMES
    assert np.isfinite([told["confidence"], told["jitter"], told["distance"]]).all()
