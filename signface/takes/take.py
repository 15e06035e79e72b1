"""The `Take`: what every reader returns and every later step of `takes` works on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np

from signface.content import Content, Summary
from signface.errors import SignfaceError
from signface.extras import needed
from signface.frames import TimedArrays

if TYPE_CHECKING:
    import pandas as pd
    import xarray


@dataclass(frozen=True, eq=False, repr=False)
class Take(TimedArrays, Summary, Content):
    """Trajectories of markers.

    Parameters
    ----------
    positions : (F, M, 3) float64 array
        Positions in millimetres; NaN (all three coordinates) where a marker is missing.
    labels : (M,) tuple of str
        Marker names, unique.
    rate : float
        Frames per second (Hz), positive and finite.
    start : float
        Time of frame 0 in seconds, so that frames line up with a video.
    name : str
        Name of the take, usually the stem of its file.
    history : tuple of str
        What was done, oldest first; the first entry says which file was read.

    Raises
    ------
    SignfaceError
        Shapes disagree, a label is repeated, the rate is not positive, or there is no frame.

    See Also
    --------
    signface.read_take : where takes come from.

    Examples
    --------
    >>> import signface as sf
    >>> take = sf.datasets.mini_take()
    >>> take.positions.shape, take.rate, take.labels[0]
    ((1184, 46, 3), 200.0, 'LBROI')
    >>> take.between(1.0, 2.0).duration
    1.0
    """

    positions: np.ndarray
    labels: tuple[str, ...]
    rate: float
    start: float = 0.0
    name: str = "take"
    history: tuple[str, ...] = field(default=(), compare=False)

    def _sizes(self) -> str:
        return f"{self.n_frames} frames at {self.rate:g} Hz, {len(self.labels)} markers"

    def __post_init__(self) -> None:
        positions = np.array(self.positions, dtype=np.float64)
        labels = tuple(str(label) for label in self.labels)
        if positions.ndim != 3 or positions.shape[2] != 3:
            raise SignfaceError(f"positions must have the shape (frames, markers, 3), not {positions.shape}")
        if positions.shape[1] != len(labels):
            raise SignfaceError(f"{positions.shape[1]} trajectories but {len(labels)} marker labels")
        if positions.shape[0] == 0:
            raise SignfaceError("the take has no frame")
        if len(set(labels)) != len(labels):
            twice = sorted({label for label in labels if labels.count(label) > 1})
            raise SignfaceError(f"marker labels are repeated: {', '.join(twice[:5])}", hint="rename the markers")
        if not (np.isfinite(self.rate) and self.rate > 0):
            raise SignfaceError(f"the rate must be positive, not {self.rate}", hint="export it with its rate")
        positions[~np.isfinite(positions).all(axis=2)] = np.nan  # a half-known or infinite point is a missing one
        rate, start, history = float(self.rate), float(self.start), tuple(self.history)
        self._hold(positions=positions, labels=labels, rate=rate, start=start, history=history)

    @property
    def n_frames(self) -> int:
        """Number of frames F."""
        return self.positions.shape[0]

    def frames(self, begin: int, end: int, step: int = 1) -> np.ndarray:
        """(K, M, 3) positions of every `step`-th frame from `begin` to before `end`."""
        begin, end = self.clamp(begin, end)
        return self.positions[begin:end:step]

    def select(self, labels: Sequence[str]) -> np.ndarray:
        """(F, len(labels), 3) positions of the named markers, in the order asked for.

        Raises
        ------
        SignfaceError
            A marker is not in the take.
        """
        return self.positions[:, columns_of(self, labels)]

    def to_frame(self) -> pd.DataFrame:
        """A table with a row for each frame, `time_s` its index, and `LABEL_x, LABEL_y, LABEL_z` of each marker (mm).

        Written as csv it is a recording that `signface.read_take` reads.

        See Also
        --------
        to_xarray : with labelled axes and the history.

        Examples
        --------
        >>> import numpy as np
        >>> import signface as sf
        >>> take = sf.Take(np.arange(6.0).reshape(2, 1, 3), ("CHIN",), rate=100)
        >>> take.to_frame()
                CHIN_x  CHIN_y  CHIN_z
        time_s
        0.00       0.0     1.0     2.0
        0.01       3.0     4.0     5.0
        """
        import pandas as pd

        columns = [f"{label}_{axis}" for label in self.labels for axis in "xyz"]
        return pd.DataFrame(
            self.positions.reshape(self.n_frames, -1), pd.Index(self.time, name="time_s"), columns, copy=True
        )

    def to_xarray(self) -> xarray.DataArray:
        """The positions over `time` (s), `marker` and `axis` (`x`, `y`, `z`), in millimetres.

        The attributes are `units`, `rate` (Hz) and `history` (a line for each step).

        Raises
        ------
        SignfaceError
            xarray is not installed.
        """
        xarray = needed("xarray", "xarray")
        coordinates = {"time": ("time", self.time, {"units": "s"}), "marker": list(self.labels), "axis": list("xyz")}
        attributes = {"units": "mm", "rate": self.rate, "history": "\n".join(self.history)}
        axes = ("time", "marker", "axis")
        return xarray.DataArray(self.positions.copy(), coordinates, axes, name=self.name, attrs=attributes)


class Labelled(Protocol):
    """What has named markers."""

    @property
    def labels(self) -> tuple[str, ...]: ...

    @property
    def name(self) -> str: ...


def columns_of(recording: Labelled, labels: Sequence[str]) -> list[int]:
    """Where the named markers are among those of a recording; see `Take.select`."""
    column = {label: number for number, label in enumerate(recording.labels)}
    missing = [label for label in labels if label not in column]
    if missing:
        raise SignfaceError(f"{recording.name}: no marker named {', '.join(missing[:5])}")
    return [column[label] for label in labels]
