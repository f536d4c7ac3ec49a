"""Routes: lanes between locations, with length and path."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby
from typing import NamedTuple, TypeVar

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.roads.geometry.poses import lane_pose_at, lane_t
from eidrive_scenario.roads.geometry.tables import RoadTables
from eidrive_scenario.roads.model.location import LaneKey, LaneLocation, Pose
from eidrive_scenario.roads.model.road_map import Road

POINT_SPACING = 0.25
"""Distance between the stored points of a path [m]."""
LANE_CHANGE_LENGTH = 40.0
"""Length of a lane change if its section is long enough [m]."""


class Branch(NamedTuple):
    """Branch of a fork.

    direction  +1 if it is entered in the direction of s, else -1
    turn       change of heading up to its end, left positive, in (-π, π] [rad]
    """

    lane: LaneKey
    direction: int
    turn: float


BranchSelector = Callable[[Sequence[Branch]], Branch]


class Leg(msgspec.Struct, frozen=True):
    """Part of a route within one lane section: from s to s_end, from one lane to another (usually the same).

    direction  +1 along s, -1 against it, also of a part without length
    """

    road: str
    section: int
    lane: int
    lane_end: int
    s: float
    s_end: float
    direction: int

    def contains(self, location: LaneLocation) -> bool:
        """Return whether a location is on the road between both ends, on any lane."""
        low, high = sorted((self.s, self.s_end))
        return self.road == location.road and low - 1e-6 <= location.s <= high + 1e-6


@dataclass(frozen=True)
class Route:
    """Route from `start` to `end` over `lanes`; distances along it count from the start [m].

    A closed route ends at its start and is repeated. `lap` is the closed route that follows this one. With
    `against_traffic` it leads against the driving direction of its lanes. A route through intermediate locations
    consists of `parts`.
    """

    tables: RoadTables = field(repr=False)
    lanes: tuple[LaneKey, ...]
    start: LaneLocation
    end: LaneLocation
    closed: bool = False
    lap: Route | None = field(default=None, repr=False)
    against_traffic: bool = False
    parts: tuple[Route, ...] = field(default=(), repr=False)

    @property
    def roads(self) -> Mapping[str, Road]:
        """Roads of the network by their ids."""
        return self.tables.by_id

    @property
    def onward(self) -> Route | None:
        """Route that follows at the end: the lap, or a closed route itself."""
        return self if self.closed else self.lap

    @cached_property
    def legs(self) -> tuple[Leg, ...]:
        """Parts of the route: one for each lane section, or two around an intermediate location near a lane change."""
        if self.parts:
            return _join_legs([part.legs for part in self.parts])
        groups: list[list[LaneKey]] = []
        for key in self.lanes:
            if groups and groups[-1][-1][:2] == key[:2] and groups[-1][-1] != key:
                groups[-1].append(key)
            else:
                groups.append([key])
        legs = []
        for number, group in enumerate(groups):
            road = self.roads[group[0].road]
            section = road.sections[group[0].section]
            direction = road.driving_direction(group[0].lane) * (-1 if self.against_traffic else 1)
            s, s_end = (section.s, section.end) if direction > 0 else (section.end, section.s)
            if number == 0:
                s = self.start.s
            if number == len(groups) - 1:
                s_end = self.end.s
            legs.append(Leg(road.id, section.index, group[0].lane, group[-1].lane, s, s_end, direction))
        return tuple(legs)

    @property
    def reference_length(self) -> float:
        """Length from start to end along the reference lines of the roads [m]."""
        return sum(abs(leg.s_end - leg.s) for leg in self.legs)

    @property
    def length(self) -> float:
        """Length from start to end along the center lines of the lanes [m]."""
        return float(self._path[1][-1])

    def polyline(self, spacing: float = 1.0) -> Array:
        """Return points (M, 3) of the center lines of the lanes from start to end, at most `spacing` apart [m].

        Gaps between lanes of invalid maps get no additional points.
        """
        most = math.ceil(2.0 * len(self._path[1]) * max(POINT_SPACING / spacing, 1.0))
        count = min(max(math.ceil(self.length / spacing), 1), most) + 1
        return self.points_at(np.linspace(0.0, self.length, count))

    def points_at(self, distance: Array) -> Array:
        """Return points (M, 3) at distances (M,) along the route."""
        points, along, _, _ = self._path
        return np.column_stack([np.interp(distance, along, points[:, axis]) for axis in range(3)])

    def location_at(self, distance: float) -> LaneLocation:
        """Return the location at a distance along the route on its center line."""
        _, along, owner, places = self._path
        index = min(max(bisect_right(along, distance) - 1, 0), len(along) - 2)
        leg = self.legs[int(owner[index + 1])]
        before = index if owner[index] == owner[index + 1] else index + 1
        span = along[index + 1] - along[before]
        part = (distance - along[before]) / span if span > 0.0 else 0.0
        return self._location(
            leg, float(places[before] + (places[index + 1] - places[before]) * min(max(part, 0.0), 1.0))
        )

    def location_by_reference_line(self, distance: float) -> LaneLocation:
        """Return the location on the center line at a distance along the reference lines of the route."""
        for leg in self.legs:
            span = abs(leg.s_end - leg.s)
            if distance <= span:
                return self._location(leg, leg.s + max(distance, 0.0) * leg.direction)
            distance -= span
        return self._location(self.legs[-1], self.legs[-1].s_end)

    def _location(self, leg: Leg, s: float) -> LaneLocation:
        road = self.roads[leg.road]
        section = road.sections[leg.section]
        if s >= section.end and section is not road.sections[-1]:
            s = math.nextafter(section.end, section.s)  # At its end, lanes have the numbers of the next section
        t = self._t(leg, s)
        lane = min((leg.lane, leg.lane_end), key=lambda n: abs(lane_t(road, section, section.lanes[n], s)[0] - t))
        return LaneLocation(leg.road, lane, s, t - lane_t(road, section, section.lanes[lane], s)[0], t)

    def pose_at(self, distance: float) -> Pose:
        """Return the pose at a distance along the route with the heading of travel."""
        location = self.location_at(distance)
        pose = lane_pose_at(self.roads[location.road], location.lane, location.s, location.offset)
        x, y, _ = self.points_at(np.array([distance - 0.25, distance + 0.25])).T
        if x[0] == x[1] and y[0] == y[1]:
            return pose.turned(0.0 if self.legs[-1].direction > 0 else math.pi)
        heading = math.atan2(y[1] - y[0], x[1] - x[0])
        return pose.turned(wrap_angle(heading - pose.h))

    def s_along(self, location: LaneLocation) -> float | None:
        """Return the distance along the route to the road and s of a location, or None if the route misses it."""
        _, along, owner, places = self._path
        for number, leg in enumerate(self.legs):
            if leg.contains(location):
                on_leg = np.flatnonzero(owner == number)
                order = places[on_leg] * leg.direction
                return float(np.interp(location.s * leg.direction, order, along[on_leg]))
        return None

    def distance(self, a: LaneLocation, b: LaneLocation) -> tuple[float, float] | None:
        """Return the distances from a to b ahead and to the left along the reference lines of the route [m].

        They refer to the driving direction of the lane of a. A closed route gives the shorter way round. The result is
        None if the route misses a location.
        """
        pass_a, pass_b = self._passes(a), self._passes(b)
        if pass_a is None or pass_b is None:
            return None
        sense = pass_a[1] * self.roads[a.road].driving_direction(a.lane)
        along = pass_b[0] - pass_a[0]
        if self.closed:
            total = self.reference_length
            along = (along + 0.5 * total) % total - 0.5 * total
        return along * sense, (b.t * pass_b[1] - a.t * pass_a[1]) * sense

    def _passes(self, location: LaneLocation) -> tuple[float, int] | None:
        """Return the length of reference lines up to a location and the direction of travel there, or None.

        The lap of the route is included.
        """
        done = 0.0
        for leg in self.legs:
            if leg.contains(location):
                return done + abs(location.s - leg.s), leg.direction
            done += abs(leg.s_end - leg.s)
        onward = None if self.lap is None else self.lap._passes(location)
        return None if onward is None else (done + onward[0], onward[1])

    def project(self, x: float, y: float, near: float | None = None, window: float = 30.0) -> tuple[float, float]:
        """Return the distance along the route of the point nearest to x, y, and the offset to the left of the route
        [m].

        `near` restricts the search to `window` [m] around a previous distance.
        """
        points, along, _, _ = self._path
        low, high = 0, len(along) - 1
        if near is not None:
            low = max(bisect_right(along, near - window) - 1, 0)
            high = min(bisect_right(along, near + window), high)
        part = points[low : high + 1]
        index = low + int(np.argmin((part[:, 0] - x) ** 2 + (part[:, 1] - y) ** 2))
        best = (math.inf, 0.0, 0.0)
        for i in (index - 1, index):
            if low <= i < high:
                (ax, ay), (bx, by) = points[i, :2], points[i + 1, :2]
                dx, dy = bx - ax, by - ay
                norm = math.hypot(dx, dy)
                if norm == 0.0:
                    continue
                part_of = min(max(((x - ax) * dx + (y - ay) * dy) / norm**2, 0.0), 1.0)
                gap = math.hypot(x - ax - part_of * dx, y - ay - part_of * dy)
                left = ((y - ay) * dx - (x - ax) * dy) / norm
                distance = float(along[i] + part_of * (along[i + 1] - along[i]))
                best = min(best, (gap, distance, left))
        return best[1], float(best[2])

    def pick(self, branches: Sequence[Branch], road: str, visit: int = 0) -> Branch | None:
        """Return the branch of the route at its exit from a road, or None if it takes none of the branches.

        `visit` is the index of the road in the route (see `visit`), as a route may pass a road twice.
        """
        for number in self._later(visit):
            if self._visits[number][0] == road and (following := self.passes(number + 1)) is not None:
                lanes = self._visits[(number + 1) % len(self._visits)][1]
                candidates = [branch for branch in branches if branch.lane.road == following]
                if candidates:
                    return next((branch for branch in candidates if branch.lane in lanes), candidates[0])
        for exact in (True, False):
            for name, lanes in self._visits:
                for branch in branches:
                    if branch.lane in lanes or (not exact and branch.lane.road == name):
                        return branch
        return None if self.lap is None else self.lap.pick(branches, road)

    def visit(self, road: str, visit: int = 0) -> int:
        """Return the index of this road in the route, searched from the previous index `visit`."""
        return next((number for number in self._later(visit) if self._visits[number][0] == road), visit)

    def passes(self, visit: int) -> str | None:
        """Return the road of a visit, or None after the end of the route."""
        if self.closed:
            visit %= len(self._visits)
        return self._visits[visit][0] if visit < len(self._visits) else None

    def roads_from(self, visit: int) -> Iterator[str]:
        """Yield the roads from a visit on; a closed route continues at its start."""
        return (self._visits[number][0] for number in self._later(visit))

    def _later(self, visit: int) -> Iterator[int]:
        """Yield the indices of the roads from a visit on; a closed route continues at its start."""
        yield from range(visit, len(self._visits))
        if self.closed:
            yield from range(min(visit, len(self._visits)))

    @cached_property
    def _visits(self) -> list[tuple[str, frozenset[LaneKey]]]:
        """Roads in the order of the route, each with its lanes."""
        return [(road, frozenset(keys)) for road, keys in groupby(self.lanes, key=lambda key: key.road)]

    def _t(self, leg: Leg, s: float) -> float:
        """Return t of the path on a leg. A lane change has a continuous curvature."""
        road = self.roads[leg.road]
        section = road.sections[leg.section]
        t = lane_t(road, section, section.lanes[leg.lane], s)[0]
        if leg.lane == leg.lane_end:
            return t
        span = min(abs(leg.s_end - leg.s), LANE_CHANGE_LENGTH)
        part = min(abs(s - leg.s) / span, 1.0) if span > 0.0 else 1.0
        return t + smoothstep(part) * (lane_t(road, section, section.lanes[leg.lane_end], s)[0] - t)

    @cached_property
    def _path(self) -> tuple[Array, Array, Array, Array]:
        """Points (M, 3), distances (M,), leg indices (M,) and s (M,) of the path."""
        legs, tables = self.legs, self.tables
        ways = np.array([abs(leg.s_end - leg.s) for leg in legs])
        counts = np.maximum(np.ceil(ways / POINT_SPACING), 1.0).astype(np.int64) + 1
        owner = np.repeat(np.arange(len(legs)), counts)
        s = np.concatenate([np.linspace(leg.s, leg.s_end, count) for leg, count in zip(legs, counts, strict=True)])
        row = np.array([tables.row_of(LaneKey(leg.road, leg.section, leg.lane)) for leg in legs])
        row_end = np.array([tables.row_of(LaneKey(leg.road, leg.section, leg.lane_end)) for leg in legs])
        t = tables.lane_t(row[owner], s)[0]
        changes = np.flatnonzero((row != row_end)[owner])
        if changes.size:
            leg_of = owner[changes]
            span = np.minimum(ways, LANE_CHANGE_LENGTH)[leg_of]
            begin = np.array([leg.s for leg in legs])[leg_of]
            part = np.divide(np.abs(s[changes] - begin), span, out=np.ones_like(span), where=span > 0.0)
            t_end = tables.lane_t(row_end[leg_of], s[changes])[0]
            t[changes] += smoothstep(np.minimum(part, 1.0)) * (t_end - t[changes])
        road = tables.section_road[tables.lane_section[row]]
        points = np.column_stack(tables.road_poses(road[owner], s, t)[:3])
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        return points, along, owner.astype(np.float64), s


def _join_legs(groups: Sequence[Sequence[Leg]]) -> tuple[Leg, ...]:
    """Return the legs of consecutive routes. Where one ends and the next one begins, both legs become one if no lane is
    changed, or if one is too short for its lane change, which then begins or ends beyond the intermediate location;
    not if the route turns back there, in a two-way lane."""
    legs = list(groups[0])
    for first, *others in groups[1:]:
        last = legs[-1]
        changes = [leg for leg in (last, first) if leg.lane != leg.lane_end]
        turns_back = (last.s_end - last.s) * (first.s_end - first.s) < 0.0 and last.direction != first.direction
        is_short = any(abs(leg.s_end - leg.s) < LANE_CHANGE_LENGTH for leg in changes)
        if not turns_back and (is_short or not changes):
            longer = max((last, first), key=lambda leg: abs(leg.s_end - leg.s))
            legs[-1] = Leg(last.road, last.section, last.lane, first.lane_end, last.s, first.s_end, longer.direction)
        else:
            legs.append(first)
        legs += others
    return tuple(legs)


Share = TypeVar("Share", float, Array)


def smoothstep(part: Share) -> Share:
    """Return the share of the lateral motion of a lane change at a share of its length, with continuous curvature."""
    return part**3 * (10.0 + part * (6.0 * part - 15.0))


def concatenate_routes(routes: Sequence[Route]) -> Route:
    """Return several consecutive routes as one."""
    lanes = list(routes[0].lanes)
    for route in routes[1:]:
        lanes.extend(route.lanes[1:] if route.lanes[0] == lanes[-1] else route.lanes)
    first = routes[0]
    end, against_traffic = routes[-1].end, first.against_traffic
    return Route(first.tables, tuple(lanes), first.start, end, against_traffic=against_traffic, parts=tuple(routes))
