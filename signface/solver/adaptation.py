"""Morphological adaptation: marker positions on the signer's face, carried to the avatar's face.

- `MorphologicalAdaptation`: Reverdy 2019, eq. 5.18 to 5.20: a triharmonic radial basis function with an affine part
  through the P neutral markers of signer and avatar.
- `SimilarityAdaptation`: displacements turned and scaled as the whole face is.
- `make_adaptation`: either by name.

The radial basis function goes through every neutral marker, and so its slopes, which are what displacements are
multiplied with, take up all that the two marker sets differ by, a marker glued 2 mm off included; across the surface,
where no marker stands, they are extrapolated. On synthetic signers the similarity leaves a quarter less error on the
skin (`docs/solver.md`), and it is the default of `solve_take`.
"""

from __future__ import annotations

import numpy as np

from signface.errors import SignfaceError

#: Singular values of the neutral markers' affine part below this share of the largest count as zero: along such a
#: direction (across a plane of markers) the markers say nothing of how the two faces differ.
FLAT = 1e-6

#: Neutral markers nearer to each other than this share of the cloud's size stand on one point.
COINCIDENT = 1e-6

#: The map may stretch any part of the face at most this many times as much as the whole.
STRETCH = 2.0

#: How far the map may pass by the neutral markers, tried in turn until nothing is stretched more than that. The values
#: are added to the diagonal of eq. 5.19 in coordinates of unit size; at the last one the map is nearly affine.
SMOOTHINGS = (0.0, *np.logspace(-5, 3, 17))

#: Frames are transformed this many at a time, so that the distances of a long take never lie in memory together.
FRAMES_AT_A_TIME = 512


