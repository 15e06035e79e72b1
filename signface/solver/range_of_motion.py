"""Calibrating a signer as a laboratory can: from a take in which named bases are shown, nobody knows how strongly.

- `calibrate_signer`: a range-of-motion take to a `Signer`; `calibrate_guarded`: the same, with what decided.
- `Shown`: when which bases are shown; `read_shown` reads it from a table.
- `calibrate_shown`: the signer's bases at the markers, from displacements.
- `away_from_avatar`: how far they are from the avatar's.

A range-of-motion take ("brows up, brows down, open the mouth, ...") says which base moves at a time, not how far. So
strengths and bases are found in turns: strengths of the bases shown from the bases as known so far, within each
window measured from the rest at its two ends; then the bases from the strengths (`signface.solver.calibration`). How
strong a base is at most cannot be told apart from how strongly it was shown: each keeps the avatar's strength, and
what is learnt is where and in which direction it moves the markers.

**The guard.** Bases learnt from one take are learnt from its noise too, and from whatever else moved along. A signer
whom the avatar fits already is solved worse by them. So each window is halved; bases learnt from the first halves are
tried on the second, and the other way round, beside the avatar's. Only where they leave clearly less of the markers'
movement unexplained are they kept. How much less is enough (`GUARD`) was chosen on 24 invented signers whose bases
depart from the avatar's by 0 to 35 %: from about a tenth on the weights are better with bases of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike

import numpy as np

from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.settings.solve import SolveSettings
from signface.signer import Signer, SignerBases
from signface.solver.calibration import calibrate
from signface.solver.solving import face_and_layout, prepare_take
from signface.solver.thin_shell import ThinShellSolver
from signface.takes.recording import Recording

#: What the avatar's bases count beside those shown, see `signface.solver.calibration.calibrate`: twice as much as where
#: strengths are known.
PRIOR = 1e-3
#: Rounds of strengths and bases.
ROUNDS = 3
#: A base may have been shown up to this weight.
STRONGEST = 1.5
#: The part of a window, at each of its ends, over which the face is at rest.
REST_SHARE = 0.06
#: Own bases are kept where they leave at most this part of the squared residual that the avatar's leave on held-out
#: frames. Signers whom the avatar fits have 0.93 to 0.95, those who depart from it by 15 % and more 0.61 at most.
GUARD = 0.67
#: A base found to point away from the avatar's by more than this cosine is not what was asked for.
ALIKE = 0.3


#: Frames of a window, the bases shown in it (as numbers), and the (F, P, 3) displacements from its rest.
Movement = tuple[np.ndarray, list[int], np.ndarray]


@dataclass(frozen=True)
class Shown:
    """A stretch of a range-of-motion take, from rest to rest.

    Parameters
    ----------
    start_s, end_s : float
        Seconds on the take's own clock.
    bases : tuple of str
        Names of the bases that are shown in it.
    """

    start_s: float
    end_s: float
    bases: tuple[str, ...]


def calibrate_signer(
    recording: Recording,
    shown: str | PathLike[str] | Sequence[Shown],
    face: FaceModel | None = None,
    layout: MarkerLayout | None = None,
    *,
    name: str = "",
    settings: SolveSettings | None = None,
    force: bool = False,
) -> Signer:
    """A signer with bases of their own, from a take in which named bases are shown.

    Where these are no better than the avatar's on held-out frames, the signer has the avatar's.

    Parameters
    ----------
    recording : Take or TakeFile
        The range-of-motion take.
    shown : path or sequence of Shown
        What is shown when; a path is that of a table that `read_shown` reads.
    face, layout : optional
        In place of those that the settings name.
    name : str
        Who it is.
    settings : SolveSettings, optional
        How takes of the signer will be solved. Creep is taken away only where they ask for it: it would be learnt from
        the very weights that are not known yet.
    force : bool
        Keep the bases learnt, whatever held-out frames say.

    Returns
    -------
    Signer
        `Signer.save` writes it.

    Raises
    ------
    SignfaceError
        The recording holds weights, the table is none or names a base that the face has not, or no window lies in the
        take and shows a base that moves its markers.

    See Also
    --------
    signface.solve : which takes the signer.
    calibrate_guarded : the same, with what decided.

    Examples
    --------
    >>> import numpy as np
    >>> import signface as sf
    >>> from signface.solver.range_of_motion import Shown
    >>> face = sf.read_face()
    >>> layout = sf.read_layout("default-40", face)
    >>> weights = np.zeros((100, face.n_bases))  # two seconds at 50 Hz: the jaw opens and closes
    >>> weights[20:80, face.names.index("jawOpen")] = np.sin(np.linspace(0, np.pi, 60)) ** 2
    >>> skin = layout.points(face) + np.tensordot(weights, 1.2 * layout.bases(face), axes=1)
    >>> head = np.repeat(layout.points(face, layout.head_labels)[None], len(weights), axis=0)
    >>> take = sf.Take(np.concatenate([skin, head], axis=1), (*layout.face_labels, *layout.head_labels), rate=50.0)
    >>> eva = sf.calibrate_signer(take, [Shown(0.3, 1.7, ("jawOpen",))], name="Eva")
    >>> eva.name, sorted(set(eva.bases.bases))
    ('Eva', ['jawOpen'])
    """
    return calibrate_guarded(recording, shown, face, layout, name=name, settings=settings, force=force).signer


@dataclass(frozen=True)
class Calibration:
    """A signer calibrated, and what held-out frames say of it.

    Parameters
    ----------
    signer : Signer
        With the bases learnt, or with the avatar's where these are no worse.
    avatar_mm, own_mm : float
        Root mean square residual on held-out halves of the windows, with the avatar's bases and with the signer's.
    """

    signer: Signer
    avatar_mm: float
    own_mm: float

    @property
    def better(self) -> bool:
        """Whether the bases learnt explain held-out frames clearly better than the avatar's (`GUARD`)."""
        return self.own_mm**2 < GUARD * self.avatar_mm**2


