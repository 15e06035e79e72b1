"""OpenFace CSV: the action units as weights, with the head's pose.

- `read_action_units`: for tables that hold nothing else, and for others with `--as aus`.
"""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path

import numpy as np

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.takes.formats.openface_table import SIGNS, is_openface, read_table
from signface.takes.formats.registry import FileHead, register_format

POSE = ("pose_Rx", "pose_Ry", "pose_Rz", "pose_Tx", "pose_Ty", "pose_Tz")
#: OpenFace's intensities go from 0 to this.
FULL_INTENSITY = 5.0
_UNIT = re.compile(r"AU\d\d_[rc]")


def _unit_certainty(head: FileHead) -> float:
    return 0.9 * is_openface(head.cells)


@register_format(
    "aus",
    title="OpenFace action units",
    written_by="OpenFace 2 with action units; a table of them alone, or any with --as aus",
    endings=(".csv",),
    recognise=_unit_certainty,
    holds="weights",
    chooses_subject=True,
)
def read_action_units(path: str | PathLike[str], *, unit: str | None = None, subject: str | None = None) -> Descriptors:
    """Read the action units of an OpenFace table as weights, and the head's pose where it is there.

    The intensity `AU01_r` (0 to 5), divided by 5, becomes the weight `AU01`. Whether a unit is there at all (`AU28_c`,
    0 or 1) stands for units without an intensity.

    Parameters
    ----------
    path : path
    unit : str, optional
        Not used: action units have no unit of length.
    subject : str, optional
        The number of the face, of several.

    Raises
    ------
    SignfaceError
        As `read_openface`, or there are no action units.
    """
    del unit
    file = Path(path)
    table = read_table(file, subject)
    there = [name for name in table.columns if _UNIT.fullmatch(name)]
    columns = [name for name in there if name.endswith("_r") or f"{name[:4]}_r" not in there]
    if not columns:
        raise SignfaceError(
            "has neither 3-D landmarks (X_0, ...) nor action units (AU01_r, ...)",
            file=file,
            hint="run OpenFace with -3Dfp or -aus",
        )
    weights = table.place(columns) / [FULL_INTENSITY if name.endswith("_r") else 1.0 for name in columns]
    present = set(POSE) <= set(table.columns)
    return Descriptors(
        weights,
        tuple(name[:4] for name in columns),
        table.rate,
        start=table.start,
        head=_poses(table.place(list(POSE))) if present else None,
        name=file.stem,
        history=(f"read {file.name} (OpenFace action units, {table.rate:.4g} Hz)", *table.notes),
    )


def _poses(values: np.ndarray) -> np.ndarray:
    """(F, 4, 4) poses in our axes from (F, 6) angles (radians, about x, then the turned y and z) and places (mm)."""
    from scipy.spatial.transform import Rotation

    poses = np.full((len(values), 4, 4), np.nan)
    known = np.isfinite(values).all(axis=1)
    turned = Rotation.from_euler("XYZ", values[known, :3]).as_matrix()
    poses[known] = np.eye(4)
    poses[known, :3, :3] = SIGNS[:, None] * turned * SIGNS
    poses[known, :3, 3] = values[known, 3:] * SIGNS
    return poses
