"""Agreement between annotators: known values, laws, and what the definitions demand."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.metrics import cohen_kappa_score

from signface.errors import SignfaceError
from signface.metrics.agreement import (
    NOTHING,
    _fitted,
    agreement_table,
    boundary_distances,
    cohen_kappa,
    confusion,
    frame_labels,
    gamma,
    gamma_interval,
    krippendorff_alpha,
    match_annotations,
    modified_kappa,
)
from signface.metrics.tiers import compare_tiers


def table(*rows) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=["start_s", "end_s", "label"])


@st.composite
def annotations(draw) -> pd.DataFrame:
    """Up to a dozen annotations in order, with and without gaps."""
    rows, now = [], 0.0
    for _ in range(draw(st.integers(0, 12))):
        start = now + draw(st.sampled_from([0.0, 0.0, 0.3]))
        now = start + draw(st.floats(0.1, 1.5))
        rows.append((start, now, draw(st.sampled_from("NAJ"))))
    return table(*rows)


ONE = table((0, 1, "N"), (1, 2, "J"), (3, 4, "N"))
OTHER = table((0.1, 1, "N"), (1, 2, "N"), (3.05, 4, "N"), (5, 6, "J"))


def test_moments_without_an_annotation_are_called_nothing():
    labels = frame_labels([ONE, OTHER], frame_s=0.5)
    assert labels.shape == (2, 12)
    assert labels[0].tolist() == ["N", "N", "J", "J", NOTHING, NOTHING, "N", "N", *[NOTHING] * 4]


@settings(deadline=None, max_examples=50)
@given(annotations())
def test_nobody_annotates_nothing_outside_the_annotations(one):
    labels = frame_labels([one, one])
    gaps = one["start_s"].to_numpy()[1:] - one["end_s"].to_numpy()[:-1]
    if len(one) and (gaps < 1e-9).all():
        assert NOTHING not in labels


@settings(deadline=None, max_examples=50)
@given(st.lists(st.tuples(st.sampled_from("NAJ"), st.sampled_from("NAJ")), min_size=2, max_size=40))
def test_cohens_kappa_is_that_of_scikit_learn(pairs):
    first, second = (np.array(side) for side in zip(*pairs))
    expected = cohen_kappa_score(first, second) if len(set(first) | set(second)) > 1 else np.nan
    np.testing.assert_allclose(cohen_kappa(first, second), expected, atol=1e-12)


def test_krippendorffs_alpha_of_his_own_example():
    # Krippendorff, Computing Krippendorff's alpha-reliability (2011), section A: two observers, binary data
    first = np.array(list("0100000000"))
    second = np.array(list("1110010100"))
    assert krippendorff_alpha(np.array([first, second])) == pytest.approx(0.095, abs=5e-4)


def test_krippendorffs_alpha_of_three_is_that_of_another_implementation():
    other = pytest.importorskip("krippendorff")
    codes = np.random.default_rng(0).integers(0, 4, (3, 50))
    expected = other.alpha(reliability_data=codes.astype(float), level_of_measurement="nominal")
    assert krippendorff_alpha(codes.astype(str)) == pytest.approx(expected)


def test_matches_share_enough_of_the_longer():
    long, short = table((0, 1, "N")), table((0, 0.59, "N"))
    assert match_annotations(long, short) == []
    assert match_annotations(long, table((0, 0.61, "N"))) == [(0, 0)]
    assert match_annotations(ONE, OTHER) == [(0, 0), (1, 1), (2, 2)]
    with pytest.raises(SignfaceError, match="between 0 and 1"):
        match_annotations(ONE, OTHER, overlap=0)


def test_the_table_counts_matches_twice_and_the_rest_against_nothing():
    counts = modified_kappa(ONE, OTHER).table
    assert counts.loc["N", "N"] == 4
    assert counts.loc["J", "N"] == 2
    assert counts.loc[NOTHING, "J"] == 1
    assert counts.loc[NOTHING, NOTHING] == 0
    assert counts.to_numpy().sum() == 7


def test_the_modified_kappa_by_hand():
    # margins: rows (J, N, nothing) = 2, 4, 1; columns = 1, 6, 0. Nothing's own column is empty, so "nothing" of the
    # first goes to J and N alone: the fit is the product of the margins, and chance is (2 * 1 + 4 * 6) / 49.
    chance = (2 * 1 + 4 * 6) / 49
    found = modified_kappa(ONE, OTHER)
    assert found.raw == pytest.approx(4 / 7)
    assert found.kappa == pytest.approx((4 / 7 - chance) / (1 - chance))


def test_chance_keeps_the_margins_and_leaves_the_impossible_cell_empty():
    rows, columns = np.array([10.0, 6.0, 3.0]), np.array([9.0, 8.0, 2.0])
    fitted = _fitted(rows, columns)
    np.testing.assert_allclose(fitted.sum(axis=1), rows, atol=1e-9)
    np.testing.assert_allclose(fitted.sum(axis=0), columns, atol=1e-9)
    assert fitted[-1, -1] == 0
    odds = fitted[0, 0] * fitted[1, 1] / (fitted[0, 1] * fitted[1, 0])
    assert odds == pytest.approx(1.0)  # quasi-independence: no association where there may be one


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(annotations(), annotations())
def test_every_measure_is_symmetric(first, second):
    for there, back in zip(
        (modified_kappa(first, second).kappa, cohen_kappa(*frame_labels([first, second]))),
        (modified_kappa(second, first).kappa, cohen_kappa(*frame_labels([second, first]))),
    ):
        np.testing.assert_allclose(there, back, atol=1e-6)


@settings(deadline=None, max_examples=40)
@given(annotations())
def test_everyone_agrees_with_himself(one):
    if one["label"].nunique() < 2:
        return
    assert modified_kappa(one, one).kappa == pytest.approx(1.0)
    labels = frame_labels([one, one])
    assert cohen_kappa(*labels) == pytest.approx(1.0)
    assert krippendorff_alpha(labels) == pytest.approx(1.0)
    assert (boundary_distances(one, one)[["start_s", "end_s"]] == 0).all(axis=None)


def test_a_moved_boundary_is_measured_with_its_sign():
    moved = table((0.0, 1.1, "N"), (1.1, 1.9, "J"))
    distances = boundary_distances(table((0.0, 1.0, "N"), (1.0, 2.0, "J")), moved)
    np.testing.assert_allclose(distances["start_s"], [0, 0.1], atol=1e-12)
    np.testing.assert_allclose(distances["end_s"], [0.1, -0.1], atol=1e-12)


def test_the_confusion_table_holds_all_the_time_there_is():
    seconds = confusion(frame_labels([ONE, OTHER]))
    assert list(seconds.columns) == ["J", "N", NOTHING]
    assert seconds.to_numpy().sum() == pytest.approx(6.0)
    assert seconds.loc["J", "N"] == pytest.approx(1.0)
    assert seconds.loc[NOTHING, "J"] == pytest.approx(1.0)
    assert seconds.loc["N", NOTHING] == pytest.approx(0.15, abs=0.011)


def test_the_table_names_every_pair_and_all_together():
    found = agreement_table({"eva": ONE, "tom": OTHER, "machine": ONE})
    assert list(found["annotators"]) == ["eva / tom", "eva / machine", "tom / machine", "all"]
    assert found["cohen_kappa"][1] == pytest.approx(1.0)
    assert found["start_ms"][0] == pytest.approx(50)


def test_nothing_annotated_at_all_is_no_crash():
    empty = table()
    found = agreement_table({"a": empty, "b": empty})
    assert np.isnan(found["cohen_kappa"][0])
    assert np.isnan(found["modified_kappa"][0])


def test_gamma_is_below_one_for_others_and_the_same_for_one_seed():
    pytest.importorskip("pygamma_agreement")
    found, low, high = gamma_interval([ONE, OTHER], seed=1)
    assert low <= found <= high < 1.0
    assert high - low < 0.1
    assert found == gamma([ONE, OTHER], seed=1)
    table = agreement_table({"one": ONE, "other": OTHER}, with_gamma=True, seed=1)
    assert table.loc[0, ["gamma", "gamma_low", "gamma_high"]].tolist() == [found, low, high]


def test_tiers_that_not_everybody_has_are_no_comparison():
    table = pd.DataFrame({"start_s": [0.0], "end_s": [1.0], "label": ["N"]})
    both = {"eva": {"affect": table, "brows": table}, "tom": {"affect": table}}
    assert [agreement.tier for agreement in compare_tiers(both)] == ["affect"]
    with pytest.raises(SignfaceError, match="not every file has a tier brows"):
        compare_tiers(both, tiers=["brows"])
    with pytest.raises(SignfaceError, match="two files or more"):
        compare_tiers({"eva": both["eva"]})
