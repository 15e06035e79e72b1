"""
Draw a face
===========

A face with some weights, from where you like, without a display.
"""

import matplotlib.pyplot as plt
import numpy as np

import signface as sf

face = sf.read_face()
smile = np.zeros(face.n_bases)
shown = {"mouthSmileLeft": 0.9, "mouthSmileRight": 0.9, "cheekSquintLeft": 0.6, "cheekSquintRight": 0.6}
for base, weight in shown.items():
    smile[face.names.index(base)] = weight
print(f"{face.n_bases} bases, {np.count_nonzero(smile)} of them used")

figure, axes = plt.subplots(1, 3, figsize=(9, 3.8), layout="constrained")
views = {"neutral": (None, 0), "smile": (smile, 0), "from the side": (smile, 50)}
for part, (title, (weights, yaw)) in zip(axes, views.items()):
    part.imshow(sf.draw_face(face, weights, yaw=yaw))
    part.set_title(title)
    part.set_axis_off()
plt.show()

# %%
# The frame of a take in which the face is farthest from rest.

weights = sf.datasets.mini_weights("M2_SE_A")
farthest = int(np.argmax(np.linalg.norm(weights.weights, axis=1)))
figure, axes = plt.subplots(figsize=(3, 3.8), layout="constrained")
axes.imshow(sf.draw_face(face, weights.on(face.names).weights[farthest]))
axes.set_title(f"{weights.name} at {weights.time[farthest]:.2f} s")
axes.set_axis_off()
plt.show()
