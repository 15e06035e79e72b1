"""Build the classifiers that ship: `default` and `thesis-forest`, each with its card.

    python models/build_classifier.py

`default` is the best sequence model, trained on all takes of the first synthetic corpus and on each of them twice
more, acted and recorded otherwise (`signface.synth.variety`); `thesis-forest` is the thesis's plain method, a forest
trained on the kinds IE and SE as they are. Both are measured, as they ship, on the EU takes of two signers of another
seed, `default` outside its training too (`benchmarks/generalisation.py`). Corpora are made on the way; the same seeds
give the same bytes on one kind of processor. Training the networks needs PyTorch (`pip install "signface[deep]"`); all
of it takes some half an hour on two cores, and what is written needs neither.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.generalisation import everything_neutral, make_rows, measure, table
from signface.errors import SignfaceError
from signface.evaluation.protocol import score_model
from signface.files import whole_file
from signface.label.familiarity import fit_familiarity, measures
from signface.label.labelling import find_segments
from signface.label.model import Card, TrainedModel
from signface.label.persistence import save_model
from signface.label.vocabulary import AFFECT
from signface.learn.training import Example, train
from signface.progress import progress
from signface.settings.choices import NAMES, SEQUENCE_NAMES
from signface.settings.solve import SolveSettings
from signface.settings.training import TrainingSettings
from signface.solver.solving import solve
from signface.synth.corpus import TakeRequest, make_take, plan_corpus
from signface.synth.other.corpus import OtherRequest, make_other_take, plan_other
from signface.synth.variety import varied_take

#: Signers and seed of the corpus that is trained on, and how often each of its takes is acted and recorded otherwise.
SIGNERS, SEED, COPIES = 12, 301, 2
#: Signers and seed of the corpus that is measured on.
TEST_SIGNERS, TEST_SEED = 2, 0
#: Seed of the takes by which a model learns what it knows: of nobody trained on or measured on.
FAMILIAR_SEED = 5552
#: Share of varied takes whose neutral frame is told rather than found.
TOLD = 0.25
#: Underscores in the name of a take as it is; a variation has one more.
USUAL_NAME = 2
#: Which take of the corpus is meant, if it is not a variation.
AS_IT_IS = -1

FOLDER = Path(__file__).resolve().parent / "classifiers"
#: name: classifier and kinds of takes that it is trained on.
SHIPPED = {"default": ("gru", ["IE", "SE", "EU"]), "thesis-forest": ("forest", ["IE", "SE"])}
#: The one that learns variations, and what it knows.
VARIED = "default"
TEST_KINDS = ["EU"]
SCORED = {
    "manual_segments": "accuracy on EU reference segments, unseen signers",
    "automatic_segments": "accuracy on EU automatic segments, unseen signers",
    "frames": "agreement on EU frames, transitions included, unseen signers",
}


def main() -> None:
    """Make the corpora, train, measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", default=list(SHIPPED), help="which classifiers (default: all)")
    parser.add_argument("--workers", type=int, default=2, help="takes solved at a time (default: 2)")
    arguments = parser.parse_args()
    copies = COPIES if VARIED in arguments.names else 0
    training = [
        (request, copy) for copy in (AS_IT_IS, *range(copies)) for request in plan_corpus(signers=SIGNERS, seed=SEED)
    ]
    test = [(r, AS_IT_IS) for r in plan_corpus(signers=TEST_SIGNERS, seed=TEST_SEED, kinds=TEST_KINDS)]
    solved = examples_of(training, workers=arguments.workers)
    tested = examples_of(test, workers=arguments.workers)
    for name in arguments.names:
        model = trained(name, solved)
        if name == VARIED:
            model = with_familiarity(model, *takes_to_know_by(workers=arguments.workers))
        write(model, tested, make_rows(workers=arguments.workers) if name == VARIED else {})
        print((FOLDER / f"{name}.md").read_text(encoding="utf-8"))


def examples_of(wanted: list[tuple[TakeRequest, int]], *, workers: int = 2) -> list[Example]:
    """The takes asked for, solved; each is a request and which of its variations, or `AS_IT_IS`."""
    from joblib import Parallel, delayed

    made: Iterable[Example | None] = Parallel(n_jobs=workers, return_as="generator")(
        delayed(example_of)(*one) for one in wanted
    )
    return [example for example in progress(made, "solving", total=len(wanted)) if example is not None]


def example_of(request: TakeRequest, copy: int) -> Example | None:
    """A take, solved; None where a variation shows too little of the face.

    As it is, its neutral frame is told, as a corpus's manifest does; that of most variations is looked for.
    """
    varied = copy != AS_IT_IS
    made = varied_take(request, copy) if varied else make_take(request)
    told = not varied or request.stream(what=200 + copy).random() < TOLD
    settings = SolveSettings(layout="default-40", neutral=made.neutral_s if told else "auto")
    try:
        descriptors = solve(made.take, settings=settings)
    except SignfaceError:
        return None
    return Example(
        take=f"{request.name}_{copy}" if varied else request.name,
        signer=request.signer_name,
        kind=request.kind,
        descriptors=replace(descriptors, head=None),
        reference=made.reference,
        sentence=request.sentence,
    )


