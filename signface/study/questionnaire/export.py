"""The answers as the csv that `signface study analyse` reads: one row per participant and stimulus.

- `export_table`: the table.
- `write_export`: the csv.
"""

from __future__ import annotations

import csv
from os import PathLike

from signface.files import whole_file
from signface.study.design import Study
from signface.study.questionnaire.questionnaire import PERSONAL
from signface.study.questionnaire.store import Store
from signface.study.responses import COLUMNS


def export_table(study: Study, store: Store, *, finished_only: bool = False) -> tuple[list[str], list[dict[str, str]]]:
    """Columns and rows of the export.

    Parameters
    ----------
    study, store
    finished_only : bool
        Leave out participants who did not come to the end.

    Returns
    -------
    (list of str, list of dict)
        Rows by participant and stimulus. A text that a spreadsheet would take for a formula begins with an apostrophe.
    """
    people, answers = store.everything()
    wanted = {person.id: person.pseudonym for person in people if person.finished or not finished_only}
    stimuli = study.stimuli
    personal: dict[int, dict[str, str]] = {}
    rows: dict[tuple[int, str], dict[str, str]] = {}
    for participant, name, question, value in answers:
        if participant not in wanted:
            continue
        if name == PERSONAL:
            personal.setdefault(participant, {})[question] = value
        elif name in stimuli:
            rows.setdefault((participant, name), {})[question] = value
    asked = [question.column for question in study.personal] + list(study.questions)
    columns = [*COLUMNS, *(column for column in asked if column not in COLUMNS)]
    table = []
    for (participant, name), values in rows.items():
        stimulus = stimuli[name]
        cells = {
            "participant": wanted[participant],
            "stimulus": name,
            "expression": stimulus.expression,
            "intensity": str(stimulus.intensity),
            "method": stimulus.method,
            **personal.get(participant, {}),
            **values,
        }
        table.append({column: _harmless(cells.get(column, "")) for column in columns})
    return columns, sorted(table, key=lambda row: (row["participant"], row["stimulus"]))


def write_export(
    study: Study, store: Store, path: str | PathLike[str], *, finished_only: bool = False
) -> tuple[int, int]:
    """Write the csv; the numbers of participants and of rows in it.

    Raises
    ------
    SignfaceError
        The file cannot be written.
    """
    columns, rows = export_table(study, store, finished_only=finished_only)
    with whole_file(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return len({row["participant"] for row in rows}), len(rows)


def _harmless(text: str) -> str:
    return f"'{text}" if text[:1] in ("=", "+", "-", "@", "\t") else text
