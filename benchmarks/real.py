"""How well real signers are annotated: `python -m benchmarks.real FOLDER`.

FOLDER holds corpora of OpenFace recordings with human annotations, each a folder with a `takes.csv`: `krsl` (tiers
brows and head), `lse` (tier CNM_tipo), `buhmap` (tier movement), and `gfe`, the files of UCI's Grammatical Facial
Expressions; those that are not there are passed over.

Every person is annotated by what was learnt of the others (leave one signer out); with `--others FOLDER` the persons
of the second folder are, by what was learnt of all in the first. Nothing is chosen on the persons that are judged,
but where the table says so. Intervals (95 %) are drawn over signers, 2,000 times.

A signer's rest and level come from all of their recordings and no annotation; the takes of one person are never on
both sides.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from benchmarks.real_boundaries import judged_boundaries, judged_jitter, scored_boundaries
from benchmarks.real_pictures import draw_boundaries, draw_three
from benchmarks.real_scores import (
    DRAWS,
    Fold,
    best_of_others,
    frame_counts,
    interval,
    judged_labels,
    judged_sentences,
    macro_f1,
)
from signface.channels.rules import find_channels, read_channels
from signface.corpus.examples import solve_corpus
from signface.corpus.levels import learn_signers
from signface.corpus.manifest import read_corpus
from signface.frames import hysteresis, runs
from signface.head import head_angles
from signface.label.labelling import find_segments, label_spans
from signface.label.vocabulary import NONE, Vocabulary
from signface.learn.examples import Example
from signface.learn.fitting import fit_model
from signface.learn.restriction import restricted
from signface.metrics.bootstrap import cluster_draws
from signface.segmentation.segments import Segments
from signface.settings.solve import SolveSettings
from signface.settings.training import TrainingSettings

WEIGHTS, MEASURES, UNITS = SolveSettings(), SolveSettings(method="measures"), SolveSettings(read_as="aus")
SENTENCES = TrainingSettings(classifier="boosting", features=("weights", "head"), normalise="range", balanced=True)
CLIPS = TrainingSettings(
    classifier="extra-trees",
    features=("weights", "head"),
    normalise="middle",
    aggregate="course",
    balanced=True,
)


@dataclass(frozen=True)
class Row:
    """A line of the table: numbers of what was judged, with their intervals."""

    corpus: str
    what: str
    how: str
    values: dict[str, tuple[float, float, float]]

    def cells(self) -> list[str]:
        """As Markdown."""
        said = []
        for name, (value, low, high) in self.values.items():
            between = "" if low == high else f" ({low:.2f} to {high:.2f})"
            said.append(f"{name} {value:g}" if name == "of" else f"{name} {value:.2f}{between}")
        return [self.corpus, self.what, self.how, "; ".join(said)]


class Real:
    """A corpus with signers learnt, in a folder of its own beside which nothing is written."""

    def __init__(self, folder: Path, work: Path) -> None:
        self.folders: dict[str, Path] = {}
        for source in sorted(folder.iterdir()):
            for place in (source, source / source.name):
                if place.is_dir() and ((place / "takes.csv").is_file() or any(place.glob("*_datapoints.txt"))):
                    self.folders[source.name] = place
        self.work = work

    def examples(self, corpus: str, settings: SolveSettings, tier: str, sparse: bool = False) -> list[Example]:
        """The annotated takes of a corpus, with the level of each signer over all of theirs."""
        place = self.work / f"{corpus}-{settings.digest[:8]}"
        if not place.is_dir():
            place.mkdir(parents=True)
            for file in self.folders[corpus].iterdir():
                if file.is_file():
                    shutil.copyfile(file, place / file.name)
            for signer in learn_signers(read_corpus(place), settings):
                (place / "signers").mkdir(exist_ok=True)
                signer.save(place / "signers" / f"{signer.name}.json")
        return solve_corpus(read_corpus(place), settings=settings, tier=tier, sparse=sparse)


def folds_of(examples: list[Example], others: list[Example] | None) -> list[Fold]:
    """One signer left out at a time; or all of these on one side and the others on the other."""
    if others is not None:
        return [(examples, others)]
    signers = sorted({example.signer for example in examples})
    return [([e for e in examples if e.signer != s], [e for e in examples if e.signer == s]) for s in signers]


def learnt_segments(fold: Fold, settings: TrainingSettings) -> list[tuple[Example, pd.DataFrame]]:
    """What a model of the one side finds in the takes of the other."""
    warnings.simplefilter("ignore")
    model = fit_model(fold[0], settings)
    return [(e, find_segments(e.descriptors, model, level=e.level).table) for e in fold[1]]


def learnt_labels(fold: Fold, settings: TrainingSettings) -> list[tuple[str, str, str]]:
    """Signer, true label and found label of each given segment of the other side."""
    warnings.simplefilter("ignore")
    model, rows = fit_model(fold[0], settings), []
    for example in fold[1]:
        spans = example.stable[["start_s", "end_s"]].to_numpy(float)
        found, _ = label_spans(example.descriptors, spans, model, level=example.level)
        rows += [(example.signer, str(t), f) for t, f in zip(example.stable["label"], found, strict=True)]
    return rows


def side_by_side(work: Callable[..., list], folds: list[Fold], *more: object) -> list:
    """All folds on the cores of this machine."""
    parts = Parallel(n_jobs=min(2, len(folds)))(delayed(work)(fold, *more) for fold in folds)
    return [row for part in parts for row in part]


def by_rule(examples: list[Example], channel: str, names: dict[str, str], levels: bool) -> list:
    """What the shipped rules find, with or without the level of the signer; `names` of their values."""
    found = []
    for example in examples:
        level = example.level if levels else None
        events = {e.channel: e.table for e in find_channels(example.descriptors, level=level)}.get(channel)
        table = pd.DataFrame(columns=["start_s", "end_s", "value"]) if events is None else events
        said = [next((mine for word, mine in names.items() if word in str(v)), NONE) for v in table["value"]]
        found.append((example, table.assign(label=said)))
    return found


#: Channel, value, and what is tried for its thresholds: the level that counts, its share that still does, milliseconds.
TRIED = {
    "br_raise": ("brows", "raised", ("on", "off"), (0.7, 0.8, 0.9, 1.0, 1.1, 1.25), (0.7, 0.85), (120, 240, 360)),
    "chin_up": ("head", "chin up", ("on_deg", "off_deg"), (6.0, 8.0, 10.0, 12.0, 14.0), (0.5, 0.7), (160, 320, 560)),
    "turn_forward": ("head", "forward", ("on_deg", "off_deg"), (12.0, 15.0, 18.0, 21.0), (0.6, 0.8), (160, 320, 560)),
}


def by_chosen_rule(folds: list[Fold], label: str) -> list[tuple[Example, pd.DataFrame]]:
    """The shipped rule of a value with the thresholds that suit the other signers best, the signal as it ships."""
    channel, value, (on, off), levels, shares, lengths = TRIED[label]
    shipped = read_channels()[channel]
    tables = []
    for level, share, length in product(levels, shares, lengths):
        rule = dict(shipped[value])
        numbers = {on: level, off: share * level, "min_ms": length}
        rule = {**rule, "signer": {**rule["signer"], **numbers}} if channel == "brows" else {**rule, **numbers}
        tables.append({channel: {**shipped, value: rule}})
    everyone = list({e.take: e for fold in folds for side in fold for e in side}.values())
    found = []
    for row in _by_tables(everyone, channel, tables):
        names = [[label if value in str(word) else NONE for word in events["value"]] for events in row]
        found.append({e.take: events.assign(label=n) for e, events, n in zip(everyone, row, names, strict=True)})
    chosen = best_of_others(folds, found, label)
    return [(e, found[n][e.take]) for (_, test), n in zip(folds, chosen, strict=True) for e in test]


def _by_tables(examples: list[Example], channel: str, tables: list[dict]) -> list[list[pd.DataFrame]]:
    """The events of a channel in each take, by each table of rules."""
    halves = [examples[0::2], examples[1::2]]
    found = Parallel(n_jobs=2)(delayed(_events)(half, channel, tables) for half in halves)
    rows = []
    for number in range(len(tables)):
        row: list[pd.DataFrame] = [None] * len(examples)  # type: ignore[list-item]
        row[0::2], row[1::2] = (half[number] for half in found)
        rows.append(row)
    return rows


def _events(examples: list[Example], channel: str, tables: list[dict]) -> list[list[pd.DataFrame]]:
    nothing = pd.DataFrame(columns=["start_s", "end_s", "value"])
    rows = []
    for table in tables:
        found = (
            {e.channel: e.table for e in find_channels(one.descriptors, table, level=one.level)} for one in examples
        )
        rows.append([events.get(channel, nothing) for events in found])
    return rows


def by_distance(folds: list[Fold], label: str) -> list[tuple[Example, pd.DataFrame]]:
    """The plain rule: brow height over the take's median, with the thresholds that suit the other signers best."""
    grid = [(on, share * on, ms) for on in (0.5, 1.0, 1.5, 2.0, 3.0, 4.0) for share in (0.5, 0.8) for ms in (100, 240)]

    def found(example: Example, on: float, off: float, ms: float) -> pd.DataFrame:
        take = example.descriptors
        height = take.weight("browHeight")
        active = hysteresis(np.nan_to_num(height - np.nanmedian(height), nan=-9.0), on, off)
        spans = [(a / take.rate, b / take.rate) for a, b in runs(active) if (b - a) / take.rate >= ms / 1000]
        return pd.DataFrame([(take.start + a, take.start + b, label) for a, b in spans], columns=COLUMNS)

    everyone = list({e.take: e for fold in folds for side in fold for e in side}.values())
    tried = [{e.take: found(e, *g) for e in everyone} for g in grid]
    chosen = best_of_others(folds, tried, label)
    return [(e, tried[n][e.take]) for (_, test), n in zip(folds, chosen, strict=True) for e in test]


