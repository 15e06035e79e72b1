"""The sentences of an evaluation's report: what was found, what it does not show, and what was done.

- `headline`: the main result in two or three sentences.
- `limits`: what the numbers do not show.
- `protocol_words`, `training_words`: what was trained on and tested, and how, in plain words.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signface.evaluation.details import ENERGIES, favourite
from signface.label.vocabulary import Vocabulary
from signface.report.evaluation.tables import by_protocol
from signface.settings.choices import NAMES, SEQUENCE_NAMES

KIND_WORDS = {"IE": "isolated expressions", "SE": "sequences of expressions", "EU": "expressive utterances"}


def percent(value: float | None) -> str:
    """`73 %`, with a narrow space that does not break; a dash where there is nothing."""
    return "–" if value is None else f"{100 * value:.0f}\u202f%"


def headline(metrics: Mapping[str, Any], facts: Mapping[str, Any], vocabulary: Vocabulary) -> list[str]:
    """The main result, beside what it is to be held against.

    Parameters
    ----------
    metrics : mapping
        The content of metrics.json.
    facts : mapping
        Of `signface.corpus.facts.corpus_facts`.
    vocabulary : Vocabulary
        What the labels stand for.
    """
    parts = by_protocol(metrics)
    first = next(iter(parts))
    best = favourite(metrics["classifiers"])
    automatic, manual = (metrics["classifiers"][best][key] for key in ("automatic_segments", "manual_segments"))
    takes = sum(len(fold["test_takes"]) for fold in metrics["protocol"]["folds"])
    signers = len({fold["signer"] for fold in metrics["protocol"]["folds"]})
    corpus = f"the {'synthetic ' if facts['synthetic'] else ''}corpus “{facts['name']}”"
    made = "finds and labels" if best in SEQUENCE_NAMES else "labels"
    sentences = [
        f"On {takes} {'take' if takes == 1 else 'takes'} of {kinds_words(metrics['protocol']['test_kinds'])} by "
        f"{_number(signers)} {'signer' if signers == 1 else 'signers'} of {corpus}, “{best}” "
        f"{made} {percent(automatic['accuracy'])}{_interval(automatic)} of the segments found automatically as the "
        f"reference has them, and {percent(manual['accuracy'])}{_interval(manual)} of the annotator’s own segments, "
        + ("after training on the same signer. " if first == "within" else "for signers that it was not trained on. ")
        + f"Always saying {vocabulary.describe(manual['majority_label'] or 'one label')} would be right for "
        f"{percent(manual['majority'])} of the annotator’s segments, a guess for {percent(manual['chance'])}."
    ]
    for protocol, part in parts.items():
        if protocol == first or best not in part["classifiers"]:
            continue
        other = part["classifiers"][best]
        sentences.append(
            ("For a signer that it was not trained on, " if protocol == "across" else "Trained on the same signer, ")
            + f"the same classifier is right for {percent(other['automatic_segments']['accuracy'])} of the automatic "
            f"and {percent(other['manual_segments']['accuracy'])} of the annotator’s segments."
        )
    by_best = metrics["segmentation_by_classifier"].get(best)
    cut = by_best or metrics["segmentation"]
    sentences.append(
        f"Boundaries between segments, found by {'the classifier itself' if by_best else 'the energies'}, match the "
        f"reference’s within 0.10 s with an F1 of {cut['boundary_f1']['0.10']:.2f}; stable or transition agree "
        f"on {percent(cut['frame_agreement'])} of the time."
    )
    return sentences


def limits(metrics: Mapping[str, Any], facts: Mapping[str, Any]) -> list[str]:
    """What the numbers do not show."""
    signers = {fold["signer"] for fold in metrics["protocol"]["folds"]}
    words = []
    if facts["synthetic"]:
        words.append(
            "The corpus is synthetic: the faces do not exist and were moved by a program. The numbers compare methods "
            "and show that the whole way works. They do not say how well real signers’ expressions are recognised, and "
            "nothing about any sign language follows from them."
        )
    one = len(signers) == 1
    words.append(
        f"{'One signer was' if one else f'{_number(len(signers)).capitalize()} signers were'} tested. The intervals "
        "tell how much hangs on the takes that happened to be recorded, not how another signer would do."
    )
    if len(metrics["classifiers"]) > 1:
        words.append(
            f"“{favourite(metrics['classifiers'])}” is named because it was right most of the time here among "
            f"{_number(len(metrics['classifiers']))} classifiers, on the very takes that it is reported on: expect a "
            "little less on new ones."
        )
    words.append(
        "The reference is one annotation. How far two annotators would agree is not known from it, and no method can "
        "be expected to agree better than they do (signface elan agree measures that)."
    )
    return words


def protocol_words(protocol: Mapping[str, Any]) -> str:
    """What was trained on and tested.

    Parameters
    ----------
    protocol : mapping
        The entry `protocol` of a part of metrics.json.
    """
    train, test = (kinds_words(protocol[key]) for key in ("train_kinds", "test_kinds"))
    if protocol["name"] == "within" and set(protocol["train_kinds"]) & set(protocol["test_kinds"]):
        return (
            f"Each signer’s takes were tested in turns: a classifier was trained on that signer’s {train}, but for the "
            f"takes of the turn, and tested on the {test} among these. No take is in both, and no sentence where the "
            "corpus names sentences."
        )
    if protocol["name"] == "within":
        return (
            f"As in the thesis: for each signer a classifier was trained on that signer’s {train} and tested on the "
            f"same signer’s {test}. No take is in both."
        )
    return (
        f"Each signer in turn was left out: a classifier was trained on the {train} of all other signers and tested on "
        f"the {test} of the one left out, of whom it has seen nothing."
    )


def training_words(training: Mapping[str, Any]) -> str:
    """How classifiers were trained, where that is not as in the thesis; empty where it is.

    Parameters
    ----------
    training : mapping
        The entry `training` of a protocol: what `signface.learn.training.train` was told.
    """
    words = []
    features = list(training.get("features", ["weights"]))
    if features != ["weights"]:
        words.append(f"classifiers of segments saw {' and '.join(features)}")
    if training.get("normalise") == "signer":
        words.append("each signer’s weights were taken less their mean and over their spread")
    if training.get("aggregate") == "frames":
        words.append("a segment’s label is what all of its frames say, not its mean")
    if training.get("balanced"):
        words.append("every label weighed the same in training")
    if training.get("search"):
        words.append("parameters were searched within the training takes")
    if training.get("calibrate"):
        words.append("confidences were calibrated on training takes left out")
    text = "; ".join(words)
    return f"{text[0].upper()}{text[1:]}." if text else ""


def classifier_words(names: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Each classifier and what it is."""
    return [(name, (NAMES | SEQUENCE_NAMES).get(name, "")) for name in names]


def method_words(method: str) -> str:
    """A method of segmentation, in a table."""
    return "energies alone" if method == ENERGIES else method


def kinds_words(kinds: list[str]) -> str:
    """`isolated expressions (IE) and sequences of expressions (SE)`."""
    spelt = [f"{KIND_WORDS[kind]} ({kind})" if kind in KIND_WORDS else f"takes of the kind {kind}" for kind in kinds]
    return spelt[0] if len(spelt) == 1 else ", ".join(spelt[:-1]) + " and " + spelt[-1]


def _interval(scores: Mapping[str, Any]) -> str:
    bounds = scores.get("accuracy_interval")
    return f" (95 % interval {100 * bounds[0]:.0f} to {100 * bounds[1]:.0f})" if bounds else ""


def _number(count: int) -> str:
    words = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
    return words[count] if count < len(words) else str(count)
