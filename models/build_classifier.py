"""Build the classifiers that ship: `default` and `thesis-forest`, each with its card.

    signface synth corpora/feel-train --signers 12 --seed 301
    signface synth corpora/feel --signers 2 --seed 0
    python models/build_classifier.py corpora/feel-train corpora/feel

`default` is the best sequence model, trained on all takes of the first synthetic corpus; `thesis-forest` is the
thesis's plain method, a forest trained on the kinds IE and SE. Both are measured, as they ship, on the EU takes of the
second corpus, whose signers have other seeds and so other heads and habits. The same corpora give the same bytes.
Training the networks needs PyTorch (`pip install "signface[deep]"`) and some minutes on two cores; what is written
needs neither.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path

from signface.corpus.examples import solve_corpus
from signface.corpus.manifest import read_corpus
from signface.errors import SignfaceError
from signface.evaluation.protocol import score_model
from signface.files import whole_file
from signface.label.model import Card
from signface.label.persistence import save_model
from signface.label.vocabulary import AFFECT
from signface.learn.training import Example, train
from signface.progress import progress
from signface.settings.choices import NAMES, SEQUENCE_NAMES
from signface.settings.solve import SolveSettings
from signface.settings.training import TrainingSettings
from signface.solver.solving import solve
from signface.synth.corpus import TakeRequest, plan_corpus
from signface.synth.variety import varied_take

#: Signers and seed of the corpus that is trained on, and how often each of its takes is acted and recorded otherwise.
SIGNERS, SEED, COPIES = 12, 301, 2
#: Share of varied takes whose neutral frame is told rather than found.
TOLD = 0.25

FOLDER = Path(__file__).resolve().parent / "classifiers"
#: name: classifier and kinds of takes that it is trained on.
SHIPPED = {"default": ("gru", ["IE", "SE", "EU"]), "thesis-forest": ("forest", ["IE", "SE"])}
TEST_KINDS = ["EU"]
SCORED = {
    "manual_segments": "accuracy on EU reference segments, unseen signers",
    "automatic_segments": "accuracy on EU automatic segments, unseen signers",
    "frames": "agreement on EU frames, transitions included, unseen signers",
}


def main() -> None:
    """Solve, train, measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("train", type=Path, help="folder of the corpus to train on")
    parser.add_argument("test", type=Path, help="folder of the corpus to measure on")
    arguments = parser.parse_args()
    training, test = (
        solve_corpus(corpus, progress=partial(progress, what="solving", total=len(corpus)))
        for corpus in (
            read_corpus(arguments.train),
            read_corpus(arguments.test).select(kinds=TEST_KINDS),
        )
    )
    for name in SHIPPED:
        build(name, training, test)
        print((FOLDER / f"{name}.md").read_text(encoding="utf-8"))


def varied_examples(
    *, signers: int = SIGNERS, seed: int = SEED, copies: int = COPIES, workers: int = 2
) -> list[Example]:
    """The takes of a corpus, each acted and recorded otherwise `copies` times (`signface.synth.variety`), solved."""
    from joblib import Parallel, delayed

    wanted = [(request, copy) for copy in range(copies) for request in plan_corpus(signers=signers, seed=seed)]
    made: Iterable[Example | None] = Parallel(n_jobs=workers, return_as="generator")(
        delayed(varied_example)(*one) for one in wanted
    )
    return [example for example in progress(made, "varying", total=len(wanted)) if example is not None]


def varied_example(request: TakeRequest, copy: int) -> Example | None:
    """A varied take, solved as users solve; None where too little of the face is seen."""
    made = varied_take(request, copy)
    told = request.stream(what=200 + copy).random() < TOLD
    settings = SolveSettings(layout="default-40", neutral=made.neutral_s if told else "auto")
    try:
        descriptors = solve(made.take, settings=settings)
    except SignfaceError:
        return None
    return Example(
        take=f"{request.name}_{copy}",
        signer=request.signer_name,
        kind=request.kind,
        descriptors=replace(descriptors, deviation=None, head=None),
        reference=made.reference,
        sentence=request.sentence,
    )


