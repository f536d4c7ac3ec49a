"""Right of way in junctions: first come, first served, one car at a time on conflicting lanes.

The first car of a queue requests all lanes of its passage through the junction within its braking distance, if there is
space behind the junction. They are granted when no car holds a lane that crosses, merges or diverges. A car holds a
lane until it has left it, and against diverging lanes until it has cleared the fork.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.roads.geometry.nearest import NearestPoints
from eidrive_scenario.traffic.lanes import TrafficLanes

CLEARANCE = 3.2
"""Minimum distance of the center lines of lanes without a conflict [m].

It is less than that of adjacent lanes, and more than two cars need whose ends swing out in bends.
"""
TIGHT = 6.0
"""Radius of bends below which long ends need more than `CLEARANCE` [m]."""
FRONT, HALF_WIDTH = 4.7, 1.0
"""Distance of the front of a van from its rear axle, which follows the lane, and half its width [m]."""
FORK = 9.0
"""Distance from the start at which diverging lanes are separate [m]."""
SAMPLE = 0.75


class Crossings:
    """Conflicting lanes of junctions and the cars that hold them."""

    def __init__(self, lanes: TrafficLanes) -> None:
        self._lanes = lanes
        self._meeting: dict[int, dict[int, bool]] = {}
        self._by_junction: dict[str, list[int]] = {}
        for row, key in enumerate(lanes.keys):
            junction = lanes.roads.roads[key.road].junction_id
            if junction is not None and lanes.tables.lane_drivable[row]:
                self._by_junction.setdefault(junction, []).append(row)
        self.holders: dict[int, dict[str, float]] = {}
        """Cars that hold each lane of a junction, with the progress of their rear on it [m]."""

    def junction_lanes(self, row: int) -> list[int]:
        """Return all lanes of the junction that contains a lane."""
        junction = self._lanes.roads.roads[self._lanes.keys[row].road].junction_id
        return [] if junction is None else self._by_junction.get(junction, [])

    def meeting(self, row: int) -> dict[int, bool]:
        """Return the lanes in conflict with a lane of a junction. The value is True if they only diverge."""
        known = self._meeting.get(row)
        if known is not None:
            return known
        lines, low, high = self._lines
        found: dict[int, bool] = {}
        mine = lines[row]
        points = NearestPoints(mine)
        for other in self.junction_lanes(row):
            reach = CLEARANCE + max(self._swings[row], self._swings[other])
            near_by = np.all(low[other] <= high[row] + reach) and np.all(low[row] <= high[other] + reach)
            if self._lanes.road[other] == self._lanes.road[row] or not near_by:
                continue
            line = lines[other]
            together = np.hypot(*(line[0] - mine[0])) < 1.0
            near = np.flatnonzero(points.nearest(line)[0] < (CLEARANCE if together else reach))
            if near.size:
                found[other] = bool(together and near.max() * SAMPLE < 2.0 * FORK)
        self._meeting[row] = found
        return found

    @cached_property
    def _swings(self) -> Array:
        """Width (N,) by which the front of a van swings out farther in the bends of lanes than `CLEARANCE` permits."""
        rows = np.arange(len(self._lanes.keys))
        radius = 1.0 / np.maximum(self._lanes.tightest(rows), 1e-6)
        return np.maximum(_swing(radius) - _swing(np.array(TIGHT)), 0.0)

    @cached_property
    def _lines(self) -> tuple[dict[int, Array], Array, Array]:
        """Center lines (K, 2) of all lanes in junctions, and the corners of their bounding boxes."""
        lanes = self._lanes
        inside = np.array([row for group in self._by_junction.values() for row in group], dtype=np.int64)
        counts = np.maximum((lanes.length[inside] / SAMPLE).astype(np.int64), 1) + 1
        rows = np.repeat(inside, counts)
        step = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts)
        progress = lanes.length[rows] * step / np.repeat(counts - 1, counts)
        poses = lanes.tables.lane_poses(rows, lanes.s(rows, progress), np.zeros(len(rows)))
        points = np.column_stack([poses.x, poses.y])
        low, high = np.full((len(lanes.keys), 2), np.inf), np.full((len(lanes.keys), 2), -np.inf)
        np.minimum.at(low, rows, points)
        np.maximum.at(high, rows, points)
        pieces = np.split(points, np.cumsum(counts)[:-1])
        return dict(zip(inside.tolist(), pieces, strict=True)), low, high

    def free(self, row: int, name: str, blocked: set[int]) -> bool:
        """Return True if `name` may hold a lane: no car holds and nothing blocks a lane in conflict with it."""
        for other, only_fork in self.meeting(row).items():
            if other in blocked:
                return False
            for holder, rear in self.holders.get(other, {}).items():
                if holder != name and not (only_fork and rear > FORK):
                    return False
        return True

    def take(self, row: int, name: str) -> None:
        """Let `name` hold a lane."""
        self.holders.setdefault(row, {})[name] = -np.inf

    def holds(self, name: str, row: int) -> bool:
        """Return whether `name` holds a lane."""
        return name in self.holders.get(row, ())

    def release(self, name: str, row: int) -> None:
        """Release a lane that `name` has left."""
        self.holders.get(row, {}).pop(name, None)

    def forget(self, name: str) -> None:
        """Release all lanes that `name` holds."""
        for held in self.holders.values():
            held.pop(name, None)


def _swing(radius: Array) -> Array:
    """Return the width by which the outer front corner of a van is outside of the path of its rear end [m]."""
    outer = radius + HALF_WIDTH
    return np.asarray(np.hypot(outer, FRONT) - outer)
