"""From a column of times to a rate: units of time, clocks that start elsewhere, frames that do not come evenly.

- `read_clock`: the rate and start of a file's times, and where its rows lie when they are uneven.
- `declared_clock`: the same where a file declares a rate and has times too.
- `Clock`: what they give.

What is certain is corrected, and said; what is not is refused, and `--rate` named.
"""

from __future__ import annotations

import datetime
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from signface.errors import SignfaceError
from signface.takes.formats.doubts import doubt
from signface.takes.formats.uneven import usual_rate

#: Faces are recorded at no lower and no higher rate (Hz).
SLOWEST, FASTEST = 5.0, 1000.5
#: Seconds in one of each unit that programs write times in; finest last.
UNITS = {"days": 86400.0, "hours": 3600.0, "minutes": 60.0, "milliseconds": 1e-3, "microseconds": 1e-6}
UNITS |= {"ticks of 100 ns": 1e-7, "nanoseconds": 1e-9}
#: Rates at which cameras run (Hz), within a hundredth.
CAMERAS: tuple[float, ...] = (10, 12, 12.5, 15, 16, 20, 24, 25, 30, 40, 48, 50, 60, 75, 80, 90, 100, 120, 125)
CAMERAS += (144, 150, 160, 200, 240, 250, 300, 320, 360, 400, 480, 500, 600, 1000)
#: Times beyond this many seconds (15 years) count from a date.
FROM_A_DATE = 4.7e8
DAY = 86400.0
#: In steps: how far a row may lie from an even clock before frames are resampled, and how long a gap is left.
EVEN, GAP = 0.35, 2.5
OWN_RATE = "give its frames per second with --rate"


class Clock(NamedTuple):
    """When the rows of a file were recorded.

    `times` (seconds, rising, one for each of `rows`) is None where rows come evenly at `rate` from `start` on;
    otherwise rows are to be put on an even grid.
    """

    rate: float
    start: float
    notes: tuple[str, ...] = ()
    times: np.ndarray | None = None
    rows: np.ndarray | None = None


def _off_even(times: np.ndarray) -> float:
    """How far times lie from the line through the first and the last, at most (s)."""
    return float(np.abs(times - np.linspace(times[0], times[-1], len(times))).max())


def _rounding(times: np.ndarray) -> float:
    """Half the last digit in which times are written (s)."""
    for digits in range(7):
        if np.allclose(times * 10**digits, np.round(times * 10**digits), rtol=0, atol=1e-6 * 10 ** min(digits, 3)):
            return 0.5 * 10.0**-digits
    return 5e-8


def mean_rate(times: np.ndarray) -> float:
    """Frames per second (Hz) of times in seconds that rise evenly.

    Times are often written with three digits, so that 1/120 s comes as 0.008, 0.017: the mean step over the whole
    file is right where single steps are not. Where a whole number is within that rounding, it is the rate; 29.97 Hz
    stays 29.97 Hz in any file long enough to tell.
    """
    span = float(times[-1] - times[0])
    rate = (len(times) - 1) / span
    unsure = rate * 2 * _rounding(times) / span
    return float(round(rate)) if abs(rate - round(rate)) <= max(unsure, 1e-9) and round(rate) > 0 else rate


def _named_unit(heading: str) -> str | None:
    """The unit of time that a column's heading names, if it is not seconds."""
    word = heading.strip().lower().replace("(", "_").replace("[", "_").rstrip(")] ").rpartition("_")[2].strip()
    named = {"ms": "milliseconds", "msec": "milliseconds", "us": "microseconds", "µs": "microseconds"}
    named |= {"ns": "nanoseconds", "min": "minutes", "h": "hours"}
    return word if word in UNITS else named.get(word)


def _unit(step: float, first: float, heading: str, declared: float | None) -> str | None:
    """The unit of time in which rows `step` apart are a camera's frames: None for seconds, "" if none is certain."""
    named = _named_unit(heading)
    if named:
        return named
    if declared:
        fits = [unit for unit, seconds in UNITS.items() if abs(declared * step * seconds - 1) < 0.02]
        if abs(declared * step - 1) < 0.02 or SLOWEST <= 1 / step <= FASTEST:
            return None
        return fits[0] if fits else ""
    if SLOWEST <= 1 / step <= FASTEST:
        return None
    fits = []
    for unit, seconds in UNITS.items():
        rate = 1 / (step * seconds)
        from_a_date = 1e17 < first < 1e18  # ticks are counted from the year 1 or 1601
        if not SLOWEST <= rate <= FASTEST or (unit == "ticks of 100 ns") != from_a_date:
            continue
        finer = unit not in ("days", "hours", "minutes")
        if finer or any(abs(rate / usual - 1) < 0.01 for usual in CAMERAS):
            fits.append(unit)
    return fits[0] if len(fits) == 1 and step != 1 else ""  # times that rise by 1 are numbers of frames


