"""How a take is written into an EAF, as one object that every door knows."""

from __future__ import annotations

from dataclasses import dataclass

from signface.errors import SignfaceError
from signface.settings import Settings, option


@dataclass(frozen=True)
class EafOptions(Settings):
    """What goes into an EAF and how; validated when it is made.

    The fields say in their metadata what they decide. Which file, whose film and into what is said with each take.

    Raises
    ------
    SignfaceError
        A value is not of its kind or outside its range.

    Examples
    --------
    >>> EafOptions(doubtful=0.5).chosen
    {'doubtful': 0.5}
    """

    TABLE = "eaf"

    template: str | None = option(
        None, help="a lab's template, whose tiers and vocabularies are used", metavar="ETF_OR_EAF", path=True
    )
    mapping: str | None = option(
        None, help="which channel goes to which tier (signface elan map writes one)", metavar="FILE", path=True
    )
    channels: str | None = option(
        None,
        help="also write the further channels, by the thresholds of a .toml or the shipped ones (default)",
        metavar="FILE",
        path=True,
    )
    doubtful: float | None = option(
        None,
        help="also write a tier of the segments whose confidence is below this",
        kind=float,
        metavar="CONFIDENCE",
    )
    author: str = option("signface", help="who the file says made it", metavar="NAME")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.doubtful is not None and not 0 <= self.doubtful <= 1:
            raise SignfaceError(f"doubtful is a confidence from 0 to 1, not {self.doubtful:g}")
