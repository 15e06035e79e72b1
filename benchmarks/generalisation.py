"""How far a classifier of affect holds outside its training: `python -m benchmarks.generalisation [MODELS] [-o JSON]`.

Utterances of synthetic signers whom no training met are recorded in other ways (another rate, jitter, markers absent,
half the strength), and others are made by the second generator (`signface.synth.other`), which nothing is trained on.
Nothing is chosen on any of them. Every take is solved as `signface annotate` does, its neutral frame looked for.

With `--real FOLDER --kind st`, a folder with a `takes.csv` of real signers: on plain statements, in which nobody was
asked for an affect, how much of the time one is found. (Whether the signers felt any, nobody wrote down.)

MODELS are names or files of classifiers, `default` if none is named. Some minutes on two quiet cores.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed

from signface.corpus.manifest import read_corpus
from signface.errors import SignfaceError, SignfaceWarning
from signface.evaluation.protocol import score_model
from signface.label.familiarity import UNLIKE
from signface.label.labelling import find_segments
from signface.label.model import TrainedModel
from signface.label.persistence import load_model
from signface.label.vocabulary import UNKNOWN
from signface.learn.examples import Example
from signface.segmentation.segments import Segments
from signface.settings.solve import SolveSettings
from signface.solver.solving import solve
from signface.synth.corpus import SyntheticTake, TakeRequest, make_take, plan_corpus
from signface.synth.other.corpus import OtherRequest, make_other_take, plan_other
from signface.synth.variety import Acting, Recorded, recorded_as
from signface.takes.reading import read_take

#: Signers whom nothing was trained or chosen on.
SEED, SIGNERS = 9174, 3
NEUTRAL = "N"


#: Nothing done to a take.
AS_IT_IS = Recorded()


@dataclass(frozen=True)
class Condition:
    """How the takes of a row are made.

    Parameters
    ----------
    name : str
        What the table says.
    recorded : Recorded
        Of the first generator's takes.
    gain : float
        Factor on all weights.
    cutoff_hz : float, optional
        As `--cutoff`.
    other : str
        Empty, or of the second generator: `true` weights, or `tracked` landmarks.
    """

    name: str
    recorded: Recorded = AS_IT_IS
    gain: float = 1.0
    cutoff_hz: float | None = None
    other: str = ""


FILMED = Recorded(rate=30.0, jitter_mm=2.0)
CONDITIONS = (
    Condition("own generator, as recorded"),
    Condition("30 Hz", Recorded(rate=30.0)),
    Condition("20 % of markers absent", Recorded(absent=0.2)),
    Condition("half the gains", gain=0.5),
    Condition("1 mm of jitter", Recorded(jitter_mm=1.0)),
    Condition("2 mm of jitter", Recorded(jitter_mm=2.0)),
    Condition("30 Hz and 2 mm", FILMED),
    Condition("30 Hz and 2 mm, `--cutoff 5`", FILMED, cutoff_hz=5.0),
    Condition("another generator, true weights", other="true"),
    Condition("another generator, as tracked", other="tracked"),
    Condition("another generator, as tracked, `--cutoff 5`", other="tracked", cutoff_hz=5.0),
)
COLUMNS = {
    "found": "segments found and right",
    "reference": "reference segments right",
    "frames": "frames right",
    "boundaries": "boundary F1, 0.1 s",
    "confidence": "mean confidence",
    "unlike": "takes it calls unlike its training",
}


def requests(condition: Condition) -> list[TakeRequest] | list[OtherRequest]:
    """The takes of a row: each of the eighteen utterances once, by one of three signers; eight of each other person."""
    if condition.other:
        return [r for r in plan_other(signers=SIGNERS, seed=SEED, kinds=["EU"]) if r.number < 8]
    planned = plan_corpus(signers=SIGNERS, seed=SEED, kinds=["EU"])
    return [request for request in planned if request.number % SIGNERS == request.signer]


def make_example(condition: Condition, request: TakeRequest | OtherRequest) -> Example:
    """A take of a row, solved."""
    made: SyntheticTake
    if isinstance(request, OtherRequest):
        made = make_other_take(request)
    else:
        made = make_take(request, change=None if condition.gain == 1.0 else Acting(gain=condition.gain))
        made = replace(made, take=recorded_as(made.take, condition.recorded, request.stream(what=300)))
    descriptors = made.avatar_weights
    if condition.other != "true":
        settings = SolveSettings(layout="default-40", cutoff_hz=condition.cutoff_hz)
        descriptors = solve(made.take, settings=settings)
    return Example(request.name, request.signer_name, request.kind, replace(descriptors, head=None), made.reference)


def make_rows(conditions: Sequence[Condition] = CONDITIONS, *, workers: int = 2) -> dict[str, list[Example]]:
    """The solved takes of each row, by its name."""
    jobs = [(condition, request) for condition in conditions for request in requests(condition)]
    made = Parallel(n_jobs=workers)(delayed(make_example)(*job) for job in jobs)
    rows: dict[str, list[Example]] = {condition.name: [] for condition in conditions}
    for (condition, _), example in zip(jobs, made, strict=True):
        rows[condition.name].append(example)
    return rows


def measure(model: TrainedModel, examples: Sequence[Example]) -> dict[str, float]:
    """The columns of `COLUMNS` for a model, and how many reference segments there are."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SignfaceWarning)  # that --cutoff 5 is not how the training was solved
        scores = score_model(model, examples)
        found = [find_segments(example.descriptors, model) for example in examples]
    sure = np.concatenate([_stable(segments)["confidence"].to_numpy(float) for segments in found])
    return {
        "found": scores["automatic_segments"]["accuracy"],
        "reference": scores["manual_segments"]["accuracy"],
        "frames": scores["frames"]["accuracy"],
        "boundaries": scores["segmentation"]["boundary_f1"]["0.10"],
        "confidence": float(sure.mean()),
        "unlike": float(np.mean([any(step.startswith(UNLIKE) for step in segments.history) for segments in found])),
        "n": scores["manual_segments"]["n"],
    }