def calibrate_guarded(
    recording: Recording,
    shown: str | PathLike[str] | Sequence[Shown],
    face: FaceModel | None = None,
    layout: MarkerLayout | None = None,
    *,
    name: str = "",
    settings: SolveSettings | None = None,
    force: bool = False,
) -> Calibration:
    """What `calibrate_signer` does, with what decided; parameters and errors are its."""
    if not hasattr(recording, "labels"):
        raise SignfaceError("holds weights, not markers", file=getattr(recording, "name", None))
    settings = settings or SolveSettings()
    face, layout = face_and_layout(recording.labels, settings, face, layout)
    windows = read_shown(shown, face.names) if isinstance(shown, (str, PathLike)) else shown
    prepared = prepare_take(recording, face, layout, settings=settings.changed(creep=bool(settings.creep)))
    movements = movements_of(
        prepared.displacements, windows, face, prepared.layout, rate=recording.rate, start_s=recording.start
    )
    avatar, length = prepared.layout.bases(face), len(prepared.displacements)
    residuals = _held_out(movements, face, prepared.layout, length, recording.rate, settings)
    found = Calibration(Signer(name), *residuals)
    bases = _learn(movements, avatar, length, recording.rate, PRIOR) if force or found.better else avatar
    learnt = [face.names[base] for base in sorted({base for _, moved, _ in movements for base in moved})]
    return replace(found, signer=Signer(name, SignerBases.of(bases, learnt, face, prepared.layout)))


