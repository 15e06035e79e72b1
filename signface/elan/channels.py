"""`channel_tiers`: the events of the further channels as tiers."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import cycle

import numpy as np

from signface.channels.events import ChannelEvents
from signface.elan.tiers import DependentTier, Tier, milliseconds
from signface.label.vocabulary import PALETTE, Vocabulary


def channel_tiers(channels: Iterable[ChannelEvents], signer: str = "") -> list[Tier]:
    """One tier `CHANNEL@SIGNER` for each channel, with its closed vocabulary.

    Cycles and amplitude (degrees) of head movements go to tiers that hang on it: `head-cycles`, `head-amplitude`.

    Parameters
    ----------
    channels : iterable of ChannelEvents
    signer : str
    """
    tiers = []
    for channel in channels:
        table = channel.table[channel.table["end_s"] > 0.0005]
        start_ms, end_ms = milliseconds(table["start_s"].clip(lower=0).to_numpy(float), table["end_s"].to_numpy(float))
        dependents = []
        for column, measure, digits in (("cycles", "cycles", 1), ("amplitude_deg", "amplitude", 0)):
            if column in table.columns:
                numbers = table[column].to_numpy(float)
                texts = tuple(f"{number:.{digits}f}" if np.isfinite(number) else None for number in numbers)
                dependents.append(DependentTier(f"{channel.channel}-{measure}", texts))
        values = tuple(str(value) for value in table["value"])
        vocabulary = vocabulary_of(channel)
        tiers.append(Tier(channel.channel, signer, start_ms, end_ms, values, vocabulary, tuple(dependents)))
    return tiers


def vocabulary_of(channel: ChannelEvents) -> Vocabulary:
    """The closed vocabulary of a channel."""
    colours = dict(zip(channel.values, cycle(PALETTE)))
    return Vocabulary(channel.channel, tuple(channel.values), channel.values, colours, description=channel.description)
