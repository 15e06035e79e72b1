"""
Agreement of annotators
=======================

How far do two people, or a person and the machine, agree? Kappa counts frames; the modified kappa counts annotations
that overlap, as EasyDIAg does in ELAN (Holle and Rein 2014).
"""

import matplotlib.pyplot as plt

import signface as sf

name = "M2_SE_A"
weights, reference = sf.datasets.mini_weights(name), sf.datasets.mini_reference(name)
model = sf.load_model()
labelled = sf.label_segments(weights, sf.segment(weights), model)
tables = {"annotator": reference.table, model.name: labelled.table}  # or sf.read_tiers("a.eaf")["affect@Eva"]
agreement = sf.agreement_table(tables)
print(
    agreement[["annotations", "matched", "agreement", "cohen_kappa", "modified_kappa"]].round(2).to_string(index=False)
)

# %%
# The two rows of segments, one above the other.

figure = sf.draw_timeline(weights, labelled, reference=reference, title=f"{model.name} and the reference: {name}")
plt.show()
