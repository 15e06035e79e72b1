"""`write_take`: everything that ELAN shows of a take, written together or not at all.

The EAF is prepared first, so that a mapping that does not fit, or a file that an annotator has worked in, is found
before the curves appear beside it.
"""

from __future__ import annotations

import datetime
from collections.abc import Mapping as MappingABC
from os import PathLike
from pathlib import Path
from typing import Any

from signface.channels.rules import find_channels, find_intensities
from signface.descriptors import Descriptors
from signface.elan.channels import channel_tiers
from signface.elan.curves import write_curves, write_tsconf
from signface.elan.document import read_document
from signface.elan.export import prepare_eaf, prepare_into
from signface.elan.mapping import Mapping
from signface.elan.tiers import doubtful_tier
from signface.elan.vocabularies import AFFECT
from signface.segmentation.segments import Segments

TSCONF = "_tsconf.xml"


def write_take(
    path: str | PathLike[str],
    descriptors: Descriptors,
    segments: Segments,
    *,
    signer: str = "",
    video: str | PathLike[str] | None = None,
    properties: MappingABC[str, str] | None = None,
    channels: MappingABC[str, MappingABC[str, Any]] | None = None,
    doubtful_below: float | None = None,
    template: str | PathLike[str] | None = None,
    into: str | PathLike[str] | None = None,
    mapping: Mapping | None = None,
    date: datetime.datetime | str | None = None,
    replace: bool = False,
) -> list[Path]:
    """Write a take's tiers and curves: a new EAF, one from a template, or into one that is there.

    Parameters
    ----------
    path : path
        The `.eaf` to write; not used with `into`.
    descriptors : Descriptors
    segments : Segments
        Labelled, with confidence; with `intensity` where the classifier has learnt it, which is then written.
    signer, video, properties, mapping, date, replace :
        As in `export.write_eaf`.
    channels : mapping, optional
        Thresholds (`signface.channels.rules.read_channels`): also write the further channels, and the intensity of the
        affect by their rule where the segments have none.
    doubtful_below : float, optional
        Also write the segments whose confidence is below this on a tier of their own.
    template : path, optional
        A lab's `.etf` or `.eaf` whose structure the new file takes over.
    into : path, optional
        An EAF that is there; only our own tiers in it are added or brought up to date.

    Returns
    -------
    list of Path
        What belongs to the take, the `.eaf` first: the curves, and their description unless the file has one of its
        own.

    Raises
    ------
    SignfaceError
        As `export.write_eaf` or `export.write_into`; or the take has fewer than three frames.
    """
    file = Path(path if into is None else into)
    tiers = []
    if channels is not None:
        tiers = channel_tiers(find_channels(descriptors, channels), signer)
        if "intensity" in channels and "intensity" not in segments.table:
            segments = find_intensities(descriptors, segments, channels)
    if doubtful_below is not None:
        tiers = [doubtful_tier(segments, signer, below=doubtful_below), *tiers]
    curves, tsconf = file.with_suffix(".curves.csv"), file.with_name(file.stem + TSCONF)
    linked = (curves,) if into is not None and _has_curves(file, tsconf) else (curves, tsconf)
    if into is None:
        prepared = prepare_eaf(
            file,
            segments,
            signer=signer,
            video=video,
            properties=properties,
            vocabulary=AFFECT,
            tiers=tiers,
            linked_files=linked,
            template=template,
            mapping=mapping,
            date=date,
            author="signface",
            replace=replace,
        )
    else:
        prepared = prepare_into(
            file,
            segments,
            signer=signer,
            video=video,
            properties=properties,
            vocabulary=AFFECT,
            tiers=tiers,
            linked_files=linked,
            mapping=mapping,
            date=date,
            replace=replace,
        )
    write_curves(descriptors, segments, curves)
    if tsconf in linked:
        write_tsconf(curves, tsconf, date=date)
    prepared.store()
    return [file, *linked]


def _has_curves(file: Path, own: Path) -> bool:
    """Whether an EAF is linked with a description of curves that is not ours: ELAN reads one of them only."""
    links = read_document(file).getroot().iterfind("HEADER/LINKED_FILE_DESCRIPTOR")
    names = [(link.get("LINK_URL") or "").rpartition("/")[2] for link in links]
    return any(name.endswith(TSCONF) and name != own.name for name in names)
