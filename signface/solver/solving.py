"""A recording to descriptors: the whole way from markers to weights.

- `solve`: the whole way, to descriptors in memory.
- `solve_pieces`: the same piece by piece, for recordings of any length.
- `prepare_take`: the first half, marker displacements on the avatar (`signface.solver.preparation`).

A recording is gone through twice: once to find what holds for all of it (the neutral frame above all), once to solve
it. One that is no longer than a piece is cleaned once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.settings.solve import SolveSettings
from signface.signer import Signer
from signface.solver.measures import with_upright_brows
from signface.solver.methods import make_solver
from signface.solver.observability import unobserved_bases
from signface.solver.preparation import Preparation, PreparedTake, prepare_take
from signface.solver.thin_shell import ThinShellSolver
from signface.solver.uncertainty import deviations
from signface.takes.cleaning import Progress, silently
from signface.takes.recording import PIECE, Recording, pieces
from signface.takes.selecting import selected

__all__ = ["PreparedTake", "prepare_take", "solve", "solve_pieces"]


def solve(
    recording: Recording | Descriptors,
    face: FaceModel | None = None,
    layout: MarkerLayout | None = None,
    *,
    settings: SolveSettings | None = None,
    signer: Signer | None = None,
    uncertainty: bool = False,
    piece: int = PIECE,
    progress: Progress = silently,
) -> Descriptors:
    """Blendshape weights of a recording (Reverdy 2019, 5.2), all of them in memory.

    Parameters
    ----------
    recording : Take, TakeFile or Descriptors
        As it was read; markers in any place of the room. Descriptors (weights from a phone) are given back.
    face : FaceModel, optional
        The avatar; the one that the settings name by default.
    layout : MarkerLayout, optional
        Where the markers stand on the avatar, and which of them carry the head; by default the one that the settings
        name, or the shipped one that fits the markers best.
    settings : SolveSettings, optional
        How markers become weights.
    signer : Signer, optional
        Whose take it is: with bases of their own, where they are known, in place of the avatar's (thin shell only).
    uncertainty : bool
        Also give the weights' standard deviations (`signface.solver.uncertainty`); only the thin shell can.
    piece : int
        Frames worked on at a time; what comes out does not depend on it but by rounding.
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

    See Also
    --------
    solve_pieces : the same for recordings of any length.
    signface.annotation.annotate : the weights, and what they mean.

    Examples
    --------
    >>> import signface as sf
    >>> sf.solve(sf.datasets.mini_take("M1_IE_J")).weights.shape
    (2149, 51)
    """
    pieces = solve_pieces(
        recording,
        face,
        layout,
        settings=settings,
        signer=signer,
        uncertainty=uncertainty,
        piece=piece,
        progress=progress,
    )
    solved = list(pieces)
    if len(solved) == 1:
        return solved[0]
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(one, name) for one in solved])
        for name in ("weights", "residual", "head", "deviation")
        if getattr(solved[0], name) is not None
    }
    return replace(solved[0], history=solved[-1].history, **arrays)


def solve_pieces(
    recording: Recording | Descriptors,
    face: FaceModel | None = None,
    layout: MarkerLayout | None = None,
    *,
    settings: SolveSettings | None = None,
    signer: Signer | None = None,
    uncertainty: bool = False,
    piece: int = PIECE,
    progress: Progress = silently,
) -> Iterator[Descriptors]:
    """Blendshape weights of a recording, piece by piece, one after the other.

    Parameters and errors are those of `solve`. The last piece has the history of the whole take; how many gaps were
    filled, say, is not known before.

    See Also
    --------
    signface.write_weights : weights to disk.

    Examples
    --------
    >>> import signface as sf
    >>> recording = sf.open_recording(sf.datasets.mini_file())
    >>> [part.n_frames for part in sf.solve_pieces(recording, piece=500)]
    [500, 500, 184]
    """
    recording = selected(recording, settings)
    if isinstance(recording, Descriptors):
        yield recording
        return
    if piece < 1:
        raise SignfaceError(f"a piece has one frame or more, not {piece}")
    settings = SolveSettings() if settings is None else settings
    face, layout = face_and_layout(recording.labels, settings, face, layout)
    preparation = Preparation(recording, face, layout, settings=settings, signer=signer, piece=piece, progress=progress)
    given = settings.solver_options
    solver = make_solver(settings.method, face, preparation.layout, signer_bases=preparation.signer_bases, **given)
    known = solver if isinstance(solver, ThinShellSolver) else None
    if uncertainty and known is None:
        raise SignfaceError(f"the method {settings.method} does not say how uncertain it is", hint="use thin-shell")
    note = " ".join([f"{preparation.note}; solve {settings.method}", *(f"{k}={v:g}" for k, v in given.items())])
    warnings = [f"warning: {known.markers.warning}"] if known is not None and known.markers.warning else []
    unobserved = unobserved_bases(solver)
    for begin, end in progress(pieces(recording.n_frames, piece), "solving"):
        displacements, head = preparation.frames(begin, end)
        solution = solver.solve(displacements)
        solved = Descriptors(
            weights=solution.weights,
            names=solver.names,
            rate=recording.rate,
            start=recording.start + begin / recording.rate,
            residual=solution.residual,
            head=head,
            deviation=deviations(known, solution) if uncertainty and known is not None else None,
            name=recording.name,
            history=(*(preparation.history if end == recording.n_frames else recording.history), note, *warnings),
            settings=settings,
            unobserved=unobserved,
        )
        yield with_upright_brows(solved)


def face_and_layout(
    labels: Sequence[str], settings: SolveSettings, face: FaceModel | None = None, layout: MarkerLayout | None = None
) -> tuple[FaceModel, MarkerLayout]:
    """The face and layout given, or those that the settings name for markers of these labels."""
    from signface.face.layout_files import choose_layout, read_layout
    from signface.face.reading import read_face

    face = read_face(settings.face) if face is None else face
    if layout is None:
        layout = choose_layout(labels, face) if settings.layout is None else read_layout(settings.layout, face)
    return face, layout
