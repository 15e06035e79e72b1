"""Heads of the synthetic corpus: each signer's own shape, and skin that moves otherwise than the avatar's.

- `draw_head`: a new head on the avatar's topology.
- `Head.skin`: where its skin is for given weights; not linear in them.
- `Head.avatar_weights`: the weights that show the same on the avatar.
- `local_maps`: how a change of shape turns and stretches each part of the skin.

If the corpus were made with the avatar's own bases, solving it would only invert the program that made it (the
inverse crime of inverse problems). So everything that a real face does differently is put in: another shape, bases
carried over to it and changed (strength, side, direction), a jaw that turns about its hinge, muscles whose effect is
not proportional and which disturb one another.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial.transform import Rotation

from signface.content import Content
from signface.face.mesh import Mesh
from signface.face.model import FaceModel

#: Root mean square distance of a signer's face from the avatar's, millimetres: least and greatest.
SHAPE_RMS_MM = (4.0, 6.0)
#: Where the jaw turns, on the default face: the axis through both joints, just before the ears (y and z, mm). The
#: rotation that fits `jawOpen` best turns about y = -2, z = 18.
HINGE_YZ_MM = (0.0, 15.0)
#: The base that moves the lower jaw about its hinge.
JAW = "jawOpen"
#: Single features that are not drawn: crooked ones, ears, wrinkles, the head's size or posture, a frown at rest.
LEFT_OUT = (
    "macro-",
    "asym-",
    "l-ear",
    "r-ear",
    "chin-cleft",
    "chin-triangle",
    "head-age",
    "head-angle",
    "head-back",
    "head-scale",
    "mouth-angles",
    "mouth-trans-in",
    "mouth-trans-out",
    "nose-trans-in",
    "nose-trans-out",
)


@dataclass(frozen=True, eq=False)
class Head(Content):
    """A signer's head.

    Parameters
    ----------
    face : FaceModel
        Neutral skin and own bases, on the avatar's topology, millimetres.
    gains : (N,) float64 array
        How strong each base is beside the avatar's.
    bends : (N,) float64 array
        How far each base departs from proportionality: weight w acts as `w + bend * w * (1 - w)`.
    couplings : tuple of (int, int, (V, 3) array)
        Pairs of bases and the skin's displacement when both are fully active, millimetres.
    """

    face: FaceModel
    gains: np.ndarray
    bends: np.ndarray
    couplings: tuple[tuple[int, int, np.ndarray], ...]

    def acting(self, weights: np.ndarray) -> np.ndarray:
        """(F, N) weights as they act, bent."""
        return weights + self.bends * weights * (1.0 - weights)

    def avatar_weights(self, weights: np.ndarray) -> np.ndarray:
        """(F, N) weights with which the avatar's own bases show what this skin shows, but for its disturbances."""
        return self.acting(weights) * self.gains

    def skin(self, weights: np.ndarray, vertices: np.ndarray) -> np.ndarray:
        """Positions of some vertices of the skin in head coordinates.

        Parameters
        ----------
        weights : (F, N) array
        vertices : (K,) int array

        Returns
        -------
        (F, K, 3) array
            Millimetres.
        """
        acting = self.acting(weights)
        jaw = self.face.names.index(JAW)
        others = np.delete(np.arange(self.face.n_bases), jaw)
        rest = self.face.mesh.vertices[vertices]
        skin = rest + np.tensordot(acting[:, others], self.face.bases[others][:, vertices], axes=1)
        skin += _swing(acting[:, jaw], self.face.bases[jaw][vertices], rest)
        for first, second, field in self.couplings:
            skin += (weights[:, first] * weights[:, second])[:, None, None] * field[vertices]
        return skin


