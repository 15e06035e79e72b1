"""
Solve a recording
=================

The solver finds, for each frame, the weights with which the avatar's bases bring its skin to the markers.
"""

import matplotlib.pyplot as plt
import numpy as np

import signface as sf

take = sf.datasets.mini_take("M1_IE_J")
weights = sf.solve(take)  # the face and layout that ship, the default settings
residual = np.nanmedian(weights.residual)
print(f"{weights.n_frames} frames, {len(weights.names)} bases, {residual:.2f} mm")

# %%
# The five bases that move most, and how far the solved face lies from the markers.

most = np.argsort(np.nanstd(weights.weights, axis=0))[:-6:-1]
figure, (upper, lower) = plt.subplots(2, sharex=True, figsize=(9, 5), layout="constrained", height_ratios=(3, 1))
for base in most:
    upper.plot(weights.time, weights.weights[:, base], label=weights.names[base])
upper.set_ylabel("weight")
upper.legend(loc="upper left", bbox_to_anchor=(1, 1), frameon=False)
lower.plot(weights.time, weights.residual, color="grey")
lower.set(xlabel="time, s", ylabel="residual, mm", ylim=(0, None))
plt.show()

# %%
# What was done on the way is kept, in words.

print(*weights.history, sep="\n")
