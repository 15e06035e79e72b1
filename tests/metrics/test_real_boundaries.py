"""The boundaries of the benchmark on real signers: what is right scores, what is placed at random scores less."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from benchmarks.real_boundaries import annotated_times, by_others, counts, edges, found_in, judged_boundaries, middles
from signface.descriptors import Descriptors
from signface.metrics.segmentation import match_times
from signface.segmentation.segments import Segments
from tests.fixtures.hand_made import example

LABELS = ("N", "J", "N", "A", "N")


def takes(signers: tuple[str, ...] = ("S1", "S2")) -> list:
    return [example(LABELS, take=f"{s}{n}", signer=s, seed=n) for s in signers for n in range(2)]


def test_what_is_found_where_it_is_annotated_is_matched_and_chance_is_less():
    made = takes()
    parts = counts(made, *found_in(made, [edges]), 0.1)
    assert parts.shape == (2, 5)
    np.testing.assert_array_equal(parts[:, :3], [[16, 16, 16]] * 2)
    assert (parts[:, 3] < 10).all()


def test_a_movement_has_one_middle_and_two_edges():
    take = takes()[0].descriptors
    assert len(edges(take)) == 2 * len(middles(take)) == 8
    np.testing.assert_allclose(middles(take), edges(take).reshape(-1, 2).mean(axis=1))


def test_what_the_ends_of_a_take_cut_off_is_no_boundary():
    one = takes()[0]
    end = one.descriptors.duration
    table = pd.DataFrame({"start_s": [0.02, 1.0], "end_s": [1.0, end - 0.02], "kind": "stable", "label": ["N", "J"]})
    one = type(one)(one.take, one.signer, one.kind, one.descriptors, Segments(table))
    assert annotated_times(one).tolist() == [1.0]


def test_thresholds_are_chosen_on_the_others():
    """Each signer's are those that suit the other: here a way that finds everything, and one that finds nothing."""
    mine, others = takes(("S1",)), takes(("S2",))

    def nothing(take: Descriptors) -> np.ndarray:
        return np.array([0.01])

    both = [*mine, *others]
    found = by_others(both, found_in(both, [nothing, edges]), None, [], 0.1)
    np.testing.assert_array_equal(found[:, :3], [[16, 16, 16]] * 2)
    ways, ways_of_others = (found_in(side, [nothing, edges]) for side in (mine, others))
    np.testing.assert_array_equal(by_others(mine, ways, others, ways_of_others, 0.1), found[:1])


def test_the_table_says_the_counts():
    told = {(within, way): values for within, way, values in judged_boundaries(with_brows())}
    assert len(told) == 10
    shipped = told["0.1 s", "as shipped"]
    assert shipped["F1"][0] == shipped["precision"][0] == shipped["recall"][0] == 1
    assert shipped["above chance"][0] == pytest.approx(1 - shipped["at random"][0])


def with_brows() -> list:
    """The takes with bases some of which are of the brows."""
    renamed = []
    for one in takes():
        take = one.descriptors
        names = tuple(f"brow{n}" if n < 6 else f"mouth{n}" for n in range(len(take.names)))
        renamed.append(type(one)(one.take, one.signer, one.kind, take.changed("renamed", names=names), one.reference))
    return renamed


def test_times_are_matched_once_each():
    assert match_times(np.array([1.0, 1.1]), np.array([1.05]), 0.1) == [(0, 0)]
