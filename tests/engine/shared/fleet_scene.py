"""Straight streets, cars and views of them, for tests of background traffic."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from opendrive_xml import lanes_xml, map_xml, road_xml

from eidrive_scenario.roads import LaneLocation, RoadNetwork
from eidrive_scenario.traffic import Fleet
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.view import WorldView

LENGTH, WIDTH, REAR_AXLE = 4.6, 1.9, 1.4
"""Size of the cars, and distance of the box center before the reference point [m]."""


def street(
    left: int = 0, right: int = 2, *, length: float = 1000.0, mark: str = "both", rule: str = "RHT", extra: str = ""
) -> RoadNetwork:
    """Return one straight road along x from 0 with lanes of 3.5 m on both sides."""
    lanes = lanes_xml(left, right, more=f'<roadMark sOffset="0" type="broken" laneChange="{mark}"/>')
    return RoadNetwork.parse(map_xml(road_xml(length=length, lanes=lanes, rule=rule, extra=extra)))


def car(name: str) -> ActorSpec:
    return ActorSpec(name, "car", "car", (LENGTH, WIDTH, 1.5), (REAR_AXLE, 0.0, 0.75), wheelbase=2.8, max_speed=60.0)


def add_car(
    fleet: Fleet, spec: ActorSpec, location: LaneLocation, *, speed: float = 0.0, desired_speed: float | None = None
) -> Placement:
    """Add a car to a fleet at the center line of a lane."""
    return fleet.add_at(spec, *fleet.lanes.of(location), speed=speed, desired_speed=desired_speed)


def view_of(placements: Mapping[str, Placement], time: float = 0.0, tick: int = 0) -> WorldView:
    """Return the view of cars at their placements."""
    rows = list(placements.values())
    count = len(rows)
    yaw, speed = np.array([p.yaw for p in rows]), np.array([p.speed for p in rows])
    return WorldView(
        time=time,
        tick=tick,
        names=tuple(placements),
        categories=("car",) * count,
        position=np.array([(p.x, p.y, p.z) for p in rows]).reshape(count, 3),
        yaw=yaw,
        pitch=np.zeros(count),
        roll=np.zeros(count),
        velocity=np.stack([speed * np.cos(yaw), speed * np.sin(yaw), 0.0 * yaw], axis=1).reshape(count, 3),
        acceleration=np.zeros((count, 3)),
        yaw_rate=np.zeros(count),
        speed=speed,
        size=np.tile((LENGTH, WIDTH, 1.5), (count, 1)),
        offset=np.tile((REAR_AXLE, 0.0, 0.75), (count, 1)),
    )
