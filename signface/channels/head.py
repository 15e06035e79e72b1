"""What the head does: nods and shakes with their cycles and amplitude, tilts and turns held.

- `swings`: the turning points of an angle.
- `head_events`: events of the head channel.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from signface.descriptors import Descriptors
from signface.frames import hysteresis, long_enough, runs
from signface.head import head_angles

#: Window over which angles are smoothed before their turning points are sought (s).
SMOOTHING_S = 0.1
#: How long the beginning of a take is (s).
BEGINNING_S = 0.3


def head_events(
    descriptors: Descriptors, rules: Mapping[str, Mapping[str, Any]], *, signer_known: bool = False
) -> pd.DataFrame | None:
    """Events of the head channel.

    Parameters
    ----------
    descriptors : Descriptors
    rules : mapping
        Value and its thresholds: a movement has `angle, min_swing_deg, max_swing_ms, min_swings`, a posture
        `angle, sign, on_deg, off_deg, min_ms`. A posture may have `beginning`, a share of the angle at the beginning of
        the take that is taken off: half of how a take begins is how the signer sits today. One with `signer = true`
        is sought only where it is known how the signer holds the head; a table `signer` replaces thresholds there.
    signer_known : bool
        Whether angles are measured from the signer's rest over all their takes.

    Returns
    -------
    DataFrame or None
        `start_s, end_s, value, cycles, amplitude_deg`: the number of cycles of a movement (two swings make one) and
        its median swing; the median angle of a posture. None when the head's pose is unknown (it never moves).
    """
    angles = head_angles(descriptors)
    if not any(np.nanmax(np.abs(angle), initial=0) > 1e-6 for angle in angles.values()):
        return None
    if signer_known:
        rules = {
            v: {**rule, **rule["signer"]} if isinstance(rule.get("signer"), dict) else rule for v, rule in rules.items()
        }
    rate = descriptors.rate
    smooth = {name: _smoothed(angle, rate) for name, angle in angles.items()}
    movements = []
    for value, rule in rules.items():
        if "min_swings" in rule:
            movements += [(*event, value) for event in _movements(smooth[rule["angle"]], rate, rule)]
    # Where a nod and a shake overlap, the wider one is meant: the head rarely moves about one axis alone.
    movements.sort(key=lambda event: -event[3])
    taken = np.zeros(descriptors.n_frames, bool)
    rows = []
    for start, end, cycles, amplitude, value in movements:
        if not taken[start:end].any():
            taken[start:end] = True
            rows.append((start, end, value, cycles, amplitude))
    strength = np.full(descriptors.n_frames, -np.inf)
    posture = np.full(descriptors.n_frames, -1)
    names = [v for v, rule in rules.items() if "on_deg" in rule and (signer_known or not rule.get("signer"))]
    for index, value in enumerate(names):
        rule = rules[value]
        course = _smoothed(angles[rule["angle"]], rate, rule.get("smooth_ms", 1000 * SMOOTHING_S) / 1000)
        opening = course[: max(1, round(BEGINNING_S * rate))]
        known = opening[np.isfinite(opening)]
        taken_off = rule.get("beginning", 0.0) * float(known.mean()) if len(known) else 0.0
        signal = rule["sign"] * (course - taken_off)
        on = long_enough(hysteresis(signal, rule["on_deg"], rule["off_deg"]) & ~taken, rule["min_ms"] / 1000 * rate)
        stronger = on & (signal / rule["on_deg"] > strength)
        strength[stronger], posture[stronger] = (signal / rule["on_deg"])[stronger], index
    for index, value in enumerate(names):
        on = long_enough(posture == index, rules[value]["min_ms"] / 1000 * rate)
        for start, end in runs(on):
            held = float(np.nanmedian(np.abs(smooth[rules[value]["angle"]][start:end])))
            rows.append((int(start), int(end), value, np.nan, held))
    rows.sort()
    first = descriptors.start
    return pd.DataFrame(
        [(first + start / rate, first + end / rate, *rest) for start, end, *rest in rows],
        columns=["start_s", "end_s", "value", "cycles", "amplitude_deg"],
    )


def _smoothed(angle: np.ndarray, rate: float, width_s: float = SMOOTHING_S) -> np.ndarray:
    """The angle smoothed over `width_s`; unknown frames are bridged, and NaN again afterwards."""
    unknown = np.isnan(angle)
    if unknown.all():
        return angle
    frames = np.arange(len(angle))
    whole = np.interp(frames, frames[~unknown], angle[~unknown])
    window = 2 * round(width_s * rate / 2) + 1
    if 3 < window <= len(whole):
        from scipy.signal import savgol_filter  # slow to import

        whole = savgol_filter(whole, window, polyorder=2)
    return np.where(unknown, np.nan, whole)


def swings(angle: np.ndarray, smallest: float) -> list[int]:
    """Frames at which an angle turns, such that it changes by at least `smallest` between one and the next.

    The zigzag through the curve: a turn counts once the angle has come back from it by `smallest`. NaN is passed over.
    """
    turns: list[int] = []
    known = np.flatnonzero(np.isfinite(angle))
    if not len(known):
        return turns
    low = high = int(known[0])
    direction = 0
    for frame in known[1:].tolist():
        if direction >= 0 and angle[frame] > angle[high]:
            high = frame
        if direction <= 0 and angle[frame] < angle[low]:
            low = frame
        if direction >= 0 and angle[high] - angle[frame] >= smallest:
            turns.append(high)
            direction, low = -1, frame
        elif direction <= 0 and angle[frame] - angle[low] >= smallest:
            turns.append(low)
            direction, high = 1, frame
    if direction:
        turns.append(high if direction > 0 else low)
    return turns


def _movements(angle: np.ndarray, rate: float, rule: Mapping[str, Any]) -> list[tuple[int, int, float, float]]:
    """Start, end, cycles and median swing of each run of quick swings."""
    turns = swings(angle, rule["min_swing_deg"])
    spans = [_moving_part(angle, a, b) for a, b in pairwise(turns)]
    longest = rule["max_swing_ms"] / 1000 * rate
    movements, first = [], 0
    while first < len(spans):
        last = first
        while (
            last < len(spans) and spans[last][1] - spans[last][0] <= longest and _follows(spans, first, last, longest)
        ):
            last += 1
        if last - first >= rule["min_swings"]:
            widths = [abs(angle[turns[i + 1]] - angle[turns[i]]) for i in range(first, last)]
            movements.append((spans[first][0], spans[last - 1][1] + 1, (last - first) / 2, float(np.median(widths))))
        first = max(last, first + 1)
    return movements


def _follows(spans: list[tuple[int, int]], first: int, swing: int, longest: float) -> bool:
    """Whether a swing begins soon after the one before it: a head that rests in between has ended its movement."""
    return swing == first or spans[swing][0] - spans[swing - 1][1] <= longest / 2


def _moving_part(angle: np.ndarray, start: int, end: int) -> tuple[int, int]:
    """The frames of a swing between which it makes the middle 80 % of its way.

    A turning point may lie anywhere in a stretch of rest before or after the swing; where it moves is what counts.
    """
    way = (angle[start : end + 1] - angle[start]) / (angle[end] - angle[start])
    left = np.flatnonzero(way <= 0.1)
    arrived = np.flatnonzero(way >= 0.9)
    return start + int(left[-1] if len(left) else 0), start + int(arrived[0] if len(arrived) else end - start)
