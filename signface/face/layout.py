"""`MarkerLayout`: where each marker stands on a face model, and what it is for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from signface.content import Content, Summary
from signface.errors import SignfaceError
from signface.face.model import FaceModel

ROLES = ("face", "head")

#: Layouts of landmarks that a tracker finds in pictures. Unlike markers, they are on the same places of a signer's face
#: in every take, and do not creep on the skin.
LANDMARK_LAYOUTS = ("mediapipe", "openface", "kinect")


@dataclass(frozen=True, eq=False, repr=False)
class MarkerLayout(Summary, Content):
    """Marker labels, their roles, and their points on a face's neutral surface.

    Parameters
    ----------
    labels : (M,) tuple of str
        Marker names, unique.
    roles : (M,) tuple of str
        `face` (P markers that move with the skin) or `head` (Q rigid markers that only carry the head's motion).
    corners : (M, 3) int64 array
        The three vertices of the triangle a marker stands on; three times the same vertex for a marker on a vertex;
        -1 for a head marker that has no point on the skin.
    barycentric : (M, 3) float64 array
        Weights of those vertices, summing to 1 (0 where there is no point).
    name : str
        Name of the layout.

    See Also
    --------
    signface.read_layout, signface.choose_layout : where layouts come from.

    Examples
    --------
    >>> import signface as sf
    >>> layout = sf.read_layout("default-40", sf.read_face())
    >>> layout.face_labels[:3]
    ('LBROI', 'RBROI', 'LBROM')
    """

    labels: tuple[str, ...]
    roles: tuple[str, ...]
    corners: np.ndarray
    barycentric: np.ndarray
    name: str = "layout"

    def _sizes(self) -> str:
        return f"{len(self.face_labels)} face markers, {len(self.head_labels)} head markers"

    def __post_init__(self) -> None:
        labels, roles = tuple(map(str, self.labels)), tuple(map(str, self.roles))
        corners = np.array(self.corners, dtype=np.int64).reshape(-1, 3)
        barycentric = np.array(self.barycentric, dtype=np.float64).reshape(-1, 3)
        if not len(labels) == len(roles) == len(corners) == len(barycentric):
            raise SignfaceError(f"{self.name}: labels, roles and points of the layout differ in number")
        if len(set(labels)) != len(labels):
            raise SignfaceError(f"{self.name}: marker labels are repeated in the layout")
        bad = sorted(set(roles) - set(ROLES))
        if bad:
            raise SignfaceError(f"{self.name}: unknown role {', '.join(bad)}", hint="a role is face or head")
        standing = np.asarray((corners >= 0).all(axis=1))
        loose = [label for label, role, on in zip(labels, roles, standing) if role == "face" and not on]
        if loose:
            raise SignfaceError(f"{self.name}: face markers without a vertex: {', '.join(loose[:5])}")
        if not np.isfinite(barycentric).all() or not np.allclose(barycentric[standing].sum(axis=1), 1.0):
            raise SignfaceError(f"{self.name}: barycentric weights must be finite and sum to 1")
        self._hold(labels=labels, roles=roles, corners=corners, barycentric=barycentric)

    @classmethod
    def on_vertices(
        cls, face_markers: dict[str, int], head_markers: Sequence[str] = (), name: str = "layout"
    ) -> MarkerLayout:
        """A layout from `{label: vertex}` and the labels of rigid head markers without a point."""
        labels = (*face_markers, *head_markers)
        corners = [[vertex] * 3 for vertex in face_markers.values()] + [[-1] * 3] * len(head_markers)
        barycentric = [[1.0, 0.0, 0.0]] * len(face_markers) + [[0.0] * 3] * len(head_markers)
        roles = ("face",) * len(face_markers) + ("head",) * len(head_markers)
        return cls(labels, roles, np.array(corners), np.array(barycentric), name)

    def _of(self, role: str) -> tuple[str, ...]:
        return tuple(label for label, kind in zip(self.labels, self.roles) if kind == role)

    @property
    def of_landmarks(self) -> bool:
        """Whether a tracker finds its markers in pictures; see `LANDMARK_LAYOUTS`."""
        return self.name in LANDMARK_LAYOUTS

    @property
    def face_labels(self) -> tuple[str, ...]:
        """Labels of the P face markers, in order."""
        return self._of("face")

    @property
    def head_labels(self) -> tuple[str, ...]:
        """Labels of the Q head markers, in order."""
        return self._of("head")

    def restricted(self, labels: Sequence[str]) -> MarkerLayout:
        """The layout with only the given markers, in the layout's own order."""
        keep = [i for i, label in enumerate(self.labels) if label in set(labels)]
        names, roles = (tuple(values[i] for i in keep) for values in (self.labels, self.roles))
        return MarkerLayout(names, roles, self.corners[keep], self.barycentric[keep], self.name)

    def interpolate(self, values: np.ndarray, labels: Sequence[str] | None = None) -> np.ndarray:
        """(..., len(labels), 3) values at the markers from values at the vertices.

        Parameters
        ----------
        values : (..., V, 3) array
            A quantity per vertex: neutral positions, displacements of a base.
        labels : sequence of str, optional
            Which markers; by default the face markers.

        Raises
        ------
        SignfaceError
            A marker has no point on the face, or its vertex is not in the face.
        """
        wanted = self.face_labels if labels is None else tuple(labels)
        rows = [self.labels.index(label) for label in wanted]
        corners, barycentric = self.corners[rows], self.barycentric[rows]
        if (corners < 0).any():
            loose = [label for label, corner in zip(wanted, corners) if (corner < 0).any()]
            raise SignfaceError(f"{self.name}: markers without a point on the face: {', '.join(loose[:5])}")
        if corners.size and corners.max() >= values.shape[-2]:
            raise SignfaceError(
                f"{self.name}: the layout names vertex {corners.max()} but the face has {values.shape[-2]}",
                hint="use a layout made for this face",
            )
        return np.einsum("...pkd,pk->...pd", values[..., corners, :], barycentric)

    def points(self, face: FaceModel, labels: Sequence[str] | None = None) -> np.ndarray:
        """(P, 3) neutral positions of the markers on a face, millimetres."""
        return self.interpolate(face.mesh.vertices, labels)

    def bases(self, face: FaceModel) -> np.ndarray:
        """(N, P, 3) displacement of each face marker by each base, millimetres."""
        return self.interpolate(face.bases)
