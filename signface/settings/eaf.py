"""How a take is written into an EAF, as one object that every door knows."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass
from pathlib import Path

from signface.errors import SignfaceError
from signface.files import reading, shipped
from signface.settings.base import Settings, number, option


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
    >>> import signface as sf
    >>> sf.EafOptions(doubtful=0.5).chosen
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
        help="also brows, eyes, gaze, nose, mouth, cheeks, head and intensity; FILE holds other thresholds",
        metavar="FILE",
        bare="default",
        path=True,
    )
    doubtful: float | None = number(
        help="also a tier with the segments whose confidence is below this, 0 to 1", metavar="CONFIDENCE"
    )
    curves: bool = option(True, help="also write the curves of ELAN's timeseries viewer", kind=bool)
    author: str = option("signface", help="who the file says made it", metavar="NAME")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.doubtful is not None and not 0 <= self.doubtful <= 1:
            raise SignfaceError(f"doubtful is a confidence from 0 to 1, not {self.doubtful:g}")

    def absolute(self) -> EafOptions:
        """The options with absolute paths, for processes that stand in another folder."""
        shipped_name = self.channels in _thresholds()
        files = {name: file for name, file in self._files().items() if not (name == "channels" and shipped_name)}
        return self.changed(**{name: os.path.abspath(file) for name, file in files.items()})

    @property
    def content_digest(self) -> str:
        """SHA-256 of all that they decide, with the content of the files in place of their names.

        Raises
        ------
        SignfaceError
            A file cannot be read.
        """
        values = self.as_dict()
        for name, file in self._files().items():
            with reading(Path(file)):
                values[name] = hashlib.sha256(Path(file).read_bytes()).hexdigest()
        return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()

    def _files(self) -> dict[str, str]:
        """The fields that name files, and the files."""
        channels = None if self.channels is None else str(_thresholds().get(self.channels, self.channels))
        named = {"template": self.template, "mapping": self.mapping, "channels": channels}
        return {name: file for name, file in named.items() if file is not None}


def _thresholds() -> dict[str, Path]:
    """Names and files of the shipped thresholds of the further channels."""
    return shipped("channels", ".toml")
