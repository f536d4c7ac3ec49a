"""Number of lanes between places, along links of lanes."""

from __future__ import annotations

import pytest
from opendrive_xml import lane_links_xml, lane_xml, map_xml, predecessor_xml, road_xml, section_xml, successor_xml

from eidrive_scenario.roads import RoadNetwork


def road_with_pocket() -> RoadNetwork:
    """Return a road whose lane -1 continues as -2 beside a new lane -1 from 60 m on, and a road beyond."""
    before = section_xml(lane_xml(1), lane_xml(-1, link=lane_links_xml(after=-2)))
    left = lane_xml(1, link=lane_links_xml(before=1))
    after = section_xml(left, lane_xml(-1) + lane_xml(-2, link=lane_links_xml(-1, -1)), s=60)
    beyond = section_xml("", lane_xml(-1, link=lane_links_xml(before=-2)) + lane_xml(-2))
    first = road_xml("1", length=120.0, link=successor_xml("2"), lanes=before + after)
    second = road_xml("2", length=80.0, x=120.0, link=predecessor_xml("1"), lanes=beyond)
    return RoadNetwork.parse(map_xml(first, second))


@pytest.mark.parametrize(
    ("a", "b", "lanes"),
    [
        (("1", -1, 20.0), ("1", -1, 40.0), 0),
        (("1", -1, 20.0), ("1", 1, 40.0), 1),
        (("1", -1, 20.0), ("1", -2, 80.0), 0),
        (("1", -1, 20.0), ("1", 1, 80.0), 1),
        (("1", 1, 20.0), ("1", -2, 80.0), -1),
        (("1", -1, 20.0), ("1", -1, 80.0), 1),
        (("1", -2, 80.0), ("1", -1, 20.0), 0),
        (("1", -1, 80.0), ("1", -1, 20.0), -1),
        (("1", -1, 20.0), ("2", -1, 30.0), 0),
        (("1", -1, 20.0), ("2", -2, 30.0), -1),
        (("2", -2, 30.0), ("1", -1, 20.0), 1),
    ],
)
def test_lanes_are_counted_from_the_lane_that_continues(
    a: tuple[str, int, float], b: tuple[str, int, float], lanes: int
) -> None:
    roads = road_with_pocket()
    assert roads.lanes_between(roads.location(*a), roads.location(*b)) == lanes


def test_lanes_of_opposite_roads_are_counted_from_the_first_road() -> None:
    """Head to head: lane -1 of the first road continues as lane 1 of the second one, whose s runs backward."""
    first = road_xml(
        "1",
        length=100.0,
        link=successor_xml("2", "end"),
        lanes=section_xml("", lane_xml(-1, link=lane_links_xml(after=1)) + lane_xml(-2, link=lane_links_xml(after=2))),
    )
    second = road_xml(
        "2",
        length=80.0,
        x=180.0,
        hdg=3.141592653589793,
        link=successor_xml("1", "end"),
        lanes=section_xml(lane_xml(2, link=lane_links_xml(after=-2)) + lane_xml(1, link=lane_links_xml(after=-1)), ""),
    )
    roads = RoadNetwork.parse(map_xml(first, second))
    assert roads.lanes_between(roads.location("1", -1, 50.0), roads.location("2", 1, 30.0)) == 0
    assert roads.lanes_between(roads.location("1", -1, 50.0), roads.location("2", 2, 30.0)) == -1
    assert roads.lanes_between(roads.location("2", 1, 30.0), roads.location("1", -2, 50.0)) == 1
