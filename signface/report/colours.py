"""One colour for each expression, the same in ELAN, in every figure and in every report."""

from __future__ import annotations

from signface.label.vocabulary import COLOURS, is_transition

TRANSITION = "#f4f4f4"
OTHER = "#8c8c8c"


def colour_of(label: str) -> str:
    """The colour of a label as `#rrggbb`; transitions and labels outside the vocabulary have one of their own."""
    if label in COLOURS:
        return "#{:02x}{:02x}{:02x}".format(*COLOURS[label])
    return TRANSITION if is_transition(label) else OTHER


def ink_on(label: str) -> str:
    """Black or white, whichever reads better on the colour of a label (WCAG relative luminance)."""
    if label not in COLOURS:
        return "black"
    red, green, blue = ((channel / 255) ** 2.2 for channel in COLOURS[label])
    return "white" if 0.2126 * red + 0.7152 * green + 0.0722 * blue < 0.18 else "black"
