"""What every mapping from markers to weights shares: the interface, its result, and the face seen by the markers.

- `Solver`: built once from a face and a layout; `.solve(displacements)` gives a `Solution`.
- `Solution`: weights and residuals of a batch of frames.
- `MarkerBases`: the bases where the markers stand, and which of them the markers can observe at all.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from signface.content import Content
from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel

#: A base is observed when its root mean square displacement at the markers reaches this share of the median base's.
#: Below it, jitter and misfit would be read as activations: an eye turned sideways drags the lids by 0.2 mm.
OBSERVED_SHARE = 0.2

#: Relative size of a singular value of the marker matrix under which bases count as linearly dependent.
DEPENDENT = 1e-7

#: Cosine between two bases at the markers from which they count as opposed.
OPPOSED = -1.0 + 1e-9


@dataclass(frozen=True, eq=False)
class Solution(Content):
    """Weights of a batch of frames.

    Parameters
    ----------
    weights : (F, N) float64 array
        0 at rest, 1 fully active. NaN in a frame without any marker.
    residual : (F,) float64 array
        Root mean square distance between the given and the solved markers, over the markers present, in the
        displacements' unit (millimetres in signface). NaN in a frame without any marker.
    """

    weights: np.ndarray
    residual: np.ndarray


class Solver(Protocol):
    """Markers to weights. Everything that does not depend on the frame is computed by the constructor."""

    names: tuple[str, ...]

    def solve(self, displacements: np.ndarray) -> Solution:
        """Weights of each frame.

        Parameters
        ----------
        displacements : (F, P, 3) array
            Displacement of each face marker of the layout from its neutral place (eq. 5.21), in the face's unit;
            NaN where a marker is missing.
        """
        ...


class MarkerBases:
    """The bases at the markers (eq. 5.22), with the checks that every solver needs.

    Parameters
    ----------
    face : FaceModel
    layout : MarkerLayout
        Its P face markers are used.
    skin : bool
        Whether the solver also weighs the skin between the markers, as a thin shell does: bases must then differ
        somewhere on the skin, not at the markers, and few markers will do.
    signer_bases : (N, P, 3) array, optional
        Displacements of the markers by the bases, where they are not the avatar's.

    Attributes
    ----------
    matrix : (3P, N) array
        Displacement of each marker coordinate (marker by marker, x y z) by each base, in the face's unit.
    observed : (N,) bool array
        The bases that the markers can see. The others are left at weight 0: an eye rotation moves no skin.
    scale : float
        Mean over the observed bases of their summed squared displacement at the markers (unit squared): what one
        typical base, fully active, does to the markers.
    warning : str
        With `skin`: which bases the markers alone do not tell apart; empty when they tell all.

    Raises
    ------
    SignfaceError
        There are too few markers, no base is observed, or observed bases are linearly dependent at the markers (with
        `skin`, on the whole skin).
    """

    def __init__(
        self, face: FaceModel, layout: MarkerLayout, *, skin: bool = False, signer_bases: np.ndarray | None = None
    ) -> None:
        bases = layout.bases(face)
        if signer_bases is not None:
            if np.shape(signer_bases) != bases.shape or not np.isfinite(signer_bases).all():
                raise SignfaceError(
                    f"the signer's bases have the shape {np.shape(signer_bases)}, not {bases.shape}, or are not finite",
                    hint="calibrate the signer with this face and layout",
                )
            bases = np.asarray(signer_bases, dtype=np.float64)
        self.names = face.names
        self.face_name = face.name
        self.labels = layout.face_labels
        self.n_markers = bases.shape[1]
        if self.n_markers < 4:
            raise SignfaceError(
                f"the layout {layout.name} has {self.n_markers} face markers, and at least 4 are needed",
                hint="use a layout with more face markers",
            )
        self.matrix = bases.reshape(len(bases), -1).T.copy()
        energy = np.einsum("ij,ij->j", self.matrix, self.matrix)
        if not energy.any():
            raise SignfaceError(
                f"no base of {face.name} moves a marker of the layout {layout.name}",
                hint="use a layout made for this face",
            )
        typical = np.median(energy[energy > 1e-12 * energy.max()])
        self.observed = energy > OBSERVED_SHARE**2 * typical
        self.scale = float(energy[self.observed].mean())
        at_markers = f"at the markers of the layout {layout.name}"
        self.warning = ""
        if skin:
            everywhere = face.bases[self.observed].reshape(int(self.observed.sum()), -1).T
            if alike := self._dependent(everywhere):
                raise self._refusal(alike, f"on the skin of {face.name}")
            if alike := self._dependent(self.matrix[:, self.observed]):
                self.warning = f"bases are linearly dependent {at_markers}, and the shell alone decides: {alike}"
        elif 3 * self.n_markers < self.observed.sum():
            raise SignfaceError(
                f"{self.n_markers} face markers (3 coordinates each) cannot tell apart"
                f" the {self.observed.sum()} bases of {self.face_name} that move them",
                hint=f"use at least {-(-self.observed.sum() // 3)} face markers",
            )
        elif alike := self._dependent(self.matrix[:, self.observed]):
            raise self._refusal(alike, at_markers)

    def _refusal(self, alike: str, where: str) -> SignfaceError:
        return SignfaceError(
            f"bases of {self.face_name} are linearly dependent {where}: {alike}",
            hint="drop one of them from the face, or add markers that tell them apart",
        )

    def _dependent(self, columns: np.ndarray) -> str:
        """The observed bases that are linearly dependent, given as (k, n) columns, in words; nothing if none is.

        Of two bases that are exactly opposed (an eye turned in and out), weights of 0 or more tell which one acts:
        that is no ambiguity, and only one of them is looked at.
        """
        names = np.array(self.names)[self.observed]
        length = np.linalg.norm(columns, axis=0)
        opposed = (np.triu((columns / length).T @ (columns / length), k=1) < OPPOSED).any(axis=0)
        columns, names = columns[:, ~opposed] / length[~opposed], names[~opposed]
        # R of a QR factorisation has the singular values and rows of the many rows it stands for.
        _, values, rows = np.linalg.svd(np.linalg.qr(columns, mode="r"), full_matrices=True)
        null = rows[np.append(values, np.zeros(len(rows) - len(values))) < DEPENDENT * values[0]]
        if not len(null):
            return ""
        share = np.abs(null).max(axis=0)
        involved = names[share > 0.05 * share.max()]
        return ", ".join(involved[:8]) + (f" and {len(involved) - 8} more" if len(involved) > 8 else "")

    def checked(self, displacements: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """`rows` with 0 for missing markers, and the (F, P) bool array of present ones."""
        rows = self.rows(displacements)
        present = np.isfinite(rows).reshape(len(rows), -1, 3).all(axis=2)
        if not present.all():
            rows = np.where(np.repeat(present, 3, axis=1), rows, 0.0)
        return rows, present

    def rows(self, displacements: np.ndarray) -> np.ndarray:
        """The displacements as (F, 3P) rows, whatever they hold.

        Raises
        ------
        SignfaceError
            The shape does not fit the layout.
        """
        displacements = np.asarray(displacements, dtype=np.float64)
        if displacements.ndim != 3 or displacements.shape[1:] != (self.n_markers, 3):
            raise SignfaceError(
                f"displacements must have the shape (frames, {self.n_markers}, 3), not {displacements.shape}"
            )
        return displacements.reshape(len(displacements), -1)

    def solution(self, weights: np.ndarray, rows: np.ndarray, present: np.ndarray) -> Solution:
        """The `Solution` of solved weights: the residual over the markers present, NaN where there is none."""
        error = (weights @ self.matrix.T - rows).reshape(len(rows), self.n_markers, 3)
        squared = np.einsum("fpd,fpd->fp", error, error)
        count = present.sum(axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            residual = np.sqrt((squared * present).sum(axis=1) / count)
        return Solution(np.where(count[:, None] > 0, weights, np.nan), residual)


def presence_patterns(present: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Frames grouped by which markers they have, from an (F, P) bool array.

    Each (P,) pattern of present markers with the (k,) frames that show it; frames without any marker are left out.
    """
    if present.all():
        return [(np.ones(present.shape[1], dtype=bool), np.arange(len(present)))]
    packed = np.packbits(present, axis=1)
    _, first, inverse = np.unique(packed, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(inverse.ravel(), kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(inverse.ravel()))[:-1])
    return [(present[start], frames) for start, frames in zip(first, groups) if present[start].any()]