def _held_out(
    movements: Sequence[Movement],
    face: FaceModel,
    layout: MarkerLayout,
    length: int,
    rate: float,
    settings: SolveSettings,
) -> tuple[float, float]:
    """Root mean square residuals (mm) on the half of each window that was not learnt from: avatar's bases, own ones."""
    options = settings.solver_options if settings.method == "thin-shell" else {}
    plain = ThinShellSolver(face, layout, **options)  # type: ignore[arg-type]
    squares = []
    for turn in (slice(None, None, 1), slice(None, None, -1)):
        learnt_on, tried_on = [], []
        for frames, moved, movement in movements:
            parts = [(part, moved, rows) for part, rows in zip(_halves(frames), _halves(movement), strict=True)][turn]
            learnt_on.append(parts[0])
            tried_on.append(parts[1][2])
        own = _learn(learnt_on, layout.bases(face), length, rate, PRIOR)
        solvers = plain, ThinShellSolver(face, layout, signer_bases=own, **options)  # type: ignore[arg-type]
        # Window by window, so that long ones do not decide alone.
        squares.append([[np.nanmean(solver.solve(rows).residual ** 2) for rows in tried_on] for solver in solvers])
    avatars, signers = np.sqrt(np.nanmean(squares, axis=(0, 2)))
    return float(avatars), float(signers)


