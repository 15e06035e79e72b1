"""No blendshapes: how high the brows are, how wide the eyes and the mouth, in millimetres of the avatar.

- `FaceMeasures`: a dozen measures of a face from the markers nearest to where they are taken.

Blendshapes read a face as expressions that an avatar can make; fifty of them from a tracker's noisy landmarks are more
than a classifier of few signers can use. What linguists measure by hand is often enough for it. The two sides of a face
are taken together, so that a turn of the head that a tracker takes for a crooked face cancels out.
"""

from __future__ import annotations

import numpy as np

from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.solver.base import Solution

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


class FaceMeasures:
    """Named measures from displacements of markers; a `signface.solver.base.Solver` without bases.

    Parameters
    ----------
    face : FaceModel
        In the place and size of the default face.
    layout : MarkerLayout
        Measures whose places have no marker near them are left out.

    Attributes
    ----------
    names : tuple of str
        Of `MEASURES`.

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
        self.names = tuple(names)
        self._mix = np.array(rows)

    def solve(self, displacements: np.ndarray) -> Solution:
        """Measures of each frame in millimetres, 0 at rest; NaN where a marker is missing.

        Parameters
        ----------
        displacements : (F, P, 3) array
            As for any solver.
        """
        flat = displacements.reshape(len(displacements), -1)
        measures = np.nan_to_num(flat) @ self._mix.T
        measures[(~np.isfinite(flat)).astype(float) @ (self._mix != 0).T.astype(float) > 0] = np.nan
        return Solution(measures, np.full(len(measures), np.nan))