def strange_example(request: OtherRequest, tracked: bool) -> Example:
    """A take of the second generator, its landmarks solved or its weights as they truly are."""
    made = make_other_take(request)
    descriptors = solve(made.take, settings=SolveSettings(layout="default-40")) if tracked else made.avatar_weights
    return Example(request.name, request.signer_name, request.kind, replace(descriptors, head=None), made.reference)


def takes_to_know_by(*, workers: int = 2) -> tuple[list[Example], list[Example]]:
    """Takes like the training, as they are and varied, and takes that are not: by none of them was the model trained.

    What is unlike is the second generator's. Nothing of it teaches a label.
    """
    from joblib import Parallel, delayed

    of_one = plan_corpus(signers=1, seed=FAMILIAR_SEED)
    known = examples_of([(r, AS_IT_IS) for r in of_one] + [(r, 0) for r in of_one], workers=workers)
    others = [r for r in plan_other(signers=4, seed=FAMILIAR_SEED, kinds=["EU"]) if r.number < 8]
    strange = Parallel(n_jobs=workers)(
        delayed(strange_example)(request, tracked) for tracked in (True, False) for request in others
    )
    return known, strange


def with_familiarity(model: TrainedModel, known: list[Example], strange: list[Example]) -> TrainedModel:
    """The model with what tells takes like its training from others (`signface.label.familiarity`)."""
    told = [
        [measures(e.descriptors, find_segments(e.descriptors, model), model) for e in of] for of in (known, strange)
    ]
    return replace(model, card=replace(model.card, familiarity=fit_familiarity(*told)))


def trained(name: str, training: list[Example]) -> TrainedModel:
    """One classifier of `SHIPPED`, trained on the takes that are its own among solved ones."""
    classifier, kinds = SHIPPED[name]
    varied = name == VARIED
    return train(
        [e for e in training if e.kind in kinds and (varied or e.take.count("_") == USUAL_NAME)],
        TrainingSettings(classifier=classifier, calibrate=False),
        solve=SolveSettings(layout="default-40"),
        corpus="synthetic (signface synth)",
        name=name,
    )


def write(model: TrainedModel, test: list[Example], outside: dict[str, list[Example]]) -> None:
    """Measure a classifier and write it with its card.

    Parameters
    ----------
    model : TrainedModel
    test : list of Example
    outside : dict of str to list of Example
        Rows of `benchmarks.generalisation.make_rows`; none to leave them out.
    """
    scores = score_model(model, test)
    measured = {what: scores[section]["accuracy"] for section, what in SCORED.items()}
    model = replace(model, card=replace(model.card, scores=measured))
    save_model(model, FOLDER / f"{model.name}.skops")
    beyond = {
        row: {model.name: measure(model, examples), "everything neutral": everything_neutral(examples)}
        for row, examples in outside.items()
    }
    with whole_file(FOLDER / f"{model.name}.md") as temporary:
        text = card_text(model.name, model.card, scores, table(beyond) if beyond else "")
        temporary.write_text(text, encoding="utf-8")


def card_text(name: str, card: Card, sections: dict, outside: str = "") -> str:
    """The card of the classifier, for people; `outside` is the table of `benchmarks/generalisation.py`."""
    usual = [take for take in card.takes if take.count("_") == USUAL_NAME]
    more = (
        f",\nand {len(card.takes) - len(usual)} variations of them, acted otherwise and recorded by other cameras and"
        "\nby trackers that jitter (`signface.synth.variety`)"
        if len(usual) < len(card.takes)
        else ""
    )
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
recorded: {len(usual)} takes of the kinds {" and ".join(card.kinds)} by {len(card.signers)} invented signers
(`signface synth --signers {SIGNERS} --seed {SEED}`){more},
on the face `{card.face}` with the markers of `{card.layout}`. On recordings of people, take its
labels as a first guess to be corrected, and train your own from your corrections:
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
{_intensity(sections.get("intensity"))}{_outside(outside)}"""


def _outside(outside: str) -> str:
    """The table of what it has not met, if it was measured."""
    if not outside:
        return ""
    return f"""
## Outside the training

Utterances of invented signers whom no training met, recorded otherwise, and of a second generator
(`signface synth --generator other`), on which no label was trained; neutral frames are looked for
(`python -m benchmarks.generalisation`, [Generalisation](../../docs/generalisation.md)). Rows of jitter and rate are of
what it was trained to pass over; those of another generator are not. In takes that it calls unlike its training, what
it would name is called `unknown`; what tells them was learnt from others of its own generator and of the second one.

{outside}
"""


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
