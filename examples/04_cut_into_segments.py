"""
Cut weights into segments
=========================

A face that changes has energy: the squared velocity and acceleration of its weights. Between the peaks lie stable
segments, at them transitions (Reverdy 2019, chapter 4).
"""

import signface as sf

weights = sf.datasets.mini_weights("M2_SE_A")  # what a solve should find; sf.solve(take) finds it
segments = sf.segment(weights)
print(segments.table.head())

# %%
# Beside the reference: what an annotator said of the same take.

figure = sf.draw_timeline(weights, segments, reference=sf.datasets.mini_reference("M2_SE_A"))
