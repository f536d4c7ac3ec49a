"""Steps within a lane section, compared with those through sections, links and junctions."""

from __future__ import annotations

import random
from collections.abc import Iterator

from opendrive_xml import map_xml, road_xml

from eidrive_scenario.extensions.library import library_path
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.routing.steady_lanes import SteadyLane

DISTANCES = (1e-9, 0.01, 0.3, 2.0, 7.0, 60.0, 500.0)
"""Lengths of the steps [m]."""


CUBICS = """<geometry s="0" x="0" y="0" hdg="0.3" length="60">
<paramPoly3 pRange="arcLength" aU="0" bU="1" cU="0" dU="-1e-5" aV="0" bV="0" cV="4e-3" dV="-3e-5"/></geometry>
<geometry s="60" x="55" y="25" hdg="0.4" length="40">
<paramPoly3 pRange="normalized" aU="0" bU="40" cU="0" dU="-1" aV="0" bV="0" cV="-3" dV="2"/></geometry>"""
"""Plan view of 100 m of cubics."""
SLOPE = '<elevationProfile><elevation s="0" a="1" b="0.04" c="-1e-4" d="0"/></elevationProfile>'


def networks() -> Iterator[RoadNetwork]:
    """Yield the roads of the library, and a road of cubics with and without a slope."""
    yield from map(RoadNetwork.load, sorted(library_path().rglob("*.xodr")))
    for profiles in ("", SLOPE):
        text = map_xml(road_xml(geometry=CUBICS, profiles=profiles))
        yield RoadNetwork.parse(text.encode(), "cubics")


def test_step_in_section_equals_advance_and_lane_pose_bit_by_bit() -> None:
    draw, compared = random.Random(4), 0
    for network in networks():
        for _ in range(60):
            road = draw.choice(list(network.roads.values()))
            section = draw.choice(road.sections)
            s = draw.choice([section.s, draw.uniform(section.s, section.end)])
            lanes = network.lane_ids(road.id, s)
            here = network.location(road.id, draw.choice(lanes), s, draw.uniform(-1.0, 1.0))
            distance = draw.choice([1.0, -1.0]) * draw.choice(DISTANCES)
            within = network.movement.step_in_section(here, distance)
            if within is not None:
                reached = network.advance(here, distance)
                assert reached == within[0]
                assert network.lane_pose_at(reached.road, reached.lane, reached.s, reached.offset) == within[1]
                compared += 1
    assert compared > 100


def test_steps_to_the_ends_of_steady_parts_equal_advance_bit_by_bit() -> None:
    """Parts end at lane sections and at curves of the reference line; steps that do not remain within one have none."""
    draw, compared, ended = random.Random(8), 0, 0
    for network in networks():
        for road in network.roads.values():
            ends = [*road.reference.starts, *road.section_starts, road.length]
            s = draw.uniform(0.0, road.length)
            for number in network.lane_ids(road.id, s):
                here = network.location(road.id, number, s, draw.uniform(-1.0, 1.0))
                lane = SteadyLane(road, number, 1)
                for distance in (end - s + change for end in ends for change in (-1e-6, -1e-15, 0.0, 1e-15, 1e-6)):
                    within = lane.step(s, here.offset, distance)
                    ended += within is None
                    if within is not None:
                        sense = network.driving_direction(road.id, number)
                        reached = network.advance(here, distance * sense)
                        assert reached is not None
                        assert repr(reached) == repr(within[0])
                        place = (reached.road, reached.lane, reached.s, reached.offset)
                        assert repr(network.lane_pose_at(*place)) == repr(within[1])
                        compared += 1
    assert compared > 1000
    assert ended > 1000
