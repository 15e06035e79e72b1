"""Build the classifier that ships: `models/classifiers/default.skops` and its card `default.md`.

    signface synth corpora/feel --signers 4 --seed 11
    python models/build_classifier.py corpora/feel

The classifier is trained on all takes of the kinds IE and SE of a synthetic corpus. What its card says of it is
measured first, on the EU takes of the same corpus, by classifiers that were trained without the signer they are
given to (`signface evaluate --protocol across`). The same corpus gives the same bytes.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from signface.cli.progress import progress
from signface.corpus.examples import solve_examples
from signface.corpus.manifest import read_corpus
from signface.evaluate.protocol import evaluate, folds_of
from signface.files import whole_file
from signface.label.model import Card
from signface.label.persistence import save_model
from signface.label.training import train_model
from signface.label.vocabulary import AFFECTS

FOLDER = Path(__file__).resolve().parent / "classifiers"
CLASSIFIER = "forest"
TRAIN_KINDS, TEST_KINDS = ["IE", "SE"], ["EU"]
SCORED = {
    "manual_segments": "accuracy on EU reference segments, unseen signer",
    "automatic_segments": "accuracy on EU automatic segments, unseen signer",
    "frames": "agreement on EU frames, transitions included, unseen signer",
}


def main() -> None:
    """Solve, evaluate, train and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("corpus", type=Path, help="folder of a synthetic corpus")
    corpus = read_corpus(parser.parse_args().corpus)
    examples = solve_examples(corpus, progress=partial(progress, what="solving", total=len(corpus)))
    folds = folds_of(examples, protocol="across", train_kinds=TRAIN_KINDS, test_kinds=TEST_KINDS)
    sections = evaluate(folds, classifiers=[CLASSIFIER]).metrics["classifiers"][CLASSIFIER]
    model = train_model(
        [example for example in examples if example.kind in TRAIN_KINDS],
        classifier=CLASSIFIER,
        face="default",
        layout="default-40",
        corpus="synthetic (signface synth)",
        scores={what: round(sections[section]["accuracy"], 3) for section, what in SCORED.items()},
        name="default",
    )
    save_model(model, FOLDER / "default.skops")
    with whole_file(FOLDER / "default.md") as temporary:
        temporary.write_text(card_text(model.card, sections), encoding="utf-8")
    print((FOLDER / "default.md").read_text(encoding="utf-8"))


def card_text(card: Card, sections: dict) -> str:
    """The card of the classifier, for people."""
    rows = "\n".join(
        f"| {what} | {scores['accuracy']:.2f} | {_interval(scores)} | {scores['macro_f1']:.2f} "
        f"| {scores['chance']:.2f} | {scores['majority']:.2f} ({scores['majority_label']}) | {scores['n']} |"
        for section, what in SCORED.items()
        for scores in [sections[section]]
    )
    truth = sections["manual_segments"]
    recalls = "\n".join(
        f"| {label} ({AFFECTS[label]}) | {sum(row)} | {row[i] / sum(row):.2f} |"
        for i, (label, row) in enumerate(zip(truth["labels"], truth["confusion"], strict=True))
        if sum(row)
    )
    return f"""# The default classifier

A {card.classifier} (scikit-learn, {card.frames} training frames, seed {card.seed}), written by
`models/build_classifier.py` with signface {card.version}.

**It has met no real signer.** It was trained on a synthetic corpus made by `signface synth`, in which no person is
recorded: {len(card.takes)} takes of the kinds {" and ".join(card.kinds)} by {len(card.signers)} invented signers, on
the face `{card.face}` with the markers of `{card.layout}`. On recordings of people, take its labels as a first guess
to be corrected, and train your own from your corrections: `signface train CORPUS -o MODEL`.

It labels the expressions {", ".join(f"{label} ({AFFECTS[label]})" for label in AFFECTS if label in card.labels)}.

## Measured

On the expressive utterances (EU) of the same synthetic corpus, each signer labelled by a classifier that was trained
on the other signers only. The shipped one is trained on all of them. These numbers say how hard the synthetic corpus
is, not how well real faces are labelled.

| on | accuracy | 95 % | macro F1 | chance | majority class | n |
| --- | --- | --- | --- | --- | --- | --- |
{rows}

How many reference segments of each expression get their label:

| expression | segments | share right |
| --- | --- | --- |
{recalls}

Segments of one take are alike: the interval comes from drawing whole takes again.
"""


def _interval(scores: dict) -> str:
    low, high = scores["accuracy_interval"]
    return f"{low:.2f} to {high:.2f}"


if __name__ == "__main__":
    main()