class MorphologicalAdaptation:
    """Map positions on one face to the corresponding positions on another (eq. 5.18).

    Per coordinate, `F(m) = sum_k u_k |m - M0_k|^3 + a x + b y + c z + d`, with `F(M0_k)` the avatar's marker k. The
    system is solved in coordinates centred on the markers and divided by their size, so that the unit of length
    plays no part.

    Where the neutral markers lie in a plane or on a line, the affine part across it is not determined by them. It
    is then taken from the best similarity (rotation and scale) between the two clouds: markers leaving the plane
    keep their way out of it, scaled as the face is.

    Through every marker exactly, the map of a dense and noisy set (landmarks on the lids, 2 mm apart, 1 mm uncertain)
    would stretch the face tenfold between neighbours, and the noise of every frame with it. The map therefore passes
    by the markers just as far (a smoothing spline) as is needed to stretch no part of the face more than `STRETCH`
    times as much as the whole; `smoothing` says how far, and is 0 for the usual sets of some 40 markers.

    Parameters
    ----------
    source : (P, 3) array
        Neutral markers on the signer.
    target : (P, 3) array
        The same markers on the neutral avatar.

    Raises
    ------
    SignfaceError
        There are fewer than 4 markers, a position is not finite, or markers coincide.

    Examples
    --------
    >>> import numpy as np
    >>> square = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0], [1, 1, 1]])
    >>> MorphologicalAdaptation(square, 2 * square).transform(np.array([[0.5, 0.5, 0.0]])).round(9)
    array([[1., 1., 0.]])
    """

    def __init__(self, source: np.ndarray, target: np.ndarray) -> None:
        source, target = _checked(source, target)
        self._centre = source.mean(axis=0)
        self._size = float(np.sqrt(((source - self._centre) ** 2).sum(axis=1).mean()))
        self._knots = (source - self._centre) / self._size
        distance = np.linalg.norm(self._knots[:, None] - self._knots[None], axis=2)
        close = np.argwhere(np.triu(distance < COINCIDENT, k=1))
        if len(close):
            raise SignfaceError(
                f"neutral markers {close[0, 0] + 1} and {close[0, 1] + 1} stand on one point",
                hint="drop one of them, or choose another neutral frame",
            )
        for self.smoothing in SMOOTHINGS:
            self._fit(distance, target)
            if self._largest_stretch() <= STRETCH:
                break

    def _largest_stretch(self) -> float:
        """The greatest stretch of the map at any marker, beside that of the best similarity."""
        apart = self._knots[:, None] - self._knots[None]
        pull = 3.0 * np.linalg.norm(apart, axis=2)[:, :, None] * apart
        slopes = self._linear + np.einsum("mki,kj->mij", pull, self._radial)
        return float(np.linalg.svd(slopes, compute_uv=False)[:, 0].max() / self._scale)

    def _fit(self, distance: np.ndarray, target: np.ndarray) -> None:
        """Solve eq. 5.19, the affine part first brought to the directions that the markers span."""
        knots, count = self._knots, len(self._knots)
        similarity = _similarity(knots, target)
        self._scale = float(np.cbrt(np.linalg.det(similarity[:3])))
        _, values, axes = np.linalg.svd(knots, full_matrices=False)
        spanned = axes[values > FLAT * values[0]]
        affine = np.column_stack([knots @ spanned.T, np.ones(count)])
        system = np.zeros((count + affine.shape[1],) * 2)
        system[:count, :count] = distance**3 + self.smoothing * np.eye(count)
        system[:count, count:] = affine
        system[count:, :count] = affine.T
        right = np.zeros((len(system), 3))
        # The similarity is taken off first and added again: across a plane of markers it is all there is.
        right[:count] = target - (knots @ similarity[:3] + similarity[3])
        unknown = np.linalg.solve(system, right)
        self._radial = unknown[:count]
        self._linear = similarity[:3] + spanned.T @ unknown[count:-1]
        self._constant = similarity[3] + unknown[-1]

    @property
    def description(self) -> str:
        """For the history."""
        return f"rbf passing by them, {self.smoothing:.1g}" if self.smoothing else "rbf"

    def transform(self, points: np.ndarray) -> np.ndarray:
        """(..., 3) positions on the avatar from (..., 3) positions on the signer, such as (F, P, 3); NaN stays NaN."""
        points = np.asarray(points, dtype=np.float64)
        flat = points.reshape(-1, 3)
        result = np.empty_like(flat)
        step = max(1, FRAMES_AT_A_TIME * 40 // max(1, len(self._knots) // 40))
        for start in range(0, len(flat), step):
            local = (flat[start : start + step] - self._centre) / self._size
            # |m - k|^2 as a product of matrices: r^3 is so flat at 0 that the cancellation there does not show.
            squared = local @ (-2.0 * self._knots.T)
            squared += np.einsum("ij,ij->i", local, local)[:, None]
            squared += np.einsum("ij,ij->i", self._knots, self._knots)
            np.maximum(squared, 0.0, out=squared)
            squared *= np.sqrt(squared)
            result[start : start + step] = squared @ self._radial + local @ self._linear + self._constant
        return result.reshape(points.shape)


class SimilarityAdaptation:
    """Carry displacements over by the best rotation and scale between the neutral markers of two faces.

    Neutral markers need not fall on one another: a marker's place on the avatar is that of its layout, and its
    displacement from there is the signer's, turned and scaled.

    Parameters
    ----------
    source, target : (P, 3) array
        As for `MorphologicalAdaptation`, with the same errors.
    """

    def __init__(self, source: np.ndarray, target: np.ndarray) -> None:
        source, target = _checked(source, target)
        self._centre = source.mean(axis=0)
        self._similarity = _similarity(source - self._centre, target)

    @property
    def description(self) -> str:
        """For the history."""
        return "similarity"

    def transform(self, points: np.ndarray) -> np.ndarray:
        """Positions on the avatar, (..., 3) from (..., 3); NaN stays NaN."""
        return (np.asarray(points, dtype=np.float64) - self._centre) @ self._similarity[:3] + self._similarity[3]


#: The adaptations by name.
ADAPTATIONS: dict[str, type[SimilarityAdaptation | MorphologicalAdaptation]] = {
    "similarity": SimilarityAdaptation,
    "rbf": MorphologicalAdaptation,
}


def make_adaptation(
    name: str, source: np.ndarray, target: np.ndarray
) -> SimilarityAdaptation | MorphologicalAdaptation:
    """An adaptation by name.

    Raises
    ------
    SignfaceError
        There is no adaptation of that name, or the neutral markers do not allow one.
    """
    if name not in ADAPTATIONS:
        raise SignfaceError(f"no adaptation is called {name!r}", hint=f"there are {' and '.join(ADAPTATIONS)}")
    return ADAPTATIONS[name](source, target)


def _checked(source: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Neutral markers as arrays, refused where there are fewer than 4, one is missing, or they do not correspond."""
    source, target = np.asarray(source, dtype=np.float64), np.asarray(target, dtype=np.float64)
    if source.shape != target.shape or source.ndim != 2 or source.shape[1] != 3:
        raise SignfaceError(
            f"neutral markers of shapes {source.shape} and {target.shape} do not correspond: both must be (P, 3)"
        )
    if len(source) < 4:
        raise SignfaceError(
            f"the adaptation needs at least 4 neutral markers, not {len(source)}",
            hint="choose a neutral frame in which the markers are seen",
        )
    missing = ~(np.isfinite(source) & np.isfinite(target)).all(axis=1)
    if missing.any():
        raise SignfaceError(
            f"{missing.sum()} of {len(source)} neutral markers are missing",
            hint="choose a neutral frame in which they are seen",
        )
    if not np.ptp(source, axis=0).any():
        raise SignfaceError("all neutral markers stand on one point", hint="check the neutral frame")
    return source, target


def _similarity(knots: np.ndarray, target: np.ndarray) -> np.ndarray:
    """(4, 3) rows of the best rotation with scale, then the shift: `x @ result[:3] + result[3]` (Umeyama 1991).

    `knots` are centred. The rotation is proper, so that a plane of markers is not turned inside out.
    """
    centre = target.mean(axis=0)
    left, values, right = np.linalg.svd(knots.T @ (target - centre))
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(left) * np.linalg.det(right))])
    scale = float((values * sign).sum() / (knots**2).sum())
    return np.vstack([scale * (left * sign) @ right, centre])
