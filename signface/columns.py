"""What the columns of a table of weights are called, and a head's pose in plain numbers.

- `base_column`, `base_of`: the column of a base, and the base of a column.
- `pose_columns`: poses as three millimetres and three degrees.
- `poses_of`: the way back.
- `joined_sides`: names of bases in few words.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from signface.errors import SignfaceError

TIME, RESIDUAL = "time_s", "residual_mm"

#: A pose in plain numbers: where the origin of the neutral head goes, and the rotation vector (its direction is the
#: axis, its length the angle).
POSE = ("head_x_mm", "head_y_mm", "head_z_mm", "head_rx_deg", "head_ry_deg", "head_rz_deg")

#: A pose to the last bit: the matrix, row by row.
POSE_MATRIX = tuple(f"head_{row}{column}" for row in range(4) for column in range(4))

#: What a store says of a take in each of its rows.
WORDS = ("take", "signer", "kind")

DEVIATION = "sd:"
_TAKEN = {TIME, RESIDUAL, *POSE, *POSE_MATRIX, *WORDS}


def base_column(base: str) -> str:
    """Name of the column of a base: its own, but for `base:NAME` where that is taken.

    Examples
    --------
    >>> base_column("jawOpen"), base_column("time_s")
    ('jawOpen', 'base:time_s')
    """
    return f"base:{base}" if base in _TAKEN or base.startswith(("base:", DEVIATION)) else base


def base_of(column: str) -> str:
    """The base of a column of `base_column`."""
    return column.removeprefix("base:")


def joined_sides(names: Sequence[str]) -> str:
    """Names of bases in few words: `*` stands for Left and Right where both are there.

    Examples
    --------
    >>> joined_sides(["eyeBlinkLeft", "eyeBlinkRight", "jawLeft"])
    'eyeBlink*, jawLeft'
    """
    words: list[str] = []
    for name in names:
        stem = name.removesuffix("Left").removesuffix("Right")
        both = stem != name and {f"{stem}Left", f"{stem}Right"} <= set(names)
        words.append(f"{stem}*" if both else name)
    return ", ".join(dict.fromkeys(words))


def pose_columns(poses: np.ndarray) -> dict[str, np.ndarray]:
    """(F,) numbers under each name of `POSE`; NaN where a pose is unknown.

    Parameters
    ----------
    poses : (F, 4, 4) array
        Rigid motions, millimetres.

    Raises
    ------
    SignfaceError
        A pose is no rigid motion.

    Examples
    --------
    >>> nod = np.array([[1.0, 0, 0, 0], [0, 0, -1, 5], [0, 1, 0, 0], [0, 0, 0, 1]])
    >>> {name: float(values[0].round(6)) for name, values in pose_columns(nod[None]).items()}
    {'head_x_mm': 0.0, 'head_y_mm': 5.0, 'head_z_mm': 0.0, 'head_rx_deg': 90.0, 'head_ry_deg': 0.0, 'head_rz_deg': 0.0}
    """
    from scipy.spatial.transform import Rotation

    numbers = np.full((len(poses), 6), np.nan)
    known = np.isfinite(poses).all(axis=(1, 2))
    turned = poses[known, :3, :3]
    square = np.matmul(turned, turned.transpose(0, 2, 1))
    if np.abs(square - np.eye(3)).max(initial=0) > 1e-6 or (np.linalg.det(turned) < 0).any():
        raise SignfaceError("poses of the head are no rigid motions", hint="write the weights as .parquet")
    if len(turned):
        numbers[known, :3] = poses[known, :3, 3]
        numbers[known, 3:] = Rotation.from_matrix(turned).as_rotvec(degrees=True)
    return dict(zip(POSE, numbers.T, strict=True))


def poses_of(columns: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """(F, 4, 4) poses from the columns of `POSE` or of `POSE_MATRIX`; None where neither are there."""
    if all(name in columns for name in POSE_MATRIX):
        return np.stack([columns[name] for name in POSE_MATRIX], axis=1).reshape(-1, 4, 4)
    if not all(name in columns for name in POSE):
        return None
    from scipy.spatial.transform import Rotation

    numbers = np.stack([columns[name] for name in POSE], axis=1)
    poses = np.full((len(numbers), 4, 4), np.nan)
    known = np.isfinite(numbers).all(axis=1)
    if known.any():
        poses[known] = np.eye(4)
        poses[known, :3, :3] = Rotation.from_rotvec(numbers[known, 3:], degrees=True).as_matrix()
        poses[known, :3, 3] = numbers[known, :3]
    return poses
