"""Tests of all lanes below a point, including overlapping roads of junctions, and of the distance from lanes."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from opendrive_xml import elevation_xml, lane_xml, map_xml, road_xml, section_xml, superelevation_xml

from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.geometry import poses as scalar


def beneath(network: RoadNetwork, x: float, y: float) -> set[tuple[str, int]]:
    """Return all lanes below a point by a search on each road from every second meter."""
    found = set()
    for road in network.roads.values():
        for guess in np.arange(0.0, road.length + 2.0, 2.0):
            s, t, beyond = scalar.project(road, x, y, min(float(guess), road.length))
            _, lane, outside = scalar.lane_beside(road, s, t)
            place = scalar.road_pose_at(road, s, t)
            if beyond <= 0.0 and outside <= 0.0 and np.hypot(place.x - x, place.y - y) < 1e-3:
                found.add((road.id, lane.id))
    return found


@pytest.mark.parametrize("name", ["coop_1", "coop_2"])
def test_overlapped_lanes_of_points_on_a_crossing(library: Path, name: str) -> None:
    network = RoadNetwork.load(library / f"{name}.xodr")
    junction = next(iter(network.junctions))
    inside = [road for road in network.roads.values() if road.junction_id == junction]
    rng = np.random.default_rng(3)
    points = []
    for road in inside:
        for s in rng.uniform(1.0, road.length - 1.0, 4).tolist():
            lanes = [lane for lane in road.section_at(s).lanes.values() if lane.drivable]
            lane = lanes[int(rng.integers(len(lanes)))]
            pose = scalar.lane_pose_at(road, lane.id, s, float(rng.uniform(-0.9, 0.9)))
            points.append((pose.x, pose.y))
    x, y = np.array(points).T
    row, s, point = network.overlapped_lanes(x, y)
    keys = network.tables.lane_keys
    several = 0
    for n in range(len(points)):
        mine = {(keys[int(r)].road, keys[int(r)].lane) for r in row[point == n]}
        expected = {lane for lane in beneath(network, float(x[n]), float(y[n])) if network.roads[lane[0]] in inside}
        assert mine == expected, points[n]
        several += len(mine) > 1
    assert several > len(points) / 3
    again = network.tables.lane_poses(row, s, np.zeros(len(row)))
    assert np.hypot(again.x - x[point], again.y - y[point]).max() < 3.5


def test_overlapped_lanes_outside_a_junction_is_one_at_most(library: Path) -> None:
    network = RoadNetwork.load(library / "coop_2.xodr")
    row, _, point = network.overlapped_lanes(np.array([-40.0, -40.0]), np.array([0.0, 300.0]))
    assert point.tolist() == [0]
    assert network.tables.lane_id[row].tolist() == [-1]


@pytest.mark.parametrize("heading", [0.0, math.pi / 8.0, 1.0, 2.0, math.pi, 4.0])
@pytest.mark.parametrize("curvature", [0.0, 0.05, -0.05])
@pytest.mark.parametrize(
    ("s", "t", "gap"),
    [
        (20.0, -3.4, 0.9),
        (20.0, -12.5, 10.0),
        (21.3, 4.7, 4.7),
        (20.0, -2.4, 0.0),
        (0.3, 0.4, 0.5),  # before the lane, which begins at 0.6 m
        (0.0, -3.3, 1.0),
        (0.1, -1.0, 0.5),
    ],
)
def test_gap_to_the_lane_in_any_direction(heading: float, curvature: float, s: float, t: float, gap: float) -> None:
    """A driving lane of 2.5 m on a line or an arc that begins at 0.6 m; a sidewalk beside it does not count."""
    first = section_xml(right=lane_xml(-1, 2.5, kind="border"))
    lanes = first + section_xml(right=lane_xml(-1, 2.5) + lane_xml(-2, 1.5, kind="sidewalk"), s=0.6)
    line = f'<geometry s="0" x="5" y="3" hdg="{heading}" length="0.6"><line/></geometry>'
    shape = f'<arc curvature="{curvature}"/>' if curvature else "<line/>"
    x, y = 5.0 + 0.6 * math.cos(heading), 3.0 + 0.6 * math.sin(heading)
    line += f'<geometry s="0.6" x="{x}" y="{y}" hdg="{heading}" length="39.4">{shape}</geometry>'
    network = RoadNetwork.parse(map_xml(road_xml(length=40.0, geometry=line, lanes=lanes)))
    pose = network.road_pose_at("1", s, t)
    (lane,) = np.flatnonzero(network.tables.lane_drivable)
    assert network.lane_gap(pose.x, pose.y, 0.0, np.array([lane]), gap) == pytest.approx(gap, abs=1e-9)


@pytest.mark.parametrize("bank", [0.0, 0.2])
def test_gap_to_a_lane_on_its_level(bank: float) -> None:
    """A lane of 3.5 m at a height of 6 m."""
    profiles = elevation_xml(6.0) + (superelevation_xml(bank) if bank else "")
    network = RoadNetwork.parse(map_xml(road_xml(profiles=profiles, lanes=section_xml(right=lane_xml(-1)))))
    lanes = np.flatnonzero(network.tables.lane_drivable)
    assert network.lane_gap(50.0, -4.0, 6.0, lanes, 5.0) == pytest.approx(4.0 - 3.5 * math.cos(bank))
    assert network.lane_gap(50.0, -4.0, 0.0, lanes, 5.0) == math.inf
    assert network.lane_gap(50.0, -104.0, 6.0, lanes, 5.0) == math.inf
