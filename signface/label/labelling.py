"""Labels for the segments of a take (thesis 4.4.3).

- `label_spans`: a label and a confidence for any stretches of a take, each for itself.
- `label_segments`: the segments of a take with labels, transitions included.
- `without_transitions`: a labelled table in which one value ends where the next begins.
- `find_segments`: a take's segments and their labels by whatever the model is, from nothing but the take.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.label.courses import segment_courses
from signface.label.familiarity import abstained
from signface.label.model import TrainedModel
from signface.label.spans import frames_within, segment_means
from signface.label.vocabulary import Vocabulary
from signface.segmentation.cutting import segment
from signface.segmentation.segments import Segments
from signface.signer_level import SignerLevel

#: Frames per second that the confidence of a segment is averaged over.
CONFIDENCE_RATE = 25.0

#: The least probability of a frame that counts: one frame alone cannot rule a label out for its segment.
LEAST = 1e-3

#: How much of a transition at the end of the take stands for the expression outside it (s).
EDGE_S = 0.05


def label_spans(
    descriptors: Descriptors, spans: np.ndarray, model: TrainedModel, *, level: SignerLevel | None = None
) -> tuple[list[str], list[float]]:
    """Label and confidence of each span of a take, each judged for itself (see `label_segments`).

    Parameters
    ----------
    descriptors : Descriptors
    spans : (S, 2) array
        Start and end of each span in seconds.
    model : TrainedModel
    level : SignerLevel, optional
        As in `TrainedModel.seen`.

    Raises
    ------
    SignfaceError
        The model was trained on other bases, or no span has weights.
    """
    if len(spans) == 0:
        return [], []
    judge = _judged_by_frames if model.sequential else _judged_by_rows
    chosen, shares = judge(model.seen(descriptors, level), np.asarray(spans, dtype=float), model)
    confidences = model.confidence(shares[np.arange(len(spans)), chosen])
    confidences[shares.sum(axis=1) == 0] = 0.0  # nothing was seen of the span
    return [model.card.labels[code] for code in chosen], confidences.tolist()


def _judged_by_rows(take: Descriptors, spans: np.ndarray, model: TrainedModel) -> tuple[np.ndarray, np.ndarray]:
    """Code of the label of each span, and its mean probabilities over the frames, zero where none has weights."""
    means = segment_means(take, spans)
    known = np.isfinite(means).all(axis=1)
    if not known.any():
        raise SignfaceError(f"{take.name}: no segment has weights, so none can be labelled")
    if model.card.aggregate == "course":
        shares = np.zeros((len(spans), len(model.card.labels)))
        shares[known] = model.probabilities(segment_courses(take, spans[known]))
        return shares.argmax(axis=1), shares
    thinned = [_thinned(take, start, end) for start, end in spans]
    probabilities = model.probabilities(take.weights[np.concatenate(thinned)])
    shares = np.zeros((len(spans), len(model.card.labels)))
    logs = np.zeros_like(shares)
    offset = 0
    for row, frames in enumerate(thinned):
        if known[row]:
            of_span = probabilities[offset : offset + len(frames)]
            shares[row], logs[row] = of_span.mean(axis=0), np.log(of_span.clip(LEAST)).mean(axis=0)
        offset += len(frames)
    chosen = logs.argmax(axis=1)
    if model.card.aggregate == "mean":
        labels = model.estimator.predict(means[known])
        chosen[known] = [model.card.labels.index(label) for label in labels]
    nearest = np.flatnonzero(known)
    for blind in np.flatnonzero(~known):  # the expression before goes on, or at the start the one after was there
        before = nearest[nearest < blind]
        chosen[blind] = chosen[before[-1] if len(before) else nearest[0]]
    return chosen, shares


def _judged_by_frames(take: Descriptors, spans: np.ndarray, model: TrainedModel) -> tuple[np.ndarray, np.ndarray]:
    """What a sequence model's frames say of each span: the label with the highest mean log probability."""
    estimator: Any = model.estimator
    among, times = estimator.label_probabilities(take), estimator.frame_times(take)
    shares = np.zeros((len(spans), among.shape[1]))
    logs = np.zeros_like(shares)
    for row, (start, end) in enumerate(spans):
        inside = (times >= start) & (times < end)
        if not inside.any():
            inside[np.argmin(np.abs(times - (start + end) / 2))] = True
        shares[row], logs[row] = among[inside].mean(axis=0), np.log(among[inside].clip(LEAST)).mean(axis=0)
    return logs.argmax(axis=1), shares


