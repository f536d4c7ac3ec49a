"""Right of way between a tight turn and the lane beside its exit, where the front of a van swings out."""

from __future__ import annotations

import math

import pytest
from opendrive_xml import lane_links_xml, lane_xml, map_xml, road_xml, section_xml

from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.model.location import LaneKey
from eidrive_scenario.traffic.lanes import TrafficLanes
from eidrive_scenario.traffic.right_of_way import Crossings


@pytest.mark.parametrize(("radius", "conflict"), [(2.5, True), (12.0, False)])
def test_tight_turn_conflicts_with_the_lane_beside_its_exit(radius: float, conflict: bool) -> None:
    """Road 2 turns right into the lane at y = -3.5 beside road 1, which is straight with its lane at y = 0.

    The outer front corner of a van 4.7 m before its rear axle swings out by 2.4 m at a radius of 2.5 m, and by 0.8 m at
    12 m; half widths of 1 m and 1.05 m leave 1.45 m.
    """
    lane = section_xml(right=lane_xml(-1, link=lane_links_xml(-1, -1)))
    bend = f'<arc curvature="{-1.0 / (radius + 1.75)}"/>'
    length = 0.5 * math.pi * (radius + 1.75)
    entry = f'<geometry s="0" x="0" y="{-1.75 - radius - 1.75}" hdg="{math.pi / 2}" length="{length}">{bend}</geometry>'
    roads = RoadNetwork.parse(
        map_xml(
            road_xml("1", length=40.0, x=-20.0, y=1.75, junction="9", lanes=lane),
            road_xml("2", length=length, geometry=entry, junction="9", lanes=lane),
        )
    )
    lanes = TrafficLanes(roads)
    crossings = Crossings(lanes)
    straight, turn = (lanes.row_of[LaneKey(road, 0, -1)] for road in ("1", "2"))
    assert (turn in crossings.meeting(straight)) is conflict
    assert (straight in crossings.meeting(turn)) is conflict
