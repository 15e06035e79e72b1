"""Recordings that differ: what cameras, trackers and other people do to a take of the synthetic corpus.

- `Recorded`, `recorded_as`: a take as another camera gives it: another rate, jitter, markers absent.
- `Acting`: a performance with other gains, and with movement of the mouth and brows that belongs to no affect.
- `draw_recorded`, `draw_acting`, `draw_spread`: drawn widely, for training.
- `varied_take`: a take of the corpus, acted and recorded otherwise.

A classifier that has only met one camera and one way of mouthing takes a landmark tracker's jitter for signing, and
another person's mouthing for affect. Varying what does not matter, far more than it varies in any one place, is what
makes a model pass over it (J. Tobin et al., Domain randomization, 2017). The ranges are those of devices: a
motion-capture system jitters by tenths of a millimetre at 100 to 200 Hz, landmarks of a film by 1 to 3 mm at 25 to 60
Hz, and trackers, which filter or follow their last estimate, wander rather than shake.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from signface.synth.corpus import SyntheticTake, TakeRequest, make_take
from signface.synth.expressions import Spread
from signface.synth.motion import pulse, saturate, smooth_noise
from signface.synth.programme import Programme
from signface.takes.take import Take

#: Share of varied takes that a tracker of landmarks has recorded; the others were recorded by cameras and markers.
TRACKED = 0.6
#: Least of the head markers that are kept: the head's motion needs three.
HEAD_MARKERS = 6


@dataclass(frozen=True)
class Recorded:
    """How a take is recorded.

    Parameters
    ----------
    rate : float, optional
        Frames per second (Hz); as the take is by default.
    jitter_mm : float
        Root mean square in space of jitter that differs from frame to frame.
    wander_mm : float
        The same of jitter that lasts, as of a tracker that follows its last estimate.
    wander_hz : float
        How fast it changes: its power falls to a half there.
    absent : float
        Share of the face markers that are not there.
    """

    rate: float | None = None
    jitter_mm: float = 0.0
    wander_mm: float = 0.0
    wander_hz: float = 2.0
    absent: float = 0.0


def recorded_as(take: Take, how: Recorded, rng: np.random.Generator) -> Take:
    """The take as another camera gives it.

    Parameters
    ----------
    take : Take
        Its last markers are the head's, as in the layouts that ship.
    how : Recorded
    rng : numpy Generator

    Examples
    --------
    >>> import signface as sf
    >>> filmed = recorded_as(sf.datasets.mini_take(), Recorded(rate=30.0, jitter_mm=2.0), np.random.default_rng(0))
    >>> filmed.rate, filmed.n_frames
    (30.0, 177)
    """
    positions, rate, labels = take.positions, take.rate, take.labels
    if how.rate is not None and how.rate != take.rate:
        rate = how.rate
        at = np.arange(int(take.duration * rate)) * (take.rate / rate)
        first = np.minimum(at.astype(int), take.n_frames - 1)
        second = np.minimum(first + 1, take.n_frames - 1)
        share = (at - first)[:, None, None]
        positions = np.where(share > 0, positions[first] * (1 - share) + positions[second] * share, positions[first])
    shape = positions.shape
    noise = how.jitter_mm / np.sqrt(3.0) * rng.standard_normal(shape)
    if how.wander_mm:
        slow = smooth_noise(rng, shape[0], rate, how.wander_hz, shape[1] * 3).reshape(shape)
        noise = noise + how.wander_mm / np.sqrt(3.0) * slow
    face = len(labels) - HEAD_MARKERS
    kept = np.sort(np.append(rng.permutation(face)[round(how.absent * face) :], np.arange(face, len(labels))))
    return Take(
        (positions + noise)[:, kept],
        tuple(labels[marker] for marker in kept),
        rate,
        take.start,
        take.name,
        (*take.history, "recorded otherwise (synthetic)"),
    )


@dataclass(frozen=True)
class Acting:
    """How a performance differs from the corpus's.

    Parameters
    ----------
    gain : float
        Factor on all weights.
    by_base : float
        Deviation of the logarithm of a factor on each base.
    mouthing, grammar : float
        How much of the mouth, and of brows, lids and cheeks, moves without an affect, beside what the corpus does.
    tonic : float
        Greatest weight of bases that are never at rest.
    seed : int
        Of what is drawn.
    """

    gain: float = 1.0
    by_base: float = 0.0
    mouthing: float = 0.0
    grammar: float = 0.0
    tonic: float = 0.0
    seed: int = 0

    def __call__(self, weights: np.ndarray, plan: Programme, time: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
        """(F, N) weights in [0, 1] from those of `signface.synth.performance.perform`."""
        rng = np.random.default_rng(self.seed)
        factors = _alike(np.exp(rng.normal(0.0, 1.0, len(names)) * self.by_base), names)
        acted = weights * factors
        mouth = np.array([name.startswith(("mouth", "jaw", "cheekPuff", "tongue")) for name in names])
        upper = np.array(
            [name.startswith(("brow", "eyeSquint", "eyeWide", "cheekSquint", "noseSneer")) for name in names]
        )
        if self.tonic:
            held = rng.random(len(names)) < 0.15
            acted = acted + _alike(held * rng.uniform(0.0, self.tonic, len(names)), names)
        for clause in plan.clauses:
            moment = clause.start_s
            while self.mouthing and moment < clause.end_s:
                length = rng.uniform(0.12, 0.45)
                shape = _some(mouth, rng, 4, names) * self.mouthing * rng.uniform(0.2, 1.0)
                acted = acted + pulse(time, moment, moment + length, length / 2, length / 2)[:, None] * shape
                moment += length * rng.uniform(0.5, 1.6)
            moment = clause.start_s + rng.uniform(-0.3, 0.6)
            while self.grammar and moment < clause.end_s:
                length = rng.uniform(0.4, 2.5)
                shape = _some(upper, rng, 3, names) * self.grammar * rng.uniform(0.2, 1.0)
                edge = min(rng.uniform(0.1, 0.5), length / 2)
                acted = acted + pulse(time, moment, moment + length, edge, edge)[:, None] * shape
                moment += length + rng.exponential(0.8)
        return saturate(self.gain * acted)


def _alike(values: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """Values by base, the right side's as the left's."""
    of = dict(zip(names, values, strict=True))
    return np.array([of.get(name.replace("Right", "Left"), of[name]) for name in names])


def _some(among: np.ndarray, rng: np.random.Generator, most: int, names: tuple[str, ...]) -> np.ndarray:
    """(N,) weights of a few of the bases, both sides alike."""
    chosen = rng.choice(np.flatnonzero(among), int(rng.integers(1, most + 1)), replace=False)
    weights = np.zeros(len(names))
    weights[chosen] = rng.uniform(0.2, 1.0, len(chosen))
    return np.maximum(_alike(weights, names), weights)


def draw_recorded(rng: np.random.Generator) -> Recorded:
    """A camera or a tracker, drawn from the ranges of devices."""
    if rng.random() < TRACKED:
        return Recorded(
            rate=float(np.exp(rng.uniform(np.log(25.0), np.log(60.0)))),
            jitter_mm=float(rng.uniform(0.0, 2.2)),
            wander_mm=float(rng.uniform(0.0, 1.5) if rng.random() < 0.6 else 0.0),
            wander_hz=float(np.exp(rng.uniform(np.log(0.5), np.log(6.0)))),
            absent=float(rng.uniform(0.0, 0.25) if rng.random() < 0.5 else 0.0),
        )
    return Recorded(
        rate=float(np.exp(rng.uniform(np.log(50.0), np.log(200.0)))),
        jitter_mm=float(rng.uniform(0.0, 1.0)),
        absent=float(rng.uniform(0.0, 0.25) if rng.random() < 0.5 else 0.0),
    )


def draw_acting(rng: np.random.Generator) -> Acting:
    """A way of acting that departs from the corpus's, now less, now more."""
    return Acting(
        gain=float(np.exp(rng.uniform(np.log(0.45), np.log(1.3)))),
        by_base=float(rng.uniform(0.0, 0.4)),
        mouthing=float(rng.uniform(0.0, 0.7) if rng.random() < 0.6 else 0.0),
        grammar=float(rng.uniform(0.0, 0.7) if rng.random() < 0.6 else 0.0),
        tonic=float(rng.uniform(0.0, 0.2) if rng.random() < 0.5 else 0.0),
        seed=int(rng.integers(2**31)),
    )


def draw_spread(rng: np.random.Generator) -> Spread:
    """How far faces stray from the prototypes in one take; up to twice as far as in the corpus."""
    wider = rng.uniform(1.0, 2.0)
    usual = Spread()
    return replace(
        usual,
        missing=usual.missing * wider,
        stray=min(0.8, usual.stray * wider),
        repetition=usual.repetition * wider,
    )


def varied_take(request: TakeRequest, copy: int) -> SyntheticTake:
    """A take of the corpus, acted and recorded otherwise.

    Parameters
    ----------
    request : TakeRequest
    copy : int
        Which of its variations, from 0. The same request and number give the same take.

    Returns
    -------
    SyntheticTake
        The signer is that of the request; the reference, and the time of the neutral frame, are of what was acted.
    """
    rng = request.stream(what=100 + copy)
    made = make_take(request, draw_spread(rng), change=draw_acting(rng))
    return replace(made, take=recorded_as(made.take, draw_recorded(rng), rng))
