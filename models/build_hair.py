"""Build the brows and lashes of the default face, and the tint of its skin.

    python models/build_hair.py

They are made from `faces/default.glb` alone, which is not changed. Each hair is a triangle bound to the skin: its root
and tip stand on a place of a triangle (barycentric), a little above it, and have that place's displacement in each of
the 51 bases. Lashes turn with the rim of the lid. The same face gives the same bytes.

Written: `heads/hair.glb` (brows and lashes with the same 51 bases) and `heads/tint.npz` (by how much each vertex of the
skin is redder or darker than the rest), both for pictures only.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components, dijkstra

from signface.face.files.gltf import write_face
from signface.face.mesh import Mesh
from signface.face.model import FaceModel
from signface.face.reading import read_face

HERE = Path(__file__).resolve().parent
SEED = 20
#: Middle line of the left brow from the nose outwards, x and y in millimetres, and half its height there.
BROW = np.array([[10.5, 50.5], [17.0, 52.7], [26.0, 55.4], [36.0, 57.8], [44.0, 57.2], [51.0, 53.2], [54.5, 50.0]])
HALF_HEIGHT = np.array([2.0, 3.0, 3.2, 2.9, 2.2, 1.3, 0.5])
BROW_HAIRS, BROW_HAIR_MM, HAIR_WIDTH_MM, BROW_ABOVE_MM = 280, 6.5, 0.85, 0.45
UPPER_LASHES, UPPER_LASH_MM, LOWER_LASHES, LOWER_LASH_MM = 30, 6.0, 16, 2.4
LASH_WIDTH_MM, RIM_MM, RIM_ABOVE_MM, EYEBALL_MM = 0.5, 1.2, 0.5, 12.0
BROW_COLOUR, LASH_COLOUR, RIM_COLOUR = (0.20, 0.14, 0.105), (0.06, 0.045, 0.04), (0.13, 0.075, 0.06)
#: Factors on the skin's red, green and blue: lips, cheeks and tip of the nose, lids.
LIPS, FLUSH, LIDS = (0.88, 0.60, 0.60), (1.01, 0.93, 0.92), (0.90, 0.83, 0.82)


def twice_area(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(n,) signed areas of the parallelograms of plane vectors (n, 2)."""
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


