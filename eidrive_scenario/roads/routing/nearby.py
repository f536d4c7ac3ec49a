"""Search for the lane at a point near a previous location: on its road or on adjacent roads."""

from __future__ import annotations

from collections.abc import Mapping

from eidrive_scenario.roads.geometry import poses
from eidrive_scenario.roads.model.location import LaneKey, LaneLocation
from eidrive_scenario.roads.model.road_map import Road
from eidrive_scenario.roads.routing.links import LaneLinks
from eidrive_scenario.roads.routing.movement import driving_direction


def locate_near(
    roads: Mapping[str, Road], links: LaneLinks, x: float, y: float, hint: LaneLocation
) -> LaneLocation | None:
    """Return the lane location of a point on the road of `hint` or on an adjacent one, or None if it is on neither."""
    road = roads[hint.road]
    location = _on(road, x, y, hint.s)
    if location is not None:
        return location
    for direction in (driving_direction(road, hint.lane), -driving_direction(road, hint.lane)):
        last = len(road.sections) - 1 if direction > 0 else 0
        ways = links.beyond(LaneKey(road.id, last, hint.lane), direction) if hint.lane else ()
        for other, way in ways:
            target = roads[other.road]
            found = _on(target, x, y, 0.0 if way > 0 else target.length)
            if found is not None:
                return found
    return None


def _on(road: Road, x: float, y: float, s: float) -> LaneLocation | None:
    s, t, beyond = poses.project(road, x, y, s)
    if beyond:
        return None
    section, lane, outside = poses.lane_beside(road, s, t)
    if outside:
        return None
    return LaneLocation(road.id, lane.id, s, t - poses.lane_t(road, section, lane, s)[0], t)