COLUMNS = ["start_s", "end_s", "label"]
RULE_OF_OTHERS = "the same signal, thresholds chosen on the other signers"
RULE_BY_LEVEL = "shipped rule, signer's level (thresholds chosen on K01, K02, K04, K08, K09)"


def leak(weights: list[Example], measures: list[Example]) -> dict:
    """|r| of brow signals with the head's pitch in takes without any annotation of brows, within takes."""
    quiet = [i for i, e in enumerate(weights) if set(e.stable["label"]) == {NONE}]
    signals = {"plain distance": [], "weights, up less down": [], "the rule's signal": [], "pitch": []}
    for i in quiet:
        take, measured = weights[i].descriptors, measures[i].descriptors
        pitch = head_angles(take)["pitch"]
        up = np.mean([take.weight(b) for b in ("browInnerUp", "browOuterUpLeft", "browOuterUpRight")], axis=0)
        net = up - np.mean([take.weight(b) for b in ("browDownLeft", "browDownRight")], axis=0)
        for name, signal in zip(
            signals, (measured.weight("browHeight"), net, net + 0.0075 * pitch, pitch), strict=True
        ):
            signals[name].append(signal - np.nanmean(signal))
    whole = {name: np.concatenate(parts) for name, parts in signals.items()}
    known = np.isfinite(np.array(list(whole.values()))).all(axis=0)
    return {n: float(np.corrcoef(v[known], whole["pitch"][known])[0, 1]) for n, v in whole.items() if n != "pitch"}