def _midnight(times: np.ndarray, notes: list[str]) -> np.ndarray:
    """Seconds since midnight that went past one."""
    falls = np.flatnonzero(np.diff(times) < 0)
    for row in falls:
        if times[row] <= DAY and abs(times[row + 1] - times[row] + DAY) < 60:
            times = np.where(np.arange(len(times)) > row, times + DAY, times)
            notes.append("its times go past midnight: a day was added")
    return times


def read_clock(times: np.ndarray, file: Path, *, heading: str = "", declared: float | None = None) -> Clock:
    """The clock of a file's rows, from the times that stand in them.

    Times may be in other units than seconds, may count from 1970 or midnight, and need not rise evenly: rows that an
    even clock does not explain are to be put on one (`Clock.times`), rows that repeat a time are left out.

    Parameters
    ----------
    times : (R,) array
        As the file has them.
    file : Path
        Named in errors and warnings.
    heading : str
        What stands above them; it may name their unit ("time_ms").
    declared : float, optional
        The rate (Hz) that the file declares elsewhere, by which their unit is told.

    Raises
    ------
    SignfaceError
        Fewer than two times, times that do not rise, or that no unit makes frames of a camera.

    Examples
    --------
    >>> read_clock(np.array([0.0, 0.04, 0.08]), Path("take.csv"))
    Clock(rate=25.0, start=0.0, notes=(), times=None, rows=None)
    """
    if len(times) < 2:
        raise SignfaceError(
            "has one frame, and a rate needs two", file=file, hint="export more of the recording, or " + OWN_RATE
        )
    notes: list[str] = []
    if not np.isfinite(times).all():
        raise SignfaceError("a row has no time", file=file, hint=OWN_RATE)
    whole = np.asarray(times, dtype=np.float64)
    steps = np.diff(whole)
    rising = steps[steps > 0]
    if len(rising) < 0.5 * len(steps):
        raise SignfaceError("its times do not rise from row to row", file=file, hint=OWN_RATE)
    step = float(np.median(rising))
    unit = _unit(_typical(whole, step), float(whole[0]), heading, declared)
    if unit == "":
        rate = 1 / step
        what = "numbers of frames" if step == 1 else f"{rate:.3g} frames a second, at which no face is recorded"
        raise SignfaceError(f"its times would be {what}", file=file, hint=f"{OWN_RATE}, or times in seconds")
    first = float(whole[0])
    if unit is not None:
        seconds = (whole - first) * UNITS[unit]  # first the difference: large numbers have few digits behind the point
        text = f"its times are {unit}, made seconds"
        notes.append(text if _named_unit(heading) else doubt(file, text))
        first *= UNITS[unit]
    else:
        seconds = whole - first
    if abs(first) > FROM_A_DATE:
        notes.append(_from_a_date(first, file))
        first = 0.0
    seconds = _midnight(first + seconds, notes)
    return _even_or_not(seconds, notes, file)


def _typical(times: np.ndarray, step: float) -> float:
    """The step between frames: the mean one where times are written so coarsely that some are equal."""
    mean = float(times[-1] - times[0]) / (len(times) - 1)
    coarse = mean > 0 and _off_even(times) <= 1.01 * step and (np.diff(times) == 0).any()
    return mean if coarse else step


def _from_a_date(first: float, file: Path) -> str:
    when = ""
    for epoch in (datetime.datetime(1970, 1, 1), datetime.datetime(1601, 1, 1), datetime.datetime(1, 1, 1)):
        try:
            moment = epoch + datetime.timedelta(seconds=first)
        except OverflowError:
            continue
        if 1990 <= moment.year <= 2100:
            when = f" ({moment:%Y-%m-%d %H:%M:%S})"
            break
    return doubt(file, f"its times count from a date{when}: the first frame is at 0 s (--start says otherwise)")


