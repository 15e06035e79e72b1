"""The mapping file: which of our channels goes to which tier of a lab, and which label becomes which value.

A TOML file with a table for each channel:

    [affect]
    tier = "Emotion_{signer}"        # a tier of the template; "" leaves the channel out
    transitions = ""                 # what transitions (NA, ASu, ...) become; "" leaves them out
    [affect.labels]
    N = "neutral"
    J = "joy"                        # a label that is not named stays as it is; "" leaves it out

A channel without a table goes to a tier of ours, `CHANNEL@SIGNER`, which is added to the file.

- `ChannelRule`, `Mapping`, `read_mapping`: the file as an object.

The same file serves both ways: what signface writes goes to the lab's tiers, and what annotators wrote on them is read
as ours (`signface.elan.translation`). `signface.elan.mapping_draft` writes a first one.
"""

from __future__ import annotations

import tomllib
import warnings
from collections.abc import Mapping as MappingABC
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

from lxml import etree

from signface.elan.document import file_of, named
from signface.elan.vocabularies import external_vocabulary, vocabulary_entries, vocabulary_name
from signface.errors import SignfaceError, SignfaceWarning
from signface.files import reading
from signface.label.vocabulary import AFFECT, Vocabulary


@dataclass(frozen=True)
class ChannelRule:
    """Where a channel goes.

    Parameters
    ----------
    tier : str
        Name of the tier, in which `{signer}` stands for the signer; empty to leave the channel out.
    labels : mapping of str to str
        Our label and the lab's value; an empty value leaves the annotation out.
    transitions : str, optional
        What the transitions of the affect channel become unless `labels` names them; None keeps their names.
    """

    tier: str
    labels: MappingABC[str, str] = field(default_factory=dict)
    transitions: str | None = None

    def value(self, label: str, vocabulary: Vocabulary = AFFECT) -> str | None:
        """The lab's value of a label; None when the annotation is left out."""
        if label in self.labels:
            return self.labels[label] or None
        if self.transitions is not None and vocabulary.is_transition(label):
            return self.transitions or None
        return label


Mapping = MappingABC[str, ChannelRule]


def read_mapping(path: str | PathLike[str]) -> dict[str, ChannelRule]:
    """Read a mapping file.

    Raises
    ------
    SignfaceError
        The file is missing, is no TOML, or holds something else than channels.
    """
    file = Path(path)
    try:
        with reading(file):
            content = tomllib.loads(file.read_text("utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise SignfaceError(f"is no TOML ({error})", file=file) from error
    rules = {}
    for channel, table in content.items():
        if not isinstance(table, dict):
            raise SignfaceError(
                f"{channel} is no table", file=file, hint=f'write [{channel}] and tier = "NAME" under it'
            )
        unknown = sorted(set(table) - {"tier", "labels", "transitions"})
        if unknown:
            raise SignfaceError(
                f"[{channel}] has the unknown key {unknown[0]}",
                file=file,
                hint="the keys are tier, labels, transitions",
            )
        tier, labels, transitions = table.get("tier"), table.get("labels", {}), table.get("transitions")
        if not isinstance(tier, str):
            raise SignfaceError(f'[{channel}] names no tier (tier = "NAME")', file=file)
        if not isinstance(labels, dict) or not all(isinstance(value, str) for value in labels.values()):
            raise SignfaceError(f"[{channel}.labels] must give each label a text", file=file)
        if transitions is not None and not isinstance(transitions, str):
            raise SignfaceError(f"[{channel}] transitions must be a text", file=file)
        rules[channel] = ChannelRule(tier, labels, transitions)
    return rules


def stereotype(root: etree._Element, tier: etree._Element) -> str | None:
    """How a tier depends on its parent (`Symbolic_Association`, ...); None for an independent tier."""
    kind = named(root, "LINGUISTIC_TYPE", tier.get("LINGUISTIC_TYPE_REF"))
    return None if kind is None else kind.get("CONSTRAINTS")


def closed_entries(root: etree._Element, tier: etree._Element) -> dict[str, str] | None:
    """Values and entry ids of a tier's closed vocabulary, in the tier's language where the vocabulary has it.

    None where the tier has no vocabulary, or one whose entries are in another file (`.ecv`) that is not here; the
    latter with a `SignfaceWarning`.
    """
    name = vocabulary_name(root, tier)
    vocabulary = None if name is None else named(root, "CONTROLLED_VOCABULARY", name)
    if vocabulary is not None and vocabulary.get("EXT_REF"):
        vocabulary, where = external_vocabulary(root, vocabulary)
        if vocabulary is None:
            warnings.warn(
                f"{file_of(root)}: the vocabulary {name} of the tier {tier.get('TIER_ID')} is kept in "
                f"{where or 'another file'}, which is not here: its values are not checked; put it beside the file",
                SignfaceWarning,
                stacklevel=2,
            )
    if vocabulary is None:
        return None
    entries: dict[str, str] = {}
    for value, _, identifier in vocabulary_entries(vocabulary, tier.get("LANG_REF")):
        entries.setdefault(value, identifier)
    return entries
