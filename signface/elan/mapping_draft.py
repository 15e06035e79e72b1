"""A first mapping file for a laboratory, of its template or of what its annotators wrote.

- `write_mapping`: the file; `suggest_mapping`: its text.

Tiers and values are recognised by their names. What could not be guessed is said in the file, to be filled in.
"""

from __future__ import annotations

import difflib
import json
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from collections.abc import Mapping as MappingABC
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

from lxml import etree

from signface.channels.events import ChannelEvents
from signface.elan.channels import vocabulary_of
from signface.elan.document import read_document, tier_rows
from signface.elan.mapping import closed_entries, stereotype
from signface.errors import SignfaceError
from signface.files import whole_file
from signface.label.vocabulary import AFFECT, INTENSITY, Vocabulary

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
    "clause": ("clause", "question", "sentence", "cnm"),
}
LABEL_WORDS = {
    "N": ("neutral", "none", "n"),
    "A": ("anger", "angry", "a"),
    "D": ("disgust", "disgusted", "d"),
    "F": ("fear", "afraid", "scared", "f"),
    "J": ("joy", "happy", "happiness", "j"),
    "Sa": ("sadness", "sad", "sa"),
    "Su": ("surprise", "surprised", "su"),
    "raised": ("raise", "br raise", "brow raise", "up", "raising"),
    "lowered": ("lower", "br low", "br lower", "low", "down", "furrow", "furrowed", "frown"),
    "wide": ("open wide", "widened"),
    "squint": ("squinted", "squinting", "narrow", "narrowed"),
    "closed": ("close", "shut"),
    "nod": ("nods", "nodding", "head nod"),
    "shake": ("headshake", "head shake", "shaking", "hs"),
    "chin up": ("head up", "chin raise", "back"),
    "forward": ("turn forward", "head forward", "lean forward", "leaning forward"),
    "wh": ("wh question", "content question", "partial", "i.parcial"),
    "polar": ("yes/no", "yn question", "polar question", "i.polarizada"),
    "negation": ("neg", "negative", "no", "n.no"),
}
#: What the shipped classifier of clauses says.
CLAUSES = Vocabulary(
    "clause",
    ("wh", "polar", "negation"),
    {"wh": "wh-question", "polar": "yes/no question", "negation": "negated clause"},
)


@dataclass
class _Seen:
    """A tier as it stands in all files: its closed values with their names, and how often each is annotated."""

    closed: dict[str, list[str]] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)

    @property
    def values(self) -> dict[str, list[str]]:
        """The values that it may hold or holds, and what each is called."""
        return self.closed or {value: [value] for value in sorted(self.counts)}


def suggest_mapping(
    roots: etree._Element | Sequence[etree._Element], vocabularies: MappingABC[str, Vocabulary | None]
) -> str:
    """A first mapping file, as text: what could be guessed, and the rest to be filled in.

    Parameters
    ----------
    roots : element or sequence of them
        The template, or annotators' documents: tiers that differ by their signer only count as one, and where a tier
        has no closed vocabulary its values are those annotated.
    vocabularies : mapping
        Our channels and their vocabularies.
    """
    tiers: dict[str, _Seen] = {}
    documents = [roots] if isinstance(roots, etree._Element) else list(roots)
    for root in documents:
        rows = tier_rows(root)
        for tier in root.iterfind("TIER"):
            if stereotype(root, tier) not in (None, "Symbolic_Association"):
                continue
            name = tier.get("TIER_ID") or ""
            seen = tiers.setdefault(_pattern(name, tier.get("PARTICIPANT")), _Seen())
            seen.closed |= _names_of_values(root, tier) or {}
            seen.counts.update(value.strip() for _, _, value in rows.get(name, []) if value.strip())
    lines = [
        "# Which channel goes to which tier, and which label becomes which value.",
        '# tier = "" leaves a channel out; a channel without a table goes to a tier of its own, CHANNEL@SIGNER.',
        "# {signer} in a tier's name stands for the signer. A label that is not named stays as it is.",
        f"# Tiers there are: {', '.join(tiers) or 'none'}",
    ]
    free = dict(tiers)
    for channel, vocabulary in vocabularies.items():
        tier = _closest_tier(channel, list(free))
        lines += ["", f"[{channel}]" if tier else f"# [{channel}]"]
        if tier is None:
            lines.append('# tier = ""')
            continue
        lines.append(f"tier = {_toml(tier)}")
        lines += _labels_of(channel, vocabulary, tier, free.pop(tier))
    if free:
        lines += ["", f"# Tiers that no channel goes to: {', '.join(free)}"]
    return "\n".join(lines) + "\n"


