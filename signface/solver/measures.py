"""Few numbers in place of weights: how high the brows are, how wide eyes and mouth, in millimetres of the avatar.

- `FaceMeasures`: a dozen measures of a face, most of them from the markers nearest to where they are taken.
- `with_upright_brows`: brows as they would stand with the head upright.

Blendshapes read a face as expressions that an avatar can make; fifty of them from a tracker's noisy landmarks are more
than a classifier of few signers can use. What linguists measure by hand is often enough for it, but for the brows:
their distance from the eyes leaks the head's pitch, and what the whole face says of them, solved to weights, leaks it
less. The two sides of a face are taken together, so that a turn of the head that a tracker takes for a crooked face
cancels out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.head import head_angles
from signface.solver.base import Solution
from signface.solver.thin_shell import ThinShellSolver

#: Where measures are taken: on the signer's left and in the middle of the default face, seen from the front (x, y), mm.
PLACES = {
    "brow inner": (10, 49.5),
    "brow middle": (25, 52),
    "brow outer": (44, 46),
    "upper lid": (29, 43),
    "lower lid": (29, 32),
    "mouth corner": (22, -29),
    "upper lip": (0, -20),
    "lower lip": (0, -40),
    "upper lip inside": (0, -27.8),
    "lower lip inside": (0, -28.8),
    "chin": (0, -64),
}
#: A marker may stand so far from its place, mm.
FARTHEST_MM = 9.0

#: Each measure: sums of the ups (1) and of the aparts (0) of places, with what they count.
MEASURES: dict[str, tuple[int, dict[str, float]]] = {
    "browInnerHeight": (1, {"brow inner": 1.0}),
    "browHeight": (1, {"brow inner": 1 / 3, "brow middle": 1 / 3, "brow outer": 1 / 3}),
    "browOuterHeight": (1, {"brow outer": 1.0}),
    "browApart": (0, {"brow inner": 1.0}),
    "lidOpening": (1, {"upper lid": 1.0, "lower lid": -1.0}),
    "mouthWidth": (0, {"mouth corner": 1.0}),
    "mouthHeight": (1, {"upper lip": 1.0, "lower lip": -1.0}),
    "mouthOpening": (1, {"upper lip inside": 1.0, "lower lip inside": -1.0}),
    "upperLipHeight": (1, {"upper lip": 1.0}),
    "cornerHeight": (1, {"mouth corner": 1.0, "upper lip": -1.0}),
    "jawDrop": (1, {"chin": -1.0}),
}

#: The measure that is made of weights: the mean of the first less that of the second, no millimetres.
BROWS_RAISED = "browsRaised"
RAISED = ("browInnerUp", "browOuterUpLeft", "browOuterUpRight")
LOWERED = ("browDownLeft", "browDownRight")
#: How much these weights sink by degree of pitch where nothing is expressed, as the rule of the channel has it
#: (`[brows.raised.signer]` of models/channels/default.toml). One number for all: one fitted for each signer takes the
#: raises of those away who lean forward as they ask.
PER_PITCH_DEG = 0.0075


class FaceMeasures:
    """Named measures from displacements of markers; a `signface.solver.base.Solver` without bases.

    Parameters
    ----------
    face : FaceModel
        In the place and size of the default face.
    layout : MarkerLayout
        Measures whose places have no marker near them are left out, and `browsRaised` where the face has not its
        bases or the markers do not observe one.

    Attributes
    ----------
    names : tuple of str
        Of `MEASURES`, and `browsRaised`: weights of `ThinShellSolver`, inner and outer brows up less brows
        down (`solve` gives back what the head's pitch takes from it: `with_upright_brows`).

    Raises
    ------
    SignfaceError
        The layout has no marker near any of the places.

    Examples
    --------
    >>> import signface as sf
    >>> face = sf.read_face()
    >>> FaceMeasures(face, sf.read_layout("openface", face)).names[:4]
    ('browInnerHeight', 'browHeight', 'browOuterHeight', 'browApart')
    """

    def __init__(self, face: FaceModel, layout: MarkerLayout) -> None:
        labels = layout.face_labels
        points = layout.points(face, labels)
        front = np.flatnonzero(points[:, 2] > 0)
        rows: list[np.ndarray] = []
        names = []
        for name, (axis, terms) in MEASURES.items():
            row = np.zeros((len(labels), 3))
            found = True
            for place, share in terms.items():
                x, y = PLACES[place]
                sides = (1, -1) if x else (1,)
                for side in sides:
                    distance = np.hypot(points[front, 0] - side * x, points[front, 1] - y)
                    if not len(front) or distance.min() > FARTHEST_MM:
                        found = False
                        continue
                    nearest = front[int(np.argmin(distance))]
                    row[nearest, axis] += share / len(sides) * (side if axis == 0 else 1)
            if found:
                names.append(name)
                rows.append(row.ravel())
        if not names:
            raise SignfaceError(
                f"the layout {layout.name} has no marker where the face is measured", hint="use another method"
            )
        self._mix = np.array(rows)
        self._solver = _brow_solver(face, layout)
        self.names = tuple(names) if self._solver is None else (*names, BROWS_RAISED)

    def solve(self, displacements: np.ndarray) -> Solution:
        """Measures of each frame in millimetres (`browsRaised` in weights), 0 at rest; NaN where a marker is missing.

        Parameters
        ----------
        displacements : (F, P, 3) array
            As for any solver.
        """
        flat = displacements.reshape(len(displacements), -1)
        measures = np.nan_to_num(flat) @ self._mix.T
        measures[(~np.isfinite(flat)).astype(float) @ (self._mix != 0).T.astype(float) > 0] = np.nan
        if self._solver is not None:
            solved = self._solver.solve(displacements).weights
            up, down = (
                solved[:, [self._solver.names.index(n) for n in some]].mean(axis=1) for some in (RAISED, LOWERED)
            )
            measures = np.column_stack([measures, up - down])
        return Solution(measures, np.full(len(measures), np.nan))


def with_upright_brows(measured: Descriptors) -> Descriptors:
    """Measures with what the head's pitch takes from `browsRaised` given back; others, and still heads, as they are.

    Parameters
    ----------
    measured : Descriptors
        Any; the pitch is that of its `head`.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.spatial.transform import Rotation
    >>> from signface.descriptors import Descriptors
    >>> head = np.eye(4)[None].repeat(2, axis=0)
    >>> head[1, :3, :3] = Rotation.from_euler("x", 20, degrees=True).as_matrix()
    >>> lowered = Descriptors(np.zeros((2, 1)), ("browsRaised",), rate=30.0, head=head)
    >>> with_upright_brows(lowered).weights.ravel().round(2).tolist()
    [0.0, 0.15]
    """
    if BROWS_RAISED not in measured.names or measured.head is None:
        return measured
    weights = measured.weights.copy()
    weights[:, measured.names.index(BROWS_RAISED)] += PER_PITCH_DEG * head_angles(measured)["pitch"]
    return replace(measured, weights=weights)


def _brow_solver(face: FaceModel, layout: MarkerLayout) -> ThinShellSolver | None:
    """What solves for `browsRaised`; None where the face or the markers show too little for it."""
    try:
        solver = ThinShellSolver(face, layout)
    except SignfaceError:  # too few markers for weights: distances can be measured all the same
        return None
    seen = dict(zip(solver.names, solver.markers.observed, strict=True))
    return solver if all(seen.get(name, False) for name in (*RAISED, *LOWERED)) else None
