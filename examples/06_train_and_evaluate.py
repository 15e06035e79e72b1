"""
Train and evaluate
==================

Ten lines more: a corpus is solved, a classifier trained on it, and others are measured on takes and signers that they
have not seen. (The corpus that ships has four takes: it shows how it is done, and measures nothing.)
"""

import signface as sf

corpus = sf.datasets.mini_corpus()  # or sf.read_corpus("corpora/feel")
settings = sf.SolveSettings(layout="default-40")
examples = sf.solve_corpus(corpus, settings=settings)
model = sf.train(examples, sf.TrainingSettings(classifier="knn3"), solve=settings)
sf.save_model(model, "mine.skops")
measured = sf.evaluate(examples, classifiers=["knn3", "forest"], protocols=["across"])
for name, scores in measured.metrics["classifiers"].items():
    print(name, round(scores["manual_segments"]["accuracy"], 2))
print("report:", sf.write_report(measured, examples, corpus, "report", settings=settings).name)

# %%
# An utterance, its reference, and what was found by a classifier that had not seen its signer.

take = "M2_EU_04"
weights = next(example.descriptors for example in examples if example.take == take)
found = measured.segments["across"]["forest"][take]
figure = sf.draw_timeline(weights, found, reference=sf.datasets.mini_reference(take))
