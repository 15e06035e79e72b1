"""What is no error in the answers of a study but changes what can be concluded.

- `doubts`: a line each.
- `listed`: the first names, and how many more.
"""

from __future__ import annotations

from collections.abc import Sequence

from signface.study.responses import PERSONAL, SCALES, SPELT_OUT, Responses


def doubts(responses: Responses) -> list[str]:
    """What is no error but changes what can be concluded."""
    table, warnings = responses.table, []
    if responses.simulated:
        warnings.append("SIMULATED ANSWERS: no participant was asked; nothing can be concluded from them")
    if len(responses.methods) == 1:
        warnings.append(
            f"one method only ({responses.methods[0]}): nothing to compare, the tests between methods are left out"
        )
    if len(responses.participants) < 5:
        warnings.append(
            f"{len(responses.participants)} participants: too few for intervals over participants to mean much"
        )
    answer_counts = table.groupby(["expression", "method"]).size().unstack(fill_value=0)
    empty = [
        f"{row} × {column}"
        for row in answer_counts.index
        for column in answer_counts.columns
        if answer_counts.loc[row, column] == 0
    ]
    if empty:
        warnings.append(f"no answer for {listed(empty)}: the tests over expression and method are left out")
    elif answer_counts.to_numpy().min() != answer_counts.to_numpy().max():
        warnings.append(
            "not every expression was shown equally often with every method: means by method mix unequal shares"
        )
    counts = table.groupby("participant").size()
    if counts.nunique() > 1:
        fewer = counts[counts < counts.max()]
        warnings.append(
            f"{len(fewer)} of {len(counts)} participants gave fewer than {counts.max()} answers "
            f"(the fewest: {counts.idxmin()} with {counts.min()}): pairs are made of the answers that exist"
        )
    strange = sorted(set(table["answer_expression"].dropna()) - set(table["expression"]))
    if strange:
        warnings.append(f"answers name expressions that were never played: {listed(strange)}")
    for column, title in responses.questions.items():
        if table[column].nunique() == 1 and column != "correct":
            warnings.append(f"every answer about {title} is {table[column].dropna().iloc[0]:g}: nothing to test")
        elif column in SCALES:
            each = table.dropna(subset=[column]).groupby("participant")[column].agg(["nunique", "size"])
            flat = each[(each["nunique"] == 1) & (each["size"] > 5)]
            if len(flat):
                warnings.append(f"always the same answer about {title}: {listed(list(flat.index))}")
    if "correct" in responses.questions and table["correct"].nunique() == 1:
        warnings.append("every expression was recognised, or none: nothing to test about accuracy")
    for column, title in PERSONAL.items():
        people = responses.people()[column]
        if people.notna().any() and people.isna().any():
            warnings.append(f"{int(people.isna().sum())} participants did not give their {title}")
        if people.nunique() == 1 and len(people) > 1:
            warnings.append(
                f"all participants have the same {title} ({people.dropna().iloc[0]}): its influence is not analysed"
            )
    return warnings


def listed(names: Sequence[str]) -> str:
    """The first `SPELT_OUT` names, and how many more there are."""
    head = ", ".join(str(name) for name in names[:SPELT_OUT])
    return head + (f" and {len(names) - SPELT_OUT} more" if len(names) > SPELT_OUT else "")