class Skin:
    """The default skin: places on it seen from the front, and its free rims."""

    def __init__(self, face: FaceModel) -> None:
        self.face, self.vertices, self.triangles = face, face.mesh.vertices, face.mesh.triangles
        self.normals = face.mesh.vertex_normals
        self.corners = self.vertices[self.triangles]
        edges = np.concatenate([self.triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
        self.edges, count = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
        self.free = self.edges[count == 1]

    def place(self, x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
        """Corners (3,) and weights (3,) of the frontmost place of the skin at (x, y)."""
        a, b, c = np.moveaxis(self.corners[:, :, :2], 1, 0)
        p = np.array([x, y])
        double = twice_area(b - a, c - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            second = twice_area(p - a, c - a) / double
            third = twice_area(b - a, p - a) / double
        weights = np.stack([1 - second - third, second, third], axis=1)
        inside = np.flatnonzero((weights >= 0).all(axis=1) & (double > 0))
        depth = (weights[inside] * self.corners[inside, :, 2]).sum(axis=1)
        chosen = inside[depth.argmax()]
        return self.triangles[chosen], weights[chosen]

    def before(self, point: np.ndarray) -> float:
        """How far the frontmost skin lies before a point (3,), millimetres; 0 where there is none."""
        try:
            corners, weights = self.place(point[0], point[1])
        except ValueError:  # argmax of nothing
            return 0.0
        return max(0.0, float(weights @ self.vertices[corners, 2] - point[2]))

    def rims(self) -> list[np.ndarray]:
        """Vertices of each free rim, (n,) each."""
        graph = sparse.coo_matrix((np.ones(len(self.free)), self.free.T), shape=(len(self.vertices),) * 2)
        label = connected_components(graph, directed=False)[1]
        return [np.flatnonzero(label == each) for each in np.unique(label[self.free[:, 0]])]

    def lid_rim(self, side: int) -> np.ndarray:
        """Vertices of the rim of one eye's lids (+1 the left) in their order, from the inner corner."""
        rim = next(r for r in self.rims() if side * self.vertices[r, 0].mean() > 10 and self.vertices[r, 1].min() > 20)
        start = rim[np.argmin(side * self.vertices[rim, 0])]
        neighbours = {int(v): self.free[(self.free == v).any(axis=1)].sum(axis=1) - v for v in rim}
        order = [int(start), int(max(neighbours[int(start)], key=lambda v: self.vertices[v, 1]))]
        while len(order) < len(rim):
            order.append(int(next(v for v in neighbours[order[-1]] if v != order[-2])))
        return np.array(order)


class Hairs:
    """Triangles that gather, each vertex with its displacement in each base."""

    def __init__(self) -> None:
        self.points: list[np.ndarray] = []
        self.moved: list[np.ndarray] = []
        self.colours: list[tuple[float, float, float]] = []
        self.triangles: list[tuple[int, int, int]] = []

    def vertex(self, point: np.ndarray, moved: np.ndarray, colour: tuple[float, float, float]) -> int:
        """Number of a new vertex at (3,) that moves by (N, 3)."""
        self.points.append(point)
        self.moved.append(moved)
        self.colours.append(colour)
        return len(self.points) - 1

    def model(self, names: tuple[str, ...]) -> FaceModel:
        """What has gathered, to a hundredth of a millimetre; what moves less lies still."""
        bases = np.round(np.stack(self.moved, axis=1), 2)
        return FaceModel(
            Mesh(np.round(np.array(self.points), 3), np.array(self.triangles)),
            bases,
            names,
            name="hair",
            colours=np.array(self.colours),
            history=("build_hair.py: brows and lashes bound to faces/default.glb, CC0 1.0",),
        )


def grow_brow(skin: Skin, hairs: Hairs, side: int, rng: np.random.Generator) -> None:
    """Hairs of one brow: upright at the nose, then outwards, the upper ones downwards and the lower ones upwards."""
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(BROW, axis=0), axis=1))])
    for _ in range(BROW_HAIRS):
        s, across = along[-1] * rng.random(), rng.uniform(-1, 1)
        middle = np.array([np.interp(s, along, BROW[:, k]) for k in (0, 1)])
        ahead = np.array([np.interp(s + 1, along, BROW[:, k]) - np.interp(s - 1, along, BROW[:, k]) for k in (0, 1)])
        direction = np.arctan2(ahead[1], ahead[0])
        root = middle + np.array([0, across * float(np.interp(s, along, HALF_HEIGHT)) - 0.8])
        upright = max(0.0, 1 - s / 16)
        direction += 1.05 * upright + (1 - upright) * (-0.22 * across - 0.05) + rng.normal(0, 0.10)
        length = BROW_HAIR_MM * rng.uniform(0.7, 1.1) * (0.65 if s > 0.8 * along[-1] else 1.0)
        tip = root + length * np.array([np.cos(direction), np.sin(direction)])
        beside = 0.5 * HAIR_WIDTH_MM * np.array([-np.sin(direction), np.cos(direction)])
        shade = rng.uniform(0.75, 1.3)
        colour = tuple(np.array(BROW_COLOUR) * shade)
        numbers = []
        for x, y in (root - beside, root + beside, tip):
            corners, weights = skin.place(side * x, y)
            normal = weights @ skin.normals[corners]
            point = weights @ skin.vertices[corners] + BROW_ABOVE_MM * normal / np.linalg.norm(normal)
            numbers.append(hairs.vertex(point, weights @ skin.face.bases[:, corners], colour))
        hairs.triangles.append(tuple(numbers if side > 0 else numbers[::-1]))


def frames(skin: Skin, vertices: np.ndarray, rim: np.ndarray) -> np.ndarray:
    """(n, 3, 3) along a rim, into the lid and away from the eyeball, as columns, at the rim's vertices."""
    points = vertices[rim]
    at_rest = skin.vertices[rim].mean(axis=0) - (0.0, 0.0, EYEBALL_MM)
    normal = points - at_rest
    along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    normal -= (normal * along).sum(axis=1, keepdims=True) * along
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.stack([along, np.cross(along, normal), normal], axis=2)


