"""Which of the poses that a face rests in is the neutral one.

Stillness alone cannot tell: a signer who holds joy for four seconds rests in it longer than in the neutral face. But
measured from a face that is not neutral, half of what the face does is *negative* expression, which the bases cannot
show within their bounds. So each candidate is tried as the neutral frame on some frames of the take, and the one is
taken whose movements the avatar explains best.

On a synthetic corpus of 60 takes (seed 0, on which the constants were chosen) the skin at the chosen frame is 0.23 mm
RMS from neutral on average and 0.6 mm at worst, on 30 of another signer (seed 5) 0.24 and 0.6 mm; in the longest still
stretch near the median pose it is 0.38 and 1.9 mm, and 0.31 and 1.4 mm.
"""

from __future__ import annotations

import numpy as np

from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.solver.adaptation import make_adaptation
from signface.solver.displacements import neutral_places
from signface.solver.thin_shell import ThinShellSolver
from signface.takes.neutral import find_neutral, neutral_candidates
from signface.takes.rigid import apply, inverse, rigid_transforms
from signface.takes.take import Take

#: Frames on which a candidate is tried.
FRAMES = 60
#: A frame with so many times the energy of the most energetic tenth's least is left out: no face does that.
OUTLYING = 6.0


def resting_time(take: Take, face: FaceModel, layout: MarkerLayout, *, adaptation: str = "similarity") -> float:
    """Time of a neutral frame: of the poses in which the face rests, the one from which the avatar explains most.

    A candidate's score is the solver's energy over the mean squared displacement of the markers: the share of the
    movement that is left unexplained.

    Parameters
    ----------
    take : Take
        Cleaned.
    face : FaceModel
    layout : MarkerLayout
        Markers that the take does not have are passed over. With fewer than three head markers the choice is
        `signface.takes.neutral.find_neutral`'s.
    adaptation : str
        See `signface.solver.adaptation.make_adaptation`.

    Returns
    -------
    float
        Seconds, on the take's own clock.

    Raises
    ------
    SignfaceError
        No frame shows three markers.
    """
    labels = [label for label in layout.face_labels if label in take.labels]
    head = [label for label in layout.head_labels if label in take.labels]
    if len(head) < 3 or len(labels) < 4:
        return find_neutral(take, labels, head=head)
    candidates = neutral_candidates(take, labels, head=head)
    if len(candidates) == 1:
        return candidates[0]
    solver = ThinShellSolver(face, layout.restricted(labels))
    target = layout.points(face, labels)
    frames = np.unique(np.linspace(0, take.n_frames - 1, FRAMES).round().astype(int))
    skin, carried = take.select(labels), take.select(head)
    scores = []
    for time in candidates:
        (seen, rest), (carriers, neutral) = (neutral_places(take, names, time) for names in (labels, head))
        if len(seen) == len(labels) and len(carriers) == len(head):
            scores.append(_unexplained(solver, skin[frames], carried[frames], rest, neutral, target, adaptation))
        else:
            scores.append(np.inf)
    return candidates[int(np.argmin(scores))] if np.isfinite(scores).any() else candidates[0]


def _unexplained(
    solver: ThinShellSolver,
    skin: np.ndarray,
    carried: np.ndarray,
    rest: np.ndarray,
    neutral: np.ndarray,
    target: np.ndarray,
    adaptation: str,
) -> float:
    """Share of the movement that the avatar does not explain when `rest` is the neutral face; inf when unknown."""
    weights = np.isfinite(carried[..., 0]).astype(float)
    poses = rigid_transforms(neutral, np.nan_to_num(carried), weights)
    moved = apply(inverse(poses), skin)[weights.sum(axis=1) >= 3]
    onto = rigid_transforms(rest, target[None], np.ones((1, len(rest))))
    rest, moved = apply(onto, rest[None])[0], apply(np.repeat(onto, len(moved), axis=0), moved)
    mapping = make_adaptation(adaptation, rest, target)
    displacements = mapping.transform(moved) - mapping.transform(rest)
    solution = solver.solve(displacements)
    solved = np.isfinite(solution.weights).all(axis=1)
    if not solved.any():
        return np.inf
    energy = solver.energy(solution.weights[solved], displacements[solved])
    # One marker that is nowhere near the face, in one frame, must not outweigh all that the face does in the others.
    usual = energy <= OUTLYING * np.quantile(energy, 0.9)
    return float(energy[usual].mean() / max(np.nanmean(displacements[solved][usual] ** 2), 1e-12))