def label_segments(
    descriptors: Descriptors, segments: Segments, model: TrainedModel, *, level: SignerLevel | None = None
) -> Segments:
    """Label the segments of a take.

    A stable segment gets the label that the classifier gives to its mean descriptor (eq. 4.6), or to its frames
    (`signface.settings.choices.AGGREGATES`). Its confidence is that label's probability averaged over the segment's
    frames, calibrated where the model is: a face that changes inside a segment, or lies between two expressions,
    lowers it, whichever the classifier.

    A transition is named by its neighbours (`NA`), and its confidence is the product of theirs, since its name is
    right when both are. Where it comes from or leads to nothing because the take begins or ends in it, the first or
    last `EDGE_S` of the take stand for the neighbour. A transition between two equal labels is no transition of the
    expression (a blink, a mouthed word): it is taken, with its neighbours, into one stable segment, whose confidence
    is the mean of theirs by duration.

    A stable segment in which no frame has weights takes the label of the one before it (or after, at the start),
    with confidence 0.

    Parameters
    ----------
    descriptors : Descriptors
        The take.
    segments : Segments
        Its segments, from `signface.segmentation.cutting.segment`.
    model : TrainedModel
    level : SignerLevel, optional
        As in `TrainedModel.seen`.

    Returns
    -------
    Segments
        With the columns `label` and `confidence`, and `intensity` where the model gives it; neighbours have unequal
        labels.

    Raises
    ------
    SignfaceError
        The model was trained on other bases, or no segment has weights.

    See Also
    --------
    signface.annotate : from a recording on, with the segments of the model.

    Examples
    --------
    >>> import signface as sf
    >>> weights = sf.datasets.mini_weights()
    >>> labelled = sf.label_segments(weights, sf.segment(weights), sf.load_model())
    >>> labelled.table["label"].tolist()
    ['N', 'ND', 'D', 'DN', 'N']
    """
    states = _states(segments)
    samples = np.array([state.sample for state in states])
    labels, confidences = label_spans(descriptors, samples, model, level=level)
    states = [
        replace(state, label=label, confidence=confidence)
        for state, label, confidence in zip(states, labels, confidences, strict=True)
    ]
    table = _table(_without_repetition(states), model.card.vocabulary)
    labelled = segments.changed(f"label {model.name} ({model.card.classifier})", table)
    return labelled if model.intensity is None else model.intensity.annotate(descriptors, labelled)


def find_segments(descriptors: Descriptors, model: TrainedModel, *, level: SignerLevel | None = None) -> Segments:
    """The labelled segments of a take.

    A sequence model finds them itself; for the others the take is cut by `signface.segmentation.cutting.segment` and
    labelled by `label_segments`. The columns are the same, and neighbours have unequal labels. In a take that is unlike
    the model's training, what it would name is called unknown (`signface.label.familiarity`).

    Raises
    ------
    SignfaceError
        The model was trained on other bases, or no frame has weights.
    """
    if not model.sequential:
        return abstained(descriptors, label_segments(descriptors, segment(descriptors), model, level=level), model)
    segments = model.estimator.annotate(model.seen(descriptors, level))
    table = segments.table.copy()
    stable = (table["kind"] == "stable").to_numpy()
    sure = table["confidence"].to_numpy(float).copy()
    sure[stable] = model.confidence(sure[stable])
    for row in np.flatnonzero(~stable):  # as sure as both neighbours
        sure[row] = np.prod([sure[other] for other in (row - 1, row + 1) if 0 <= other < len(sure) and stable[other]])
    table["confidence"] = sure
    if not model.card.vocabulary.transitions:
        table = without_transitions(table)
    labelled = segments.changed(f"find_segments {model.name} ({model.card.classifier})", table)
    labelled = abstained(descriptors, labelled, model)
    return labelled if model.intensity is None else model.intensity.annotate(descriptors, labelled)


