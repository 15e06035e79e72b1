"""Splitting every triangle of a face in four: the same surface and the same bases on a finer mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from signface.face.mesh import Mesh
from signface.face.model import FaceModel


def subdivide(face: FaceModel) -> FaceModel:
    """Put a vertex in the middle of every edge; bases, identities and colours are interpolated linearly.

    The first V vertices stay those of `face`, so layouts on its vertices stay valid.

    Returns
    -------
    FaceModel
        With V + E vertices and 4 T triangles.
    """
    triangles = face.mesh.triangles
    corners = np.stack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]], axis=1)
    edges, number = np.unique(np.sort(corners.reshape(-1, 2), axis=1), axis=0, return_inverse=True)
    middle = number.reshape(-1, 3) + len(face.mesh.vertices)  # of the edges ab, bc, ca

    def with_middles(values: np.ndarray) -> np.ndarray:
        added = 0.5 * (values[..., edges[:, 0], :] + values[..., edges[:, 1], :])
        return np.concatenate([values, added], axis=-2)

    (a, b, c), (ab, bc, ca) = triangles.T, middle.T
    split = np.stack([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]).transpose(2, 0, 1).reshape(-1, 3)
    return replace(
        face,
        mesh=Mesh(with_middles(face.mesh.vertices), split),
        bases=with_middles(face.bases),
        identities=None if face.identities is None else with_middles(face.identities),
        colours=None if face.colours is None else with_middles(np.asarray(face.colours)),
        history=(*face.history, "subdivide"),
    )
