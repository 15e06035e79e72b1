"""How hard is the synthetic corpus? Forests on the true weights, where no solver can spoil or help anything.

    python benchmarks/corpus_difficulty.py [--signers 3] [--seeds 0 7]

For each signer: `within` trains on the frames of that signer's IE and SE, `across` on those of the other signers of the
same seed, `with EU` on the segments of every other signer, utterances included. All label the mean of each reference
segment of EU (4.4.3 of the thesis). The numbers in corpora/README.md come from here.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
from sklearn.ensemble import RandomForestClassifier
from sklearn.metrics import confusion_matrix

from signface.synth.corpus import make_take, plan_corpus

LABELS = ("N", "A", "D", "F", "J", "Sa", "Su")
#: Every fourth frame: 50 Hz is plenty for means and for training.
STEP = 4


@dataclass(frozen=True)
class Sample:
    """What one signer shows: means of stable segments (S, N) with label and kind, and frames of IE and SE."""

    means: np.ndarray
    labels: np.ndarray
    kinds: np.ndarray
    frames: np.ndarray
    frame_labels: np.ndarray


def sample(seed: int, signer: int) -> Sample:
    """The true avatar weights of all takes of a signer."""
    means, labels, kinds, frames, frame_labels = [], [], [], [], []
    for job in plan_corpus(signers=signer + 1, seed=seed):
        if job.signer != signer:
            continue
        made = make_take(job)
        weights, time = made.avatar_weights.weights[::STEP], made.avatar_weights.time[::STEP]
        table = made.reference.table
        for row in table[table["kind"] == "stable"].itertuples():
            inside = weights[(time >= row.start_s) & (time < row.end_s)]
            means.append(inside.mean(axis=0))
            labels.append(row.label)
            kinds.append(job.kind)
            if job.kind != "EU":
                frames.append(inside)
                frame_labels.extend([row.label] * len(inside))
    return Sample(np.array(means), np.array(labels), np.array(kinds), np.concatenate(frames), np.array(frame_labels))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--signers", type=int, default=3, help="signers of each seed (default 3)")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 7], help="seeds (default 0 7)")
    arguments = parser.parse_args()
    people = [(seed, signer) for seed in arguments.seeds for signer in range(arguments.signers)]
    samples = {person: sample(*person) for person in people}
    scores: dict[str, list[float]] = {
        "within": [],
        "within, affects only": [],
        "across": [],
        "with EU": [],
        "majority": [],
    }
    confusion = np.zeros((len(LABELS), len(LABELS)), dtype=int)
    for person in people:
        own = samples[person]
        tested = own.kinds == "EU"
        truth = own.labels[tested]

        def guess(features: np.ndarray, labels: np.ndarray, means: np.ndarray = own.means[tested]) -> np.ndarray:
            return RandomForestClassifier(200, random_state=0).fit(features, labels).predict(means)

        found = guess(own.frames, own.frame_labels)
        scores["within"].append(np.mean(found == truth))
        scores["within, affects only"].append(np.mean((found == truth)[truth != "N"]))
        confusion += confusion_matrix(truth, found, labels=LABELS)
        beside = [samples[other] for other in people if other[0] == person[0] and other != person]
        found = guess(np.concatenate([o.frames for o in beside]), np.concatenate([o.frame_labels for o in beside]))
        scores["across"].append(np.mean(found == truth))
        others = [samples[other] for other in people if other != person]
        found = guess(np.concatenate([o.means for o in others]), np.concatenate([o.labels for o in others]))
        scores["with EU"].append(np.mean(found == truth))
        scores["majority"].append(np.mean(truth == "N"))
    for name, values in scores.items():
        print(f"{name:22s} {np.mean(values):.2f}  ({min(values):.2f} to {max(values):.2f})")
    print("confusion of `within` (rows: reference)", *LABELS)
    for label, row in zip(LABELS, confusion):
        print(f"{label:>3s}", *(f"{count:4d}" for count in row))


if __name__ == "__main__":
    main()
