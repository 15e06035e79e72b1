"""How a recording is solved, as one object that every door knows.

It stands at the top of the package because descriptors and models carry it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from signface.errors import SignfaceError
from signface.settings.base import Settings, number, option
from signface.timecode import seconds_of_clock, seconds_of_timecode

#: name: what it is, for `--help` and reports.
METHODS = {
    "thin-shell": "least bending and stretching of the skin, soft bounds (the default)",
    "least-squares": "least squares without bounds",
    "nnls": "non-negative least squares",
    "bounded": "least squares with weights from 0 to 1",
    "direct-shell": "the skin bent by the markers alone, then read as weights",
    "rbf-network": "a radial basis function network learnt from examples of the avatar",
    "gaussian-process": "Gaussian process regression learnt from examples of the avatar",
    "sparse-online-gp": "its sparse online form",
    "measures": "brows, lids and mouth measured from rest (mm), and one weight of the brows",
}

#: What is said of a take and not of how takes are solved.
OF_THE_TAKE = ("unit", "rate_hz", "start_s", "subject", "join", "cut_from", "cut_to", "offset_s", "film_timecode")


@dataclass(frozen=True)
class SolveSettings(Settings):
    """How markers become weights (Reverdy 2019, 5.2); validated when it is made.

    The fields say in their metadata what they decide. None stands for the method's own value.

    Raises
    ------
    SignfaceError
        A value is not of its kind or outside its range.

    See Also
    --------
    signface.signer.Signer : who signs, with bases and level of their own.
    signface.settings.laboratory.read_settings : the settings of a laboratory's TOML.

    Examples
    --------
    >>> import signface as sf
    >>> settings = sf.SolveSettings(alpha=0.3)
    >>> settings.chosen
    {'alpha': 0.3}
    >>> sf.SolveSettings.from_dict(settings.as_dict()) == settings
    True
    """

    TABLE = "solve"

    face: str = option(
        "default", help="a shipped face or a file (.glb, .wfm) or folder of .obj", metavar="FACE", path=True
    )
    layout: str | None = option(
        None,
        help="a shipped layout or a .csv (default: the shipped layout that fits the markers best)",
        metavar="LAYOUT",
        path=True,
    )
    neutral: str | float = option(
        "auto", help="time of a frame with a neutral face, or auto", kind=object, metavar="SECONDS"
    )
    method: str = option("thin-shell", help="how weights are solved", choices=tuple(METHODS), metavar="METHOD")
    alpha: float | None = number(help="weight of the thin shell, 0 to 1 (default: the method's own)", metavar="A")
    adaptation: str = option(
        "similarity", help="how displacements are carried to the avatar", choices=("similarity", "rbf")
    )
    sparsity: float | None = number(help="pull towards rest, 0 or more (default: 0.006)", metavar="S")
    head_slack: float | None = number(help="how far head markers may creep, 0 trusts them (default: 0.3)", metavar="H")
    slip: float | None = number(
        help="how far off a marker counts in full, beside a typical displacement; 0 trusts all (default: 0.4)",
        metavar="D",
    )
    creep: bool | None = option(
        None, help="do not take away what the markers creep on the skin", kind=bool, flag="--keep-creep"
    )
    check_markers: bool = option(
        True,
        help="do not look for ghosts, swapped and frozen markers before the solve",
        kind=bool,
        flag="--keep-wrong-markers",
    )
    short_gap_s: float | None = number(
        help="longest gap that a spline fills (default: 0.05 s)", flag="--short-gap", metavar="SECONDS"
    )
    long_gap_s: float | None = number(
        help="longest gap that neighbouring markers fill (default: 0.5 s)", flag="--long-gap", metavar="SECONDS"
    )
    cutoff_hz: float | None = number(
        help="what changes faster is filtered out (default: 12 Hz)", flag="--cutoff", metavar="HZ"
    )
    filter_method: str = option(
        "butterworth", help="the filter", choices=("butterworth", "raised-sine"), flag="--filter"
    )
    head_fallback: str | None = option(
        None,
        help="least-moving: carry the head by the least-moving markers where head markers do not suffice",
        choices=("least-moving",),
        metavar="least-moving",
    )
    read_as: str | None = option(
        None,
        help="aus: take the action units of an OpenFace table, and not its landmarks",
        choices=("aus",),
        flag="--as",
        metavar="aus",
    )
    unit: str | None = option(
        None, help="unit of length of the recording (mm, cm, m, in), where it says none or a wrong one", metavar="U"
    )
    rate_hz: float | None = number(
        help="frames per second of the recording, where it says none or wrong ones; every row is then a frame",
        flag="--rate",
        metavar="HZ",
    )
    start_s: float | None = number(
        help="time of the recording's first frame, where it says another", flag="--start", metavar="SECONDS"
    )
    subject: str | None = option(
        None, help="whose markers, of several signers in one recording (signface take info names them)", metavar="NAME"
    )
    join: tuple[str, ...] = option(
        (), help="markers that the file has in parts, NAME=PART+PART,...: LBROI=LBROI+M12", kind=tuple, metavar="PARTS"
    )
    cut_from: str | None = option(
        None, help="only from this time on: seconds or [H:]M:S, as in the EAF", flag="--from", metavar="TIME"
    )
    cut_to: str | None = option(None, help="only up to this time, without it", flag="--to", metavar="TIME")
    offset_s: float | None = number(
        help="seconds added to the take's times: how long after its film it began", flag="--offset", metavar="SECONDS"
    )
    film_timecode: str | None = option(
        None,
        help="timecode of the film's first frame (H:M:S.s or H:M:S:F@RATE): a phone's take is placed by its own",
        flag="--timecode",
        metavar="TIMECODE",
    )

    def __post_init__(self) -> None:
        for name in ("cut_from", "cut_to"):
            value = getattr(self, name)
            if isinstance(value, (int, float)) and not isinstance(value, bool):
                object.__setattr__(self, name, f"{value:.15g}")
        super().__post_init__()
        for rule in self.join:
            name, sign, parts = rule.partition("=")
            if not (sign and name.strip() and all(part.strip() for part in parts.split("+"))):
                raise SignfaceError(f"{rule!r} joins no markers", hint="write --join NAME=PART+PART")
        if self.rate_hz is not None and not 0 < self.rate_hz < math.inf:
            raise SignfaceError(f"rate_hz must be positive, not {self.rate_hz:g}", hint="give frames per second")
        if self.start_s is not None and not math.isfinite(self.start_s):
            raise SignfaceError(f"start_s is no number of seconds: {self.start_s}")
        begin, end = self.cut_s
        if not begin < end:
            raise SignfaceError(f"nothing lies from {self.cut_from} to {self.cut_to}", hint="--from is before --to")
        if self.offset_s is not None and not abs(self.offset_s) < float("inf"):
            raise SignfaceError(f"offset_s is no number of seconds: {self.offset_s}")
        if self.film_timecode is not None:
            seconds_of_timecode(self.film_timecode)
        if self.neutral != "auto":
            try:
                object.__setattr__(self, "neutral", float(self.neutral))
            except (TypeError, ValueError):
                raise SignfaceError(f"neutral is neither a time in seconds nor auto: {self.neutral!r}") from None
        for name in ("sparsity", "head_slack", "slip", "short_gap_s", "long_gap_s", "cutoff_hz"):
            value = getattr(self, name)
            if value is not None and not 0 <= value < float("inf"):
                raise SignfaceError(f"{name} must be 0 or more, not {value:g}")

    @property
    def reading(self) -> dict[str, Any]:
        """How a recording is opened: keywords of `signface.open_recording`."""
        named = {name: getattr(self, name) for name in ("unit", "read_as", "subject", "film_timecode")}
        return {**named, "rate": self.rate_hz, "start": self.start_s}

    @property
    def cut_s(self) -> tuple[float, float]:
        """From when to when in seconds; infinite where the take is not cut."""
        begin = -math.inf if self.cut_from is None else seconds_of_clock(self.cut_from)
        return begin, math.inf if self.cut_to is None else seconds_of_clock(self.cut_to)

    def for_take_of(self, other: SolveSettings | None) -> SolveSettings:
        """The settings with whose markers, from when to when, and where in the film, as `other` says it of a take."""
        other = type(self)() if other is None else other
        return self.changed(**{name: getattr(other, name) for name in OF_THE_TAKE})

    @property
    def solver_options(self) -> dict[str, float]:
        """What the method is told: those of `alpha`, `sparsity`, `head_slack` and `slip` that are given."""
        named = {name: getattr(self, name) for name in ("alpha", "sparsity", "head_slack", "slip")}
        return {name: value for name, value in named.items() if value is not None}

    @property
    def takes_creep_away(self) -> bool:
        """Whether creep is taken away: by default for the thin shell, and not for its rivals."""
        return self.method == "thin-shell" if self.creep is None else self.creep

    def differences(self, other: Mapping[str, Any]) -> list[str]:
        """What would give other weights under other settings, given as plain values; in words.

        Layout and neutral frame are the take's own, and faces are told apart by their bases.

        Examples
        --------
        >>> import signface as sf
        >>> sf.SolveSettings(alpha=0.3).differences(sf.SolveSettings().as_dict())
        ['alpha 0.3 instead of the usual']
        """
        takes_own = ("face", "layout", "neutral", *OF_THE_TAKE)
        words = {name: "the usual" if value is None else value for name, value in other.items()}
        return [
            f"{name} {'the usual' if value is None else value} instead of {words[name]}"
            for name, value in self.as_dict().items()
            if name not in takes_own and name in other and other[name] != value
        ]
