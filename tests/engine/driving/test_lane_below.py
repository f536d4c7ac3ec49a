"""Lane of a vehicle that starts where lanes overlap: in a junction, and on or below a bridge."""

from __future__ import annotations

import math

import numpy as np
import pytest
from opendrive_xml import elevation_xml, map_xml, road_xml
from planned_drive import detections
from signal_street import CAR

from eidrive_scenario.driving.planning.path import lane_below
from eidrive_scenario.driving.planning.route_planner import RoutePlanner
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.extensions.library import library_path
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import EgoState


def state(x: float, y: float, yaw: float, z: float = 0.0) -> EgoState:
    return EgoState(0.0, np.array([x, y, z]), yaw, 0.0, 0.0, 8.0, 0.0, 0.0)


def end_of_plan(roads: RoadNetwork, ego: EgoState) -> np.ndarray:
    planner = RoutePlanner(AgentSettings(target_speed=8.0), CAR, roads, dt=0.05, seed=0)
    return np.asarray(planner.plan(ego, detections(0.0), None, 0.0).points[-1])


@pytest.fixture(scope="module")
def junction() -> RoadNetwork:
    """Return a junction about (42, 1.75) with a lane of 3.5 m in each direction on its four arms."""
    return RoadNetwork.load(library_path() / "roads/four_way_junction.xodr")


@pytest.mark.parametrize("turn", [-0.3, 0.0, 0.3])
@pytest.mark.parametrize(
    ("x", "y", "yaw"),
    [(42.0, 0.0, 0.0), (42.0, 3.5, math.pi), (43.75, 1.75, math.pi / 2.0), (40.25, 1.75, -math.pi / 2.0)],
)
def test_vehicle_in_a_junction_follows_the_lane_along_its_heading(
    junction: RoadNetwork, x: float, y: float, yaw: float, turn: float
) -> None:
    """The connecting roads straight ahead lead from each arm to the opposite one, whose lane is straight on."""
    place = lane_below(junction, state(x, y, yaw + turn))
    assert place is not None
    end = end_of_plan(junction, state(x, y, yaw + turn))
    ahead, aside = math.cos(yaw), math.sin(yaw)
    assert (end[0] - x) * ahead + (end[1] - y) * aside > 30.0
    assert abs((end[1] - y) * ahead - (end[0] - x) * aside) < 0.2


@pytest.mark.parametrize(("bridge", "ground"), [("1", "2"), ("2", "1")])
def test_vehicle_where_a_bridge_crosses_follows_its_own_road(bridge: str, ground: str) -> None:
    """Road 1 leads along x, road 2 along y. Their right lanes overlap at (150 + 1.75, -1.75)."""
    heights = {bridge: 6.5, ground: 0.0}
    along = road_xml("1", length=300.0, profiles=elevation_xml(heights["1"], 0.0))
    across = road_xml(
        "2", length=300.0, x=150.0, y=-150.0, hdg=math.pi / 2.0, profiles=elevation_xml(heights["2"], 0.0)
    )
    roads = RoadNetwork.parse(map_xml(along, across))
    for road, yaw in (("1", 0.0), ("2", math.pi / 2.0)):
        for turn in (-0.7, 0.0, 0.7):
            place = lane_below(roads, state(151.75, -1.75, yaw + turn, heights[road]))
            assert place is not None
            assert place.road == road
