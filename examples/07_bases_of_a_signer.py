"""
A signer's own bases
====================

Nobody frowns like the avatar. From a take in which a signer shows named bases, nobody knows how strongly, signface
learns where this signer's skin goes; takes of the signer are then solved with those bases.
"""

import matplotlib.pyplot as plt
import numpy as np

import signface as sf

face = sf.read_face()
layout = sf.read_layout("default-40", face)
shown = ["browInnerUp", "jawOpen", "mouthPucker", "noseSneerLeft", "mouthSmileLeft", "mouthFrownRight"]

# %%
# The signer is made up: her markers move as the avatar's, and a third elsewhere. She shows each base for a second.

rng = np.random.default_rng(1)
avatar = layout.bases(face)
hers = avatar + 0.35 * rng.normal(size=avatar.shape) * avatar.std(axis=(1, 2))[:, None, None]
weights = np.zeros((50 * len(shown) + 100, face.n_bases))
for second, base in enumerate(shown, start=1):
    rows = slice(50 * second, 50 * second + 50)
    weights[rows, face.names.index(base)] = 0.8 * np.sin(np.linspace(0, np.pi, 50)) ** 2


def record(weights: np.ndarray) -> sf.Take:
    """A take of her at 50 Hz, keeping her head still."""
    skin = layout.points(face) + np.tensordot(weights, hers, axes=1)
    head = np.repeat(layout.points(face, layout.head_labels)[None], len(weights), axis=0)
    noise = rng.normal(0.0, 0.03, (len(weights), len(skin[0]) + len(head[0]), 3))
    return sf.Take(np.concatenate([skin, head], axis=1) + noise, layout.face_labels + layout.head_labels, 50.0)


with open("shown.csv", "w") as table:
    table.write("start_s,end_s,bases\n")
    table.writelines(f"{second},{second + 0.98},{base}\n" for second, base in enumerate(shown, start=1))
settings = sf.SolveSettings(neutral=0.3)
eva = sf.calibrate_signer(record(weights), "shown.csv", name="Eva", settings=settings)
eva.save("eva.json")

# %%
# Another take of hers, solved with the avatar's bases and with her own.

truth = 0.7 * weights[::-1]
solved = {
    "avatar's bases": sf.solve(record(truth), settings=settings),
    "her own bases": sf.solve(record(truth), settings=settings, signer=sf.Signer.read("eva.json")),
}
figure, axes = plt.subplots(figsize=(9, 3.5), layout="constrained")
for name, result in solved.items():
    error = np.abs(result.on(face.names).weights - truth).sum(axis=1)
    print(f"{name:15} off by {error.mean():.3f} a frame, all weights together")
    axes.plot(result.time, error, label=name)
axes.set(xlabel="time, s", ylabel="sum of errors")
axes.legend(frameon=False)
plt.show()
