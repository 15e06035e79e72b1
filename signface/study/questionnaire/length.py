"""How long a study takes a participant, from its films and questions.

- `study_minutes`: minutes, in steps of five.
- `with_counts`: a text of the study in which `{films}` and `{minutes}` stand for this study's own.
"""

from __future__ import annotations

from pathlib import Path

from signface.study.design import Study

#: A film is seen this often; seconds for an answer; seconds of a film whose length is not known.
TIMES_SEEN, ANSWER_S, FILM_S = 2.0, 6.0, 4.0


def film_seconds(file: Path) -> float | None:
    """Length of an MP4 by its movie header (ISO/IEC 14496-12, 8.2.2); None for other files."""
    try:
        content = file.read_bytes()
    except OSError:
        return None
    start = content.find(b"mvhd") + 4
    if start < 4 or len(content) < start + 32:
        return None
    long = content[start] == 1  # version 1 has times of eight bytes
    place, size = (start + 20, 8) if long else (start + 12, 4)
    scale = int.from_bytes(content[place : place + 4], "big")
    length = int.from_bytes(content[place + 4 : place + 4 + size], "big")
    return length / scale if scale and length < 2 ** (8 * size) - 1 else None


def study_minutes(study: Study) -> int:
    """Minutes that a participant needs, in steps of five: each film seen twice, six seconds an answer."""
    seconds = ANSWER_S * len(study.personal)
    lengths = {film: film_seconds(study.folder / film) for film in study.films}
    for block in study.blocks:
        for stimulus in block.stimuli:
            known = [FILM_S if (length := lengths[film]) is None else length for film in stimulus.films]
            seconds += TIMES_SEEN * max(known) + ANSWER_S * len(block.questions)  # two films play together
    return max(5, 5 * round(seconds / 300))


def with_counts(text: str, study: Study) -> str:
    """A text of the study with `{films}`, how many pages show films, and `{minutes}` filled in."""
    if "{films}" not in text and "{minutes}" not in text:
        return text
    pages = sum(len(block.stimuli) for block in study.blocks)
    return text.replace("{films}", str(pages)).replace("{minutes}", str(study_minutes(study)))
