"""Sensors of vehicles on slopes and banked roads, whose bodies are not upright."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator

import numpy as np
import pytest
from opendrive_xml import elevation_xml, map_xml, road_xml, superelevation_xml
from sample_car import CAR

from eidrive_scenario.base.geometry import rotation_matrix
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.sensing.settings import LidarSettings, TruthSettings
from eidrive_scenario.sensing.truth import TruthSensor, few_visibilities, visibilities
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement

BUS = dataclasses.replace(
    CAR, name="Ego", category="bus", size=(12.0, 2.55, 3.2), offset=(3.2, 0.0, 1.6), wheelbase=6.0
)
SLOPES = [
    elevation_xml(),
    elevation_xml(slope=0.06),
    elevation_xml(slope=-0.06),
    elevation_xml(slope=0.15),
    superelevation_xml(0.08),
    elevation_xml(slope=0.08) + superelevation_xml(-0.06),
]


@pytest.fixture(params=SLOPES, ids=["level", "up", "down", "steep", "banked", "both"])
def roads(request: pytest.FixtureRequest) -> RoadNetwork:
    """Straight road of 300 m along x with this profile."""
    return RoadNetwork.parse(map_xml(road_xml(length=300.0, profiles=request.param)))


@pytest.fixture(params=[BUS, dataclasses.replace(CAR, name="Ego")], ids=["bus", "car"])
def world(request: pytest.FixtureRequest, roads: RoadNetwork) -> Iterator[World]:
    """An ego at 100 m and a car 20 m ahead, in one lane."""
    ego: ActorSpec = request.param
    with World(roads) as created:
        for spec, s in ((ego, 100.0), (dataclasses.replace(CAR, name="Car"), 120.0)):
            pose = roads.lane_pose_at("1", -1, s)
            created.add(spec, Placement(pose.x, pose.y, pose.z, pose.h, pose.p, pose.r))
        yield created


def test_truth_sensor_detects_a_car_in_plain_sight(world: World) -> None:
    truth = Rig(world.spec("Ego"), {"truth": TruthSettings()}).read(world, world.view()).truth
    assert truth is not None
    assert truth.names == ("Car",)
    assert truth.visibility.tolist() == [1.0]


def test_lidar_does_not_measure_the_own_body_and_measures_the_car(world: World) -> None:
    settings = LidarSettings(channels=32, points_per_second=32 * 360 * 20, range_noise=0.0, dropoff=0.0)
    view = world.view()
    cloud = Rig(world.spec("Ego"), {"lidar": settings}).read(world, view).lidars["lidar"]
    points = cloud.world_points
    inside = []
    for row in (0, 1):
        turn = rotation_matrix(view.yaw[row], view.pitch[row], view.roll[row])
        place = (points - view.position[row]) @ turn - view.offset[row]
        inside.append(int((np.abs(place) <= view.size[row] / 2.0 + 0.05).all(axis=1).sum()))
    assert inside[0] == 0
    assert inside[1] >= 5 or world.spec("Ego").category == "bus"  # whose roof hides the car from its lidar


def test_rays_near_the_own_body_are_not_lost(roads: RoadNetwork) -> None:
    """In the frame of the road, a bus on a slope measures the road behind it as on a level road."""
    ranges = []
    for network in (roads, RoadNetwork.parse(map_xml(road_xml(length=300.0)))):
        with World(network) as world:
            pose = network.lane_pose_at("1", -1, 150.0)
            world.add(BUS, Placement(pose.x, pose.y, pose.z, pose.h, pose.p, pose.r))
            settings = LidarSettings(channels=32, points_per_second=32 * 360 * 20, range_noise=0.0, dropoff=0.0)
            cloud = Rig(BUS, {"lidar": settings}).read(world, world.view()).lidars["lidar"]
            near = np.linalg.norm(cloud.points, axis=1) < 80.0
            azimuth = np.arctan2(cloud.points[:, 1], cloud.points[:, 0])
            backward = np.abs(np.abs(azimuth) - math.pi) < 0.03  # within the width of the road
            ranges.append(np.linalg.norm(cloud.points[near & backward], axis=1))
    assert len(ranges[0]) == len(ranges[1]) > 2
    assert np.sort(ranges[0]) == pytest.approx(np.sort(ranges[1]), abs=0.02)


def test_truth_sensor_on_a_bridge_does_not_detect_a_car_below_it() -> None:
    """A bridge along y at a height of 6 m, 7 m wide: the lines from 7.9 m to the car below cross it at |x| < 3.2 m."""
    roads = road_xml(x=-50.0), road_xml("2", y=-50.0, hdg=math.pi / 2.0, profiles=elevation_xml(6.0))
    network = RoadNetwork.parse(map_xml(*roads))
    with World(network) as world:
        for name, road, s in (("Ego", "2", 45.0), ("Car", "1", 53.0)):
            pose = network.lane_pose_at(road, -1, s)
            world.add(dataclasses.replace(CAR, name=name), Placement(pose.x, pose.y, pose.z, pose.h))
        view = world.view()
        truth = TruthSensor(TruthSettings(), world.spec("Ego"))
        assert few_visibilities([truth], [0], [[1]], world, view) == [0.0]
        assert visibilities([truth], [0], [[1]], world, view) == [0.0]


@pytest.mark.parametrize("x", [0.0, 4e5])
def test_truth_sensor_below_a_bridge_does_not_detect_a_car_on_it(x: float) -> None:
    """The lines from 1.9 m at x = -9.5 m to the car, up to 7.4 m, cross the bridge at x > -3.2 m, within its 7 m."""
    roads = road_xml(x=x - 50.0), road_xml("2", x=x, y=-50.0, hdg=math.pi / 2.0, profiles=elevation_xml(6.0))
    network = RoadNetwork.parse(map_xml(*roads))
    with World(network) as world:
        for name, road, s in (("Ego", "1", 40.0), ("Car", "2", 45.0)):
            pose = network.lane_pose_at(road, -1, s)
            world.add(dataclasses.replace(CAR, name=name), Placement(pose.x, pose.y, pose.z, pose.h))
        view = world.view()
        truth = TruthSensor(TruthSettings(), world.spec("Ego"))
        assert few_visibilities([truth], [0], [[1]], world, view) == [0.0]
        assert visibilities([truth], [0], [[1]], world, view) == [0.0]
