"""Vocabularies: of affect, and of whatever a laboratory annotates."""

from __future__ import annotations

import dataclasses
import json
import pickle
from itertools import permutations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from signface.errors import SignfaceError
from signface.label.vocabulary import AFFECT, GREY, INTENSITY, PALETTE, Vocabulary

WORDS = st.text("abcdeäß 日", min_size=1, max_size=4).filter(lambda word: word == " ".join(word.split()))
COLOURS = st.tuples(*[st.integers(0, 255)] * 3)


@st.composite
def vocabularies(draw, transitions=None):
    """Any vocabulary whose transitions, if it has any, have names of their own."""
    values = tuple(draw(st.lists(WORDS, min_size=1, max_size=6, unique=True)))
    some = st.sampled_from(values)
    described = draw(st.dictionaries(some, WORDS))
    coloured = draw(st.dictionaries(some, COLOURS))
    parts = ("any", values, described, coloured)
    try:
        return Vocabulary(
            *parts, transitions=draw(st.booleans() if transitions is None else st.just(transitions)) and len(values) > 1
        )
    except SignfaceError:
        return Vocabulary(*parts)


@pytest.mark.parametrize(("before", "after"), permutations(AFFECT.values, 2))
def test_the_name_of_a_transition_says_where_it_comes_from_and_leads(before, after):
    name = AFFECT.join(before, after)
    assert AFFECT.split(name) == (before, after)
    assert AFFECT.is_transition(name)
    assert name not in AFFECT.values


def test_names_of_transitions_are_distinct():
    names = [AFFECT.join(*pair) for pair in permutations(AFFECT.values, 2)]
    assert len(set(names)) == 42
    assert AFFECT.allowed == (*AFFECT.values, *names)


@pytest.mark.parametrize("name", ["", "N", "Sa", "XA", "NX", "NAD", "na"])
def test_other_words_are_no_transitions(name):
    assert not AFFECT.is_transition(name)
    with pytest.raises(SignfaceError):
        AFFECT.split(name)


def test_unknown_labels_are_not_joined():
    with pytest.raises(SignfaceError, match="'X'"):
        AFFECT.join("N", "X")


@given(vocabularies(transitions=True))
def test_joining_and_splitting_undo_each_other_in_every_vocabulary_with_transitions(vocabulary):
    pairs = list(permutations(vocabulary.values, 2))
    for pair in pairs if vocabulary.transitions else ():
        assert vocabulary.split(vocabulary.join(*pair)) == pair
    if not vocabulary.transitions and len(vocabulary.values) > 1:
        with pytest.raises(SignfaceError, match="has no transitions"):
            vocabulary.join(*vocabulary.values[:2])


@pytest.mark.parametrize("values", [("a", "b", "ab"), ("a", "ab", "b", "bb"), ("x", "xx")])
def test_transitions_whose_names_mean_two_things_are_refused(values):
    with pytest.raises(SignfaceError, match="two things"):
        Vocabulary("v", values, transitions=True)
    assert Vocabulary("v", values).values == values


@given(vocabularies())
def test_a_vocabulary_is_the_same_after_json_pickle_and_a_list_of_its_entries(vocabulary):
    assert Vocabulary.from_dict(json.loads(json.dumps(vocabulary.as_dict()))) == vocabulary
    assert pickle.loads(pickle.dumps(vocabulary)) == vocabulary
    assert hash(Vocabulary.from_dict(vocabulary.as_dict())) == hash(vocabulary)
    listed = Vocabulary.of(vocabulary.entries, vocabulary.name)
    assert listed.allowed == vocabulary.allowed or set(listed.allowed) == set(vocabulary.allowed)
    if listed.transitions == vocabulary.transitions:
        assert listed == vocabulary


@pytest.mark.slow
@given(vocabularies(), st.integers(1, 40))
def test_every_value_has_a_colour_and_none_shares_it_with_another(vocabulary, count):
    assert {value: vocabulary.palette[value] for value in vocabulary.colours} == vocabulary.colours
    many = Vocabulary("many", tuple(f"v{number}" for number in range(count)))
    assert len(set(many.palette.values())) == min(count, 35)
    assert list(many.palette.values())[:7] == list(PALETTE[:count])
    assert Vocabulary("v", ("none", "x")).palette == {"none": GREY, "x": PALETTE[0]}
    assert many.coloured().coloured() == many.coloured()


@given(st.permutations(AFFECT.values))
def test_the_order_of_the_values_changes_nothing_but_the_order(values):
    turned = dataclasses.replace(AFFECT, values=tuple(values))
    assert set(turned.entries) == set(AFFECT.entries)
    assert turned.palette == AFFECT.palette
    assert turned.rest == AFFECT.rest == "N"
    assert set(turned.allowed) == set(AFFECT.allowed)


@pytest.mark.parametrize(
    ("parts", "problem"),
    [
        ({"values": ()}, "no value"),
        ({"values": ("a", " ")}, "empty one"),
        ({"values": ("a", "a")}, "'a' twice"),
        ({"values": ("a",), "descriptions": {"b": "x"}}, "no value 'b'"),
        ({"values": ("a",), "colours": {"a": (1, 2)}}, "colour of 'a'"),
        ({"values": ("a",), "colours": {"a": (1, 2, 256)}}, "colour of 'a'"),
    ],
)
def test_what_is_no_vocabulary_is_refused(parts, problem):
    with pytest.raises(SignfaceError, match=problem):
        Vocabulary("v", **parts)


def test_what_it_holds_decides_whose_vocabulary_a_table_has():
    assert Vocabulary.holding(["N", "NJ", "J"]) is AFFECT
    assert Vocabulary.holding([]) is AFFECT
    assert Vocabulary.holding(["up", "N"]).values == ("N", "up")
    assert INTENSITY.rest == ""
    with pytest.raises(SignfaceError, match=r"here: '4' not in the closed vocabulary intensity"):
        INTENSITY.check(["1", "4"], "here")