def _even_or_not(times: np.ndarray, notes: list[str], file: Path) -> Clock:
    """The clock of times in seconds: even within their rounding, or to be resampled."""
    if (np.diff(times) < 0).any():
        row = int(np.argmax(np.diff(times) < 0)) + 1
        raise SignfaceError(f"its times do not rise from row to row (row {row + 1})", file=file, hint=OWN_RATE)
    span = float(times[-1] - times[0])
    mean = span / (len(times) - 1)
    steps = np.diff(times)
    rounding = _rounding(times - times[0])
    coarse = rounding <= 2 * mean and steps.max() <= mean + 2.1 * rounding
    if mean > 0 and _off_even(times) <= EVEN * mean + (2 * rounding if coarse else 0):
        return Clock(mean_rate(times), float(times[0]), tuple(notes))
    rows = np.flatnonzero(np.diff(times, prepend=-math.inf) > 0)
    if len(rows) < len(times):
        notes.append(doubt(file, f"{len(times) - len(rows)} of its rows repeat a time and were left out"))
    times = times[rows]
    rate = _usual(times, file)
    frames = int(np.floor((times[-1] - times[0]) * rate + 1e-6)) + 1
    on_grid = _on_grid(times, rate)
    lost = frames - len(times)
    if on_grid:
        text = f"{lost} of {frames} frames are missing between its rows, at {rate:.6g} Hz"
    else:
        text = f"its times are uneven: {len(times)} rows were resampled to {frames} frames at {rate:.6g} Hz"
    notes.append(doubt(file, text))
    if on_grid:  # what lies on the grid but for the rounding of its time must not be smoothed
        times = times[0] + np.round((times - times[0]) * rate) / rate
    return Clock(rate, float(times[0]), tuple(notes), times, rows)


def _usual(times: np.ndarray, file: Path) -> float:
    """The rate of most rows; steps over dropped frames do not count."""
    try:
        rate = usual_rate(times)
    except SignfaceError as error:
        raise error.at(file) from error
    near = np.diff(times)[np.diff(times) < 1.5 / rate]
    exact = 1 / float(near.mean()) if len(near) else rate
    return rate if abs(exact / rate - 1) < 0.003 else float(round(exact)) if abs(exact - round(exact)) < 0.02 else exact


def _on_grid(times: np.ndarray, rate: float) -> bool:
    place = (times - times[0]) * rate
    near = np.round(place)
    return bool(np.abs(place - near).max() <= 0.25 and (np.diff(near) > 0).all())


def declared_clock(declared: float, times: np.ndarray | None, file: Path, *, name: str, heading: str = "") -> Clock:
    """The clock of a file that declares a rate, and perhaps has times too.

    Times that agree with the rate (or that tell nothing) leave it. Times at another rate are believed, since each row
    has its own, and it is said.

    Parameters
    ----------
    declared : float
        Frames per second (Hz); NaN where none is declared.
    times : (R,) array, optional
        The column of times.
    name : str
        What declares the rate: "DataRate".

    Raises
    ------
    SignfaceError
        Neither tells a rate.

    Examples
    --------
    >>> declared_clock(100.0, np.array([0.0, 0.01, 0.02]), Path("take.trc"), name="DataRate").rate
    100.0
    """
    known = math.isfinite(declared) and declared > 0
    if times is None or len(times) < 2 or not np.isfinite(times).all() or not np.ptp(times) > 0:
        if not known:
            raise SignfaceError(f"has no rate: {name} is 0 or absent", file=file, hint=OWN_RATE)
        first = float(times[0]) if times is not None and len(times) and np.isfinite(times[0]) else 0.0
        return Clock(declared, first)
    clock = read_clock(times, file, heading=heading, declared=declared if known else None)
    if not known:
        return clock._replace(notes=(*clock.notes, doubt(file, f"{name} is no rate: {clock.rate:g} Hz by its times")))
    unsure = 2.2 * _rounding(times - times[0]) / max(float(np.ptp(times)), 1e-9) + 0.002
    if clock.times is None and abs(clock.rate / declared - 1) <= unsure:
        return clock._replace(rate=declared)
    if clock.times is not None and abs(clock.rate / declared - 1) <= 0.01:
        return clock
    note = f"its times rise at {clock.rate:.6g} Hz and {name} says {declared:g}: the times were believed"
    return clock._replace(notes=(*clock.notes, doubt(file, note)))
