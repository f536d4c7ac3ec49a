"""Criterion: time on a sidewalk."""

from __future__ import annotations

from eidrive_criteria.folds import SummedCriterion, SummedSettings
from eidrive_scenario.api.common import WorldView
from eidrive_scenario.api.criteria import SIDEWALKS, corners


class OnSidewalkSettings(SummedSettings):
    """Settings: `{of: Ego, at_most: 0}` [s]."""


class OnSidewalk(SummedCriterion):
    """Criterion that fails if the actor is on a sidewalk for longer than `at_most`.

    It is on a sidewalk with its center, or with a corner while no corner is on a drivable lane.
    """

    settings_type = OnSidewalkSettings
    name = "on_sidewalk"
    unit = "s"
    state = "was on a sidewalk"

    def increment(self, view: WorldView, row: int, duration: float, distance: float) -> float | None:
        location = self.lanes.under_center(view, row)
        if location is not None and self.lanes.lane(location).drivable:
            return None
        x, y, *_ = view.plain_boxes[row]
        center, *outline = self.lanes.types_at([(x, y, view.states[row].z), *corners(view, row)])
        if center & SIDEWALKS and "driving" not in center:
            return duration
        beside = any(types & SIDEWALKS for types in outline) and not any("driving" in types for types in outline)
        return duration if beside else None