def _swing(weights: np.ndarray, displacements: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """(F, K, 3) displacement along arcs about the jaw's hinge that end, for a weight of 1, in `displacements` (K, 3).

    A chord c of a circle of radius r about the hinge spans the angle 2 asin(c / 2r); the arc bulges away from the
    hinge.
    """
    chord = np.linalg.norm(displacements, axis=1)
    moving = chord > 1e-6
    along = np.divide(displacements, chord[:, None], where=moving[:, None], out=np.zeros_like(displacements))
    outward = rest - np.array([0.0, *HINGE_YZ_MM])
    outward[:, 0] = 0.0
    radius = np.maximum(np.linalg.norm(outward, axis=1), 30.0)
    outward -= (outward * along).sum(axis=1, keepdims=True) * along
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
    half = np.maximum(np.arcsin(np.clip(chord / (2.0 * radius), 0.0, 0.95)), 1e-6)
    arc = chord / (2.0 * np.sin(half))
    angle = half * (1.0 - 2.0 * weights[:, None])
    travelled = arc * (np.sin(half) - np.sin(angle))
    bulge = arc * (np.cos(angle) - np.cos(half))
    return travelled[..., None] * along + bulge[..., None] * outward


def draw_head(avatar: FaceModel, identities: np.ndarray, names: tuple[str, ...], rng: np.random.Generator) -> Head:
    """A new signer's head.

    Parameters
    ----------
    avatar : FaceModel
    identities : (K, V, 3) array
        Changes of shape on the avatar's topology (`signface.face.reading.read_identities`).
    names : (K,) tuple of str
        Their names; `l-` and `r-` open the names of the two sides of one change.
    rng : numpy Generator

    Returns
    -------
    Head
    """
    vertices = avatar.mesh.vertices
    shape = draw_shape(avatar, identities, names, rng)
    maps = local_maps(avatar.mesh, shape)
    bases = np.einsum("vij,nvj->nvi", maps, avatar.bases)
    count = avatar.n_bases

    gains = np.clip(rng.normal(1.0, 0.12, count), 0.7, 1.3)
    leaning = rng.normal(0.0, 0.07, count)
    side = np.tanh(vertices[:, 0] / 10.0)
    bases = bases * (gains[:, None] * (1.0 + leaning[:, None] * side))[..., None]

    regional = Rotation.from_rotvec(smooth_field(vertices, rng, spread_mm=35.0) * np.radians(5.0)).as_matrix()
    single = Rotation.from_rotvec(rng.normal(0.0, np.radians(3.0), (count, 3))).as_matrix()
    bases = np.einsum("nij,vjk,nvk->nvi", single, regional, bases, optimize=True)

    # One-sided bases lean as a whole: that part of it is strength, not a difference within the base.
    one_sided = np.array(
        [1.0 if name.endswith("Left") else -1.0 if name.endswith("Right") else 0.0 for name in avatar.names]
    )
    face = FaceModel(Mesh(shape, avatar.mesh.triangles), bases, avatar.names, name="signer")
    return Head(
        face=face,
        gains=gains * (1.0 + leaning * one_sided),
        bends=np.clip(rng.normal(0.0, 0.15, count), -0.3, 0.3),
        couplings=_draw_couplings(face, rng),
    )


def _draw_couplings(
    face: FaceModel, rng: np.random.Generator, count: int = 14
) -> tuple[tuple[int, int, np.ndarray], ...]:
    """Pairs of bases that move common skin, and a smooth displacement of that skin when both act."""
    size = np.linalg.norm(face.bases, axis=2)
    overlap = size @ size.T
    np.fill_diagonal(overlap, 0.0)
    chances = np.triu(overlap).ravel() ** 0.5
    chosen = rng.choice(len(chances), size=count, replace=False, p=chances / chances.sum())
    couplings = []
    for pair in chosen:
        first, second = divmod(int(pair), face.n_bases)
        common = size[first] * size[second]
        field = smooth_field(face.mesh.vertices, rng, spread_mm=20.0)
        couplings.append((first, second, 1.2 * field * np.sqrt(common / common.max())[:, None]))
    return tuple(couplings)


def draw_shape(
    avatar: FaceModel, identities: np.ndarray, names: tuple[str, ...], rng: np.random.Generator
) -> np.ndarray:
    """(V, 3) another head: a few features of its own, and as much of a sex, an age and ancestries as it takes to lie
    `SHAPE_RMS_MM` from the avatar.

    The distance is taken over the skin that the bases move, after the best rigid alignment: a head that only sits
    elsewhere is no other head. Features are not scaled: twice a hooked nose is a caricature.
    """
    rest, moving = avatar.mesh.vertices, avatar.moving
    person = np.tensordot(_person(names, rng), identities, axes=1)
    features = np.tensordot(_features(names, rng), identities, axes=1)
    target = rng.uniform(*SHAPE_RMS_MM)
    low, high = 0.0, 3.0
    for _ in range(20):
        factor = 0.5 * (low + high)
        shape = _aligned(rest + features + factor * person, rest, moving)
        rms = np.sqrt(((shape - rest)[moving] ** 2).sum(axis=1).mean())
        low, high = (factor, high) if rms < target else (low, factor)
    return shape


def _person(names: tuple[str, ...], rng: np.random.Generator) -> np.ndarray:
    """(K,) somewhat a woman or a man, no longer young, of mixed ancestry."""
    amounts = dict.fromkeys(names, 0.0)
    amounts[str(rng.choice(["macro-female", "macro-male"]))] = rng.uniform(0.2, 0.8)
    ancestries = ["macro-african", "macro-asian", "macro-caucasian"]
    amounts.update(zip(ancestries, 0.7 * rng.dirichlet(np.full(3, 0.7))))
    amounts["macro-old"] = rng.uniform(0.0, 0.25)
    return np.array([amounts[name] for name in names])


def _features(names: tuple[str, ...], rng: np.random.Generator) -> np.ndarray:
    """(K,) how much of each single feature.

    Shapes that oppose each other (`-incr` and `-decr`, `-up` and `-down`) exclude each other; both sides of a face get
    nearly the same.
    """
    amounts = dict.fromkeys(names, 0.0)
    ways: dict[str, list[str]] = {}
    for name in names:
        if not name.startswith(LEFT_OUT):
            ways.setdefault(_sideless(name).rpartition("-")[0], []).append(name)
    for feature in ways.values():
        if rng.random() < 0.4:
            way = _sideless(str(rng.choice(feature)))
            amount = min(abs(rng.normal(0.0, 0.22)), 0.4)
            for name in feature:
                if _sideless(name) == way:
                    amounts[name] = amount * np.clip(rng.normal(1.0, 0.2), 0.5, 1.5)  # no face is quite symmetric
    return np.array([amounts[name] for name in names])


def _sideless(name: str) -> str:
    """The name of an identity shape without its side."""
    return name.removeprefix("l-").removeprefix("r-")


def _aligned(points: np.ndarray, reference: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Points moved rigidly so that those under the mask lie closest to the reference."""
    centre, goal = points[mask].mean(axis=0), reference[mask].mean(axis=0)
    turn, _ = Rotation.align_vectors(reference[mask] - goal, points[mask] - centre)
    return turn.apply(points - centre) + goal


def local_maps(mesh: Mesh, shape: np.ndarray, rings: int = 4) -> np.ndarray:
    """(V, 3, 3) linear map at each vertex from the mesh's neighbourhood to the same neighbourhood of another shape.

    Least squares over the edges that meet there and the normal, averaged over some rings: the idea of deformation
    transfer (R. Sumner and J. Popović, 2004) without its global solve, which shapes as close as two heads do not need.
    """
    edges = np.concatenate([mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]], mesh.triangles[:, [2, 0]]])
    edges = np.unique(np.concatenate([edges, edges[:, ::-1]]), axis=0)
    count = len(mesh.vertices)
    gather = sparse.csr_matrix((np.ones(len(edges)), (edges[:, 0], np.arange(len(edges)))), (count, len(edges)))
    before = mesh.vertices[edges[:, 1]] - mesh.vertices[edges[:, 0]]
    after = shape[edges[:, 1]] - shape[edges[:, 0]]
    moments = gather @ (before[:, :, None] * before[:, None, :]).reshape(-1, 9)
    crossed = gather @ (after[:, :, None] * before[:, None, :]).reshape(-1, 9)
    lengths = gather @ (before**2).sum(axis=1)
    stretch = np.sqrt((gather @ (after**2).sum(axis=1)) / lengths)
    old, new = mesh.vertex_normals, Mesh(shape, mesh.triangles).vertex_normals
    moments += (lengths[:, None, None] * old[:, :, None] * old[:, None, :]).reshape(-1, 9)
    crossed += ((lengths * stretch)[:, None, None] * new[:, :, None] * old[:, None, :]).reshape(-1, 9)
    average = sparse.csr_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), (count, count)) + sparse.eye(count)
    average = sparse.diags(1.0 / np.asarray(average.sum(axis=1)).ravel()) @ average
    for _ in range(rings):
        moments, crossed = average @ moments, average @ crossed
    return crossed.reshape(-1, 3, 3) @ np.linalg.inv(moments.reshape(-1, 3, 3))


def smooth_field(points: np.ndarray, rng: np.random.Generator, *, spread_mm: float, waves: int = 24) -> np.ndarray:
    """(V, 3) a random vector field of unit variance in each coordinate that changes over `spread_mm`.

    Random Fourier features of a Gaussian covariance (A. Rahimi and B. Recht, 2007).
    """
    frequency = rng.normal(0.0, 1.0 / spread_mm, (waves, 3))
    phase = rng.uniform(0.0, 2.0 * np.pi, waves)
    amplitude = rng.standard_normal((waves, 3)) * np.sqrt(2.0 / waves)
    return np.cos(points @ frequency.T + phase) @ amplitude
