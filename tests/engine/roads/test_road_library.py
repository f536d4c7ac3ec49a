"""Tests of the library roads: lanes at the sites of the paper, and consistency of the files."""

import math
from pathlib import Path

import pytest

from eidrive_scenario.roads import RoadNetwork
from xosc.roads.crossings import CROSSINGS
from xosc.roads.make_roads import write

NAMES = ("coop_1", "coop_2")


@pytest.mark.parametrize("name", NAMES)
def test_lane_successors_continue_position_and_width(library: Path, name: str) -> None:
    network = RoadNetwork.load(library / f"{name}.xodr")
    checked = 0
    for key in network.graph:
        direction = network.driving_direction(key.road, key.lane)
        for other, way in network.links.beyond(key, direction):
            end = network.lane_pose_at(key.road, key.lane, network.roads[key.road].length if direction > 0 else 0.0)
            start = network.lane_pose_at(other.road, other.lane, 0.0 if way > 0 else network.roads[other.road].length)
            assert math.dist(end[:2], start[:2]) < 1e-6
            assert math.cos(end.h - start.h) * direction * way == pytest.approx(1.0)
            widths = [network.lane_width(k.road, k.lane, s) for k, s in ((key, 0.0), (other, 0.0))]
            assert widths[0] == widths[1]
            checked += 1
    assert checked >= 24


@pytest.mark.parametrize("name", NAMES)
def test_road_file_equals_output_of_its_script(library: Path, tmp_path: Path, name: str) -> None:
    crossing = next(crossing for crossing in CROSSINGS if crossing.name == name)
    write(crossing, tmp_path / "again.xodr")
    assert (tmp_path / "again.xodr").read_bytes() == (library / f"{name}.xodr").read_bytes()


@pytest.mark.parametrize(
    ("name", "x", "y", "heading", "road", "lane"),
    [
        ("coop_1", 0.0, 0.0, 0.0, "1", -1),
        ("coop_1", 29.5, 39.5, -90.0, "3", 3),
        ("coop_2", 0.0, 0.0, 0.0, "1", -1),
        ("coop_2", 25.0, 34.5, -90.0, "3", 1),
    ],
)
def test_start_positions_of_the_paper_are_on_lane_centers(
    library: Path, name: str, x: float, y: float, heading: float, road: str, lane: int
) -> None:
    network = RoadNetwork.load(library / f"{name}.xodr")
    found = network.locate_at(x, y)
    assert found is not None
    assert (found.road, found.lane) == (road, lane)
    assert found.offset == pytest.approx(0.0, abs=1e-6)
    assert math.cos(network.pose(found).h - math.radians(heading)) == pytest.approx(1.0)


@pytest.mark.parametrize("name", NAMES)
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
