"""Tests of the library roads of EI-Drive's sites: lane centers, stop lines and signals of CARLA's towns."""

import math
from pathlib import Path

import pytest

from eidrive_scenario.perception.traffic_lights import stop_lines
from eidrive_scenario.roads import RoadNetwork


@pytest.mark.parametrize(
    ("name", "x", "y", "heading"),
    [
        ("avenue_crossing", 0.0, 0.3, 0.0),  # Town03, four-way crossing: near arm, far arm, street arms
        ("avenue_crossing", 10.0, -3.2, 0.0),
        ("avenue_crossing", 10.0, 10.8, 180.0),
        ("avenue_crossing", 52.0, 6.7, 180.0),
        ("avenue_crossing", 33.2, 40.0, -90.0),
        ("avenue_crossing", 36.6, 50.0, 90.0),
        ("avenue_crossing", 37.3, -30.0, 90.0),
        ("avenue_crossing", 33.8, -30.0, -90.0),
        ("boulevard", 0.0, 0.0, 0.0),
        ("boulevard", 20.0, -3.7, 0.0),
        ("boulevard", 114.0, -1.6, 0.0),
        ("boulevard", 10.0, 8.0, 180.0),
        ("boulevard", 111.5, 30.0, -90.0),
        ("t_junction", 0.0, 0.5, 0.0),  # Town05
        ("t_junction", 60.0, 4.0, 180.0),
        ("t_junction", 29.8, 30.6, -90.0),
        ("t_junction", 33.3, 15.5, 90.0),
        ("one_way_road", 80.6, 3.5, 0.0),  # Town06: carriageway, ramp, merge
        ("one_way_road", 22.2, -0.3, 0.0),
        ("one_way_road", 200.3, -21.0, 38.0),
        ("one_way_road", 262.2, 0.0, 0.0),
        ("avenue_t_junctions", 0.0, 0.1, 0.0),  # Town03: street, avenue, boulevard
        ("avenue_t_junctions", -10.0, 3.6, 180.0),
        ("avenue_t_junctions", 31.4, 22.0, -90.0),
        ("avenue_t_junctions", 40.5, -44.0, 90.0),
        ("avenue_t_junctions", 39.0, 36.1, 90.0),
        ("avenue_t_junctions", 32.9, 90.0, -90.0),
        ("avenue_t_junctions", 0.0, 56.0, 0.0),
        ("avenue_t_junctions", 0.0, 64.0, 180.0),
        ("street_t_junction", 0.0, -0.2, 0.0),
        ("street_t_junction", 36.6, 47.4, 90.0),
        ("street_t_junction", 33.1, -30.0, -90.0),
        ("two_lane_road", 100.0, 0.0, 0.0),  # Town01: lane centers 4 m apart
        ("two_lane_road", 100.0, 4.0, 180.0),
    ],
)
def test_lane_centers_of_ei_sites_deviate_by_less_than_half_a_meter(
    library: Path, name: str, x: float, y: float, heading: float
) -> None:
    network = RoadNetwork.load(library / f"{name}.xodr")
    found = network.locate_at(x, y)
    assert found is not None
    assert network.lane_type(found.road, found.lane, found.s) == "driving"
    assert abs(found.offset) < 0.45
    assert math.cos(network.pose(found).h - math.radians(heading)) > math.cos(math.radians(2.5))


@pytest.mark.parametrize(
    ("name", "kind", "x", "y"),
    [
        ("avenue_crossing", "light", 21.2, 0.3),
        ("avenue_crossing", "light", 48.2, 6.7),
        ("avenue_crossing", "light", 33.2, 23.9),
        ("avenue_crossing", "light", 37.3, -13.4),
        ("t_junction", "stop sign", 29.8, 13.3),
        ("avenue_t_junctions", "light", 31.4, 20.6),
        ("avenue_t_junctions", "light", 37.9, -18.6),
        ("avenue_t_junctions", "stop sign", 32.9, 79.6),
        ("avenue_t_junctions", "stop sign", 18.1, 56.0),
        ("street_t_junction", "stop sign", 16.7, -0.2),
        ("street_t_junction", "stop sign", 33.1, 19.7),
        ("boulevard", "stop sign", 111.5, 17.1),
    ],
)
def test_stop_lines_of_ei_sites_are_those_of_carla(library: Path, name: str, kind: str, x: float, y: float) -> None:
    lines = stop_lines(RoadNetwork.load(library / f"{name}.xodr"))
    assert min(math.dist((line.x, line.y), (x, y)) for line in lines if line.kind == kind) < 0.75


@pytest.mark.parametrize(
    ("name", "lights", "stops", "controllers"),
    [
        ("coop_1", 0, 6, 0),
        ("coop_2", 6, 0, 2),
        ("avenue_crossing", 6, 0, 2),
        ("four_way_signals", 8, 0, 2),
        ("four_way_junction", 0, 0, 0),
        ("t_junction", 0, 1, 0),
        ("avenue_t_junctions", 4, 5, 1),
        ("street_t_junction", 0, 2, 0),
        ("boulevard", 0, 2, 0),
    ],
)
def test_number_of_lanes_with_stop_lines(library: Path, name: str, lights: int, stops: int, controllers: int) -> None:
    network = RoadNetwork.load(library / f"{name}.xodr")
    lines = stop_lines(network)
    assert [sum(line.kind == kind for line in lines) for kind in ("light", "stop sign")] == [lights, stops]
    assert len(network.controllers) == controllers