def krsl(here: Real, others: Real | None) -> list[Row]:
    """Brows, head, and the type of the sentence."""

    def load(settings: SolveSettings, tier: str, labels: list[str]) -> tuple[list[Example], list[Fold]]:
        mine = restricted(here.examples("krsl", settings, tier), labels)
        judged = None if others is None else restricted(others.examples("krsl", settings, tier), labels)
        return (mine if judged is None else judged), folds_of(mine, judged)

    def here_only(tier: str, labels: list[str]) -> list[Example]:
        return restricted(here.examples("krsl", WEIGHTS, tier), labels)

    rows, what = [], "raised brows"
    judged, _ = load(WEIGHTS, "brows", ["br_raise"])
    measured, folds = load(MEASURES, "brows", ["br_raise"])
    names = {"raised": "br_raise"}
    weighed = folds_of(judged, None) if others is None else [(here_only("brows", ["br_raise"]), judged)]
    for how, found in (
        ("brow distance over the take's median", by_distance(folds, "br_raise")),
        ("shipped rule, one take alone", by_rule(judged, "brows", names, levels=False)),
        (RULE_BY_LEVEL, by_rule(judged, "brows", names, levels=True)),
        (RULE_OF_OTHERS, by_chosen_rule(weighed, "br_raise")),
        ("boosting on measures and head", side_by_side(learnt_segments, folds, SENTENCES)),
    ):
        rows.append(Row("KRSL", what, how, judged_sentences(found, ["br_raise"])))
        if PICTURES is not None and how == RULE_BY_LEVEL:
            title = "Raised brows by the shipped rule (KRSL)"
            draw_three(found, ["br_raise"], PICTURES / "krsl-brows.png", signal="browInnerUp", title=title)
    rows += boundaries("KRSL", what, judged, None if others is None else here_only("brows", ["br_raise"]))
    if PICTURES is not None:
        title = "Energies, the boundaries cut by them, and raised brows (KRSL)"
        draw_boundaries(scored_boundaries(judged), PICTURES / "krsl-boundaries.png", title=title)
    leaks = leak(judged, measured)
    rows.append(Row("KRSL", "r of brows with pitch at rest", "", {n: (r, r, r) for n, r in leaks.items()}))
    for label, word in (("nod", "nod"), ("chin_up", "chin up"), ("turn_forward", "forward")):
        judged, _ = load(WEIGHTS, "head", [label])
        for how, levels in (("shipped rule, one take alone", False), (RULE_BY_LEVEL, True)):
            found = by_rule(judged, "head", {word: label}, levels=levels)
            rows.append(Row("KRSL", label, how, judged_sentences(found, [label])))
        if label in TRIED:
            weighed = folds_of(judged, None) if others is None else [(here_only("head", [label]), judged)]
            found = by_chosen_rule(weighed, label)
            rows.append(Row("KRSL", label, RULE_OF_OTHERS, judged_sentences(found, [label])))
        judged, folds = load(MEASURES, "head", [label])
        found = side_by_side(learnt_segments, folds, SENTENCES)
        rows.append(Row("KRSL", label, "boosting on measures and head", judged_sentences(found, [label])))
    judged, folds = load(MEASURES, "brows", ["br_raise"])
    typed = [tuple(whole(side, lambda e: e.kind) for side in fold) for fold in folds]
    rows.append(
        Row("KRSL", "sentence type", "trees on courses", judged_labels(side_by_side(learnt_labels, typed, CLIPS)))
    )
    return rows


