"""Right of way at junctions without lights: signs, priorities of the map, priority to the right, left turns."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.perception.traffic_lights import StopLine, places_along, stop_lines
from eidrive_scenario.roads import RoadNetwork

BEFORE_ENTRY = 25.0
"""Maximum distance of a sign before the junction to which it belongs [m]."""
BEYOND_ENTRY = 2.0
"""Maximum distance of a sign behind the entry [m]."""
NEAR = 3.0
"""Distance from a way within which a stop line may hold its traffic [m]."""
ALIKE, OPPOSITE = math.radians(30.0), math.radians(150.0)
"""Angles between two entries below which they have the same direction, and from which on they are oncoming [rad]."""
TURNING = math.radians(30.0)
"""Change of the heading in a junction from which on a vehicle turns [rad]."""


class Passage(NamedTuple):
    """Passage of a way through a junction.

    start, end  distances along the way [m];  heading  at the entry [rad];  turn  change of heading, left positive [rad]
    gives_way   whether a stop sign or a sign to give way stands before it;  has_light  whether a light controls it
    road        connecting road in a junction with priorities of the map; None in other junctions
    """

    junction: str
    start: float
    end: float
    heading: float
    turn: float
    gives_way: bool
    has_light: bool
    road: str | None = None


class JunctionRules:
    """Junctions of a road network with their signs."""

    def __init__(self, roads: RoadNetwork) -> None:
        self._roads = roads
        self._lines = stop_lines(roads, with_give_way=True)
        keys = [key for key, _ in roads.tables.lane_keys()]
        self._road = [key.road for key in keys]
        self._junction = [roads.road(key.road).junction_id for key in keys]
        self._priorities: Mapping[str, frozenset[tuple[str, str]]] = {
            junction.id: frozenset(junction.priorities) for junction in roads.junctions.values() if junction.priorities
        }
        self._keeps_right = all(road.rule == "RHT" for road in roads.roads.values())

    def stops_along(self, points: Array, heights: Array | None = None) -> tuple[float, ...]:
        """Return the distances along a way (M, 2) at which stop signs hold its traffic [m].

        heights  as in `passages`
        """
        signs = places_along(self._lines_near(points), points, heights)
        return tuple(sorted(place for place, line in signs if line.kind == "stop sign"))

    def passages(self, points: Array, heights: Array | None = None) -> tuple[Passage, ...]:
        """Return the passages of junctions by a way (M, 2), in their order; a way may pass a junction several times.

        heights  of the way (M,) [m], for roads above each other; None: the roads are level
        """
        step = np.diff(points, axis=0)
        along = np.concatenate([[0.0], np.cumsum(np.hypot(step[:, 0], step[:, 1]))])
        heading = np.arctan2(step[:, 1], step[:, 0])
        inside: list[set[str]] = [set() for _ in points]
        covered: list[tuple[int, str, str]] = []
        rows, _, owners = self._roads.overlapped_lanes(points[:, 0].copy(), points[:, 1].copy(), heights)
        for row, owner in zip(rows.tolist(), owners.tolist(), strict=True):
            junction = self._junction[row]
            if junction is not None:
                inside[owner].add(junction)
                if junction in self._priorities:
                    covered.append((owner, junction, self._road[row]))
        signs = list(places_along(self._lines_near(points), points, heights))
        found = [self._passage(*run, along, heading, signs) for run in _runs(inside)]
        if not covered:
            return tuple(found)
        roads = [_followed_road(*run, covered) for run in _runs(inside)]
        return tuple([passage._replace(road=road) for passage, road in zip(found, roads, strict=True)])

    def _lines_near(self, points: Array) -> list[StopLine]:
        """Return the stop lines in the extent of a way (M, 2)."""
        (left, bottom), (right, top) = points.min(axis=0) - NEAR, points.max(axis=0) + NEAR
        return [line for line in self._lines if left <= line.x <= right and bottom <= line.y <= top]

    def _passage(
        self,
        junction: str,
        first: int,
        last: int,
        along: Array,
        heading: Array,
        signs: list[tuple[float, StopLine]],
    ) -> Passage:
        start, end = float(along[first]), float(along[last])
        here = [line for place, line in signs if start - BEFORE_ENTRY <= place <= start + BEYOND_ENTRY]
        before = float(heading[max(first - 1, 0)])
        turn = float(wrap_angle(float(heading[min(last, len(heading) - 1)]) - before))
        return Passage(
            junction,
            start,
            end,
            before,
            turn,
            any(line.kind != "light" for line in here),
            any(line.kind == "light" for line in here),
        )

    def gives_way(self, own: Passage, other: Passage) -> bool:
        """Return whether traffic on one passage gives way to traffic on another one of the same junction.

        The order of precedence: lights, signs, priorities of the map, priority to the right, oncoming traffic before
        left turns. In countries with traffic on the left the sides are exchanged.
        """
        side = 1.0 if self._keeps_right else -1.0
        relation = side * float(wrap_angle(other.heading - own.heading))
        own_turn, other_turn = side * own.turn, side * other.turn
        if own.gives_way != other.gives_way and not own.has_light:
            return own.gives_way
        by_map = None if own.has_light else self._yields_by_map(own, other)
        if by_map is not None:
            return by_map
        if abs(relation) >= OPPOSITE:
            return own_turn > TURNING and other_turn <= TURNING
        if own.has_light or abs(relation) <= ALIKE:
            return False
        return relation > 0.0

    def may_cross(self, own: Passage, other: Passage) -> bool:
        """Return whether traffic that cannot be seen may cross on another passage of the same junction.

        Lights are not considered. Traffic that a sign, a priority of the map or its left turn holds gives way; priority
        to the right is not relied upon, as it holds back only drivers who see the vehicle.
        """
        side = 1.0 if self._keeps_right else -1.0
        relation = abs(float(wrap_angle(other.heading - own.heading)))
        if relation <= ALIKE or (other.gives_way and not own.gives_way):
            return False
        by_map = self._yields_by_map(own, other) if own.gives_way == other.gives_way else None
        if by_map is not None:
            return by_map
        if relation >= OPPOSITE:
            return side * own.turn > TURNING and side * other.turn <= TURNING
        return True

    def _yields_by_map(self, own: Passage, other: Passage) -> bool | None:
        """Return whether a priority of the map holds `own` for `other`; None if the map has none for both."""
        if own.road is None or other.road is None:
            return None
        known = self._priorities.get(own.junction, frozenset())
        yields, precedes = (other.road, own.road) in known, (own.road, other.road) in known
        return None if yields == precedes else yields


def _followed_road(junction: str, first: int, last: int, covered: list[tuple[int, str, str]]) -> str | None:
    """Return the connecting road that covers most points of a stay in a junction; None without priorities there.

    covered  points on connecting roads: index, junction and road
    """
    counts = Counter(road for owner, name, road in covered if name == junction and first <= owner <= last)
    return max(counts, key=lambda road: (counts[road], road), default=None)


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
