"""Stop lines on the path, states of visible signals, and vehicles that stop for them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import numpy as np
import pytest
from opendrive_xml import (
    junction_xml,
    lane_links_xml,
    lane_xml,
    lanes_xml,
    map_xml,
    predecessor_xml,
    road_xml,
    section_xml,
    successor_xml,
)
from signal_street import CAR, EAST, ROUND, SIGNAL, WEST, light, stop_sign, street

from eidrive_scenario.perception.traffic_lights import SignalsAhead, stop_lines
from eidrive_scenario.rendering import picture_maker
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import SignalReading
from eidrive_scenario.sensing.signals import SIGNAL_KINDS, SignalSensor
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement


def names(roads: RoadNetwork, path: np.ndarray, progress: float = 0.0) -> list[tuple[str, float]]:
    signals = SignalsAhead(roads)
    signals.follow(path)
    return [(one.signal, round(one.distance, 3)) for one in signals.ahead(progress)]


def test_stop_lines_apply_to_lanes_of_signal_direction() -> None:
    roads = street(light("east", 120.0), light("west", 60.0, orientation="-"), light("both", 150.0, orientation="none"))
    assert names(roads, EAST) == [("east", 120.0), ("both", 150.0)]
    assert names(roads, WEST) == [("both", 49.0), ("west", 139.0)]
    assert names(roads, EAST, 130.0) == [("both", 20.0)]
    assert names(roads, EAST + np.array([0.0, 8.0])) == []


def test_light_behind_a_change_of_lanes_stops_the_lane_at_the_entry() -> None:
    """Lane -1 of the connecting road is lane -2 from s = 10 m on, where the light of that lane stands."""
    sections = section_xml(right=lane_xml(-1, link=lane_links_xml(after=-2)))
    sections += section_xml(right=lane_xml(-1) + lane_xml(-2, link=lane_links_xml(before=-1)), s=10.0)
    lamp = light("inside", 15.0).replace("/>", '><validity fromLane="-2" toLane="-2"/></signal>')
    inner = road_xml(
        "2",
        length=20.0,
        x=50.0,
        link=predecessor_xml("1"),
        lanes=sections,
        extra=f"<signals>{lamp}</signals>",
        junction="9",
    )
    arm = road_xml("1", length=50.0, link=successor_xml(junction="9"))
    (line,) = stop_lines(RoadNetwork.parse(map_xml(arm, inner, rest=junction_xml("9", "1", {"2": -1}))))
    assert (line.x, line.y) == (50.0, -1.75)


def test_stop_lines_exclude_other_signs() -> None:
    roads = street(stop_sign("stop", 80.0), SIGNAL.format(
        s=50, t=-4.5, id="limit", dynamic="no", orientation="+", z=2.0, type="274"
    ), SIGNAL.format(
        s=60, t=-4.5, id="for pedestrians", dynamic="yes", orientation="+", z=2.0, type="1000002"
    ))  # fmt: skip
    assert [(line.signal, line.kind) for line in stop_lines(roads)] == [("stop", "stop sign")]


def fork(curvature: float, length: float) -> RoadNetwork:
    """Return roads straight on and to the left from the same point at x = 50 m, each with a separate light."""
    one = lanes_xml(0, 1)
    return RoadNetwork.parse(
        map_xml(
            road_xml("1", length=50.0, link=successor_xml(junction="9")),
            road_xml(
                "2",
                length=20.0,
                x=50.0,
                link=predecessor_xml("1") + successor_xml("4"),
                lanes=one,
                extra=f"<signals>{light('straight', 10.0)}</signals>",
                junction="9",
            ),
            road_xml(
                "3",
                length=length,
                x=50.0,
                curvature=curvature,
                link=predecessor_xml("1"),
                lanes=one,
                extra=f"<signals>{light('left', 8.0)}</signals>",
                junction="9",
            ),
            road_xml("4", length=50.0, x=70.0, link=predecessor_xml(junction="9")),
            rest=junction_xml("9", "1", {"2": -1, "3": -1}),
        )
    )


def test_stop_lines_of_connecting_roads_apply_before_junction() -> None:
    roads = fork(0.1, 5.0 * math.pi)
    arc = np.linspace(0, math.pi / 2, 20)
    turn = np.column_stack([50 + 11.75 * np.sin(arc), 10 - 11.75 * np.cos(arc)])
    before = np.column_stack([np.arange(0.0, 50.0), np.full(50, -1.75)])
    on = np.column_stack([np.arange(50.0, 110.0), np.full(60, -1.75)])
    assert names(roads, np.concatenate([before, on])) == [("straight", 50.0)]
    assert [name for name, _ in names(roads, np.concatenate([before, turn]))] == ["left"]
    # A destination on a connecting road before its middle
    assert [name for name, _ in names(roads, np.concatenate([before, turn[:7]]))] == ["left"]
    assert names(roads, np.concatenate([before, on[:9]])) == [("straight", 50.0)]
    assert names(roads, before) == []


def test_stop_lines_of_roads_that_part_late_apply_to_one() -> None:
    """In the middle of the roads the paths are 1.3 m apart, at their ends 5 m."""
    roads = fork(0.025, 20.0)
    arc = np.linspace(0.0, 0.5, 20)
    left = np.column_stack([50 + 41.75 * np.sin(arc), 40 - 41.75 * np.cos(arc)])
    before = np.column_stack([np.arange(0.0, 50.0), np.full(50, -1.75)])
    on = np.column_stack([np.arange(50.0, 110.0), np.full(60, -1.75)])
    for light_of_way, path in (("straight", on), ("left", left)):
        assert [name for name, _ in names(roads, np.concatenate([before, path]))] == [light_of_way]


def test_signals_ahead_require_stop_only_after_sight() -> None:
    signals = SignalsAhead(street(light("east", 120.0), stop_sign("stop", 150.0)))
    signals.follow(EAST)
    assert [one.must_stop for one in signals.ahead(0.0)] == [False, False]
    for state, stops in (("red", True), ("green", False), ("on;off;off", True), ("", False)):
        signals.update([SignalReading("east", state), SignalReading("stop", "")])
        assert [one.must_stop for one in signals.ahead(0.0)] == [stops, True]


TRUCK = ActorSpec("Truck", "firetruck", "truck", (8.5, 2.9, 3.8), (0.0, 0.0, 1.9), wheelbase=5.0)


def visible_signals(
    roads: RoadNetwork,
    states: Mapping[str, str],
    x: float,
    yaw: float = 0.0,
    *,
    truck: bool = False,
    kinds: frozenset[str] = SIGNAL_KINDS,
) -> set[str]:
    with World(roads, dt=0.05, picture_maker=picture_maker) as world:
        world.add(CAR, Placement(x, -1.75, yaw=yaw))
        if truck:
            world.add(TRUCK, Placement(x + 14, -2.5))
        readings = SignalSensor(CAR, roads, kinds).read(world, world.view(), 0, states)
    return {f"{reading.id} {reading.state}".strip() for reading in readings}


def test_signal_sensor_requires_front_range_and_line_of_sight() -> None:
    roads = street(light("east", 120.0), light("west", 100.0, orientation="-"), stop_sign("stop", 130.0))
    states = {"east": "red", "west": "green"}
    assert visible_signals(roads, states, 60.0) == {"east red", "stop"}
    assert visible_signals(roads, states, 60.0, kinds=frozenset({"light"})) == {"east red"}
    assert visible_signals(roads, states, 60.0, kinds=frozenset({"stop sign"})) == {"stop"}
    assert visible_signals(roads, states, 10.0) == set()
    assert visible_signals(roads, states, 125.0) == {"stop"}
    assert "east red" not in visible_signals(roads, states, 90.0, truck=True)
    assert visible_signals(roads, {}, 60.0) == {"east", "stop"}


@pytest.mark.parametrize("height", [1.5, 2.5, 3.8, 4.5])
@pytest.mark.parametrize("gap", [1.0, 2.0, 5.0, 30.0])
def test_roof_of_the_station_does_not_hide_a_lower_signal(height: float, gap: float) -> None:
    """The sensor is 4.7 m behind the front, 0.41 m above the roof; the centers of the faces are at 2.95 and 2.45 m."""
    spec = dataclasses.replace(TRUCK, size=(8.5, 2.5, height), offset=(0.0, 0.0, height / 2.0))
    roads = street(light("east", 120.0), stop_sign("stop", 120.0))
    with World(roads, dt=0.05, picture_maker=picture_maker) as world:
        world.add(spec, Placement(120.0 - gap - 4.25, -1.75))
        readings = SignalSensor(spec, roads).read(world, world.view(), 0, {"east": "green"})
    assert {reading.id for reading in readings} == {"east", "stop"}


@pytest.mark.parametrize("offset", [0.0, 0.37, 0.77])
def test_signal_is_ahead_on_every_lap(offset: float) -> None:
    path = np.concatenate([[[40.0 - offset, -1.75]], ROUND[1:], ROUND[1:]])
    assert [place for _, place in names(street(light("east", 120.0)), path)] == pytest.approx(
        [80.0 + offset, 400.0 + offset], abs=0.01
    )
