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
- `write_mapping`: a first mapping file for a template; `suggest_mapping`: its text.
"""

from __future__ import annotations

import difflib
import json
import tomllib
from collections.abc import Iterable
from collections.abc import Mapping as MappingABC
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

from lxml import etree

from signface.channels.events import ChannelEvents
from signface.elan.channels import vocabulary_of
from signface.elan.document import named, read_document
from signface.elan.vocabularies import vocabulary_entries, vocabulary_name
from signface.errors import SignfaceError
from signface.files import reading, whole_file
from signface.label.vocabulary import AFFECT, INTENSITY, Vocabulary


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


#: Words by which a lab's tier or entry is recognised, per channel and per label.
CHANNEL_WORDS = {
    "affect": ("affect", "emotion", "expression", "face", "facial"),
    "affect-confidence": ("confidence", "certainty"),
    "intensity": ("intensity", "degree"),
    "affect-doubtful": ("doubt", "check"),
    "brows": ("brow", "eyebrow"),
    "eyes": ("aperture", "eye aperture", "eyelid", "lid"),
    "blinks": ("blink",),
    "gaze": ("gaze", "look"),
    "nose": ("nose",),
    "mouth": ("mouth", "lips"),
    "cheeks": ("cheek",),
    "head": ("head",),
}
LABEL_WORDS = {
    "N": ("neutral", "none", "n"),
    "A": ("anger", "angry", "a"),
    "D": ("disgust", "disgusted", "d"),
    "F": ("fear", "afraid", "scared", "f"),
    "J": ("joy", "happy", "happiness", "j"),
    "Sa": ("sadness", "sad", "sa"),
    "Su": ("surprise", "surprised", "su"),
}


def suggest_mapping(root: etree._Element, vocabularies: MappingABC[str, Vocabulary | None]) -> str:
    """A first mapping file for a template, as text: what could be guessed, and the rest to be filled in.

    Parameters
    ----------
    root : element
        The template.
    vocabularies : mapping
        Our channels and their vocabularies.
    """
    tiers = {
        tier.get("TIER_ID") or "": tier
        for tier in root.iterfind("TIER")
        if stereotype(root, tier) in (None, "Symbolic_Association")
    }
    lines = [
        "# Which channel goes to which tier, and which label becomes which value.",
        '# tier = "" leaves a channel out; a channel without a table goes to a tier of its own, CHANNEL@SIGNER.',
        "# {signer} in a tier's name stands for the signer. A label that is not named stays as it is.",
        f"# Tiers of the template: {', '.join(tiers) or 'none'}",
    ]
    free = dict(tiers)
    for channel, vocabulary in vocabularies.items():
        tier = _closest_tier(channel, list(free))
        lines += ["", f"[{channel}]" if tier else f"# [{channel}]"]
        if tier is None:
            lines.append('# tier = ""')
            continue
        element = free.pop(tier)
        participant = element.get("PARTICIPANT")
        lines.append(f"tier = {_toml(tier.replace(participant, '{signer}') if participant else tier)}")
        values = _names_of_values(root, element)
        if vocabulary is None or values is None:
            continue
        lines.append(f"# {tier} holds one of: {', '.join(values)}")
        if channel in ("affect", "affect-doubtful") and not any(AFFECT.is_transition(value) for value in values):
            lines.append('transitions = ""  # the vocabulary has no transitions: they are left out')
        lines.append(f"[{channel}.labels]")
        for entry in vocabulary.entries:
            if channel in ("affect", "affect-doubtful") and AFFECT.is_transition(entry.value):
                continue
            value = _closest_value(entry.value, entry.description, values)
            lines.append(
                f"{_toml_key(entry.value)} = {_toml(value or '')}" + ("" if value else "  # no like entry: left out")
            )
    return "\n".join(lines) + "\n"


def write_mapping(
    template: str | PathLike[str], path: str | PathLike[str], *, channels: Iterable[ChannelEvents] = ()
) -> Path:
    """Write a first mapping file for a lab's template, to be looked through before it is used.

    Parameters
    ----------
    template : path
        An `.etf` or `.eaf`.
    path : path
        A `.toml` that is not there yet.
    channels : iterable of ChannelEvents
        The further channels that are to be mapped (`signface.channels.rules.closed_vocabularies`).

    Raises
    ------
    SignfaceError
        The template is no EAF, the path is no `.toml`, exists, or cannot be written.

    Examples
    --------
    >>> import signface as sf
    >>> template = sf.datasets.mini_file().with_name("reference") / "M1_IE_J.eaf"
    >>> read_mapping(write_mapping(template, "mapping.toml"))["affect"].tier
    'affect@{signer}'
    """
    file = Path(path)
    if file.suffix.lower() != ".toml":
        raise SignfaceError("the ending of a mapping file is .toml", file=file)
    if file.exists():
        raise SignfaceError("exists", file=file, hint="name another file, or remove this one")
    vocabularies: dict[str, Vocabulary | None] = {
        "affect": AFFECT,
        "affect-confidence": None,
        "intensity": INTENSITY,
        "affect-doubtful": AFFECT,
    }
    vocabularies |= {channel.channel: vocabulary_of(channel) for channel in channels}
    text = suggest_mapping(read_document(template).getroot(), vocabularies)
    with whole_file(file) as temporary:
        temporary.write_text(text, "utf-8")
    return file


def _closest_tier(channel: str, tiers: list[str]) -> str | None:
    """The tier whose name holds a word of the channel; the shortest of several."""
    for word in (channel, *CHANNEL_WORDS.get(channel, ())):
        named = sorted((tier for tier in tiers if word in tier.lower()), key=lambda tier: (len(tier), tier))
        if named:
            return named[0]
    return None


def _closest_value(label: str, description: str, values: dict[str, list[str]]) -> str | None:
    """The value that in some language is the label, a word for it, or written almost like it."""
    words = (label.lower(), *LABEL_WORDS.get(label, ()), description.lower())
    lower = {name.lower(): value for value, names in reversed(values.items()) for name in names}
    for word in words:
        if word in lower:
            return lower[word]
    for word in words:
        close = difflib.get_close_matches(word, lower, n=1, cutoff=0.75) if len(word) > 2 else []
        if close:
            return lower[close[0]]
    return None


def stereotype(root: etree._Element, tier: etree._Element) -> str | None:
    """How a tier depends on its parent (`Symbolic_Association`, ...); None for an independent tier."""
    kind = named(root, "LINGUISTIC_TYPE", tier.get("LINGUISTIC_TYPE_REF"))
    return None if kind is None else kind.get("CONSTRAINTS")


def _names_of_values(root: etree._Element, tier: etree._Element) -> dict[str, list[str]] | None:
    """The values that a tier's closed vocabulary holds, and how each is called in every language."""
    entries = closed_entries(root, tier)
    if entries is None:
        return None
    names: dict[str, list[str]] = {}
    for value, identifier in entries.items():
        others = [
            name.text or ""
            for entry in root.iterfind("CONTROLLED_VOCABULARY/CV_ENTRY_ML")
            if entry.get("CVE_ID") == identifier and any((v.text or "") == value for v in entry.iterfind("CVE_VALUE"))
            for name in entry.iterfind("CVE_VALUE")
        ]
        names[value] = [value, *others]
    return names


def closed_entries(root: etree._Element, tier: etree._Element) -> dict[str, str] | None:
    """Values and entry ids of a tier's closed vocabulary, in the tier's language where the vocabulary has it.

    None where the tier has no vocabulary, or an external one, whose entries are not in the file.
    """
    name = vocabulary_name(root, tier)
    vocabulary = None if name is None else named(root, "CONTROLLED_VOCABULARY", name)
    if vocabulary is None or vocabulary.get("EXT_REF"):
        return None
    entries: dict[str, str] = {}
    for value, _, identifier in vocabulary_entries(vocabulary, tier.get("LANG_REF")):
        entries.setdefault(value, identifier)
    return entries


def _toml(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)  # a JSON string is a TOML basic string


def _toml_key(text: str) -> str:
    return text if text.replace("-", "").replace("_", "").isalnum() and text.isascii() else _toml(text)
