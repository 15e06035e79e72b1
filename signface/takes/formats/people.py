"""Several people in one film: who is who from frame to frame, by where their faces are.

- `followed`: landmarks of people who stay themselves.
- `RIVAL`: how much a person must be seen to be a signer.
"""

from __future__ import annotations

import numpy as np

#: A person is a signer where seen in at least this part of the frames in which the one seen most is: others pass by.
RIVAL = 0.25

#: A face that appears further from where a person was last seen, in widths of the face, is somebody else: a face moves
#: less from frame to frame, and over longer gaps people hardly leave their places.
FARTHEST = 1.5


def followed(data: np.ndarray, confidence: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Landmarks by person, where trackers change the order of people from frame to frame.

    In each frame faces go to the people whose last place they are nearest to, all of them at the least total distance
    (the assignment problem); one farther than `FARTHEST` from everybody is a new person.

    Parameters
    ----------
    data : (F, P, N, D) array
        Landmarks by index; x and y first.
    confidence : (F, P, N) array
        0 where a landmark was not seen.

    Returns
    -------
    (F, Q, N, D) array, (F, Q, N) array, list of str
        By person, those who appear first from left to right, and notes for the history.
    """
    if data.shape[1] == 1:
        return data, confidence, []
    from scipy.optimize import linear_sum_assignment

    seen = (confidence > 0) & np.isfinite(data[..., :2]).all(axis=-1) & (np.abs(data[..., :2]).max(axis=-1) > 0)
    shown = seen.any(axis=2)
    count = np.maximum(seen.sum(axis=2), 1)[..., None]
    places = np.where(seen[..., None], data[..., :2], 0).sum(axis=2) / count
    spread = np.sqrt(
        (np.where(seen[..., None], data[..., :2] - places[:, :, None], 0) ** 2).sum(axis=(2, 3)) / count[..., 0]
    )
    width = 3 * float(np.median(spread[shown])) if shown.any() else 0.0  # a face spreads by a third of its width
    points = np.where(seen[..., None], data[..., :2], np.nan)
    last: list[np.ndarray] = []
    person_of = np.full(shown.shape, -1)
    far = 1e3 * FARTHEST * max(width, 1e-9)
    for frame in np.flatnonzero(shown.any(axis=1)):
        here = sorted(np.flatnonzero(shown[frame]), key=lambda index: places[frame, index, 0])
        new = list(here)
        if last:
            apart = np.linalg.norm(points[frame, here][:, None] - np.array(last)[None], axis=3)
            known = np.isfinite(apart)  # landmarks that both show
            mean = np.where(known, apart, 0).sum(axis=2) / np.maximum(known.sum(axis=2), 1)
            mean = np.minimum(np.where(known.any(axis=2), mean, far), far)
            for row, person in zip(*linear_sum_assignment(mean), strict=True):
                if mean[row, person] <= FARTHEST * width:
                    index = here[row]
                    person_of[frame, index] = person
                    last[person] = np.where(seen[frame, index][:, None], points[frame, index], last[person])
                    new.remove(index)
        for index in new:
            person_of[frame, index] = len(last)
            last.append(points[frame, index])
    people = max(len(last), 1)
    out = np.full((len(data), people, *data.shape[2:]), np.nan)
    sure = np.zeros((len(data), people, data.shape[2]))
    frames, indices = np.nonzero(person_of >= 0)
    out[frames, person_of[frames, indices]] = data[frames, indices]
    sure[frames, person_of[frames, indices]] = confidence[frames, indices]
    moved = int((person_of != np.arange(shown.shape[1]))[shown].sum())
    return (
        out,
        sure,
        [f"followed {people} people by their places; the index of {moved} faces was another's"] if moved else [],
    )
