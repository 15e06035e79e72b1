"""Markers creep along the skin while a take goes on; what they creep is estimated from the take and taken away.

A marker that has crept 0.2 mm since the neutral frame shows a weak expression that is not there, in every frame. No
single frame tells the two apart. But creep is slow and there all the time, while expressions come and go, and the face
rests between them: then the markers show little else. So the mean, over some seconds, of what the avatar does not
explain is taken for creep, with frames counting less the more the face moves in them; and since creep also makes the
avatar explain it falsely, solve and mean take turns.
"""

from __future__ import annotations

import numpy as np

from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.solver.thin_shell import ThinShellSolver

#: Frames per second that creep is estimated from.
RATE_HZ = 5.0
#: Root mean square displacement of the markers, as a share of what a typical base does, at which a frame counts half
#: (0.5 mm on the default face).
REST = 0.15
#: Standard deviation of the window over which the mean is taken (s): creep hardly changes within it.
WINDOW_S = 8.0
#: Seconds of rest within the window that the assumption of no creep counts for.
NONE_S = 0.3
#: Turns of solve and mean.
TURNS = 8


class Creep:
    """How far the markers of a take have crept since its neutral frame.

    Parameters
    ----------
    displacements : (K, P, 3) array
        Evenly spaced frames of the take, as `signface.solver.preparation.Preparation.frames` gives them.
    rate : float
        How many of them there are in a second; see `RATE_HZ`.
    face : FaceModel
    layout : MarkerLayout
        The one that `displacements` follows.
    signer_bases : (N, P, 3) array, optional
        See `ThinShellSolver`.

    Attributes
    ----------
    size_mm : float
        Root mean square of the creep of a marker over the take, in the displacements' unit.
    """

    def __init__(
        self,
        displacements: np.ndarray,
        rate: float,
        face: FaceModel,
        layout: MarkerLayout,
        *,
        signer_bases: np.ndarray | None = None,
    ) -> None:
        from scipy.ndimage import gaussian_filter1d

        solver = ThinShellSolver(face, layout, signer_bases=signer_bases)
        markers = solver.markers
        rest = REST**2 * markers.scale / markers.n_markers
        seen = np.isfinite(displacements).all(axis=2)
        self._rate, self._crept = rate, np.zeros_like(displacements)

        def window(values: np.ndarray) -> np.ndarray:
            return gaussian_filter1d(values, WINDOW_S * rate, axis=0, mode="constant", truncate=3.0)

        for _ in range(TURNS if seen.any() else 0):
            weights = np.nan_to_num(solver.solve(displacements - self._crept).weights)
            shown = (weights @ markers.matrix.T).reshape(displacements.shape)
            moved = np.einsum("kpd,kpd->k", shown, shown) / markers.n_markers
            trust = seen / (1.0 + moved / rest)[:, None]
            left = np.where(seen[:, :, None], displacements - shown, 0.0)
            # The window has mass 1: so many seconds in it are such a share of it.
            none = NONE_S / (np.sqrt(2.0 * np.pi) * WINDOW_S)
            self._crept = window(trust[:, :, None] * left) / (window(trust) + none)[:, :, None]
        self.size_mm = float(np.sqrt((self._crept**2).sum(axis=2).mean())) if len(self._crept) else 0.0

    def at(self, frames: np.ndarray) -> np.ndarray:
        """(F, P, 3) creep at (F,) places among the frames it was estimated from, which may lie between two of them."""
        before = np.clip(np.floor(frames).astype(int), 0, len(self._crept) - 1)
        after = np.minimum(before + 1, len(self._crept) - 1)
        share = np.clip(frames - before, 0.0, 1.0)[:, None, None]
        return (1.0 - share) * self._crept[before] + share * self._crept[after]
