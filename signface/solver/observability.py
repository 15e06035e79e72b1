"""Which bases the markers cannot see: their weights are 0, or nearly, whatever the face does.

A layout without markers on the lids cannot tell that eyes close. The solver then gives `eyeBlinkLeft` the weight 0,
which reads as an open eye and means that nobody knows.

A base is **unobserved** where either holds:

- it moves the markers less than jitter and misfit do: by less than a fifth of what the median base does, root mean
  square (`signface.solver.base.OBSERVED_SHARE`). Solvers leave it at 0 altogether.
- shown alone and fully, without any noise, it is given less than half (`LET_THROUGH`): the regularisation takes it for
  others. A lowered eye drags the upper lid a little, as a weak blink does; both explain the markers on the lids, and
  the solver takes the blink.

Both compare like with like, so that neither depends on the unit of length.
"""

from __future__ import annotations

import numpy as np

from signface.solver.base import MarkerBases, Solver

#: A base that is given less than this when it alone is fully active is explained by others, or by rest.
LET_THROUGH = 0.5


def unobserved_bases(solver: Solver) -> tuple[str, ...]:
    """Names of the bases whose weights say nothing, in the face's order.

    Parameters
    ----------
    solver : Solver
        Made for a face and the layout of a take; its options (`alpha`, `sparsity`, ...) have a say. Of measures, which
        are no bases, there are none.

    See Also
    --------
    signface.columns.joined_sides : the names in few words.

    Examples
    --------
    >>> import signface as sf
    >>> from signface.solver.thin_shell import ThinShellSolver
    >>> face = sf.read_face()
    >>> layout = sf.read_layout("default-40", face)
    >>> lids = [label for label in layout.face_labels if "LID" in label.upper()]
    >>> blind = layout.restricted([label for label in layout.labels if label not in lids])
    >>> "eyeBlinkLeft" in unobserved_bases(ThinShellSolver(face, layout))
    False
    >>> "eyeBlinkLeft" in unobserved_bases(ThinShellSolver(face, blind))
    True
    """
    markers = getattr(solver, "markers", None)
    if not isinstance(markers, MarkerBases):
        return ()
    alone = markers.matrix.T.reshape(len(markers.names), markers.n_markers, 3)
    given = np.diag(solver.solve(alone).weights)
    seen = markers.observed & (given >= LET_THROUGH)
    return tuple(name for name, here in zip(markers.names, seen, strict=True) if not here)
