"""`FaceModel`: a neutral mesh and the bases that move it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from signface.content import Content, Summary
from signface.errors import SignfaceError
from signface.face.mesh import Mesh


@dataclass(frozen=True, eq=False, repr=False)
class FaceModel(Summary, Content):
    """A blendshape face (Reverdy 2019, eq. 4.1 and 5.2): `neutral + sum_i weight_i * bases[i]`.

    Parameters
    ----------
    mesh : Mesh
        The neutral skin, V vertices, millimetres.
    bases : (N, V, 3) float64 array
        Displacements from the neutral for a weight of 1, millimetres.
    names : (N,) tuple of str
        Names of the bases, unique.
    unit : str
        Unit of the file it came from (`m`, `cm`, `mm`); inside, everything is in millimetres.
    identities : (K, V, 3) float64 array, optional
        Displacements that change whose head it is.
    identity_names : (K,) tuple of str
        Their names.
    colours : (V, 3) float64 array, optional
        Colour of each vertex for pictures, 0 to 1.
    name : str
        Name of the face.
    history : tuple of str
        Where it came from.

    Raises
    ------
    SignfaceError
        Shapes disagree, a value is not finite, or a name is repeated.

    See Also
    --------
    signface.read_face : where faces come from.

    Examples
    --------
    >>> import signface as sf
    >>> face = sf.read_face()
    >>> face.n_bases, face.names[:2]
    (51, ('eyeBlinkLeft', 'eyeLookDownLeft'))
    """

    mesh: Mesh
    bases: np.ndarray
    names: tuple[str, ...]
    unit: str = "mm"
    identities: np.ndarray | None = None
    identity_names: tuple[str, ...] = ()
    name: str = "face"
    history: tuple[str, ...] = field(default=(), compare=False)
    colours: np.ndarray | None = None

    def _sizes(self) -> str:
        return f"{len(self.names)} bases, {len(self.mesh.vertices)} vertices"

    def __post_init__(self) -> None:
        bases = np.array(self.bases, dtype=np.float64)
        names = tuple(str(name) for name in self.names)
        count = len(self.mesh.vertices)
        if bases.ndim != 3 or bases.shape[2] != 3 or len(bases) == 0:
            raise SignfaceError(f"{self.name}: bases must have the shape (N, V, 3), not {bases.shape}")
        if bases.shape[1] != count:
            raise SignfaceError(
                f"{self.name}: the bases have {bases.shape[1]} vertices but the neutral has {count}",
                hint="all shapes of a face must share one topology",
            )
        if len(names) != len(bases):
            raise SignfaceError(f"{self.name}: {len(bases)} bases but {len(names)} names")
        if len(set(names)) != len(names):
            raise SignfaceError(f"{self.name}: base names are repeated")
        if not np.isfinite(bases).all():
            raise SignfaceError(f"{self.name}: the bases have values that are not finite")
        identities = np.zeros((0, count, 3)) if self.identities is None else np.array(self.identities, float)
        if identities.shape[1:] != (count, 3) or len(identities) != len(self.identity_names):
            raise SignfaceError(f"{self.name}: identity shapes do not match the mesh or their names")
        if self.colours is not None and np.shape(self.colours) != (count, 3):
            raise SignfaceError(f"{self.name}: colours of shape {np.shape(self.colours)} do not match {count} vertices")
        self._hold(bases=bases, names=names, identities=identities)
        self._hold(identity_names=tuple(self.identity_names), history=tuple(self.history))

    @property
    def n_bases(self) -> int:
        """Number of bases N."""
        return len(self.bases)

    def pose(self, weights: np.ndarray) -> np.ndarray:
        """(V, 3) or (F, V, 3) positions of the vertices for (N,) or (F, N) weights, millimetres."""
        weights = np.asarray(weights, dtype=np.float64)
        if weights.shape[-1] != self.n_bases:
            raise SignfaceError(f"{self.name} has {self.n_bases} bases but {weights.shape[-1]} weights were given")
        return self.mesh.vertices + np.tensordot(weights, self.bases, axes=1)

    @property
    def moving(self) -> np.ndarray:
        """(V,) bool: the vertices that at least one base moves by more than a hundredth of a millimetre."""
        return (np.linalg.norm(self.bases, axis=2) > 1e-2).any(axis=0)
