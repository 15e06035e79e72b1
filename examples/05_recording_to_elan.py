"""
From a recording to an ELAN file
================================

Ten lines: a recording is solved, cut, labelled and written, with its curves beside it.
"""

import signface as sf

take = sf.read_take(sf.datasets.mini_file("M1_EU_11"))
model = sf.load_model()
settings = sf.SolveSettings(layout="default-40")
eva = sf.Signer("Eva")
annotation = sf.annotate(take, model, settings=settings, signer=eva)
files = sf.write_eaf(annotation, "take.eaf", replace=True)
print(annotation)
print("written:", *(file.name for file in files))

# %%
# What was found, at a glance; ``take.eaf`` opens in ELAN, with the same curves in its timeseries viewer.
# (ELAN's colours are written to ``take.pfsx`` as well; the list does not name it, since ELAN rewrites it.)

figure = sf.draw_timeline(annotation.descriptors, annotation.segments)
