"""Right of way between a tight turn and the lane beside its exit, where the front of a vehicle swings out."""

from __future__ import annotations

import math

import pytest
from opendrive_xml import lane_links_xml, lane_xml, map_xml, road_xml, section_xml

from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.model.location import LaneKey
from eidrive_scenario.traffic.lanes import TrafficLanes
from eidrive_scenario.traffic.right_of_way import Crossings
from eidrive_scenario.traffic.spawning.bodies import library_bodies
from eidrive_scenario.traffic.sweeps import Sweeps


def turn_beside_a_lane(radius: float) -> TrafficLanes:
    """Return a junction: road 2 turns right into the lane at y = -3.5 beside road 1, a straight with its lane at y = 0.

    `radius` [m] is that of the lane of road 2.
    """
    lane = section_xml(right=lane_xml(-1, link=lane_links_xml(-1, -1)))
    bend = f'<arc curvature="{-1.0 / (radius + 1.75)}"/>'
    length = 0.5 * math.pi * (radius + 1.75)
    entry = f'<geometry s="0" x="0" y="{-1.75 - radius - 1.75}" hdg="{math.pi / 2}" length="{length}">{bend}</geometry>'
    straight = road_xml("1", length=200.0, x=-20.0, y=1.75, junction="9", lanes=lane)
    turn = road_xml("2", length=length, geometry=entry, junction="9", lanes=lane)
    return TrafficLanes(RoadNetwork.parse(map_xml(straight, turn)))


@pytest.mark.parametrize(("radius", "conflict"), [(2.5, True), (12.0, False)])
def test_tight_turn_conflicts_with_the_lane_beside_its_exit(radius: float, conflict: bool) -> None:
    """The outer front corner of a van 4.7 m before its rear axle swings out by 2.4 m at a radius of 2.5 m, and by 0.8 m
    at 12 m; half widths of 1 m and 1.05 m leave 1.45 m.
    """
    lanes = turn_beside_a_lane(radius)
    crossings = Crossings(lanes)
    straight, turn = (lanes.row_of(LaneKey(road, 0, -1)) for road in ("1", "2"))
    assert (turn in crossings.meeting(straight)) is conflict
    assert (straight in crossings.meeting(turn)) is conflict


@pytest.mark.parametrize(
    ("category", "radius", "swept"), [("bus", 12.0, True), ("bus", 60.0, False), ("car", 12.0, False)]
)
def test_bus_sweeps_over_the_lane_beside_the_exit_of_its_turn(category: str, radius: float, swept: bool) -> None:
    """The front corner of the bus is 8.705 m ahead of its rear axle and, without 0.35 m, 0.925 m beside it. It is 3.6 m
    outside of the path of the axle at a radius of 12 m and 1.5 m at 60 m; the lane beside begins at 1.75 m.
    """
    lanes = turn_beside_a_lane(radius)
    straight, turn = (lanes.row_of(LaneKey(road, 0, -1)) for road in ("1", "2"))
    spec, _ = library_bodies(category)[0]
    assert (straight in Sweeps(lanes).of(spec, [turn])) is swept
