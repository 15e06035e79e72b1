"""How much of a take's energies is jitter of its tracker, estimated from the take alone, without labels.

- `jitter`: the jitter of the weights, and the energies that it alone would have.
- `Jitter`: what it returns.
- `warn_of_jitter`: a warning where most of a take's energies is jitter.

A tracker's jitter is not seen beside motion in the energies themselves: both fill the two to five hertz that a sliding
window of 0.23 s lets through. It is seen higher up, where faces hardly move, and carried down from there.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from signface.content import Content
from signface.descriptors import Descriptors
from signface.errors import SignfaceWarning
from signface.segmentation.energy import Energies, energies, rates_of_change
from signface.takes.filtering import CUTOFF_HZ, HIGHEST_CUTOFF, lowpass_response

#: Taps of the filter that sees jitter, `(1 - z)^4 (1 + z)^2`: nothing passes that lies on a cubic curve, nor what
#: alternates from frame to frame, which the low-pass filter has taken away.
TAPS = np.array([1.0, -2.0, -1.0, 4.0, -1.0, -2.0, 1.0])
#: Where those taps let most through, as a part of the rate.
PEAK = 0.304
#: Where jitter is looked for, as a part of the cutoff. Higher up the filter leaves little, lower down faces move.
PLACE = 0.76
#: The taps for a take too slow for the filter: `(1 - z)^4`, which sees most at half the rate.
SLOW_TAPS = np.array([1.0, -4.0, 6.0, -4.0, 1.0])

#: Mean of the smaller half of the squares of normal numbers of unit deviation.
SMALLER_HALF = 0.14252
#: Fewer values than this of the filter say nothing.
LEAST_VALUES = 12
#: Length of the jitter that is drawn to find its energies (s).
DRAWN_S = 10.0
#: Deviations smaller than this part of the largest weight are rounding of the processor.
ROUNDING = 1e-9
#: A take is warned of when more than this share of its activity is jitter, and that is at least so much (1/s): the
#: least that a transition is made of, so that a still face is not warned of.
MOSTLY, LEAST_ACTIVITY = 0.5, 0.5

_KNOWN: WeakKeyDictionary[Descriptors, dict[tuple, Jitter]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class Jitter(Content):
    """The jitter of a take's weights, and its energies.

    Parameters
    ----------
    deviation : (N,) float64 array
        Standard deviation of the jitter of each weight, as it stands in the take: after the filter of the solve.
    velocities, accelerations : (N,) float64 arrays
        Standard deviations of the velocity and the acceleration of that jitter in each base (1/s, 1/s^2), through the
        same windows as those of the take's energies.
    velocity, acceleration : float
        Mean energies of that jitter alone (1/s, 1/s^2).
    activity : float
        Mean of its activity (1/s): the noise floor of the take's own activity.
    highest : float
        The highest activity in `DRAWN_S` seconds of that jitter, where so many deviations of each base do not count as
        `jitter` was told (1/s).
    share : float
        `activity` over the mean activity of the take: 0 without jitter, 1 where there is nothing else.
    """

    deviation: np.ndarray
    velocities: np.ndarray
    accelerations: np.ndarray
    velocity: float
    acceleration: float
    activity: float
    highest: float
    share: float

    def __str__(self) -> str:
        return f"jitter is {self.share:.0%} of the motion"

    @property
    def most(self) -> bool:
        """Whether most of the take's activity is jitter, and enough to be taken for motion."""
        return self.share > MOSTLY and self.activity > LEAST_ACTIVITY


