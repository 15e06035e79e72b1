"""A laboratory's tiers and values read as ours, by the mapping file that also writes ours as theirs.

- `tier_meanings`: which tiers of a file a mapping names, and what their values mean.
- `translated`: annotators' tables with our tiers and labels, so that they can be compared with ours.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from collections.abc import Mapping as MappingABC
from os import PathLike

import pandas as pd

from signface.elan.mapping import Mapping, read_mapping
from signface.errors import SignfaceError

#: What a mapping may be given as.
MappingOrFile = Mapping | str | PathLike[str]


def as_mapping(mapping: MappingOrFile | None) -> Mapping:
    """The mapping, read where it is a file; none for None."""
    if mapping is None:
        return {}
    return mapping if isinstance(mapping, MappingABC) else read_mapping(mapping)


def tier_meanings(mapping: Mapping, tiers: Iterable[str]) -> dict[str, tuple[str, str, dict[str, str]]]:
    """The tiers that a mapping names: the channel, the signer and our label for each value of the laboratory's.

    Parameters
    ----------
    mapping : mapping
        What `signface.elan.mapping.read_mapping` returns.
    tiers : iterable of str
        Names of a file's tiers.

    Returns
    -------
    dict of str to (str, str, dict of str to str)
        Tiers that the mapping does not name are left out. The signer is what stands for `{signer}`, or after an `@`;
        empty where nothing does.

    Raises
    ------
    SignfaceError
        Two labels of a channel become one value, which then says neither.

    Examples
    --------
    >>> from signface.elan.mapping import ChannelRule
    >>> mapping = {"brows": ChannelRule("Brauen_{signer}", {"raised": "br_raise"})}
    >>> tier_meanings(mapping, ["Brauen_K01", "Kopf_K01"])
    {'Brauen_K01': ('brows', 'K01', {'br_raise': 'raised'})}
    """
    meanings = {}
    names = list(tiers)
    for channel, rule in mapping.items():
        if not rule.tier:
            continue
        labels: dict[str, str] = {}
        for label, value in rule.labels.items():
            if value and labels.setdefault(value, label) != label:
                raise SignfaceError(
                    f"the mapping gives {labels[value]} and {label} of {channel} the value {value}, which can be "
                    "written and not be read",
                    hint="leave one of them out of the mapping that reads",
                )
        pattern = re.escape(rule.tier).replace(re.escape("{signer}"), "(?P<signer>.+)", 1)
        pattern = pattern.replace(re.escape("{signer}"), "(?P=signer)")
        for name in names:
            found = re.fullmatch(pattern, name) or (
                None if "(?P" in pattern else re.fullmatch(f"{pattern}@(?P<signer>.+)", name)
            )
            if found is not None:
                meanings[name] = (channel, found.groupdict().get("signer") or "", labels)
    return meanings


def translated(
    annotators: MappingABC[str, MappingABC[str, pd.DataFrame]], mapping: MappingOrFile
) -> dict[str, dict[str, pd.DataFrame]]:
    """The annotators' tables with our names of tiers and labels where a mapping gives them.

    Parameters
    ----------
    annotators : mapping
        Of each annotator the tables `start_s, end_s, label` by tier (`signface.elan.annotators.read_annotators`).
    mapping : mapping or path

    Raises
    ------
    SignfaceError
        The mapping names no tier of any file, or two tiers of one file become one.

    Examples
    --------
    >>> import pandas as pd
    >>> from signface.elan.mapping import ChannelRule
    >>> eva = {"Brauen_K01": pd.DataFrame({"start_s": [0.0], "end_s": [1.0], "label": ["br_raise"]})}
    >>> ours = translated({"eva": eva}, {"brows": ChannelRule("Brauen_{signer}", {"raised": "br_raise"})})
    >>> ours["eva"]["brows@K01"]["label"].tolist()
    ['raised']
    """
    rules = as_mapping(mapping)
    result: dict[str, dict[str, pd.DataFrame]] = {}
    named = False
    for annotator, tiers in annotators.items():
        meanings = tier_meanings(rules, tiers)
        named |= bool(meanings)
        theirs: dict[str, pd.DataFrame] = {}
        for tier, table in tiers.items():
            channel, signer, labels = meanings.get(tier, ("", "", {}))
            name = tier if not channel else f"{channel}@{signer}" if signer else channel
            if name in theirs:
                raise SignfaceError(
                    f"{annotator} would have two tiers {name}", hint="give one of them another name in the mapping"
                )
            ours = [labels.get(str(label).strip(), label) for label in table["label"]]
            theirs[name] = table.assign(label=pd.Series(ours, table.index, dtype=object))
        result[annotator] = theirs
    if not named:
        there = sorted({tier for tiers in annotators.values() for tier in tiers})
        raise SignfaceError(
            "no file has a tier that the mapping names", hint=f"their tiers are {', '.join(there[:12]) or 'none'}"
        )
    return result
