"""Nearest points of a fixed set: by comparison with all points first, by a k-d tree if a large set is used often."""

from __future__ import annotations

import sys
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from eidrive_scenario.base.arrays import Array, Integers

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

FEW = 2048
"""Maximum size of a set without a tree."""
_BEFORE_IMPORT = 50_000_000
"""Maximum number of distances from the points of a large set before the package with the tree is imported.

The import takes 0.2 to 0.3 s, longer than these distances and than all searches of a short run.
"""
_BEFORE_TREE = 32
"""Maximum number of positions that are compared with a large set before its tree is built, once it is imported."""
_MORE = 16
"""Number of further points that are searched in a tree where more points than requested are at the same distance."""
_ROUNDED = 1e-12
"""Relative difference of squared distances [m²] that the tree may round to the same one."""
_BLOCK_SIZE = 1 << 18
"""Maximum number of distances that are computed at once."""


class NearestPoints:
    """Search for the nearest points of a set (N, D).

    Of points at the same distance, the one with the lowest index comes first.
    """

    def __init__(self, points: Array) -> None:
        self.points = points
        self._columns = np.ascontiguousarray(points.T)
        self._searches = 0

    def nearest(self, to: Array, within: float = np.inf) -> tuple[Array, Integers]:
        """Return distance [m] and index (M,) of the nearest point of points (M, D); inf and N if none is `within`.

        None is near a position that is not finite.
        """
        if not len(self.points):
            return np.full(len(to), np.inf), np.zeros(len(to), dtype=np.int64)
        if self._pays_tree(len(to)):
            distance, index = self._by_tree(to, 1, within)
            return distance[:, 0], index[:, 0]
        distance, index = np.empty(len(to)), np.empty(len(to), dtype=np.int64)
        for block in self._blocks(len(to)):
            squares = _squares(to[block], self._columns)
            index[block] = squares.argmin(axis=1)
            distance[block] = np.sqrt(squares[np.arange(len(squares)), index[block]])
        far = ~(distance < within)
        distance[far], index[far] = np.inf, len(self.points)
        return distance, index

    def several(self, to: Array, count: int) -> tuple[Array, Integers]:
        """Return distances [m] and indices (M, count) of the nearest points of points (M, D), in ascending order."""
        return self._by_tree(to, count, np.inf) if self._pays_tree(len(to)) else self._by_comparison(to, count)

    def _pays_tree(self, searches: int) -> bool:
        """Whether a tree is faster for further positions, with its construction and the import of its package."""
        size = len(self.points)
        self._searches += searches
        if size <= FEW or self._searches <= _BEFORE_TREE:
            return False
        return "scipy.spatial" in sys.modules or self._searches * size > _BEFORE_IMPORT

    def _by_comparison(self, to: Array, count: int) -> tuple[Array, Integers]:
        distance, index = np.empty((len(to), count)), np.empty((len(to), count), dtype=np.int64)
        for block in self._blocks(len(to)):
            squares = _squares(to[block], self._columns)
            some = np.argpartition(squares, count - 1, axis=1)[:, :count]
            last = np.take_along_axis(squares, some, axis=1).max(axis=1)
            for row in np.flatnonzero((squares <= last[:, None]).sum(axis=1) > count):
                some[row] = squares[row].argsort(kind="stable")[:count]
            distance[block], index[block] = _in_order(some, np.take_along_axis(squares, some, axis=1))
        return distance, index

    def _by_tree(self, to: Array, count: int, within: float) -> tuple[Array, Integers]:
        try:
            nearest = self._tree.query(to, count + 1, distance_upper_bound=within)
        except ValueError:  # Some positions are not finite
            finite = np.isfinite(to).all(axis=1, keepdims=True)
            nearest = self._tree.query(np.where(finite, to, 0.0), count + 1, distance_upper_bound=within)
            nearest = np.where(finite, nearest[0], np.inf), np.where(finite, nearest[1], len(self.points))
        distance, index = (np.asarray(part) for part in nearest)
        squares = distance * distance
        near, next_ = squares[:, :-1], squares[:, 1:]
        tied = (next_ * (1.0 - _ROUNDED) <= near) & (near < np.inf)
        distance, index = distance[:, :count], index[:, :count]
        if tied.any():
            rows = np.flatnonzero(tied.any(axis=1))
            distance[rows], index[rows] = self._of_tied(to[rows], count)
        return distance, index

    def _of_tied(self, to: Array, count: int) -> tuple[Array, Integers]:
        """Return the nearest points of positions to which several points have the same distance."""
        some = np.asarray(self._tree.query(to, count + _MORE)[1])
        squares = np.zeros(some.shape)
        for number, column in enumerate(self._columns):
            squares += (to[:, number, None] - column[some]) ** 2
        distance, index = _in_order(some, squares)
        more = np.flatnonzero(distance[:, -1] <= distance[:, count - 1] * (1.0 + _ROUNDED))
        distance, index = distance[:, :count], index[:, :count]
        if more.size:
            distance[more], index[more] = self._by_comparison(to[more], count)
        return distance, index

    @cached_property
    def _tree(self) -> cKDTree:
        from scipy.spatial import cKDTree

        return cKDTree(self.points)

    def _blocks(self, count: int) -> list[slice]:
        step = max(_BLOCK_SIZE // len(self.points), 1)
        return [slice(start, start + step) for start in range(0, count, step)]


def _in_order(index: Integers, squares: Array) -> tuple[Array, Integers]:
    """Return distances and indices (M, N), sorted by distance and then by index."""
    order = np.lexsort((index, squares))
    return np.sqrt(np.take_along_axis(squares, order, axis=1)), np.take_along_axis(index, order, axis=1)


def _squares(to: Array, columns: Array) -> Array:
    """Return the squared distances (M, N) of points (M, D) from points with the coordinates `columns` (D, N)."""
    squares: Array = to[:, 0, None] - columns[0]
    squares *= squares
    for number, column in enumerate(columns[1:], start=1):
        offset = to[:, number, None] - column
        offset *= offset
        squares += offset
    return squares
