"""Calibrating a signer: the bases as this face shows them where its markers stand.

- `calibrate`: from a range-of-motion take whose weights are known (the signer shows one base after the other, and
  somebody says how strongly), the displacements that each base gives this signer's markers.

It is example-based facial rigging (Li, Weise and Pauly 2010) at the markers: the avatar's bases are the prior, and
examples change them as far as they show them.
"""

from __future__ import annotations

import numpy as np

from signface.errors import SignfaceError

#: What the avatar's bases count beside the examples: as much as showing each base with this mean square weight. A base
#: that fills a fiftieth of the take has 0.007.
PRIOR = 5e-4
#: Markers creep. What changes more slowly than this (s) is taken as creep, not as expression.
CREEP_S = 6.0


def calibrate(
    displacements: np.ndarray, weights: np.ndarray, bases: np.ndarray, *, rate: float, prior: float = PRIOR
) -> np.ndarray:
    """Bases of a signer at the markers.

    Minimises `mean |m - A c - slow|^2 + prior |A - A0|^2`, with `slow` a slow drift of each marker.

    Parameters
    ----------
    displacements : (F, P, 3) array
        Of a take in which bases are shown by themselves, as `signface.solver.solving.prepare_take` gives them.
    weights : (F, N) array
        The weights shown.
    bases : (N, P, 3) array
        The avatar's bases at the markers: `layout.bases(face)`.
    rate : float
        Frames per second.
    prior : float
        How much the avatar's bases count.

    Returns
    -------
    (N, P, 3) array
        To be given to `ThinShellSolver` as `signer_bases`.

    Raises
    ------
    SignfaceError
        The shapes do not correspond, or too few frames show all markers.
    """
    displacements, weights = np.asarray(displacements, dtype=np.float64), np.asarray(weights, dtype=np.float64)
    bases = np.asarray(bases, dtype=np.float64)
    frames, count = weights.shape
    if displacements.shape != (frames, *bases.shape[1:]) or count != len(bases):
        raise SignfaceError(
            f"{displacements.shape} displacements, {weights.shape} weights and {bases.shape} bases do not correspond"
        )
    if not (np.isfinite(rate) and rate > 0 and np.isfinite(prior) and prior > 0):
        raise SignfaceError("the rate and the prior of a calibration must be positive")
    waves = int(2.0 * frames / rate / CREEP_S)
    phase = np.pi * (np.arange(frames) + 0.5) / frames
    slow = np.cos(phase[:, None] * np.arange(waves + 1))
    seen = np.isfinite(displacements).all(axis=(1, 2)) & np.isfinite(weights).all(axis=1)
    if seen.sum() < 2 * slow.shape[1] or seen.sum() < 10:
        raise SignfaceError(
            f"only {seen.sum()} frames of the calibration take show all markers", hint="record a longer one"
        )
    marked, weights, slow = displacements[seen].reshape(seen.sum(), -1), weights[seen], slow[seen]
    projection = np.linalg.pinv(slow)
    marked, weights = (values - slow @ (projection @ values) for values in (marked, weights))
    known = bases.reshape(count, -1)
    normal = weights.T @ weights / len(weights) + prior * np.eye(count)
    solved = np.linalg.solve(normal, weights.T @ marked / len(weights) + prior * known)
    return solved.reshape(bases.shape)