def boundaries(corpus: str, what: str, examples: list[Example], others: list[Example] | None) -> list[Row]:
    """Where a face changes by its energies against where annotations begin and end; and what of it is jitter."""
    rows = [Row(corpus, "jitter of the weights", "share of the motion of a take", judged_jitter(examples))]
    for tolerance, way, values in judged_boundaries(examples, others):
        rows.append(Row(corpus, f"boundaries of {what} within {tolerance}", way, values))
    return rows


def whole(examples: list[Example], label: Callable[[Example], str]) -> list[Example]:
    """The takes as one segment each."""
    result = []
    for example in examples:
        row = (
            example.descriptors.start,
            example.descriptors.start + example.descriptors.duration,
            "stable",
            label(example),
        )
        table = pd.DataFrame([row], columns=["start_s", "end_s", "kind", "label"])
        words = Vocabulary("kinds", tuple(sorted({label(other) for other in examples})))
        result.append(replace(example, reference=Segments(table, name=example.take), vocabulary=words))
    return result


def buhmap(here: Real, others: Real | None) -> list[Row]:
    """Isolated signs of the head and face."""
    mine = here.examples("buhmap", MEASURES, "movement", sparse=True)
    judged = None if others is None else others.examples("buhmap", MEASURES, "movement", sparse=True)
    rows = side_by_side(learnt_labels, folds_of(mine, judged), CLIPS)
    return [Row("BUHMAP", "clips, 8 classes", "trees on courses of measures and head", judged_labels(rows))]


