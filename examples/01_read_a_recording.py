"""
Read a recording
================

A take is markers in time: millimetres, a rate, labels. Where a marker was not seen, it is not a number.
"""

import matplotlib.pyplot as plt
import numpy as np

import signface as sf

take = sf.read_take(sf.datasets.mini_file("M1_IE_J"))  # C3D, TRC, QTM, CSV, .pose: the content decides
print(f"{take.name}: {take.duration:.1f} s, {len(take.labels)} markers at {take.rate:.0f} Hz")

# %%
# The layout that ships and fits says which markers lie on the face, and which carry the head.

face = sf.read_face()
layout = sf.choose_layout(take.labels, face)
print(f"{layout.name}: {len(layout.face_labels)} markers on the face, head markers {', '.join(layout.head_labels)}")

# %%
# A mouth corner as it was recorded moves with the head; the head marker beside it shows by how much. Below, when which
# marker was not seen.

missing = np.isnan(take.positions[..., 0])
figure, (height, gaps) = plt.subplots(2, sharex=True, figsize=(9, 5), layout="constrained")
for label in ("LLIPC", "HEADL"):
    height.plot(
        take.time, take.positions[:, take.labels.index(label), 2] - take.positions[0, take.labels.index(label), 2]
    )
    height.annotate(label, (take.time[-1], height.lines[-1].get_ydata()[-1]), xytext=(4, 0), textcoords="offset points")
height.set_ylabel("height, mm")
gaps.imshow(missing.T, aspect="auto", cmap="Greys", extent=(take.time[0], take.time[-1], len(take.labels), 0))
gaps.set(xlabel="time, s", ylabel="marker", title=f"{missing.mean():.1%} of the places are missing")
plt.show()
