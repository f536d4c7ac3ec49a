"""Reference line of the route: coordinates along it and to its left, and the lanes beside it."""

from __future__ import annotations

import math
from bisect import bisect_right
from functools import cached_property
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import distances_along
from eidrive_scenario.driving.planning.path import PlannedPath, path_heights
from eidrive_scenario.roads import LaneKey, LaneLocation, RoadNetwork
from eidrive_scenario.roads.geometry.poses import lane_t
from eidrive_scenario.roads.model.road_map import LaneSection

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
    limit: float = math.nan
    """Speed limit of the lane at the point [m/s]; NaN if there is none."""
    oncoming_limit: float = math.nan
    """Speed limit of the nearest lane of the opposite direction [m/s]; NaN if there is none."""
    has_solid_line: bool = False
    """Whether a solid line separates the vehicle from the lanes of the opposite direction."""

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
        return self._replace(
            own=-self.own,
            left=-self.right,
            right=-self.left,
            oncoming=-self.oncoming,
            left_edge=-self.right_edge,
            right_edge=-self.left_edge,
            far_edge=-self.far_edge,
            overtaking=-self.overtaking,
        )


class LanesOfDirection(NamedTuple):
    """Lanes of the direction of the line at one of its points.

    centers  distances of their centers to the left [m], from left to right
    key, own  lane at the point, and the distance of its center
    """

    centers: tuple[float, ...] = ()
    key: LaneKey = LaneKey("", 0, 0)
    own: float = math.nan


