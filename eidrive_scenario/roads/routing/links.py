"""Links of lanes within a road, between roads, and through junctions; number of lanes between two places.

Links are stored in both directions, as a file may specify them at either end.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from eidrive_scenario.roads.model.location import LaneKey, LaneLocation
from eidrive_scenario.roads.model.road_map import Connection, Contact, Junction, LaneSection, Road, RoadLink, RoadMap

FAR = 200
"""Maximum number of lanes in the search for the continuation of a lane."""


@dataclass(frozen=True)
class LaneEnd:
    """End of a lane of a lane section; side +1 is its end in s, -1 its start."""

    lane: LaneKey
    side: int


@dataclass(frozen=True)
class RoadEnd:
    """End of a road; side +1 is its end in s, -1 its start."""

    road: str
    side: int


class LaneLinks:
    """Links between lane ends and between road ends."""

    def __init__(self, road_map: RoadMap) -> None:
        self._roads: Mapping[str, Road] = road_map.roads
        self._lanes: dict[LaneEnd, dict[LaneEnd, None]] = {}
        self._ends: dict[RoadEnd, dict[RoadEnd, None]] = {}
        for road in road_map.roads.values():
            self._link_sections(road)
        for junction in road_map.junctions.values():
            for connection in junction.connections:
                self._link_connection(junction, connection)
        for road in road_map.roads.values():
            self._link_road(road, road.predecessor, -1)
            self._link_road(road, road.successor, 1)

    def beyond(self, lane: LaneKey, direction: int) -> Iterator[tuple[LaneKey, int]]:
        """Yield the lanes after leaving a lane in `direction` (+1 along s), with the direction of entry."""
        for other in self._lanes.get(LaneEnd(lane, direction), ()):
            yield other.lane, -other.side

    def continued(self, lane: LaneKey, road: str, section: int) -> int | None:
        """Return the lane of a road section that continues a lane or that it continues; None without one within FAR
        lanes."""
        if (lane.road, lane.section) == (road, section):
            return lane.lane
        open_ = deque((lane, direction) for direction in (1, -1))
        reached = {lane}
        while open_ and len(reached) < FAR:
            for following, way in self.beyond(*open_.popleft()):
                if (following.road, following.section) == (road, section):
                    return following.lane
                if following not in reached:
                    reached.add(following)
                    open_.append((following, way))
        return None

    def beyond_road(self, road: str, direction: int) -> Iterator[tuple[str, int]]:
        """Yield the roads after leaving a road in `direction`, with the direction of entry."""
        for other in self._ends.get(RoadEnd(road, direction), ()):
            yield other.road, -other.side

    def pairs(self) -> Iterator[tuple[LaneEnd, LaneEnd]]:
        """Yield linked ends of lanes, each pair once."""
        for end, others in self._lanes.items():
            for other in others:
                if (end.lane, end.side) < (other.lane, other.side):
                    yield end, other

    def _join(self, end: LaneEnd, other: LaneEnd) -> None:
        self._lanes.setdefault(end, {})[other] = None
        self._lanes.setdefault(other, {})[end] = None

    def _link_sections(self, road: Road) -> None:
        for before, after in zip(road.sections, road.sections[1:], strict=False):
            pairs = [(n, m) for n, lane in before.lanes.items() for m in lane.successors if m in after.lanes]
            pairs += [(n, m) for m, lane in after.lanes.items() for n in lane.predecessors if n in before.lanes]
            for n, m in pairs or [(n, n) for n in before.lanes if n in after.lanes]:
                end = LaneEnd(LaneKey(road.id, before.index, n), 1)
                self._join(end, LaneEnd(LaneKey(road.id, after.index, m), -1))

    def _link_road(self, road: Road, link: RoadLink | None, side: int) -> None:
        if link is None or link.element_type != "road" or not road.sections:
            return
        other = self._roads[link.element_id]
        if not other.sections:
            return
        contact = link.contact or _nearest_end(road, side, other)
        other_side = 1 if contact == "end" else -1
        lanes = end_section(road, side).lanes.items()
        pairs = [(n, m) for n, lane in lanes for m in (lane.successors if side > 0 else lane.predecessors)]
        self._join_roads(road, side, other, other_side, pairs)

    def _link_connection(self, junction: Junction, connection: Connection) -> None:
        incoming, connecting = self._roads[connection.incoming_road], self._roads[connection.connecting_road]
        if not incoming.sections or not connecting.sections:
            return
        other_side = 1 if connection.contact == "end" else -1
        side = side_at(incoming, junction, connecting, connection.contact)
        pairs = connection.lane_links or [(n, n) for n in end_section(incoming, side).lanes]
        self._join_roads(incoming, side, connecting, other_side, pairs)

    def _join_roads(
        self, road: Road, side: int, other: Road, other_side: int, pairs: Iterable[tuple[int, int]]
    ) -> None:
        """Join an end of a road to that of another one, and those of the pairs of their lanes that both have."""
        end, other_end = RoadEnd(road.id, side), RoadEnd(other.id, other_side)
        self._ends.setdefault(end, {})[other_end] = None
        self._ends.setdefault(other_end, {})[end] = None
        section, facing = end_section(road, side), end_section(other, other_side)
        for n, m in pairs:
            if n in section.lanes and m in facing.lanes:
                lane, target = LaneKey(road.id, section.index, n), LaneKey(other.id, facing.index, m)
                self._join(LaneEnd(lane, side), LaneEnd(target, other_side))


def end_section(road: Road, side: int) -> LaneSection:
    """Return the lane section at an end of a road; side +1 is its end in s."""
    return road.sections[-1 if side > 0 else 0]


def side_at(incoming: Road, junction: Junction, connecting: Road, contact: Contact) -> int:
    """Return the end of the incoming road that is at the junction."""
    sides = [
        side
        for side, link in ((-1, incoming.predecessor), (1, incoming.successor))
        if link is not None and link.element_type == "junction" and link.element_id == junction.id
    ]
    if len(sides) == 1:
        return sides[0]
    return 1 if _nearest_end(connecting, 1 if contact == "end" else -1, incoming) == "end" else -1


def _nearest_end(road: Road, side: int, other: Road) -> Contact:
    """Return the end of `other` that is nearest to an end of `road`."""
    x, y, *_ = road.reference.at(road.length if side > 0 else 0.0)
    start, end = other.reference.at(0.0), other.reference.at(other.length)
    return "start" if math.hypot(start.x - x, start.y - y) <= math.hypot(end.x - x, end.y - y) else "end"


def lanes_between(roads: Mapping[str, Road], links: LaneLinks, a: LaneLocation, b: LaneLocation, runs: int) -> int:
    """Return the number of lanes from the lane of a to that of b, positive in the direction of t at a.

    Lanes are followed along their links. If that of b has no counterpart at a, the lanes at b are counted: from the
    continuation of the lane of a, else from that of the nearest lane beside it, first of those on its side of the road.
    Without any, the lanes keep their numbers.

    runs  1 if s at b increases in the direction of s at a, else -1
    """
    here, there = (roads[location.road].section_at(location.s) for location in (a, b))
    own = _rank(a.lane)
    beside = sorted((lane for lane in here.lanes if lane), key=lambda lane: (lane * a.lane < 0, abs(_rank(lane) - own)))
    for lane in beside:
        reached = links.continued(LaneKey(a.road, here.index, lane), b.road, there.index)
        if reached != b.lane and lane == a.lane:
            counterpart = links.continued(LaneKey(b.road, there.index, b.lane), a.road, here.index)
            if counterpart:
                return _rank(counterpart) - own
        if reached:
            return (_rank(b.lane) - _rank(reached)) * runs + _rank(lane) - own
    return _rank(b.lane * runs) - own


def _rank(lane: int) -> int:
    """Return the place of a lane among those of a section in the direction of t, without lane 0."""
    return lane if lane > 0 else lane + 1
