"""What a questionnaire is, without the web: whose turn it is, what may be answered, in which order.

- `order_of`: the order in which one participant sees the stimuli.
- `pages_of`, `Page`: the pages of one participant, from the personal questions to the thanks.
- `check_answer`: an answer as it is stored, or why it is refused.
"""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from signface.study.design import Question, Stimulus, Study

#: The stimulus under which the personal questions are stored.
PERSONAL = ""


@dataclass(frozen=True)
class Page:
    """One page of a participant's questionnaire.

    Parameters
    ----------
    kind : str
        `personal`, `film` or `close` (the end of a block, where its answers become final).
    block : int
        Index of its block; -1 for the personal questions.
    stimulus : Stimulus or None
        What it shows.
    number : int
        Place of the film among all of the participant's films, from 1.
    """

    kind: str
    block: int
    stimulus: Stimulus | None = None
    number: int = 0

    def questions(self, study: Study) -> tuple[Question, ...]:
        """The questions that the page asks."""
        if self.kind == "personal":
            return study.personal
        return study.blocks[self.block].questions if self.kind == "film" else ()

    @property
    def key(self) -> str:
        """The stimulus under which its answers are stored."""
        return self.stimulus.name if self.stimulus else PERSONAL


def order_of(study: Study, number: int) -> tuple[tuple[int, ...], ...]:
    """For each block, the places of its stimuli in the order that participant `number` sees them.

    The study's seed and the participant's number give it, so that it can be found again at any time.
    """
    rng = np.random.default_rng([study.seed, number])
    return tuple(tuple(rng.permutation(len(block.stimuli)).tolist()) for block in study.blocks)


def pages_of(study: Study, number: int) -> tuple[Page, ...]:
    """Every page of participant `number`, in order."""
    return _pages(_Same(study), number)


class _Same:
    """A study as a key of a cache: the same object is the same study."""

    def __init__(self, study: Study) -> None:
        self.study = study

    def __hash__(self) -> int:
        return id(self.study)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other.study is self.study


@lru_cache(maxsize=4096)
def _pages(same: _Same, number: int) -> tuple[Page, ...]:
    study = same.study
    pages = [Page("personal", -1)] if study.personal else []
    film = 0
    for block, places in enumerate(order_of(study, number)):
        for place in places:
            film += 1
            pages.append(Page("film", block, study.blocks[block].stimuli[place], film))
        pages.append(Page("close", block))
    return tuple(pages)


def check_answer(question: Question, raw: str | None) -> tuple[str | None, str | None]:
    """An answer as it is stored and None, or None and the word that says why it is refused.

    Parameters
    ----------
    question : Question
    raw : str or None
        What the form held.

    Returns
    -------
    (str or None, str or None)
        `missing` (nothing was answered), `range` (no such choice, or out of range) or `number` (not a whole number).
    """
    text = "".join(c for c in raw or "" if c in "\n\t" or unicodedata.category(c)[0] != "C").strip()
    if not text:
        return ("", None) if question.optional else (None, "missing")
    if question.kind == "text":
        return (text, None) if len(text) <= question.high else (None, "range")
    if question.kind == "choice":
        return (text, None) if text in {choice.value for choice in question.choices} else (None, "range")
    if not (text.isascii() and text.isdigit() and len(text) < 10):
        return None, "number"
    value = int(text)
    return (str(value), None) if question.low <= value <= question.high else (None, "range")
