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

    The distance to the end along the center of the lane is at most `within`, for longer than `at_most`. An actor that
    stands with its back to the end is not at the end.
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
        _, _, _, length, _, _, yaw = view.plain_boxes[row]
        ahead = math.cos(yaw - roads.road_pose_at(location.road, location.s).h)
        direction = 1 if ahead >= 0.0 else -1
        reach = abs(ahead) * length / 2.0 + self._within + EPSILON
        return duration if self._ends(self.lanes.key(location), location.s, direction, reach) else None

    def _ends(self, lane: LaneKey, s: float, direction: int, reach: float) -> bool:
        """Return whether all ways from s along the center of a lane end within `reach` [m]."""
        roads, ends = self.lanes.roads, False
        ways, reached = [(lane, s, direction, reach)], {(lane, direction)}
        while ways:
            lane, s, direction, reach = ways.pop()
            rest = roads.movement.rest(lane, s, direction, reach)
            if not rest:
                return False
            following = list(roads.links.beyond(lane, direction))
            ends = ends or not following
            for other, onward in following:
                if (other, onward) not in reached:
                    reached.add((other, onward))
                    section = roads.road(other.road).sections[other.section]
                    ways.append((other, section.s if onward > 0 else section.end, onward, rest))
        return ends
