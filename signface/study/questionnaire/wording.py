"""The words of the pages: `pages/words.toml` for the languages that ship, a study's own for any other."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from signface.errors import SignfaceError


@cache
def shipped_words() -> dict[str, dict[str, str]]:
    """The words of every language that ships, by language."""
    return tomllib.loads((Path(__file__).parent / "pages" / "words.toml").read_text(encoding="utf-8"))


def wording(language: str, changed: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """The words of one language: those that ship, replaced or completed by a study's `[words.LANGUAGE]`.

    Raises
    ------
    SignfaceError
        The language does not ship and the study does not give all of its words.
    """
    shipped = shipped_words()
    words = {**shipped.get(language, {}), **changed.get(language, {})}
    missing = [key for key in shipped["en"] if key not in words]
    if missing:
        raise SignfaceError(
            f"the language {language} has no words for: {', '.join(missing[:6])}{' ...' * (len(missing) > 6)}",
            hint=f"signface ships {', '.join(shipped)}; give the others under [words.{language}] in study.toml",
        )
    return words
