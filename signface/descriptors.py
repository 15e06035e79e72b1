"""`Descriptors`: blendshape weights in time, the object that everything after the solve works on.

It stands at the top of the package because the rooms on both sides of it (solve, and segment to render) share it.
`signface.descriptors_files` writes it to disk and reads it back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from signface.columns import RESIDUAL, TIME, base_column, pose_columns
from signface.content import Content, Summary
from signface.errors import SignfaceError
from signface.extras import needed
from signface.frames import TimedArrays

if TYPE_CHECKING:
    import pandas as pd
    import xarray

    from signface.settings.solve import SolveSettings


#: How the check of markers (`signface.takes.marker_check`) begins its line of the history; what it says for nothing.
CHECKED, NOTHING_WRONG, TOO_FEW = "check_markers: ", "nothing wrong", "too few markers to tell"


@dataclass(frozen=True, eq=False, repr=False)
class Descriptors(TimedArrays, Summary, Content):
    """Blendshape weights of a take.

    Parameters
    ----------
    weights : (F, N) float64 array
        Weight of each base, 0 at rest and 1 fully active. NaN where a frame could not be solved.
    names : (N,) tuple of str
        Names of the bases, as in the face model.
    rate : float
        Frames per second (Hz).
    start : float
        Time of frame 0 in seconds.
    residual : (F,) float64 array, optional
        Root mean square distance between adapted markers and the solved face, in millimetres. NaN when unknown
        (weights that came straight from a phone).
    head : (F, 4, 4) float64 array, optional
        Pose of the head relative to its neutral frame: maps a point of the neutral head to its place in the
        recording, millimetres. The identity throughout when unknown; NaN in single frames in which it is.
    name : str
        Name of the take.
    history : tuple of str
        What was done, oldest first.
    deviation : (F, N) float64 array, optional
        Standard deviation of each weight; NaN where the markers say nothing. None when it was not asked for.
    settings : SolveSettings, optional
        How the weights were solved; None where that is not known, or nothing was solved.
    unobserved : tuple of str
        Bases that the markers cannot see (`signface.solver.observability`): their weights of 0 say nothing. Empty also
        where nobody knows, as in weights read from csv.

    See Also
    --------
    signface.solve, signface.read_weights : where they come from.

    Examples
    --------
    >>> import signface as sf
    >>> weights = sf.datasets.mini_weights()
    >>> weights.n_frames, weights.names[:2]
    (1184, ('eyeBlinkLeft', 'eyeLookDownLeft'))
    >>> weights.weight("jawOpen").shape
    (1184,)
    >>> weights.between(1.0, 2.0).duration
    1.0
    >>> weights.to_frame().columns[:3].tolist()
    ['eyeBlinkLeft', 'eyeLookDownLeft', 'eyeLookInLeft']
    """

    weights: np.ndarray
    names: tuple[str, ...]
    rate: float
    start: float = 0.0
    residual: np.ndarray | None = None
    head: np.ndarray | None = None
    name: str = "take"
    history: tuple[str, ...] = field(default=(), compare=False)
    deviation: np.ndarray | None = None
    settings: SolveSettings | None = field(default=None, compare=False)
    unobserved: tuple[str, ...] = field(default=(), compare=False)

    def _sizes(self) -> str:
        return f"{self.n_frames} frames at {self.rate:g} Hz, {len(self.names)} bases"

    def __post_init__(self) -> None:
        weights = np.array(self.weights, dtype=np.float64)
        names = tuple(str(name) for name in self.names)
        if weights.ndim != 2 or weights.shape[1] != len(names):
            raise SignfaceError(f"weights of shape {weights.shape} do not match {len(names)} base names")
        if len(set(names)) != len(names):
            raise SignfaceError("base names are repeated")
        if not (np.isfinite(self.rate) and self.rate > 0):
            raise SignfaceError(f"the rate must be positive, not {self.rate}")
        frames = weights.shape[0]
        residual = np.full(frames, np.nan) if self.residual is None else np.array(self.residual, dtype=np.float64)
        head = np.tile(np.eye(4), (frames, 1, 1)) if self.head is None else np.array(self.head, dtype=np.float64)
        if residual.shape != (frames,):
            raise SignfaceError(f"residual of shape {residual.shape} does not match {frames} frames")
        if head.shape != (frames, 4, 4):
            raise SignfaceError(f"head poses of shape {head.shape} do not match {frames} frames")
        if self.deviation is not None:
            deviation = np.array(self.deviation, dtype=np.float64)
            if deviation.shape != weights.shape:
                raise SignfaceError(f"deviations of shape {deviation.shape} do not match weights of {weights.shape}")
            self._hold(deviation=deviation)
        if set(self.unobserved) - set(names):
            raise SignfaceError(f"unobserved bases that there are not: {sorted(set(self.unobserved) - set(names))[0]}")
        self._hold(unobserved=tuple(self.unobserved))
        rate, start, history = float(self.rate), float(self.start), tuple(self.history)
        self._hold(weights=weights, names=names, rate=rate, start=start, residual=residual, head=head, history=history)

    @property
    def n_frames(self) -> int:
        """Number of frames F."""
        return self.weights.shape[0]

    @property
    def wrong_markers(self) -> str:
        """What the check of markers found before the solve, in words; empty where it found nothing, or did not look."""
        notes = [step.removeprefix(CHECKED) for step in self.history if step.startswith(CHECKED)]
        return next((note for note in notes if note not in (NOTHING_WRONG, TOO_FEW)), "")

    def weight(self, name: str) -> np.ndarray:
        """(F,) weights of one base, by name.

        Raises
        ------
        SignfaceError
            There is no base of that name.
        """
        return self.weights[:, self._column(name)]

    def on(self, bases: Sequence[str]) -> Descriptors:
        """The take with these bases only, in this order; standard deviations are left behind.

        Raises
        ------
        SignfaceError
            There is no base of a name.
        """
        if self.names == tuple(bases):
            return self
        columns = [self._column(name) for name in bases]
        left = tuple(name for name in self.unobserved if name in bases)
        return replace(self, weights=self.weights[:, columns], names=tuple(bases), deviation=None, unobserved=left)

    def _column(self, name: str) -> int:
        if name not in self.names:
            raise SignfaceError(f"{self.name}: no base named {name}", hint=f"the bases are {', '.join(self.names)}")
        return self.names.index(name)

    def columns(self) -> dict[str, np.ndarray]:
        """(F,) numbers under the names of a weights file: `time_s`, one per base, `head_*`, `residual_mm`.

        Raises
        ------
        SignfaceError
            The head's poses are no rigid motions.
        """
        assert self.head is not None
        assert self.residual is not None
        weights = {base_column(name): values for name, values in zip(self.names, self.weights.T, strict=True)}
        return {TIME: self.time, **weights, **pose_columns(self.head), RESIDUAL: self.residual}

    def to_frame(self) -> pd.DataFrame:
        """A table with a row for each frame, `time_s` its index; written as csv it is a weights file.

        Its columns are the bases, the head's pose (`head_x_mm, head_y_mm, head_z_mm`: where the origin of the neutral
        head is; `head_rx_deg, head_ry_deg, head_rz_deg`: its rotation vector) and `residual_mm`.

        See Also
        --------
        to_xarray : with labelled axes, deviations and history.
        signface.descriptors_files.write_weights : the same on disk.

        Examples
        --------
        >>> import numpy as np
        >>> import signface as sf
        >>> take = sf.Descriptors(np.array([[0.0], [0.5]]), ("jawOpen",), rate=100)
        >>> take.to_frame()["jawOpen"]
        time_s
        0.00    0.0
        0.01    0.5
        Name: jawOpen, dtype: float64
        """
        import pandas as pd

        return pd.DataFrame(self.columns()).set_index(TIME)

    def to_xarray(self) -> xarray.Dataset:
        """The take with labelled axes: `weights` and, where it is known, `deviation` over `time` and `base`, `residual`
        over `time`, and `head`, the pose's 4 by 4 matrix over `time`, `row` and `column`.

        The attributes are `name`, `rate` (Hz), `history` (a line for each step) and, where the weights were solved,
        `settings` in words; and `unobserved`, the names of bases that the markers cannot see, where there are any.

        Raises
        ------
        SignfaceError
            xarray is not installed.
        """
        xarray = needed("xarray", "xarray")
        axes = ("time", "base")
        variables = {
            "weights": (axes, self.weights.copy(), {"long_name": "0 at rest, 1 fully active"}),
            "residual": ("time", np.array(self.residual), {"units": "mm"}),
            "head": (("time", "row", "column"), np.array(self.head), {"long_name": "pose of the head", "units": "mm"}),
        }
        if self.deviation is not None:
            variables["deviation"] = (axes, self.deviation.copy(), {"long_name": "standard deviation of the weights"})
        attributes = {"name": self.name, "rate": self.rate, "history": "\n".join(self.history)}
        if self.settings is not None:
            attributes["settings"] = str(self.settings)
        if self.unobserved:
            attributes["unobserved"] = " ".join(self.unobserved)
        coordinates = {"time": ("time", self.time, {"units": "s"}), "base": list(self.names)}
        return xarray.Dataset(variables, coordinates, attributes)
