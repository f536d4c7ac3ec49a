"""Tests of the library roads: lanes at the sites of the paper, and consistency of the files."""

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from lxml import etree

from eidrive_scenario.roads import RoadNetwork, placed_objects
from xosc.roads.courses import connect
from xosc.roads.layout import Layout
from xosc.roads.make_roads import LAYOUTS, write

COOP_SITES = ("coop_1", "coop_2")
NAMES = tuple(layout.name for layout in LAYOUTS)
INSIDE = 1e-9
"""Distance from the end of a lane section [m]."""
OBJECT_TYPES = {"barrier", "building", "crosswalk", "roadMark"}
"""Types of the library's objects, all in e_objectType of ASAM OpenDRIVE 1.6."""


@pytest.mark.parametrize("name", NAMES)
def test_lane_successors_continue_position_and_width(library: Path, name: str) -> None:
    network = RoadNetwork.load(library / f"{name}.xodr")
    checked = 0
    for key in network.graph:
        direction = network.driving_direction(key.road, key.lane)
        for other, way in network.links.beyond(key, direction):
            here = network.roads[key.road].sections[key.section]
            there = network.roads[other.road].sections[other.section]
            # Just inside the sections: at their common end a location belongs to the next one
            s = here.end - INSIDE if direction > 0 else here.s + INSIDE
            s_there = there.s + INSIDE if way > 0 else there.end - INSIDE
            end = network.lane_pose_at(key.road, key.lane, s)
            start = network.lane_pose_at(other.road, other.lane, s_there)
            assert math.dist(end[:2], start[:2]) < 1e-6
            assert math.cos(end.h - start.h) * direction * way == pytest.approx(1.0)
            width = here.lanes[key.lane].width.value(s - here.s)
            assert there.lanes[other.lane].width.value(s_there - there.s) == pytest.approx(width, abs=1e-9)
            checked += 1
    assert checked >= 4 * len(network.junctions)


@pytest.mark.parametrize("layout", LAYOUTS, ids=NAMES)
def test_road_file_equals_output_of_its_script(library: Path, tmp_path: Path, layout: Layout) -> None:
    write(layout, tmp_path / "again.xodr")
    assert (tmp_path / "again.xodr").read_bytes() == (library / f"{layout.name}.xodr").read_bytes()


def test_every_road_file_has_a_description(library: Path) -> None:
    assert sorted(path.stem for path in library.glob("*.xodr")) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_road_file_has_no_diagnostics(library: Path, name: str) -> None:
    assert not RoadNetwork.load(library / f"{name}.xodr").map_warnings


@pytest.mark.parametrize("name", NAMES)
def test_objects_agree_with_the_schema_of_opendrive(library: Path, name: str) -> None:
    """The schema of version 1.6 requires unique ids in a file, and has neither walls nor paint as a fill."""
    objects = list(etree.parse(library / f"{name}.xodr").iter("object"))
    numbers = [item.get("id") for item in objects]
    assert len(set(numbers)) == len(numbers)
    assert {item.get("type") for item in objects} <= OBJECT_TYPES
    assert not [outline for item in objects for outline in item.iter("outline") if outline.get("fillType")]


@pytest.mark.parametrize("name", NAMES)
def test_lanes_and_successors_equal_carla(library: Path, carla: Any, name: str) -> None:
    file = library / f"{name}.xodr"
    network = RoadNetwork.load(file)
    town = carla.Map(name, file.read_text())
    waypoints = town.generate_waypoints(4.0)
    assert len(waypoints) > 100
    for waypoint in waypoints:
        road, lane = str(waypoint.road_id), waypoint.lane_id
        pose = network.lane_pose_at(road, lane, min(waypoint.s, network.roads[road].length))
        place, yaw = waypoint.transform.location, -math.radians(waypoint.transform.rotation.yaw)
        assert math.dist(pose[:3], (place.x, -place.y, place.z)) < 1e-3, waypoint
        turned = 0.0 if network.driving_direction(road, lane) > 0 else math.pi
        assert math.cos(pose.h + turned - yaw) > 1.0 - 1e-6, waypoint
    reached: dict[tuple[str, int], set[tuple[str, int]]] = {}
    for start, end in town.get_topology():
        reached.setdefault((str(start.road_id), start.lane_id), set()).add((str(end.road_id), end.lane_id))
    for (road, lane), ends in reached.items():
        keys = [key for key in network.graph if (key.road, key.lane) == (road, lane)]
        own = {(other.road, other.lane) for key in keys for other in network.graph[key]}
        assert ends <= own | {(road, lane)}, (road, lane)


