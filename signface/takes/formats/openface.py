"""OpenFace CSV: the 68 landmarks of one camera, in millimetres, as markers.

- `read_openface`: the landmarks; `signface.takes.formats.openface_units` reads the action units.
- `true_positions`: what its perspective does to them undone.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from signface.errors import SignfaceError
from signface.takes.formats.openface_table import SIGNS, is_openface, read_table
from signface.takes.formats.registry import FileHead, register_format
from signface.takes.take import Take

LANDMARKS = 68
AXES = ("X", "Y", "Z")


def _landmark_certainty(head: FileHead) -> float:
    return 0.95 * (is_openface(head.cells) and {"X_0", "Y_0", "Z_0"} <= {cell.strip() for cell in head.cells})


def true_positions(landmarks: np.ndarray) -> np.ndarray:
    """Landmarks as rigid motion moves them, from those that OpenFace writes.

    OpenFace fits its model of a face by weak perspective, as if all points were as far away as the face is, and then
    writes each point along the ray that goes through its pixel. A turning head is thereby sheared: points that come
    nearer also come towards the middle of the picture. With the mean depth in place of each point's own, the shape is
    the fitted one again, to the rounding of the file.

    Parameters
    ----------
    landmarks : (F, 68, 3) array
        X, Y, Z in millimetres, in the camera's axes. Of a subset of landmarks, the mean depth is the subset's.

    Returns
    -------
    (F, 68, 3) array
        In the same axes.

    Examples
    --------
    >>> written = np.array([[[90.0, 0.0, 900.0], [110.0, 0.0, 1100.0]]])
    >>> true_positions(written)[0, :, 0]
    array([100., 100.])
    """
    depth = landmarks[:, :, 2:]
    with np.errstate(invalid="ignore", divide="ignore"):
        out = landmarks * (depth.mean(axis=1, keepdims=True) / depth)
    out[..., 2:] = depth
    return out


@register_format(
    "openface",
    title="OpenFace CSV",
    written_by="OpenFace 2 (FeatureExtraction), its 68 landmarks in millimetres",
    endings=(".csv",),
    recognise=_landmark_certainty,
    chooses_subject=True,
)
def read_openface(path: str | PathLike[str], *, unit: str | None = None, subject: str | None = None) -> Take:
    """Read the 3-D landmarks of an OpenFace table as a take; landmark 30 has the label `L30`.

    Frames of low confidence or without success are missing, of several faces the chosen one is taken, and uneven
    times are put on an even grid. What OpenFace's way of writing points does to a turning head is undone
    (`true_positions`). The pose of the head is in the landmarks.

    Parameters
    ----------
    path : path
    unit : str, optional
        Not used: the file is in millimetres.
    subject : str, optional
        The number of the face, of several.

    Raises
    ------
    SignfaceError
        A row is cut short or holds words, no face was found, landmarks lack coordinates, or the times do not rise.
    """
    del unit
    file = Path(path)
    table = read_table(file, subject)
    known = set(table.columns)
    numbers = [number for number in range(LANDMARKS) if f"X_{number}" in known]
    partial = [number for number in numbers if not {f"Y_{number}", f"Z_{number}"} <= known]
    if partial:
        raise SignfaceError(f"landmark {partial[0]} has not all of X, Y and Z", file=file, hint="export all columns")
    landmarks = np.stack([table.place([f"{axis}_{number}" for number in numbers]) for axis in AXES], axis=-1)
    if len(numbers) > 1:
        landmarks = true_positions(landmarks)
    return Take(
        landmarks * SIGNS,
        tuple(f"L{number}" for number in numbers),
        table.rate,
        start=table.start,
        name=file.stem,
        history=(
            f"read {file.name} (OpenFace, {table.rate:.4g} Hz)",
            "perspective of single points undone",
            *table.notes,
        ),
    )
