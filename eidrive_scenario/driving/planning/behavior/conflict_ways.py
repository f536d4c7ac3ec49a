"""Ways on which traffic may come that no sensor shows: lanes of junctions and crosswalks that the line crosses."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.driving.planning.behavior.reference import ReferenceLine
from eidrive_scenario.driving.planning.behavior.right_of_way import (
    Course,
    JunctionRules,
    LaneCourses,
    Passage,
    in_turn,
)
from eidrive_scenario.roads import OTHER_LEVEL, RoadNetwork
from eidrive_scenario.roads.model.location import LaneKey
from eidrive_scenario.roads.objects import crosswalks

UPSTREAM = 150.0
"""Length of a lane before a junction on which hidden traffic is considered [m]."""
MOST = 3
"""Maximum number of lanes that lead to one lane of a junction."""
LANE_SPACING, FOOT_SPACING = 2.0, 0.5
"""Spacing of the places on lanes and beside crosswalks [m]."""
HALF_BODY = 1.0
"""Half of the width of a hidden vehicle [m]."""
MERGED = 10.0
"""Length of the zone on a lane that both vehicles then follow [m]."""
ROOM = 3.0
"""Distance that a waiting vehicle needs before and behind itself, together [m]."""
AROUND = 12.0
"""Distance before and behind a junction within which ways may meet the line [m]."""
WALKING_SPEED = 1.4
"""Speed of a hidden pedestrian [m/s]."""
WAITING = 2.0
"""Distance beyond the end of a crosswalk within which a pedestrian may stand [m]."""
LONGEST_CROSSING = 40.0
"""Maximum extent of a crosswalk to one side of the line [m]."""


class ConflictWay(NamedTuple):
    """Way that meets the line of the vehicle in a zone.

    key          identity of the way, the same for each line and each of its passages
    kind         lane or crosswalk;  start, end  of the zone along the line [m]
    has_light    whether a traffic light controls the passage of the vehicle
    hold         start of the first zone of a group in which the vehicle cannot wait between two zones [m]
    look         place of the sensor from which on the vehicle does not expect unseen traffic on it any more [m]
    points       places (P, 2) on the way from the zone on upstream [m];  distance  (P,) from the zone [m]
    speed        of traffic on it [m/s];  body  length of a vehicle or pedestrian on it [m]
    """

    key: Hashable
    kind: str
    start: float
    end: float
    points: Array
    distance: Array
    speed: float
    body: float
    has_light: bool
    hold: float = 0.0
    look: float = 0.0

    @property
    def spacing(self) -> float:
        """Distance between two places [m]."""
        return LANE_SPACING if self.kind == "lane" else FOOT_SPACING


class ConflictWays:
    """Lanes and crosswalks of a road network that may meet the line of a vehicle.

    size  length and width of the vehicle [m]
    """

    def __init__(self, roads: RoadNetwork, rules: JunctionRules, size: tuple[float, float]) -> None:
        self._roads = roads
        self._rules = rules
        self._length, self._half_width = size[0], size[1] / 2.0
        self._lanes: dict[str, list[tuple[tuple[LaneKey, ...], Course, float]]] = {}
        self._courses = LaneCourses(roads, rules)
        self._crosswalks = crosswalks(roads)

    def along(self, line: ReferenceLine, passages: tuple[Passage, ...]) -> list[ConflictWay]:
        """Return the ways that meet a line, in the order of their zones.

        passages  of junctions by the line
        """
        ways = [way for passage in passages for way in self._of_junction(line, passage)]
        lit = [(passage.start - AROUND, passage.end + AROUND) for passage in passages if passage.has_light]
        for number, outline in enumerate(self._crosswalks):
            for way in _beside_crosswalk(line, number, outline, self._half_width):
                ways.append(way._replace(has_light=any(low <= way.start <= high for low, high in lit)))
        return _grouped(sorted(ways, key=lambda way: way.start), self._length + ROOM)

    def _of_junction(self, line: ReferenceLine, own: Passage) -> Iterator[ConflictWay]:
        low, high = line.index_at(own.start - AROUND), line.index_at(own.end + AROUND) + 1
        for key, course, speed in self._lanes_of(own.junction):
            other = next((passage for passage in reversed(course.passages) if passage.junction == own.junction), None)
            if other is None or not self._rules.may_cross(own, other):
                continue
            way = self._meeting(line, (low, max(high, low + 2)), course, other)
            if way is not None:
                start, end, points, distance = way
                yield ConflictWay(key, "lane", start, end, points, distance, speed, 4.0, own.has_light)

    def _lanes_of(self, junction: str) -> list[tuple[tuple[LaneKey, ...], Course, float]]:
        """Return the lanes through a junction from far upstream on, their courses, and the speeds of traffic [m/s]."""
        lanes = self._lanes.get(junction)
        if lanes is None:
            lanes = self._lanes[junction] = []
            for key in self._last_lanes.get(junction, ()):
                for chain in self._upstream([key], 0.0):
                    course = self._courses.course_of(chain)
                    if course is not None:
                        lanes.append((tuple(chain), course, max(map(self._roads.usual_speed_in, chain))))
        return lanes

    @cached_property
    def _last_lanes(self) -> dict[str, list[LaneKey]]:
        """Last lanes of the ways through each junction. Traffic does not use center lanes, which the graph lacks."""
        lanes: dict[str, list[LaneKey]] = {}
        for key, drivable in self._roads.graph.nodes(data="drivable"):
            road = self._roads.road(key.road)
            last = len(road.sections) - 1 if self._roads.driving_direction(key.road, key.lane) > 0 else 0
            if drivable and road.junction_id is not None and key.section == last:
                lanes.setdefault(road.junction_id, []).append(key)
        return lanes

    def _upstream(self, chain: list[LaneKey], length: float) -> list[list[LaneKey]]:
        """Return the chains of lanes that lead to the end of a lane of a junction."""
        graph = self._roads.graph
        while length < UPSTREAM:
            first = chain[0]
            before = [
                key
                for key in graph.predecessors(first)
                if graph.edges[key, first]["kind"] == "successor" and graph.nodes[key]["drivable"] and key not in chain
            ][:MOST]
            if not before:
                break
            if len(before) > 1:
                longer = ([key, *chain] for key in before)
                chains = [self._upstream(extended, length + self._lane_length(extended[0])) for extended in longer]
                return in_turn(chains)[:MOST]
            chain = [before[0], *chain]
            length += self._lane_length(before[0])
        return [chain]

    def _lane_length(self, key: LaneKey) -> float:
        return float(self._roads.graph.nodes[key]["length"])

    def _meeting(
        self, line: ReferenceLine, window: tuple[int, int], course: Course, passage: Passage
    ) -> tuple[float, float, Array, Array] | None:
        """Return the zone in which a course meets the line, its places before, and their distances from the zone.

        None if it never meets the line, or comes from the same lane.
        """
        dense = np.arange(max(passage.start - AROUND, 0.0), min(passage.end + AROUND, course.along[-1]), 0.5)
        x, y, _ = course.poses(dense, 0.0)
        s, d, _ = line.project(x, y, *window)
        if line.heights is not None:
            gap = np.interp(dense, course.along, course.heights) - np.interp(s, line.along, line.heights)
            d = np.where(np.abs(gap) > OTHER_LEVEL, np.inf, d)
        first, last = float(line.along[window[0]]), float(line.along[min(window[1], len(line.along)) - 1])
        inside = (np.abs(d) < self._half_width + HALF_BODY) & (s >= first) & (s <= last)
        met = np.flatnonzero(inside)
        # A course that is on the line before the junction comes from behind the vehicle or from its own lane.
        if not len(met) or met[0] == 0:
            return None
        entry = float(dense[met[0]])
        zone = s[met]
        start = float(zone.min()) - HALF_BODY
        end = min(float(zone.max()) + HALF_BODY, start + MERGED + 2.0 * HALF_BODY)
        distance = np.arange(0.0, min(entry, UPSTREAM), LANE_SPACING)
        px, py, _ = course.poses(entry - distance, 0.0)
        return start, end, np.column_stack([px, py]), distance


def _beside_crosswalk(line: ReferenceLine, number: int, outline: Array, half_width: float) -> Iterator[ConflictWay]:
    """Yield the ways of pedestrians from both ends of a crosswalk (M, 3) to each place where the line crosses it."""
    center = outline[:, :2].mean(axis=0)
    reach = float(np.hypot(*(outline[:, :2] - center).T).max()) + line.spacing
    near = np.flatnonzero(np.hypot(*(line.points - center).T) <= reach)
    for run in np.split(near, np.flatnonzero(np.diff(near) > 1) + 1) if len(near) else ():
        window = max(int(run[0]) - 2, 0), min(int(run[-1]) + 3, len(line.points))
        yield from _across_line(line, number, outline, half_width, window)


def _across_line(
    line: ReferenceLine, number: int, outline: Array, half_width: float, window: tuple[int, int]
) -> Iterator[ConflictWay]:
    """Yield the ways of pedestrians to the points of the line in `window`, if the crosswalk reaches to both sides."""
    s, d, _ = line.project(outline[:, 0], outline[:, 1], *window)
    left, right = float(d.max()), float(d.min())
    if left <= half_width or right >= -half_width or left - right > 2.0 * LONGEST_CROSSING:
        return
    start, end, middle = float(s.min()), float(s.max()), line.index_at(float(s.mean()))
    if line.heights is not None and abs(float(line.heights[middle] - outline[:, 2].mean())) > OTHER_LEVEL:
        return
    (x, y), (tx, ty) = line.points[middle].tolist(), line.tangent[middle].tolist()
    for side, far in ((1.0, left), (-1.0, -right)):
        distance = np.arange(0.0, max(far - half_width, 0.0) + WAITING, FOOT_SPACING)
        offset = side * (half_width + distance)
        points = np.column_stack([x - ty * offset, y + tx * offset])
        yield ConflictWay((number, side), "crosswalk", start, end, points, distance, WALKING_SPEED, FOOT_SPACING, False)


def _grouped(ways: list[ConflictWay], room: float) -> list[ConflictWay]:
    """Return the ways (sorted) with the place before which the vehicle waits for each of them, and from which it looks.

    It looks into the lanes of a group from the first of them, as a crosswalk may be several meters before.

    room  length of a place between two zones at which the vehicle can wait [m]
    """
    grouped: list[ConflictWay] = []
    hold = end = lane = -np.inf
    for way in ways:
        if way.start - end > room:
            hold, lane = way.start, np.inf
        end = max(end, way.end)
        lane = min(lane, way.start) if way.kind == "lane" else lane
        grouped.append(way._replace(hold=hold, look=lane if way.kind == "lane" else hold))
    return grouped
