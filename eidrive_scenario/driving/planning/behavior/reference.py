"""Reference line of the route: coordinates along it and to its left, and the lanes beside it."""

from __future__ import annotations

import math
from bisect import bisect_right
from functools import cached_property
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.driving.planning.path import PlannedPath, path_heights
from eidrive_scenario.roads import LaneLocation, RoadNetwork
from eidrive_scenario.roads.geometry.poses import lane_t

NARROWEST = 2.5
"""Minimum width of a lane to which the vehicle changes [m]."""
WITHOUT_ROAD = 1.75
"""Distance from the route to the edge of the way outside of roads [m]: half a lane."""


class LanesBeside(NamedTuple):
    """Lanes at one point of the reference line; offsets to its left [m], NaN without such a lane.

    own                    center of the lane at the point
    left, right            centers of the neighboring lanes of the same direction
    oncoming               center of the nearest lane of the opposite direction
    left_edge, right_edge  edges of the lanes of the same direction
    far_edge               edge of all lanes on the side for overtaking
    overtaking             side for overtaking: 1 (left) with traffic on the right, -1 (right) with traffic on the left
    """

    own: float = 0.0
    left: float = math.nan
    right: float = math.nan
    oncoming: float = math.nan
    left_edge: float = WITHOUT_ROAD
    right_edge: float = -WITHOUT_ROAD
    far_edge: float = WITHOUT_ROAD
    overtaking: int = 1
    oncoming_limit: float = math.nan
    """Speed limit of the nearest lane of the opposite direction [m/s]; NaN if there is none."""

    @property
    def faster(self) -> float:
        """Center of the neighboring lane of the same direction on the side for overtaking [m]."""
        return self.left if self.overtaking > 0 else self.right

    def room(self, side: int) -> tuple[float, float]:
        """Return the distances from the line to the edge of the lanes of the same direction and of all lanes [m].

        side  1 for the left, -1 for the right; only on the side for overtaking lanes of the opposite direction count
        """
        same = side * (self.left_edge if side > 0 else self.right_edge)
        return same, side * self.far_edge if side == self.overtaking else same

    def mirrored(self) -> LanesBeside:
        """Return the lanes with left and right exchanged."""
        return LanesBeside(
            -self.own,
            -self.right,
            -self.left,
            -self.oncoming,
            -self.right_edge,
            -self.left_edge,
            -self.far_edge,
            -self.overtaking,
            self.oncoming_limit,
        )