def grow_lashes(skin: Skin, hairs: Hairs, side: int, rng: np.random.Generator) -> None:
    """Lashes of one eye, and the dark rim that they stand on."""
    rim = skin.lid_rim(side)
    outer = int(np.argmax(side * skin.vertices[rim, 0]))
    shapes = [skin.vertices, *(skin.vertices + base for base in skin.face.bases)]
    turned = [frames(skin, shape, rim) for shape in shapes]
    into = turned[0][:, :, 1]
    upper = np.arange(len(rim)) <= outer
    # The free rim of a lid lies millimetres behind the edge that is seen: what stands on the edge is brought forwards.
    lifted = np.array([
        turned[0][k].T @ (0.0, 0.0, skin.before(skin.vertices[v] + (0.0, 0.4 if up else -0.4, 0.0)))
        for k, (v, up) in enumerate(zip(rim, upper))
    ])  # fmt: skip

    def bound(position: float, local: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A vertex at a place of the rim, held by the frame there: where it rests, and (N, 3) how it moves."""
        first = int(position) % len(rim)
        second, share = (first + 1) % len(rim), position - int(position)
        found = []
        for shape, frame in zip(shapes, turned):
            ends = [shape[rim[k]] + frame[k] @ (lifted[k] + local) for k in (first, second)]
            found.append((1 - share) * ends[0] + share * ends[1])
        return found[0], np.array(found[1:]) - found[0]

    # Which way of the frame's second axis leads into the lid: upwards on the upper one.
    sign = 1.0 if into[upper][2:-2, 1].mean() > 0 else -1.0
    previous = None
    for position in np.linspace(0, outer, 3 * outer + 1):
        width = RIM_MM * min(1.0, 0.35 + 2.0 * min(position, outer - position + 2) / outer)
        pair = [
            hairs.vertex(*bound(position, np.array([0, sign * deep, RIM_ABOVE_MM])), RIM_COLOUR)
            for deep in (-0.1, width)
        ]
        if previous is not None:
            a, b, (c, d) = *previous, pair
            hairs.triangles += [(a, c, b), (c, d, b)]
        previous = pair
    for count, length, start, end in (
        (UPPER_LASHES, UPPER_LASH_MM, 0.12 * outer, outer + 0.3),
        (LOWER_LASHES, LOWER_LASH_MM, outer + 1.0, len(rim) - 2.0),
    ):
        for position in np.linspace(start, end, count):
            share = (position - start) / (end - start)
            outwards = share if count == UPPER_LASHES else 1 - share  # 0 at the nose, 1 at the temple
            reach = length * (0.55 + 0.45 * np.sin(np.pi * (0.15 + 0.65 * outwards))) * rng.uniform(0.85, 1.05)
            fan = (1 if count == UPPER_LASHES else -1) * (0.9 * outwards - 0.25)
            tip = reach * np.array([fan, 0.55 * sign, 0.75]) / np.linalg.norm([fan, 0.55, 0.75])
            half = 0.5 * LASH_WIDTH_MM
            numbers = [
                hairs.vertex(*bound(position, np.array(place)), LASH_COLOUR)
                for place in ((-half, 0, RIM_ABOVE_MM), (half, 0, RIM_ABOVE_MM), tip + np.array([0, 0, RIM_ABOVE_MM]))
            ]
            hairs.triangles.append(tuple(numbers))


def tint(skin: Skin) -> np.ndarray:
    """(V, 3) factors on the colour of the skin."""
    vertices = skin.vertices
    lengths = np.linalg.norm(np.diff(vertices[skin.edges], axis=1)[:, 0], axis=1)
    graph = sparse.coo_matrix((lengths, skin.edges.T), shape=(len(vertices),) * 2).tocsr()

    def far(rim: np.ndarray) -> np.ndarray:
        return dijkstra(graph, directed=False, indices=rim, min_only=True)

    def towards(colour: tuple[float, float, float], share: np.ndarray) -> np.ndarray:
        return 1 - np.clip(share, 0, 1)[:, None] * (1 - np.array(colour))

    mouth = next(r for r in skin.rims() if -50 < vertices[r, 1].mean() < 0)
    wide = 1 - (np.abs(vertices[:, 0]) / 27) ** 2  # lips end in the corners
    thick = 8.5 * np.sqrt(np.clip(wide, 0.02, 1))
    found = towards(LIPS, (thick - far(mouth)) / 2.5)
    for side in (1, -1):
        found = found * towards(LIDS, 1 - far(skin.lid_rim(side)) / 9)
        cheek = np.linalg.norm((vertices - (side * 46, -2, 78)) / (18, 16, 30), axis=1)
        ear = (side * vertices[:, 0] - 68) / 12
        found = found * towards(FLUSH, 1.2 - cheek) * towards(FLUSH, ear)
    nose = np.linalg.norm((vertices - (0, 4, 112)) / (13, 12, 20), axis=1)
    return found * towards(FLUSH, 1.3 - nose)


def main() -> None:
    """Build both files."""
    skin, hairs, rng = Skin(read_face("default")), Hairs(), np.random.default_rng(SEED)
    for side in (1, -1):
        grow_brow(skin, hairs, side, rng)
        grow_lashes(skin, hairs, side, rng)
    write_face(hairs.model(skin.face.names), HERE / "heads/hair.glb")
    hundredths = np.round(100 * tint(skin)).astype(np.uint8)
    np.savez_compressed(HERE / "heads/tint.npz", hundredths=hundredths)


if __name__ == "__main__":
    main()
