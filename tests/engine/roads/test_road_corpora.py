"""Tests of external maps: loading, and geometry compared with CARLA and esmini."""

import csv
import gzip
import math
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest
from lxml import etree
from processor_time import within_readings

from eidrive_scenario.roads import RoadNetwork, surface_meshes

TOWNS = ("Town01", "Town03", "Town04", "Town05", "Town06")


@pytest.mark.exhaustive
def test_every_corpus_map_loads_and_has_surfaces(corpora: Path) -> None:
    files = sorted(corpora.rglob("*.xodr"))
    assert len(files) >= 40
    for file in files:
        network = RoadNetwork.load(file)
        points = [network.lane_pose(key.road, key.lane, 0.0) for key in list(network.graph)[:50] if key.section == 0]
        assert np.all(np.isfinite(np.array(points))), file
        if file.stat().st_size < 1_000_000:
            assert all(np.all(np.isfinite(mesh.vertices)) for mesh in surface_meshes(network)), file


@pytest.mark.exhaustive
@pytest.mark.parametrize("town", TOWNS)
def test_lane_centers_equal_carla(corpora: Path, carla: Any, town: str) -> None:
    file = corpora / "carla_towns" / f"{town}.xodr"
    network = RoadNetwork.load(file)
    waypoints = carla.Map(town, file.read_text()).generate_waypoints(4.0)
    assert len(waypoints) > 1000
    for waypoint in waypoints:
        road, lane = str(waypoint.road_id), waypoint.lane_id
        pose = network.lane_pose_at(road, lane, min(waypoint.s, network.roads[road].length))
        place, yaw = waypoint.transform.location, -math.radians(waypoint.transform.rotation.yaw)
        assert math.dist(pose[:3], (place.x, -place.y, place.z)) < 0.02, waypoint
        turned = 0.0 if network.driving_direction(road, lane) > 0 else math.pi
        assert math.cos(pose.h + turned - yaw) > 1.0 - 1e-6, waypoint
        assert network.lane_width(road, lane, waypoint.s) == pytest.approx(waypoint.lane_width, abs=1e-3)


@pytest.mark.exhaustive
@pytest.mark.parametrize("town", ["Town03", "Town05"])
def test_lane_successors_equal_carla(corpora: Path, carla: Any, town: str) -> None:
    file = corpora / "carla_towns" / f"{town}.xodr"
    network = RoadNetwork.load(file)
    reached: dict[tuple[str, int], set[tuple[str, int]]] = {}
    for start, end in carla.Map(town, file.read_text()).get_topology():
        reached.setdefault((str(start.road_id), start.lane_id), set()).add((str(end.road_id), end.lane_id))
    missing = 0
    for (road, lane), ends in reached.items():
        mine = {(k.road, k.lane) for k in network.graph if k.road == road and k.lane == lane}
        mine |= {(o.road, o.lane) for k in network.graph if (k.road, k.lane) == (road, lane) for o in network.graph[k]}
        missing += len(ends - mine - {(road, lane)})
    assert missing == 0


@pytest.mark.exhaustive
def test_locate_hundred_thousand_points_of_a_town(corpora: Path) -> None:
    network = RoadNetwork.load(corpora / "carla_towns" / "Town04.xodr")
    rng = np.random.default_rng(4)
    keys = [key for key, drivable in network.graph.nodes(data="drivable") if drivable]
    rows = rng.integers(len(keys), size=100_000)
    tables = network.tables
    road = np.array([tables.index[key.road] for key in keys])[rows]
    lane = np.array([key.lane for key in keys])[rows]
    sections = [network.roads[key.road].sections[key.section] for key in keys]
    s = (
        np.array([part.s + 0.001 for part in sections])[rows]
        + rng.uniform(0, 1, len(rows)) * np.array([max(part.length - 0.002, 0.0) for part in sections])[rows]
    )
    row = tables.lane_row(road, s, lane)
    width = tables.width.value(row, s - tables.section_start[tables.lane_section[row]])
    poses = tables.lane_poses(row, s, rng.uniform(-0.45, 0.45, len(rows)) * width)
    network.locate(poses.x[:1], poses.y[:1])
    found = within_readings(5, lambda: network.locate(poses.x, poses.y, poses.z))
    assert np.all(found.outside == 0.0)
    back = tables.road_poses(found.road, found.s, found.t)
    assert np.hypot(back.x - poses.x, back.y - poses.y).max() < 0.01
    assert np.abs(back.z - poses.z).max() < 0.5, "another storey"


