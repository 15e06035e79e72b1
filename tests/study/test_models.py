"""Models with participants as random effects, intervals over participants and power."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import approx_fprime

from signface.errors import SignfaceError
from signface.study.reading import validate
from signface.study.statistics.intervals import difference_intervals, participant_interval
from signface.study.statistics.mixed_models import OrdinalMixedModel
from signface.study.statistics.model_tables import compare_methods
from signface.study.statistics.power import participants_needed, smallest_difference
from signface.study.statistics.random_effects import Levels
from signface.study.statistics.simulation import Effects, crossed_design, simulate

# Bitterness of wine, 9 judges, 2 temperatures x contact or none x 2 bottles (Randall, Biometrical Journal 31, 1989)
BITTERNESS = "23344455 12132354 23325544 32323253 23433333 32322454 11222323 22233334 12323244".replace(" ", "")


def wine() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    judge = np.repeat(np.arange(9), 8)
    warm, contact = np.tile([0, 0, 0, 0, 1, 1, 1, 1], 9), np.tile([0, 0, 1, 1, 0, 0, 1, 1], 9)
    return np.array(list(BITTERNESS), float), np.column_stack([warm, contact]), judge


def test_the_mixed_model_gives_the_published_fit_of_the_wine_data():
    """R's ordinal::clmm(rating ~ temp + contact + (1 | judge)), Laplace's approximation (Christensen 2019)."""
    answers, fixed, judge = wine()
    fit = OrdinalMixedModel(answers, fixed, [judge]).fit()
    assert fit.converged
    assert fit.log_likelihood == pytest.approx(-81.565409, abs=1e-5)
    assert fit.coefficients == pytest.approx([3.0630, 1.8349], abs=2e-4)
    assert fit.thresholds == pytest.approx([-1.6237, 1.5134, 4.2285, 6.0888], abs=2e-4)
    assert fit.spreads == pytest.approx([1.1311], abs=2e-4)
    assert np.sqrt(np.diag(fit.covariance)) == pytest.approx([0.5954, 0.5125], abs=2e-4)


def test_a_grouping_that_explains_nothing_gets_no_spread():
    answers, fixed, judge = wine()
    bottle = np.tile(np.arange(8), 9)
    alone = OrdinalMixedModel(answers, fixed, [judge]).fit()
    both = OrdinalMixedModel(answers, fixed, [judge, bottle]).fit()
    assert both.spreads[1] < 1e-2
    assert both.log_likelihood == pytest.approx(alone.log_likelihood, abs=1e-4)
    assert both.coefficients == pytest.approx(alone.coefficients, abs=1e-3)


def test_without_random_effects_it_is_statsmodels_ordered_model():
    ordered = pytest.importorskip("statsmodels.miscmodels.ordinal_model")
    answers, fixed, _ = wine()
    theirs = ordered.OrderedModel(pd.Series(pd.Categorical(answers, ordered=True)), fixed, distr="logit").fit(disp=0)
    ours = OrdinalMixedModel(answers, fixed, []).fit()
    assert ours.log_likelihood == pytest.approx(theirs.llf, abs=1e-5)
    assert ours.coefficients == pytest.approx(np.asarray(theirs.params)[:2], abs=1e-3)


@settings(deadline=None, max_examples=15)
@given(st.lists(st.floats(-1, 1), min_size=8, max_size=8))
def test_the_gradient_is_that_of_the_likelihood(around):
    answers, fixed, judge = wine()
    pairs = [f"{who} {what}" for who, what in zip(judge, fixed[:, 0])]
    model = OrdinalMixedModel(answers, fixed, [judge, pairs])
    point = np.array([-1.5, 0.9, 0.9, 0.6, 2.5, 1.5, 0.9, 0.6]) + 0.4 * np.array(around)
    numeric = approx_fprime(point, lambda at: model._negative(at)[0], 1e-6)
    assert model._negative(point)[1] == pytest.approx(numeric, abs=2e-3, rel=2e-4)


def test_reversed_answers_reverse_the_coefficients():
    answers, fixed, judge = wine()
    there = OrdinalMixedModel(answers, fixed, [judge]).fit()
    back = OrdinalMixedModel(-answers, fixed, [judge]).fit()
    assert back.coefficients == pytest.approx(-there.coefficients, abs=1e-3)
    assert back.log_likelihood == pytest.approx(there.log_likelihood, abs=1e-6)


def test_constant_answers_make_no_model():
    with pytest.raises(SignfaceError, match="two different answers"):
        OrdinalMixedModel([4, 4, 4], np.zeros((3, 0)), [])


@pytest.mark.slow
def test_a_planted_difference_is_found_and_its_size_recovered():
    design = crossed_design("two", ["A", "B"], ["answer_intensity"], 24)
    effects = Effects({("B", "answer_intensity"): -0.5}, participants=0.6, reactions=0.1)
    responses = validate(simulate(design, effects, seed=4))
    found = compare_methods(responses, "answer_intensity")
    assert found.likelihood_ratio.p < 1e-4
    assert found.averaged.p < 1e-3
    assert found.over_participants.p < 1e-3
    assert found.mixed is not None
    # a normal latent answer of spread 1 is a logistic one of spread 1.7: 0.5 is about 0.85 logits
    assert found.mixed.coefficients[0] == pytest.approx(-0.85, abs=0.35)
    assert found.spreads["participants"] == pytest.approx(0.6 * 1.7, abs=0.5)


def test_intervals_cover_the_mean_and_shrink_with_more_participants():
    rng = np.random.default_rng(0)
    wide, narrow = [], []
    for people, kept in ((10, wide), (90, narrow)):
        table = pd.DataFrame(
            {"participant": np.repeat(np.arange(people).astype(str), 6), "method": np.tile(list("abc"), 2 * people)}
        ).assign(y=rng.normal(4, 1, 6 * people))
        mean, low, high = participant_interval(table, "y", seed=1)
        assert mean == pytest.approx(table["y"].mean())
        assert low < mean < high
        kept.append(high - low)
        differences = difference_intervals(table, "y", ["a", "b", "c"], seed=1)
        means = table.groupby("method")["y"].mean()
        for (first, second), (difference, lower, upper) in differences.items():
            assert difference == pytest.approx(means[first] - means[second])
            assert lower < difference < upper
    assert narrow[0] < wide[0]


def test_the_same_seed_gives_the_same_interval():
    table = pd.DataFrame({"participant": np.arange(30).astype(str), "y": np.random.default_rng(0).normal(4, 1, 30)})
    assert participant_interval(table, "y", seed=3) == participant_interval(table, "y", seed=3)
    assert participant_interval(table, "y", seed=3) != participant_interval(table, "y", seed=4)


@pytest.mark.slow
@settings(deadline=None, max_examples=20)
@given(st.floats(0.1, 2), st.integers(5, 60))
def test_the_number_of_participants_that_find_a_difference_undoes_the_difference_they_find(spread, participants):
    difference = smallest_difference(spread, participants)
    assert abs(participants_needed(difference, spread) - participants) <= 1
    assert smallest_difference(spread, participants + 5) < difference
    assert participants_needed(difference / 2, spread) > participants


@pytest.mark.slow
def test_power_is_that_of_a_simulated_study():
    """Normal differences of 30 participants: Wilcoxon's test finds the promised one in about 80 % of studies."""
    from signface.study.statistics.rank_tests import wilcoxon

    rng, difference = np.random.default_rng(1), smallest_difference(1.0, 30)
    found = [wilcoxon(rng.normal(difference, 1, 30), np.zeros(30)).p < 0.05 for _ in range(400)]
    assert np.mean(found) == pytest.approx(0.8, abs=0.06)


