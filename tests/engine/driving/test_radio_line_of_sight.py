"""Line-of-sight states between antennas on actors."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import pytest
from opendrive_xml import elevation_xml, map_xml, road_xml
from sample_car import CAR

from eidrive_scenario.driving.communication.radio_line_of_sight import (
    Place,
    antenna_position,
    line_of_sight_states,
    radio_environment,
)
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.v2x.radio_environment import LOS, NLOS, NLOSV
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.appearance import Appearance, Visibility


@pytest.fixture
def world() -> Iterator[World]:
    """Level world."""
    with World() as created:
        yield created


def of_height(name: str, height: float) -> ActorSpec:
    """Return a car of this height."""
    length, width, _ = CAR.size
    return dataclasses.replace(CAR, name=name, size=(length, width, height), offset=(1.4, 0.0, height / 2.0))


def roofs(world: World, *names: str) -> dict[str, Place]:
    """Return antennas on the roofs of actors."""
    return {name: antenna_position(world.view(), world.spec(name), None) for name in names}


def both_ways(world: World, places: dict[str, Place]) -> set[tuple[int, tuple[str, ...]]]:
    """Return state and blocking actors from A to B and back, alone and among many pairs."""
    found: set[tuple[int, tuple[str, ...]]] = set()
    for pair in (("A", "B"), ("B", "A")):
        for count in (1, 40):
            states = line_of_sight_states(world, places, [pair] * count)
            found |= {(int(state), states.blockers.get(0, ())) for state in states.states}
    return found


@pytest.mark.parametrize("yaw", [0.0, 0.1, -1.8, 3.0])
@pytest.mark.parametrize("heights", [(1.49, 1.49), (1.49, 1.7), (1.9, 1.49), (3.5, 1.49)])
def test_truck_blocks_antennas_on_roofs_at_all_headings(world: World, yaw: float, heights: tuple[float, float]) -> None:
    """A ray of pybullet hits the roof at which it begins again and again for half a meter."""
    world.add(of_height("A", heights[0]), Placement(0.0, 0.0, yaw=yaw))
    world.add(of_height("B", heights[1]), Placement(100.0, 0.0, yaw=yaw))
    truck = dataclasses.replace(of_height("Truck", 5.0), size=(8.0, 8.0, 5.0), offset=(0.0, 0.0, 2.5))
    world.add(truck, Placement(50.0, 0.0, yaw=1.0 - yaw))
    places = roofs(world, "A", "B")
    assert both_ways(world, places) == {(NLOSV, ("Truck",))}
    assert line_of_sight_states(world, places, [("A", "B")]).heights.tolist() == [5.0]


@pytest.mark.parametrize("yaw", [0.0, 0.3, 1.3, -2.5])
def test_cars_of_one_height_do_not_block_each_other(world: World, yaw: float) -> None:
    for number, name in enumerate("ACDB"):
        world.add(of_height(name, 1.5), Placement(20.0 * number, 0.0, yaw=yaw))
    assert both_ways(world, roofs(world, "A", "B")) == {(LOS, ())}


def test_lower_car_blocks_where_the_line_is_below_its_roof(world: World) -> None:
    for name, x, height in (("A", 0.0, 3.5), ("Near", 20.0, 1.7), ("Far", 88.0, 1.7), ("B", 100.0, 1.4)):
        world.add(of_height(name, height), Placement(x, 0.0))
    assert both_ways(world, roofs(world, "A", "B")) == {(NLOSV, ("Far",))}


def test_actors_behind_a_building_are_not_counted(world: World) -> None:
    for name, x in (("A", 0.0), ("Front", 20.0), ("Behind", 80.0), ("B", 100.0)):
        world.add(of_height(name, 1.5), Placement(x, 0.0))
    world.add_building("House", (50.0, 0.0, 5.0), (10.0, 10.0, 10.0))
    states = line_of_sight_states(world, {"A": (0.0, 0.0, 1.2), "B": (100.0, 0.0, 1.2)}, [("A", "B"), ("B", "A")])
    assert states.states.tolist() == [NLOS, NLOS]
    assert states.blockers == {0: ("Front",), 1: ("Behind",)}


def test_actors_that_are_hidden_from_sensors_do_not_block(world: World) -> None:
    for name, x in (("A", 0.0), ("Truck", 50.0), ("B", 100.0)):
        world.add(of_height(name, 4.0 if name == "Truck" else 1.5), Placement(x, 0.0))
    assert both_ways(world, roofs(world, "A", "B")) == {(NLOSV, ("Truck",))}
    world.set_display_state({}, {"Truck": Appearance(visibility=Visibility(sensors=False))})
    assert both_ways(world, roofs(world, "A", "B")) == {(LOS, ())}


def test_first_sixteen_blocking_actors_are_named(world: World) -> None:
    for number in range(30):
        world.add(of_height(f"Car {number}", 2.0), Placement(20.0 + 10.0 * number, 0.0))
    places: dict[str, Place] = {"A": (0.0, 0.0, 1.0), "B": (400.0, 0.0, 1.0)}
    assert both_ways(world, places) == {
        (NLOSV, tuple(f"Car {number}" for number in range(16))),
        (NLOSV, tuple(f"Car {number}" for number in reversed(range(14, 30)))),
    }


def test_stations_at_one_place_have_a_line_of_sight(world: World) -> None:
    world.add(of_height("A", 1.5), Placement(0.0, 0.0))
    world.add(of_height("B", 1.5), Placement(0.0, 0.0))
    assert both_ways(world, {"A": (0.0, 0.0, 1.5), "B": (0.0, 0.0, 1.5)}) == {(LOS, ())}
    assert line_of_sight_states(world, {}, []).states.tolist() == []


def test_hill_between_antennas_blocks() -> None:
    """The road is 10 m high in the middle, and 1.9 m at the antennas."""
    hill = road_xml(length=200.0, profiles=elevation_xml(slope=0.2, curvature=-0.001))
    places: dict[str, Place] = {"A": (10.0, -2.0, 3.4), "B": (190.0, -2.0, 3.4), "Tower": (190.0, -2.0, 40.0)}
    with World(RoadNetwork.parse(map_xml(hill))) as world:
        world.add(of_height("Car", 1.5), Placement(100.0, -2.0, 10.0))
        states = line_of_sight_states(world, places, [("A", "B"), ("B", "A"), ("B", "Tower")] * 20)
    assert states.states.tolist() == [NLOS, NLOS, LOS] * 20


def on_slope(grade: float) -> tuple[float, Sequence[float]]:
    """Return the heights of a van and of the antennas of two cars around it, on a road of this grade [m]."""
    roads = RoadNetwork.parse(map_xml(road_xml(length=300.0, profiles=elevation_xml(slope=grade))))
    with World(roads) as world:
        for name, x, height in (("A", 100.0, 1.5), ("Van", 130.0, 2.5), ("B", 160.0, 1.5)):
            pose = roads.lane_pose_at("1", -1, x)
            world.add(of_height(name, height), Placement(pose.x, pose.y, pose.z, pose.h, pose.p, pose.r))
        stations = [(world.spec(name), None) for name in "AB"]
        environment = radio_environment(world, world.view(), stations, roads)
        assert environment.sight is not None
        return environment.sight([("A", "B")]).heights[0], environment.heights.tolist()


@pytest.mark.parametrize("grade", [-0.12, -0.05, 0.05, 0.12])
def test_heights_on_a_slope_are_above_the_road(grade: float) -> None:
    top, antennas = on_slope(grade)
    level_top, level_antennas = on_slope(0.0)
    assert top == pytest.approx(level_top, abs=0.05)
    assert antennas == pytest.approx(level_antennas, abs=0.05)