def everything_neutral(examples: Sequence[Example]) -> dict[str, float]:
    """The same of who calls every take neutral from beginning to end."""
    labels = [label for example in examples for label in example.stable["label"]]
    neutral = total = 0.0
    for example in examples:
        table = example.reference.table
        length = (table["end_s"] - table["start_s"]).to_numpy(float)
        neutral += length[((table["kind"] == "stable") & (table["label"] == NEUTRAL)).to_numpy()].sum()
        total += length.sum()
    share = labels.count(NEUTRAL) / len(labels)
    return {"found": share, "reference": share, "frames": neutral / total, "boundaries": 0.0, "n": len(labels)}


def _stable(segments: Segments):
    return segments.table[segments.table["kind"] == "stable"]


def real_statements(folder: Path, kind: str, most: int) -> list:
    """Weights of real takes of a kind, evenly spaced among all of them."""
    entries = list(read_corpus(folder).select(kinds=[kind]))
    chosen = [entries[i] for i in np.unique(np.linspace(0, len(entries) - 1, min(most, len(entries))).astype(int))]

    def solved(path: Path):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                return solve(read_take(path))
            except SignfaceError as error:
                print(f"passed over: {error}", file=sys.stderr)
                return None

    made = Parallel(n_jobs=2)(delayed(solved)(entry.path) for entry in chosen)
    return [descriptors for descriptors in made if descriptors is not None]


def affect_found(model: TrainedModel, takes: Sequence) -> dict[str, float]:
    """In how many takes a model finds an affect, for how much of the time, and how sure it is of all it finds."""
    shares, sure, unlike = [], [], []
    for take in takes:
        found = find_segments(take, model)
        unlike.append(any(step.startswith(UNLIKE) for step in found.history))
        table = _stable(found)
        length = (table["end_s"] - table["start_s"]).to_numpy(float)
        named = ~table["label"].isin([NEUTRAL, UNKNOWN]).to_numpy()
        shares.append(length[named].sum() / take.duration)
        sure += table["confidence"].tolist()
    return {
        "takes": float(np.mean(np.array(shares) > 0)),
        "time": float(np.mean(shares)),
        "unlike": float(np.mean(unlike)),
        "confidence": float(np.mean(sure)),
        "n": len(takes),
    }


def table(rows: dict[str, dict[str, dict[str, float]]]) -> str:
    """Markdown: a row for each condition and model."""
    lines = [f"| utterances of unseen signers | model | {' | '.join(COLUMNS.values())} |"]
    lines.append("| --- " * (len(COLUMNS) + 2) + "|")
    for row, models in rows.items():
        for name, values in models.items():
            cells = [f"{values[column]:.2f}" if column in values else "" for column in COLUMNS]
            lines.append(f"| {row} | {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the takes, measure the models, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("models", nargs="*", default=["default"], help="classifiers, by name or file")
    parser.add_argument("-o", "--output", type=Path, metavar="JSON", help="also write the numbers")
    parser.add_argument("--real", type=Path, metavar="FOLDER", help="a corpus of real signers")
    parser.add_argument("--kind", default="st", help="which takes are plain statements (default: st, as in KRSL)")
    parser.add_argument("--most", type=int, default=40, help="how many of them at most (default: 40)")
    parser.add_argument("--workers", type=int, default=2, help="takes solved at a time (default: 2)")
    given = parser.parse_args(arguments)
    began = time.monotonic()
    models = {name: load_model(name) for name in given.models}
    rows = make_rows(workers=given.workers)
    measured = {
        row: {
            **{Path(name).stem: measure(model, examples) for name, model in models.items()},
            "everything neutral": everything_neutral(examples),
        }
        for row, examples in rows.items()
    }
    print(table(measured))
    results: dict = {"synthetic": measured}
    if given.real is not None:
        statements = real_statements(given.real, given.kind, given.most)
        results["real"] = {Path(name).stem: affect_found(model, statements) for name, model in models.items()}
        for name, values in results["real"].items():
            print(
                f"\n{values['n']} plain statements of real signers ({given.real.name}), {name}: an affect is found in "
                f"{values['takes']:.0%} of them, for {values['time']:.0%} of the time; {values['unlike']:.0%} are "
                f"called unlike the training; mean confidence {values['confidence']:.2f}"
            )
    print(f"\n{time.monotonic() - began:.0f} s")
    if given.output is not None:
        given.output.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
