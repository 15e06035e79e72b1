"""K-means on the motion of the skin (Reverdy 2019, 3.6, eq. 3.6 and 3.7).

- `trajectories`: the normalised trajectory of every vertex that moves, over the frames of one or several actors.
- `cluster_markers`: the vertex nearest to each centroid, under the captor's rules.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment

from signface.content import Content
from signface.errors import SignfaceError
from signface.placement.sites import Board, Sites

if TYPE_CHECKING:
    from sklearn.cluster import KMeans

#: A coordinate that strays less than this (mm, standard deviation) is not blown up to 1: it stands still.
STILL_MM = 0.02
#: Share of the trajectories' variance that is clustered; the rest is of less than a hundredth of the distances.
KEPT = 0.9999
#: Starts of k-means; the best is kept.
STARTS = 4
#: A cluster whose centre lies within this of the plane of symmetry may get a marker on it (mm).
MIDDLE_MM = 8.0


@dataclass(frozen=True, eq=False)
class Clusters(Content):
    """A choice of markers by clusters.

    Parameters
    ----------
    markers : tuple of int
        Vertices.
    members : (K,) int array
        For each clustered vertex, the position in `markers` of the marker that stands for it.
    """

    markers: tuple[int, ...]
    members: np.ndarray


def trajectories(skins: Sequence[np.ndarray], mirror: np.ndarray | None = None) -> np.ndarray:
    """The rows of eq. 3.6, brought to as few columns as hold their distances.

    Parameters
    ----------
    skins : sequence of (F, K, 3) arrays
        Positions of the moving vertices of each actor; the actors are concatenated in time, each normalised by its
        own mean and standard deviation, so that another head is no motion.
    mirror : (K,) int array, optional
        For each moving vertex its mirror image among them. With it, each actor is joined by a mirrored one: what the
        left side does is taken to be done by the right side too.

    Returns
    -------
    (K, D) array
        Euclidean distances between its rows are those between the rows of eq. 3.6, to a hundredth.

    Raises
    ------
    SignfaceError
        Nothing moves.
    """
    gram = 0.0
    for skin in skins:
        flat = skin - skin.mean(axis=0)
        deviation = np.maximum(flat.std(axis=0), STILL_MM)
        rows = (flat / deviation).transpose(1, 0, 2)
        seen = [rows] if mirror is None else [rows, rows[mirror] * (-1.0, 1.0, 1.0)]
        for sample in seen:
            sample = sample.reshape(len(sample), -1)
            gram = gram + sample @ sample.T
    values, vectors = np.linalg.eigh(gram)
    values, vectors = np.maximum(values[::-1], 0.0), vectors[:, ::-1]
    if values[0] <= 0.0:
        raise SignfaceError("nothing moves in the range of motion", hint="give a take in which the face moves")
    rank = int(np.searchsorted(np.cumsum(values) / values.sum(), KEPT)) + 1
    return vectors[:, :rank] * np.sqrt(values[:rank])


def cluster_markers(rows: np.ndarray, sites: Sites, count: int, *, seed: int = 0) -> Clusters:
    """Markers by k-means: the allowed vertex nearest to each centroid, and the clusters.

    Fixed markers take the place of the clusters nearest to them. With symmetry, only the half face is clustered, into
    as many clusters as give `count` markers when those beside the midline are doubled; `rows` should then be symmetric
    (`trajectories` with `mirror`).

    Parameters
    ----------
    rows : (K, D) array
        From `trajectories`, in the order of `sites.clustered`.
    sites : Sites
    count : int
    seed : int

    Raises
    ------
    SignfaceError
        So many markers cannot be placed.
    """
    from sklearn.cluster import KMeans

    board = Board(sites, count)
    where = {int(vertex): row for row, vertex in enumerate(sites.clustered)}
    hidden = [vertex for vertex in sites.rules.fixed if vertex not in where]
    if hidden:
        raise SignfaceError(
            f"the fixed marker on vertex {hidden[0]} stands below the jaw or hidden, where nothing is clustered",
            hint="choose another method than k-means, or leave it out",
        )
    site_rows = np.array(
        [where[int(group[-1] if sites.vertices[group[-1], 0] > 0 else group[0])] for group in sites.groups]
    )
    if not sites.rules.symmetric:
        fit = KMeans(count, n_init=STARTS, random_state=seed).fit(rows)
        fixed = rows[[where[vertex] for vertex in sites.rules.fixed]]
        _place(board, rows, site_rows, fit, _others(fit.cluster_centers_, fixed))
        return Clusters(tuple(board.chosen), _nearest(rows, rows[[where[v] for v in board.chosen]]))

    across = sites.vertices[sites.clustered, 0]
    half = np.flatnonzero(across > -MIDDLE_MM / 2)
    given = {max(v, int(sites.mirror[v]), key=lambda vertex: sites.vertices[vertex, 0]) for v in sites.rules.fixed}
    fixed = rows[[where[vertex] for vertex in sorted(given)]]
    free = board.left
    best: tuple[int, KMeans, np.ndarray, int] | None = None
    for pieces in range(max(1, -(-free // 2)), min(-(-free // 2) + 7, free, len(half)) + 1):
        fit = KMeans(pieces + len(fixed), n_init=STARTS, random_state=seed).fit(rows[half])
        kept = _others(fit.cluster_centers_, fixed)
        centres = np.array([np.abs(across[half[fit.labels_ == k]]).mean() for k in kept])
        middle = 2 * pieces - free  # clusters that must get a marker on the midline
        cost = abs(int((centres < MIDDLE_MM).sum()) - middle)
        if best is None or cost < best[0]:
            best = cost, fit, kept[np.argsort(centres)], middle
    if best is not None:
        _, fit, order, middle = best
        single = np.array([len(group) == 1 for group in sites.groups])
        _place(board, rows, site_rows, fit, order[:middle], single)
        _place(board, rows, site_rows, fit, order[middle:], ~single)
    return Clusters(tuple(board.chosen), _nearest(rows, rows[[where[v] for v in board.chosen]]))


def _others(means: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """Indices of the centroids but for those that fixed markers stand for, each fixed marker for one."""
    distance = np.linalg.norm(fixed[:, None] - means[None], axis=2)
    return np.setdiff1d(np.arange(len(means)), linear_sum_assignment(distance)[1])


def _place(
    board: Board,
    rows: np.ndarray,
    site_rows: np.ndarray,
    fit: KMeans,
    order: np.ndarray,
    kind: np.ndarray | None = None,
) -> None:
    """Put a marker into each of some clusters, the largest first: on the free site nearest to its centroid.

    Among its own vertices: a centroid is shorter than its members, and what hardly moves lies near to any. A cluster
    without a free site of its own gets the nearest elsewhere.
    """
    sizes = np.bincount(fit.labels_, minlength=len(fit.cluster_centers_))
    clusters = fit.predict(rows[site_rows])
    for cluster in sorted(order, key=lambda k: -sizes[k]):
        if not board.left:
            return
        free = board.free
        if kind is not None and (free & kind).any():
            free = free & kind
        if (free & (clusters == cluster)).any():
            free = free & (clusters == cluster)
        open_sites = np.flatnonzero(free)
        distance = np.linalg.norm(rows[site_rows[open_sites]] - fit.cluster_centers_[cluster], axis=1)
        board.take(int(open_sites[int(np.argmin(distance))]))


def _nearest(rows: np.ndarray, means: np.ndarray) -> np.ndarray:
    """(K,) the nearest of some points, for each row."""
    squared = (means**2).sum(axis=1) - 2.0 * rows @ means.T
    return squared.argmin(axis=1)
