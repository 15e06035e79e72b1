"""What tells that an expression changes, whichever it is: movement by region of the face, and how it ends.

- `boundary_features`: what a boundary detector sees of each frame.
- `REGIONS`: the regions and their bases.

Nothing here says which expression is shown, and everything is measured against the take's own level, so that what is
learnt from some signers holds for others.
"""

from __future__ import annotations

import numpy as np

from signface.descriptors import Descriptors
from signface.frames import Means
from signface.segmentation.energy import bridged

#: Region: how the names of its bases begin (ARKit's names). Blinks and the mouth that talks stand apart from the rest.
REGIONS = {
    "brows": ("brow",),
    "eyes": ("eyeSquint", "eyeWide"),
    "lids": ("eyeBlink",),
    "nose": ("noseSneer", "cheekSquint"),
    "corners": ("mouthSmile", "mouthFrown", "mouthStretch", "mouthDimple"),
    "lips": ("mouthUpperUp", "mouthLowerDown"),
    "mouth": ("jaw", "mouthClose", "mouthFunnel", "mouthPucker", "mouthRoll", "mouthShrug", "mouthPress"),
}

#: Regions that talk and blink rather than express.
BUSY = ("lids", "mouth")

#: Windows before and after a frame whose means are compared: distance of the nearer and the further end (s).
WINDOWS_S = ((0.0, 0.12), (0.04, 0.3), (0.12, 0.6), (0.3, 0.7))

#: Distances at which a movement should have begun before the frame and ended after it (s).
REACHES_S = (0.2, 0.4, 0.6)

#: Moments around a frame at which the speed is taken (s).
MOMENTS_S = tuple(round(-0.4 + 0.08 * step, 2) for step in range(11))

#: Distances below this (in shares of the take's level) are as good as none.
LITTLE = 0.1


def boundary_features(descriptors: Descriptors, times: np.ndarray) -> np.ndarray:
    """(K, features) movement around each time, for each region, for all that express, and for the whole face.

    For each of them: how far the means after and before differ over several windows (a movement that stays, unlike a
    blink); how far the frame is from what comes just before and after; how much of the way from before to after is
    done (0 to 1 in the course of a transition), and how long that way is; the speed at moments around the frame, and
    the speed at the frame as a share of the highest.

    A face without bases of these names has the whole face only, in every place.

    Parameters
    ----------
    descriptors : Descriptors
    times : (K,) array
        Seconds.
    """
    weights = bridged(descriptors)
    moved = np.linalg.norm(weights - np.median(weights, axis=0), axis=1)
    weights = weights / max(float(np.percentile(moved, 95)), 1e-6)
    regions = {
        region: [i for i, name in enumerate(descriptors.names) if name.startswith(beginnings)]
        for region, beginnings in REGIONS.items()
    }
    everything = list(range(weights.shape[1]))
    expressive = [i for region, columns in regions.items() if region not in BUSY for i in columns]
    groups = [columns or everything for columns in (*regions.values(), expressive, everything)]
    members = np.zeros((weights.shape[1], len(groups)))
    for place, columns in enumerate(groups):
        members[columns, place] = 1.0
    curves = _curves(Means(weights, descriptors.rate), times - descriptors.start, members)
    return np.stack(curves, axis=2).reshape(len(times), -1)


def _curves(means: Means, time: np.ndarray, members: np.ndarray) -> list[np.ndarray]:
    """The features of groups of bases, each (K, G); (N, G) `members` are 1 where a base belongs to a group."""

    def length(change: np.ndarray) -> np.ndarray:
        return np.sqrt(change**2 @ members)

    here = means.between(time - 0.03, time + 0.03)
    curves = []
    for near, far in WINDOWS_S:
        curves.append(length(means.between(time + near, time + far) - means.between(time - far, time - near)))
    for neighbour in (means.between(time - 0.16, time - 0.04), means.between(time + 0.04, time + 0.16)):
        curves.append(length(neighbour - here))
    for reach in REACHES_S:
        before = means.between(time - reach - 0.1, time - reach)
        way = means.between(time + reach, time + reach + 0.1) - before
        far_off = length(way)
        curves += [((here - before) * way) @ members / (far_off**2 + LITTLE**2), far_off]
    step = 0.06
    speed = np.stack(
        [
            length(
                means.between(time + moment, time + moment + step) - means.between(time + moment - step, time + moment)
            )
            / step
            for moment in MOMENTS_S
        ]
    )
    middle = len(MOMENTS_S) // 2
    share = speed[middle - 1 : middle + 2].mean(axis=0) / (speed.max(axis=0) + 2 * LITTLE)
    return [*curves, *speed, share]
