"""The conditional random field: likelihoods and courses against all courses, counted out."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import check_grad

from signface.sequence.crf import ChainLabeller, log_likelihood


def score(scores: np.ndarray, after: np.ndarray, course) -> float:
    return sum(scores[k, s] for k, s in enumerate(course)) + sum(after[a, b] for a, b in itertools.pairwise(course))


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000), frames=st.integers(1, 5))
def test_likelihoods_of_all_courses_make_one(seed, frames):
    rng = np.random.default_rng(seed)
    scores, after = rng.normal(0, 2, (frames, 3)), rng.normal(0, 2, (3, 3))
    courses = list(itertools.product(range(3), repeat=frames))
    likely = np.array([log_likelihood(scores, after, np.array(course), [frames])[0] for course in courses])
    assert np.exp(likely).sum() == pytest.approx(1)
    total = np.logaddexp.reduce([score(scores, after, course) for course in courses])
    assert likely[0] == pytest.approx(score(scores, after, courses[0]) - total)


def test_the_likelihood_of_several_takes_has_the_slope_that_it_says():
    rng = np.random.default_rng(3)
    lengths, states = [4, 6, 1], 3
    codes = rng.integers(0, states, sum(lengths))

    def parts(values):
        return log_likelihood(values[:33].reshape(11, states), values[33:].reshape(states, states), codes, lengths)

    def slope(values):
        return np.concatenate([part.ravel() for part in parts(values)[1:]])

    assert check_grad(lambda values: parts(values)[0], slope, rng.normal(size=42)) < 1e-5


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000), frames=st.integers(1, 7))
def test_the_course_found_is_the_likeliest_in_which_something_changes(seed, frames):
    rng = np.random.default_rng(seed)
    model = ChainLabeller()
    model.classes_ = np.array(["A", "N"])
    model.following_ = rng.normal(0, 1, (4, 4))
    scores = rng.normal(0, 2, (frames, 4))
    best = {}
    for course in itertools.product(range(4), repeat=frames):
        runs = [state for state, _ in itertools.groupby(course)]
        moves = all(
            before < 2 and after < 2 and before != after and runs[i : i + 2] == [2, 3]
            for i, before, after in zip(range(1, len(runs), 3), runs[::3], runs[3::3])
        )
        if runs[0] < 2 and len(runs) % 3 == 1 and moves:
            best[course] = score(scores, model.following_, course)
    likeliest = max(best, key=best.__getitem__)
    said = np.concatenate([np.full(last - first, code) for first, last, code in model._likeliest(scores)])
    assert said.tolist() == [state if state < 2 else -1 for state in likeliest]
