"""What a recording holds, before anything is done with it, as plain values.

- `describe_take`: frames, rate, unit, markers and gaps.
- `describe_weights`: the same of weights.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from signface.descriptors import Descriptors
from signface.takes.gaps import gap_runs
from signface.takes.take import Take


def describe_take(take: Take) -> dict[str, Any]:
    """What a take holds: `name, kind, frames, rate_hz, duration_s, start_s, unit_found, markers, gaps, history`.

    `gaps` has for each marker with gaps their number, `missing_s` in all and `longest_s`.

    Examples
    --------
    >>> import signface as sf
    >>> facts = describe_take(sf.datasets.mini_take("M1_IE_J"))
    >>> facts["rate_hz"], facts["unit_found"]
    (200.0, 'mm')
    """
    gaps = {}
    for label, stretches in gap_runs(take).items():
        if len(stretches):
            lengths = np.diff(stretches, axis=1).ravel()
            gaps[label] = {
                "gaps": len(lengths),
                "missing_s": round(float(lengths.sum()) / take.rate, 6),
                "longest_s": round(float(lengths.max()) / take.rate, 6),
            }
    return {
        **_timing(take, "markers"),
        "unit_found": next((entry.removeprefix("unit ") for entry in take.history if entry.startswith("unit")), "mm"),
        "markers": list(take.labels),
        "gaps": gaps,
        "history": list(take.history),
    }


def describe_weights(weights: Descriptors) -> dict[str, Any]:
    """What a file of weights holds: `name, kind, frames, rate_hz, duration_s, start_s, bases, history`."""
    return {**_timing(weights, "weights"), "bases": list(weights.names), "history": list(weights.history)}


def _timing(recording: Take | Descriptors, kind: str) -> dict[str, Any]:
    return {
        "name": recording.name,
        "kind": kind,
        "frames": recording.n_frames,
        "rate_hz": recording.rate,
        "duration_s": round(recording.duration, 6),
        "start_s": recording.start,
    }
