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
from signface.takes.stages import Block, Stage, View

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


class Creep(Stage):
    """Takes away how far the markers of a take have crept since its neutral frame.

    It stands behind `signface.solver.displacements.Displacements`.

    Parameters
    ----------
    face : FaceModel
    layout : MarkerLayout
        The one that displacements follow.
    signer_bases : (N, P, 3) array, optional
        See `ThinShellSolver`.

    Attributes
    ----------
    size_mm : float
        Root mean square of the creep of a marker over the take, in the displacements' unit.

    Examples
    --------
    A face at rest whose markers have all crept 0.2 mm upwards:

    >>> import signface as sf
    >>> face = sf.read_face("default")
    >>> layout = sf.read_layout("default-40", face)
    >>> displacements = np.zeros((50, 40, 3)) + (0.0, 0.2, 0.0)
    >>> creep = Creep(face, layout).fit(displacements, rate=RATE_HZ)
    >>> creep.at(np.array([25.0])).shape, 0.1 < creep.size_mm < 0.25
    ((1, 40, 3), True)
    """

    def __init__(self, face: FaceModel, layout: MarkerLayout, *, signer_bases: np.ndarray | None = None) -> None:
        self._face, self._layout, self._signer_bases = face, layout, signer_bases

    def learn(self, view: View) -> None:
        """The creep, from displacements some times a second."""
        step = max(1, round(view.rate / RATE_HZ))
        self._pace = view.rate / step / view.recording.rate
        self.fit(view.every(step).positions, view.rate / step)

    def fit(self, displacements: np.ndarray, rate: float) -> Creep:
        """Estimate the creep.

        Parameters
        ----------
        displacements : (K, P, 3) array
            Evenly spaced frames of the take.
        rate : float
            How many of them there are in a second; see `RATE_HZ`.
        """
        from scipy.ndimage import gaussian_filter1d

        solver = ThinShellSolver(self._face, self._layout, signer_bases=self._signer_bases)
        markers = solver.markers
        rest = REST**2 * markers.scale / markers.n_markers
        seen = np.isfinite(displacements).all(axis=2)
        self._crept = np.zeros_like(displacements)

        def window(values: np.ndarray) -> np.ndarray:
            return gaussian_filter1d(values, WINDOW_S * rate, axis=0, mode="constant", truncate=3.0)

        for _ in range(TURNS if seen.any() else 0):
            weights = np.nan_to_num(solver.solve(displacements - self._crept).weights)
            explained = (weights @ markers.matrix.T).reshape(displacements.shape)
            moved = np.einsum("kpd,kpd->k", explained, explained) / markers.n_markers
            trust = seen / (1.0 + moved / rest)[:, None]
            left = np.where(seen[:, :, None], displacements - explained, 0.0)
            # The window has mass 1: so many seconds in it are such a share of it.
            none = NONE_S / (np.sqrt(2.0 * np.pi) * WINDOW_S)
            self._crept = window(trust[:, :, None] * left) / (window(trust) + none)[:, :, None]
        self.size_mm = float(np.sqrt((self._crept**2).sum(axis=2).mean())) if len(self._crept) else 0.0
        return self

    def at(self, frames: np.ndarray) -> np.ndarray:
        """(F, P, 3) creep at (F,) numbers of the frames it was estimated from, which may lie between two of them."""
        before = np.clip(np.floor(frames).astype(int), 0, len(self._crept) - 1)
        after = np.minimum(before + 1, len(self._crept) - 1)
        share = np.clip(frames - before, 0.0, 1.0)[:, None, None]
        return (1.0 - share) * self._crept[before] + share * self._crept[after]

    def apply(self, block: Block) -> Block:
        """The displacements without creep."""
        return block.changed(block.positions - self.at(np.asarray(block.frames) * self._pace))

    @property
    def note(self) -> str:
        """How much creep there is."""
        return f"creep of {self.size_mm:.2f} mm taken away"
