"""The mappings from markers to weights, by name."""

from __future__ import annotations

import difflib

import numpy as np

from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.settings.solve import METHODS
from signface.solver.base import Solver
from signface.solver.measures import FaceMeasures
from signface.solver.rivals.direct import ThinShellDeformation
from signface.solver.rivals.linear import Bounded, LeastSquares, NonNegative
from signface.solver.thin_shell import ThinShellSolver


def make_solver(
    method: str,
    face: FaceModel,
    layout: MarkerLayout,
    *,
    signer_bases: np.ndarray | None = None,
    **options: float | None,
) -> Solver:
    """A solver by name.

    Parameters
    ----------
    method : str
        A key of `METHODS`.
    face : FaceModel
    layout : MarkerLayout
    signer_bases : (N, P, 3) array, optional
        The signer's bases at the markers; only for `thin-shell`.
    **options
        `alpha`, `sparsity`, `head_slack`, `slip`: see `ThinShellSolver`; only for `thin-shell`. None is its default.

    Raises
    ------
    SignfaceError
        There is no such method, or it has no such option.
    """
    given = {name: value for name, value in options.items() if value is not None}
    if method == "thin-shell":
        return ThinShellSolver(face, layout, signer_bases=signer_bases, **given)  # type: ignore[arg-type]
    if method not in METHODS:
        close = difflib.get_close_matches(method, METHODS, n=1)
        raise SignfaceError(
            f"no method is called {method!r}",
            hint=f"did you mean {close[0]}" if close else f"the methods are {', '.join(METHODS)}",
        )
    if given:
        name = next(iter(given))
        raise SignfaceError(
            f"the method {method} has no {name}", hint=f"leave --{name.replace('_', '-')} out, or use thin-shell"
        )
    if signer_bases is not None:
        raise SignfaceError(f"the method {method} cannot use a signer's bases", hint="use thin-shell")
    rivals = {"least-squares": LeastSquares, "nnls": NonNegative, "bounded": Bounded}
    if method in rivals:
        return rivals[method](face, layout)
    if method == "measures":
        return FaceMeasures(face, layout)
    if method == "direct-shell":
        return ThinShellDeformation(face, layout)
    from signface.solver.rivals import regression

    learnt = {
        "rbf-network": regression.RbfNetwork,
        "gaussian-process": regression.GaussianProcessSolve,
        "sparse-online-gp": regression.SparseGaussianProcessSolve,
    }
    return learnt[method](face, layout)
