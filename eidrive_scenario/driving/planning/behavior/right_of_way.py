"""Right of way, and the courses of lanes that others may follow."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import zip_longest
from typing import NamedTuple, TypeVar

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import distances_along, wrap_angle
from eidrive_scenario.driving.planning.path import approached
from eidrive_scenario.perception.traffic_lights import StopLine, places_along, stop_lines
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.model.location import LaneKey

BEFORE_ENTRY = 25.0
"""Maximum distance of a sign before the junction to which it belongs [m]."""
BEYOND_ENTRY = 2.0
"""Maximum distance of a sign behind the entry [m]."""
NEAR = 3.0
"""Distance from a way within which a stop line may hold its traffic [m]."""
ALIKE, OPPOSITE = math.radians(30.0), math.radians(150.0)
"""Angles between two entries below which they have the same direction, and from which on they are oncoming [rad]."""
CROSSING = math.sin(math.radians(45.0))
"""Sine of the angle between two ways in a junction from which on they cross."""
TURNING = math.radians(30.0)
"""Change of the heading in a junction from which on a vehicle turns [rad]."""


class Passage(NamedTuple):
    """Passage of a way through a junction.

    start, end  distances along the way [m];  heading  at the entry [rad];  turn  change of heading, left positive [rad]
    entry       distance along the way of its stop line, or its start without one [m]
    gives_way   whether a stop sign or a sign to give way stands before it;  has_light  whether a light controls it
    is_crossed  whether ways cross its direction, other than where lanes only part or join, as on motorways
    road        connecting road in a junction with priorities of the map; None in other junctions
    """

    junction: str
    entry: float
    start: float
    end: float
    heading: float
    turn: float
    gives_way: bool
    has_light: bool
    is_crossed: bool
    road: str | None = None


class JunctionRules:
    """Junctions of a road network with their signs."""

    def __init__(self, roads: RoadNetwork) -> None:
        self._roads = roads
        self._lines = stop_lines(roads, with_give_way=True)
        self._road = [key.road for key in roads.tables.lane_keys]
        self._junction = [roads.road(road).junction_id for road in self._road]
        self._priorities: Mapping[str, frozenset[tuple[str, str]]] = {
            junction.id: frozenset(junction.priorities) for junction in roads.junctions.values() if junction.priorities
        }
        self._headings_in: dict[str, Array] = {}
        self._left_hand = frozenset(road.junction_id for road in roads.roads.values() if road.rule == "LHT")
        """Junctions with traffic on the left."""

    def stops_along(self, points: Array, heights: Array | None = None) -> tuple[float, ...]:
        """Return the distances along a way (M, 2) at which stop signs hold its traffic [m].

        heights  as in `passages`
        """
        signs = places_along(self._lines_near(points), points, heights)
        return tuple(sorted(distance for distance, line in signs if line.kind == "stop sign"))

    def passages(self, points: Array, heights: Array | None = None) -> tuple[Passage, ...]:
        """Return the passages of junctions by a way (M, 2), in their order; a way may pass a junction several times.

        heights  of the way (M,) [m], for roads above each other; None: the roads are level
        """
        along = distances_along(points)
        dx, dy = np.diff(points, axis=0).T
        heading = np.arctan2(dy, dx)
        inside: list[set[str]] = [set() for _ in points]
        covered: list[tuple[int, str, str]] = []
        lanes, _, owners = self._roads.overlapped_lanes(points[:, 0].copy(), points[:, 1].copy(), heights)
        for lane, owner in zip(lanes.tolist(), owners.tolist(), strict=True):
            junction = self._junction[lane]
            if junction is not None:
                inside[owner].add(junction)
                if junction in self._priorities:
                    covered.append((owner, junction, self._road[lane]))
        signs = list(places_along(self._lines_near(points), points, heights))
        passages = []
        for junction, first, last in _runs(inside):
            # The connecting road that covers most points of the stay.
            counts = Counter(road for index, name, road in covered if name == junction and first <= index <= last)
            road = max(counts, key=lambda road: (counts[road], road), default=None)
            start, end, before = float(along[first]), float(along[last]), float(heading[max(first - 1, 0)])
            turn = float(wrap_angle(float(heading[min(last, len(heading) - 1)]) - before))
            lines = [(place, line.kind) for place, line in signs if -BEFORE_ENTRY <= place - start <= BEYOND_ENTRY]
            kinds = {kind for _, kind in lines}
            entry = min(max((place for place, _ in lines), default=start), start)
            gives_way, has_light = bool(kinds - {"light"}), "light" in kinds
            is_crossed = bool((np.abs(np.sin(self._headings(junction) - before)) > CROSSING).any())
            passages.append(Passage(junction, entry, start, end, before, turn, gives_way, has_light, is_crossed, road))
        return tuple(passages)

    def _headings(self, junction: str) -> Array:
        """Return the headings of the roads through a junction at their ends [rad]."""
        headings = self._headings_in.get(junction)
        if headings is None:
            inside = [road for road in self._roads.roads.values() if road.junction_id == junction]
            ends = [(road.id, s) for road in inside for s in (0.0, road.length)]
            headings = self._headings_in[junction] = np.array([self._roads.road_pose_at(*end).h for end in ends])
        return headings

    def _lines_near(self, points: Array) -> list[StopLine]:
        """Return the stop lines in the extent of a way (M, 2)."""
        (left, bottom), (right, top) = points.min(axis=0) - NEAR, points.max(axis=0) + NEAR
        return [line for line in self._lines if left <= line.x <= right and bottom <= line.y <= top]

    def gives_way(self, own: Passage, other: Passage) -> bool:
        """Return whether traffic on one passage gives way to traffic on another one of the same junction.

        The order of precedence: lights, signs, priorities of the map, priority to the right, oncoming traffic before
        left turns. In countries with traffic on the left the sides are exchanged.
        """
        relation = self._right(own) * float(wrap_angle(other.heading - own.heading))
        if own.gives_way != other.gives_way and not own.has_light:
            return own.gives_way
        by_map = None if own.has_light else self._yields_by_map(own, other)
        if by_map is not None:
            return by_map
        if abs(relation) >= OPPOSITE:
            return self._turns_across(own, other)
        if own.has_light or abs(relation) <= ALIKE:
            return False
        return relation > 0.0

    def may_cross(self, own: Passage, other: Passage) -> bool:
        """Return whether traffic that cannot be seen may cross on another passage of the same junction.

        Lights are not considered. Traffic that a sign, a priority of the map or its left turn holds gives way; priority
        to the right is not relied upon, as it holds back only drivers who see the vehicle.
        """
        relation = abs(float(wrap_angle(other.heading - own.heading)))
        if relation <= ALIKE or (other.gives_way and not own.gives_way):
            return False
        by_map = self._yields_by_map(own, other) if own.gives_way == other.gives_way else None
        if by_map is not None:
            return by_map
        if relation >= OPPOSITE:
            return self._turns_across(own, other)
        return True

    def _turns_across(self, own: Passage, other: Passage) -> bool:
        """Return whether only the first one of two oncoming passages turns across the other one."""
        right = self._right(own)
        return right * own.turn > TURNING >= right * other.turn

    def _right(self, passage: Passage) -> float:
        """Return the sign of angles, which are exchanged with traffic on the left."""
        return -1.0 if passage.junction in self._left_hand else 1.0

    def _yields_by_map(self, own: Passage, other: Passage) -> bool | None:
        """Return whether a priority of the map holds `own` for `other`; None if the map has none for both."""
        if own.road is None or other.road is None:
            return None
        priorities = self._priorities.get(own.junction, frozenset())
        yields, precedes = (other.road, own.road) in priorities, (own.road, other.road) in priorities
        return None if yields == precedes else yields


def _runs(inside: list[set[str]]) -> Iterator[tuple[str, int, int]]:
    """Yield each junction with the first and the last point of each stay in it, in the order of the first points.

    inside  junctions at each point of a way
    """
    for first, names in enumerate(inside):
        for name in sorted(names - inside[first - 1] if first else names):
            last = first
            while last + 1 < len(inside) and name in inside[last + 1]:
                last += 1
            yield name, first, last


SPACING = 2.0
"""Distance between the points of a course [m]."""
LENGTH = 180.0
"""Minimum length of a course beyond its first lane, unless the lanes end [m]."""
MOST = 4
"""Maximum number of courses from one lane."""

Element = TypeVar("Element")


FASTEST_TURN, FASTEST_STOP = 4.0, 2.0
"""Maximum lateral acceleration in a curve, and deceleration before it, of a vehicle that is expected to follow a course
[m/s²]; comfortable ones, as harder turns are rare."""


class Course:
    """Center line of a lane and its successors: points (M, 2) [m], distances along it (M,) [m].

    half_width  of the lane at its start [m]
    stops       distances at which stop signs hold the traffic [m];  passages  of junctions
    heights     of the road (M,) [m]
    """

    def __init__(
        self,
        points: Array,
        along: Array,
        half_width: float,
        stops: tuple[float, ...] = (),
        passages: tuple[Passage, ...] = (),
        heights: Array | None = None,
    ) -> None:
        self.points, self.along, self.half_width = points, along, half_width
        self.heights: Array = np.zeros(len(along)) if heights is None else heights
        self.stops, self.passages = stops, passages
        self._x, self._y = (np.ascontiguousarray(column) for column in points.T)
        step = np.diff(points, axis=0)
        unit = step / np.maximum(np.hypot(step[:, 0], step[:, 1]), 1e-9)[:, None]
        self._heading = np.arctan2(unit[:, 1], unit[:, 0])
        self._segments: Array = np.stack([self._x[:-1], self._y[:-1], along[:-1], *unit.T, self._heading])
        """Start, distance along the course, direction and heading of the segments (6, M - 1)."""
        self._inside = along[1:-1]
        """Distances at which the next segment begins."""

    def project(self, x: float, y: float) -> tuple[float, float, float]:
        """Return the distance along the course, the offset to the left and the heading at the nearest point.

        The heading is interpolated between the middles of the segments.
        """
        gap = (self._x - x) ** 2 + (self._y - y) ** 2
        index = min(int(gap.argmin()), len(gap) - 2)
        x0, y0, x1, y1 = self._corners[index]
        length = math.hypot(x1 - x0, y1 - y0) or 1.0
        ux, uy = (x1 - x0) / length, (y1 - y0) / length
        ahead = (x - x0) * ux + (y - y0) * uy
        share = ahead / length - 0.5
        beside = min(max(index + (1 if share > 0.0 else -1), 0), len(self._turns) - 1)
        turn = self._turns[index]
        heading = turn + min(abs(share), 1.0) * (self._turns[beside] - turn)
        return self._distances[index] + ahead, (y - y0) * ux - (x - x0) * uy, float(wrap_angle(heading))

    def can_follow(self, along: float, speed: float) -> bool:
        """Return whether a vehicle with a speed [m/s] at a distance along the course can pass the curves ahead."""
        return speed <= self._fastest[max(bisect_right(self._distances, along) - 1, 0)]

    @cached_property
    def _corners(self) -> list[tuple[float, float, float, float]]:
        """Start and end of each segment [m]."""
        x, y = self._x.tolist(), self._y.tolist()
        return list(zip(x[:-1], y[:-1], x[1:], y[1:], strict=True))

    @cached_property
    def _turns(self) -> list[float]:
        """Headings of the segments without steps of a full turn [rad]."""
        turns: list[float] = np.unwrap(self._heading).tolist()
        return turns

    @cached_property
    def _distances(self) -> list[float]:
        distances: list[float] = self.along.tolist()
        return distances

    @cached_property
    def _fastest(self) -> list[float]:
        """Maximum speed at each point from which a vehicle can pass the curves ahead [m/s]."""
        turn = np.abs(np.diff(np.unwrap(self._heading)))
        length = (self.along[2:] - self.along[:-2]) / 2.0
        curvature = np.concatenate([[0.0], turn / np.maximum(length, 1e-9), [0.0]])
        # The mean of neighbors: the course has an angle at each of its points, and a lane may begin with one.
        curvature = np.convolve(curvature, np.ones(3) / 3.0, mode="same") if len(curvature) > 3 else curvature
        limits = np.sqrt(FASTEST_TURN / np.maximum(curvature, 1e-6))
        speeds: list[float] = approached(limits, np.diff(self.along), FASTEST_STOP).tolist()
        return speeds

    def poses(self, along: Array, left: Array | float) -> tuple[Array, Array, Array]:
        """Return x, y and heading (K,) at distances along the course and offsets to the left; straight beyond it."""
        index = self._inside.searchsorted(along, side="right")
        x, y, begin, ux, uy, heading = self._segments.take(index, axis=1)
        ahead = along - begin
        return x + ahead * ux - left * uy, y + ahead * uy + left * ux, heading


def in_turn(groups: Sequence[Sequence[Element]]) -> list[Element]:
    """Return the elements of groups in turn, so that each group is among the first ones."""
    return [element for turn in zip_longest(*groups) for element in turn if element is not None]


class LaneCourses:
    """Courses of all lanes of a road network, computed when they are first needed."""

    def __init__(self, roads: RoadNetwork, rules: JunctionRules) -> None:
        self._roads = roads
        self._rules = rules
        self._courses: dict[int, tuple[Course, ...]] = {}

    def ahead(self, lane: int) -> tuple[Course, ...]:
        """Return the courses from the start of a lane (running number), in its driving direction."""
        courses = self._courses.get(lane)
        if courses is None:
            chains = self._chains([self._roads.tables.lane_keys[lane]], 0.0)[:MOST]
            courses = tuple(course for chain in chains if (course := self.course_of(chain)) is not None)
            self._courses[lane] = courses
        return courses

    def _chains(self, chain: list[LaneKey], length: float) -> list[list[LaneKey]]:
        """Return the lanes that continue a chain, at most MOST alternatives."""
        while length < LENGTH:
            key = chain[-1]
            direction = self._roads.driving_direction(key.road, key.lane)
            branches = [branch for branch in self._roads.movement.branches(key, direction) if branch.lane not in chain]
            # The straightest first, as not all alternatives of many are kept.
            branches.sort(key=lambda branch: abs(branch.turn))
            if not branches:
                break
            if len(branches) > 1:
                longer = ((branch.lane, length + self._length(branch.lane)) for branch in branches)
                return in_turn([self._chains([*chain, lane], total) for lane, total in longer])[:MOST]
            chain = [*chain, branches[0].lane]
            length += self._length(branches[0].lane)
        return [chain]

    def _length(self, key: LaneKey) -> float:
        return self._roads.road(key.road).sections[key.section].length

    def course_of(self, chain: list[LaneKey]) -> Course | None:
        """Return the course along consecutive lanes; None if it has no length."""
        tables = self._roads.tables
        rows, places = [], []
        for key in chain:
            section = self._roads.road(key.road).sections[key.section]
            count = max(math.ceil(section.length / SPACING), 1)
            s = np.linspace(section.s, section.end, count + 1)
            if self._roads.driving_direction(key.road, key.lane) < 0:
                s = s[::-1]
            rows.append(np.full(len(s), tables.row_of(key)))
            places.append(s)
        poses = tables.lane_poses(np.concatenate(rows), np.concatenate(places), np.zeros(sum(map(len, places))))
        points = np.column_stack([poses.x, poses.y])
        step = np.hypot(*np.diff(points, axis=0).T)
        apart = np.concatenate([[True], step > 0.05])
        points, heights = points[apart], np.asarray(poses.z)[apart]
        if len(points) < 2:
            return None
        along = distances_along(points)
        first = chain[0]
        section = self._roads.road(first.road).sections[first.section]
        width = section.lanes[first.lane].width
        half_width = max(width.value(0.0), width.value(section.length)) / 2.0
        stops, passages = self._rules.stops_along(points, heights), self._rules.passages(points, heights)
        return Course(points, along, half_width, stops, passages, heights)