class ReferenceLine:
    """Path of the route with distances along it (s) and to its left (d).

    z        height of its start [m]
    offsets  distances of the points of the line to the left of those of the path (M,) [m], if it is beside the path
    """

    def __init__(
        self, path: PlannedPath, roads: RoadNetwork | None, z: float = 0.0, offsets: Array | None = None
    ) -> None:
        self._z = z
        self.path = path
        self.points: Array = path.points if offsets is None else _beside_path(path.points, offsets)
        step = np.diff(self.points, axis=0)
        length = np.maximum(np.hypot(step[:, 0], step[:, 1]), 1e-9)
        self.along: Array = np.concatenate([[0.0], np.cumsum(length)])
        self._distances: list[float] = self.along.tolist()
        self.spacing = float(self.along[-1]) / len(length)
        self.tangent, self.normal = _directions(self.points)
        self.heading: Array = np.unwrap(np.arctan2(self.tangent[:, 1], self.tangent[:, 0]))
        self.curvature: Array = np.gradient(self.heading, self.along)
        self._columns: Array = np.stack([*self.points.T, *self.tangent.T, self.along, self.heading])
        self._roads = roads
        self._beside: dict[int, LanesBeside] = {}
        self._locations: list[LaneLocation | None] = []
        self._of_direction: dict[int, LanesOfDirection] = {}

    @property
    def path_limits(self) -> Array:
        """Speed limits of the path at the points (M,) [m/s]; beside it only that at its end."""
        if self.points is self.path.points:
            return self.path.limits
        limits = np.full(len(self.points), np.inf)
        limits[-1] = self.path.limits[-1]
        return limits

    @cached_property
    def speed_limits(self) -> Array:
        """Speeds that the limits of the lanes at the points allow (M,) [m/s]; inf outside of roads."""
        limits = np.full(len(self.points), np.inf)
        roads = self._roads
        if roads is None:
            return limits
        for index in range(len(limits)):
            location = self._location(roads, index)
            if location is not None:
                limits[index] = roads.usual_speed(location.road, location.s, location.lane)
        return limits

    @property
    def length(self) -> float:
        """Length of the line [m]."""
        return float(self.along[-1])

    @cached_property
    def heights(self) -> Array | None:
        """Heights of the road at the points (M,) [m]; None if all roads are level."""
        return path_heights(self.path, self._roads, self._z)

    def _height(self, index: int) -> float | None:
        return None if self.heights is None else float(self.heights[index])

    def along_of(self, distance: float) -> float:
        """Return the distance along the line at a distance along its path [m]."""
        return distance if self.points is self.path.points else float(np.interp(distance, self._along_path, self.along))

    @cached_property
    def _along_path(self) -> Array:
        """Distances of the points along the path (M,) [m]."""
        return distances_along(self.path.points)

    def index_at(self, s: float) -> int:
        """Return the index of the last point up to a distance along the line."""
        return max(bisect_right(self._distances, s) - 1, 0)

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

    def project_near(self, x: float, y: float, index: int) -> tuple[float, float]:
        """Return s and d of one place, nearest among the points from 3 before one of them on."""
        low = max(index - 3, 0)
        gaps = [(x - px) ** 2 + (y - py) ** 2 for px, py in self.points[low : low + 12].tolist()]
        index = low + gaps.index(min(gaps))
        (px, py), (tx, ty) = self.points[index].tolist(), self.tangent[index].tolist()
        dx, dy = x - px, y - py
        return self._distances[index] + dx * tx + dy * ty, dy * tx - dx * ty

    def lanes_beside(self, s: float) -> LanesBeside:
        """Return the lanes at a distance along the line [m]."""
        index = self.index_at(s)
        lanes = self._beside.get(index)
        if lanes is None:
            lanes = self._beside[index] = self._lanes_at(index)
        return lanes

    def lanes_of_direction(self, index: int) -> LanesOfDirection:
        """Return the lanes of the direction of the line at a point; none outside of roads."""
        lanes = self._of_direction.get(index)
        if lanes is None:
            lanes = self._of_direction[index] = self._centers_at(index)
        return lanes

    def _centers_at(self, index: int) -> LanesOfDirection:
        there = self._section_at(index)
        if there is None:
            return LanesOfDirection()
        lanes, own = there.lanes, there.own
        first = next((n + 1 for n in range(own - 1, -1, -1) if not _is_usable(lanes[n])), 0)
        last = next((n for n in range(own + 1, len(lanes)) if not _is_usable(lanes[n])), len(lanes))
        centers = tuple([lane.center for lane in lanes[first:last] if 2.0 * lane.half_width >= NARROWEST])
        key = LaneKey(there.location.road, there.section.index, there.location.lane)
        return LanesOfDirection(centers, key, lanes[own].center)

    def _section_at(self, index: int) -> _Section | None:
        """Return the lanes at a point of the line; None outside of roads."""
        roads = self._roads
        if roads is None:
            return None
        location = self._location(roads, index)
        if location is None:
            return None
        road = roads.road(location.road)
        section = road.section_at(location.s)
        # The road may be passed against its driving direction; left is left of the motion.
        pose = roads.road_pose_at(location.road, location.s)
        tx, ty = self.tangent[index].tolist()
        sense = 1 if tx * math.cos(pose.h) + ty * math.sin(pose.h) >= 0.0 else -1
        order = [number for number in section.lanes if number]
        if location.lane not in order:
            return None
        lanes = []
        for number in order if sense > 0 else order[::-1]:
            lane = section.lanes[number]
            half = lane.width.value(location.s - section.s) / 2.0
            if half <= 0.0 and number != location.lane:
                continue  # It separates no others.
            center = (lane_t(road, section, lane, location.s)[0] - location.t) * sense
            # On a lane for both directions the vehicle meets traffic unless it is its own.
            with_traffic = roads.driving_direction(road.id, number) == sense and (
                not lane.is_two_way or number == location.lane
            )
            lanes.append(_Lane(number, center, half, lane.drivable, with_traffic))
        own = next(index for index, lane in enumerate(lanes) if lane.number == location.lane)
        return _Section(location, section, lanes, own, road.rule == "LHT")

    def _location(self, roads: RoadNetwork, index: int) -> LaneLocation | None:
        """Return the lane location of a point. In junctions it continues the lanes of the points before."""
        while len(self._locations) <= index:
            number, before = len(self._locations), self._locations[-1] if self._locations else None
            x, y = self.points[number].tolist()
            self._locations.append(roads.locate_at(x, y, before, self._height(number), reach=5.0))
        return self._locations[index]

    def _lanes_at(self, index: int) -> LanesBeside:
        there = self._section_at(index)
        if there is None:
            return LanesBeside()
        location, section, lanes, own, keeps_left = there
        if keeps_left:
            mirrored = [lane._replace(center=-lane.center) for lane in reversed(lanes)]
            beside = _beside(mirrored, len(lanes) - 1 - own).mirrored()
        else:
            beside = _beside(lanes, own)
        beside = beside._replace(limit=self._limit_of(location, location.lane))
        if math.isnan(beside.oncoming):
            return beside
        opposite = min(lanes, key=lambda lane: abs(lane.center - beside.oncoming))
        is_solid = _has_solid_line(section, location.s, location.lane)
        return beside._replace(oncoming_limit=self._limit_of(location, opposite.number), has_solid_line=is_solid)

    def _limit_of(self, location: LaneLocation, lane: int) -> float:
        """Return the speed limit of a lane of the road at a location [m/s]; NaN if there is none."""
        limit = None if self._roads is None else self._roads.speed_limit(location.road, location.s, lane)
        return math.nan if limit is None else limit


