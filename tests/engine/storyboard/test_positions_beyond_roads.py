"""Positions relative to an entity beyond the end of its road, and distances on closed tracks."""

from __future__ import annotations

import math
from typing import Any

import pytest
from opendrive_xml import (
    lane_links_xml,
    lane_xml,
    map_xml,
    predecessor_xml,
    ring_xml,
    road_xml,
    section_xml,
    successor_xml,
)

from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.positions.resolution import resolve_position


@pytest.mark.element("RelativeRoadPosition", "RelativeLanePosition")
@pytest.mark.parametrize("lane", [-1, -2, 1])
@pytest.mark.parametrize("ahead", [True, False])
def test_relative_position_on_the_next_road_is_measured_along_its_reference_line(
    context: Any, lane: int, ahead: bool
) -> None:
    """A straight road continues with a bend of 30 m radius: 40 m of road are 42.7 to 50.7 m of lane."""
    links = lane_links_xml(before=lane, after=lane)
    lanes = section_xml(
        *(
            (lane_xml(1, 4.0, link=links), "")
            if lane > 0
            else ("", "".join(lane_xml(n, 4.0, link=lane_links_xml(n, n)) for n in (-1, -2)))
        )
    )
    first = road_xml("1", length=100.0, link=successor_xml("2"), lanes=lanes)
    second = road_xml("2", length=80.0, x=100.0, curvature=1.0 / 30.0, link=predecessor_xml("1"), lanes=lanes)
    roads = RoadNetwork.parse(map_xml(first, second))
    made = RuntimeContext(context.scenario, roads, dt=0.1, seed=0)
    here = roads.location("1", lane, 90.0) if ahead else roads.location("2", lane, 40.0)
    made.add_actor("A", ResolvedPosition(roads.pose(here), here))
    ds, expected = (50.0, ("2", 40.0)) if ahead else (-50.0, ("1", 90.0))
    for position in (
        model.Position(relative_road_position=model.RelativeRoadPosition(entity_ref="A", ds=ds, dt=0)),
        model.Position(relative_lane_position=model.RelativeLanePosition(entity_ref="A", d_lane=0, ds=ds)),
    ):
        found = resolve_position(position, made).location
        assert found is not None
        assert (found.road, found.lane) == (expected[0], lane)
        assert found.s == pytest.approx(expected[1], abs=1e-6)


@pytest.mark.element("RelativeRoadPosition")
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("dt", [0.0, 1.0])
@pytest.mark.parametrize("ds", [40.0, 60.0, 80.0, -40.0, -60.0, -80.0])
def test_relative_road_position_beyond_shifted_lanes_keeps_its_direction(
    context: Any, ds: float, dt: float, turned: bool
) -> None:
    """A lane offset of -3.5 m at both ends of the road moves lane 1 to the t of the entity, which is in lane -1.

    Road 2 continues road 1 at the end that `ds` passes, at s = 0 or, if `turned`, with the opposite reference line.
    """
    way = 1 if ds > 0.0 else -1
    other = -1 if turned else 1
    offsets = "".join(
        f'<laneOffset s="{s}" a="{a}" b="{b}" c="0" d="0"/>'
        for s, a, b in ((0, -3.5, 0), (5, -3.5, 0.1), (40, 0, 0), (60, 0, -0.1), (95, -3.5, 0))
    )
    lanes = section_xml(
        *(lane_xml(n, link=lane_links_xml(after=n * other) if way > 0 else lane_links_xml(n * other)) for n in (1, -1))
    )
    shifted = f'<laneOffset s="0" a="{-3.5 * other}" b="0" c="0" d="0"/>' + section_xml(lane_xml(1), lane_xml(-1))
    contact = "start" if way == other else "end"
    link = successor_xml("2", contact) if way > 0 else predecessor_xml("2", contact)
    roads = RoadNetwork.parse(
        map_xml(
            road_xml("1", link=link, lanes=offsets + lanes),
            road_xml(
                "2",
                x=50.0 + way * (50.0 if contact == "start" else 150.0),
                hdg=math.pi if turned else 0.0,
                lanes=shifted,
            ),
        )
    )
    made = RuntimeContext(context.scenario, roads, dt=0.1, seed=0)
    here = roads.location("1", -1, 50.0)
    made.add_actor("A", ResolvedPosition(roads.pose(here), here))
    frame = model.RelativeRoadPosition(entity_ref="A", ds=ds, dt=dt)
    pose = resolve_position(model.Position(relative_road_position=frame), made).pose
    assert (pose.x, pose.y) == pytest.approx((50.0 + ds, -1.75 + dt))


