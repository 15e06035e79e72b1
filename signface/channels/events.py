"""`ChannelEvents`: what was found on one channel, whatever found it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from signface.content import Content


@dataclass(frozen=True, eq=False)
class ChannelEvents(Content):
    """What was found on one channel.

    Parameters
    ----------
    channel : str
    description : str
    values : mapping of str to str
        Every value that the channel can hold, with its description: a closed vocabulary.
    table : DataFrame
        `start_s, end_s, value`, in order, without overlap; for the head also `cycles` and `amplitude_deg` (missing
        for postures' cycles).

    See Also
    --------
    signface.channels.rules.find_channels : finds them by thresholds.
    """

    channel: str
    description: str
    values: Mapping[str, str]
    table: pd.DataFrame

    def __len__(self) -> int:
        return len(self.table)

    def __repr__(self) -> str:
        return f"<ChannelEvents of {self.channel}: {len(self)} of {', '.join(self.values)}>"