def _halves(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return rows[: len(rows) // 2], rows[len(rows) // 2 :]


def away_from_avatar(bases: SignerBases, face: FaceModel, layout: MarkerLayout) -> float:
    """How far a signer's bases lie from the avatar's, as a share of these, over all markers of all that were learnt."""
    columns = [face.names.index(name) for name in bases.bases]
    rows = [layout.face_labels.index(marker) for marker in bases.markers]
    avatar = layout.bases(face)[columns, rows]
    return float(np.sqrt(((bases.displacements - avatar) ** 2).sum() / (avatar**2).sum()))


def read_shown(path: str | PathLike[str], names: Sequence[str]) -> list[Shown]:
    """Read when which bases are shown: a csv with the columns `start_s, end_s, bases`.

    `bases` is one name or several joined by `+`; `*` at the end of a name stands for Left and Right.

    Raises
    ------
    SignfaceError
        The file cannot be read, a time is not a number, a window ends before it starts, or a base is unknown.
    """
    import pandas as pd

    try:
        table = pd.read_csv(path, dtype=str, keep_default_na=False)
    except FileNotFoundError:
        raise SignfaceError("no such file", file=path) from None
    except (OSError, ValueError) as error:
        raise SignfaceError("cannot be read as a table", file=path) from error
    missing = [column for column in ("start_s", "end_s", "bases") if column not in table.columns]
    if missing or not len(table):
        what = f"has no column {missing[0]}" if missing else "has no row"
        raise SignfaceError(what, file=path, hint="its columns are start_s, end_s, bases")
    windows = []
    for line, (start, end, text) in enumerate(zip(table["start_s"], table["end_s"], table["bases"]), start=2):
        try:
            start_s, end_s = float(start), float(end)
        except ValueError:
            raise SignfaceError(f"line {line}: {start!r} or {end!r} is no time in seconds", file=path) from None
        if not (np.isfinite([start_s, end_s]).all() and start_s < end_s):
            raise SignfaceError(f"line {line}: the window from {start} to {end} s is empty", file=path)
        bases: list[str] = []
        for name in map(str.strip, text.split("+")):
            bases += [f"{name[:-1]}{side}" for side in ("Left", "Right")] if name.endswith("*") else [name]
        unknown = [name for name in bases if name not in names]
        if unknown:
            raise SignfaceError(
                f"line {line}: the face has no base named {unknown[0]!r}", file=path, hint=f"it has {', '.join(names)}"
            )
        windows.append(Shown(start_s, end_s, tuple(bases)))
    return windows


def calibrate_shown(
    displacements: np.ndarray,
    shown: Sequence[Shown],
    face: FaceModel,
    layout: MarkerLayout,
    *,
    rate: float,
    start_s: float = 0.0,
    prior: float = PRIOR,
) -> tuple[np.ndarray, list[str]]:
    """Bases of a signer at the markers, from a take in which they are shown.

    Parameters
    ----------
    displacements : (F, P, 3) array
        Of the range-of-motion take, as `signface.solver.solving.prepare_take` gives them.
    shown : sequence of Shown
    face : FaceModel
    layout : MarkerLayout
        The one that `displacements` follows.
    rate : float
        Frames per second.
    start_s : float
        Time of frame 0.
    prior : float
        How much the avatar's bases count, see `signface.solver.calibration.calibrate`.

    Returns
    -------
    (N, P, 3) array, list of str
        To be given to `ThinShellSolver` as `signer_bases`; and the names of the bases that were learnt.

    Raises
    ------
    SignfaceError
        No window lies in the take and shows a base that moves the markers.
    """
    movements = movements_of(displacements, shown, face, layout, rate=rate, start_s=start_s)
    bases = layout.bases(face)
    learnt = sorted({base for _, moved, _ in movements for base in moved})
    signers = _learn(movements, bases, len(displacements), rate, prior)
    return signers, [face.names[base] for base in learnt]


def movements_of(
    displacements: np.ndarray,
    shown: Sequence[Shown],
    face: FaceModel,
    layout: MarkerLayout,
    *,
    rate: float,
    start_s: float = 0.0,
) -> list[Movement]:
    """What the markers do in each window that can be used; parameters and errors are those of `calibrate_shown`."""
    energy = (layout.bases(face) ** 2).sum(axis=(1, 2))
    moving = energy > 1e-4 * np.median(energy[energy > 0])
    time = start_s + np.arange(len(displacements)) / rate
    movements = []
    for window in shown:
        frames = np.flatnonzero((time >= window.start_s) & (time <= window.end_s))
        moved = [base for base in map(face.names.index, window.bases) if moving[base]]
        movement = _from_rest(displacements[frames]) if len(frames) >= 10 and moved else None
        if movement is not None:
            movements.append((frames, moved, movement))
    if not movements:
        raise SignfaceError(
            "no window of the calibration lies in the take and shows a base that moves its markers",
            hint="its times are seconds on the take's own clock",
        )
    return movements


def _learn(movements: Sequence[Movement], bases: np.ndarray, length: int, rate: float, prior: float) -> np.ndarray:
    """(N, P, 3) bases of the signer from movements in a take of so many frames, strengths and bases in turns."""
    energy = (bases**2).sum(axis=(1, 2))
    signers, learnt = bases.copy(), sorted({base for _, moved, _ in movements for base in moved})
    for _ in range(ROUNDS):
        weights = np.full((length, len(bases)), np.nan)
        known = np.full((length, *bases.shape[1:]), np.nan)
        for frames, moved, movement in movements:
            columns = signers[moved].reshape(len(moved), -1).T
            weights[frames] = 0.0
            rows = np.nan_to_num(movement).reshape(len(movement), -1)
            solved = np.linalg.lstsq(columns, rows.T, rcond=None)[0].T
            weights[frames[:, None], moved] = np.clip(solved, 0.0, STRONGEST)
            known[frames] = movement
        signers = calibrate(known, weights, bases, rate=rate, prior=prior)
        for base in learnt:
            along = float((signers[base] * bases[base]).sum() / energy[base])
            alike = along * np.sqrt(energy[base]) / max(float(np.linalg.norm(signers[base])), 1e-12)
            signers[base] = signers[base] / along if alike > ALIKE else bases[base]
    return signers


def _from_rest(displacements: np.ndarray) -> np.ndarray | None:
    """Displacements from the straight line between the rest at both ends; None where a marker is not seen at rest."""
    rest = max(2, round(REST_SHARE * len(displacements)))
    ends = [displacements[:rest], displacements[-rest:]]
    if any(not np.isfinite(end).any(axis=0).all() for end in ends):
        return None
    before, after = (np.nanmedian(end, axis=0) for end in ends)
    share = np.linspace(0.0, 1.0, len(displacements))[:, None, None]
    return displacements - (1.0 - share) * before - share * after
