"""The algebra of random intercepts: sums over the answers of a level, and the system of equations of all levels.

- `Levels`: which level of which grouping each answer belongs to.
- `Hessian`: ΛZ'WZΛ + I, its determinant, its solutions, and the parts of its inverse that a gradient needs.

Z, the table of answers by levels, is never written out. The finest grouping (participants × methods) and the grouping
it is nested in (participants) make one small block per participant; what crosses them (stimuli) is a border. Blocks are
inverted one by one and the border by its Schur complement, so that time grows with the participants and not with their
cube.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class Levels:
    """The levels of all groupings, in slots: block by block, then the border.

    Parameters
    ----------
    n : int
        Answers.
    groupings : sequence of array_like (n,)
        Labels of each grouping.

    Attributes
    ----------
    size : int
        Slots; a block shorter than the longest has slots that no answer uses.
    groups : int
        Groupings.
    columns : ndarray (n, groups)
        The slot of each answer's level.
    """

    def __init__(self, n: int, groupings: Sequence[ArrayLike]) -> None:
        codes = [np.unique(np.asarray(labels).astype(str), return_inverse=True)[1] for labels in groupings]
        sizes = [int(code.max()) + 1 for code in codes]
        self.groups = len(codes)
        fine = int(np.argmax(sizes)) if codes else -1
        outer = [
            place
            for place, code in enumerate(codes)
            if place != fine and len(np.unique(codes[fine] * sizes[place] + code)) == sizes[fine]
        ]
        around = max(outer, key=lambda place: sizes[place], default=-1)
        self.core = [place for place in (around, fine) if place >= 0]
        self.border = [place for place in range(self.groups) if place not in self.core]
        # the block of an answer, and where its core levels stand in it
        block = codes[self.core[0]] if self.core else np.zeros(n, int)
        self.blocks = int(block.max()) + 1 if self.core else 0
        inside = [np.zeros(n, int)] if self.core else []
        if len(self.core) == 2:
            inside.append(1 + _rank_within(block, codes[fine]))
        self.width = 1 + max((int(place.max()) for place in inside), default=-1)
        self.columns = np.zeros((n, self.groups), int)
        for place, position in zip(self.core, inside):
            self.columns[:, place] = block * self.width + position
        start = self.blocks * self.width
        self.border_start = start
        for place in self.border:
            self.columns[:, place] = start + codes[place]
            start += sizes[place]
        self.size = start
        self._owner = np.full(self.size, -1)
        for place in range(self.groups):
            self._owner[self.columns[:, place]] = place

    def of_groups(self, values: Array) -> Array:
        """One value per grouping as one per slot; 0 in slots that no answer uses."""
        return np.append(values, 0.0)[self._owner] if self.size else np.zeros(0)

    def spread(self, effects: Array) -> Array:
        """Z times the effects: what the levels add to each answer, (n,)."""
        return effects[self.columns].sum(axis=1)

    def gather(self, values: Array) -> Array:
        """Z' times values of the answers: their sum by level, (size,)."""
        total = np.zeros(self.size)
        for column in self.columns.T:
            total += np.bincount(column, values, self.size)
        return total

    def hessian(self, weights: Array, scale: Array) -> Hessian:
        """ΛZ'WZΛ + I for the weights W of the answers and the spreads Λ of the slots."""
        return Hessian(self, weights, scale)


def _rank_within(block: NDArray[np.intp], code: NDArray[np.intp]) -> NDArray[np.intp]:
    """The place of each code among the codes of its block, from 0."""
    pairs = np.unique(np.column_stack([block, code]), axis=0)
    first = np.searchsorted(pairs[:, 0], pairs[:, 0])
    place = np.zeros(int(code.max()) + 1, int)
    place[pairs[:, 1]] = np.arange(len(pairs)) - first
    return place[code]


