"""How far each solved weight can be trusted.

Three things make a weight wrong: the markers jitter; the avatar does not show what the signer does, which the frame's
residual tells the size of; and the signer's bases are stronger or weaker than the avatar's. The first two reach a
weight through the curvature of the energy (`ThinShellSolver.uncertainty`): much where the markers hardly determine it.
The third is a share of the weight itself.
"""

from __future__ import annotations

import numpy as np

from signface.solver.base import Solution
from signface.solver.thin_shell import ThinShellSolver

#: Standard deviation of a marker's coordinate that is there even where the residual is nothing (mm).
JITTER_MM = 0.15
#: By how much a signer's bases are stronger or weaker than the avatar's, beyond what the metric of the errors can tell.
MISFIT = 0.1


def deviations(solver: ThinShellSolver, solution: Solution) -> np.ndarray:
    """Standard deviation of each weight of a solution, on a face in millimetres.

    On synthetic signers, 91 % of the errors of weights above 0.05 lie within twice of it (`docs/solver.md`).

    Parameters
    ----------
    solver : ThinShellSolver
    solution : Solution
        What the solver made of some frames.

    Returns
    -------
    (F, N) array
        NaN for the bases that the markers do not observe, and in frames that could not be solved.
    """
    solved = np.isfinite(solution.weights).all(axis=1)
    result = np.full(solution.weights.shape, np.nan)
    weights = solution.weights[solved]
    error = np.sqrt(JITTER_MM**2 + solution.residual[solved] ** 2)
    result[solved] = np.hypot(solver.uncertainty(weights, error), MISFIT * weights)
    return result