def _has_solid_line(section: LaneSection, s: float, lane: int) -> bool:
    """Return whether the line in the middle of the road that is nearest to a lane is solid at s."""
    middle = section.lanes.get(0)
    marks = [mark for mark in (middle.road_marks if middle is not None else ()) if mark.s_offset <= s - section.s]
    # The lines of a mark in the middle are named from left to right.
    kinds = marks[-1].type.split() if marks else []
    return bool(kinds) and kinds[-1 if lane < 0 else 0] == "solid"


class _Lane(NamedTuple):
    """Lane beside a point of the line: number, distance of its center to the left and half width [m], whether it is
    drivable, and whether its traffic drives in the direction of the line."""

    number: int
    center: float
    half_width: float
    drivable: bool
    with_traffic: bool


class _Section(NamedTuple):
    """Lanes at a point of the line from left to right, the index of that at the point, and the side of the traffic."""

    location: LaneLocation
    section: LaneSection
    lanes: list[_Lane]
    own: int
    keeps_left: bool


def _is_usable(lane: _Lane) -> bool:
    return lane.drivable and lane.with_traffic


def _directions(points: Array) -> tuple[Array, Array]:
    """Return the unit vectors along a line of points (M, 2) and to its left (M, 2)."""
    ahead = np.vstack([points[1] - points[0], points[2:] - points[:-2], points[-1] - points[-2]])
    tangent = ahead / np.maximum(np.hypot(ahead[:, 0], ahead[:, 1]), 1e-9)[:, None]
    return tangent, np.column_stack([-tangent[:, 1], tangent[:, 0]])


def _beside_path(points: Array, offsets: Array) -> Array:
    """Return the points (M, 2) at offsets (M,) to the left of those of a path (M, 2) [m]."""
    return np.asarray(points + offsets[:, None] * _directions(points)[1])


def _beside(lanes: list[_Lane], own: int) -> LanesBeside:
    """Return the lanes beside one of the lanes of a section, from left to right, with traffic on the right."""
    _, center, half, _, _ = lanes[own]
    left_edge = far_edge = center + half
    right_edge = center - half
    left = right = oncoming = math.nan
    same = True
    for _, offset, width, drivable, with_traffic in reversed(lanes[:own]):
        if not drivable:
            break
        same = same and with_traffic
        far_edge = offset + width
        if same:
            left_edge = far_edge
            left = offset if math.isnan(left) and 2.0 * width >= NARROWEST else left
        elif math.isnan(oncoming):
            oncoming = offset
    for _, offset, width, drivable, with_traffic in lanes[own + 1 :]:
        if not drivable or not with_traffic:
            break
        right_edge = offset - width
        right = offset if math.isnan(right) and 2.0 * width >= NARROWEST else right
    return LanesBeside(center, left, right, oncoming, left_edge, right_edge, far_edge)
