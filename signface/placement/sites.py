"""Where a marker may stand: what the captor allows.

- `Rules`: symmetry, forbidden zones, least distance, markers that are there already.
- `find_sites`: the places on a face that the rules leave, single ones and pairs.
- `Board`: a choice in the making; knows which sites are still free.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from signface.content import Content
from signface.errors import SignfaceError
from signface.face.camera import face_camera
from signface.face.model import FaceModel
from signface.placement.empirical import find_landmarks
from signface.render.raster import visible_triangles
from signface.render.still import whole_mesh

#: Zones where no marker holds, and how far around their lines (mm).
ZONES = {
    "lids": "the edges of the lids, 4 mm",
    "lips-inner": "the inner edge of the lips, 4 mm",
    "nostrils": "the boundaries of the nostrils, 3 mm",
    "under-jaw": "below the edge of the jaw, and behind its angle",
}
_LIDS_MM, _LIPS_MM, _NOSTRIL_MM = 4.0, 4.0, 3.0
#: A vertex this near to the plane of symmetry is on it (mm).
MIDLINE_MM = 0.5
#: A vertex has a mirror image when one lies this near (mm).
MIRROR_MM = 2.0
#: Pictures on which it is found out what cameras see, width and height in pixels.
_VIEW = (400, 480)
#: Sites closer than this need not both be tried (mm); no one glues a marker that precisely.
GRAIN_MM = 2.5


@dataclass(frozen=True, eq=False)
class Rules(Content):
    """What the captor allows.

    Parameters
    ----------
    symmetric : bool
        Every marker beside the midline has its mirror image.
    forbidden : tuple of str
        Keys of `ZONES`.
    spheres : tuple of ((3,) array, float)
        More forbidden places: centre and radius, millimetres.
    apart_mm : float
        Least distance between markers.
    fixed : tuple of int
        Vertices that carry a marker in any case.
    """

    symmetric: bool = True
    forbidden: tuple[str, ...] = tuple(ZONES)
    spheres: tuple[tuple[np.ndarray, float], ...] = ()
    apart_mm: float = 8.0
    fixed: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        unknown = [zone for zone in self.forbidden if zone not in ZONES]
        if unknown:
            raise SignfaceError(f"no zone is called {unknown[0]}", hint=f"the zones are {', '.join(ZONES)}")
        if not (np.isfinite(self.apart_mm) and self.apart_mm >= 0):
            raise SignfaceError(f"the least distance between markers is 0 mm or more, not {self.apart_mm:g}")


@dataclass(frozen=True, eq=False)
class Sites(Content):
    """Places for markers on a face.

    Parameters
    ----------
    groups : tuple of (1,) or (2,) int arrays
        Vertices that are chosen together: one, or a pair of mirror images.
    vertices : (V', 3) array
        Positions of all vertices of the face, millimetres.
    moving : (K',) int array
        Vertices that some base moves, allowed or not.
    clustered : (K,) int array
        Those of them that belong to the face: seen, and not below the jaw where that is forbidden. Clusters on the neck
        would take markers that must stand elsewhere.
    mirror : (V',) int array
        Mirror image of each vertex, -1 where it has none.
    rules : Rules
    """

    groups: tuple[np.ndarray, ...]
    vertices: np.ndarray
    moving: np.ndarray
    clustered: np.ndarray
    mirror: np.ndarray
    rules: Rules = field(default_factory=Rules)

    @property
    def union(self) -> np.ndarray:
        """Sorted vertices of all sites and of the fixed markers."""
        return np.unique(np.concatenate([*self.groups, np.array(self.rules.fixed, dtype=np.int64)]))

    def check_count(self, count: int) -> None:
        """Raise when so many markers cannot be placed at all.

        Raises
        ------
        SignfaceError
            There are fewer moving or free vertices than markers, or more fixed markers than markers.
        """
        room = sum(map(len, self.groups)) + len(self.rules.fixed)
        if count > len(self.moving):
            raise SignfaceError(
                f"{count} markers were asked for, but only {len(self.moving)} vertices of the face move",
                hint="ask for fewer markers",
            )
        if count > room:
            raise SignfaceError(
                f"{count} markers were asked for, but the zones leave room for {room}",
                hint="ask for fewer markers or forbid less",
            )
        if count < max(4, len(self.rules.fixed)):
            raise SignfaceError(
                f"{count} markers are fewer than {max(4, len(self.rules.fixed))}", hint="ask for more markers"
            )


class Board:
    """Markers chosen so far, and the sites that are still free.

    Parameters
    ----------
    sites : Sites
    count : int
        How many markers are wanted, the fixed ones included.

    Raises
    ------
    SignfaceError
        So many cannot be placed.
    """

    def __init__(self, sites: Sites, count: int) -> None:
        sites.check_count(count)
        self.sites, self.count = sites, count
        self.chosen: list[int] = []
        self._size = np.array([len(group) for group in sites.groups])
        self._alive = np.ones(len(sites.groups), dtype=bool)
        self._first = np.array([group[0] for group in sites.groups])
        self._last = np.array([group[-1] for group in sites.groups])
        for vertex in sites.rules.fixed:
            self._take([int(vertex)])

    @property
    def left(self) -> int:
        """How many markers are still to be chosen."""
        return self.count - len(self.chosen)

    @property
    def free(self) -> np.ndarray:
        """(S,) bool: the sites that may be chosen next.

        With pairs, the number still left must come out even: the last places on the midline are kept for that.

        Raises
        ------
        SignfaceError
            Markers are left but no site is.
        """
        fits = self._alive & (self._size <= self.left)
        if self.left and not fits.any():
            raise SignfaceError(
                f"only {len(self.chosen)} of {self.count} markers can be placed"
                f" {self.sites.rules.apart_mm:g} mm apart where they are allowed",
                hint="ask for fewer markers, a smaller least distance, or forbid less",
            )
        single = fits & (self._size == 1)
        if single.sum() <= 2 and not single[fits].all():
            if self.left % 2 and single.any():
                return single
            if self.left % 2 == 0 and single.sum() == 1:
                return fits & ~single
        return fits

    def take(self, site: int) -> None:
        """Choose a site; what lies too near to it is no longer free."""
        self._take([int(vertex) for vertex in self.sites.groups[site]])
        self._alive[site] = False

    def _take(self, vertices: list[int]) -> None:
        places = self.sites.vertices
        for vertex in vertices:
            self.chosen.append(vertex)
            for ends in (self._first, self._last):
                near = np.linalg.norm(places[ends] - places[vertex], axis=1) < max(self.sites.rules.apart_mm, 1e-9)
                self._alive &= ~near


def find_sites(face: FaceModel, rules: Rules | None = None) -> Sites:
    """The sites of a face that the rules leave, thinned to one every few millimetres.

    Parameters
    ----------
    face : FaceModel
    rules : Rules, optional

    Raises
    ------
    SignfaceError
        No base moves the face, the zones leave no place, or a symmetric layout is asked for on a face that is not
        symmetric about x = 0.
    """
    rules = rules or Rules()
    vertices = face.mesh.vertices
    moving = np.flatnonzero(face.moving)
    if not len(moving):
        raise SignfaceError(f"no base of {face.name} moves its skin", hint="check the face: signface face check")
    wrong = [vertex for vertex in rules.fixed if not 0 <= vertex < len(vertices)]
    if wrong:
        raise SignfaceError(f"{face.name} has no vertex {wrong[0]}", hint=f"its vertices are 0 to {len(vertices) - 1}")
    still = [vertex for vertex in rules.fixed if not face.moving[vertex]]
    if still:
        raise SignfaceError(
            f"the fixed marker on vertex {still[0]} stands where no base moves the skin",
            hint="give it the role head, or leave it out",
        )
    seen = seen_skin(face)
    allowed = moving[(seen & ~forbidden(face, rules))[moving]]
    neck = forbidden(face, Rules(forbidden=tuple(zone for zone in rules.forbidden if zone == "under-jaw")))
    clustered = moving[(seen & ~neck)[moving]]
    distance, mirror = cKDTree(vertices).query(vertices * (-1.0, 1.0, 1.0))
    mirror = np.where(distance < MIRROR_MM, mirror, -1)
    mirror[np.abs(vertices[:, 0]) < MIDLINE_MM] = np.flatnonzero(np.abs(vertices[:, 0]) < MIDLINE_MM)
    if rules.symmetric:
        side = allowed[vertices[allowed, 0] > -MIDLINE_MM]
        paired = np.isin(mirror[side], allowed)
        if len(side) and (mirror[side] < 0).mean() > 0.2:
            raise SignfaceError(f"{face.name} is not symmetric about x = 0", hint="ask for --asymmetric")
        side = side[paired]
        pairs = [np.unique([vertex, mirror[vertex]]) for vertex in _thinned(vertices, side)]
        groups = [
            pair for pair in pairs
            if len(pair) == 1 or np.linalg.norm(vertices[pair[0]] - vertices[pair[1]]) >= rules.apart_mm
        ]  # fmt: skip
    else:
        groups = [np.array([vertex]) for vertex in _thinned(vertices, allowed)]
    if not groups:
        raise SignfaceError("the forbidden zones leave no place for a marker", hint="forbid less")
    return Sites(tuple(groups), vertices, moving, clustered, mirror, rules)


def _thinned(vertices: np.ndarray, some: np.ndarray) -> np.ndarray:
    """Vertices at least `GRAIN_MM` from one another, those on the midline first, then from the middle outwards."""
    order = some[np.lexsort((np.linalg.norm(vertices[some] - vertices[some].mean(axis=0), axis=1),
                             np.abs(vertices[some, 0]) >= MIDLINE_MM))] if len(some) else some  # fmt: skip
    kept: list[int] = []
    for vertex in order:
        if not kept or np.linalg.norm(vertices[kept] - vertices[vertex], axis=1).min() >= GRAIN_MM:
            kept.append(int(vertex))
    return np.array(kept, dtype=np.int64)


def seen_skin(face: FaceModel) -> np.ndarray:
    """(V,) bool: the vertices that cameras around the face see at rest.

    What lies in the sockets, behind the lips or in the nostrils moves too, but carries no marker.
    """
    seen = np.zeros(len(face.mesh.vertices), dtype=bool)
    mesh, _ = whole_mesh(face, hair=False)  # a marker is glued on under hair as well
    for yaw, pitch in ((0.0, 0.0), (-60.0, 0.0), (60.0, 0.0), (0.0, -25.0)):
        camera = face_camera(face, yaw=yaw, pitch=pitch, size=_VIEW, margin=1.1)
        triangles = visible_triangles(mesh, camera)
        corners = mesh.triangles[triangles]
        facing = mesh.triangle_normals[triangles] @ camera.axes[2] > 0.0
        corners = corners[facing].ravel()
        seen[corners[corners < len(seen)]] = True
    return seen


def forbidden(face: FaceModel, rules: Rules) -> np.ndarray:
    """(V,) bool: the vertices that lie in a forbidden zone."""
    vertices = face.mesh.vertices
    out = np.zeros(len(vertices), dtype=bool)
    for centre, radius in rules.spheres:
        out |= np.linalg.norm(vertices - centre, axis=1) < radius
    if not rules.forbidden:
        return out
    places = find_landmarks(face)

    def near(line: list[str], limit: float) -> np.ndarray:
        corners = np.array([places[name] for name in line])
        steps = np.linspace(0.0, 1.0, 12)[:, None]
        points = np.concatenate([a + steps * (b - a) for a, b in itertools.pairwise(corners)])
        return cKDTree(points).query(vertices)[0] < limit

    for side in ("L_", "R_"):
        if "lids" in rules.forbidden:
            for lid in ("palpebrale_superius", "palpebrale_inferius"):
                out |= near([side + "endocanthion", side + lid, side + "exocanthion"], _LIDS_MM)
        if "lips-inner" in rules.forbidden:
            for middle, half in (("stomion_superius", "rima_upper"), ("stomion_inferius", "rima_lower")):
                out |= near([middle, side + half, side + "inner_commissure"], _LIPS_MM)
        if "nostrils" in rules.forbidden:
            out |= near([side + "nostril", side + "nostril"], _NOSTRIL_MM)
    if "under-jaw" in rules.forbidden:
        edge = np.array([places[name] for name in ("menton", "L_jaw_front", "L_jaw_middle", "L_jaw_side", "L_gonion")])
        mirrored = np.array(
            [places[name] for name in ("menton", "R_jaw_front", "R_jaw_middle", "R_jaw_side", "R_gonion")]
        )
        depth = 0.5 * (edge + mirrored * (-1.0, 1.0, 1.0))
        order = np.argsort(depth[:, 0])
        out |= vertices[:, 1] < np.interp(np.abs(vertices[:, 0]), depth[order, 0], depth[order, 1])
        out |= vertices[:, 2] < depth[-1, 2]
    return out
