"""Operators on a face's skin: stiffness, mass, and the thin-shell energy of its bases.

- `stiffness_and_mass`: the cotangent Laplacian and the lumped vertex areas.
- `thin_shell_matrices`: stretching and bending energy of every pair of bases (seed 001, eq. 5.15 to 5.17).
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from signface.face.mesh import Mesh
from signface.face.model import FaceModel


def stiffness_and_mass(mesh: Mesh) -> tuple[sparse.csr_matrix, np.ndarray]:
    """The cotangent Laplacian of a mesh and the area around each vertex (seed 001, eq. 5.11 and 5.12).

    The Laplacian is the robust one of Sharp and Crane, "A Laplacian for Nonmanifold Triangle Meshes" (2020), which
    stays positive semidefinite on needle-shaped and non-manifold triangles.

    Parameters
    ----------
    mesh : Mesh

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

    Returns
    -------
    stretching : (N, N) array
        `b_i' S b_j`, square millimetres; positive semidefinite.
    bending : (N, N) array
        `b_i' S M^-1 S b_j`, without unit; positive semidefinite.
    """
    stiffness, mass = stiffness_and_mass(face.mesh)
    count, vertices = face.n_bases, len(mass)
    columns = face.bases.transpose(1, 0, 2).reshape(vertices, 3 * count)
    stiff = stiffness @ columns
    stretching = np.einsum("vid,vjd->ij", columns.reshape(vertices, count, 3), stiff.reshape(vertices, count, 3))
    inverse = np.divide(1.0, np.sqrt(mass), where=mass > 0, out=np.zeros(vertices))  # a loose vertex has no skin
    curved = (stiff * inverse[:, None]).reshape(vertices, count, 3)
    bending = np.tensordot(curved, curved, axes=((0, 2), (0, 2)))
    return 0.5 * (stretching + stretching.T), 0.5 * (bending + bending.T)
