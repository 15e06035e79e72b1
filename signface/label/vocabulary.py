"""Vocabularies: the values that a tier may hold, with their descriptions and colours.

- `Vocabulary`: one of them; `join`, `split` and `is_transition` speak of its transitions.
- `Entry`: one value.
- `AFFECT`: the seven stable expressions and the transitions between them (thesis 4.3.2).
- `INTENSITY`: 1, 2 or 3.
- `PALETTE`: colours for values that have none of their own.

`signface.elan.vocabularies` reads them from EAFs, templates and text files.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import permutations
from typing import Any, NamedTuple

from signface.errors import SignfaceError

#: Red, green and blue, 0 to 255.
Colour = tuple[int, int, int]

#: Okabe and Ito's colours, told apart by colour-blind readers. Where there are more values, they come again lighter and
#: darker.
PALETTE: tuple[Colour, ...] = (
    (230, 159, 0),
    (86, 180, 233),
    (0, 158, 115),
    (240, 228, 66),
    (0, 114, 178),
    (213, 94, 0),
    (204, 121, 167),
)

#: The colour of a face at rest, or of what is not annotated.
GREY: Colour = (153, 153, 153)

#: Names and descriptions of the value that says that nothing is shown.
RESTING = ("none", "neutral")


#: The label of what nobody annotated.
NONE = "none"

#: The label of what a model abstains from (`signface.label.familiarity`). It is not rest: something is shown.
UNKNOWN = "unknown"


class Entry(NamedTuple):
    """One value of a vocabulary.

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
    colour: Colour | None = None


