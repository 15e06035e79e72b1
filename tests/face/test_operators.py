"""Laplacian, mass and subdivision of a skin."""

import numpy as np
import pytest

from signface.face.layout_files import read_layout
from signface.face.operators import stiffness_and_mass, thin_shell_matrices
from signface.face.subdivision import subdivide


def test_the_laplacian_knows_no_constants_is_symmetric_and_never_negative(face):
    stiffness, mass = stiffness_and_mass(face.mesh)
    assert np.abs(stiffness @ np.ones(len(mass))).max() < 1e-8
    assert np.abs(stiffness - stiffness.T).max() < 1e-9
    functions = np.random.default_rng(0).normal(size=(len(mass), 30))
    assert (np.einsum("vk,vk->k", functions, stiffness @ functions) >= -1e-9).all()


def test_the_mass_is_the_area_of_the_skin(face):
    _, mass = stiffness_and_mass(face.mesh)
    assert (mass > 0).all()
    assert mass.sum() == pytest.approx(face.mesh.triangle_areas.sum(), rel=1e-4)


def test_subdivision_keeps_area_vertices_and_the_motion_of_markers(face):
    fine = subdivide(face)
    assert len(fine.mesh.triangles) == 4 * len(face.mesh.triangles)
    assert fine.mesh.triangle_areas.sum() == pytest.approx(face.mesh.triangle_areas.sum())
    assert (fine.mesh.vertices[: len(face.mesh.vertices)] == face.mesh.vertices).all()
    coarse, dense = (read_layout("default-40", own).bases(own) for own in (face, fine))
    assert np.abs(coarse - dense).max() < 1e-4  # millimetres: the layout is written to 1e-5


@pytest.mark.slow
def test_stretching_and_bending_hardly_change_with_the_mesh(face):
    for coarse, fine in zip(thin_shell_matrices(face), thin_shell_matrices(subdivide(face))):
        assert np.linalg.eigvalsh(coarse).min() > -1e-9 * np.trace(coarse)
        assert np.diag(fine) == pytest.approx(np.diag(coarse), rel=0.2)
        assert np.diag(fine).mean() == pytest.approx(np.diag(coarse).mean(), rel=0.06)
