"""A performance of the synthetic corpus: all that a face does in a take, added up to weights in time.

- `perform`: the weights of a take.
- `group_of_bases`: which bases move together.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from signface.synth.expressions import NEUTRAL, Habits, Spread, base_weights, draw_face
from signface.synth.motion import pose_track, pulse, saturate, smooth_noise
from signface.synth.programme import Programme
from signface.synth.signing import GRAMMAR, blinks, glances, grammar_track, mouthing

#: Parts of the face that move in their own time.
GROUPS = (("brow",), ("eye", "cheekSquint", "noseSneer"), ("mouth", "cheekPuff"), ("jaw",))
#: How much of the affect's mouth is lost while words are mouthed.
MOUTH_TAKEN = 0.65
#: Affect acted within an utterance is weaker than the same acted for its own sake.
IN_UTTERANCES = (0.65, 1.0)


def group_of_bases(names: tuple[str, ...]) -> np.ndarray:
    """(N,) index into `GROUPS` of each base."""
    return np.array([next(i for i, starts in enumerate(GROUPS) if name.startswith(starts)) for name in names])


def perform(
    plan: Programme, time: np.ndarray, habits: Habits, spread: Spread, names: tuple[str, ...], rng: np.random.Generator
) -> np.ndarray:
    """(F, N) weights of a signer's own bases in a take, in [0, 1].

    Parameters
    ----------
    plan : Programme
    time : (F,) array
        Seconds, evenly spaced.
    habits : Habits
    spread : Spread
    names : (N,) tuple of str
    rng : numpy Generator
    """
    rate = 1.0 / (time[1] - time[0])
    groups = group_of_bases(names)
    affect = _affect(plan, time, rate, habits, spread, names, groups, rng)
    signing = np.zeros_like(affect)
    taken = np.zeros(len(time))
    for clause in plan.clauses:
        words, busy = mouthing(time, clause.start_s, clause.end_s, names, rng)
        for marking, start, end in clause.markings:
            signing += grammar_track(time, marking, start, end, names, rng)
            if GRAMMAR[marking].mouth is not None:
                shaped = pulse(time, start, end, 0.2, 0.2)
                words, busy = words * (1.0 - shaped)[:, None], np.maximum(busy, shaped)
        signing += words
        taken = np.maximum(taken, busy)
    mouth = groups >= 2
    affect[:, mouth] *= (1.0 - MOUTH_TAKEN * taken)[:, None]

    uttering = bool(plan.clauses)
    likely = [clause.end_s for clause in plan.clauses] + [phase.end_s for phase in plan.phases[:-1]]
    lids = blinks(time, likely, 18.0 if uttering else 12.0, names, rng)
    closed = lids.max(axis=1)
    weights = affect + signing
    eyes = groups == 1
    weights[:, eyes] *= (1.0 - 0.8 * closed)[:, None]  # the lids' other muscles let go in a blink
    weights += lids + glances(time, 18.0 if uttering else 4.0, names, rng) + _restlessness(time, rate, names, rng)
    return saturate(weights)


def _affect(
    plan: Programme,
    time: np.ndarray,
    rate: float,
    habits: Habits,
    spread: Spread,
    names: tuple[str, ...],
    groups: np.ndarray,
    rng: np.random.Generator,
) -> np.ndarray:
    """(F, N) weights of the affect alone."""
    poses: list[np.ndarray] = []
    for phase in plan.phases:
        pose = draw_face(phase.affect, max(1, phase.intensity), habits, spread, names, rng)
        if plan.clauses:
            if phase.affect == NEUTRAL and poses and rng.random() < 0.5:
                pose = pose + rng.uniform(0.05, 0.30) * poses[-1]  # an affect lingers
            elif phase.affect != NEUTRAL:
                pose = pose * rng.uniform(*IN_UTTERANCES)
        poses.append(pose)
    starts = [phase.end_s for phase in plan.phases[:-1]]
    ends = [phase.start_s for phase in plan.phases[1:]]
    track = pose_track(time, np.array(poses), starts, ends, groups, rng)

    # No apex is constant: it begins a little strong, relaxes, and wavers all the while.
    moments, strengths = [], []
    for phase in plan.phases:
        moments += [phase.start_s, phase.start_s + 0.3 * (phase.end_s - phase.start_s), phase.end_s]
        relaxed = 1.0 - rng.uniform(0.0, 0.25)
        strengths += [1.0 + rng.uniform(0.0, 0.12), 0.5 + 0.5 * relaxed, relaxed]
    course = gaussian_filter1d(np.interp(time, moments, strengths), 0.08 * rate)
    waver = 0.07 * smooth_noise(rng, len(time), rate, 0.9, len(groups)) + 0.05 * smooth_noise(rng, len(time), rate, 0.5)
    return np.maximum(track * (course[:, None] + waver), 0.0)


def _restlessness(time: np.ndarray, rate: float, names: tuple[str, ...], rng: np.random.Generator) -> np.ndarray:
    """(F, N) small slow weights that mean nothing."""
    restless = base_weights(
        {"browInnerUp": 1, "browDown*": 1, "mouthPress*": 1, "jawOpen": 0.5, "mouthSmile*": 0.7}, names
    )
    noise = smooth_noise(rng, len(time), rate, 0.3, len(names))
    return 0.025 * np.maximum(noise, 0.0) * restless