def lse(here: Real, others: Real | None) -> list[Row]:
    """Questions and negation: given segments, and found in whole sentences."""
    labels, unknown = ["i.parcial", "i.polarizada", "n.no"], ["i.xeral", "n.resto"]

    def load(settings: SolveSettings) -> list[Fold]:
        mine = restricted(here.examples("lse", settings, "CNM_tipo"), labels, unknown)
        judged = None if others is None else restricted(others.examples("lse", settings, "CNM_tipo"), labels, unknown)
        return folds_of(mine, judged)

    def given(folds: list[Fold]) -> list[Fold]:
        kept = []
        for fold in folds:
            sides = []
            for side in fold:
                shown = [e for e in side if set(e.stable["label"]) - {NONE}]
                tables = [e.stable[e.stable["label"] != NONE].reset_index(drop=True) for e in shown]
                sides.append([replace(e, reference=Segments(t)) for e, t in zip(shown, tables, strict=True)])
            kept.append((sides[0], sides[1]))
        return kept

    rows = []
    units = load(UNITS)
    for how, folds in (("action units", units), ("measures", load(MEASURES))):
        clips = CLIPS.changed(normalise="range", parameters={"min_samples_leaf": 2})
        right = judged_labels(side_by_side(learnt_labels, given(folds), clips))
        rows.append(Row("LSE", "given segments, 3 classes", f"trees on courses of {how} and head", right))
    found = side_by_side(learnt_segments, units, SENTENCES)
    how = "boosting on action units and head"
    rows.append(Row("LSE", "found in sentences", how, judged_sentences(found, labels)))
    mine = restricted(here.examples("lse", WEIGHTS, "CNM_tipo"), labels, unknown)
    judged = None
    if others is not None:
        judged = restricted(others.examples("lse", WEIGHTS, "CNM_tipo"), labels, unknown)
    what = "questions and negation"
    rows += boundaries("LSE", what, mine if judged is None else judged, None if judged is None else mine)
    if PICTURES is not None:
        title = "Questions and negation by boosting on action units and head (LSE), signers left out"
        draw_three(found, labels, PICTURES / "lse-clauses.png", signal="AU01", title=title)
        scored = scored_boundaries(mine if judged is None else judged)
        title = "Energies, the boundaries cut by them, and questions and negation (LSE)"
        draw_boundaries(scored, PICTURES / "lse-boundaries.png", title=title)
    return rows


#: Phrases of an expression are cut into so many parts, one of which is left out at a time.
PARTS = 5
#: The recordings are short: every frame is learnt from. Written down before any was judged.
SHORT = SENTENCES.changed(parameters={"every": 1, "smallest": 10})


