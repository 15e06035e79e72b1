"""Markers chosen one after the other, each time the one that tells most.

- `Reconstruction`: what is left of the error of the best linear reconstruction of the skin, on recorded motion.
- `OptimalDesign`: the solver's own information matrix on the bases, A- or D-optimal; needs no motion.
- `ThinShell`: what is left when a thin shell is pulled through the markers (B. Le, M. Zhu and Z. Deng, "Marker
  Optimization for Facial Motion Acquisition and Deformation", 2013).
- `select`: forward selection by one of them, under the captor's rules.

Adding a marker replaces these arrays and never writes into them, so that a shallow copy starts afresh.

All three keep what is not yet known given the markers so far (a conditional covariance, an information matrix, a
residual) and update it by each marker, so that a choice among hundreds of places takes milliseconds. Forward selection
is not the optimum; for the determinant it comes within 37 % of it (G. Nemhauser, L. Wolsey and M. Fisher, 1978).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from signface.face.model import FaceModel
from signface.face.operators import stiffness_and_mass, thin_shell_matrices
from signface.placement.sites import Board, Sites
from signface.solver.thin_shell import ALPHA, TOLERANCE

#: Noise of a marker's coordinate that selection reckons with: jitter (mm), and how far aside it may be glued (mm).
JITTER_MM, ASIDE_MM = 0.2, 2.0


class Criterion(Protocol):
    """What a site would tell beyond the markers already taken."""

    def gains(self) -> np.ndarray:
        """(S,) gain of each site; the larger the better."""
        ...

    def add(self, vertices: Sequence[int]) -> None:
        """Take markers at these vertices."""
        ...


def select(criterion: Criterion, sites: Sites, count: int) -> tuple[int, ...]:
    """Vertices of `count` markers, the fixed ones first, then in the order of what they tell.

    A pair of mirror images is judged by half its gain, so that it competes fairly with a marker on the midline.

    Raises
    ------
    SignfaceError
        So many markers cannot be placed.
    """
    board = Board(sites, count)
    size = np.array([len(group) for group in sites.groups])
    if board.chosen:
        criterion.add(board.chosen)
    while board.left:
        gains = np.where(board.free, criterion.gains() / size, -np.inf)
        best = int(np.argmax(gains))
        board.take(best)
        criterion.add([int(vertex) for vertex in sites.groups[best]])
    return tuple(board.chosen)


def placement_noise(face: FaceModel, displacements: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """(K,) variance of a marker's coordinate (mm squared), from jitter and from being glued aside.

    Glued `ASIDE_MM` away, a marker moves as the skin there does: the mean squared difference between neighbouring
    vertices' displacements, per squared distance, tells how much that differs.

    Parameters
    ----------
    face : FaceModel
    displacements : (F, V, 3) array
        Displacements of all vertices in some frames.
    vertices : (K,) int array
    """
    t = face.mesh.triangles
    edges = np.unique(np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1), axis=0)
    wanted = np.isin(edges, vertices).any(axis=1)
    edges = edges[wanted]
    apart = displacements[:, edges[:, 0]] - displacements[:, edges[:, 1]]
    length = ((face.mesh.vertices[edges[:, 0]] - face.mesh.vertices[edges[:, 1]]) ** 2).sum(axis=1)
    slope = (apart**2).mean(axis=(0, 2)) / np.maximum(length, 1e-6)
    total, number = np.zeros(len(face.mesh.vertices)), np.zeros(len(face.mesh.vertices))
    for end in (0, 1):
        np.add.at(total, edges[:, end], slope)
        np.add.at(number, edges[:, end], 1.0)
    return JITTER_MM**2 / 3.0 + ASIDE_MM**2 * (total / np.maximum(number, 1.0))[vertices]


class _OnUnion:
    """Coordinates of the vertices that may be chosen, and the rows of each site among them."""

    def __init__(self, sites: Sites) -> None:
        self.union = sites.union
        self._row = {int(vertex): row for row, vertex in enumerate(self.union)}
        self.blocks = [self.rows(group) for group in sites.groups]
        sizes = np.array([len(block) for block in self.blocks])
        #: Sites of one size at a time, and their rows, (sites, size).
        self.stacks = [
            (which, np.array([self.blocks[site] for site in which]))
            for which in (np.flatnonzero(sizes == size) for size in np.unique(sizes))
        ]

    def rows(self, vertices: Sequence[int] | np.ndarray) -> np.ndarray:
        """(3 k,) rows of the coordinates of some vertices."""
        places = np.array([self._row[int(vertex)] for vertex in vertices])
        return (3 * places[:, None] + np.arange(3)).ravel()


class Reconstruction(_OnUnion):
    """Forward selection on the reconstruction error (eq. 3.5) of the best linear mapping.

    With the markers' covariance S (plus their noise) and their covariance R with what is to be reconstructed, a block b
    of new coordinates lowers the mean squared error by `tr(R_b' S_bb^-1 R_b)`; both are then conditioned on it.

    Parameters
    ----------
    sites : Sites
    positions : (F, K, 3) array
        Displacements of the vertices `sites.union` in the training frames of all actors, each about its mean.
    targets : (F, N) array
        The weights shown, about their mean.
    metric : (N, N) array
        The squared error of the skin as a quadratic form of the weights' errors (`signface.placement.evaluation`).
    noise : (K,) array
        Variance of each vertex's coordinates as a marker (`placement_noise`).
    """

    def __init__(
        self, sites: Sites, positions: np.ndarray, targets: np.ndarray, metric: np.ndarray, noise: np.ndarray
    ) -> None:
        super().__init__(sites)
        values, vectors = np.linalg.eigh(metric)
        moved = targets @ (vectors * np.sqrt(np.maximum(values, 0.0)))
        flat = positions.reshape(len(positions), -1)
        self._covariance = flat.T @ flat / len(flat)
        self._cross = flat.T @ moved / len(flat)
        self._noise = np.repeat(noise, 3)
        self.error = float((moved**2).sum() / len(moved))

    def gains(self) -> np.ndarray:
        """(S,) by how much each site would lower the mean squared error."""
        result = np.empty(len(self.blocks))
        for which, rows in self.stacks:
            size = rows.shape[1]
            inner = self._covariance[rows[:, :, None], rows[:, None, :]].copy()
            inner[:, np.arange(size), np.arange(size)] += self._noise[rows]
            cross = self._cross[rows]
            result[which] = np.einsum("sin,sin->s", cross, np.linalg.solve(inner, cross))
        return result

    def add(self, vertices: Sequence[int]) -> None:
        """Condition on markers at these vertices."""
        rows = self.rows(vertices)
        inner = self._covariance[np.ix_(rows, rows)] + np.diag(self._noise[rows])
        across = self._covariance[:, rows].copy()
        cross = self._cross[rows].copy()
        gain = np.linalg.solve(inner, cross)
        self.error -= float((cross * gain).sum())
        self._cross = self._cross - across @ gain
        self._covariance = self._covariance - across @ np.linalg.solve(inner, across.T)


class OptimalDesign(_OnUnion):
    """Optimal design on the bases: the information that markers give on the weights, with the solver's thin shell.

    The information matrix of the solve is `M = sum over markers of B' B + shell` (eq. 5.22 and 5.25, without bounds).
    `A` lowers `tr(G M^-1)`, the expected squared error of the skin; `D` raises `log det M`.

    Parameters
    ----------
    sites : Sites
    face : FaceModel
    count : int
        How many markers are wanted: the shell counts beside all of them.
    metric : (N, N) array or None
        G; with None the criterion is D.
    """

    def __init__(self, sites: Sites, face: FaceModel, count: int, metric: np.ndarray | None) -> None:
        super().__init__(sites)
        self._columns = face.bases[:, self.union].transpose(1, 2, 0).reshape(-1, face.n_bases)
        typical = count * np.einsum("ij,ij->j", self._columns, self._columns).mean() / len(self.union)
        shell = np.zeros((face.n_bases, face.n_bases))
        for part in thin_shell_matrices(face):
            shell += 0.5 * part / np.diag(part).mean()
        # Bases that move no skin (the gaze) have no shell energy either: a little keeps the matrix regular.
        shell += 1e-3 * np.eye(face.n_bases)
        self._covariance = np.linalg.inv(TOLERANCE**2 * ALPHA * typical * shell)
        self._metric = metric

    def gains(self) -> np.ndarray:
        """(S,) by how much each site would raise `log det M`, or lower `tr(G M^-1)`."""
        result = np.empty(len(self.blocks))
        for which, rows in self.stacks:
            columns = self._columns[rows]
            spread = columns @ self._covariance
            inner = spread @ columns.transpose(0, 2, 1) + np.eye(rows.shape[1])
            if self._metric is None:
                result[which] = np.linalg.slogdet(inner)[1]
            else:
                result[which] = np.einsum("sij,sij->s", np.linalg.solve(inner, spread), spread @ self._metric)
        return result

    def add(self, vertices: Sequence[int]) -> None:
        """Add the information of markers at these vertices."""
        columns = self._columns[self.rows(vertices)]
        spread = columns @ self._covariance
        self._covariance = self._covariance - spread.T @ np.linalg.solve(
            spread @ columns.T + np.eye(len(columns)), spread
        )


class ThinShell(_OnUnion):
    """Thin-shell selection: markers are handles of a linear thin shell, and the pose of the training frames is rebuilt.

    With the shell's energy `d' A d` (half stretching, half bending; skin that no base moves is held), handles at S
    deform the skin to `K_.S K_SS^-1 d_S`, where K is the inverse of A. The residual of the training poses and K are
    conditioned on each new handle. Handles move the skin exactly as they moved in the take, as in the paper.

    Parameters
    ----------
    sites : Sites
    face : FaceModel
    displacements : (F, V, 3) array
        Displacements of all vertices in the training frames.
    """

    def __init__(self, sites: Sites, face: FaceModel, displacements: np.ndarray) -> None:
        super().__init__(sites)
        moving = sites.moving
        stiffness, mass = stiffness_and_mass(face.mesh)
        inverse = sparse.diags(np.divide(1.0, mass, where=mass > 0, out=np.zeros_like(mass)))
        energy = (stiffness / stiffness.diagonal().mean()).tocsc()
        bending = (stiffness @ inverse @ stiffness).tocsc()
        energy = (0.5 * energy + 0.5 * bending / bending.diagonal().mean())[moving][:, moving].tocsc()
        energy = energy + 1e-9 * sparse.eye(len(moving), format="csc")
        place = {int(vertex): row for row, vertex in enumerate(moving)}
        self._rows = np.array([place[int(vertex)] for vertex in self.union])
        right = np.zeros((len(moving), len(self._rows)))
        right[self._rows, np.arange(len(self._rows))] = 1.0
        self._kernel = splu(energy).solve(right)  # (moving, union)
        flat = displacements[:, moving].transpose(1, 0, 2).reshape(len(moving), -1)
        # The poses span few directions: their scores on these give the same sums of squares.
        values, vectors = np.linalg.eigh(flat @ flat.T)
        kept = values > 1e-8 * values[-1]
        self._residual = vectors[:, kept] * np.sqrt(values[kept])
        self._pairs = [block[::3] // 3 for block in self.blocks]

    def gains(self) -> np.ndarray:
        """(S,) by how much each site would lower the squared residual of the training poses."""
        rows = self._rows
        variance = np.maximum(self._kernel[rows, np.arange(len(rows))], 1e-12)
        residual = self._residual[rows]
        toward = np.einsum("vu,vu->u", self._kernel, self._residual @ residual.T) / variance
        size = np.einsum("vu,vu->u", self._kernel, self._kernel) * (residual**2).sum(axis=1) / variance**2
        single = 2.0 * toward - size
        # Mirror images pull on different skin: their gains add up but for what they share near the midline.
        return np.array([single[pair].sum() for pair in self._pairs])

    def add(self, vertices: Sequence[int]) -> None:
        """Hold the shell by handles at these vertices."""
        for vertex in vertices:
            column = int(np.searchsorted(self.union, vertex))
            variance = max(float(self._kernel[self._rows[column], column]), 1e-12)
            along = self._kernel[:, column] / variance
            self._residual = self._residual - np.outer(along, self._residual[self._rows[column]])
            self._kernel = self._kernel - np.outer(along, self._kernel[self._rows[column]])

    @property
    def error(self) -> float:
        """Squared residual of the training poses, millimetres squared, summed over frames and vertices."""
        return float((self._residual**2).sum())
