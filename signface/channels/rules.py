"""What the face and the head do besides the affect: brows, eyes, gaze, nose, mouth, cheeks, head.

- `read_channels`: the thresholds, from the shipped file or one's own.
- `find_channels`: the events (`events.ChannelEvents`) of every channel of a take.
- `unseen_values`: the values that no base of a take can show.
- `find_intensities`: the intensity (1 to 3) of each stable segment.

The thresholds stand in `models/channels/default.toml`, with what they mean.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from signface.channels.events import ChannelEvents
from signface.channels.head import head_events
from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.files import shipped
from signface.frames import Means, bridge, hysteresis, long_enough, stretches
from signface.head import head_angles
from signface.segmentation.segments import Segments
from signface.signer_level import SignerLevel, signer_range

#: Keys that a channel's table holds besides its values.
CHANNEL_KEYS = {"description", "together", "measured_only"}
VALUE_KEYS = {"description", "bases", "minus", "combine", "on", "off", "min_ms", "max_ms", "gap_ms", "signer"}
#: Keys of a value's table `signer`, which holds where the level of the signer is known.
SIGNER_KEYS = {"minus", "on", "off", "min_ms", "max_ms", "gap_ms", "per_pitch_deg", "take", "smooth_ms"}
#: A signer's range is taken as at least this wide (half of it, weights), so that rest is not blown up to expression.
LEAST_RANGE = 0.05
#: Labels that have no degree: the neutral face, and what a model did not know.
NO_DEGREE = ("N", "unknown")


def read_channels(name: str | PathLike[str] = "default") -> dict[str, dict[str, Any]]:
    """The thresholds of a shipped name or of a TOML file of one's own.

    Raises
    ------
    SignfaceError
        The file is missing, is no TOML, or a value's table is incomplete.
    """
    known = shipped("channels", ".toml")
    file = known.get(str(name), Path(name))
    try:
        content = tomllib.loads(file.read_text("utf-8"))
    except OSError as error:
        hint = f"shipped ones are {', '.join(known)}"
        raise SignfaceError("no such file of channels", file=file, hint=hint) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SignfaceError(f"is no TOML ({error})", file=file) from error
    for channel, table in content.items():
        if not isinstance(table, dict):
            raise SignfaceError(f"{channel} is no table", file=file)
        if channel in ("head", "intensity"):
            continue
        for value, rule in _values(table):
            _check_rule(f"{channel}.{value}", rule, file)
    return content


def _check_rule(name: str, rule: object, file: Path) -> None:
    if not isinstance(rule, dict):
        raise SignfaceError(f"{name} is no table", file=file)
    unknown, missing = sorted(set(rule) - VALUE_KEYS), sorted({"bases", "on", "off", "min_ms"} - set(rule))
    if unknown or missing:
        problem = f"the unknown key {unknown[0]}" if unknown else f"no {missing[0]}"
        raise SignfaceError(f"[{name}] has {problem}", file=file, hint=f"the keys are {', '.join(sorted(VALUE_KEYS))}")
    signer = rule.get("signer", {})
    if not isinstance(signer, dict) or set(signer) - SIGNER_KEYS or not {"on", "off"} <= set(signer or {"on", "off"}):
        hint = f"its keys are {', '.join(sorted(SIGNER_KEYS))}; on and off are needed"
        raise SignfaceError(f"[{name}.signer] is no table of thresholds of a signer", file=file, hint=hint)
    if rule["off"] > rule["on"] or signer.get("off", 0) > signer.get("on", 0):
        raise SignfaceError(f"[{name}] off is above on", file=file, hint="a value ends lower than it begins")


def find_channels(
    descriptors: Descriptors,
    channels: Mapping[str, Mapping[str, Any]] | None = None,
    *,
    level: SignerLevel | None = None,
) -> list[ChannelEvents]:
    """Events of every channel.

    Bases that the face has not, or that the markers cannot see (`Descriptors.unobserved`), are passed over. A channel
    without any other is left out: an empty one would say that nothing was there. So are gaze when the weights were
    solved from markers, and the head when its pose is unknown (the identity throughout). `unseen_values` names them.

    Parameters
    ----------
    descriptors : Descriptors
    channels : mapping, optional
        What `read_channels` returns; the shipped thresholds when not given.
    level : SignerLevel, optional
        Of the signer over all their takes. Values with thresholds of their own for it are found by the signer's range
        (`signer_signal`), the others, and all without it, by the weights as they are.
    """
    rules = read_channels() if channels is None else channels
    solved = np.isfinite(descriptors.residual if descriptors.residual is not None else np.nan).any()
    channel_events = []
    for channel, table in rules.items():
        if channel == "intensity" or (table.get("measured_only") and solved):
            continue
        if channel == "head":
            events = head_events(descriptors, dict(_values(table)), signer_known=level is not None)
            if events is None:
                continue
        else:
            used = dict(_values(table))
            signals = {}
            for value, stated in _values(table):
                rule = _observed(stated, descriptors)
                signal = weight_signal(descriptors, rule)
                if signal is None:
                    continue
                signals[value] = signal
                if level is not None and "signer" in rule and level.sample is not None:
                    signals[value] = signer_signal(descriptors, rule, level)
                    used[value] = {**rule, **rule["signer"]}
            if not signals:
                continue
            together = [tuple(pair) for pair in table.get("together", [])]
            events = _weight_events(descriptors, signals, used, together)
        channel_events.append(_as_events(channel, table, events))
    return channel_events


def unseen_values(
    descriptors: Descriptors, channels: Mapping[str, Mapping[str, Any]] | None = None
) -> dict[str, tuple[str, ...]]:
    """By channel, the values that cannot be found in a take, for no base that the markers see shows them.

    A channel is named only where one of its values needs a base that the face has: a table of action units without
    cheeks says nothing of cheeks, and nobody expects it to.

    Parameters
    ----------
    descriptors : Descriptors
        With `unobserved` where they were solved.
    channels : mapping, optional
        What `read_channels` returns; the shipped thresholds when not given.

    Examples
    --------
    >>> bases = ("eyeBlinkLeft", "eyeBlinkRight", "eyeWideLeft")
    >>> take = Descriptors(np.zeros((9, 3)), bases, rate=100, unobserved=bases[:2])
    >>> unseen_values(take)
    {'eyes': ('closed',), 'blinks': ('blink',)}
    """
    rules = read_channels() if channels is None else channels
    unseen = {}
    for channel, table in rules.items():
        if channel in ("intensity", "head") or table.get("measured_only"):
            continue
        blind = [
            value
            for value, rule in _values(table)
            if weight_signal(descriptors, rule) is not None
            and weight_signal(descriptors, _observed(rule, descriptors)) is None
        ]
        if blind:
            unseen[channel] = tuple(blind)
    return unseen


def _observed(rule: Mapping[str, Any], descriptors: Descriptors) -> Mapping[str, Any]:
    """The rule without the bases that the markers cannot see: as 0 they would halve a mean of two sides."""
    if not descriptors.unobserved:
        return rule
    kept = dict(rule)
    for key in ("bases", "minus"):
        if key in rule:
            kept[key] = [base for base in rule[key] if base not in descriptors.unobserved]
    if "signer" in rule:
        kept["signer"] = _observed(rule["signer"], descriptors)
    return kept


def closed_vocabularies(channels: Mapping[str, Mapping[str, Any]]) -> list[ChannelEvents]:
    """Every channel with the values that it can hold and no events."""
    empty = pd.DataFrame(columns=["start_s", "end_s", "value"])
    return [_as_events(channel, table, empty) for channel, table in channels.items() if channel != "intensity"]


def _as_events(channel: str, table: Mapping[str, Any], events: pd.DataFrame) -> ChannelEvents:
    """Events with every value that the channel can hold and its description, those of pairs among them."""
    values = {value: str(rule.get("description", "")) for value, rule in _values(table)}
    values |= {joined: f"{first} and {second} together" for first, second, joined in table.get("together", [])}
    return ChannelEvents(channel, str(table.get("description", channel)), values, events)


def find_intensities(
    descriptors: Descriptors, segments: Segments, channels: Mapping[str, Mapping[str, Any]] | None = None
) -> Segments:
    """The segments with a column `intensity`: 1, 2 or 3 for stable ones, missing for transitions, neutral and unknown.

    Parameters
    ----------
    descriptors : Descriptors
    segments : Segments
        Labelled.
    channels : mapping, optional
        What `read_channels` returns; its table `intensity` holds the two limits.
    """
    limits = (read_channels() if channels is None else channels)["intensity"]
    table = segments.table.copy()
    time, levels = descriptors.time, []
    for row in table.itertuples(index=False):
        frames = (time >= row.start_s) & (time < row.end_s)
        strength = np.linalg.norm(np.nanmean(descriptors.weights[frames], axis=0)) if frames.any() else np.nan
        stable = row.kind == "stable" and row.label not in NO_DEGREE and np.isfinite(strength)
        levels.append(1 + (strength >= limits["marked"]) + (strength >= limits["extreme"]) if stable else None)
    table["intensity"] = pd.array([None if level is None else int(level) for level in levels], dtype="Int64")
    return segments.changed("find_intensities", table)


def weight_signal(descriptors: Descriptors, rule: Mapping[str, Any]) -> np.ndarray | None:
    """(F,) signal of a value: mean (or maximum) of its bases less the mean of `minus`; None without any base."""
    bases = [descriptors.weight(base) for base in rule["bases"] if base in descriptors.names]
    if not bases:
        return None
    signal = np.max(bases, axis=0) if rule.get("combine") == "max" else np.mean(bases, axis=0)
    minus = [descriptors.weight(base) for base in rule.get("minus", []) if base in descriptors.names]
    return signal - np.mean(minus, axis=0) if minus else signal


def signer_signal(descriptors: Descriptors, rule: Mapping[str, Any], level: SignerLevel) -> np.ndarray:
    """(F,) signal of a value in units of the signer: 0 where they rest, 2 at the upper end of their range.

    The signal of `weight_signal` with `per_pitch_deg` times the head's pitch added (what a monocular tracker takes for
    a movement of the face when the head nods), less the low end of the signer's range and over half of that range
    (`signface.signer_level.signer_range`), smoothed over `smooth_ms`, less `take` times the take's own tenth
    percentile: a little of what a take never leaves is the camera's or the mood's.

    Parameters
    ----------
    descriptors : Descriptors
    rule : mapping
        With a table `signer`.
    level : SignerLevel
        With a sample.
    """
    own, frames = rule["signer"], level.frames
    assert frames is not None
    values = []
    for take in (descriptors, frames):
        signal = weight_signal(take, {**rule, **own})
        assert signal is not None
        slope = own.get("per_pitch_deg", 0.0)
        values.append(signal + slope * head_angles(take)["pitch"] if slope else signal)
    low, half = signer_range(values[1])
    signal = (values[0] - low) / max(float(half), LEAST_RANGE)
    known = np.isfinite(signal)
    if not known.any():
        return signal
    half_s = own.get("smooth_ms", 0) / 2000
    if half_s:
        time = (np.arange(len(signal)) + 0.5) / descriptors.rate
        whole = np.interp(time, time[known], signal[known])[:, None]
        mean = Means(whole, descriptors.rate).between(time - half_s, time + half_s)[:, 0]
        signal = np.where(known, mean, np.nan)
    return signal - own.get("take", 0.0) * np.percentile(signal[known], 10)


def _weight_events(
    descriptors: Descriptors,
    signals: Mapping[str, np.ndarray],
    rules: Mapping[str, Mapping[str, Any]],
    together: list[tuple[str, ...]],
) -> pd.DataFrame:
    rate = descriptors.rate
    active: dict[str, np.ndarray] = {}
    for value, signal in signals.items():
        rule = rules[value]
        on = hysteresis(signal, rule["on"], rule["off"])
        on = bridge(on, round(rule.get("gap_ms", 0) / 1000 * rate))
        active[value] = long_enough(on, rule["min_ms"] / 1000 * rate, rule.get("max_ms", np.inf) / 1000 * rate)
    names = list(active)
    strength = np.array([np.where(active[name], signals[name] / rules[name]["on"], -np.inf) for name in names])
    label = np.where(np.isfinite(strength).any(axis=0), np.argmax(strength, axis=0), -1)
    for index, (first, second, _) in enumerate(together):
        if first in active and second in active:
            label[active[first] & active[second]] = len(names) + index
    values = [*names, *(joined for _, _, joined in together)]
    shortest = min(rules[name]["min_ms"] for name in names) / 1000 * rate
    rows = [
        (descriptors.start + start / rate, descriptors.start + end / rate, values[code])
        for start, end, code in _runs(label, shortest)
    ]
    return pd.DataFrame(rows, columns=["start_s", "end_s", "value"])


def _runs(label: np.ndarray, shortest: float) -> Iterator[tuple[int, int, int]]:
    """Stretches of one label (not -1); a fragment shorter than `shortest` frames goes to the run it touches.

    Fragments appear where two values that are each long enough overlap a little.
    """
    merged: list[list[int]] = []
    for start, end in stretches(label).tolist():
        code = int(label[start])
        follows = merged and merged[-1][1] == start and merged[-1][2] >= 0
        if follows and (merged[-1][2] == code or (code >= 0 and end - start < shortest)):
            merged[-1][1] = end
        elif follows and code >= 0 and merged[-1][1] - merged[-1][0] < shortest:
            merged[-1][1:] = [end, code]  # a fragment with nothing before it
        else:
            merged.append([start, end, code])
    yield from ((start, end, code) for start, end, code in merged if code >= 0)


def _values(table: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The values of a channel's table and their rules."""
    return ((key, rule) for key, rule in table.items() if key not in CHANNEL_KEYS)