class Hessian:
    """The system of all levels; made by `Levels.hessian`.

    Attributes
    ----------
    log_determinant : float
    """

    def __init__(self, levels: Levels, weights: Array, scale: Array) -> None:
        self._levels, self._scale = levels, scale
        blocks, width, start = levels.blocks, levels.width, levels.border_start
        edge = levels.size - start
        inner = np.zeros(blocks * width * width)
        across = np.zeros(blocks * width * edge)
        outside = np.zeros(edge * edge)
        for first in levels.core:
            slot = levels.columns[:, first]
            for second in levels.core:
                inner += np.bincount(slot * width + levels.columns[:, second] % width, weights, len(inner))
            for second in levels.border:
                across += np.bincount(slot * edge + levels.columns[:, second] - start, weights, len(across))
        for first in levels.border:
            slot = levels.columns[:, first] - start
            for second in levels.border:
                outside += np.bincount(slot * edge + levels.columns[:, second] - start, weights, len(outside))
        self._inner = inner.reshape(blocks, width, width)
        self._across = across.reshape(blocks, width, edge)
        self._outside = outside.reshape(edge, edge)
        self._core_scale, self._edge_scale = scale[:start].reshape(blocks, width), scale[start:]
        a = self._core_scale[:, :, None] * self._inner * self._core_scale[:, None, :] + np.eye(width)
        self._b = self._core_scale[:, :, None] * self._across * self._edge_scale
        d = self._edge_scale[:, None] * self._outside * self._edge_scale + np.eye(edge)
        self._a_inverse = np.linalg.inv(a)
        self._e = self._a_inverse @ self._b
        schur = d - np.einsum("cki,ckj->ij", self._b, self._e)
        self._s_inverse = np.linalg.inv(schur)
        self.log_determinant = float(np.linalg.slogdet(a)[1].sum() + np.linalg.slogdet(schur)[1])

    def solve(self, right: Array) -> Array:
        """H⁻¹ times a vector, (size,)."""
        levels = self._levels
        core = right[: levels.border_start].reshape(levels.blocks, levels.width)
        first = (self._a_inverse @ core[:, :, None])[:, :, 0]
        edge = self._s_inverse @ (right[levels.border_start :] - np.einsum("cki,ck->i", self._b, first))
        return np.concatenate([(first - self._e @ edge).ravel(), edge])

    def _inverse(self) -> tuple[Array, Array, Array]:
        """The inverse between levels of one block, of a block and the border, and of the border."""
        cross = -self._e @ self._s_inverse
        return self._a_inverse - cross @ self._e.transpose(0, 2, 1), cross, self._s_inverse

    def leverage(self) -> Array:
        """z'H⁻¹z of each answer, z its row of ZΛ, (n,)."""
        levels = self._levels
        core, cross, edge = self._inverse()
        total = np.zeros(len(levels.columns))
        scaled = self._scale[levels.columns]
        for first in levels.core:
            slot = levels.columns[:, first]
            row, place = np.divmod(slot, levels.width)
            for second in levels.core:
                other = levels.columns[:, second] % levels.width
                total += core[row, place, other] * scaled[:, first] * scaled[:, second]
            for second in levels.border:
                other = levels.columns[:, second] - levels.border_start
                total += 2 * cross[row, place, other] * scaled[:, first] * scaled[:, second]
        for first in levels.border:
            for second in levels.border:
                one, two = (
                    levels.columns[:, first] - levels.border_start,
                    levels.columns[:, second] - levels.border_start,
                )
                total += edge[one, two] * scaled[:, first] * scaled[:, second]
        return total

    def trace(self) -> Array:
        """The diagonal of H⁻¹ΛZ'WZ, (size,): what ½log|H| gains by each slot's spread."""
        core, cross, edge = self._inverse()
        inner = np.einsum("ckj,cj,cjk->ck", core, self._core_scale, self._inner)
        inner += np.einsum("cki,i,cki->ck", cross, self._edge_scale, self._across)
        outer = np.einsum("cji,cj,cji->i", cross, self._core_scale, self._across)
        outer += np.einsum("ij,j,ji->i", edge, self._edge_scale, self._outside)
        return np.concatenate([inner.ravel(), outer])
