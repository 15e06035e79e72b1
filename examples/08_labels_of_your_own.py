"""
Labels of your own
==================

Affect is one tier; a laboratory has others. Here brows are annotated up or down, in a tier that only this laboratory
has, and a classifier learns it.
"""

from shutil import copytree

import numpy as np
import pandas as pd

import signface as sf

folder = copytree(sf.datasets.mini_file().parent, "laboratory", dirs_exist_ok=True)
corpus = sf.read_corpus(folder).select(kinds=["SE", "EU"])
brows = sf.Vocabulary("brows", ("up", "down"), {"up": "raised", "down": "lowered"})

# %%
# An annotator's tier. In place of an annotator, the weights say when the brows are up or down.

for entry in corpus:
    weights = sf.datasets.mini_weights(entry.name)
    raised, lowered = weights.weight("browInnerUp"), weights.weight("browDownLeft")
    state = np.select([raised - lowered > 0.1, lowered - raised > 0.1], ["up", "down"], "")
    starts = np.flatnonzero(np.r_[True, state[1:] != state[:-1]])
    edges = np.r_[weights.time[starts], weights.start + weights.duration]
    table = pd.DataFrame({"start_s": edges[:-1], "end_s": edges[1:], "kind": "stable", "label": state[starts]})
    table = table[(table["label"] != "") & (table["end_s"] - table["start_s"] > 0.1)].reset_index(drop=True)
    annotated = sf.Segments(table, name=entry.name)
    sf.write_eaf(annotated, into=entry.annotation, signer=entry.signer, tier="brows", vocabulary=brows)

# %%
# From here on it is as with affect; what nobody annotated is ``none``. Two synthetic takes are enough to show how it is
# done, and tell nothing of how well: with another take left out, ``M2_SE_A``, the same classifier finds no brows.

*others, example = sf.solve_corpus(corpus, tier="brows")
model = sf.train(others, sf.TrainingSettings(classifier="knn1", calibrate=False))
print("labels:", *model.card.labels)
annotation = sf.annotate(example.descriptors, model)
print(annotation)
figure = sf.draw_timeline(example.descriptors, annotation.segments, reference=example.reference)