@dataclass(frozen=True)
class _State:
    """An expression held from `start` to `end`, judged by the frames of `sample`.

    It has no duration where a transition has no stable neighbour. `moving` says that a transition leads to it.
    """

    start: float
    end: float
    sample: tuple[float, float]
    moving: bool
    label: str = ""
    confidence: float = 0.0


def _states(segments: Segments) -> list[_State]:
    """The stable segments, and one of no duration wherever a transition lacks a stable neighbour."""
    states: list[_State] = []
    previous = "transition"
    rows = list(segments.table[["start_s", "end_s", "kind"]].itertuples(index=False))
    for number, (start, end, kind) in enumerate(rows):
        if kind == "stable":
            states.append(_State(start, end, (start, end), moving=number > 0 and previous == "transition"))
        else:
            if previous == "transition":
                states.append(_State(start, start, (start, min(start + EDGE_S, end)), moving=number > 0))
            if number == len(rows) - 1:
                states.append(_State(end, end, (max(end - EDGE_S, start), end), moving=True))
        previous = kind
    return states


def _thinned(descriptors: Descriptors, start: float, end: float) -> np.ndarray:
    """Some `CONFIDENCE_RATE` frames per second of the span, evenly spaced, at least one if there is any."""
    frames = frames_within(descriptors, start, end)
    count = min(len(frames), max(1, round((end - start) * CONFIDENCE_RATE)))
    return frames[((np.arange(count) + 0.5) * len(frames) / max(count, 1)).astype(int)]


def _without_repetition(states: list[_State]) -> list[_State]:
    """The states with runs of one label made into one state."""
    kept: list[_State] = []
    for state in states:
        if kept and kept[-1].label == state.label:
            before = kept[-1]
            durations = np.array([before.end - before.start, state.end - state.start]) + 1e-9
            confidence = float(np.average([before.confidence, state.confidence], weights=durations))
            kept[-1] = replace(before, end=state.end, confidence=confidence)
        else:
            kept.append(state)
    return kept


def without_transitions(table: pd.DataFrame) -> pd.DataFrame:
    """A labelled table in which every transition is shared by its neighbours, half and half.

    That is how tiers are annotated whose vocabulary has no transitions: one value ends where the next begins. At the
    ends of the take the one neighbour takes all.
    """
    stable = (table["kind"] == "stable").to_numpy()
    if stable.all() or not stable.any():
        return table[stable].reset_index(drop=True)
    start, end = table["start_s"].to_numpy(float).copy(), table["end_s"].to_numpy(float).copy()
    rows = np.flatnonzero(stable)
    start[rows[0]], end[rows[-1]] = start[0], end[-1]
    for before, after in pairwise(rows):
        if after > before + 1:
            end[before] = start[after] = (end[before] + start[after]) / 2
    return table.assign(start_s=start, end_s=end)[stable].reset_index(drop=True)


def _table(states: list[_State], vocabulary: Vocabulary) -> pd.DataFrame:
    """The rows of the states, and of the transitions between them where the vocabulary has any."""
    rows: list[tuple[float, float, str, str, float]] = []
    for number, state in enumerate(states):
        if state.moving and number > 0:
            before = states[number - 1]
            name = vocabulary.join(before.label, state.label) if vocabulary.transitions else ""
            rows.append((before.end, state.start, "transition", name, before.confidence * state.confidence))
        if state.end > state.start:
            rows.append((state.start, state.end, "stable", state.label, state.confidence))
    table = pd.DataFrame(rows, columns=["start_s", "end_s", "kind", "label", "confidence"])
    return table if vocabulary.transitions else without_transitions(table)
