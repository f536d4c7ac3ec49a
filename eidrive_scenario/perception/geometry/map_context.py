"""Map context of a detector: positions, directions and heights of roads."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.base.geometry import footprint, wrap_angle
from eidrive_scenario.roads import LaneLocations, RoadNetwork
from eidrive_scenario.world.road_objects import solid_boxes

CELL = 0.5
"""Cell size of the mask of areas near roads [m]; larger for maps that would have more than MOST_CELLS."""
MOST_CELLS = 16_000_000
"""Maximum number of cells of the mask, one byte each."""
BEYOND = 20.0
"""Margin of the mask around the center lines of the lanes [m]."""
UNKNOWN, OFF, ON = -1, 0, 1
ON_BODY = 0.3
"""Maximum distance of points from the body of the map that they are on [m]: three times the noise of a lidar, and a
usual error of the pose."""
LOWEST = 0.25
"""Height from which bodies of the map are considered [m]; lower ones are ground for a lidar."""
LANE_DEVIATION = math.radians(25.0)
"""Standard deviation between the headings of vehicles and of their lanes [rad].

A design choice: a heading across the lane, as while turning, deviates by 3.6 standard deviations, so it is possible if
the points or the image show it clearly.
"""


class MapContext:
    """Roads around a station, queried for many points at once. Without a map, all answers are neutral.

    margin   maximum distance to a road at which a point counts as near it [m]
    """

    def __init__(self, roads: RoadNetwork | None, *, margin: float = 0.5) -> None:
        self.margin = margin
        self._roads = roads
        self._mask: NDArray[np.int8] | None = None
        self._level = roads is None or roads.is_level
        if roads is not None:
            x0, y0, x1, y1 = roads.bounds()
            width, height = x1 - x0 + 2.0 * BEYOND, y1 - y0 + 2.0 * BEYOND
            self._cell = max(CELL, math.sqrt(width * height / MOST_CELLS), max(width, height) / MOST_CELLS)
            self._corner = np.array([x0 - BEYOND, y0 - BEYOND])
            shape = (math.ceil(height / self._cell), math.ceil(width / self._cell))
            self._mask = np.full(shape, UNKNOWN, dtype=np.int8)

    @property
    def has_map(self) -> bool:
        """Whether there is a map."""
        return self._roads is not None

    def near_road(self, plan: Array) -> Bools:
        """Return whether points (N, 2) are within `margin` of a road, to within a cell; True without a map."""
        if self._mask is None or self._roads is None or not len(plan):
            return np.ones(len(plan), dtype=bool)
        column, row = (np.floor((plan - self._corner) / self._cell).astype(np.int64)).T
        inside = (column >= 0) & (row >= 0) & (column < self._mask.shape[1]) & (row < self._mask.shape[0])
        near = np.zeros(len(plan), dtype=bool)
        cells = np.where(inside, row * self._mask.shape[1] + column, 0)
        mask = self._mask.reshape(-1)
        new = np.unique(cells[inside & (mask[cells] == UNKNOWN)])
        if new.size:
            x = self._corner[0] + (new % self._mask.shape[1] + 0.5) * self._cell
            y = self._corner[1] + (new // self._mask.shape[1] + 0.5) * self._cell
            located = self._roads.locate(x, y)
            mask[new] = np.where((located.road >= 0) & (located.outside <= self.margin), ON, OFF)
        near[inside] = mask[cells[inside]] == ON
        return near

    def is_of_traffic(self, plan: Array) -> Bools:
        """Return whether points (N, 2) are near a road, and on no body of the map beside its lanes, as a wall is."""
        of_traffic = self.near_road(plan)
        rows, bodies = np.flatnonzero(of_traffic), self._bodies_beside_lanes
        if not len(rows) or not len(bodies):
            return of_traffic
        points = plan[rows]
        reach = np.hypot(bodies[:, 3], bodies[:, 4])[:, None] / 2.0 + ON_BODY
        around = (bodies[:, :2] > points.min(axis=0) - reach) & (bodies[:, :2] < points.max(axis=0) + reach)
        x, y, _, length, width, _, yaw = bodies[around.all(axis=1)].T[:, :, None]
        cos, sin, dx, dy = np.cos(yaw), np.sin(yaw), points[:, 0] - x, points[:, 1] - y
        on_body = (np.abs(cos * dx + sin * dy) <= length / 2.0 + ON_BODY) & (
            np.abs(cos * dy - sin * dx) <= width / 2.0 + ON_BODY
        )
        of_traffic[rows] = ~on_body.any(axis=0)
        return of_traffic

    @cached_property
    def _bodies_beside_lanes(self) -> Array:
        """Boxes (N, 7) of the map that reach into the area near roads. On lanes they are obstacles."""
        if self._roads is None:
            return np.empty((0, 7))
        boxes = solid_boxes(self._roads, LOWEST)
        corners = footprint(boxes)
        near = self.near_road(corners.reshape(-1, 2)).reshape(corners.shape[:2]).any(axis=1)
        return boxes[near & ~self.on_lane(boxes[:, :2])]

    def lane_heading(self, plan: Array, near: Array) -> Array:
        """Return the driving direction (N,) at points (N, 2) [rad]; NaN off the roads, in junctions, and on lanes for
        both directions.

        near  heights (N,) next to which the roads are, if several are above each other [m]
        """
        headings = np.full(len(plan), np.nan)
        if self._roads is None or not len(plan):
            return headings
        located = self._locate(self._roads, plan, near)
        for point in np.flatnonzero((located.road >= 0) & (located.outside <= 0.0) & (located.lane != 0)).tolist():
            road, lane = located.roads[int(located.road[point])], int(located.lane[point])
            mapped = self._roads.roads[road].section_at(float(located.s[point])).lanes.get(lane)
            has_both = mapped is not None and mapped.is_two_way
            if has_both or self._roads.roads[road].junction_id is not None:
                continue
            against = self._roads.driving_direction(road, lane) < 0
            headings[point] = float(located.heading[point]) + (np.pi if against else 0.0)
        return headings

    def on_lane(self, plan: Array) -> Bools:
        """Return whether points (N, 2) are on a lane for vehicles; False without a map."""
        on = np.zeros(len(plan), dtype=bool)
        if self._roads is not None and len(plan):
            lanes, _, points = self._roads.overlapped_lanes(plan[:, 0], plan[:, 1])
            on[points[self._roads.tables.lane_drivable[lanes]]] = True
        return on

    def facing(self, boxes: Array) -> Array:
        """Return headings (N,) of boxes (N, 7) [rad], reversed if their lane clearly has the opposite direction."""
        lane = self.lane_heading(boxes[:, :2], boxes[:, 2] - boxes[:, 5] / 2.0)
        against = np.cos(boxes[:, 6] - np.nan_to_num(lane)) < -math.cos(math.pi / 4)
        return np.where(np.isfinite(lane) & against, wrap_angle(boxes[:, 6] + math.pi), boxes[:, 6])

    def ground(self, plan: Array, otherwise: float, near: Array | None = None) -> Array:
        """Return the height (N,) of the road below points (N, 2) [m]; `otherwise` off the roads and without a map.

        near  heights (N,) next to which the roads are, if several are above each other [m]; None: `otherwise`
        """
        height = np.full(len(plan), otherwise)
        if self._roads is None or self._level or not len(plan):
            return height
        located = self._locate(self._roads, plan, height if near is None else near)
        for point in np.flatnonzero((located.road >= 0) & (located.outside <= 5.0)).tolist():
            road = located.roads[int(located.road[point])]
            height[point] = self._roads.road_pose_at(road, float(located.s[point]), float(located.t[point])).z
        return height

    def _locate(self, roads: RoadNetwork, plan: Array, near: Array) -> LaneLocations:
        """Return locations of points (N, 2), on the road next to the heights (N,) where several are above each other.

        Beside the roads heights would select a road farther away: that of a slope, for points that are assumed level.
        """
        located = roads.locate(plan[:, 0], plan[:, 1], None if self._level else near)
        beside = np.flatnonzero(located.outside > 0.0)
        if beside.size and not self._level:
            located.insert(roads.locate(plan[beside, 0], plan[beside, 1]), beside)
        return located
