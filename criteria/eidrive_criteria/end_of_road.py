"""Criterion: time at the end of the road."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from eidrive_criteria.folds import SummedCriterion, SummedSettings
from eidrive_scenario.api.common import EPSILON, LaneKey, WorldView


class EndOfRoadSettings(SummedSettings):
    """Settings: `{of: Ego, within: 1.0, at_most: 0}` with the distance within [m] and the time at_most [s]."""

    within: Annotated[float, Field(ge=0)] = 1.0


class EndOfRoad(SummedCriterion):
    """Criterion that fails if the front of the actor is at an end of its lane without continuation.

    The distance to the end is at most `within`, for longer than `at_most`. An actor that stands with its back to the
    end is not at the end.
    """

    settings_type = EndOfRoadSettings
    name = "end_of_road"
    unit = "s"
    state = "was at the end of its road"

    def __init__(self, settings: EndOfRoadSettings) -> None:
        super().__init__(settings)
        self._within = settings.within

    def increment(self, view: WorldView, row: int, duration: float, distance: float) -> float | None:
        location, roads = self.lanes.center(view, row), self.lanes.roads
        if location is None:
            return None
        road, key = roads.road(location.road), self.lanes.key(location)
        _, _, _, length, _, _, yaw = view.plain_boxes[row]
        ahead = math.cos(yaw - roads.road_pose_at(location.road, location.s).h)
        direction = 1 if ahead >= 0.0 else -1
        section = road.sections[key.section]
        left = section.end - location.s if direction > 0 else location.s - section.s
        front = abs(ahead) * length / 2.0
        return duration if self._ends(key, direction, left - front) else None

    def _ends(self, lane: LaneKey, direction: int, left: float) -> bool:
        """Return whether all ways along a lane, of which `left` [m] are ahead of the front, end within the distance."""
        roads, ends = self.lanes.roads, False
        ways, reached = [(lane, direction, left)], {(lane, direction)}
        while ways:
            lane, direction, left = ways.pop()
            if left > self._within + EPSILON:
                return False
            following = list(roads.links.beyond(lane, direction))
            ends = ends or not following
            for way in following:
                if way not in reached:
                    reached.add(way)
                    section = roads.road(way[0].road).sections[way[0].section]
                    ways.append((*way, left + section.end - section.s))
        return ends
