"""The bound energy: what keeps weights between 0 and 1.

Eq. 5.24 of seed 001 sums `exp((lower - c) / s) + exp((c - upper) / s)` over the weights, with `s = 0.1`, `lower = -0.1`
and `upper = 1.1`. Used as printed, its slope is not zero where nothing is wrong: at c = 0 it is -3.7, so a neutral face
would be pushed off rest, and a weight that the markers do not determine would drift to 0.5. We therefore take the
tangent at 0 off the lower exponential and the tangent at 1 off the upper one, and let each act beyond its point only:

    lower(c) = exp((lower - c) / s) - exp(lower / s) * (1 - c / s)               for c < 0, else 0
    upper(c) = exp((c - upper) / s) - exp((1 - upper) / s) * (1 + (c - 1) / s)   for c > 1, else 0

It is convex, has a continuous slope, rises as the printed one does, and is exactly zero from 0 to 1: no weight within
its range is biased, and a neutral face has weights of exactly zero.
"""

from __future__ import annotations

import numpy as np

#: The smoothing and the bounds of eq. 5.24.
SMOOTHING = 0.1
LOWER = -0.1
UPPER = 1.1

#: `exp(LOWER / s)` and `exp((1 - UPPER) / s)`, equal because the range is symmetric about 0.5.
AT_REST = float(np.exp(LOWER / SMOOTHING))


def outside(weights: np.ndarray) -> np.ndarray:
    """How far each weight lies beyond 0 or 1: negative below 0, positive above 1, else 0."""
    return weights - np.clip(weights, 0.0, 1.0)


def bound_energy(weights: np.ndarray) -> np.ndarray:
    """Energy of each weight, the shape of `weights`."""
    x = np.abs(outside(weights)) / SMOOTHING
    return AT_REST * (np.expm1(x) - x)


def bound_slope(weights: np.ndarray) -> np.ndarray:
    """First derivative of `bound_energy`."""
    beyond = outside(weights)
    return np.sign(beyond) * (AT_REST / SMOOTHING) * np.expm1(np.abs(beyond) / SMOOTHING)


def bound_curvature(weights: np.ndarray) -> np.ndarray:
    """Second derivative of `bound_energy`; 0 within the range, and at 0 and 1 themselves."""
    beyond = outside(weights)
    return np.where(beyond == 0.0, 0.0, (AT_REST / SMOOTHING**2) * np.exp(np.abs(beyond) / SMOOTHING))
