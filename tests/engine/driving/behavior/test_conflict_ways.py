"""Ways of traffic that meet a drive, on roads of the library."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from eidrive_scenario.driving.planning.behavior.conflict_ways import ConflictWay, ConflictWays
from eidrive_scenario.driving.planning.behavior.reference import ReferenceLine
from eidrive_scenario.driving.planning.behavior.right_of_way import JunctionRules
from eidrive_scenario.driving.planning.path import PlannedPath
from eidrive_scenario.extensions.library import library_path
from eidrive_scenario.roads import RoadNetwork

Size = tuple[float, float]
CAR: Size = (4.9, 1.8)
"""Length and width [m]."""


@cache
def road_map(name: str) -> RoadNetwork:
    return RoadNetwork.load(library_path() / "roads" / f"{name}.xodr")


def ways_of(
    roads: RoadNetwork, start: tuple[str, int, float], size: Size = CAR, *, length: float = 120.0
) -> list[ConflictWay]:
    """Return the ways that meet a drive straight on from a lane position."""
    here = roads.location(*start)
    there = roads.advance(here, length)
    assert there is not None
    first, last = roads.pose(here), roads.pose(there)
    count = int(math.hypot(last.x - first.x, last.y - first.y)) + 1
    points = np.column_stack([np.linspace(first.x, last.x, count), np.linspace(first.y, last.y, count)])
    return ways_along(roads, ReferenceLine(PlannedPath(points, ends=True), roads), size)


def ways_along(roads: RoadNetwork, line: ReferenceLine, size: Size = CAR) -> list[ConflictWay]:
    rules = JunctionRules(roads)
    return ConflictWays(roads, rules, size).along(line, rules.passages(line.points))


def incoming_roads(ways: list[ConflictWay]) -> set[str]:
    return {way.key[0].road for way in ways if way.kind == "lane"}  # type: ignore[index]


class TestFourWayJunction:
    """Junction at x = 40 m: roads 1 and 2 are along x, 3 and 4 come from the left and from the right."""

    def test_straight_drive_meets_the_lanes_of_the_crossing_road_only(self) -> None:
        ways = ways_of(road_map("four_way_junction"), ("1", -1, 60.0))
        assert incoming_roads(ways) == {"3", "4"}
        straight = {way.key[0].road: way for way in ways if way.kind == "lane" and way.end - way.start < 3.0}  # type: ignore[index]
        first = road_map("four_way_junction").lane_pose_at("1", -1, 60.0).x
        middle = first + (straight["3"].start + straight["3"].end) / 2.0
        assert middle == pytest.approx(40.25, abs=0.3), "the lane is at x = 40.25"
        assert straight["4"].start - straight["3"].start == pytest.approx(3.5, abs=0.1)
        assert straight["3"].points[-1][1] > 100.0, "upstream of the lane from the left"
        assert straight["4"].points[-1][1] < -100.0, "upstream of the lane from the right"

    def test_vehicle_waits_for_all_lanes_before_the_first_one(self) -> None:
        ways = ways_of(road_map("four_way_junction"), ("1", -1, 60.0))
        lanes = [way for way in ways if way.kind == "lane"]
        assert {way.hold for way in lanes} == {min(way.start for way in lanes)}

    def test_long_vehicle_waits_before_the_crosswalk_and_looks_from_the_first_lane(self) -> None:
        """Between the crosswalk, which ends at x = 28.2 m, and the lanes is less than the length of a bus of 12 m."""
        ways = ways_of(road_map("four_way_junction"), ("1", -1, 60.0), size=(12.0, 2.5))
        crosswalks, lanes = ([way for way in ways if way.kind == kind] for kind in ("crosswalk", "lane"))
        first = min(way.start for way in crosswalks)
        assert {way.hold for way in ways} == {first}
        assert {way.look for way in crosswalks} == {first}
        assert {way.look for way in lanes} == {min(way.start for way in lanes)}

    def test_pedestrians_come_from_both_ends_of_each_crosswalk(self) -> None:
        ways = [way for way in ways_of(road_map("four_way_junction"), ("1", -1, 60.0)) if way.kind == "crosswalk"]
        assert len(ways) == 4
        for way in ways:
            assert way.points[0][1] * way.points[-1][1] > 0.0
            assert abs(way.points[-1][1]) > 5.0
        assert {math.copysign(1.0, way.points[0][1]) for way in ways} == {1.0, -1.0}

    def test_lights_control_the_ways_of_a_junction_with_signals(self) -> None:
        assert not any(way.has_light for way in ways_of(road_map("four_way_junction"), ("1", -1, 60.0)))
        ways = ways_of(road_map("four_way_signals"), ("1", -1, 60.0))
        assert ways
        assert all(way.has_light for way in ways)

    def test_road_without_junction_and_crosswalk_has_no_ways(self) -> None:
        assert ways_of(road_map("two_lane_road"), ("1", -1, 20.0)) == []

    def test_traffic_has_the_highest_speed_of_its_lanes(self) -> None:
        """The lanes through the junction have limits of 50 km/h, road 3 before it of 100 km/h."""
        text = (library_path() / "roads" / "four_way_junction.xodr").read_text(encoding="utf-8")
        start = text.index('id="3" junction="-1"')
        text = text[:start] + text[start:].replace('<speed max="50" unit="km/h"/>', '<speed max="100" unit="km/h"/>', 1)
        speeds = {
            way.key[0].road: way.speed  # type: ignore[index]
            for way in ways_of(RoadNetwork.parse(text), ("1", -1, 60.0))
            if way.kind == "lane"
        }
        assert speeds == pytest.approx({"3": 100.0 / 3.6, "4": 50.0 / 3.6})

    def test_lane_that_begins_within_the_junction_is_a_way(self) -> None:
        """As in maps of CARLA, a lane may begin in the last section of a road of a junction."""
        text = (library_path() / "roads" / "four_way_junction.xodr").read_text(encoding="utf-8")
        road = text.index('id="107" junction="100"')
        end = text.index("</lanes>", road)
        lane = '<lane id="{}" type="driving"><link/><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'
        center = '<center><lane id="0" type="none"/></center>'
        section = f'<laneSection s="8">{center}<right>{lane.format(-1)}{lane.format(-2)}</right></laneSection>'
        roads = RoadNetwork.parse(text[:end] + section + text[end:])
        assert roads.lane_ids("107", 0.0, drivable=True) == (-1,)
        ways = ways_of(roads, ("1", -1, 60.0))
        assert ("107", 1, -2) in {way.key[-1] for way in ways if way.kind == "lane"}  # type: ignore[index]

    def test_center_lane_of_a_driving_type_is_no_way(self) -> None:
        """As in the map `multi_intersections` of esmini."""
        text = (library_path() / "roads" / "four_way_junction.xodr").read_text(encoding="utf-8")
        center = '<lane id="0" type="{}" level="false">'
        text = text.replace(center.format("none"), center.format("driving"))
        expected = ways_of(road_map("four_way_junction"), ("1", -1, 60.0))
        assert [way.key for way in ways_of(RoadNetwork.parse(text), ("1", -1, 60.0))] == [way.key for way in expected]

    def test_closed_route_meets_the_ways_on_each_lap(self) -> None:
        """Laps through the junction along x, and back at y = -30 m."""
        roads = road_map("four_way_junction")
        lap = [(-20.0, 0.0), (100.0, 0.0), (100.0, -30.0), (-20.0, -30.0)]
        once = PlannedPath(np.array([*lap, lap[0]]), ends=False)
        twice = PlannedPath(np.array([*lap, *lap, lap[0]]), ends=False)
        first, both = (ways_along(roads, ReferenceLine(path, roads)) for path in (once, twice))
        assert len(first) > 8
        assert [way.key for way in both] == [way.key for way in first] * 2
        later = np.array([way.start for way in both[len(first) :]]) - [way.start for way in both[: len(first)]]
        # A lap has 300 m, less what the path cuts off at its corners.
        assert np.ptp(later) < 1.5
        assert 290.0 < later.mean() <= 300.0


def test_way_on_a_circle_comes_from_each_of_its_entries() -> None:
    """Roads 401 and 403 of the junction before lead to the lane that the drive from the west meets."""
    roads = road_map("roundabout")
    here, there = roads.locate_at(-20.0, 0.0), roads.locate_at(52.3, -72.3)
    assert here is not None
    assert there is not None
    points = np.asarray(roads.route(here, there).polyline(1.0))[:, :2]
    ways = ways_along(roads, ReferenceLine(PlannedPath(points, ends=True), roads))
    passed = {key.road for way in ways if way.kind == "lane" for key in way.key}  # type: ignore[attr-defined]
    assert {"401", "403"} <= passed
