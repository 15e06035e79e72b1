"""Times as people and cameras write them: clock times and timecodes, in seconds.

- `seconds_of_clock`: seconds, or minutes and hours before them.
- `seconds_of_timecode`: the timecode of a film.
- `seconds_apart`: how long one timecode is after another, over midnight too.
"""

from __future__ import annotations

import re

from signface.errors import SignfaceError

DAY_S = 86400.0

_CLOCK = re.compile(r"^\s*(-?)(?:(?:(\d+):)?(\d+):)?(\d+(?:[.,]\d*)?)\s*$")
_TIMECODE = re.compile(r"^\s*(\d{1,2}):(\d\d):(\d\d)(?:([.,]\d+)|[:;](\d+)(?:@(\d+(?:\.\d+)?))?)?\s*$")


def seconds_of_clock(text: str) -> float:
    """Seconds of a time like `12.5`, `1:02.5` (minutes) or `0:01:02.5` (hours).

    Raises
    ------
    SignfaceError
        It is no such time; a timecode with frames is none, since its rate is not known.

    Examples
    --------
    >>> seconds_of_clock("1:02.5"), seconds_of_clock("0:01:02,5")
    (62.5, 62.5)
    """
    match = _CLOCK.match(text)
    if match is None:
        raise SignfaceError(f"{text!r} is no time", hint="give seconds (62.5) or minutes and seconds (1:02.5)")
    sign, hours, minutes, seconds = match.groups()
    total = 3600 * int(hours or 0) + 60 * int(minutes or 0) + float(seconds.replace(",", "."))
    return -total if sign else total


def seconds_of_timecode(text: str) -> float:
    """Seconds since midnight of `10:23:11`, `10:23:11.480` or `10:23:11:12@25` with the rate of its frames.

    Frames of drop-frame timecode (`10:23:11;12@29.97`) are counted at 30: its hours are those of the clock.

    Raises
    ------
    SignfaceError
        It is no timecode, its frames have no rate, or there are more than the rate has.

    Examples
    --------
    >>> seconds_of_timecode("00:00:10:05@25"), seconds_of_timecode("00:00:10.2")
    (10.2, 10.2)
    """
    match = _TIMECODE.match(text)
    if match is None or int(match[2]) > 59 or int(match[3]) > 59 or int(match[1]) > 23:
        raise SignfaceError(
            f"{text!r} is no timecode", hint="write 10:23:11.48, or 10:23:11:12@25 with the film's rate"
        )
    seconds = 3600.0 * int(match[1]) + 60 * int(match[2]) + int(match[3])
    if match[4]:
        return seconds + float(match[4].replace(",", "."))
    frame = int(match[5] or 0)
    if frame and match[6] is None:
        raise SignfaceError(f"{text!r} counts frames of an unknown rate", hint=f"add the film's: {text.strip()}@25")
    counted = round(float(match[6])) if match[6] else 1
    if frame and frame >= counted:
        raise SignfaceError(f"{text!r} has frame {frame} of {counted} in a second", hint="check the rate after @")
    return seconds + frame / max(counted, 1)


def seconds_apart(later: float, earlier: float) -> float:
    """How many seconds one time of the day is after another, at most half a day: midnight may lie between them.

    Examples
    --------
    >>> seconds_apart(5.0, 86390.0)
    15.0
    """
    return (later - earlier + DAY_S / 2) % DAY_S - DAY_S / 2
