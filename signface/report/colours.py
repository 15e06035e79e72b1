"""One colour for each label, the same in ELAN, in every figure and in every report."""

from __future__ import annotations

from signface.label.vocabulary import AFFECT, Vocabulary

TRANSITION = "#f4f4f4"
OTHER = "#8c8c8c"


def colour_of(label: str, vocabulary: Vocabulary = AFFECT) -> str:
    """The colour of a label as `#rrggbb`; transitions and labels outside the vocabulary have one of their own.

    Examples
    --------
    >>> colour_of("J"), colour_of("NJ")
    ('#0072b2', '#f4f4f4')
    """
    if label in vocabulary.values:
        return "#{:02x}{:02x}{:02x}".format(*vocabulary.palette[label])
    return TRANSITION if vocabulary.is_transition(label) else OTHER


def ink_on(label: str, vocabulary: Vocabulary = AFFECT) -> str:
    """Black or white, whichever reads better on the colour of a label (WCAG relative luminance)."""
    if label not in vocabulary.values:
        return "black"
    red, green, blue = ((channel / 255) ** 2.2 for channel in vocabulary.palette[label])
    return "white" if 0.2126 * red + 0.7152 * green + 0.0722 * blue < 0.18 else "black"