@settings(deadline=None, max_examples=20)
@given(st.integers(2, 6), st.integers(1, 3), st.integers(1, 4), st.integers(0, 2**32 - 1))
def test_the_block_system_is_the_written_out_one(people, methods, stimuli, seed):
    rng = np.random.default_rng(seed)
    kept = rng.random(people * methods * stimuli) < 0.8  # participants who stopped: blocks of unequal size
    who, how, what = (axis.ravel()[kept] for axis in np.indices((people, methods, stimuli)))
    if not len(who):
        return
    levels = Levels(len(who), [what, who * 10 + how, who])
    table = np.zeros((len(who), levels.size))
    table[np.arange(len(who))[:, None], levels.columns] = 1
    weights, scale = rng.random(len(who)), levels.of_groups(rng.random(3) + 0.2)
    written = scale[:, None] * (table.T * weights @ table) * scale + np.eye(levels.size)
    ours, inverse, right = levels.hessian(weights, scale), np.linalg.inv(written), rng.random(levels.size)
    assert ours.log_determinant == pytest.approx(np.linalg.slogdet(written)[1])
    assert ours.solve(right) == pytest.approx(inverse @ right)
    scaled = table * scale
    assert ours.leverage() == pytest.approx(np.einsum("ij,jk,ik->i", scaled, inverse, scaled))
    assert ours.trace() == pytest.approx(np.diag(inverse @ (scale[:, None] * (table.T * weights @ table))))
    assert levels.spread(right) == pytest.approx(table @ right)
    assert levels.gather(weights) == pytest.approx(table.T @ weights)
