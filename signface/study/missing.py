"""Words that say that nothing was answered, as the programs write them that answers pass through.

- `is_missing`: whether a cell says so.
- `NO_NUMBERS`: codes that say so in columns of numbers.
"""

from __future__ import annotations

import re

#: In small letters: R and SPSS (`NA`, `#NULL!`), pandas and NumPy (`NaN`, `<NA>`, `1.#QNAN`), JavaScript (`null`,
#: `undefined`), SQL (`\\N`), spreadsheets (`#N/A`), people (`n/a`, a dash, a question mark).
_WORDS = {
    *("", "na", "n/a", "n.a.", "n.a", "n. a.", "nan", "-nan", "+nan", "nan(ind)", "-nan(ind)", "<na>"),
    *("#n/a", "#n/a n/a", "#na", "#null!", "null", "nil", "undefined", "\\n", "missing", "<missing>", "no answer"),
    *("na_character_", "na_integer_", "na_real_"),
    *("1.#qnan", "-1.#qnan", "1.#ind", "-1.#ind", "-", "--", "---", "–", "—", "?"),
}

#: SAS writes a dot, or a dot and a letter; Stata and SPSS a dot.
_DOTS = re.compile(r"\.[a-z_]?|\.{2,3}|…")

#: Codes of SPSS's and Qualtrics's users for an answer that is not there. No question of a study has such an answer.
NO_NUMBERS = {"-9", "-99", "-999", "-9999", "-88", "-77", "none", "#value!", "#div/0!", "#ref!", "#name?"}


def is_missing(word: str, *, number: bool = False) -> bool:
    """Whether a cell says that nothing was answered.

    Parameters
    ----------
    word : str
        The cell without blanks at its ends.
    number : bool
        Whether its column holds numbers, where no word is an answer.

    Returns
    -------
    bool
        `None` as Python writes it is missing; `none` may be the choice "none of these" and is an answer.

    Examples
    --------
    >>> [is_missing(word) for word in ("", "NA", "n/a", ".", "Sa", "none", "None")]
    [True, True, True, True, False, False, True]
    >>> is_missing("-99"), is_missing("-99", number=True), is_missing("-99.0", number=True)
    (False, True, True)
    """
    small = word.lower()
    if small in _WORDS or _DOTS.fullmatch(small) or word == "None":
        return True
    return number and re.sub(r"\.0+$", "", small) in NO_NUMBERS
