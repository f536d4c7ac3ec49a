"""Criterion: distance driven against the direction of the lane."""

from __future__ import annotations

import math

from eidrive_criteria.folds import SummedCriterion, SummedSettings, exceeds
from eidrive_scenario.api.common import WorldView
from eidrive_scenario.api.criteria import LaneTracker

AGAINST = math.cos(math.radians(120.0))
"""Cosine of the angle between an actor and its lane from which on the lane is the wrong one."""
STILL = 0.02
"""Speed up to which an actor stands [m/s]: its movement is ignored."""


class WrongLaneSettings(SummedSettings):
    """Settings: `{of: Ego, at_most: 0}` [m]."""


class WrongLane(SummedCriterion):
    """Criterion that fails if the actor drives farther than `at_most` in a lane of the opposite direction.

    Its heading and the direction of the lane under its center differ by more than 120°. Junctions and lanes for both
    directions are excluded.
    """

    settings_type = WrongLaneSettings
    name = "wrong_lane"
    unit = "m"
    state = "drove against the direction of its lane"

    def increment(self, view: WorldView, row: int, duration: float, distance: float) -> float | None:
        against = drives_against_lane(self.lanes, view, row)
        return distance if against and exceeds(distance, STILL * duration) else None


def drives_against_lane(lanes: LaneTracker, view: WorldView, row: int) -> bool:
    """Return whether an actor is in a lane of the opposite direction, outside junctions and lanes for both."""
    location = lanes.under_center(view, row)
    if location is None or lanes.roads.road(location.road).junction_id is not None:
        return False
    lane = lanes.lane(location)
    if not lane.drivable or lane.type == "bidirectional" or lane.direction == "both":
        return False
    return math.cos(view.states[row].yaw - lanes.roads.pose(location).h) < AGAINST