@dataclass(frozen=True)
class Vocabulary:
    """The values that a tier may hold: a closed controlled vocabulary, as ELAN calls it.

    Parameters
    ----------
    name : str
        The `CV_ID` in an EAF.
    values : tuple of str
        The labels of stable segments, in the order in which tables show them.
    descriptions : mapping of str to str
        What values stand for, where that is known.
    colours : mapping of str to (3,) tuple of int
        Red, green and blue of values, 0 to 255, where they have colours of their own.
    transitions : bool
        Whether stretches between two values are annotated too, each named by joining the two.
    description : str
        Of the vocabulary.
    blank : str
        The value that stands for what nobody annotated; it is learnt and found, and stands in no annotation.

    Raises
    ------
    SignfaceError
        There is no value, one is empty or there twice, something is said of a value that is not there, a colour is
        none, or the names of two transitions are the same.

    See Also
    --------
    signface.elan.vocabularies.read_vocabulary : from an EAF, a template or a text file.

    Examples
    --------
    >>> import signface as sf
    >>> from signface.label.vocabulary import AFFECT
    >>> brows = sf.Vocabulary("brows", ("none", "raised", "lowered"), {"raised": "eyebrows raised"})
    >>> brows.rest, brows.describe("raised"), brows.describe("lowered")
    ('none', 'eyebrows raised', 'lowered')
    >>> AFFECT.join("N", "Sa"), AFFECT.split("NSa")
    ('NSa', ('N', 'Sa'))
    """

    name: str
    values: tuple[str, ...]
    descriptions: Mapping[str, str] = field(default_factory=dict)
    colours: Mapping[str, Colour] = field(default_factory=dict)
    transitions: bool = False
    description: str = ""
    blank: str = ""

    def __post_init__(self) -> None:
        values = tuple(self.values)
        object.__setattr__(self, "values", values)
        if not values or not all(isinstance(value, str) and value.strip() for value in values):
            raise SignfaceError(f"the vocabulary {self.name} has no value, or an empty one: {list(values)}")
        if len(set(values)) < len(values):
            twice = next(value for value in values if values.count(value) > 1)
            raise SignfaceError(f"the vocabulary {self.name} has {twice!r} twice")
        strangers = sorted({*self.descriptions, *self.colours, self.blank or values[0]} - set(values))
        if strangers:
            raise SignfaceError(f"the vocabulary {self.name} has no value {strangers[0]!r}, which it describes")
        described = {value: str(self.descriptions[value]) for value in values if self.descriptions.get(value)}
        object.__setattr__(self, "descriptions", described)
        coloured = {value: _colour(self.colours[value], value) for value in values if value in self.colours}
        object.__setattr__(self, "colours", coloured)
        if self.transitions and len(self._pairs) + len(values) < len(values) ** 2:
            raise SignfaceError(
                f"transitions of the vocabulary {self.name} cannot be named by joining two values: "
                "names would mean two things",
                hint="rename values, or annotate no transitions",
            )

    def __hash__(self) -> int:
        return hash((self.name, self.values, self.transitions))

    @classmethod
    def of(cls, entries: Iterable[Entry], name: str, description: str = "") -> Vocabulary:
        """The vocabulary of the values that a tier may hold, transitions among them if every two values are joined.

        Examples
        --------
        >>> import signface as sf
        >>> from signface.label.vocabulary import AFFECT
        >>> sf.Vocabulary.of(AFFECT.entries, "affect", AFFECT.description) == AFFECT
        True
        """
        listed = {entry.value: entry for entry in entries}
        joined = {a + b for a, b in permutations(listed, 2)} & set(listed)
        stable = [entry for value, entry in listed.items() if value not in joined]
        moving = bool(joined) and len(stable) > 1 and joined == {a.value + b.value for a, b in permutations(stable, 2)}
        return cls(
            name,
            tuple(entry.value for entry in (stable if moving else listed.values())),
            {e.value: e.description for e in (stable if moving else listed.values())},
            {e.value: e.colour for e in (stable if moving else listed.values()) if e.colour is not None},
            transitions=moving,
            description=description,
        )

    @property
    def rest(self) -> str:
        """The value that says that nothing is shown: called or described as `none` or `neutral`; else empty."""
        for value in self.values:
            if value.casefold() in RESTING or self.descriptions.get(value, "").casefold() in RESTING:
                return value
        return ""

    @cached_property
    def _pairs(self) -> dict[str, tuple[str, str]]:
        """The two values of each name of a transition; of no name that has two meanings."""
        if not self.transitions:
            return {}
        pairs = {before + after: (before, after) for before, after in permutations(self.values, 2)}
        return {name: pair for name, pair in pairs.items() if name not in self.values}

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """Everything that a tier may hold: the values, then the names of the transitions."""
        stable = [
            Entry(value, self.descriptions.get(value, ""), self.colours.get(value))
            for value in self.values
            if value != self.blank
        ]
        moving = [
            Entry(name, self.describe(name), self._between(*pair) if self.colours else None)
            for name, pair in self._pairs.items()
        ]
        return (*stable, *moving)

    @cached_property
    def allowed(self) -> tuple[str, ...]:
        """Everything that may stand in an annotation: the values, then the names of the transitions."""
        return tuple(entry.value for entry in self.entries)

    @cached_property
    def palette(self) -> dict[str, Colour]:
        """A colour for every value: its own, grey for the value at rest, else one of `PALETTE` that is not taken."""
        taken = set(self.colours.values())
        free = iter(colour for colour in _shades(len(self.values) + len(taken)) if colour not in taken)
        return {value: self.colours.get(value) or (GREY if value == self.rest else next(free)) for value in self.values}

    def join(self, before: str, after: str) -> str:
        """Name of the transition from one value to another.

        Raises
        ------
        SignfaceError
            The vocabulary has no transitions, or a label is not in it.
        """
        for label in (before, after):
            if label not in self.values:
                raise SignfaceError(f"{label!r} is no label of {self.name}", hint=f"the labels are {self._few}")
        if not self.transitions:
            raise SignfaceError(f"the vocabulary {self.name} has no transitions")
        return before + after

    def split(self, name: str) -> tuple[str, str]:
        """The two values of a transition's name.

        Raises
        ------
        SignfaceError
            The name is not made of two values.
        """
        if name in self._pairs:
            return self._pairs[name]
        raise SignfaceError(f"{name!r} is no name of a transition", hint=f"join two of {self._few}")

    def is_transition(self, name: str) -> bool:
        """Whether `name` is the name of a transition."""
        return name in self._pairs

    def describe(self, name: str) -> str:
        """What a value or the name of a transition stands for; itself where nothing is said of it."""
        if name in self._pairs:
            before, after = self._pairs[name]
            return f"transition from {self.describe(before)} to {self.describe(after)}"
        return self.descriptions.get(name, name)

    def spelt(self, value: str) -> str:
        """A value with what it stands for: `joy (J)`; the value alone where nothing is said of it."""
        return f"{self.descriptions[value]} ({value})" if value in self.descriptions else value

    def check(self, values: Iterable[str], where: str) -> None:
        """Refuse what is not in the vocabulary.

        Raises
        ------
        SignfaceError
            Names the values and where they were found.
        """
        outside = sorted(set(values) - set(self.allowed))
        if outside:
            raise SignfaceError(
                f"{where}: {', '.join(repr(value) for value in outside[:5])} not in the closed vocabulary {self.name}",
                hint=f"it holds {self._few}",
            )

    def including(self, value: str) -> Vocabulary:
        """The vocabulary with one value more, at its end, unless it has it."""
        return self if value in self.values else replace(self, values=(*self.values, value))

    def abstains(self, label: str) -> bool:
        """Whether a label says that a model did not know: `UNKNOWN`, or a transition from or to it.

        Examples
        --------
        >>> from signface.label.vocabulary import AFFECT
        >>> [AFFECT.abstains(label) for label in ("unknown", "Nunknown", "NJ")]
        [True, True, False]
        """
        if UNKNOWN in self.values:
            return False
        wide = self.including(UNKNOWN)
        return label == UNKNOWN or (wide.is_transition(label) and UNKNOWN in wide.split(label))

    def with_blank(self, value: str = NONE) -> Vocabulary:
        """The vocabulary with a value for what nobody annotated; itself where it has that value.

        Examples
        --------
        >>> import signface as sf
        >>> brows = sf.Vocabulary("brows", ("raised", "lowered")).with_blank()
        >>> brows.values, brows.allowed
        (('raised', 'lowered', 'none'), ('raised', 'lowered'))
        """
        return self if value in self.values else replace(self.including(value), blank=value)

    @classmethod
    def holding(cls, labels: Iterable[str], name: str = "labels") -> Vocabulary:
        """`AFFECT` where it holds all of the labels, else a vocabulary of them in alphabetical order.

        Examples
        --------
        >>> import signface as sf
        >>> from signface.label.vocabulary import AFFECT
        >>> sf.Vocabulary.holding(["J", "N", "NJ"]) is AFFECT
        True
        >>> sf.Vocabulary.holding(["raised", "lowered", "raised"]).values
        ('lowered', 'raised')
        """
        distinct = {str(label) for label in labels}
        return AFFECT if distinct <= set(AFFECT.allowed) else cls(name, tuple(sorted(distinct)))

    def without_blank(self) -> Vocabulary:
        """The vocabulary of what stands in annotations; the inverse of `with_blank`."""
        return replace(
            self,
            values=tuple(value for value in self.values if value != self.blank),
            descriptions={value: words for value, words in self.descriptions.items() if value != self.blank},
            colours={value: colour for value, colour in self.colours.items() if value != self.blank},
            blank="",
        )

    def coloured(self) -> Vocabulary:
        """The vocabulary in which every value has its colour of `palette`."""
        return replace(self, colours=self.palette)

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {
            "name": self.name,
            "values": list(self.values),
            "descriptions": dict(self.descriptions),
            "colours": {value: list(colour) for value, colour in self.colours.items()},
            "transitions": self.transitions,
            "description": self.description,
            "blank": self.blank,
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Vocabulary:
        """The vocabulary from what `as_dict` gives.

        Raises
        ------
        SignfaceError
            It is no vocabulary.

        Examples
        --------
        >>> import signface as sf
        >>> from signface.label.vocabulary import AFFECT
        >>> sf.Vocabulary.from_dict(AFFECT.as_dict()) == AFFECT
        True
        """
        try:
            return cls(**{**content, "values": tuple(content["values"])})
        except (TypeError, KeyError, AttributeError, ValueError) as error:
            raise SignfaceError(f"is no vocabulary: {error}") from error

    def _between(self, before: str, after: str) -> Colour:
        """Half way between the two, and paler, so that the stable segments stand out on the tier."""
        red, green, blue = ((a + b + 2 * 255) // 4 for a, b in zip(self.palette[before], self.palette[after]))
        return red, green, blue

    @property
    def _few(self) -> str:
        return " ".join(self.values[:12]) + (" ..." if len(self.values) > 12 else "")


def _colour(colour: Any, value: str) -> Colour:
    if len(colour) != 3 or not all(isinstance(part, int) and 0 <= part <= 255 for part in colour):
        raise SignfaceError(f"the colour of {value!r} is no red, green and blue from 0 to 255: {colour}")
    red, green, blue = colour
    return red, green, blue


def _shades(count: int) -> list[Colour]:
    """`count` colours: those of `PALETTE`, then lighter and darker ones, then again."""
    shades: list[Colour] = []
    for towards, share in ((0, 0.0), (255, 0.45), (0, 0.4), (255, 0.7), (0, 0.65)):
        for red, green, blue in PALETTE:
            mixed = [round(part + (towards - part) * share) for part in (red, green, blue)]
            shades.append((mixed[0], mixed[1], mixed[2]))
    return [shades[number % len(shades)] for number in range(count + len(PALETTE))]


#: Expressions of affect. Joy is blue and fear is light blue as in the thesis's figure 4.3.
AFFECT = Vocabulary(
    "affect",
    ("N", "A", "D", "F", "J", "Sa", "Su"),
    {
        "N": "neutral",
        "A": "anger",
        "D": "disgust",
        "F": "fear",
        "J": "joy",
        "Sa": "sadness",
        "Su": "surprise",
    },
    {
        "N": GREY,
        "A": (213, 94, 0),
        "D": (0, 158, 115),
        "F": (86, 180, 233),
        "J": (0, 114, 178),
        "Sa": (204, 121, 167),
        "Su": (240, 228, 66),
    },
    transitions=True,
    description="Expression held or the transition between two, seven classes of affect",
)

INTENSITY = Vocabulary(
    "intensity",
    ("1", "2", "3"),
    {"1": "slight", "2": "marked", "3": "extreme"},
    description="Intensity of the affect",
)
