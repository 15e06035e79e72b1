"""Answers of participants who do not exist, to try an analysis, plan a study or test the statistics.

- `Design`: what would be shown and asked; `DESIGNS` are the thesis's three groups (sections 6.3.2 and 6.4.2).
- `Effects`: what differs between methods and between participants.
- `simulate`: a table in the form of a study's csv, with a column `simulated` that says `yes` in every row.

The model is a latent one. A Likert answer is where a latent value falls among six thresholds; the value is the sum of
what the expression and the played intensity do, the method's effect, the participant's own level, the participant's
own reaction to the method, and noise of variance 1. An expression is recognised with the logistic probability of a
similar sum; a wrong answer falls where the thesis's participants erred (section 6.4.3: anger and disgust, fear to
surprise, sadness to fear and surprise). The constants are chosen so that tables look like a study's. They are not
estimates, and no conclusion about faces may be drawn from them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from signface.content import Content
from signface.errors import SignfaceError
from signface.study.responses import COLUMNS, QUESTIONS

EXPRESSIONS = ("A", "D", "F", "J", "Sa", "Su")

#: Where latent values are cut into the answers 1 to 7.
THRESHOLDS = (-2.2, -1.6, -1.0, -0.4, 0.3, 1.1)

#: question: its column in the csv, where that has another name.
_CSV = {"correct": "answer_expression"}

#: What one step of played intensity adds to the latent answer.
_PLAYED = {"answer_intensity": 0.75, "answer_difficulty": 0.15, "answer_credibility": 0.15, "answer_fidelity": 0.1}

#: What an expression adds, for every scale, and the logit of its being recognised.
_EXPRESSION = {"A": 0.1, "D": 0.15, "F": 0.1, "J": 0.0, "Sa": -0.5, "Su": 0.15}
_RECOGNISED = {"A": 0.3, "D": 0.2, "F": -0.9, "J": 2.6, "Sa": 0.0, "Su": 1.6}

#: played: the wrong answers that attract, with their weights; any other wrong answer weighs 1.
_CONFUSED = {"A": {"D": 6}, "D": {"A": 6}, "F": {"Su": 8}, "Sa": {"F": 3, "Su": 3}, "Su": {"F": 3}}


@dataclass(frozen=True, eq=False)
class Design(Content):
    """What participants are shown and asked.

    Parameters
    ----------
    name : str
    stimuli : pandas.DataFrame
        Columns `stimulus`, `expression`, `intensity` and `method`, one row per film.
    questions : tuple of str
        Columns of answers: `correct` stands for the forced choice of an expression.
    participants : int
        How many take part when nobody says otherwise.
    asked : mapping of str to frozenset of str
        Stimulus to its questions, where blocks ask different ones; a stimulus that is not named is asked all.
    labels : tuple of str
        What can be answered to the forced choice; the played expressions when empty.
    """

    name: str
    stimuli: pd.DataFrame
    questions: tuple[str, ...]
    participants: int = 20
    asked: Mapping[str, frozenset[str]] = field(default_factory=dict)
    labels: tuple[str, ...] = ()


@dataclass(frozen=True)
class Effects:
    """What differs between methods and between participants.

    Parameters
    ----------
    methods : mapping of (method, question) to float
        Shift of the latent answer: in standard deviations of the noise for scales, in logits for `correct`. A
        question `*` means all of them. Absent means 0.
    participants : float
        Standard deviation of the participants' own levels.
    reactions : float
        Standard deviation of a participant's own reaction to a method, which makes methods differ for a person
        although they do not on average.
    """

    methods: Mapping[tuple[str, str], float] = field(default_factory=dict)
    participants: float = 0.5
    reactions: float = 0.0

    def of(self, method: str, question: str) -> float:
        """The shift of one question by one method."""
        return self.methods.get((method, question), self.methods.get((method, "*"), 0.0))


def crossed_design(name: str, methods: Sequence[str], questions: Sequence[str], participants: int) -> Design:
    """Six expressions, three intensities, every method: 18 films a method, as in thesis 6.1."""
    rows = [
        {
            "stimulus": f"{expression}{intensity}_{method}",
            "expression": expression,
            "intensity": intensity,
            "method": method,
        }
        for expression in EXPRESSIONS
        for intensity in (1, 2, 3)
        for method in methods
    ]
    return Design(name, pd.DataFrame(rows), tuple(questions), participants)


_FOUR = ("correct", "answer_intensity", "answer_difficulty", "answer_credibility")

#: name: methods, questions and participants of the thesis's three groups.
DESIGNS = {
    "group-1": (("LSTS30", "LSTS50", "LSTS70"), _FOUR, 27),
    "group-2a": (("LSTS30", "FS", "video"), _FOUR, 21),
    "group-2b": (("LSTS30", "FS"), ("answer_fidelity",), 20),
}


def thesis_design(name: str) -> Design:
    """One of `DESIGNS`.

    Raises
    ------
    SignfaceError
        There is no design of that name.
    """
    if name not in DESIGNS:
        raise SignfaceError(f"{name!r} is no design", hint=f"name a study's folder, or one of {', '.join(DESIGNS)}")
    methods, questions, participants = DESIGNS[name]
    return crossed_design(name, methods, questions, participants)


def study_design(name: str) -> Design:
    """The design of a study's folder, or one of the thesis's by name.

    Raises
    ------
    SignfaceError
        There is neither a folder nor a design of that name.
    """
    if not Path(name).exists():
        return thesis_design(name)

    from signface.study.design import read_study

    study = read_study(name, films=False)
    rows, asked, labels = [], {}, []
    for block in study.blocks:
        columns = {question.column for question in block.questions}
        columns_asked = frozenset(column for column in QUESTIONS if _CSV.get(column, column) in columns)
        labels += [
            choice.value
            for question in block.questions
            if question.column == _CSV["correct"]
            for choice in question.choices
        ]
        for stimulus in block.stimuli:
            asked[stimulus.name] = columns_asked
            rows.append(
                {
                    "stimulus": stimulus.name,
                    "expression": stimulus.expression,
                    "intensity": stimulus.intensity,
                    "method": stimulus.method,
                }
            )
    questions = tuple(column for column in QUESTIONS if any(column in of_stimulus for of_stimulus in asked.values()))
    if not questions:
        raise SignfaceError(
            "asks nothing that can be simulated",
            file=name,
            hint=f"it knows {', '.join(_CSV.get(column, column) for column in QUESTIONS)}",
        )
    return Design(study.name, pd.DataFrame(rows), questions, asked=asked, labels=tuple(dict.fromkeys(labels)))


def simulate(
    design: Design, effects: Effects | None = None, *, participants: int | None = None, seed: int = 0
) -> pd.DataFrame:
    """Answers of simulated participants, each to every stimulus of the design.

    Parameters
    ----------
    design : Design
    effects : Effects, optional
        No difference between methods when not given.
    participants : int, optional
        The design's own number when not given.
    seed : int
        The same seed gives the same bytes.

    Returns
    -------
    pandas.DataFrame
        The columns of a study's csv, and `simulated`.

    Raises
    ------
    SignfaceError
        An effect names a method or a question that the design does not have, or there is no participant.
    """
    effects = effects or Effects()
    methods = sorted(design.stimuli["method"].unique())
    for method, question in effects.methods:
        if method not in methods:
            raise SignfaceError(f"no method {method!r} in the design", hint=f"its methods are {', '.join(methods)}")
        if question != "*" and question not in design.questions:
            raise SignfaceError(f"{question!r} is not asked", hint=f"the design asks {', '.join(design.questions)}")
    count = design.participants if participants is None else participants
    if count < 1:
        raise SignfaceError("a study needs participants", hint="ask for at least one")
    rng = np.random.default_rng(seed)
    stimuli = design.stimuli.reset_index(drop=True)
    labels = sorted(set(stimuli["expression"]) | set(design.labels))
    method_index = stimuli["method"].map(methods.index).to_numpy()
    width = len(str(count))
    blocks = []
    for number in range(1, count + 1):
        person = {
            "participant": f"S{number:0{width}d}",
            "age": int(18 + rng.gamma(1.2, 6.0)),
            "gender": str(rng.choice(["F", "M"])),
            "avatar_habit": int(rng.integers(1, 8)),
            "vision_problem": str(rng.choice(["yes", "no"], p=[0.4, 0.6])),
        }
        block = stimuli.sample(frac=1, random_state=int(rng.integers(2**31))).assign(**person)
        for question in QUESTIONS:
            if question not in design.questions:
                continue
            participant_shift = rng.normal(0, effects.participants)
            reactions = rng.normal(0, effects.reactions, len(methods)) if effects.reactions else np.zeros(len(methods))
            shift = np.array([effects.of(method, question) for method in methods]) + reactions
            level = participant_shift + shift[method_index[block.index]]
            if question == "correct":
                block["answer_expression"] = _recognise(block["expression"].tolist(), level, labels, rng)
            else:
                block[question] = _rate(block, question, level, rng)
            answered = [question in design.asked.get(name, design.questions) for name in block["stimulus"]]
            column = _CSV.get(question, question)
            block[column] = block[column].where(answered)
        blocks.append(block)
    table = pd.concat(blocks, ignore_index=True).assign(simulated="yes")
    return table.reindex(columns=[*COLUMNS, "simulated"])


def _recognise(played: list[str], level: np.ndarray, labels: list[str], rng: np.random.Generator) -> list[str]:
    answers = []
    for expression, shift in zip(played, level):
        probability = 1 / (1 + np.exp(-(_RECOGNISED.get(expression, 0.5) + shift)))
        wrong = [label for label in labels if label != expression]
        if rng.random() < probability or not wrong:
            answers.append(expression)
            continue
        weights = np.array([_CONFUSED.get(expression, {}).get(label, 1) for label in wrong], float)
        answers.append(str(rng.choice(wrong, p=weights / weights.sum())))
    return answers


def _rate(block: pd.DataFrame, question: str, level: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    played = block["intensity"].fillna(2).to_numpy(float) - 2
    expression = block["expression"].map(lambda label: _EXPRESSION.get(label, 0.0)).to_numpy(float)
    latent = level + expression + _PLAYED[question] * played + rng.normal(0, 1, len(block))
    return 1 + np.searchsorted(THRESHOLDS, latent)
