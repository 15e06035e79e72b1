"""The statistical tests of thesis table 6.1: published numbers, other libraries, and laws that hold for any data."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from signface.study.statistics.contingency import chi_square, cochran, counts_of_proportion, mcnemar
from signface.study.statistics.rank_tests import (
    dunn,
    friedman,
    kruskal_wallis,
    monotone_share,
    scheirer_ray_hare,
    spearman,
    wilcoxon,
)
from signface.study.statistics.test_result import holm

likert = st.integers(1, 7).map(float)
quick = settings(deadline=None, max_examples=40)


# --- the thesis's own numbers -------------------------------------------------------------------------------------


def test_one_count_only_gives_each_published_proportion():
    # tables 6.3 and 6.6: 27 participants, 54 films, so 486 answers a method; tables 6.8 and 6.9: 21 and 378
    assert [counts_of_proportion(share, 486) for share in (0.626, 0.623, 0.603)] == [[304], [303], [293]]
    assert [counts_of_proportion(share, 378) for share in (0.558, 0.624)] == [[211], [236]]
    assert counts_of_proportion(0.82, 378, decimals=2) == [309, 310, 311]


def test_recognition_in_the_first_study_gives_the_published_chi_square():
    found = chi_square([[304, 182], [303, 183], [293, 193]])
    assert (round(found.statistic, 3), round(found.p, 3), found.df) == (0.645, 0.725, 2)
    assert not found.violated


def test_recognition_in_the_second_study_gives_the_published_p_values():
    lsts30, fs = [211, 378 - 211], [236, 378 - 236]
    assert round(chi_square([lsts30, fs]).p, 3) == 0.076  # with Yates' correction; 0.064 without
    assert round(stats.chi2_contingency([lsts30, fs], correction=False)[1], 3) != 0.076
    for right in (309, 310, 311):  # 0.82 has two decimals: whichever count it was, p is below 0.001 as published
        video = [right, 378 - right]
        assert chi_square([lsts30, video]).p < 0.001
        assert chi_square([fs, video]).p < 0.001


# --- published worked examples -------------------------------------------------------------------------------------


def test_scheirer_ray_hare_gives_the_worked_example_of_sokal_and_rohlf():
    """Food eaten by rats, fresh or rancid lard, by sex (Sokal and Rohlf, Biometry, 3rd edition 1995, section 13.12).

    No ties. By hand: rank sums 57 (fresh) and 21 (rancid) of 6 each, so SS = (57² + 21²)/6 − 78²/12 = 108, and with
    MS = 12·13/12 = 13, H = 108/13 = 8.308; 44 and 34 for the sexes give 8.333/13 = 0.641.
    """
    eaten = [709, 679, 699, 657, 594, 677, 592, 538, 476, 508, 505, 539]
    sex, fat = (["male"] * 3 + ["female"] * 3) * 2, ["fresh"] * 6 + ["rancid"] * 6
    by_sex, by_fat, together = scheirer_ray_hare(eaten, sex, fat)
    assert [round(found.statistic, 4) for found in (by_sex, by_fat, together)] == [0.6410, 8.3077, 0.4103]
    assert [round(found.p, 5) for found in (by_sex, by_fat, together)] == [0.42334, 0.00395, 0.52184]
    assert by_sex.violated == ("a cell of 3 < 5 answers",)


def test_scheirer_ray_hare_corrects_ties_as_in_the_worked_example_of_mangiafico():
    """Two tribes, four places, ties (Mangiafico, rcompanion.org/handbook/F_14.html, 2016).

    By hand: Σ(t³ − t) over the ties of these 24 numbers is 114, so D = 1 − 114/(24³ − 24) = 0.99174, and the total
    mean square is 24·25/12 · D = 49.587. The sums of squares of ranks are 8.1667, 746.5833 and 315.5833.
    """
    counted = [10, 4, 12, 5, 15, 4, 15, 9, 15, 11, 18, 12, 8, 13, 8, 15, 10, 17, 22, 22, 20, 22, 20, 25]
    tribe = ["Jedi", "Sith"] * 12
    place = ["Olympia"] * 6 + ["Ventura"] * 6 + ["Northampton"] * 6 + ["Burlington"] * 6
    ties = np.unique(counted, return_counts=True)[1]
    mean_square = 24 * 25 / 12 * (1 - (ties**3 - ties).sum() / (24**3 - 24))
    found = scheirer_ray_hare(counted, tribe, place)
    expected = [8 + 1 / 6, 746 + 7 / 12, 315 + 7 / 12]
    assert [result.statistic * mean_square for result in found] == pytest.approx(expected)
    assert [round(result.statistic, 4) for result in found] == [0.1647, 15.0560, 6.3642]
    assert [round(result.p, 5) for result in found] == [0.68487, 0.00177, 0.09517]  # as R's anova of ranks
    assert [result.df for result in found] == [1, 3, 3]


def test_scheirer_ray_hare_on_unequal_cells_adjusts_each_factor_for_the_other():
    """Ties and unequal cells; H of each factor from R 4.2: anova(lm(rank(y) ~ a * b)), the factor written last."""
    y = [1, 2, 2, 3, 5, 7, 7, 6, 4, 4, 3, 2, 1, 7, 6, 5, 4]
    found = scheirer_ray_hare(y, list("pppqqqpqpqqppqqpp"), list("xyxyxyzzzxyxyzxyz"))
    assert [result.statistic for result in found] == pytest.approx([4.75735714, 4.68799603, 0.76464286])
    assert found[2].p == pytest.approx(0.68227572)


# --- agreement with other libraries --------------------------------------------------------------------------------


@pytest.mark.slow
def test_tests_agree_with_statsmodels():
    multitest = pytest.importorskip("statsmodels.stats.multitest")
    tables = pytest.importorskip("statsmodels.stats.contingency_tables")
    rng = np.random.default_rng(3)
    p_values = rng.random(12)
    assert holm(p_values) == pytest.approx(multitest.multipletests(p_values, method="holm")[1])
    right = (rng.random((60, 3)) < [0.4, 0.6, 0.7]).astype(float)
    ours, theirs = cochran(right), tables.cochrans_q(right)
    assert (ours.statistic, ours.p) == pytest.approx((theirs.statistic, theirs.pvalue))
    pairs = np.array([[((right[:, 0] == a) & (right[:, 1] == b)).sum() for b in (1, 0)] for a in (1, 0)])
    assert mcnemar(right[:, 0], right[:, 1]).p == pytest.approx(tables.mcnemar(pairs, exact=True).pvalue)


@quick
@given(st.lists(st.lists(likert, min_size=5, max_size=30), min_size=2, max_size=4))
def test_with_two_groups_dunn_is_kruskal_wallis(groups):
    first, second = np.array(groups[0]), np.array(groups[1])
    whole, pair = kruskal_wallis([first, second]), dunn([first, second])[0, 1]
    if math.isnan(whole.p):
        assert math.isnan(pair.p)
        return
    assert pair.statistic**2 == pytest.approx(whole.statistic, abs=1e-9)
    # Near a statistic of 0 its rounding, 1e-14, is one of 1e-7 in the root of it, and in p.
    assert pair.p == pytest.approx(whole.p, abs=1e-6)


@quick
@given(st.data(), st.integers(2, 4), st.integers(2, 3), st.integers(2, 6))
def test_in_a_balanced_design_each_factor_of_scheirer_ray_hare_is_its_kruskal_wallis(data, rows, columns, each):
    """As in the thesis: H of the method is 10.299 in table 6.3 and in every line of tables 6.5 and A.4."""
    answers = np.array(data.draw(st.lists(likert, min_size=rows * columns * each, max_size=rows * columns * each)))
    first = np.repeat(np.arange(rows), columns * each)
    second = np.tile(np.repeat(np.arange(columns), each), rows)
    by_first, by_second, _ = scheirer_ray_hare(answers, first, second)
    for result, factor in ((by_first, first), (by_second, second)):
        alone = kruskal_wallis([answers[factor == level] for level in np.unique(factor)])
        assert result.statistic == pytest.approx(alone.statistic, rel=1e-8, abs=1e-12, nan_ok=True)
        # With two groups p falls like the root of the statistic near 0: where they have equal mean ranks, a rounding of
        # 1e-15 is 4e-8 in p. There p is held against that of the same statistic, elsewhere against the other test's.
        if result.statistic < 1e-9:
            assert result.p == pytest.approx(stats.chi2.sf(result.statistic, result.df), abs=1e-12)
        else:
            assert result.p == pytest.approx(alone.p, abs=1e-8, nan_ok=True)


# --- laws ----------------------------------------------------------------------------------------------------------


@st.composite
def two_factors(draw):
    n = draw(st.integers(12, 60))
    answers = draw(st.lists(likert, min_size=n, max_size=n))
    first = draw(st.lists(st.sampled_from("abc"), min_size=n, max_size=n))
    second = draw(st.lists(st.sampled_from("xy"), min_size=n, max_size=n))
    return np.array(answers), np.array(first), np.array(second)


def results_of(answers, first, second):
    codes = np.unique(first, return_inverse=True)[1].astype(float)
    pairs = len(answers) // 2
    groups = [answers[first == level] for level in np.unique(first)]
    counts = [[(answers[first == level] > 4).sum(), (answers[first == level] <= 4).sum()] for level in np.unique(first)]
    return [
        *scheirer_ray_hare(answers, first, second),
        spearman(codes, answers),
        kruskal_wallis(groups),
        wilcoxon(answers[:pairs], answers[pairs : 2 * pairs]),
        chi_square(counts),
        *dunn(groups).values(),
    ]


@pytest.mark.slow
@quick
@given(two_factors())
def test_p_values_lie_between_0_and_1_and_effects_between_minus_1_and_1(data):
    for result in results_of(*data):
        assert math.isnan(result.p) or 0 <= result.p <= 1
        assert math.isnan(result.effect) or -1 - 1e-9 <= result.effect <= 1 + 1e-9
        assert math.isnan(result.p) == any(reason.startswith("not made") for reason in result.violated)


@pytest.mark.slow
@quick
@given(two_factors(), st.randoms(use_true_random=False))
def test_the_order_of_the_answers_does_not_matter(data, random):
    answers, first, second = data
    order = list(range(len(answers)))
    random.shuffle(order)
    for before, after in zip(
        scheirer_ray_hare(answers, first, second), scheirer_ray_hare(answers[order], first[order], second[order])
    ):
        assert before.statistic == pytest.approx(after.statistic, abs=1e-8, nan_ok=True)
    codes = np.unique(first, return_inverse=True)[1]
    assert spearman(codes, answers).p == pytest.approx(spearman(codes[order], answers[order]).p, abs=1e-9, nan_ok=True)


@pytest.mark.slow
@quick
@given(two_factors())
def test_the_names_of_levels_and_the_order_of_factors_do_not_matter(data):
    answers, first, second = data
    renamed = np.array([{"a": "zulu", "b": "mike", "c": "alfa"}[level] for level in first])
    plain, swapped = scheirer_ray_hare(answers, first, second), scheirer_ray_hare(answers, second, renamed)
    for before, after in zip(plain, (swapped[1], swapped[0], swapped[2])):
        assert before.statistic == pytest.approx(after.statistic, abs=1e-8, nan_ok=True)
        assert before.df == after.df


@pytest.mark.slow
@quick
@given(two_factors())
def test_rank_tests_do_not_change_when_the_scale_is_stretched(data):
    answers, first, second = data
    stretched = np.exp(answers / 3)
    for before, after in zip(scheirer_ray_hare(answers, first, second), scheirer_ray_hare(stretched, first, second)):
        assert before.statistic == pytest.approx(after.statistic, abs=1e-8, nan_ok=True)


@pytest.mark.slow
@quick
@given(st.lists(st.tuples(likert, likert), min_size=1, max_size=60))
def test_wilcoxon_changes_sign_when_the_methods_change_places(pairs):
    first, second = np.array(pairs).T
    there, back = wilcoxon(first, second), wilcoxon(second, first)
    assert there.p == pytest.approx(back.p, nan_ok=True)
    assert there.effect == pytest.approx(-back.effect, nan_ok=True)
    assert there.n == int((first != second).sum())


@pytest.mark.slow
@quick
@given(st.lists(st.floats(0, 1), min_size=0, max_size=12), st.integers(0, 3))
def test_holm_never_lowers_a_p_value_and_keeps_their_order(p_values, missing):
    values = np.array([*p_values, *[math.nan] * missing])
    corrected = holm(values)
    made = ~np.isnan(values)
    assert (np.isnan(corrected) == ~made).all()
    assert (corrected[made] >= values[made]).all()
    assert (corrected[made] <= 1).all()
    order = np.argsort(values[made], kind="stable")
    assert (np.diff(corrected[made][order]) >= 0).all()
    if made.sum():
        assert corrected[made].min() == pytest.approx(min(1.0, values[made].min() * made.sum()))


@quick
@given(st.integers(1, 600), st.data())
def test_a_count_is_among_those_its_rounded_proportion_allows(n, data):
    count = data.draw(st.integers(0, n))
    assert count in counts_of_proportion(round(count / n, 3), n)


# --- conditions ------------------------------------------------------------------------------------------------------


def test_conditions_of_validity_are_named_when_they_do_not_hold():
    assert "expected count" in chi_square([[3, 4], [2, 6]]).violated[0]
    assert "4 < 5" in kruskal_wallis([[1, 2, 3, 4], [2, 3, 4, 5, 6]]).violated[0]
    assert "3 < 20 pairs" in wilcoxon([1, 2, 3, 4], [1, 3, 4, 6]).violated[0]
    assert not wilcoxon(np.arange(30.0), np.arange(30.0)[::-1] + 0.5).violated


@pytest.mark.parametrize(
    ("result", "why"),
    [
        (kruskal_wallis([[4, 4, 4], [4, 4]]), "constant answers"),
        (kruskal_wallis([[1, 2, 3], []]), "fewer than two groups"),
        (spearman([1, 2, 3, 4], [5, 5, 5, 5]), "constant answers"),
        (spearman([2, 2, 2, 2], [1, 2, 3, 4]), "constant factor"),
        (wilcoxon([3, 3], [3, 3]), "no pair differs"),
        (wilcoxon([math.nan], [3]), "no pair"),
        (chi_square([[10, 0], [12, 0]]), "one row or one column"),
        (scheirer_ray_hare([1, 2, 3, 4], list("aabb"), list("xyxx"))[0], "an empty cell"),
        (scheirer_ray_hare([4, 4, 4, 4], list("aabb"), list("xyxy"))[2], "constant answers"),
        (scheirer_ray_hare([1, 2, 3, 4], list("aaaa"), list("xyxy"))[0], "a factor with one level"),
        (friedman([[1, 2], [2, 3]]), "three methods"),
        (cochran([[1, 1, 1], [0, 0, 0]]), "all methods agree"),
        (mcnemar([1, 0], [1, 0]), "no pair differs"),
    ],
)
def test_what_cannot_be_tested_says_why(result, why):
    assert math.isnan(result.p)
    assert why in result.violated[0]


def test_a_relation_that_rises_and_falls_is_said_not_to_be_monotone():
    rng = np.random.default_rng(0)
    level = np.repeat(np.arange(1.0, 8.0), 40)
    hill, slope = -((level - 4) ** 2) + rng.normal(0, 1, 280), level + rng.normal(0, 1, 280)
    assert monotone_share(level, hill) < 0.5 < 0.99 < monotone_share(level, slope)
    assert "not monotone" in spearman(level, hill).violated[0]
    assert not spearman(level, slope).violated
    assert monotone_share(level, rng.normal(0, 1, 280)) == 1  # noise has no shape to speak of