def jitter(
    descriptors: Descriptors,
    *,
    factor: float = 3.0,
    window_s: float = 0.23,
    time_constant_s: float = 0.15,
    pulse_s: float = 0.3,
) -> Jitter:
    """The jitter of a take's weights, and the energies that it alone would have.

    Each weight goes through a filter that sees some three quarters of the cutoff of the solve (9 Hz for the usual
    12 Hz) and is blind to cubic curves. The scale of what is left comes from the smaller half of its squares, so that
    up to half of the time may be blinks and jolts; a mean, unlike a median, also tells steps of rounding from zero.
    Jitter is taken to be the same at all frequencies before the filter of the solve. Then jitter of that scale, with
    the correlations between the weights that it has in the take, is drawn and sent through filter and energies.

    Jitter that is slower than that (a tracker that wanders) is not told from motion and counts as such. What is
    smooth has none. In takes of less than about 25 Hz motion reaches the frequencies looked at, and some of it counts
    as jitter.

    Parameters
    ----------
    descriptors : Descriptors
        At least three frames. Where its settings are not known, weights count as filtered as usual.
    factor : float
        How many deviations of each base do not count in `highest`.
    window_s, time_constant_s, pulse_s : float
        See `signface.segmentation.energy.energies`.

    Returns
    -------
    Jitter
        All zero for a take too short to say anything (fewer than `LEAST_VALUES` windows of known frames).

    Raises
    ------
    SignfaceError
        There are fewer than three frames, or no frame has weights.

    Examples
    --------
    >>> import numpy as np
    >>> import signface as sf
    >>> rng = np.random.default_rng(1)
    >>> smile = 0.5 - 0.5 * np.cos(np.arange(600) / 50)
    >>> clean = sf.Descriptors(smile[:, None], ("mouthSmileLeft",), rate=25)
    >>> shaken = sf.Descriptors(clean.weights + rng.normal(0, 0.01, (600, 1)), clean.names, rate=25)
    >>> [round(float(jitter(take).deviation[0]), 3) for take in (clean, shaken)]
    [0.0, 0.01]
    """
    cutoff_hz, method = _filter_of(descriptors)
    key = (cutoff_hz, method, factor, window_s, time_constant_s, pulse_s)
    known = _KNOWN.setdefault(descriptors, {})
    if key not in known:
        own = energies(descriptors, window_s=window_s, time_constant_s=time_constant_s, pulse_s=pulse_s)
        drawn, deviation = _drawn(descriptors, cutoff_hz, method)
        _, changes = rates_of_change(drawn, window_s=window_s, pulse_s=pulse_s)
        velocities, accelerations = changes
        alone = _energies(velocities, accelerations, 0.0, time_constant_s)
        activity, motion = float(alone.activity.mean()), float(own.activity.mean())
        known[key] = Jitter(
            deviation=deviation,
            velocities=velocities.std(axis=0),
            accelerations=accelerations.std(axis=0),
            velocity=float(alone.velocity.mean()),
            acceleration=float(alone.acceleration.mean()),
            activity=activity,
            highest=float(_energies(velocities, accelerations, factor, time_constant_s).activity.max()),
            share=min(1.0, activity / motion) if motion > 0 else 0.0,
        )
    return known[key]


def warn_of_jitter(descriptors: Descriptors, found: Jitter | None = None) -> None:
    """Warn (`SignfaceWarning`) where most of a take's energies is jitter of its tracker.

    Parameters
    ----------
    descriptors : Descriptors
    found : Jitter, optional
        What `jitter` found in it, where that is known.

    Raises
    ------
    SignfaceError
        No frame has weights.

    Examples
    --------
    >>> import signface as sf
    >>> warn_of_jitter(sf.datasets.mini_weights())  # markers do not jitter much
    """
    if descriptors.n_frames < 3:
        return
    found = jitter(descriptors) if found is None else found
    if found.most:
        warnings.warn(
            f"{descriptors.name}: {found.share:.0%} of the motion is jitter of the tracker: boundaries of segments are "
            "doubtful (--cutoff 6 takes some of it away)",
            SignfaceWarning,
            stacklevel=2,
        )