def test_routes_over_a_town_have_minimal_cost(corpora: Path) -> None:
    network = RoadNetwork.load(corpora / "carla_towns" / "Town03.xodr")
    keys = [key for key, data in network.graph.nodes(data=True) if data["drivable"] and data["length"] > 20.0]
    rng = np.random.default_rng(7)
    found = 0
    for source in (keys[i] for i in rng.integers(len(keys), size=15)):
        costs = nx.single_source_dijkstra_path_length(network.graph, source)
        for target in (keys[i] for i in rng.integers(len(keys), size=8)):
            a, b = (
                network.location(k.road, k.lane, network.roads[k.road].sections[k.section].s + 10.0)
                for k in (source, target)
            )
            if target not in costs or source[:2] == target[:2]:
                continue
            route = network.route(a, b)
            assert nx.path_weight(network.graph, route.lanes, "weight") == pytest.approx(costs[target])
            line = route.polyline(1.0)
            steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
            assert steps.max() < 1.01
            found += 1
    assert found > 50


@pytest.mark.parametrize(
    ("scenario", "road_file"),
    [
        ("cut-in", "e6mini.xodr"),
        ("left-hand-traffic_using_road_rule", "e6mini-lht.xodr"),
        ("velodrome", "velodrome.xodr"),
        ("lane_change_crest", "crest-curve.xodr"),
        ("pedestrian", "fabriksgatan.xodr"),
        ("pedestrian_collision", "fabriksgatan.xodr"),
        ("highway_merge", "soderleden.xodr"),
    ],
)
def test_lane_positions_equal_esmini(corpora: Path, scenario: str, road_file: str) -> None:
    network = RoadNetwork.load(corpora / "esmini" / "xodr" / road_file)
    root = etree.parse(str(corpora / "esmini" / "xosc" / f"{scenario}.xosc")).getroot()
    known = {p.get("name"): p.get("value") for p in root.iterfind("ParameterDeclarations/ParameterDeclaration")}

    def value(element: Any, name: str, default: str = "0") -> str:
        text = element.get(name, default)
        return str(known[text[1:]] if text.startswith("$") else text)

    with gzip.open(corpora / "reference" / f"esmini__{scenario}.csv.gz", "rt") as file:
        first = {row["name"]: row for row in csv.DictReader(file) if float(row["time"]) == 0.0}
    checked = 0
    for private in root.iterfind("Storyboard/Init/Actions/Private"):
        row = first[value(private, "entityRef")]
        for place in private.iterfind("PrivateAction/TeleportAction/Position/LanePosition"):
            at = network.location(
                value(place, "roadId"),
                int(value(place, "laneId")),
                float(value(place, "s")),
                float(value(place, "offset")),
            )
            pose = network.pose(at)
            orientation = place.find("Orientation")
            turn = 0.0 if orientation is None else float(value(orientation, "h"))
            assert math.dist(pose[:3], [float(row[axis]) for axis in "xyz"]) < 0.002
            assert math.cos(pose.h + turn - float(row["h"])) > 1.0 - 1e-6
            checked += 1
    assert checked >= 1


def test_superelevation_of_banked_track_equals_esmini(corpora: Path) -> None:
    network = RoadNetwork.load(corpora / "esmini" / "xodr" / "velodrome.xodr")
    with gzip.open(corpora / "reference" / "esmini__velodrome.csv.gz", "rt") as file:
        trace = np.array([[float(row[column]) for column in ("x", "y", "z", "r")] for row in csv.DictReader(file)])
    found = network.locate(trace[:, 0], trace[:, 1], trace[:, 2])
    poses = network.tables.road_poses(found.road, found.s, found.t)
    assert np.abs(poses.z - trace[:, 2]).max() < 0.005
    assert np.cos(poses.r - trace[:, 3]).min() > 1.0 - 1e-4