def _labels_of(channel: str, vocabulary: Vocabulary | None, tier: str, seen: _Seen) -> list[str]:
    """The lines of a channel's labels."""
    values = seen.values
    if vocabulary is None or not values:
        return []
    affect = channel in ("affect", "affect-doubtful")
    often = {value: f" ({seen.counts[value]})" if seen.counts[value] else "" for value in values}
    lines = [f"# {tier} holds one of: {', '.join(value + often[value] for value in values)}"]
    if affect and not any(AFFECT.is_transition(value) for value in values):
        lines.append('transitions = ""  # the vocabulary has no transitions: they are left out')
    lines.append(f"[{channel}.labels]")
    free = dict(values)
    for entry in vocabulary.entries:
        if affect and AFFECT.is_transition(entry.value):
            continue
        value = _closest_value(entry.value, entry.description, free)
        if value is not None:
            free.pop(value)
        known = f"{_toml_key(entry.value)} = {_toml(value or '')}"
        lines.append(known + ("" if value else "  # no like entry: left out"))
    left = [value for value in free if not (affect and AFFECT.is_transition(value))]
    if left:
        lines.append(f"# values that nothing became: {', '.join(value + often[value] for value in left)}")
    return lines


def write_mapping(
    template: str | PathLike[str] | Sequence[str | PathLike[str]],
    path: str | PathLike[str],
    *,
    channels: Iterable[ChannelEvents] = (),
) -> Path:
    """Write a first mapping file for a lab's template or annotations, to be looked through before it is used.

    Parameters
    ----------
    template : path, or sequence of paths
        An `.etf` or `.eaf`, several of them, or folders of them.
    path : path
        A `.toml` that is not there yet.
    channels : iterable of ChannelEvents
        The further channels that are to be mapped (`signface.channels.rules.closed_vocabularies`).

    Raises
    ------
    SignfaceError
        A template is no EAF, a folder holds none, the path is no `.toml`, exists, or cannot be written.

    Examples
    --------
    >>> import signface as sf
    >>> from signface.elan.mapping import read_mapping
    >>> template = sf.datasets.mini_file().with_name("reference") / "M1_IE_J.eaf"
    >>> read_mapping(write_mapping(template, "mapping.toml"))["affect"].tier
    'affect@{signer}'
    """
    file = Path(path)
    if file.suffix.lower() != ".toml":
        raise SignfaceError("the ending of a mapping file is .toml", file=file)
    if file.exists():
        raise SignfaceError("exists", file=file, hint="name another file, or remove this one")
    named = [template] if isinstance(template, str | PathLike) else list(template)
    files = [one for path in named for one in _documents(Path(path))]
    vocabularies: dict[str, Vocabulary | None] = {
        "affect": AFFECT,
        "affect-confidence": None,
        "intensity": INTENSITY,
        "affect-doubtful": AFFECT,
    }
    vocabularies |= {channel.channel: vocabulary_of(channel) for channel in channels} | {"clause": CLAUSES}
    text = suggest_mapping([read_document(one).getroot() for one in files], vocabularies)
    with whole_file(file) as temporary:
        temporary.write_text(text, "utf-8")
    return file


def _documents(path: Path) -> list[Path]:
    """The file, or those of a folder."""
    if not path.is_dir():
        return [path]
    inside = sorted([*path.glob("*.eaf"), *path.glob("*.etf")])
    if not inside:
        raise SignfaceError(
            "holds no .eaf and no .etf", file=path, hint="name the files of annotators, or their folder"
        )
    return inside


def _pattern(name: str, participant: str | None) -> str:
    """A tier's name with `{signer}` for its participant, or for what follows an `@`."""
    if participant and participant in name:
        return name.replace(participant, "{signer}")
    base, at, _ = name.partition("@")
    return f"{base}@{{signer}}" if at else name


def _closest_tier(channel: str, tiers: list[str]) -> str | None:
    """The tier whose name holds a word of the channel; the shortest of several."""
    for word in (channel, *CHANNEL_WORDS.get(channel, ())):
        named = sorted((tier for tier in tiers if word in tier.lower()), key=lambda tier: (len(tier), tier))
        if named:
            return named[0]
    return None


def _closest_value(label: str, description: str, values: dict[str, list[str]]) -> str | None:
    """The value that in some language is the label, a word for it, or written almost like it."""
    words = [_plain(word) for word in (label, *LABEL_WORDS.get(label, ()), description)]
    lower = {_plain(name): value for value, names in reversed(values.items()) for name in names}
    for word in words:
        if word in lower:
            return lower[word]
    for word in words:
        close = difflib.get_close_matches(word, lower, n=1, cutoff=0.75) if len(word) > 2 else []
        if close:
            return lower[close[0]]
    return None


def _plain(name: str) -> str:
    """Small letters, with blanks for what joins words."""
    return re.sub(r"[\s_-]+", " ", name.lower()).strip()


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


def _toml(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)  # a JSON string is a TOML basic string


def _toml_key(text: str) -> str:
    return text if text.replace("-", "").replace("_", "").isalnum() and text.isascii() else _toml(text)
