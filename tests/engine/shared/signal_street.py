"""A straight street with traffic lights and stop signs, paths on it, and a car."""

from __future__ import annotations

import numpy as np
from opendrive_xml import map_xml, road_xml

from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.world.actor import ActorSpec

CAR = ActorSpec("Ego", "car", "car", (4.892, 1.837, 1.49), (1.4, 0.0, 0.745), wheelbase=2.85, max_steering=0.6)

SIGNAL = (
    '<signal s="{s}" t="{t}" id="{id}" name="" dynamic="{dynamic}" orientation="{orientation}" zOffset="{z}"'
    ' country="DE" type="{type}" subtype="-1" value="-1" height="0.9" width="0.34" hOffset="0"/>'
)


def light(name: str, s: float, *, orientation: str = "+") -> str:
    return SIGNAL.format(s=s, t=-4.5, id=name, dynamic="yes", orientation=orientation, z=2.5, type="1000001")


def stop_sign(name: str, s: float) -> str:
    return SIGNAL.format(s=s, t=-4.5, id=name, dynamic="no", orientation="+", z=2.0, type="206")


def street(*signals: str) -> RoadNetwork:
    """Return a straight road of 200 m along x with a lane in each direction."""
    return RoadNetwork.parse(map_xml(road_xml(length=200.0, extra=f"<signals>{''.join(signals)}</signals>")))


EAST = np.column_stack([np.arange(0.0, 200.0), np.full(200, -1.75)])
WEST = np.column_stack([np.arange(199.0, -1.0, -1.0), np.full(200, 1.75)])

ROUND = np.concatenate(
    [
        np.column_stack([np.arange(40.0, 160.0), np.full(120, -1.75)]),
        np.column_stack([np.full(40, 160.0), np.arange(-1.75, -41.75, -1.0)]),
        np.column_stack([np.arange(160.0, 40.0, -1.0), np.full(120, -41.75)]),
        np.column_stack([np.full(41, 40.0), np.arange(-41.75, -0.75)]),
    ]
)
"""Lap of 320 m that uses the street from x = 40 m to 160 m."""