def parts_of(example: Example, expression: str) -> list[Example]:
    """The take cut between phrases, `PARTS` parts of as many phrases each."""
    shown = example.stable[example.stable["label"] == expression]
    ends, begins = shown["end_s"].to_numpy(float), shown["start_s"].to_numpy(float)
    limits = [round(len(shown) * part / PARTS) for part in range(1, PARTS)]
    take = example.descriptors
    cuts = [take.start, *((ends[i - 1] + begins[i]) / 2 for i in limits), take.start + take.duration]
    parts = []
    for low, high in pairwise(cuts):
        table = example.stable.copy()
        table["start_s"], table["end_s"] = table["start_s"].clip(low, high), table["end_s"].clip(low, high)
        table = table[table["end_s"] > table["start_s"] + 1e-6].reset_index(drop=True)
        cut = replace(example, descriptors=take.between(low, high), reference=Segments(table, name=example.take))
        parts.append(replace(cut, take=f"{example.take} {low:.0f}"))
    return parts


def gfe(here: Real, others: Real | None) -> list[Row]:
    """Grammatical expressions in Libras, one a recording: F of frames."""
    rows, total = [], []
    judged = None if others is None else others.examples("gfe", MEASURES, "expression")
    for example in here.examples("gfe", MEASURES, "expression"):
        name = example.kind
        (mine,) = restricted([example], [name])
        if judged is None:
            parts = parts_of(mine, name)
            folds = [([p for p in parts if p is not part], [part]) for part in parts]
        else:
            folds = [([mine], restricted([e for e in judged if e.kind == name], [name]))]
        found = side_by_side(learnt_segments, folds, SHORT)
        counts = np.array([frame_counts(part, table, [NONE, name]) for part, table in found])
        times = np.concatenate([np.ones((1, len(found))), cluster_draws(len(found), DRAWS)])
        value = interval(macro_f1(np.einsum("ds,sij->dij", times, counts)))
        total.append(value[0])
        rows.append(Row("GFE", name, "boosting on measures and head", {"F frames": value}))
    mean = float(np.mean(total))
    how = "fifths of the phrases of signer a left out" if judged is None else "other signers"
    return [*rows, Row("GFE", f"mean of {len(rows)} expressions", how, {"F frames": (mean, mean, mean)})]


#: Where pictures go; None for none.
PICTURES: Path | None = None
NAMES = ("krsl", "lse", "buhmap", "gfe")


def main() -> None:
    """Judge every corpus that is there, and print one table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder of corpora: krsl, lse, buhmap, gfe")
    parser.add_argument("--others", type=Path, help="the same corpora of other persons, to be judged instead")
    parser.add_argument("--only", nargs="+", choices=NAMES, default=NAMES)
    parser.add_argument("--pictures", type=Path, help="folder for pictures of the best, the middle and the worst take")
    parser.add_argument("-o", "--output", type=Path, help="a .json of the same numbers")
    arguments = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = "1"
    global PICTURES
    PICTURES = arguments.pictures
    if PICTURES is not None:
        PICTURES.mkdir(parents=True, exist_ok=True)
    warnings.simplefilter("ignore")
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as work:
        here = Real(arguments.folder, Path(work) / "here")
        others = None if arguments.others is None else Real(arguments.others, Path(work) / "others")
        for judge in (krsl, lse, buhmap, gfe):
            name = judge.__name__
            if name not in here.folders or name not in arguments.only:
                continue
            if others is not None and name not in others.folders:
                continue
            start = time.perf_counter()
            rows += judge(here, others)
            print(f"{name}: {time.perf_counter() - start:.0f} s", file=sys.stderr, flush=True)
    if not rows:
        raise SystemExit(f"{arguments.folder} holds none of {', '.join(NAMES)}")
    table = [["corpus", "what", "how", "value (95 % over signers)"], ["---"] * 4, *(row.cells() for row in rows)]
    print("\n".join(f"| {' | '.join(cells)} |" for cells in table))
    if arguments.output is not None:
        content = [{"corpus": r.corpus, "what": r.what, "how": r.how, "values": r.values} for r in rows]
        arguments.output.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
