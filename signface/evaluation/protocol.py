"""The evaluation of the thesis (4.4.3 and 4.5), for signers that were and were not trained on.

- `PROTOCOLS`: what is trained on what.
- `folds_of`: training and test takes of each signer.
- `UNCALIBRATED`: the settings of a plain evaluation.
- `evaluate_folds`: every classifier on every fold, on reference segments, automatic segments and frames.
- `score_model`: the same for one model that is trained already.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import combinations

import numpy as np
import pandas as pd

from signface.channels.rules import find_intensities
from signface.errors import SignfaceError
from signface.label.calibration import brier_score, expected_calibration_error
from signface.label.intensity import IntensityClassifier
from signface.label.labelling import find_segments, label_segments, label_spans
from signface.label.model import TrainedModel
from signface.label.vocabulary import UNKNOWN, Vocabulary
from signface.learn.examples import Example, common_vocabulary, signer_levels
from signface.learn.folds import groups_of, inner_folds
from signface.learn.ordinal import ordinal_metrics
from signface.learn.training import train
from signface.metrics.classification import accuracy_interval, classification_metrics, mcnemar
from signface.metrics.segmentation import segmentation_metrics
from signface.segmentation.cutting import segment
from signface.segmentation.segments import Segments, value_at
from signface.settings.choices import BY_SIGNER, NAMES
from signface.settings.training import TrainingSettings
from signface.signer_level import SignerLevel

#: name: which takes train the classifier that a signer's test takes are given to.
PROTOCOLS = {
    "within": "the training kinds of the same signer; in turns, where they are test kinds too",
    "across": "the training kinds of all other signers",
}

#: Times per second at which the whole annotation is compared with the reference.
FRAMES_RATE = 25.0

#: Turns in which a signer's takes are tested, where their kind is trained on as well.
TURNS = 5

#: What to do where turns cannot be dealt.
TURNS_HINT = "choose training kinds that are not tested, or --protocol across"

#: How classifiers are trained where nothing else is wanted: calibration trains each of them six times.
UNCALIBRATED = TrainingSettings(calibrate=False)

#: What stands for a transition when the whole annotation is compared.
TRANSITION = "transition"


@dataclass(frozen=True)
class Fold:
    """One signer's test takes and the takes their classifiers are trained on; never the same take in both.

    Nor is a sentence of the same signer, where the corpus names sentences.
    """

    signer: str
    train: tuple[Example, ...]
    test: tuple[Example, ...]

    def __post_init__(self) -> None:
        both = sorted({example.take for example in self.train} & {example.take for example in self.test})
        if both:
            raise SignfaceError(
                f"takes would be both trained on and tested: {', '.join(both[:5])}",
                hint="choose training kinds that are not test kinds",
            )
        known = {(e.signer, e.sentence) for e in self.train if e.sentence}
        again = sorted({e.sentence for e in self.test if e.sentence and (e.signer, e.sentence) in known})
        if again:
            raise SignfaceError(f"sentences would be both trained on and tested: {', '.join(again[:5])}")


@dataclass
class Evaluation:
    """What `evaluate_folds` measured.

    `metrics` is the content of metrics.json (see CONTRACT.md); `by_signer` has, for each signer, the same dictionary
    of classifiers. `tables` has what they were counted from: for each classifier its `manual_segments` and
    `automatic_segments` (a row a stable segment: `signer, take, kind, start_s, end_s, truth, found, confidence`) and
    its `frames` (a row a frame of 1 / `FRAMES_RATE`: `signer, take, kind, time_s, truth, found`). `truth` is empty
    where the reference has no stable segment. `found` holds the labelled segments of each classifier, by take.
    `trained` has, for each fold, what each classifier's card says of its `parameters`, `calibration` and `scores` on
    training takes left out.
    """

    metrics: dict
    by_signer: dict[str, dict] = field(default_factory=dict)
    tables: dict[str, dict[str, pd.DataFrame]] = field(default_factory=dict)
    found: dict[str, dict[str, Segments]] = field(default_factory=dict)
    trained: list[dict[str, dict]] = field(default_factory=list)


def folds_of(
    examples: Sequence[Example],
    *,
    protocol: str,
    train_kinds: Sequence[str],
    test_kinds: Sequence[str],
    turns: int = TURNS,
) -> list[Fold]:
    """The folds of a protocol: one for each signer with test takes, or several.

    Where `within` trains on a kind that it tests, the test takes of a signer are dealt into turns. Each turn in its
    turn is tested by what the other takes of the training kinds teach; takes of one sentence stay together.

    Parameters
    ----------
    examples : sequence of Example
        Takes of a corpus; their names are unique.
    protocol : str
        One of `PROTOCOLS`.
    train_kinds, test_kinds : sequences of str
        Kinds of takes to train on and to test.
    turns : int
        At most as many as a signer has test takes (or sentences).

    Raises
    ------
    SignfaceError
        There is no such protocol, a set is empty, `across` has one signer only, or there are too few takes for turns.

    Examples
    --------
    >>> import signface as sf
    >>> examples = sf.datasets.mini_examples()
    >>> folds = folds_of(examples, protocol="across", train_kinds=["IE", "SE"], test_kinds=["EU"])
    >>> for fold in folds:
    ...     print(fold.signer, [example.take for example in fold.train], [example.take for example in fold.test])
    M1 ['M2_SE_A'] ['M1_EU_11']
    M2 ['M1_IE_J'] ['M2_EU_04']
    """
    if protocol not in PROTOCOLS:
        raise SignfaceError(f"there is no protocol named {protocol}", hint=f"choose {' or '.join(PROTOCOLS)}")
    signers = sorted({example.signer for example in examples})
    if protocol == "across" and len(signers) < 2:
        raise SignfaceError("an unseen signer needs a corpus of two signers or more", hint="use --protocol within")
    folds = []
    for signer in signers:
        test = [e for e in examples if e.signer == signer and e.kind in test_kinds]
        train = [e for e in examples if (e.signer == signer) == (protocol == "within") and e.kind in train_kinds]
        if not test:
            continue
        if not train:
            raise SignfaceError(
                f"there is no annotated take of the kind {', '.join(train_kinds)} to train on for the signer {signer}",
                hint="choose other training kinds, or another protocol",
            )
        both = {e.take for e in train} & {e.take for e in test}
        folds += _turns(signer, train, test, turns) if both else [Fold(signer, tuple(train), tuple(test))]
    if not folds:
        raise SignfaceError(f"there is no annotated take of the kind {', '.join(test_kinds)} to test")
    return folds


def _turns(signer: str, train: Sequence[Example], test: Sequence[Example], turns: int) -> list[Fold]:
    """Folds of one signer whose test takes are trained on in the turns of the others."""
    pairs = inner_folds(test, folds=turns, by_signer=False)
    if not pairs:
        raise SignfaceError(f"the signer {signer} has too few takes to test in turns", hint=TURNS_HINT)
    folds = []
    for _, tested in pairs:
        away = set(groups_of(tested, by_signer=False))
        kept = [e for e, group in zip(train, groups_of(train, by_signer=False), strict=True) if group not in away]
        if not kept:
            problem = f"there is nothing to train on for the signer {signer} in one of the turns"
            raise SignfaceError(problem, hint=TURNS_HINT)
        folds.append(Fold(signer, tuple(kept), tuple(tested)))
    return folds


def evaluate_folds(
    folds: Sequence[Fold],
    settings: TrainingSettings = UNCALIBRATED,
    *,
    classifiers: Sequence[str] = tuple(NAMES),
    segments: Mapping[str, Segments] | None = None,
    progress: Callable[[Sequence[tuple[int, str]]], Iterable[tuple[int, str]]] = iter,
) -> Evaluation:
    """Train every classifier on every fold and compare what it says with the reference.

    - *Reference segments*: the mean descriptor of each stable segment of the reference is classified.
    - *Automatic segments*: so is that of each stable segment that `signface.segmentation` finds (a sequence model finds
      its own, which `segmentation_by_classifier` compares with the reference's); it should have the label that the
      reference gives to most of it. Those of which no part is stable in the reference have no right label; they are
      counted (`without_reference`) and left out.
    - *Frames*: the whole annotation, transitions included, is compared with the reference 25 times a second, with
      all transitions as one further label. This is what an annotator finds on opening the file.
    - *Intensity*: that of each stable segment of the reference which has one, given its label, by what was learnt from
      the training takes and by the rule of `signface.channels.rules`.

    What chooses parameters or calibrates does so within the training takes of each fold. Where a signer is normalised,
    it is by the test takes of the fold, of which no label is looked at.

    Parameters
    ----------
    folds : sequence of Fold
    settings : TrainingSettings
        How every classifier is trained; `classifier` itself is not looked at. Its seed is that of the bootstrap too.
    classifiers : sequence of str
        Names of `NAMES` and `SEQUENCE_NAMES` of `signface.label.labellers`.
    segments : mapping of Segments, optional
        Automatic segments of test takes by name, where they are known already.
    progress : callable, optional
        Wraps the list of steps (number of the fold, classifier), to show how far it is.

    Returns
    -------
    Evaluation
    """
    known = dict(segments or {})
    for fold in folds:
        for example in fold.test:
            if example.take not in known:
                known[example.take] = segment(example.descriptors)
    tables: dict[str, dict[str, list[pd.DataFrame]]] = {
        name: {"manual_segments": [], "automatic_segments": [], "frames": []} for name in classifiers
    }
    own: dict[str, list[tuple[pd.DataFrame, pd.DataFrame]]] = {name: [] for name in classifiers}
    annotated: dict[str, dict[str, Segments]] = {name: {} for name in classifiers}
    trained: list[dict[str, dict]] = [{} for _ in folds]
    levels = [signer_levels(fold.test) if settings.normalise in BY_SIGNER else {} for fold in folds]
    strengths: list[pd.DataFrame] = []
    steps = [(number, name) for number in range(len(folds)) for name in classifiers]
    for number, name in progress(steps):
        fold = folds[number]
        model = train(fold.train, settings.for_classifier(name), name=name)
        card = model.card
        trained[number][name] = {
            "parameters": dict(card.parameters),
            "calibration": dict(card.calibration),
            "scores": dict(card.scores),
        }
        for example in fold.test:
            found, level = known[example.take], levels[number].get(example.signer)
            if model.sequential:
                found = find_segments(example.descriptors, model, level=level)
                own[name].append((example.reference.table, found.table))
            compared, annotated[name][example.take] = _compared(example, found, model, level)
            for section, table in compared.items():
                tables[name][section].append(table)
            if name == classifiers[0] and model.intensity is not None:
                strengths.append(_intensities(example, model.intensity))
    pooled = {
        name: {key: pd.concat(parts, ignore_index=True) for key, parts in sections.items()}
        for name, sections in tables.items()
    }
    test = [example for fold in folds for example in fold.test]
    vocabulary = common_vocabulary(test)
    metrics: dict = {
        "segmentation": segmentation_metrics((e.reference.table, known[e.take].table) for e in test),
        "classifiers": {name: _scores(sections, vocabulary, settings.seed) for name, sections in pooled.items()},
    }
    metrics["segmentation_by_classifier"] = {name: segmentation_metrics(pairs) for name, pairs in own.items() if pairs}
    if strengths:
        metrics["intensity"] = _intensity_scores(pd.concat(strengths, ignore_index=True))
    metrics["mcnemar"] = _mcnemar({name: sections["manual_segments"] for name, sections in pooled.items()})
    by_signer = {
        signer: {
            name: _scores(
                {key: table[table.signer == signer] for key, table in sections.items()}, vocabulary, settings.seed
            )
            for name, sections in pooled.items()
        }
        for signer in dict.fromkeys(fold.signer for fold in folds)
    }
    return Evaluation(metrics, by_signer, pooled, annotated, trained)


def score_model(model: TrainedModel, test: Sequence[Example], *, seed: int = 0) -> dict:
    """What `evaluate_folds` measures, for a model that is trained already, on takes that it was not trained on.

    Returns
    -------
    dict
        `manual_segments`, `automatic_segments` and `frames` as in metrics.json, `segmentation`, and `intensity` where
        the model gives it.
    """
    parts: dict[str, list[pd.DataFrame]] = {}
    pairs, strengths = [], []
    levels = signer_levels(test) if model.card.normalise in BY_SIGNER else {}
    for example in test:
        level = levels.get(example.signer)
        cut = partial(find_segments, model=model, level=level) if model.sequential else segment
        found = cut(example.descriptors)
        pairs.append((example.reference.table, found.table))
        for section, table in _compared(example, found, model, level)[0].items():
            parts.setdefault(section, []).append(table.assign(take=f"{example.signer}/{example.take}"))
        if model.intensity is not None:
            strengths.append(_intensities(example, model.intensity))
    scores = _scores({section: pd.concat(tables) for section, tables in parts.items()}, common_vocabulary(test), seed)
    scores["segmentation"] = segmentation_metrics(pairs)
    if strengths:
        scores["intensity"] = _intensity_scores(pd.concat(strengths, ignore_index=True))
    return scores


def _compared(
    example: Example, found: Segments, model: TrainedModel, level: SignerLevel | None = None
) -> tuple[dict[str, pd.DataFrame], Segments]:
    """The tables of a take (see `Evaluation.tables`), and its labelled segments."""
    descriptors, reference = example.descriptors, example.stable
    manual = reference[["start_s", "end_s", "label"]].rename(columns={"label": "truth"})
    manual["found"], manual["confidence"] = label_spans(
        descriptors, manual[["start_s", "end_s"]].to_numpy(float), model, level=level
    )
    stable = found.table[found.table["kind"] == "stable"]
    spans = stable[["start_s", "end_s"]].to_numpy(float)
    automatic = stable[["start_s", "end_s"]].assign(truth=most_overlapping(spans, reference))
    if found.labelled:
        automatic["found"], automatic["confidence"] = stable["label"], stable["confidence"]
        labelled = found
    else:
        automatic["found"], automatic["confidence"] = label_spans(descriptors, spans, model, level=level)
        labelled = label_segments(descriptors, found, model, level=level)
    times = np.arange(descriptors.start + 0.5 / FRAMES_RATE, descriptors.start + descriptors.duration, 1 / FRAMES_RATE)
    truth, said = (_annotation_at(segments.table, times) for segments in (example.reference, labelled))
    frames = pd.DataFrame({"time_s": times, "truth": truth, "found": said})[truth != ""]
    tables = {"manual_segments": manual, "automatic_segments": automatic, "frames": frames}
    for table in tables.values():
        for place, column in enumerate(("signer", "take", "kind")):
            table.insert(place, column, getattr(example, column))
    return tables, labelled


def most_overlapping(spans: np.ndarray, reference: pd.DataFrame) -> list[str]:
    """For each span, the label that the reference's stable segments give to the longest part of it.

    Empty where the span overlaps none.
    """
    labels = []
    starts, ends = reference["start_s"].to_numpy(float), reference["end_s"].to_numpy(float)
    for start, end in spans:
        overlap = (np.minimum(ends, end) - np.maximum(starts, start)).clip(0)
        by_label = pd.Series(overlap).groupby(reference["label"].to_numpy(object)).sum()
        labels.append(str(by_label.idxmax()) if overlap.sum() > 0 else "")
    return labels


def _mcnemar(tables: dict[str, pd.DataFrame]) -> list[dict]:
    """McNemar's test between each pair of classifiers on the same reference segments."""
    hits = {name: (table["truth"] == table["found"]).tolist() for name, table in tables.items()}
    return [
        {"first": first, "second": second, **mcnemar(hits[first], hits[second])}
        for first, second in combinations(hits, 2)
    ]


def _intensities(example: Example, learnt: IntensityClassifier) -> pd.DataFrame:
    """Intensity of the reference's stable segments that have one: annotated, learnt and by the rule."""
    ruled = find_intensities(example.descriptors, example.reference)
    table = example.stable.assign(rule=ruled.table.loc[example.stable.index, "intensity"])
    table["learnt"] = learnt.predict(
        example.descriptors, table[["start_s", "end_s"]].to_numpy(float), table["label"].tolist()
    )
    if "intensity" not in table:
        table["intensity"] = None
    return table[["intensity", "learnt", "rule"]].dropna()


def _intensity_scores(table: pd.DataFrame) -> dict:
    truth = table["intensity"].tolist()
    return {name: ordinal_metrics(truth, table[name].tolist()) for name in ("learnt", "rule")}


def _annotation_at(table: pd.DataFrame, times: np.ndarray) -> np.ndarray:
    """Labels at some times, all transitions as one; empty where nothing is annotated."""
    labels, kinds = value_at(table, "label", times), value_at(table, "kind", times)
    return np.where(kinds == TRANSITION, TRANSITION, labels)


def _scores(sections: dict[str, pd.DataFrame], vocabulary: Vocabulary, seed: int) -> dict:
    """The metrics of one classifier, section by section."""
    scores = {}
    for section, table in sections.items():
        judged = table[table["truth"] != ""]
        # Labels found where nothing was: an automatic annotation has no gaps, so this does not happen to frames.
        labels = list(vocabulary.values)
        if section == "frames" and vocabulary.transitions:
            labels.append(TRANSITION)
        if (judged["found"] == UNKNOWN).any():
            labels.append(UNKNOWN)
        result = classification_metrics(judged["truth"].tolist(), judged["found"].tolist(), labels)
        hits = (judged["truth"] == judged["found"]).tolist()
        result["accuracy_interval"] = accuracy_interval(hits, judged["take"].tolist(), seed=seed)
        result["n_takes"] = int(judged["take"].nunique())
        if section != "frames":
            result["calibration_error"], result["brier"] = None, None
            if len(judged):
                sure = judged["confidence"].to_numpy(float)
                result["calibration_error"] = expected_calibration_error(sure, np.array(hits))
                result["brier"] = brier_score(sure, np.array(hits))
        if section == "automatic_segments":
            result["without_reference"] = int(len(table) - len(judged))
        scores[section] = result
    return scores
