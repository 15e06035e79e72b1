"""How often each test of a study finds a difference between methods that is not there.

Simulates studies without any mean difference, with and without participants who react to methods in their own way,
and prints for each test the share of studies in which it finds a difference at 5 %. Twenty-seven participants and
fifty-four films as in the thesis's first study.

    python benchmarks/study_levels.py --studies 200
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np

from signface.study.reading import validate
from signface.study.statistics.model_tables import compare_methods
from signface.study.statistics.rank_tests import wilcoxon
from signface.study.statistics.simulation import Effects, crossed_design, simulate
from signface.study.statistics.thesis_tables import pairwise_results, participant_means, test_methods

QUESTIONS = ("correct", "answer_difficulty")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--studies", type=int, default=200)
    parser.add_argument("--participants", type=int, default=27)
    arguments = parser.parse_args()
    design = crossed_design("null", ["a", "b", "c"], QUESTIONS, arguments.participants)
    heads = (
        "reactions",
        "question",
        "χ² or Kruskal",
        "pairs",
        "mixed model",
        "averaged",
        "Friedman",
        "Wilcoxon on means",
    )
    print("| " + " | ".join(heads) + " |")
    print("|" + " --- |" * len(heads))
    for reactions in (0.0, 0.4):
        found: dict[str, list[list[float]]] = {question: [] for question in QUESTIONS}
        for seed in range(arguments.studies):
            responses = validate(simulate(design, Effects(participants=0.5, reactions=reactions), seed=seed))
            for question in QUESTIONS:
                models, means = compare_methods(responses, question), participant_means(responses, question)
                found[question].append(
                    [
                        test_methods(responses, question).p,
                        pairwise_results(responses, question)["a", "b"].p,
                        models.likelihood_ratio.p,
                        models.averaged.p,
                        models.over_participants.p,
                        wilcoxon(means["a"], means["b"]).p,
                    ]
                )
        for question, values in found.items():
            shares = (np.array(values) < 0.05).mean(axis=0)
            print(
                f"| {reactions:g} | {question} | " + " | ".join(f"{share:.3f}" for share in shares) + " |", flush=True
            )


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main()
