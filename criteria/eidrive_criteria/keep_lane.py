"""Criterion: number of lane changes."""

from __future__ import annotations

from eidrive_criteria.folds import SummedCriterion, SummedSettings
from eidrive_scenario.api.common import LaneLocation, WorldView


class KeepLaneSettings(SummedSettings):
    """Settings: `{of: Ego, at_most: 0}` lane changes."""


class KeepLane(SummedCriterion):
    """Criterion that fails if the center of the actor crosses the edge of its lane more than `at_most` times.

    Leaving all lanes and coming back counts once each. The end of a lane, and the choice of a branch in a junction, do
    not count.
    """

    settings_type = KeepLaneSettings
    name = "keep_lane"
    state = "crossed the edge of its lane"

    def __init__(self, settings: KeepLaneSettings) -> None:
        super().__init__(settings)
        self._before: LaneLocation | None = None
        self._has_previous = False

    def interrupt(self) -> None:
        super().interrupt()
        self._has_previous = False

    def increment(self, view: WorldView, row: int, duration: float, distance: float) -> float | None:
        location = self.lanes.center(view, row)
        before, has_previous = self._before, self._has_previous
        self._before, self._has_previous = location, True
        if not has_previous or self._same_lane(before, location):
            return None
        return 1.0

    def _same_lane(self, before: LaneLocation | None, now: LaneLocation | None) -> bool:
        if before is None or now is None:
            return before is now
        first, second = self.lanes.key(before), self.lanes.key(now)
        if first == second:
            return True
        roads = self.lanes.roads
        if any(second == following for way in (1, -1) for following, _ in roads.links.beyond(first, way)):
            return True
        # A step may pass several lanes of short sections or roads.
        continued = roads.links.continued(first, second.road, second.section)
        if continued == second.lane:
            return True
        if first.road == second.road:
            return continued is None and abs(first.section - second.section) > 1
        return any(roads.road(key.road).junction_id is not None for key in (first, second))
