"""Overlapping roads of junctions: candidates for roads below a point."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.arrays import Array, Integers
from eidrive_scenario.roads.geometry.tables import RoadTables


class Overlaps:
    """Nearby roads of the same junction for points on connecting roads.

    points, road  (S, 2) and (S,) samples along the lanes of all roads; samples of a road are contiguous
    reach         maximum distance of a lane of a road from its nearest sample [m]
    """

    def __init__(self, tables: RoadTables, points: Array, road: Integers, reach: float) -> None:
        self._points, self._reach = points, reach
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

    def beneath(self, road: Integers, x: Array, y: Array) -> tuple[Integers, Integers]:
        """Return pairs for points (N,): point index and nearest sample of a nearby other road."""
        counts = self._counts[road]
        point = np.arange(len(road)).repeat(counts)
        if not point.size:
            return point, point
        step = np.arange(len(point)) - (counts.cumsum() - counts).repeat(counts)
        other = self._others[self._starts[road].repeat(counts) + step]
        px, py = x[point], y[point]
        low, high, reach = self._low[other], self._high[other], self._reach
        near = (px >= low[:, 0] - reach) & (px <= high[:, 0] + reach)
        near &= (py >= low[:, 1] - reach) & (py <= high[:, 1] + reach)
        point, other, px, py = point[near], other[near], px[near], py[near]
        if not point.size:
            return point, other
        first, sizes = self._first[other], self._last[other] - self._first[other]
        owner = np.arange(len(point)).repeat(sizes)
        begins = sizes.cumsum() - sizes
        sample = np.arange(len(owner)) + (first - begins).repeat(sizes)
        gap = (self._points[sample, 0] - px[owner]) ** 2 + (self._points[sample, 1] - py[owner]) ** 2
        least = np.minimum.reduceat(gap, begins)
        # Ties select the first sample, as argmin does.
        at = (gap == least[owner]).nonzero()[0]
        at = at[owner[at].searchsorted(np.arange(len(point)))]
        close = least <= reach * reach
        return point[close], sample[at[close]]
