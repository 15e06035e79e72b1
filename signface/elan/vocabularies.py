"""Controlled vocabularies: the values that a tier may hold, with their descriptions and colours.

- `Vocabulary`, `Entry`: what ELAN calls a controlled vocabulary and its entries.
- `AFFECT`: the seven stable expressions and the 42 transitions between them (thesis 4.3.2).
- `INTENSITY`: 1, 2 or 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

from signface.errors import SignfaceError
from signface.label.vocabulary import AFFECTS, COLOURS, join


@dataclass(frozen=True)
class Entry:
    """One value of a controlled vocabulary.

    Parameters
    ----------
    value : str
        What stands in the annotation.
    description : str
        What ELAN shows beside it.
    colour : (3,) tuple of int, optional
        Red, green, blue, 0 to 255.
    """

    value: str
    description: str = ""
    colour: tuple[int, int, int] | None = None

    @property
    def identifier(self) -> str:
        """The entry's `CVE_ID`; it depends on the value only, so that two runs write the same file."""
        return "cveid_" + "".join(c if c.isascii() and c.isalnum() else f"_{ord(c):x}_" for c in self.value)


@dataclass(frozen=True)
class Vocabulary:
    """A closed controlled vocabulary.

    Parameters
    ----------
    name : str
        The `CV_ID`; linguistic types refer to it.
    description : str
    entries : tuple of Entry
    """

    name: str
    description: str
    entries: tuple[Entry, ...]

    @property
    def values(self) -> tuple[str, ...]:
        """The values, in order."""
        return tuple(entry.value for entry in self.entries)

    def check(self, values: list[str], where: str) -> None:
        """Refuse values that are not in the vocabulary.

        Raises
        ------
        SignfaceError
            Names the values and where they were found.
        """
        outside = sorted(set(values) - set(self.values))
        if outside:
            listed = ", ".join(repr(value) for value in outside[:5])
            raise SignfaceError(
                f"{where}: {listed} not in the closed vocabulary {self.name}",
                hint=f"it holds {', '.join(self.values[:12])}{' ...' if len(self.values) > 12 else ''}",
            )


def _affect() -> Vocabulary:
    stable = [Entry(label, name, COLOURS[label]) for label, name in AFFECTS.items()]
    transitions = []
    for before, after in permutations(AFFECTS, 2):
        # Half way between the two, and paler, so that the stable segments stand out on the tier.
        red, green, blue = ((a + b + 2 * 255) // 4 for a, b in zip(COLOURS[before], COLOURS[after]))
        description = f"transition from {AFFECTS[before]} to {AFFECTS[after]}"
        transitions.append(Entry(join(before, after), description, (red, green, blue)))
    return Vocabulary(
        "affect", "Expression held or the transition between two, seven classes of affect", (*stable, *transitions)
    )


#: Stable labels, then transitions named by joining two of them.
AFFECT = _affect()
INTENSITY = Vocabulary(
    "intensity",
    "Intensity of the affect",
    (Entry("1", "slight"), Entry("2", "marked"), Entry("3", "extreme")),
)
