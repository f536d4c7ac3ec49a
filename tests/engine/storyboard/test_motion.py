"""Scripted motion with values by hand: lane -1 along y = -2 towards +x, lane 1 along y = 2 towards -x."""

from __future__ import annotations

import math
from typing import Any

import pytest
from opendrive_xml import lane_links_xml, lane_xml, map_xml, predecessor_xml, road_xml, section_xml, successor_xml

from eidrive_scenario.roads import Pose, RoadNetwork
from eidrive_scenario.storyboard.kinematics.motion import LateralStep, Motion
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition


def on_lane(roads: Any, lane: Any, s: Any, *, heading: Any = 0.0, offset: Any = 0.0) -> Any:
    motion = Motion(roads)
    here = roads.location("1", lane, s, offset)
    motion.teleport(ResolvedPosition(roads.pose(here).turned(heading), here))
    motion.initialize()
    return motion


def test_motion_without_roads_is_straight() -> None:
    motion = Motion(None)
    motion.teleport(ResolvedPosition(Pose(1.0, 2.0, 0.5, math.pi / 2, 0.0, 0.0)))
    motion.initialize()
    motion.set_speed(10.0)
    placement = motion.step(0.1)
    assert (placement.x, placement.y, placement.z) == pytest.approx((1.0, 3.0, 0.5))


def test_actor_without_roads_stops_after_a_trajectory_unless_another_one_follows() -> None:
    motion = Motion(None)
    motion.set_speed(10.0)
    speeds = []
    for x, is_end in ((1.0, True), (2.0, False), (3.0, True)):
        motion.move_to(Pose(x, 0.0, 0.0, 0.0, 0.0, 0.0), land=is_end)
        speeds.append(motion.step(0.1).speed)
    assert speeds == [10.0, 10.0, 10.0]
    standing = motion.step(0.1)
    assert (standing.x, standing.speed) == (3.0, 0.0)


def test_teleported_actor_is_at_its_position_in_the_next_view() -> None:
    motion = Motion(None)
    motion.teleport(ResolvedPosition(Pose(1.0, 2.0, 0.0, 0.0, 0.0, 0.0)))
    motion.set_speed(10.0)
    first, second = motion.step(0.1), motion.step(0.1)
    assert (first.x, first.teleport) == (1.0, True)
    assert (second.x, second.teleport) == (2.0, False)


@pytest.mark.parametrize(
    ("lane", "heading", "speed", "x", "yaw"),
    [
        (-1, 0.0, 10.0, 101.0, 0.0),
        (1, 0.0, 10.0, 99.0, math.pi),
        (-1, math.pi, 10.0, 99.0, math.pi),
        (-1, 0.0, -10.0, 99.0, 0.0),
    ],
)
def test_actor_follows_its_lane_in_its_direction(
    street: Any, lane: Any, heading: Any, speed: Any, x: Any, yaw: Any
) -> None:
    motion = on_lane(street, lane, 100.0, heading=heading)
    motion.set_speed(speed)
    placement = motion.step(0.1)
    assert placement.x == pytest.approx(x)
    assert math.cos(placement.yaw - yaw) == pytest.approx(1.0)
    assert placement.y == pytest.approx(2.0 if lane > 0 else -2.0)


def test_speed_in_bend_is_that_of_the_actor(bend: Any) -> None:
    """Lane -1 is a circle of 52 m: 10 m are 10/52 rad of it."""
    motion = on_lane(bend, -1, 0.0)
    motion.set_speed(10.0)
    for _ in range(10):
        placement = motion.step(0.1)
    angle = 10.0 / 52.0
    assert placement.x == pytest.approx(52.0 * math.sin(angle), abs=1e-6)
    assert placement.y == pytest.approx(50.0 - 52.0 * math.cos(angle), abs=1e-6)
    assert placement.yaw == pytest.approx(angle)
    assert not placement.across, "it goes where it points, although the chord of a step points elsewhere"


def test_actor_stops_at_the_end_of_the_road(street: Any) -> None:
    motion = on_lane(street, -1, 199.5)
    motion.set_speed(10.0)
    placement = motion.step(0.1)
    assert placement.x == 200.0
    assert motion.end_of_road
    assert motion.step(0.1).speed == 0.0


def section(s: float, number: int, link: str = "") -> str:
    lane = lane_xml(number, 4, link=link)
    return section_xml(right=lane, s=s) if number < 0 else section_xml(lane, s=s)


NARROWED = section_xml(lane_xml(2, 4, link=lane_links_xml(1)) + lane_xml(1, 4, kind="none"), s=100)
"""Section whose lane 2 continues lane 1 of the section before, beside a lane 1 without a link."""


@pytest.mark.parametrize(
    ("sections", "lane", "start", "speed", "end"),
    [
        (section(0, -1) + section(100, 1), -1, 99.0, 30.0, 100.0),
        (section(0, -1) + section(100, 1), 1, 101.0, 30.0, 100.0),
        (section(0, 1) + section(100, -1), -1, 101.0, -30.0, 100.0),
        (section(0, -2, lane_links_xml(after=-1)) + section(199, -1, lane_links_xml(-2)), -2, 198.0, 30.0, 200.0),
        (section(0, 1) + NARROWED, 1, 101.0, 30.0, 100.0),
    ],
)
def test_step_beyond_the_end_of_a_lane_stops_there(
    sections: str, lane: int, start: float, speed: float, end: float
) -> None:
    """Lanes that end inside their road, lanes with another id in the last section, and one linked to none of its id."""
    motion = on_lane(RoadNetwork.parse(map_xml(road_xml(length=200.0, lanes=sections))), lane, start)
    motion.set_speed(speed)
    assert motion.step(0.1).x == pytest.approx(end)
    assert motion.end_of_road
    placement = motion.step(0.1)
    assert (placement.x, placement.speed) == (pytest.approx(end), 0.0)


