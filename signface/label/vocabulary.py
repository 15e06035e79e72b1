"""The closed vocabulary of the affect channel (thesis 4.3.2).

- `AFFECTS`: the seven labels of stable segments and what they stand for.
- `COLOURS`: the colour of each.
- `join`, `split`: the names of transitions, made of two of them.
"""

from __future__ import annotations

from signface.errors import SignfaceError

#: label: the expression it stands for, in the order in which tables show them.
AFFECTS = {
    "N": "neutral",
    "A": "anger",
    "D": "disgust",
    "F": "fear",
    "J": "joy",
    "Sa": "sadness",
    "Su": "surprise",
}

#: label: red, green and blue (0 to 255), in ELAN and in every figure. Okabe and Ito's colours, told apart by
#: colour-blind readers; joy is blue and fear is light blue as in the thesis's figure 4.3.
COLOURS = {
    "N": (153, 153, 153),
    "A": (213, 94, 0),
    "D": (0, 158, 115),
    "F": (86, 180, 233),
    "J": (0, 114, 178),
    "Sa": (204, 121, 167),
    "Su": (240, 228, 66),
}


def join(before: str, after: str) -> str:
    """Name of the transition from one expression to another: `join("N", "Sa")` is `NSa`."""
    for label in (before, after):
        if label not in AFFECTS:
            raise SignfaceError(f"{label!r} is no label of an expression", hint=f"the labels are {' '.join(AFFECTS)}")
    return before + after


def split(name: str) -> tuple[str, str]:
    """The two expressions of a transition's name: `split("NSa")` is `("N", "Sa")`.

    Raises
    ------
    SignfaceError
        The name is not made of two labels.
    """
    for before in AFFECTS:
        if name.startswith(before) and name[len(before) :] in AFFECTS:
            return before, name[len(before) :]
    raise SignfaceError(f"{name!r} is no name of a transition", hint=f"join two of {' '.join(AFFECTS)}")


def is_transition(name: str) -> bool:
    """Whether `name` is the name of a transition."""
    return any(name == before + after for before in AFFECTS for after in AFFECTS)
