"""Criterion: time off the road."""

from __future__ import annotations

from eidrive_criteria.folds import SummedCriterion, SummedSettings
from eidrive_scenario.api.common import WorldView

ALLOWED = frozenset({"driving", "parking"})


class OffRoadSettings(SummedSettings):
    """Settings: `{of: Ego, at_most: 0}` [s]."""


class OffRoad(SummedCriterion):
    """Criterion that fails if the center of the actor is on no drivable or parking lane for longer than `at_most`."""

    settings_type = OffRoadSettings
    name = "off_road"
    unit = "s"
    state = "left the road"

    def increment(self, view: WorldView, row: int, duration: float, distance: float) -> float | None:
        location = self.lanes.under_center(view, row)
        if location is not None:
            lane = self.lanes.lane(location)
            if lane.drivable or lane.type in ALLOWED:
                return None
        x, y, *_ = view.plain_boxes[row]
        (types,) = self.lanes.types_at([(x, y, view.states[row].z)])
        return None if types & ALLOWED else duration
