"""Lane on which a vehicle is, where several overlap."""

from __future__ import annotations

import math

import numpy as np

from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.perception.traffic_lights import OTHER_LEVEL
from eidrive_scenario.roads import LaneLocation, RoadNetwork
from eidrive_scenario.sensing.readings import EgoState

ALIGNED = 0.6
"""Maximum angle between the headings of a vehicle and of the lane that it follows [rad]."""


def lane_below(roads: RoadNetwork, ego: EgoState) -> LaneLocation | None:
    """Return the lane of a vehicle, or None if no road is near.

    The nearest lane may be that of a road above or below, or of crossing traffic in a junction. Then the overlapping
    lane on the level of the vehicle is selected whose traffic drives closest to its heading, if it is aligned.
    """
    x, y, z = ego.position.tolist()
    place = roads.locate_at(x, y)
    if place is None:
        return None
    is_level = _is_level(roads, place, z)
    if is_level and _angle(roads, place, ego.yaw) <= ALIGNED:
        return place
    height = None if roads.is_level else np.array([z])
    rows, along, _ = roads.overlapped_lanes(np.array([x]), np.array([y]), height)
    keys = [key for key, _ in roads.tables.lane_keys()]
    found = [
        roads.location(keys[row].road, keys[row].lane, s)
        for row, s in zip(rows.tolist(), along.tolist(), strict=True)
        if roads.tables.lane_drivable[row]
    ]
    found = [one for one in found if _is_level(roads, one, z)]
    best = min(found, key=lambda one: _angle(roads, one, ego.yaw), default=place)
    return best if not is_level or _angle(roads, best, ego.yaw) <= ALIGNED else place


def _is_level(roads: RoadNetwork, place: LaneLocation, z: float) -> bool:
    """Return whether a lane is on the level of a vehicle at height z [m]."""
    return roads.is_level or abs(roads.road_pose_at(place.road, place.s, place.t).z - z) <= OTHER_LEVEL


def _angle(roads: RoadNetwork, place: LaneLocation, yaw: float) -> float:
    """Return the angle between a heading and the driving direction of a lane [rad]."""
    heading = roads.lane_pose_at(place.road, place.lane, place.s).h
    if roads.driving_direction(place.road, place.lane) < 0:
        heading += math.pi
    return abs(float(wrap_angle(yaw - heading)))
