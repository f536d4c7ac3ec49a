"""Lane changes that a route requires: before the end of a road, to a lane that leads to its next road."""

from __future__ import annotations

from typing import NamedTuple

from eidrive_scenario.roads import LaneKey, LaneLocation, RoadNetwork, Route
from eidrive_scenario.roads.geometry.poses import lane_t
from eidrive_scenario.roads.routing.route import LANE_CHANGE_LENGTH, smoothstep

MIN_LANE_CHANGE_LENGTH = 1.0
"""Minimum length of a lane change [m]."""


class LaneChange(NamedTuple):
    """Lane change within one lane section.

    s       start [m]
    span    length [m]
    offset  offset from the lane center that is kept [m]
    """

    road: str
    section: int
    before: int
    after: int
    s: float
    span: float
    offset: float


class RouteLanes:
    """Lateral motion of an actor that keeps it on its route."""

    def __init__(self, roads: RoadNetwork) -> None:
        self._roads = roads
        self._queried: tuple[Route, int, str, int] | None = None
        self._leading: list[frozenset[int]] = []
        self._change: LaneChange | None = None

    def forget(self) -> None:
        """Discard the current lane change, as another source moves the actor laterally."""
        self._change = None

    def step(self, here: LaneLocation, distance: float, route: Route, visit: int) -> tuple[int, float, bool] | None:
        """Return lane, offset from its center after `distance` [m], and whether the lane change is complete.

        Return None if the lane is kept. The actor moves in driving direction, on road number `visit` of the route.
        """
        road = self._roads.roads[here.road]
        section = road.section_at(here.s)
        way = self._roads.driving_direction(here.road, here.lane)
        change = self._change
        if change is None or (change.road, change.section) != (here.road, section.index):
            change = self._change = self._required_change(here, section.index, way, route, visit)
            if change is None:
                return None
        s = min(max(here.s + way * distance, section.s), section.end)
        part = min(abs(s - change.s) / change.span, 1.0)
        lanes = (section.lanes[change.before], section.lanes[change.after])
        before, after = (lane_t(road, section, lane, s)[0] for lane in lanes)
        done = part >= 1.0
        if done:
            self._change = None
        offset = change.offset + smoothstep(part) * (after - before)
        return (change.after, offset + before - after, done) if part > 0.5 else (change.before, offset, done)

    def _required_change(
        self, here: LaneLocation, section: int, way: int, route: Route, visit: int
    ) -> LaneChange | None:
        query = (route, visit, here.road, way)
        if self._queried is None or self._queried[0] is not route or self._queried[1:] != query[1:]:
            self._queried, self._leading = query, self._lanes_to_next(here.road, way, route, visit)
        leading = self._leading[section] if section < len(self._leading) else frozenset()
        if not leading or here.lane in leading:
            return None
        road = self._roads.roads[here.road]
        lane_section = road.sections[section]
        nearest = min(leading, key=lambda lane: abs(lane - here.lane))
        rest = lane_section.end - here.s if way > 0 else here.s - lane_section.s
        rest_of_road = road.length - here.s if way > 0 else here.s
        wanted = LANE_CHANGE_LENGTH * abs(nearest - here.lane)
        if rest_of_road > wanted and (rest_of_road == rest or self._has_successor(here, section, way)):
            return None
        if rest < MIN_LANE_CHANGE_LENGTH:
            return None
        return LaneChange(here.road, section, here.lane, nearest, here.s, min(wanted, rest), here.offset)

    def _has_successor(self, here: LaneLocation, section: int, way: int) -> bool:
        key = LaneKey(here.road, section, here.lane)
        return any(other.road == here.road for other, _ in self._roads.links.beyond(key, way))

    def _lanes_to_next(self, road_id: str, way: int, route: Route, visit: int) -> list[frozenset[int]]:
        """Return for each lane section of a road the lanes that are linked to the next road of the route."""
        road, following = self._roads.roads[road_id], route.passes(visit + 1)
        if following is None or route.passes(visit) != road_id:
            return []
        leading: list[frozenset[int]] = [frozenset()] * len(road.sections)
        for section in reversed(road.sections) if way > 0 else road.sections:
            found = set()
            for lane in section.lanes.values():
                if lane.id == 0 or not lane.drivable or self._roads.driving_direction(road_id, lane.id) != way:
                    continue
                for key, _ in self._roads.links.beyond(LaneKey(road_id, section.index, lane.id), way):
                    inside = key.road == road_id and key.section == section.index + way
                    if key.lane in leading[key.section] if inside else key.road == following:
                        found.add(lane.id)
            leading[section.index] = frozenset(found)
        return leading
