"""Build the classifier of questions and negation that ships: `lse-questions`, with its card.

    python models/build_questions.py FOLDER

FOLDER is a corpus of the recordings of LSE_GFE_UVIGO that are at hand: OpenFace tables of sentences in Spanish Sign
Language with the tier CNM_tipo in ELAN files (repository mporta-gtm/GrammaticalFacialExpressions, MIT licence, 2022).
Action units and the head's pose are learnt from. `i.xeral` and `n.resto`, which the corpus's authors leave out, are
neither learnt nor counted as nothing. The same corpus gives the same bytes; it takes some minutes.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

from signface.corpus.examples import solve_corpus
from signface.corpus.levels import learn_signers
from signface.corpus.manifest import read_corpus
from signface.label.persistence import save_model
from signface.label.vocabulary import Vocabulary
from signface.learn.restriction import restricted
from signface.learn.training import train
from signface.segmentation.segments import Segments
from signface.settings.solve import SolveSettings
from signface.settings.training import TrainingSettings

FILE = Path(__file__).resolve().parent / "classifiers" / "lse-questions.skops"
#: The corpus's label: ours, and what it stands for.
LABELS = {
    "i.parcial": ("wh", "wh-question"),
    "i.polarizada": ("polar", "yes/no question"),
    "n.no": ("negation", "negation by a headshake"),
}
UNKNOWN = ("i.xeral", "n.resto")
SETTINGS = TrainingSettings(classifier="boosting", features=("weights", "head"), normalise="range", balanced=True)
UNITS = SolveSettings(read_as="aus")


def main() -> None:
    """Train on all signers and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("corpus", type=Path, help="folder of the corpus, with takes.csv")
    source = parser.parse_args().corpus
    vocabulary = Vocabulary("questions", tuple(LABELS), description="questions and negation")
    with tempfile.TemporaryDirectory() as folder:  # signers are learnt beside the corpus, not in it
        for file in source.iterdir():
            (Path(folder) / file.name).symlink_to(file.resolve())
        (Path(folder) / "signers").mkdir()
        for signer in learn_signers(read_corpus(folder), UNITS):
            signer.save(Path(folder) / "signers" / f"{signer.name}.json")
        examples = solve_corpus(read_corpus(folder), settings=UNITS, tier="CNM_tipo")
    words = tuple(word for word, _ in LABELS.values())
    ours = Vocabulary("questions", words, dict(LABELS.values()), description="questions, negation").with_blank()
    taught = []
    for example in restricted(examples, list(LABELS), UNKNOWN, vocabulary=vocabulary):
        table = example.reference.table.copy()
        table["label"] = [LABELS[label][0] if label in LABELS else label for label in table["label"]]
        named = Segments(table, name=example.take)
        taught.append(replace(example, reference=named, vocabulary=ours, tier="clause"))
    model = train(taught, SETTINGS, name=FILE.stem, solve=UNITS, corpus="LSE_GFE_UVIGO, seven signers")
    save_model(model, FILE)
    print(f"{FILE.name}: {model.card.frames} frames of {len(model.card.takes)} takes; {dict(model.card.scores)}")


if __name__ == "__main__":
    main()