LANES = [
    ("coop_1", 0.0, 0.0, 0.0, "1", -1),
    ("coop_1", 29.5, 39.5, -90.0, "3", 3),
    ("coop_2", 0.0, 0.0, 0.0, "1", -1),
    ("coop_2", 25.0, 34.5, -90.0, "3", 1),
    ("coop_3", 0.0, 0.0, 0.0, "1", -1),
    ("coop_5", 0.0, 0.0, 0.0, "1", -2),
    ("coop_5", 18.1, 53.9, 0.0, "3", 1),
    ("coop_7", 0.0, 0.0, 0.0, "1", -4),
    ("coop_7", 35.6, 47.6, -90.0, "3", 3),
]


@pytest.mark.parametrize(("name", "x", "y", "heading", "road", "lane"), LANES)
def test_start_positions_of_the_paper_are_on_lane_centers(
    library: Path, name: str, x: float, y: float, heading: float, road: str, lane: int
) -> None:
    network = RoadNetwork.load(library / f"{name}.xodr")
    found = network.locate_at(x, y)
    assert found is not None
    assert (found.road, found.lane) == (road, lane)
    assert found.offset == pytest.approx(0.0, abs=1e-6)
    assert math.cos(network.pose(found).h - math.radians(heading)) == pytest.approx(1.0)


@pytest.mark.parametrize("name", COOP_SITES)
def test_each_arm_leads_from_stop_line_to_all_others(library: Path, name: str) -> None:
    network = RoadNetwork.load(library / f"{name}.xodr")
    reached: dict[str, set[str]] = {}
    for connection in network.junctions["100"].connections:
        target = network.roads[connection.connecting_road].successor
        assert target is not None
        reached.setdefault(connection.incoming_road, set()).add(target.element_id)
    arms = {"1", "2", "3", "4"}
    assert reached == {arm: arms - {arm} for arm in arms}
    assert len(network.signals) == 4
    assert sorted(item.type for item in network.objects) == ["building"] * 24 + ["crosswalk"] * 4 + ["roadMark"] * 4


def test_arms_are_straight_for_sixty_meters(library: Path) -> None:
    for name, x in (("coop_1", 29.5), ("coop_2", 25.0)):
        network = RoadNetwork.load(library / f"{name}.xodr")
        for y in (-75.0, -30.0, 0.0, 30.0, 75.0):
            found = network.locate_at(x, y)
            assert found is not None
            assert network.on_road(found)


def test_motorway_lanes_lead_through_the_merge(library: Path) -> None:
    network = RoadNetwork.load(library / "motorway.xodr")
    ramp, start = network.location("4", -1, 10.0), network.location("1", -3, 100.0)
    goal = network.location("2", -3, 500.0)
    assert [key.lane for key in network.route(start, goal).lanes if key.road == "2"] == [-3, -3, -3]
    lanes = [(key.road, key.lane) for key in network.route(ramp, goal).lanes]
    assert lanes[0] == ("4", -1)
    assert ("2", -4) in lanes  # the acceleration lane, which must be left
    assert lanes[-1] == ("2", -3)
    assert network.lane_ids("2", 100.0, drivable=True) == (-1, -2, -3, -4)
    assert network.lane_width("2", -4, 230.0) == pytest.approx(1.875)
    assert network.lane_ids("2", 300.0, drivable=True) == (-1, -2, -3)


@pytest.mark.parametrize(("leg", "segments"), [(2, 1), (3, 2), (4, 3)])
def test_roundabout_is_driven_counterclockwise(library: Path, leg: int, segments: int) -> None:
    network = RoadNetwork.load(library / "roundabout.xodr")
    route = network.route(network.location("1", 1, 40.0), network.location(str(leg), -1, 40.0))
    circle = [key.road for key in route.lanes if key.road in ("5", "6", "7", "8")]
    assert circle == ["5", "6", "7"][:segments]


