"""What goes into a document of what was found in a take: tiers, curves, and facts for the header.

- `Results`: what can be written.
- `contents_of`: of one signer, or of all signers of a dialogue.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

import pandas as pd

from signface.channels.events import ChannelEvents
from signface.elan.channels import channel_tiers
from signface.elan.curves import joined_curves
from signface.elan.tiers import Tier, doubtful_tier, label_tier
from signface.errors import SignfaceError
from signface.label.vocabulary import AFFECT, Vocabulary
from signface.segmentation.segments import Segments
from signface.settings.eaf import EafOptions
from signface.signer import Signer


class Results(Protocol):
    """What can be written: `signface.annotation.Annotation`, or anything that holds the like.

    `segments` are labelled, with confidence, and with `intensity` where it is known; `channels` are events by channel;
    `curves` is `time_s` and curves (`signface.segmentation.curves.curves_table`); `signer` names the tiers; `tier` says
    what the segments are of, `vocabulary` what their labels are, and `facts` what the header of the file says.
    """

    @property
    def segments(self) -> Segments: ...

    @property
    def channels(self) -> Mapping[str, ChannelEvents] | None: ...

    @property
    def curves(self) -> pd.DataFrame: ...

    @property
    def signer(self) -> Signer: ...

    @property
    def tier(self) -> str: ...

    @property
    def vocabulary(self) -> Vocabulary: ...

    @property
    def facts(self) -> Mapping[str, str]: ...


class Contents(NamedTuple):
    """What goes into a document.

    `segments` are those of the first signer; `facts` of several signers are called `NAME@SIGNER`.
    """

    tiers: tuple[Tier, ...]
    curves: pd.DataFrame | None
    facts: dict[str, str]
    segments: Segments


def contents_of(
    annotation: Results | Segments | Sequence[Results],
    options: EafOptions,
    *,
    signer: str | None = None,
    tier: str | None = None,
    vocabulary: Vocabulary | None = None,
) -> Contents:
    """The contents of one annotation, or of the annotations of all signers of a take; see `writing.write_eaf`.

    Raises
    ------
    SignfaceError
        There is no annotation, or two of them are of one signer.
    """
    if isinstance(annotation, Segments) or not isinstance(annotation, Sequence):
        return _one(annotation, options, signer, tier, vocabulary)
    if not annotation:
        raise SignfaceError("there is no annotation to write")
    if len(annotation) == 1:
        return _one(annotation[0], options, signer, tier, vocabulary)
    names = [one.signer.name for one in annotation]
    if len(set(names)) < len(names) or "" in names or signer is not None:
        raise SignfaceError("the annotations of one take are of signers with names of their own", hint="name them")
    each = [_one(one, options, None, tier, vocabulary) for one in annotation]
    curves = [one.curves for one in each if one.curves is not None]
    facts = {
        f"{fact}@{name}": value for name, one in zip(names, each, strict=True) for fact, value in one.facts.items()
    }
    return Contents(
        tuple(tier for one in each for tier in one.tiers),
        joined_curves(curves, names) if curves else None,
        facts,
        each[0].segments,
    )


def _one(
    annotation: Results | Segments,
    options: EafOptions,
    signer: str | None,
    tier: str | None,
    vocabulary: Vocabulary | None,
) -> Contents:
    curves, facts, tiers = None, {}, []
    if isinstance(annotation, Segments):
        segments, signer = annotation, signer or ""
        tier, vocabulary = tier or "affect", vocabulary or AFFECT
    else:
        tier, vocabulary = tier or annotation.tier, vocabulary or annotation.vocabulary
        segments, signer = annotation.segments, annotation.signer.name if signer is None else signer
        curves = annotation.curves if options.curves else None
        facts = dict(annotation.facts)
        others = (event for event in (annotation.channels or {}).values() if event.channel != tier)
        tiers = channel_tiers(others, signer)
        tiers += [
            label_tier(one.segments, signer, channel=one.tier, vocabulary=one.vocabulary)
            for one in getattr(annotation, "clauses", ())
        ]
    untrusted = getattr(annotation, "untrusted", ())
    if options.doubtful is not None or untrusted:
        below = options.doubtful
        doubtful = doubtful_tier(
            segments, signer, below=below, untrusted=untrusted, channel=tier, vocabulary=vocabulary
        )
        tiers = [doubtful, *tiers] if below is not None or doubtful.values else tiers
    return Contents(
        (label_tier(segments, signer, channel=tier, vocabulary=vocabulary), *tiers), curves, facts, segments
    )
