"""Where the roads of a junction lie over each other: which others may lie beneath a point of one of them."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.arrays import Array, Integers
from eidrive_scenario.roads.geometry.tables import RoadTables


class Overlaps:
    """For points on connecting roads, the other roads of the junction that are near, and where on them.

    points, road, s  (S,) samples along the lanes of all roads, the samples of a road next to each other
    reach            no lane of a road lies further from its nearest sample than this [m]
    """

    def __init__(self, tables: RoadTables, points: Array, road: Integers, s: Array, reach: float) -> None:
        self._points, self._s, self._reach = points, s, reach
        count = len(tables.roads)
        self._first, self._last = np.searchsorted(road, [np.arange(count), np.arange(1, count + 1)])
        groups: dict[str, list[int]] = {}
        for index, one in enumerate(tables.roads):
            if one.junction_id is not None and self._last[index] > self._first[index]:
                groups.setdefault(one.junction_id, []).append(index)
        others: list[list[int]] = [[] for _ in range(count)]
        for group in groups.values():
            for index in group:
                others[index] = [other for other in group if other != index]
        self._counts = np.array([len(entry) for entry in others], dtype=np.int64)
        self._starts = np.cumsum(self._counts) - self._counts
        self._others = np.array([other for entry in others for other in entry], dtype=np.int64)
        self._low, self._high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
        np.minimum.at(self._low, road, points)
        np.maximum.at(self._high, road, points)

    def beneath(self, road: Integers, x: Array, y: Array) -> tuple[Integers, Integers, Array]:
        """For points (N,) on roads, pairs of a point's number and another road near it, and s of its nearest sample."""
        counts = self._counts[road]
        point = np.repeat(np.arange(len(road)), counts)
        if not point.size:
            return point, point, np.empty(0)
        step = np.arange(len(point)) - np.repeat(np.cumsum(counts) - counts, counts)
        other = self._others[np.repeat(self._starts[road], counts) + step]
        px, py = x[point], y[point]
        low, high, reach = self._low[other], self._high[other], self._reach
        near = (px >= low[:, 0] - reach) & (px <= high[:, 0] + reach)
        near &= (py >= low[:, 1] - reach) & (py <= high[:, 1] + reach)
        point, other, px, py = point[near], other[near], px[near], py[near]
        if not point.size:
            return point, other, np.empty(0)
        first, sizes = self._first[other], self._last[other] - self._first[other]
        owner = np.repeat(np.arange(len(point)), sizes)
        begins = np.cumsum(sizes) - sizes
        sample = np.arange(len(owner)) - np.repeat(begins, sizes) + np.repeat(first, sizes)
        gap = (self._points[sample, 0] - px[owner]) ** 2 + (self._points[sample, 1] - py[owner]) ** 2
        least = np.minimum.reduceat(gap, begins)
        # The first of equally near samples, as argmin has it.
        at = np.flatnonzero(gap == least[owner])
        at = at[np.unique(owner[at], return_index=True)[1]]
        close = least <= reach * reach
        return point[close], other[close], self._s[sample[at[close]]]