def test_one_way_road_opens_a_lane_and_takes_the_ramp(library: Path) -> None:
    network = RoadNetwork.load(library / "one_way_road.xodr")
    assert network.lane_width("1", -1, 105.0) == pytest.approx(1.75)  # in the middle of the opening of 28 m
    route = network.route(network.location("5", -1, 10.0), network.location("3", -4, 100.0))
    assert [key.road for key in route.lanes][0::2] == ["5", "3"]
    exit_ = network.route(network.location("1", -1, 120.0), network.location("4", -1, 30.0))
    assert [key.road for key in exit_.lanes][-1] == "4"


def test_crest_has_its_height_and_radius(library: Path) -> None:
    """Climb: 90 m at a mean grade of 3 %, 60 m at 6 %, 48 m at a mean of 3 %. Radius: 1 / z'' = 96 m / 0.12."""
    network = RoadNetwork.load(library / "crest_road.xodr")
    s = (150.0, 348.0, 546.0)
    assert [network.road_pose_at("1", at, 0.0).z for at in s] == pytest.approx([0.0, 7.74, 0.0], abs=1e-9)
    assert network.road_pose_at("1", 348.0, 0.0).p == pytest.approx(0.0, abs=1e-9)
    below = [7.74 - network.road_pose_at("1", 348.0 + ds, 0.0).z for ds in (-20.0, 20.0)]
    assert below == pytest.approx([20.0**2 / (2 * 800.0)] * 2)


def test_tunnel_walls_follow_the_edges_of_the_road(library: Path) -> None:
    network = RoadNetwork.load(library / "tunnel_road.xodr")
    walls = [placed for placed in placed_objects(network) if placed.object.name.startswith("tunnel wall")]
    assert {round(placed.height, 3) for placed in walls} == {4.7}
    # Parts of 5 m are chords of arcs of 150 m
    assert sum(placed.length for placed in walls) == pytest.approx(2 * 320.0, rel=(5.0 / 150.0) ** 2 / 24.0)
    middle = network.road_pose_at("1", 282.5, 0.0)
    nearest = sorted(math.dist(placed.pose[:2], middle[:2]) for placed in walls)[:2]
    assert nearest == pytest.approx([4.2, 4.2], abs=0.03)  # 3.5 m lane, 0.5 m margin, half of the wall


def test_connecting_curve_reaches_its_end_with_continuous_curvature() -> None:
    for x, y, end in ((20.0, 9.0, 1.2), (25.0, -20.0, -math.pi / 2), (40.0, 2.5, 0.0), (30.0, -3.0, -0.3)):
        line = connect(1.0, 2.0, 0.7, 1.0 + _turned(x, y)[0], 2.0 + _turned(x, y)[1], 0.7 + end)
        for before, after in pairwise(line):
            ends, starts = before.at(before.length), after.at(0.0)
            assert math.dist(ends[:2], starts[:2]) < 1e-9
            assert ends.h == pytest.approx(starts.h)
            assert ends.curvature == pytest.approx(starts.curvature, abs=1e-9)
        last = line[-1].at(line[-1].length)
        assert math.dist(last[:2], (1.0 + _turned(x, y)[0], 2.0 + _turned(x, y)[1])) < 1e-9
        assert math.cos(last.h - 0.7 - end) == pytest.approx(1.0)


def _turned(x: float, y: float) -> tuple[float, float]:
    return x * math.cos(0.7) - y * math.sin(0.7), x * math.sin(0.7) + y * math.cos(0.7)


@pytest.mark.parametrize(("x", "y", "end"), [(-5.0, 0.0, 0.0), (5.0, -20.0, math.pi / 2), (5.0, 0.0, math.pi)])
def test_poses_without_a_single_turn_are_refused(x: float, y: float, end: float) -> None:
    with pytest.raises(ValueError, match=r"turn|behind"):
        connect(0.0, 0.0, 0.0, x, y, end)
