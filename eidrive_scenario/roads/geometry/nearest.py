"""Nearest points of a fixed set: by comparison with all of a small set, by a k-d tree of a large one."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from eidrive_scenario.arrays import Array, Integers

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

FEW = 2048
"""Maximum size of a set without a tree. The import of the tree takes longer than all searches of a short run."""
_BLOCK_SIZE = 1 << 18
"""Maximum number of distances that are computed at once."""
_PER_PIVOT = 8
"""Number of consecutive points that one pivot represents."""
_GROUP_SIZE = 32
"""Maximum number of positions that share the candidates for their nearest points."""
_MANY = 1 << 13
"""Minimum number of distances for which the pivots select candidates first."""
_ROUNDING = 1e-6
"""Margin for rounding errors of distances to pivots [m]."""


class NearestPoints:
    """Search for the nearest points of a set (N, D).

    Of points at the same distance, a small set gives the one with the lowest index first.
    """

    def __init__(self, points: Array) -> None:
        self.points = points
        self._columns = np.ascontiguousarray(points.T)

    def nearest(self, to: Array, within: float = np.inf) -> tuple[Array, Integers]:
        """Return distance [m] and index (M,) of the nearest point of points (M, D); inf and N if none is `within`."""
        if len(self.points) > FEW:
            distance, index = self._tree.query(to, k=1, distance_upper_bound=within)
            return np.asarray(distance), np.asarray(index)
        distance, index = np.empty(len(to)), np.empty(len(to), dtype=np.int64)
        for start in range(0, len(to), _GROUP_SIZE):
            group = to[start : start + _GROUP_SIZE]
            if len(group) * len(self.points) < _MANY:
                squares = _squares(group, self._columns)
                nearest = chosen = squares.argmin(axis=1)
            else:
                candidates = self._candidates(group)
                squares = _squares(group, self._columns.take(candidates, axis=1))
                chosen = squares.argmin(axis=1)
                nearest = candidates[chosen]
            index[start : start + _GROUP_SIZE] = nearest
            distance[start : start + _GROUP_SIZE] = np.sqrt(squares[np.arange(len(group)), chosen])
        far = distance >= within
        distance[far], index[far] = np.inf, len(self.points)
        return distance, index

    def several(self, to: Array, count: int) -> tuple[Array, Integers]:
        """Return distances [m] and indices (M, count) of the nearest points of points (M, D), in ascending order."""
        if len(self.points) > FEW:
            distance, index = (np.asarray(part) for part in self._tree.query(to, k=count))
            return distance.reshape(len(to), count), index.reshape(len(to), count)
        distance, index = np.empty((len(to), count)), np.empty((len(to), count), dtype=np.int64)
        for block in self._blocks(len(to)):
            squares = _squares(to[block], self._columns)
            # Sorted by index first, so that the stable sort resolves ties by index
            some = np.sort(np.argpartition(squares, count - 1, axis=1)[:, :count], axis=1)
            near = np.take_along_axis(squares, some, axis=1)
            order = near.argsort(axis=1, kind="stable")
            index[block] = np.take_along_axis(some, order, axis=1)
            distance[block] = np.sqrt(np.take_along_axis(near, order, axis=1))
        return distance, index

    @cached_property
    def _tree(self) -> cKDTree:
        from scipy.spatial import cKDTree

        return cKDTree(self.points)

    def _blocks(self, count: int) -> list[slice]:
        step = max(_BLOCK_SIZE // len(self.points), 1)
        return [slice(start, start + step) for start in range(0, count, step)]

    @cached_property
    def _pivots(self) -> tuple[Array, Array]:
        """Columns (D, P) of the pivots, and the maximum distances (P,) from them to the points they represent [m]."""
        starts = np.arange(0, len(self.points), _PER_PIVOT)
        pivots = np.minimum(starts + _PER_PIVOT // 2, len(self.points) - 1)
        offsets = self._columns - self._columns[:, pivots.repeat(_PER_PIVOT)[: len(self.points)]]
        return self._columns[:, pivots], np.maximum.reduceat(np.sqrt((offsets * offsets).sum(axis=0)), starts)

    def _candidates(self, to: Array) -> Integers:
        """Return the indices, in ascending order, of points that can be the nearest one of any of points (M, D)."""
        pivots, radius = self._pivots
        gap = np.sqrt(_squares(to, pivots))
        # The nearest point is not farther than the nearest pivot.
        limit = gap.min(axis=1) * (1.0 + 1e-9) + _ROUNDING
        excluded = (gap - radius > limit[:, None]).all(axis=0)
        found: Integers = (~excluded).repeat(_PER_PIVOT)[: len(self.points)].nonzero()[0]
        return found


def _squares(to: Array, columns: Array) -> Array:
    """Return the squared distances (M, N) of points (M, D) from points with the coordinates `columns` (D, N)."""
    found: Array = to[:, 0, None] - columns[0]
    found *= found
    for number, column in enumerate(columns[1:], start=1):
        offset = to[:, number, None] - column
        offset *= offset
        found += offset
    return found
