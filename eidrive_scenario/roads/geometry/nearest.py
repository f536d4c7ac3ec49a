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


class NearestPoints:
    """Search for the nearest points of a set (N, D).

    Of points at the same distance, a small set gives the one with the lowest index first.
    """

    def __init__(self, points: Array) -> None:
        self.points = points
        self._columns = tuple(np.ascontiguousarray(column) for column in points.T)

    def nearest(self, to: Array, within: float = np.inf) -> tuple[Array, Integers]:
        """Return distance [m] and index (M,) of the nearest point of points (M, D); inf and N if none is `within`."""
        if len(self.points) > FEW:
            distance, index = self._tree.query(to, k=1, distance_upper_bound=within)
            return np.asarray(distance), np.asarray(index)
        distance, index = np.empty(len(to)), np.empty(len(to), dtype=np.int64)
        for block in self._blocks(len(to)):
            squares = self._squares(to[block])
            index[block] = squares.argmin(axis=1)
            distance[block] = np.sqrt(squares.min(axis=1))
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
            squares = self._squares(to[block])
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

    def _squares(self, to: Array) -> Array:
        """Return squared distances (M, N)."""
        found = np.zeros((len(to), len(self.points)))
        for number, column in enumerate(self._columns):
            offset = to[:, number, None] - column
            offset *= offset
            found += offset
        return found
