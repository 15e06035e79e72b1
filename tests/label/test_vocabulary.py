"""The vocabulary of the affect channel."""

from __future__ import annotations

from itertools import permutations

import pytest

from signface.errors import SignfaceError
from signface.label.vocabulary import AFFECTS, is_transition, join, split


@pytest.mark.parametrize(("before", "after"), permutations(AFFECTS, 2))
def test_the_name_of_a_transition_says_where_it_comes_from_and_leads(before, after):
    name = join(before, after)
    assert split(name) == (before, after)
    assert is_transition(name)
    assert name not in AFFECTS


def test_names_of_transitions_are_distinct():
    names = [join(*pair) for pair in permutations(AFFECTS, 2)]
    assert len(set(names)) == 42


@pytest.mark.parametrize("name", ["", "N", "Sa", "XA", "NX", "NAD", "na"])
def test_other_words_are_no_transitions(name):
    assert not is_transition(name)
    with pytest.raises(SignfaceError):
        split(name)


def test_unknown_labels_are_not_joined():
    with pytest.raises(SignfaceError, match="'X'"):
        join("N", "X")
