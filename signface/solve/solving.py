"""A take to descriptors: the whole way from markers to weights.

- `solve_take`: the whole way.
- `prepare_take`: its first half, marker displacements on the avatar; every solver starts from these.
- `neutral_markers`: where each face marker stands in the neutral frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.solve.adaptation import MorphologicalAdaptation, SimilarityAdaptation, make_adaptation
from signface.solve.methods import make_solver
from signface.solve.resting import resting_time
from signface.solve.solver import Solution
from signface.takes.filtering import CUTOFF_HZ, lowpass
from signface.takes.gaps import LONG_S, SHORT_S, fill_gaps
from signface.takes.labels import rename_to
from signface.takes.stabilisation import align_neutral, stabilise
from signface.takes.take import Take

#: The neutral place of a marker is its median within this time of the neutral frame (s): one frame's jitter would
#: otherwise be carried into every frame of the take.
NEUTRAL_WINDOW_S = 0.05


@dataclass(frozen=True)
class PreparedTake:
    """A take brought to the avatar, ready to be solved.

    Parameters
    ----------
    displacements : (F, P, 3) array
        Displacements of the face markers from their neutral places (eq. 5.21), adapted to the avatar, millimetres;
        NaN where a marker is missing.
    layout : MarkerLayout
        The given layout without the markers that the neutral frame does not show; `displacements` follows it.
    head : (F, 4, 4) array
        Poses of the head.
    adaptation : SimilarityAdaptation or MorphologicalAdaptation
        From the signer's face, in its neutral pose, to the avatar's.
    take : Take
        The cleaned take.
    note : str
        What was done, for the history.
    """

    displacements: np.ndarray
    layout: MarkerLayout
    head: np.ndarray
    adaptation: SimilarityAdaptation | MorphologicalAdaptation
    take: Take
    note: str

    def described(self, face: FaceModel, solution: Solution, *notes: str) -> Descriptors:
        """The descriptors of the take, from what a solver made of its displacements; `notes` end the history."""
        return Descriptors(
            weights=solution.weights,
            names=face.names,
            rate=self.take.rate,
            start=self.take.start,
            residual=solution.residual,
            head=self.head,
            name=self.take.name,
            history=(*self.take.history, *notes),
        )


def prepare_take(
    take: Take,
    face: FaceModel,
    layout: MarkerLayout,
    *,
    neutral: str | float = "auto",
    adaptation: str = "similarity",
    short_gap_s: float = SHORT_S,
    long_gap_s: float = LONG_S,
    cutoff_hz: float = CUTOFF_HZ,
    filter_method: str = "butterworth",
    head_fallback: str | None = None,
) -> PreparedTake:
    """Clean a take, take the head's motion away and adapt it to the avatar (Reverdy 2019, 5.2.1 and 5.2.2).

    Parameters and errors are those of `solve_take`.
    """
    known = rename_to(take, layout.labels)
    clean = lowpass(fill_gaps(known, short_s=short_gap_s, long_s=long_gap_s), cutoff_hz=cutoff_hz, method=filter_method)
    labels = [label for label in layout.face_labels if label in clean.labels]
    head = [label for label in layout.head_labels if label in clean.labels]
    if neutral == "auto":
        time = resting_time(clean, face, layout, adaptation=adaptation)
        found = "found"
    else:
        time, found = float(neutral), "given"
    clean.frame_at(time)
    shown, places = neutral_markers(clean, labels, time)
    if len(shown) < 4:
        raise SignfaceError(
            f"only {len(shown)} face markers are seen at the neutral time {time:.3f} s",
            file=take.name,
            hint="give another neutral time: --neutral SECONDS",
        )
    part = layout.restricted([*shown, *head])
    target = part.points(face, shown)
    aligned = align_neutral(clean, shown, target, time)
    still, poses = stabilise(aligned, head=head, neutral_s=time, fallback=head_fallback)
    _, places = neutral_markers(still, shown, time)
    mapping = make_adaptation(adaptation, places, target)
    dropped = [label for label in layout.face_labels if label not in shown]
    note = f"neutral frame {found} at {time:.3f} s; adapted to {face.name}"
    note += f" ({mapping.description}) by {len(shown)} markers of {layout.name}"
    note += f" without {', '.join(dropped[:5])}{' ...' * (len(dropped) > 5)}" if dropped else ""
    # Against the adapted neutral, not the avatar's: where the map passes by the markers, rest must still be rest.
    displacements = mapping.transform(still.select(shown)) - mapping.transform(places)
    return PreparedTake(displacements, part, poses, mapping, still, note)


def solve_take(
    take: Take,
    face: FaceModel,
    layout: MarkerLayout,
    *,
    neutral: str | float = "auto",
    adaptation: str = "similarity",
    method: str = "thin-shell",
    alpha: float | None = None,
    short_gap_s: float = SHORT_S,
    long_gap_s: float = LONG_S,
    cutoff_hz: float = CUTOFF_HZ,
    filter_method: str = "butterworth",
    head_fallback: str | None = None,
) -> Descriptors:
    """Blendshape weights of a take (Reverdy 2019, 5.2).

    Parameters
    ----------
    take : Take
        As it was read; markers in any place of the room.
    face : FaceModel
        The avatar.
    layout : MarkerLayout
        Where the markers stand on the avatar, and which of them carry the head.
    neutral : float or "auto"
        Time in seconds of a frame with a neutral face; `auto` looks for one.
    adaptation : str
        `similarity` or `rbf` (the thesis's), see `signface.solve.adaptation`.
    method, alpha
        See `signface.solve.methods.make_solver`.
    short_gap_s, long_gap_s : float
        Longest gaps that are filled (seconds), see `signface.takes.gaps.fill_gaps`.
    cutoff_hz, filter_method
        See `signface.takes.filtering.lowpass`.
    head_fallback : str, optional
        `least-moving`: carry the head by the least-moving markers where head markers do not suffice.

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
    prepared = prepare_take(
        take,
        face,
        layout,
        neutral=neutral,
        adaptation=adaptation,
        short_gap_s=short_gap_s,
        long_gap_s=long_gap_s,
        cutoff_hz=cutoff_hz,
        filter_method=filter_method,
        head_fallback=head_fallback,
    )
    solution = make_solver(method, face, prepared.layout, alpha=alpha).solve(prepared.displacements)
    note = f"{prepared.note}; solve {method}" + (f" alpha={alpha:g}" if alpha is not None else "")
    return prepared.described(face, solution, note)


def neutral_markers(take: Take, labels: list[str], neutral_s: float) -> tuple[list[str], np.ndarray]:
    """The markers that are seen around the neutral time, and their median places.

    Returns
    -------
    (list of str, (K, 3) array)
        Labels in the order given, and places in millimetres.
    """
    frame = take.frame_at(neutral_s)
    reach = int(NEUTRAL_WINDOW_S * take.rate)
    window = take.select(labels)[max(0, frame - reach) : frame + reach + 1]
    seen = np.isfinite(window[..., 0]).any(axis=0)
    places = np.nanmedian(window[:, seen], axis=0)
    return [label for label, here in zip(labels, seen, strict=True) if here], places