def _drawn(descriptors: Descriptors, cutoff_hz: float, method: str) -> tuple[Descriptors, np.ndarray]:
    """`DRAWN_S` seconds of jitter like the take's, and the (N,) deviations of it; none where the take says nothing."""
    rate, names = descriptors.rate, descriptors.names
    frames = max(3, int(np.ceil(DRAWN_S * rate)))
    seen = _seen(descriptors.weights, taps := _taps(rate, cutoff_hz))
    if len(seen) < LEAST_VALUES:
        return Descriptors(np.zeros((frames, len(names))), names, rate), np.zeros(len(names))
    gain = lowpass_response(np.fft.rfftfreq(frames, 1 / rate), rate, cutoff_hz=cutoff_hz, method=method)
    passed = np.abs(np.fft.rfft(taps, frames)) * gain
    found = _deviation(seen)
    found[found < ROUNDING * np.nanmax(np.abs(descriptors.weights))] = 0.0
    scale = found / np.sqrt(_mean_square(passed, frames))  # of the jitter before the filter
    white = np.random.default_rng(0).normal(size=(frames, len(names))) @ _root(_correlation(seen)) * scale
    weights = np.fft.irfft(np.fft.rfft(white, axis=0) * gain[:, None], frames, axis=0)
    return Descriptors(weights, names, rate), scale * np.sqrt(_mean_square(gain, frames))


def _energies(velocities: np.ndarray, accelerations: np.ndarray, factor: float, time_constant_s: float) -> Energies:
    """Energies of (K, N) rates of change, of which so many deviations of each base do not count."""
    speed, change = (
        np.maximum(np.abs(rates) - factor * rates.std(axis=0), 0.0).sum(axis=1) for rates in (velocities, accelerations)
    )
    return Energies(np.arange(len(speed)), speed, change, time_constant_s)


def _filter_of(descriptors: Descriptors) -> tuple[float, str]:
    """Cutoff (Hz) and kind of the filter that the weights went through; none has an infinite cutoff."""
    settings = descriptors.settings
    if settings is None:
        return CUTOFF_HZ, "butterworth"
    if settings.read_as == "aus":  # nothing was solved, and nothing filtered
        return float("inf"), settings.filter_method
    return CUTOFF_HZ if settings.cutoff_hz is None else settings.cutoff_hz, settings.filter_method


def _taps(rate: float, cutoff_hz: float) -> np.ndarray:
    """The filter that sees jitter, spread over so many frames that it looks at the same frequencies at any rate."""
    wide = max(1, round(PEAK * rate / (PLACE * min(cutoff_hz, CUTOFF_HZ))))
    unfiltered = cutoff_hz > HIGHEST_CUTOFF * rate
    return np.repeat(SLOW_TAPS if unfiltered and wide == 1 else TAPS, wide) / wide


def _seen(weights: np.ndarray, taps: np.ndarray) -> np.ndarray:
    """(K, N) what the taps see of the weights, where all frames below them are known."""
    if len(weights) < len(taps):
        return np.empty((0, weights.shape[1]))
    known = np.isfinite(weights).all(axis=1)
    whole = np.convolve(known, np.ones(len(taps)), mode="valid") > len(taps) - 0.5
    filled = np.where(known[:, None], weights, 0.0)
    seen = np.stack([np.convolve(column, taps, mode="valid") for column in filled.T], axis=1)
    return seen[whole]


def _mean_square(response: np.ndarray, frames: int) -> float:
    """Variance of white noise of unit variance after a filter whose gains at 0 to half the rate are given."""
    square = response**2
    twice = 2 * square.sum() - square[0] - (square[-1] if frames % 2 == 0 else 0.0)
    return float(twice / frames)


def _deviation(seen: np.ndarray) -> np.ndarray:
    """(N,) standard deviation, from the smaller half of the squares."""
    square = np.sort(seen**2, axis=0)[: (len(seen) + 1) // 2]
    return np.sqrt(square.mean(axis=0) / SMALLER_HALF)


def _correlation(seen: np.ndarray) -> np.ndarray:
    """(N, N) correlations of what is usual: what is further out than twice the deviation is drawn in to that."""
    deviation = _deviation(seen)
    usual = np.clip(seen / np.where(deviation > 0, deviation, 1.0), -2.0, 2.0)
    usual[:, deviation == 0] = 0.0
    square = usual.T @ usual
    size = np.sqrt(np.diag(square))
    size[size == 0] = 1.0
    correlation = square / np.outer(size, size)
    np.fill_diagonal(correlation, 1.0)
    return correlation


def _root(correlation: np.ndarray) -> np.ndarray:
    """The symmetric root of a correlation matrix."""
    values, vectors = np.linalg.eigh(correlation)
    return (vectors * np.sqrt(values.clip(min=0.0))) @ vectors.T