class ReferenceLine:
    """Path of the route with distances along it (s) and to its left (d).

    z  height of its start [m]
    """

    def __init__(self, path: PlannedPath, roads: RoadNetwork | None, z: float = 0.0) -> None:
        self._z = z
        self.path = path
        self.points: Array = path.points
        step = np.diff(self.points, axis=0)
        length = np.maximum(np.hypot(step[:, 0], step[:, 1]), 1e-9)
        self.along: Array = np.concatenate([[0.0], np.cumsum(length)])
        self._places: list[float] = self.along.tolist()
        self.spacing = float(self.along[-1]) / len(length)
        middle = np.vstack([self.points[1] - self.points[0], self.points[2:] - self.points[:-2], step[-1]])
        self.tangent: Array = middle / np.maximum(np.hypot(middle[:, 0], middle[:, 1]), 1e-9)[:, None]
        self.normal: Array = np.column_stack([-self.tangent[:, 1], self.tangent[:, 0]])
        self.heading: Array = np.unwrap(np.arctan2(self.tangent[:, 1], self.tangent[:, 0]))
        self.curvature: Array = np.gradient(self.heading, self.along) if len(self.along) > 1 else np.zeros(1)
        self._columns: Array = np.stack([*self.points.T, *self.tangent.T, self.along, self.heading])
        self._roads = roads
        self._beside: dict[int, LanesBeside] = {}
        self._place: LaneLocation | None = None

    @property
    def length(self) -> float:
        """Length of the line [m]."""
        return float(self.along[-1])

    @cached_property
    def heights(self) -> Array | None:
        """Heights of the road at the points (M,) [m]; None if all roads are level."""
        return path_heights(self.path, self._roads, self._z)

    def index_at(self, s: float) -> int:
        """Return the index of the last point up to a distance along the line."""
        return max(bisect_right(self._places, s) - 1, 0)

    def project(self, x: Array, y: Array, low: int, high: int) -> tuple[Array, Array, Array]:
        """Return s, d and heading of the line (…) for points (…), nearest among the points from `low` to `high`."""
        line = self.points[low:high]
        flat_x, flat_y = x.ravel(), y.ravel()
        shifted = line - line[0]
        # Half of the square of the distance, without the part that is the same for all points of the line.
        half = 0.5 * np.einsum("mi,mi->m", shifted, shifted)
        places = np.column_stack([flat_x - line[0, 0], flat_y - line[0, 1], np.ones(len(flat_x))])
        gap = places @ np.vstack([-shifted.T, half])
        index = low + gap.argmin(axis=1)
        at_x, at_y, tx, ty, along, heading = self._columns.take(index, axis=1)
        dx, dy = flat_x - at_x, flat_y - at_y
        s = along + dx * tx + dy * ty
        d = dy * tx - dx * ty
        return s.reshape(x.shape), d.reshape(x.shape), heading.reshape(x.shape)

    def place(self, x: float, y: float, low: int, high: int) -> tuple[float, float]:
        """Return s and d of one point, nearest among the points from `low` to `high`."""
        gaps = [(x - px) ** 2 + (y - py) ** 2 for px, py in self.points[low:high].tolist()]
        index = low + gaps.index(min(gaps))
        (px, py), (tx, ty) = self.points[index].tolist(), self.tangent[index].tolist()
        dx, dy = x - px, y - py
        return self._places[index] + dx * tx + dy * ty, dy * tx - dx * ty

    def lanes_beside(self, index: int) -> LanesBeside:
        """Return the lanes at a point of the line."""
        lanes = self._beside.get(index)
        if lanes is None:
            lanes = self._beside[index] = self._lanes_at(index)
        return lanes

    def _lanes_at(self, index: int) -> LanesBeside:
        roads = self._roads
        if roads is None:
            return LanesBeside()
        x, y = self.points[index].tolist()
        place = self._place = roads.locate_at(x, y, self._place, reach=5.0)
        if place is None:
            return LanesBeside()
        road = roads.road(place.road)
        section = road.section_at(place.s)
        # The road may be passed against its driving direction; left is left of the motion.
        pose = roads.road_pose_at(place.road, place.s)
        tx, ty = self.tangent[index].tolist()
        sense = 1 if tx * math.cos(pose.h) + ty * math.sin(pose.h) >= 0.0 else -1
        order = [number for number in section.lanes if number]
        order = order if sense > 0 else order[::-1]
        if place.lane not in order:
            return LanesBeside()
        center, half = {}, {}
        for number in order:
            lane = section.lanes[number]
            center[number] = (lane_t(road, section, lane, place.s)[0] - place.t) * sense
            half[number] = lane.width.value(place.s - section.s) / 2.0
        own = order.index(place.lane)
        lanes = [
            (center[n], half[n], section.lanes[n].drivable, roads.driving_direction(road.id, n) == sense) for n in order
        ]
        if road.rule == "RHT":
            beside = _beside(lanes, own)
        else:
            lanes = [(-middle, width, drivable, same) for middle, width, drivable, same in reversed(lanes)]
            beside = _beside(lanes, len(lanes) - 1 - own).mirrored()
        if math.isnan(beside.oncoming):
            return beside
        opposite = min(order, key=lambda number: abs(center[number] - beside.oncoming))
        limit = roads.speed_limit(road.id, place.s, opposite)
        return beside if limit is None else beside._replace(oncoming_limit=limit)


def _beside(lanes: list[tuple[float, float, bool, bool]], own: int) -> LanesBeside:
    """Return the lanes beside one of the lanes of a section, from left to right, with traffic on the right.

    lanes  center to the left of the line and half width [m], whether it is drivable, and whether its traffic drives in
           the direction of the line
    """
    center, half, _, _ = lanes[own]
    left_edge = far_edge = center + half
    right_edge = center - half
    left = right = oncoming = math.nan
    same = True
    for place, width, drivable, with_traffic in reversed(lanes[:own]):
        if not drivable:
            break
        same = same and with_traffic
        far_edge = place + width
        if same:
            left_edge = far_edge
            left = place if math.isnan(left) and 2.0 * width >= NARROWEST else left
        elif math.isnan(oncoming) and math.isnan(left):
            oncoming = place
    for place, width, drivable, with_traffic in lanes[own + 1 :]:
        if not drivable or not with_traffic:
            break
        right_edge = place - width
        right = place if math.isnan(right) and 2.0 * width >= NARROWEST else right
    return LanesBeside(center, left, right, oncoming, left_edge, right_edge, far_edge)
