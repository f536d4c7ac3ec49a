"""Lane changes that a route asks for: before the end of a road, into a lane that leads to the route's next road."""

from __future__ import annotations

from typing import NamedTuple

from eidrive_scenario.roads import LaneKey, LaneLocation, RoadNetwork, Route
from eidrive_scenario.roads.geometry.poses import lane_t
from eidrive_scenario.roads.routing.route import LANE_CHANGE_LENGTH, smoothstep

SHORTEST = 1.0
"""On less than this nobody changes lanes [m]."""


class LaneChange(NamedTuple):
    """From lane to lane within one lane section: where it begins, over how many meters, and the offset that stays."""

    road: str
    section: int
    before: int
    after: int
    s: float
    span: float
    offset: float


class RouteLanes:
    """What an actor does across its lane to stay on its route."""

    def __init__(self, roads: RoadNetwork) -> None:
        self._roads = roads
        self._asked: tuple[Route, int, str, int] | None = None
        self._leading: list[frozenset[int]] = []
        self._change: LaneChange | None = None

    def forget(self) -> None:
        """Somebody else moves the actor across its lane."""
        self._change = None

    def step(self, here: LaneLocation, distance: float, route: Route, visit: int) -> tuple[int, float, bool] | None:
        """The lane to count from, the offset to have in it after `distance` meters, and whether that is all.

        None where the lane is to be kept. The actor moves with the traffic, on the route's road number `visit`.
        """
        road = self._roads.roads[here.road]
        section = road.section_at(here.s)
        way = self._roads.driving_direction(here.road, here.lane)
        change = self._change
        if change is None or (change.road, change.section) != (here.road, section.index):
            change = self._change = self._needed(here, section.index, way, route, visit)
            if change is None:
                return None
        s = min(max(here.s + way * distance, section.s), section.end)
        part = min(abs(s - change.s) / change.span, 1.0)
        lanes = (section.lanes[change.before], section.lanes[change.after])
        before, after = (lane_t(road, section, lane, s)[0] for lane in lanes)
        done = part >= 1.0
        if done:
            self._change = None
        aside = change.offset + smoothstep(part) * (after - before)
        return (change.after, aside + before - after, done) if part > 0.5 else (change.before, aside, done)

    def _needed(self, here: LaneLocation, section: int, way: int, route: Route, visit: int) -> LaneChange | None:
        asked = (route, visit, here.road, way)
        if self._asked is None or self._asked[0] is not route or self._asked[1:] != asked[1:]:
            self._asked, self._leading = asked, self._lanes_to_next(here.road, way, route, visit)
        leading = self._leading[section] if section < len(self._leading) else frozenset()
        if not leading or here.lane in leading:
            return None
        road = self._roads.roads[here.road]
        stretch = road.sections[section]
        nearest = min(leading, key=lambda lane: abs(lane - here.lane))
        rest = stretch.end - here.s if way > 0 else here.s - stretch.s
        beyond = road.length - here.s if way > 0 else here.s
        wanted = LANE_CHANGE_LENGTH * abs(nearest - here.lane)
        if beyond > wanted and (beyond == rest or self._goes_on(here, section, way)):
            return None
        if rest < SHORTEST:
            return None
        return LaneChange(here.road, section, here.lane, nearest, here.s, min(wanted, rest), here.offset)

    def _goes_on(self, here: LaneLocation, section: int, way: int) -> bool:
        key = LaneKey(here.road, section, here.lane)
        return any(other.road == here.road for other, _ in self._roads.links.beyond(key, way))

    def _lanes_to_next(self, road_id: str, way: int, route: Route, visit: int) -> list[frozenset[int]]:
        """For each lane section of a road, the lanes from which links lead to the next road of the route."""
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
