"""Do the markers of a take lie where its layout says? Labels alone cannot tell.

Two marker sets may share their labels: numbers from 0 are OpenFace's 68 landmarks in one laboratory's tables and 68 of
MediaPipe's 468 in another's. And a recording may be a mirror image, left and right still named as they were.

- `check_fit`: refuses markers that lie elsewhere, or mirrored.
- `check_take`: the same for a take and a layout.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.takes.labels import match_labels
from signface.takes.recording import Recording
from signface.takes.take import columns_of

#: Fewer markers than this tell nothing.
FEWEST = 8

#: Markers that miss their places by more than this part of the layout's own radius are others. Heads of 26 real signers
#: miss them by 0.1 to 0.25 (the most where depths are a Kinect's); other markers of the same names by 0.9.
FARTHEST = 0.5

#: A take is mirrored where its mirror image misses by less than this part of what it misses by itself. (Mirrored takes
#: have 0.15 to 0.3, with a Kinect's depths 0.7; flat faces, of a picture without depth, have 1.)
MIRRORED = 0.8

#: Frames that are looked at for the fullest one.
SAMPLE = 200


def misfit(places: np.ndarray, points: np.ndarray) -> tuple[float, float]:
    """How far markers miss their places on a face, turned, moved and scaled as is best.

    Parameters
    ----------
    places, points : (M, 3) array
        Where markers are, in any place and unit, and where they stand on the face, millimetres.

    Returns
    -------
    (float, float)
        Root mean square distances as parts of that of the points from their middle: as the markers are, and mirrored.

    Examples
    --------
    >>> points = np.array([[0.0, 0, 0], [90, 0, 0], [0, 70, 0], [0, 0, 50]])
    >>> [round(part, 3) for part in misfit(2 * points + 5, points)]
    [0.0, 0.55]
    """
    here, there = places - places.mean(axis=0), points - points.mean(axis=0)
    left, singular, right = np.linalg.svd(there.T @ here)
    proper = np.sign(np.linalg.det(left @ right)) or 1.0
    size, goal = (here**2).sum(), (there**2).sum()
    parts = []
    for sign in (proper, -proper):
        along = float((singular * (1.0, 1.0, sign)).sum())
        parts.append(float(np.sqrt(max(0.0, 1 - along**2 / max(size * goal, 1e-300)))))
    return parts[0], parts[1]


def check_fit(places: np.ndarray, points: np.ndarray, layout: str, labels: Sequence[str] = ()) -> None:
    """Refuse markers that do not lie as a layout says.

    Parameters
    ----------
    places, points : (M, 3) array
        As for `misfit`; markers that are missing (NaN) are passed over, and fewer than eight are not judged.
    layout : str
        Its name.
    labels : sequence of str
        Of the markers, for the hint.

    Raises
    ------
    SignfaceError
        The markers are others of the same names, or their mirror image.
    """
    seen = np.isfinite(places).all(axis=1)
    if seen.sum() < FEWEST:
        return
    places, points = places[seen], points[seen]
    straight, mirrored = misfit(places, points)
    radius = float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean()))
    if min(straight, mirrored) > FARTHEST:
        bare = bool(labels) and all(label.isdecimal() for label in labels)
        numbered = " (MediaPipe's landmarks are called 0 to 467, OpenFace's L0 to L67)" * bare
        raise SignfaceError(
            f"its markers have names of the layout {layout} and lie elsewhere: {straight * radius:.0f} mm from their "
            f"places, on a face of {radius:.0f} mm about its middle",
            hint="give the layout of these markers: --layout FILE; signface layout suggest proposes one" + numbered,
        )
    if mirrored < MIRRORED * straight and mirrored < FARTHEST:
        raise SignfaceError(
            f"is a mirror image: its markers lie {straight * radius:.0f} mm from their places in the layout {layout}, "
            f"and mirrored {mirrored * radius:.0f} mm",
            hint="give all x the other sign, or exchange left and right in the names of the markers",
        )


def check_take(take: Recording, layout: MarkerLayout, face: FaceModel) -> None:
    """Refuse a take whose markers do not lie as the layout says, by one frame that shows most of them.

    Raises
    ------
    SignfaceError
        As `check_fit`; the message names the take.

    Examples
    --------
    >>> import signface as sf
    >>> face, take = sf.read_face(), sf.datasets.mini_take()
    >>> layout = sf.choose_layout(take.labels, face)
    >>> check_take(take, layout, face)
    >>> check_take(take.changed("mirrored", positions=take.positions * [-1, 1, 1]), layout, face)
    Traceback (most recent call last):
    signface.errors.SignfaceError: M2_EU_04: is a mirror image: its markers lie 50 mm from their places in the layout
    default-40, and mirrored 4 mm. Give all x the other sign, or exchange left and right in the names of the markers
    """
    matches = match_labels(take.labels, layout.labels)
    if len(matches) < FEWEST:
        return
    frames = take.frames(0, take.n_frames, max(1, take.n_frames // SAMPLE))[:, columns_of(take, list(matches.values()))]
    fullest = int(np.argmax(np.isfinite(frames[..., 0]).sum(axis=1)))
    try:
        check_fit(frames[fullest], layout.points(face, list(matches)), layout.name, list(matches))
    except SignfaceError as error:
        raise error.at(Path(take.name)) from error
