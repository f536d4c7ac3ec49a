"""Tests of all lanes below a point, including overlapping roads of junctions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

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
