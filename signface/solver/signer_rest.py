"""Where a signer's face rests, from all of their takes of landmarks.

- `signer_rest`: the median face, the head's motion taken away.
- `learn_signer`: the signer with rest and level, and the takes solved by them.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.settings.solve import SolveSettings
from signface.signer import Signer
from signface.signer_level import SignerRest
from signface.solver.solving import face_and_layout, solve
from signface.takes.recording import Recording
from signface.takes.rigid import apply, inverse, rigid_transforms
from signface.takes.selecting import selected

#: Frames looked at over all takes.
FRAMES = 6000
#: The median face and the head's poses are found from one another so many times.
TURNS = 5


def signer_rest(recordings: Sequence[Recording], layout: MarkerLayout) -> SignerRest:
    """The median of the landmarks over all takes of a signer, the head's motion taken away by the head markers.

    The median, not the stillest stretch: a signer asks questions with raised brows that are held still.

    Parameters
    ----------
    recordings : sequence of Take or TakeFile
        Of one signer, millimetres; NaN where a landmark is missing.
    layout : MarkerLayout

    Returns
    -------
    SignerRest
        In the place of the head that is the median one's.

    Raises
    ------
    SignfaceError
        There is no take, or fewer than three head markers are seen together.

    Examples
    --------
    >>> import signface as sf
    >>> layout = sf.read_layout("default-40", sf.read_face())
    >>> rest = signer_rest([sf.datasets.mini_take()], layout)
    >>> rest.places.shape, rest.takes
    ((46, 3), 1)
    """
    if not recordings:
        raise SignfaceError("there is no take of the signer to find their rest in")
    labels = [label for label in layout.labels if all(label in one.labels for one in recordings)]
    head = np.array([label in layout.head_labels for label in labels])
    step = max(1, sum(one.n_frames for one in recordings) // FRAMES)
    parts = []
    for one in recordings:
        columns = [one.labels.index(label) for label in labels]
        parts.append(one.frames(0, one.n_frames, step)[:, columns])
    frames = np.concatenate(parts)
    seen = np.isfinite(frames[..., 0])
    usable = seen[:, head].sum(axis=1) >= 3
    if head.sum() < 3 or not usable.any():
        raise SignfaceError("fewer than three head markers are seen", file=recordings[0].name)
    frames, seen = frames[usable], seen[usable]
    places = frames[np.argmax(seen.sum(axis=1))]
    known = np.isfinite(places[:, 0])
    for _ in range(TURNS):
        carriers = head & known
        trust = seen[:, carriers].astype(float)
        poses = rigid_transforms(places[carriers], np.nan_to_num(frames[:, carriers]), trust)
        moved = apply(inverse(poses), frames)[trust.sum(axis=1) >= 3]
        with np.errstate(all="ignore"):
            places = np.nanmedian(moved, axis=0)
        known = np.isfinite(places[:, 0])
    places = _usual_place(places, poses[trust.sum(axis=1) >= 3])
    kept = [label for label, here in zip(labels, known, strict=True) if here]
    return SignerRest(tuple(kept), places[known], len(recordings))


def _usual_place(places: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """The places of a face as the head is held on the average, so that poses are measured from there."""
    from scipy.spatial.transform import Rotation

    usual = np.eye(4)
    usual[:3, :3] = Rotation.from_matrix(poses[:, :3, :3]).mean().as_matrix()
    middle = np.nanmean(places, axis=0)
    there = np.median(apply(poses, middle[None, None])[:, 0], axis=0)
    usual[:3, 3] = there - usual[:3, :3] @ middle
    return apply(usual[None], places[None])[0]


def learn_signer(
    recordings: Iterable[Callable[[], Recording | Descriptors]],
    settings: SolveSettings | None = None,
    signer: Signer | None = None,
) -> tuple[Signer, list[Descriptors | None]]:
    """A signer with the rest and the level of all of their takes, and these takes solved from that rest.

    Landmarks have a rest; markers, which are glued on anew each time, and weights have a level only.

    Parameters
    ----------
    recordings : iterable of callables
        Each opens a take; called up to twice, so that not all lie in memory.
    settings, signer : optional
        As of `signface.solve`; a rest that is known stays.

    Returns
    -------
    Signer, list of Descriptors or None
        None for a take that cannot be solved.

    Raises
    ------
    SignfaceError
        None of the takes can be solved.
    """
    settings = SolveSettings() if settings is None else settings
    signer = Signer() if signer is None else signer
    openers = list(recordings)
    if signer.rest is None and settings.neutral == "auto":
        landmarks, layout = [], None
        for opener in openers:
            with contextlib.suppress(SignfaceError):  # said when it is solved
                recording = selected(opener(), settings)
                if isinstance(recording, Descriptors):
                    continue
                _, found = face_and_layout(recording.labels, settings)
                if found.of_landmarks:
                    landmarks.append(recording)
                    layout = found
        if layout is not None:
            signer = replace(signer, rest=signer_rest(landmarks, layout))
    solved: list[Descriptors | None] = []
    problem = SignfaceError("there is no take of the signer")
    for opener in openers:
        try:
            solved.append(solve(opener(), settings=settings, signer=signer))
        except SignfaceError as error:
            problem = error
            solved.append(None)
    whole = [take for take in solved if take is not None]
    if not whole:
        raise problem
    return signer.with_level(whole), solved
