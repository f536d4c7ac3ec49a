"""Tests of traffic areas: ranges of roads between cursors, and polygons."""

from __future__ import annotations

import math

import numpy as np
import pytest
from fleet_scene import street
from opendrive_xml import (
    junction_xml,
    lane_links_xml,
    lane_xml,
    map_xml,
    predecessor_xml,
    road_xml,
    section_xml,
    successor_xml,
)

from eidrive_scenario.errors import InputError
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.traffic import Cursor, SpawnSites, Stretch, polygon, road_range, stretches_cover
from eidrive_scenario.traffic.lanes import TrafficLanes
from eidrive_scenario.traffic.spawning.sites import SpawnAreas


def three_in_a_row(turned: bool = False) -> RoadNetwork:
    """Return three consecutive roads a, b, c of 100 m; with `turned` the middle one has the opposite direction."""

    def road(number: str, x: float, before: tuple[str, str] | None, after: tuple[str, str] | None) -> str:
        link = (predecessor_xml(*before) if before else "") + (successor_xml(*after) if after else "")
        sides = [
            lane_xml(lane, link=lane_links_xml(other if before else None, other if after else None))
            for lane in (1, -1)
            for other in (-lane if turned else lane,)
        ]
        start, hdg = (x + 100.0, math.pi) if turned and number == "b" else (x, 0.0)
        return road_xml(number, x=start, hdg=hdg, link=link, lanes=section_xml(*sides))

    if turned:
        roads = [
            road("a", 0.0, None, ("b", "end")),
            road("b", 100.0, ("c", "start"), ("a", "end")),
            road("c", 200.0, ("b", "start"), None),
        ]
    else:
        roads = [
            road("a", 0.0, None, ("b", "start")),
            road("b", 100.0, ("a", "end"), ("c", "start")),
            road("c", 200.0, ("b", "end"), None),
        ]
    return RoadNetwork.parse(map_xml(*roads))


def test_range_on_one_road() -> None:
    roads = street()
    assert road_range(roads, [Cursor("1", 100.0, (-1,)), Cursor("1", 300.0)]) == [Stretch("1", 100.0, 300.0, (-1,))]
    assert road_range(roads, [Cursor("1", 300.0), Cursor("1", 100.0)]) == [Stretch("1", 100.0, 300.0)]


def test_cursor_without_s_is_start_or_end_of_its_road() -> None:
    assert road_range(street(), [Cursor("1"), Cursor("1")]) == [Stretch("1", 0.0, 1000.0)]


def test_cursor_without_s_may_be_the_end_of_its_road() -> None:
    """Roads 1 and 2 begin at the same point."""
    lanes = section_xml(*[lane_xml(number, link=lane_links_xml(before=-number)) for number in (1, -1)])
    roads = RoadNetwork.parse(
        map_xml(
            road_xml("1", link=predecessor_xml("2", "start"), lanes=lanes),
            road_xml("2", hdg=math.pi, link=predecessor_xml("1", "start"), lanes=lanes),
        )
    )
    whole = [Stretch("1", 0.0, 100.0), Stretch("2", 0.0, 100.0)]
    assert road_range(roads, [Cursor("1"), Cursor("2")]) == whole
    assert road_range(roads, [Cursor("2"), Cursor("1")]) == whole[::-1]


def test_lanes_of_cursor_are_valid_up_to_the_next_cursor() -> None:
    cursors = [Cursor("1", 100.0, (-1,)), Cursor("1", 200.0, (-2,)), Cursor("1", 300.0)]
    assert road_range(street(), cursors) == [Stretch("1", 100.0, 200.0, (-1,)), Stretch("1", 200.0, 300.0, (-2,))]


def test_length_truncates_the_range() -> None:
    roads = street()
    assert road_range(roads, [Cursor("1", 100.0), Cursor("1", 300.0)], 50.0) == [Stretch("1", 100.0, 150.0)]
    backwards = [Cursor("1", 300.0), Cursor("1", 100.0)]
    assert road_range(roads, backwards, 50.0) == [Stretch("1", 250.0, 300.0)]


def test_range_over_several_roads_follows_their_links() -> None:
    cursors = [Cursor("a", 60.0), Cursor("c", 30.0)]
    assert road_range(three_in_a_row(), cursors) == [
        Stretch("a", 60.0, 100.0),
        Stretch("b", 0.0, 100.0),
        Stretch("c", 0.0, 30.0),
    ]
    assert road_range(three_in_a_row(), cursors, 90.0) == [Stretch("a", 60.0, 100.0), Stretch("b", 0.0, 50.0)]
    assert road_range(three_in_a_row(turned=True), cursors, 90.0) == [
        Stretch("a", 60.0, 100.0),
        Stretch("b", 50.0, 100.0),
    ]
    backwards = [Cursor("c", 30.0), Cursor("a", 60.0)]
    assert road_range(three_in_a_row(), backwards) == [
        Stretch("c", 0.0, 30.0),
        Stretch("b", 0.0, 100.0),
        Stretch("a", 60.0, 100.0),
    ]


def test_range_follows_the_shortest_roads_not_the_fewest() -> None:
    """Road b of 300 m and the roads d and e of 30 m lead from a to c."""
    lanes = section_xml(right=lane_xml(-1, link=lane_links_xml(-1, -1)))
    links = {
        "a": successor_xml(junction="J"),
        "b": predecessor_xml("a") + successor_xml("c"),
        "c": predecessor_xml("b"),
        "d": predecessor_xml("a") + successor_xml("e"),
        "e": predecessor_xml("d") + successor_xml("c"),
    }
    lengths = {"a": 100.0, "b": 300.0, "c": 100.0, "d": 30.0, "e": 30.0}
    junctions = {"b": "J", "d": "J"}
    parts = [
        road_xml(name, length=lengths[name], link=link, lanes=lanes, junction=junctions.get(name, "-1"))
        for name, link in links.items()
    ]
    roads = RoadNetwork.parse(map_xml(*parts, rest=junction_xml("J", "a", {"b": -1, "d": -1})))
    stretches = road_range(roads, [Cursor("a", 0.0), Cursor("c", 100.0)])
    assert [stretch.road for stretch in stretches] == ["a", "d", "e", "c"]


def test_range_over_unknown_or_unlinked_roads_is_an_error() -> None:
    with pytest.raises(InputError, match="road '2' does not exist"):
        road_range(street(), [Cursor("1"), Cursor("2")])
    apart = RoadNetwork.parse(map_xml(road_xml("1", length=10.0), road_xml("2", length=10.0, y=100.0)))
    with pytest.raises(InputError, match="no chain of roads leads from road '1' to road '2'"):
        road_range(apart, [Cursor("1"), Cursor("2")])


def test_areas_cover_sites_in_range_and_polygon() -> None:
    lanes = TrafficLanes(street(1, 1))
    sites = SpawnAreas(lanes).driving
    inside = sites.subset(stretches_cover(lanes, [Stretch("1", 100.0, 200.0, (-1,))])(sites))
    assert len(inside) == 20
    assert inside.x.min() >= 100.0
    assert inside.x.max() <= 200.0
    assert np.all(inside.y < 0.0)
    within: SpawnSites = sites.subset(polygon([(100.0, -10.0), (200.0, -10.0), (200.0, 10.0), (100.0, 10.0)])(sites))
    assert len(within) == 40
    assert sorted({round(float(y), 2) for y in within.y}) == [-1.75, 1.75]
