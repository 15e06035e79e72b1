"""Energy curves of a take: how fast its blendshape weights move.

- `energies`: the two curves of the thesis (eq. 4.4 and 4.5) and their combination.
- `rates_of_change`: what they add up, base by base.
- `Energies`: what it returns.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from scipy.ndimage import correlate1d, median_filter

from signface.content import Content
from signface.descriptors import Descriptors
from signface.errors import SignfaceError

#: Rate below which weights are first interpolated, so that a slow recording is differentiated like a fast one (Hz).
FINE_RATE = 100.0

#: Curves of takes that are still in use: segmentation, ELAN's curves and the figure all want them. Descriptors do not
#: change.
_KNOWN: WeakKeyDictionary[Descriptors, dict[tuple[float, float, float, bytes], Energies]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class Energies(Content):
    """Energy curves of a take.

    Parameters
    ----------
    time : (K,) float64 array
        Times in seconds: those of the frames, with evenly spaced ones between them when the take is slower than
        `FINE_RATE`.
    velocity : (K,) float64 array
        Sum over the bases of the absolute velocity of the weights (1/s).
    acceleration : (K,) float64 array
        Sum over the bases of the absolute acceleration of the weights (1/s^2).
    time_constant_s : float
        The time that makes the acceleration comparable with the velocity, in seconds.
    """

    time: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    time_constant_s: float

    @property
    def combined(self) -> np.ndarray:
        """(K,) `velocity**2 + (time_constant_s * acceleration)**2` (1/s^2)."""
        return self.velocity**2 + (self.time_constant_s * self.acceleration) ** 2

    @property
    def activity(self) -> np.ndarray:
        """(K,) square root of `combined` (1/s): the same peaks, on a scale that is linear in the weights."""
        return np.sqrt(self.combined)


def energies(
    descriptors: Descriptors,
    *,
    window_s: float = 0.23,
    time_constant_s: float = 0.15,
    pulse_s: float = 0.3,
    spared: tuple[np.ndarray, np.ndarray] | None = None,
) -> Energies:
    """Velocity and acceleration energies of the weights of a take (thesis 4.4.2, eq. 4.4 and 4.5).

    The derivatives are those of a parabola fitted to the weights in a sliding window (Savitzky-Golay). The window is
    given in seconds, so that the same motion has the same energies at any rate. The take is continued at its
    ends by its mirror image: the parabola of half a window would fit a slope to the noise there. A movement that the
    recording cuts off shows at the very end as an acceleration.

    The thesis adds `E_vel^2 + E_acc^2` although one is in 1/s and the other in 1/s^2, so that the acceleration
    drowns the velocity, and the more so the shorter the unit of time. Here the acceleration is multiplied by a time
    constant. For a weight that moves along a raised cosine lasting T the two peaks are equal when the constant is
    `T / pi`, and velocity and acceleration then take turns, so that a whole transition makes one hump instead of two
    or three. 0.15 s belongs to transitions of about half a second. A constant time, rather than a level of each take,
    leaves the curve of a moment independent of the rest of its take.

    Blinks and mouthed syllables are faster than any change of expression, and their acceleration would be all that
    the curves show. What is back where it began within `pulse_s` is therefore taken out first, by a running median
    of each base, which leaves a movement that stays untouched.

    Parameters
    ----------
    descriptors : Descriptors
        At least three frames. Frames without weights (NaN) are bridged in a straight line, per base.
    window_s : float
        Width of the sliding window in seconds. A take shorter than it is differentiated with a shorter one.
    time_constant_s : float
        See above, in seconds.
    pulse_s : float
        The longest movement and return that is taken out, in seconds; 0 leaves everything.
    spared : (N,) and (N,) arrays, optional
        Velocities (1/s) and accelerations (1/s^2) of each base that do not count: only what is beyond them is added.

    Returns
    -------
    Energies
        K is the number of frames, or more when the rate is below `FINE_RATE`.

    Raises
    ------
    SignfaceError
        There are fewer than three frames, or no frame has weights.

    Examples
    --------
    >>> import numpy as np
    >>> import signface as sf
    >>> ramp = np.linspace(0, 1, 101)[:, None]  # one base rising by 1 in a second
    >>> curves = sf.energies(sf.Descriptors(ramp, ("jawOpen",), rate=100))
    >>> round(float(curves.velocity[50]), 6), round(float(curves.acceleration[50]), 6)
    (1.0, 0.0)
    """
    if descriptors.n_frames < 3:
        raise SignfaceError(
            f"{descriptors.name}: {descriptors.n_frames} frames are too few for an energy curve",
            hint="a rate of change needs three frames",
        )
    if window_s <= 0 or time_constant_s <= 0 or pulse_s < 0:
        raise SignfaceError("the window and the time constant of the energies must be positive seconds")
    without = b"" if spared is None else np.concatenate(spared).tobytes()
    known, key = _KNOWN.setdefault(descriptors, {}), (window_s, time_constant_s, pulse_s, without)
    if key in known:
        return known[key]
    time, changes = rates_of_change(descriptors, window_s=window_s, pulse_s=pulse_s)
    sizes = (np.abs(change) for change in changes)
    if spared is not None:
        sizes = (np.maximum(size - least, 0.0) for size, least in zip(sizes, spared, strict=True))
    speed, change = (size.sum(axis=1) for size in sizes)
    curves = Energies(time=time, velocity=speed, acceleration=change, time_constant_s=time_constant_s)
    known[key] = curves
    return curves


def rates_of_change(
    descriptors: Descriptors, *, window_s: float, pulse_s: float
) -> tuple[np.ndarray, Iterator[np.ndarray]]:
    """(K,) times, and then the (K, N) velocities (1/s) and accelerations (1/s^2) of the weights; see `energies`.

    One after the other: of a long take both at once would be many.
    """
    weights = bridged(descriptors)
    factor = max(1, int(np.ceil(FINE_RATE / descriptors.rate)))
    time, weights = _refined(descriptors.time, weights, factor)
    rate = descriptors.rate * factor
    weights = _without_pulses(weights, pulse_s, rate)
    window = _window_frames(window_s, rate, len(time))
    kernels = (_derivative(window, rate, order) for order in (1, 2))
    return time, (correlate1d(weights, kernel, axis=0, mode="mirror") for kernel in kernels)


def bridged(descriptors: Descriptors) -> np.ndarray:
    """(F, N) weights in which frames without weights lie on the straight line between their neighbours.

    At the ends of the take the nearest known weights are held.

    Raises
    ------
    SignfaceError
        No frame has weights.
    """
    known = np.isfinite(descriptors.weights).all(axis=1)
    if not known.any():
        raise SignfaceError(
            f"{descriptors.name}: no frame has weights", hint="look at the markers of the take: signface take info"
        )
    if known.all():
        return descriptors.weights
    frames = np.arange(descriptors.n_frames)
    columns = [np.interp(frames, frames[known], column[known]) for column in descriptors.weights.T]
    return np.column_stack(columns)


def _refined(time: np.ndarray, weights: np.ndarray, factor: int) -> tuple[np.ndarray, np.ndarray]:
    """Times and weights with `factor - 1` frames put between each two, on a cubic spline."""
    if factor == 1:
        return time, weights
    from scipy.interpolate import make_interp_spline

    fine = np.linspace(time[0], time[-1], factor * (len(time) - 1) + 1)
    return fine, make_interp_spline(time, weights, k=min(3, len(time) - 1), axis=0)(fine)


def _without_pulses(weights: np.ndarray, pulse_s: float, rate: float) -> np.ndarray:
    """Weights without movements that are back where they began within `pulse_s`: a running median of twice that."""
    half = round(pulse_s * rate)
    if not half:
        return weights
    if len(weights) <= half + 1:
        return median_filter(weights, size=(2 * half + 1, 1), mode="mirror")
    # Base by base: the filter for one dimension is ten times as fast, and right where the take is longer than a half.
    columns = [median_filter(np.ascontiguousarray(base), size=2 * half + 1, mode="mirror") for base in weights.T]
    return np.stack(columns, axis=1)


def _derivative(window: int, rate: float, order: int) -> np.ndarray:
    """(window,) shares of the frames of a window in the derivative of their parabola (Savitzky and Golay 1964)."""
    away = np.arange(window) - window // 2
    square, fourth = int((away**2).sum()), int((away**4).sum())
    if order == 1:
        return rate * away / square
    return 2 * rate**2 * (window * away**2 - square) / (window * fourth - square**2)


def _window_frames(window_s: float, rate: float, frames: int) -> int:
    """The odd number of frames, at least 3, whose window is closest to `window_s` in its second moment.

    N frames spread like a continuous window of `sqrt(N^2 - 1) / rate` seconds, not of `N / rate`.
    """
    ideal = np.sqrt(1 + (window_s * rate) ** 2)
    window = max(3, 2 * round((ideal - 1) / 2) + 1)
    return min(window, frames if frames % 2 else frames - 1)
