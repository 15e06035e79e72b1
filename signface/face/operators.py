"""Operators on a face's skin: stiffness, mass, and the thin-shell energy of its bases.

- `stiffness_and_mass`: the cotangent Laplacian and the lumped vertex areas.
- `thin_shell_matrices`: stretching and bending energy of every pair of bases (Reverdy 2019, eq. 5.15 to 5.17).
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
from scipy import sparse

from signface.face.mesh import Mesh
from signface.face.model import FaceModel

#: The scale at which bending is measured, as a share of the square root of the skin's area: 7 mm on the default face.
RESOLUTION = 0.02

#: What was computed for faces that are still in use: several solvers are made for one face. A face does not change.
_KNOWN: WeakKeyDictionary[FaceModel, tuple[np.ndarray, np.ndarray]] = WeakKeyDictionary()


def stiffness_and_mass(mesh: Mesh) -> tuple[sparse.csr_matrix, np.ndarray]:
    """The cotangent Laplacian of a mesh and the area around each vertex (Reverdy 2019, eq. 5.11 and 5.12).

    The Laplacian is the robust one of Sharp and Crane, "A Laplacian for Nonmanifold Triangle Meshes" (2020), which
    stays positive semidefinite on needle-shaped and non-manifold triangles.

    Returns
    -------
    stiffness : (V, V) sparse matrix
        Symmetric, positive semidefinite, without unit: the negative of `L` in eq. 5.12. Its rows sum to 0.
    mass : (V,) array
        Lumped areas in square millimetres; they sum to the area of the mesh.
    """
    import robust_laplacian

    # Centred and of unit size: the robust Laplacian's mollification is relative, and its results must be too.
    centre, size = mesh.vertices.mean(axis=0), np.ptp(mesh.vertices, axis=0).max()
    stiffness, mass = robust_laplacian.mesh_laplacian((mesh.vertices - centre) / size, mesh.triangles)
    return stiffness.tocsr(), mass.diagonal() * size**2


def thin_shell_matrices(face: FaceModel) -> tuple[np.ndarray, np.ndarray]:
    """Stretching and bending energy of each pair of bases.

    For displacements `d = sum_i c_i b_i` of the skin, with the stiffness `S` and the diagonal mass `M`, the thin-shell
    energy of eq. 5.15 is `k_s d' S d + k_b d' S M^-1 S d`, summed over the three coordinates; here as quadratic forms
    of the weights.

    A base is known at the vertices and linear between them, and such a function has a kink at every edge, whose bending
    is without limit: `M^-1` doubles the energy each time the mesh is split. The bending is therefore measured at a
    resolution `h`, as `S (M + h^2 S)^-1 S`, with `h` the `RESOLUTION` of the skin: waves much longer than `h` count as
    in eq. 5.15, shorter ones by their slope, and the value no longer depends on how finely the face is meshed.

    Returns
    -------
    stretching : (N, N) array
        `b_i' S b_j`, square millimetres; positive semidefinite.
    bending : (N, N) array
        `b_i' S (M + h^2 S)^-1 S b_j`, without unit; positive semidefinite.
    """
    if face not in _KNOWN:
        _KNOWN[face] = _thin_shell_matrices(face)
    return _KNOWN[face]


def _thin_shell_matrices(face: FaceModel) -> tuple[np.ndarray, np.ndarray]:
    from scipy.sparse.linalg import splu

    stiffness, mass = stiffness_and_mass(face.mesh)
    count, vertices = face.n_bases, len(mass)
    columns = face.bases.transpose(1, 0, 2).reshape(vertices, 3 * count)
    stiff = stiffness @ columns
    smoothing = sparse.diags(mass) + RESOLUTION**2 * mass.sum() * stiffness
    smoothing = smoothing.tocsc()
    # Symmetric and positive definite: an ordering made for that keeps the factors sparse.
    factors = splu(smoothing, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    smooth = factors.solve(np.asfortranarray(stiff))
    by_base = [
        np.ascontiguousarray(values.reshape(vertices, count, 3).transpose(1, 0, 2)).reshape(count, -1)
        for values in (columns, stiff, smooth)
    ]
    stretching, bending = by_base[0] @ by_base[1].T, by_base[1] @ by_base[2].T
    result = 0.5 * (stretching + stretching.T), 0.5 * (bending + bending.T)
    for matrix in result:
        matrix.setflags(write=False)
    return result