@pytest.fixture(scope="module")
def ring() -> RoadNetwork:
    """Closed track of two roads, half circles with a radius of 50 m, counter-clockwise."""
    lanes = section_xml(lane_xml(1, 4.0, link=lane_links_xml(1, 1)), lane_xml(-1, 4.0, link=lane_links_xml(-1, -1)))
    return RoadNetwork.parse(ring_xml(50.0, lanes))


HALF = 50.0 * math.pi
"""Length of each road of the ring [m]."""


@pytest.mark.parametrize("ds", [20.0, 150.0, 170.0, 220.0, 300.0, 400.0, -20.0, -170.0, -250.0])
@pytest.mark.parametrize("lane", [-1, 1])
def test_relative_road_position_on_a_closed_track_is_the_driven_distance(
    context: Any, ring: RoadNetwork, ds: float, lane: int
) -> None:
    made = RuntimeContext(context.scenario, ring, dt=0.1, seed=0)
    here = ring.location("a", lane, HALF - 30.0)
    made.add_actor("A", ResolvedPosition(ring.pose(here), here))
    frame = model.RelativeRoadPosition(entity_ref="A", ds=ds, dt=0)
    found = resolve_position(model.Position(relative_road_position=frame), made).location
    assert found is not None
    road, s = divmod((HALF - 30.0 + ds) % (2.0 * HALF), HALF)
    assert (found.road, found.lane) == ("ab"[int(road)], lane)
    assert found.s == pytest.approx(s)


@pytest.mark.parametrize("one_road", [False, True])
@pytest.mark.parametrize("lane", [-1, 1])
def test_distance_on_a_closed_track_is_the_shorter_way(one_road: bool, lane: int) -> None:
    """A road of 300 m and one of 14 m, or one road linked with itself, on a circle with a radius of 50 m."""
    around = 100.0 * math.pi
    lanes = section_xml(lane_xml(1, 4.0, link=lane_links_xml(1, 1)), lane_xml(-1, 4.0, link=lane_links_xml(-1, -1)))

    def part(number: str, other: str, begin: float, length: float) -> str:
        angle = begin / 50.0
        return road_xml(
            number,
            x=50.0 * math.cos(angle),
            y=50.0 * math.sin(angle),
            hdg=angle + math.pi / 2.0,
            length=length,
            curvature=0.02,
            link=predecessor_xml(other) + successor_xml(other),
            lanes=lanes,
        )

    parts = (
        [part("1", "1", 0.0, around)]
        if one_road
        else [part("1", "2", 0.0, 300.0), part("2", "1", 300.0, around - 300.0)]
    )
    roads = RoadNetwork.parse(map_xml(*parts))
    way = -lane
    for a, b in ((290.0, 10.0), (10.0, 290.0), (20.0, 120.0), (120.0, 20.0), (5.0, 299.0)):
        found = roads.distance(roads.location("1", lane, a), roads.location("1", lane, b))
        ahead = (b - a + around / 2.0) % around - around / 2.0
        assert found == pytest.approx((ahead * way, 0.0))
        assert roads.orientation(roads.location("1", lane, a), roads.location("1", lane, b)) == 1


@pytest.mark.parametrize("sense", [1, -1])
def test_distance_in_one_sense_leads_around_a_closed_track(ring: RoadNetwork, sense: int) -> None:
    for lane in (-1, 1):
        a, b = ring.location("a", lane, 20.0), ring.location("a", lane, 50.0)
        ahead = 30.0 * -lane
        expected = ahead if ahead * sense > 0.0 else ahead - math.copysign(2.0 * HALF, ahead)
        assert ring.distance(a, b, sense=sense) == pytest.approx((expected, 0.0))
        assert ring.distance(a, a, sense=sense) == pytest.approx((0.0, 0.0))