def build(name: str, training: list[Example], test: list[Example]) -> None:
    """Train, measure and write one classifier.

    Parameters
    ----------
    name : str
        One of `SHIPPED`.
    training, test : list of Example
        Solved takes of the two corpora.
    """
    classifier, kinds = SHIPPED[name]
    model = train(
        [example for example in training if example.kind in kinds],
        TrainingSettings(classifier=classifier, calibrate=False),
        solve=SolveSettings(layout="default-40"),
        corpus="synthetic (signface synth)",
        name=name,
    )
    scores = score_model(model, test)
    measured = {what: scores[section]["accuracy"] for section, what in SCORED.items()}
    model = replace(model, card=replace(model.card, scores=measured))
    save_model(model, FOLDER / f"{name}.skops")
    with whole_file(FOLDER / f"{name}.md") as temporary:
        temporary.write_text(card_text(name, model.card, scores), encoding="utf-8")


def card_text(name: str, card: Card, sections: dict) -> str:
    """The card of the classifier, for people."""
    rows = "\n".join(
        f"| {what} | {scores['accuracy']:.2f} | {_interval(scores)} | {scores['macro_f1']:.2f} "
        f"| {scores['chance']:.2f} | {scores['majority']:.2f} ({scores['majority_label']}) | {scores['n']} |"
        for section, what in SCORED.items()
        for scores in [sections[section]]
    )
    truth = sections["manual_segments"]
    recalls = "\n".join(
        f"| {label} ({AFFECT.describe(label)}) | {sum(row)} | {row[i] / sum(row):.2f} |"
        for i, (label, row) in enumerate(zip(truth["labels"], truth["confusion"], strict=True))
        if sum(row)
    )
    labels = ", ".join(f"{value} ({words})" for value, words in AFFECT.descriptions.items() if value in card.labels)
    boundaries = ", ".join(
        f"{value:.2f} within {tolerance} s" for tolerance, value in sections["segmentation"]["boundary_f1"].items()
    )
    return f"""# The classifier `{name}`

A {(NAMES | SEQUENCE_NAMES)[card.classifier]} (`{card.classifier}`; {card.frames} training frames, seed {card.seed}),
written by `models/build_classifier.py` with signface {card.version}.

**It has met no real signer.** It was trained on a synthetic corpus made by `signface synth`, in which no person is
recorded: {len(card.takes)} takes of the kinds {" and ".join(card.kinds)} by {len(card.signers)} invented signers
(`signface synth --signers 12 --seed 301`), on the face `{card.face}` with the markers of `{card.layout}`. On recordings
of people, take its labels as a first guess to be corrected, and train your own from your corrections:
`signface train CORPUS -o MODEL`.

It labels the expressions {labels}.

## Measured

On expressive utterances (EU) of invented signers that it was not trained on. Its training signers and these come from
one generator, so these numbers say how hard the synthetic corpus is, not how well real faces are labelled.

| on | accuracy | 95 % | macro F1 | chance | majority class | n |
| --- | --- | --- | --- | --- | --- | --- |
{rows}

How many reference segments of each expression get their label:

| expression | segments | share right |
| --- | --- | --- |
{recalls}

Its boundaries against the reference's (for `thesis-forest`, those of `signface segment`): F1 {boundaries}.
The references carry the uncertainty of an annotator, 30 to 80 ms: the exact boundaries reach 0.93 within 0.10 s.

Segments of one take are alike: the interval comes from drawing whole takes again.

{_reliability(truth)}
{_intensity(sections.get("intensity"))}"""


def _reliability(scores: dict) -> str:
    error, brier = scores["calibration_error"], scores["brier"]
    return f"Confidence in the labels of reference segments: expected calibration error {error:.2f}, Brier {brier:.2f}."


def _intensity(scores: dict | None) -> str:
    """What is known of the intensities that it gives, if it does."""
    if scores is None:
        return ""
    told = "; ".join(
        f"{how}, exact {part['exact']:.2f}, within one {part['within_one']:.2f}, "
        f"mean error {part['mean_absolute_error']:.2f}"
        for how, part in scores.items()
    )
    return f"Intensity (1 to 3) of {scores['learnt']['n']} reference segments: {told}.\n"


def _interval(scores: dict) -> str:
    low, high = scores["accuracy_interval"]
    return f"{low:.2f} to {high:.2f}"


if __name__ == "__main__":
    main()
