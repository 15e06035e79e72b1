"""What holds the weights in their range and at rest, apart from the shell.

**Bounds.** Eq. 5.24 (Reverdy 2019) sums `exp((lower - c) / s) + exp((c - upper) / s)` over the weights, with `s = 0.1`,
`lower = -0.1` and `upper = 1.1`. Used as printed, its slope is not zero where nothing is wrong: at c = 0 it is -3.7, so
that a neutral face is pushed off rest, and a weight that the markers do not determine drifts to 0.5. We therefore take
the tangent at 0 off the lower exponential and the tangent at 1 off the upper one, and let each act beyond its point
only:

    lower(c) = exp((lower - c) / s) - exp(lower / s) * (1 - c / s)               for c < 0, else 0
    upper(c) = exp((c - upper) / s) - exp((1 - upper) / s) * (1 + (c - 1) / s)   for c > 1, else 0

This is convex, has a continuous slope, rises as the printed energy does, and is exactly zero from 0 to 1: no weight in
its range is biased.

**Rest.** A face at any moment uses few of its bases. `rest(c)` is 0 for c <= 0 and rises as `c` beyond a short parabola
(up to `KNEE`), so that its slope is continuous and zero at rest. Multiplied by a small `sparsity`, it decides between
explanations that the markers hardly tell apart in favour of the one with fewer, weaker bases.

**Release.** The same pull that decides which bases act also makes those that do weaker than they are. Once the first
solve has said which are clearly active, it has done its work, and a second solve lets them go (`released`), as the
relaxed lasso does (N. Meinshausen, Computational Statistics & Data Analysis 52, 2007). Each solve is convex.
"""

from __future__ import annotations

import numpy as np

#: The smoothing and the bounds of eq. 5.24.
SMOOTHING = 0.1
LOWER = -0.1
UPPER = 1.1

#: `exp(LOWER / s)` and `exp((1 - UPPER) / s)`, equal because the range is symmetric about 0.5.
AT_REST = float(np.exp(LOWER / SMOOTHING))

#: Where the rest energy turns from a parabola into a straight line.
KNEE = 0.02

#: Weights of the first solve between which the rest energy lets go of a base: not at all, altogether.
RELEASE = (0.1, 0.4)


def _outside(weights: np.ndarray) -> np.ndarray:
    """How far each weight lies beyond 0 or 1: negative below 0, positive above 1, else 0."""
    return weights - np.clip(weights, 0.0, 1.0)


def holding_energy(weights: np.ndarray, sparsity: float) -> np.ndarray:
    """Bound energy and `sparsity` times rest energy of each weight, the shape of `weights`."""
    x = np.abs(_outside(weights)) / SMOOTHING
    inside = np.clip(weights, 0.0, KNEE)
    rest = np.where(weights > KNEE, weights - KNEE / 2, inside**2 / (2 * KNEE))
    return AT_REST * (np.expm1(x) - x) + sparsity * rest


def holding_slope(weights: np.ndarray, sparsity: float) -> np.ndarray:
    """First derivative of `holding_energy`."""
    beyond = _outside(weights)
    bounds = np.sign(beyond) * (AT_REST / SMOOTHING) * np.expm1(np.abs(beyond) / SMOOTHING)
    return bounds + sparsity * np.clip(weights / KNEE, 0.0, 1.0)


def holding_curvature(weights: np.ndarray, sparsity: float) -> np.ndarray:
    """Second derivative of `holding_energy`; at its jumps, the value from within the range."""
    beyond = _outside(weights)
    bounds = np.where(beyond == 0.0, 0.0, (AT_REST / SMOOTHING**2) * np.exp(np.abs(beyond) / SMOOTHING))
    return bounds + np.where((weights >= 0.0) & (weights < KNEE), sparsity / KNEE, 0.0)


def released(weights: np.ndarray) -> np.ndarray:
    """Share of the rest energy's pull that the second solve leaves out, 0 to 1, by the weights of the first."""
    return np.clip((weights - RELEASE[0]) / (RELEASE[1] - RELEASE[0]), 0.0, 1.0)