def roads_with_opposed_lanes() -> RoadNetwork:
    """Lane -1 of road 1 meets lane 1 of road 2, whose traffic drives towards it: both along y = -2 from x = 0 to 200.

    Sidewalks on maps of CARLA are linked so.
    """
    first = section_xml(right=lane_xml(-1, 4, kind="sidewalk", link=lane_links_xml(after=1)))
    second = section_xml(lane_xml(1, 4, kind="sidewalk", link=lane_links_xml(-1)))
    return RoadNetwork.parse(
        map_xml(
            road_xml("1", link=successor_xml("2"), lanes=first),
            road_xml("2", x=100.0, y=-4.0, link=predecessor_xml("1"), lanes=second),
        )
    )


@pytest.mark.parametrize(
    ("heading", "speed", "x"), [(0.0, 10.0, 101.0), (0.0, -10.0, 79.0), (math.pi, -10.0, 101.0), (math.pi, 10.0, 79.0)]
)
def test_actor_that_enters_a_lane_against_the_traffic_keeps_its_yaw(heading: float, speed: float, x: float) -> None:
    motion = on_lane(roads_with_opposed_lanes(), -1, 90.0, heading=heading)
    motion.set_speed(speed)
    for _ in range(11):
        placement = motion.step(0.1)
    assert (placement.x, placement.y) == pytest.approx((x, -2.0))
    assert math.cos(placement.yaw - heading) == pytest.approx(1.0)
    motion.set_speed(-speed)
    for _ in range(11):
        placement = motion.step(0.1)
    assert (placement.x, placement.y) == pytest.approx((90.0, -2.0))
    assert math.cos(placement.yaw - heading) == pytest.approx(1.0)


def test_lateral_step_into_a_lane_against_the_traffic_keeps_its_side() -> None:
    motion = on_lane(roads_with_opposed_lanes(), -1, 99.5)
    motion.set_speed(10.0)
    motion.set_lateral_step(LateralStep(0.6))
    placement = motion.step(0.1)
    assert (placement.x, placement.y) == pytest.approx((100.3, -1.4))
    assert placement.yaw == pytest.approx(math.atan2(0.6, 0.8))


@pytest.mark.parametrize(("lane", "y"), [(-1, -1.4), (1, 1.4)])
def test_lateral_step_moves_left_and_shortens_the_distance(street: Any, lane: Any, y: Any) -> None:
    """Steps of 0.6 m to the left and 0.8 m along the lane are 1 m in total."""
    motion = on_lane(street, lane, 100.0)
    motion.set_speed(10.0)
    motion.set_lateral_step(LateralStep(0.6))
    placement = motion.step(0.1)
    sign = -math.copysign(1.0, lane)
    assert (placement.x, placement.y) == pytest.approx((100.0 + sign * 0.8, y))
    along = 0.0 if lane < 0 else math.pi
    assert math.sin(placement.yaw - along) == pytest.approx(0.6)


def test_reference_lane_may_be_the_oncoming_lane(street: Any) -> None:
    motion = on_lane(street, -1, 100.0)
    assert motion.set_reference_lane(1).offset == pytest.approx(-4.0)
    assert motion.direction == -1
    motion.set_speed(10.0)
    assert motion.step(0.1).x == pytest.approx(101.0)


def test_actor_pointing_across_the_road_crosses_it(street: Any) -> None:
    motion = on_lane(street, -1, 100.0, heading=math.pi / 2)
    motion.set_speed(2.0)
    for _ in range(10):
        placement = motion.step(0.1)
    assert (placement.x, placement.y) == pytest.approx((100.0, 0.0), abs=1e-9)


@pytest.mark.parametrize(
    ("x", "y", "yaw", "expected"),
    [
        (-20.0, -2.0, 0.0, (20.0, -2.0)),
        (210.0, -2.0, 0.0, (250.0, -2.0)),
        (-20.0, 30.0, math.pi / 2, (-20.0, 70.0)),
        (100.0, -60.0, math.pi / 2, (100.0, -20.0)),
    ],
)
def test_actor_outside_the_road_drives_straight_on(
    street: Any, x: float, y: float, yaw: float, expected: tuple[float, float]
) -> None:
    """40 m in steps of 1 m: onto the road, away from its end, past its corner, and toward its side."""
    motion = Motion(street)
    motion.teleport(ResolvedPosition(Pose(x, y, 0.0, yaw, 0.0, 0.0), street.locate_at(x, y)))
    motion.initialize()
    motion.set_speed(10.0)
    for _ in range(40):
        before, placement = motion.pose, motion.step(0.1)
        assert math.dist(before[:2], (placement.x, placement.y)) == pytest.approx(1.0)
    assert (placement.x, placement.y) == pytest.approx(expected)
    assert placement.yaw == pytest.approx(yaw)


def test_actor_snaps_to_its_lane_after_free_pose(street: Any) -> None:
    motion = on_lane(street, -1, 100.0)
    motion.set_speed(10.0)
    motion.move_to(Pose(120.0, -6.5, 0.0, 0.0, 0.0, 0.0), land=True)
    assert motion.step(0.1).x == 120.0
    placement = motion.step(0.1)
    assert (placement.x, placement.y) == pytest.approx((121.0, -6.5))
    assert motion.location.lane == -2


def test_move_along_lane_covers_the_distance_in_one_step(street: Any) -> None:
    motion = on_lane(street, -1, 100.0)
    motion.set_speed(10.0)
    motion.move_along_lane(4.0)
    assert motion.step(0.1).x == pytest.approx(104.0)
    assert motion.step(0.1).x == pytest.approx(105.0)
