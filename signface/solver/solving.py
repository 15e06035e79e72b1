"""A recording to descriptors: the whole way from markers to weights.

- `solve_take`: the whole way, to descriptors in memory.
- `solve_pieces`: the same piece by piece, for recordings of any length.
- `prepare_take`: the first half, marker displacements on the avatar (`signface.solver.preparation`).

A recording is gone through twice: once to find what holds for all of it (the neutral frame above all), once to solve
it. One that is no longer than a piece is cleaned once.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.solver.methods import make_solver
from signface.solver.preparation import Preparation, PreparedTake, prepare_take
from signface.solver.thin_shell import ThinShellSolver
from signface.solver.uncertainty import deviations
from signface.takes.cleaning import Progress, silently
from signface.takes.recording import PIECE, Recording, pieces

__all__ = ["PreparedTake", "prepare_take", "solve_pieces", "solve_take"]


def solve_take(
    recording: Recording,
    face: FaceModel,
    layout: MarkerLayout,
    *,
    neutral: str | float = "auto",
    adaptation: str = "similarity",
    method: str = "thin-shell",
    alpha: float | None = None,
    **options: Any,
) -> Descriptors:
    """Blendshape weights of a recording (Reverdy 2019, 5.2), all of them in memory.

    Parameters
    ----------
    recording : Take or TakeFile
        As it was read; markers in any place of the room.
    face : FaceModel
        The avatar.
    layout : MarkerLayout
        Where the markers stand on the avatar, and which of them carry the head.
    neutral : float or "auto"
        Time in seconds of a frame with a neutral face; `auto` looks for one.
    adaptation : str
        `similarity` or `rbf` (the thesis's), see `signface.solver.adaptation`.
    method, alpha, sparsity, head_slack, slip
        See `signface.solver.methods.make_solver`.
    creep : bool, optional
        Take away what the markers creep along the skin (`signface.solver.creep`); by default for the thin shell, and
        not for its rivals.
    signer : path, optional
        A file of the signer's own bases, made by `signface calibrate`; only the thin shell uses it.
    uncertainty : bool
        Also give the weights' standard deviations (`signface.solver.uncertainty`); only the thin shell can.
    short_gap_s, long_gap_s : float
        Longest gaps that are filled (seconds), see `signface.takes.gaps.fill_gaps`.
    cutoff_hz, filter_method
        See `signface.takes.filtering.lowpass`.
    head_fallback : str, optional
        `least-moving`: carry the head by the least-moving markers where head markers do not suffice.
    piece : int
        Frames worked on at a time; what is found does not depend on it but by rounding.
    progress : callable, optional
        Shows how far we are, see `signface.takes.cleaning.Progress`.

    Returns
    -------
    Descriptors
        With the residual of each frame (root mean square distance between the adapted markers and the solved face,
        millimetres on the avatar) and the head's poses. A frame that cannot be solved is NaN.

    Raises
    ------
    SignfaceError
        The take's markers do not match the layout, the head's motion cannot be found, the neutral time is outside
        the take, or no face marker is seen there.

    Examples
    --------
    >>> from signface.face.layout_files import choose_layout
    >>> from signface.face.reading import read_face
    >>> from signface.takes.reading import read_take
    >>> face, take = read_face("default"), read_take("take.c3d")  # doctest: +SKIP
    >>> solve_take(take, face, choose_layout(take.labels, face)).weights.shape  # doctest: +SKIP
    (12000, 51)
    """
    parts = list(
        solve_pieces(
            recording, face, layout, neutral=neutral, adaptation=adaptation, method=method, alpha=alpha, **options
        )
    )
    if len(parts) == 1:
        return parts[0]
    return Descriptors(
        weights=np.concatenate([part.weights for part in parts]),
        names=face.names,
        rate=recording.rate,
        start=recording.start,
        residual=np.concatenate([part.residual for part in parts if part.residual is not None]),
        head=np.concatenate([part.head for part in parts if part.head is not None]),
        deviation=None if parts[0].deviation is None else np.concatenate([part.deviation for part in parts]),
        name=recording.name,
        history=parts[-1].history,
    )


def solve_pieces(
    recording: Recording,
    face: FaceModel,
    layout: MarkerLayout,
    *,
    method: str = "thin-shell",
    alpha: float | None = None,
    sparsity: float | None = None,
    head_slack: float | None = None,
    slip: float | None = None,
    creep: bool | None = None,
    uncertainty: bool = False,
    piece: int = PIECE,
    progress: Progress = silently,
    **options: Any,
) -> Iterator[Descriptors]:
    """Blendshape weights of a recording, piece by piece, one after the other.

    Parameters and errors are those of `solve_take`. The last piece has the history of the whole take; how many gaps
    were filled, say, is not known before.

    Yields
    ------
    Descriptors
    """
    if piece < 1:
        raise SignfaceError(f"a piece has one frame or more, not {piece}")
    given = {"alpha": alpha, "sparsity": sparsity, "head_slack": head_slack, "slip": slip}
    given = {name: value for name, value in given.items() if value is not None}
    creep = method == "thin-shell" if creep is None else creep
    preparation = Preparation(recording, face, layout, creep=creep, piece=piece, progress=progress, **options)
    solver = make_solver(method, face, preparation.layout, signer_bases=preparation.signer_bases, **given)
    known = solver if isinstance(solver, ThinShellSolver) else None
    if uncertainty and known is None:
        raise SignfaceError(f"the method {method} does not say how uncertain it is", hint="use thin-shell")
    note = f"{preparation.note}; solve {method}" + "".join(f" {name}={value:g}" for name, value in given.items())
    warnings = [f"warning: {known.markers.warning}"] if known is not None and known.markers.warning else []
    for begin, end in progress(pieces(recording.n_frames, piece), "solving"):
        displacements, head = preparation.frames(begin, end)
        solution = solver.solve(displacements)
        yield Descriptors(
            weights=solution.weights,
            names=face.names,
            rate=recording.rate,
            start=recording.start + begin / recording.rate,
            residual=solution.residual,
            head=head,
            deviation=deviations(known, solution) if uncertainty and known is not None else None,
            name=recording.name,
            history=(*(preparation.history if end == recording.n_frames else recording.history), note, *warnings),
        )
