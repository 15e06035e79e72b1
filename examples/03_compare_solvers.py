"""
Compare ways to solve
=====================

The takes that ship are synthetic, so that the right weights are known. Least squares fits the markers best and the
weights worst; the thin shell asks for a skin that bends as little as it can.
"""

import matplotlib.pyplot as plt
import numpy as np

import signface as sf

take, truth = sf.datasets.mini_take(), sf.datasets.mini_weights()
methods = ("thin-shell", "bounded", "nnls", "least-squares")
solved = {name: sf.solve(take, settings=sf.SolveSettings(method=name)) for name in methods}
for name, weights in solved.items():
    error = np.sqrt(np.nanmean((weights.weights - truth.on(weights.names).weights) ** 2))
    outside = np.nanmean(((weights.weights < -0.1) | (weights.weights > 1.1)).any(axis=1))
    print(f"{name:14} error of a weight {error:.3f}, frames out of bounds {outside:5.1%}")

# %%
# One base through the take, beside the truth.

base = "noseSneerLeft"
figure, axes = plt.subplots(figsize=(9, 3.5), layout="constrained")
axes.plot(truth.time, truth.weight(base), color="black", linewidth=3, label="truth")
for name, weights in solved.items():
    axes.plot(weights.time, weights.weight(base), linewidth=1, label=name)
axes.set(xlabel="time, s", ylabel=base)
axes.legend(frameon=False)
plt.show()
