"""`curves_table`: what moves in a take, as curves for a viewer or a figure: energies, confidence, weights, residual."""

from __future__ import annotations

import numpy as np
import pandas as pd

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.segmentation.energy import energies
from signface.segmentation.segments import Segments

#: Rows per second: a whole number of milliseconds apart, as ELAN wants it.
CURVES_RATE = 100

#: Curve and the bases whose mean weight it is; it appears where the face has any of them.
WEIGHT_CURVES = {
    "brows_up": ("browInnerUp", "browOuterUpLeft", "browOuterUpRight"),
    "brows_down": ("browDownLeft", "browDownRight"),
    "lids_closed": ("eyeBlinkLeft", "eyeBlinkRight"),
    "lip_corners_up": ("mouthSmileLeft", "mouthSmileRight"),
    "lip_corners_down": ("mouthFrownLeft", "mouthFrownRight"),
    "jaw_open": ("jawOpen",),
}

#: How many weights stand in their place for a face whose bases have other names: those that move most.
OTHER_WEIGHTS = 6


def curves_table(descriptors: Descriptors, segments: Segments) -> pd.DataFrame:
    """Curves of a take, every 10 ms.

    Parameters
    ----------
    descriptors : Descriptors
        At least three frames.
    segments : Segments
        The confidence of each is drawn over its duration; missing between segments and where there is none.

    Returns
    -------
    DataFrame
        `time_s` (multiples of 0.01 from 0 or the take's start, whichever is later), `velocity_energy`,
        `acceleration_energy`, `confidence`, a few weights, `residual_mm`.

    Raises
    ------
    SignfaceError
        The take has fewer than three frames or ends before time 0.
    """
    first = max(0, int(np.ceil(descriptors.start * CURVES_RATE - 1e-6)))
    last = int(np.floor(descriptors.time[-1] * CURVES_RATE + 1e-6))
    if last < first:
        raise SignfaceError(f"{descriptors.name}: the take ends before time 0", hint="mend its start_s")
    time = np.arange(first, last + 1) / CURVES_RATE
    energy = energies(descriptors)
    columns = {
        "time_s": time,
        "velocity_energy": np.interp(time, energy.time, energy.velocity),
        "acceleration_energy": np.interp(time, energy.time, energy.acceleration),
        "confidence": _confidence(time, segments),
    }
    for name, bases in _weight_curves(descriptors).items():
        mean = np.mean([descriptors.weight(base) for base in bases], axis=0)
        columns[name] = np.interp(time, descriptors.time, mean)  # NaN stays NaN around a frame without weights
    assert descriptors.residual is not None
    columns["residual_mm"] = np.interp(time, descriptors.time, descriptors.residual)
    return pd.DataFrame(columns)


def _confidence(time: np.ndarray, segments: Segments) -> np.ndarray:
    """(K,) confidence of the segment that each time lies in, NaN outside segments."""
    table = segments.table
    values = np.full(len(time), np.nan)
    if "confidence" not in table.columns or not len(table):
        return values
    start, end = table["start_s"].to_numpy(float), table["end_s"].to_numpy(float)
    segment = np.searchsorted(start, time + 1e-9, side="right") - 1
    inside = (segment >= 0) & (time < end[segment.clip(min=0)] - 1e-9)
    values[inside] = table["confidence"].to_numpy(float)[segment[inside]]
    return values


def _weight_curves(descriptors: Descriptors) -> dict[str, tuple[str, ...]]:
    """Curve and the bases it is the mean of: those of `WEIGHT_CURVES`, or the bases that move most."""
    known = {
        name: present
        for name, bases in WEIGHT_CURVES.items()
        if (present := tuple(base for base in bases if base in descriptors.names))
    }
    if known:
        return known
    spread = np.nan_to_num(np.nanstd(descriptors.weights, axis=0))
    most = sorted(np.argsort(-spread, kind="stable")[:OTHER_WEIGHTS])
    return {descriptors.names[index]: (descriptors.names[index],) for index in most}
