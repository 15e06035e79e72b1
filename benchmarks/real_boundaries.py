"""Whether faces change where annotators say that something begins or ends; for `benchmarks.real`.

- `judged_boundaries`: boundaries found by `signface.segmentation.cutting.segment` against those of a tier, beside as
  many placed at random and evenly.
- `scored_boundaries`: each take by itself.
- `judged_jitter`: how much of the motion is jitter of the tracker.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
from joblib import Parallel, delayed

from benchmarks.real_scores import DRAWS, interval
from signface.descriptors import Descriptors
from signface.learn.examples import Example
from signface.metrics.bootstrap import cluster_draws
from signface.metrics.segmentation import match_times
from signface.segmentation.cutting import segment
from signface.segmentation.noise import jitter

#: Tolerances (s), and how often as many boundaries are placed at random in each take.
TOLERANCES, PLACED = (0.1, 0.2), 30
#: An annotation that begins or ends so near to an end of its take was cut off by it (s).
CUT_OFF_S = 0.05
#: What is tried for the thresholds of the segmentation.
TRIED = tuple(
    {"prominence": prominence, "noise_factor": unrest, "least_stable_s": stable}
    for prominence, unrest, stable in product((0.15, 0.5), (2.0, 4.0, 8.0), (0.0, 0.15))
)

#: Finds rising times of boundaries in a take (s).
Finder = Callable[[Descriptors], np.ndarray]


def annotated_times(example: Example) -> np.ndarray:
    """Where annotations begin and end inside the take."""
    take = example.descriptors
    times = np.unique(example.reference.table[["start_s", "end_s"]].to_numpy(float).round(6))
    return times[(times > take.start + CUT_OFF_S) & (times < take.start + take.duration - CUT_OFF_S)]


def edges(take: Descriptors, **options: float) -> np.ndarray:
    """Where segments meet."""
    return segment(take, **options).table["start_s"].to_numpy(float)[1:]


def middles(take: Descriptors, **options: float) -> np.ndarray:
    """The middle of each transition."""
    table = segment(take, **options).table
    spans = table.loc[table["kind"] == "transition", ["start_s", "end_s"]].to_numpy(float)
    return spans.mean(axis=1)


def brows_of(take: Descriptors) -> Descriptors:
    """The weights of the brows alone."""
    columns = [n for n, name in enumerate(take.names) if name.startswith("brow")]
    names = tuple(take.names[n] for n in columns)
    return Descriptors(take.weights[:, columns], names, take.rate, take.start, name=take.name, settings=take.settings)


def counts(
    examples: Sequence[Example], places: Sequence[np.ndarray], tolerance_s: float, *, floors: bool = True
) -> np.ndarray:
    """(S, 5) for each signer: matched, annotated, found, matched of as many at random (mean), of as many even ones.

    `places` are the boundaries found in each take.
    """
    signers = sorted({example.signer for example in examples})
    rng, result = np.random.default_rng(0), np.zeros((len(signers), 5))
    for example, found in zip(examples, places, strict=True):
        take, true = example.descriptors, annotated_times(example)
        matched = len(match_times(true, found, tolerance_s))
        random = even = 0.0
        if floors:
            placed = np.sort(rng.random((PLACED, len(found))), axis=1) * take.duration + take.start
            random = float(np.mean([len(match_times(true, one, tolerance_s)) for one in placed]))
            spread = take.start + take.duration * (np.arange(len(found)) + 0.5) / max(1, len(found))
            even = len(match_times(true, spread, tolerance_s))
        result[signers.index(example.signer)] += (matched, len(true), len(found), random, even)
    return result


def by_others(
    examples: Sequence[Example],
    tried: Sequence[Sequence[np.ndarray]],
    others: Sequence[Example] | None,
    tried_on_others: Sequence[Sequence[np.ndarray]],
    tolerance_s: float,
) -> np.ndarray:
    """As `counts`, the boundaries of each signer found in that of the `tried` ways which suits the other signers best.

    The others are those of `examples`, or the signers of `others`.
    """
    learnt = examples if others is None else others
    ways = tried if others is None else tried_on_others
    scores = np.array([counts(learnt, places, tolerance_s, floors=False) for places in ways])
    rows = []
    for row, signer in enumerate(sorted({example.signer for example in examples})):
        kept = np.ones(scores.shape[1], dtype=bool)
        if others is None:
            kept[row] = False
        matched, true, found = scores[:, kept, :3].sum(axis=1).T
        best = tried[int(np.argmax(matched / (true + found)))]
        own = [n for n, example in enumerate(examples) if example.signer == signer]
        rows.append(counts([examples[n] for n in own], [best[n] for n in own], tolerance_s)[0])
    return np.array(rows)


def found_in(examples: Sequence[Example], finders: Sequence[Finder]) -> list[list[np.ndarray]]:
    """What each finder finds in each take, on both cores."""
    halves = [[example.descriptors for example in examples[start::2]] for start in (0, 1)]
    first, second = Parallel(n_jobs=2)(delayed(_all_found)(half, finders) for half in halves)
    ways = []
    for even, odd in zip(first, second, strict=True):
        way: list[np.ndarray] = [np.empty(0)] * len(examples)
        way[0::2], way[1::2] = even, odd
        ways.append(way)
    return ways


def _all_found(takes: Sequence[Descriptors], finders: Sequence[Finder]) -> list[list[np.ndarray]]:
    return [[find(take) for take in takes] for find in finders]


def judged_boundaries(
    examples: Sequence[Example], others: Sequence[Example] | None = None
) -> Iterator[tuple[str, str, dict[str, tuple[float, float, float]]]]:
    """Tolerance and way of finding, in words; F1, what it is above chance, precision, recall, F1 of even ones.

    `others` are the persons that thresholds are chosen on, where they are not the other ones among `examples`.
    """
    options = [partial(edges, **tried) for tried in TRIED]
    plain, shaken, middle, *tried = found_in(examples, [edges, partial(edges, jitter_factor=0.0), middles, *options])
    (brows,) = found_in([replace(e, descriptors=brows_of(e.descriptors)) for e in examples], [middles])
    learnt = [] if others is None else found_in(others, options)
    for tolerance in TOLERANCES:
        for way, parts in (
            ("as shipped", counts(examples, plain, tolerance)),
            ("jitter counted as motion", counts(examples, shaken, tolerance)),
            ("thresholds chosen on the other signers", by_others(examples, tried, others, learnt, tolerance)),
            ("middles of transitions", counts(examples, middle, tolerance)),
            ("middles of transitions, brows alone", counts(examples, brows, tolerance)),
        ):
            yield f"{tolerance:g} s", way, _values(parts)


def _values(parts: np.ndarray) -> dict[str, tuple[float, float, float]]:
    """What is told of (S, 5) counts, with intervals over signers."""
    times = np.concatenate([np.ones((1, len(parts))), cluster_draws(len(parts), DRAWS)])
    matched, true, found, random, even = (times @ parts).T
    with np.errstate(invalid="ignore", divide="ignore"):
        both = 2 / (true + found)
        values = {
            "F1": interval(matched * both),
            "above chance": interval((matched - random) * both),
            "precision": interval(matched / found),
            "recall": interval(matched / true),
        }
    values |= {"at random": (float(random[0] * both[0]),) * 3, "evenly": (float(even[0] * both[0]),) * 3}
    return {**values, "of": (float(true[0]),) * 3}


def scored_boundaries(examples: Sequence[Example]) -> list[tuple[float, Example]]:
    """F1 of the boundaries within the larger tolerance, of takes that have annotated ones; worst first.

    Takes in which nothing is found are not among them. Of equal takes the one with more boundaries is further out.
    """
    scored = []
    for example in examples:
        true, found = annotated_times(example), edges(example.descriptors)
        if len(true) and len(found):
            number = len(true) + len(found)
            f1 = 2 * len(match_times(true, found, TOLERANCES[-1])) / number
            scored.append((f1, number if f1 > 0.5 else -number, example.take, example))
    return [(f1, example) for f1, *_, example in sorted(scored, key=lambda row: row[:3])]


def judged_jitter(examples: Sequence[Example]) -> dict[str, tuple[float, float, float]]:
    """Share of the motion that is jitter, in the median take and in the highest."""
    shares = [jitter(example.descriptors).share for example in examples]
    return {name: (float(value),) * 3 for name, value in (("median", np.median(shares)), ("highest", max(shares)))}
