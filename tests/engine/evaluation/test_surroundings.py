"""Relations of actors along lanes: a right turn with a known length."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from opendrive_xml import (
    lane_xml,
    lanes_xml,
    map_xml,
    predecessor_xml,
    ring_xml,
    road_xml,
    section_xml,
    successor_xml,
)

from eidrive_scenario.evaluation.surroundings import Relation, Surroundings
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.world.view import WorldView

ROADS = RoadNetwork.load(Path(__file__).parents[3] / "xosc" / "roads" / "coop_1.xodr")
TURN = "105"
"""Connecting road of the right turn from road 2 to road 3; 18.35 m long."""

Pose = tuple[float, float, float, float]


def view(**actors: Pose) -> WorldView:
    """Return boxes 4 m by 2 m at x, y, yaw with a speed; the reference point is the center of the box."""
    x, y, yaw, speed = np.array(list(actors.values())).T
    count = len(actors)
    zeros = np.zeros(count)
    return WorldView(
        time=0.0,
        tick=0,
        names=tuple(actors),
        categories=("car",) * count,
        position=np.stack([x, y, zeros], axis=1),
        yaw=yaw,
        pitch=zeros,
        roll=zeros,
        velocity=np.stack([speed * np.cos(yaw), speed * np.sin(yaw), zeros], axis=1),
        acceleration=np.zeros((count, 3)),
        yaw_rate=zeros,
        speed=speed,
        size=np.ones((count, 1)) * (4.0, 2.0, 1.5),
        offset=np.ones((count, 1)) * (0.0, 0.0, 0.75),
    )


def at(road: str, lane: int, s: float, speed: float = 5.0) -> Pose:
    """Return the pose at the center of a lane in its driving direction."""
    pose = ROADS.lane_pose_at(road, lane, s)
    return pose.x, pose.y, pose.h + (0.0 if ROADS.driving_direction(road, lane) > 0 else math.pi), speed


def test_gap_to_leader_follows_the_lane_around_a_bend() -> None:
    """10 m from the start of the turn to its end, 6 m on the next road: 24.35 m - 4 m along the reference line."""
    length = ROADS.roads[TURN].length
    following = next(ROADS.links.beyond_road(TURN, 1))[0]
    assert following == "3"
    lane = next(lane for lane in (-2, -1) if math.dist(at("3", lane, 0.0)[:2], at(TURN, -1, length)[:2]) < 0.5)
    cars = view(Ego=at(TURN, -1, 2.0), Lead=at("3", lane, 6.0, speed=3.0))
    leader = Surroundings(ROADS).leader(cars, "Ego")
    assert leader is not None
    assert leader.gap == pytest.approx(length - 2.0 + 6.0 - 4.0, abs=0.01)
    assert leader.speed == pytest.approx(5.0)
    assert leader.other_speed == pytest.approx(3.0)
    assert leader.left == pytest.approx(0.0, abs=0.05)
    assert Surroundings(None).leader(cars, "Ego") is None, "a straight path misses the car around the corner"


def test_car_on_the_other_side_is_oncoming_beside() -> None:
    cars = view(Ego=at("1", -1, 20.0), Other=at("1", 1, 60.0, speed=4.0))
    (other_actor,) = Surroundings(ROADS).relations(cars, "Ego")
    assert other_actor.gap == pytest.approx(36.0)
    assert other_actor.side_gap == pytest.approx(1.5)
    assert other_actor.other_speed == pytest.approx(-4.0)
    assert not other_actor.leads
    assert not other_actor.wrong_way


def test_actor_in_the_wrong_lane_is_recognized() -> None:
    x, y, yaw, speed = at("1", 1, 20.0)
    cars = view(Ego=(x, y, yaw + math.pi, speed), Other=at("1", 1, 60.0))
    (other_actor,) = Surroundings(ROADS).relations(cars, "Ego")
    assert other_actor.wrong_way
    assert other_actor.gap == pytest.approx(36.0)


def test_car_straight_across_the_junction_leads() -> None:
    cars = view(Ego=at("1", -1, 90.0), Lead=at("2", -1, 10.0))
    leader = Surroundings(ROADS).leader(cars, "Ego")
    assert leader is not None
    assert leader.gap == pytest.approx(10.0 + 34.5 + 10.0 - 4.0, abs=0.05)


def test_actor_off_all_roads_has_straight_coordinates() -> None:
    cars = view(Ego=(-500.0, -500.0, 0.0, 5.0), Lead=(-480.0, -500.0, 0.0, 0.0))
    leader = Surroundings(ROADS).leader(cars, "Ego")
    assert leader is not None
    assert leader.gap == pytest.approx(16.0)


def test_actors_away_from_the_lane_have_no_relation() -> None:
    """Cars on the crossing road and in a row 60 m beside the lane."""
    others = {f"Far{n}": (-80.0 + 5.0 * n, -60.0, 0.0, 5.0) for n in range(20)}
    cars = view(Ego=at("1", -1, 20.0), Lead=at("1", -1, 50.0), Crossing=at("3", -1, 90.0), **others)
    assert [other_actor.other for other_actor in Surroundings(ROADS).relations(cars, "Ego")] == ["Lead"]


def test_absent_actor_has_no_relations() -> None:
    assert list(Surroundings(ROADS).relations(view(Lead=at("1", -1, 20.0)), "Ego")) == []


def relation(roads: RoadNetwork, own: tuple[str, int, float], other: tuple[str, int, float]) -> Relation:
    """Return the relation to another car, both at road, lane and s, in the direction of their lanes."""

    def pose(road: str, lane: int, s: float) -> Pose:
        place = roads.lane_pose_at(road, lane, s)
        return place.x, place.y, place.h + (0.0 if roads.driving_direction(road, lane) > 0 else math.pi), 5.0

    (other_actor,) = Surroundings(roads).relations(view(Ego=pose(*own), Lead=pose(*other)), "Ego")
    return other_actor


SHIFT = 3.5
"""Lateral shift of the lanes between s = 40 and s = 80 m [m]."""


def shifted_road() -> RoadNetwork:
    """Return a road whose lanes shift to the left by one width, between 40 and 80 m, by its lane offset."""
    cubic = f'<laneOffset s="40" a="0" b="0" c="{3 * SHIFT / 40**2}" d="{-2 * SHIFT / 40**3}"/>'
    offsets = f'<laneOffset s="0" a="0" b="0" c="0" d="0"/>{cubic}<laneOffset s="80" a="{SHIFT}" b="0" c="0" d="0"/>'
    return RoadNetwork.parse(map_xml(road_xml(length=200.0, lanes=offsets + lanes_xml(1, 2))))


@pytest.mark.parametrize(("own", "lead"), [(-1, 120.0), (-2, 120.0), (-1, 60.0)])
def test_car_in_the_same_lane_after_a_lane_offset_leads(own: int, lead: float) -> None:
    other_actor = relation(shifted_road(), ("1", own, 20.0), ("1", own, lead))
    assert other_actor.leads
    assert other_actor.left == pytest.approx(0.0, abs=1e-9)


def test_car_straight_ahead_after_a_lane_offset_does_not_lead() -> None:
    """After the shift, lane -2 is where lane -1 was."""
    other_actor = relation(shifted_road(), ("1", -1, 20.0), ("1", -2, 120.0))
    assert not other_actor.leads
    assert other_actor.left == pytest.approx(-3.5)


@pytest.mark.parametrize(("lane", "leads"), [(-2, True), (-1, False)])
def test_lane_beside_a_new_lane_continues(lane: int, leads: bool) -> None:
    """From 60 m on a pocket lane -1 begins, and the lane continues as -2."""
    before = section_xml(lane_xml(1), lane_xml(-1, link='<successor id="-2"/>'))
    after = section_xml(lane_xml(1), lane_xml(-1) + lane_xml(-2, link='<predecessor id="-1"/>'), s=60)
    roads = RoadNetwork.parse(map_xml(road_xml(length=200.0, lanes=before + after)))
    other_actor = relation(roads, ("1", -1, 20.0), ("1", lane, 120.0))
    assert other_actor.leads is leads
    behind = relation(roads, ("1", -2, 70.0), ("1", -1, 50.0))
    assert behind.left == pytest.approx(0.0)
    assert behind.ahead == pytest.approx(-20.0)


def test_car_beyond_the_end_of_the_own_lane_is_beside() -> None:
    """Lane -2 ends at 60 m."""
    lanes = lanes_xml(1, 2) + lanes_xml(1, 1, s=60)
    roads = RoadNetwork.parse(map_xml(road_xml(length=200.0, lanes=lanes)))
    assert relation(roads, ("1", -2, 20.0), ("1", -1, 120.0)).left == pytest.approx(3.5)
    assert relation(roads, ("1", -1, 20.0), ("1", -1, 120.0)).leads


@pytest.mark.parametrize(("reach", "aheads"), [(200.0, []), (400.0, [301.75])])
def test_gap_beyond_200_m_follows_the_lane(reach: float, aheads: list[float]) -> None:
    """10 m of road a, 240 m of b and 50 m of c, which turns left with a radius of 50 m, 51.75 m in the right lane."""
    lanes = section_xml(lane_xml(1), lane_xml(-1, link='<predecessor id="-1"/><successor id="-1"/>'))
    roads = RoadNetwork.parse(
        map_xml(
            road_xml("a", length=20.0, link=successor_xml("b"), lanes=lanes),
            road_xml("b", length=240.0, x=20.0, link=predecessor_xml("a") + successor_xml("c"), lanes=lanes),
            road_xml("c", length=100.0, x=260.0, curvature=1.0 / 50.0, link=predecessor_xml("b"), lanes=lanes),
        )
    )
    cars = view(
        Ego=(10.0, -1.75, 0.0, 5.0), Lead=(260.0 + 51.75 * math.sin(1.0), 50.0 - 51.75 * math.cos(1.0), 1.0, 5.0)
    )
    relations = list(Surroundings(roads).relations(cars, "Ego", reach=reach))
    assert [each.ahead for each in relations] == pytest.approx(aheads, rel=1e-3)
    assert all(each.leads for each in relations)


@pytest.mark.parametrize(("lane", "radius"), [(-2, 25.25), (-1, 21.75), (1, 18.25), (2, 14.75)])
def test_gap_in_a_bend_is_measured_along_the_lane(lane: int, radius: float) -> None:
    """A third of a circle on the first of two half circles of 20 m, and over their joint."""
    sides = [
        "".join(lane_xml(n, link=f'<predecessor id="{n}"/><successor id="{n}"/>') for n in numbers)
        for numbers in ((2, 1), (-1, -2))
    ]
    roads = RoadNetwork.parse(ring_xml(20.0, section_xml(*sides)))
    way = roads.driving_direction("a", lane)
    for first, second in (((1, 5.0), (1, 5.0 + 20.0 * math.pi / 3.0)), ((1, 50.0), (2, 50.0 + 20.0 * math.pi / 3.0))):
        places = []
        for _, s in (first, second)[::way]:
            half = 20.0 * math.pi
            places.append(("a", lane, s) if s < half else ("b", lane, s - half))
        other_actor = relation(roads, *places)
        assert other_actor.ahead == pytest.approx(radius * math.pi / 3.0, rel=2e-3)
        assert other_actor.leads


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize(("lane", "beside"), [(-2, -1), (-1, -2), (-1, 1), (1, 2), (2, 1)])
def test_actor_behind_the_border_of_a_road_in_a_curve(lane: int, beside: int, reverse: bool) -> None:
    """2 m beyond the border of two roads around (0, 40), with a radius of 40 m, to an actor 8 m before the border.

    In half of the cases, s of the first road runs against that of the second one.
    """

    def lanes(before: int, after: int) -> str:
        left2, left1, right1, right2 = (
            lane_xml(n, link=f'<predecessor id="{n * before}"/><successor id="{n * after}"/>') for n in (2, 1, -1, -2)
        )
        return section_xml(left2 + left1, right1 + right2)

    def place(number: int, at: float) -> tuple[str, int, float]:
        if at > 0.0:
            return "b", number, at
        return ("a", -number, -at) if reverse else ("a", number, 60.0 + at)

    x, y = -40.0 * math.sin(1.5), 40.0 - 40.0 * math.cos(1.5)
    first = road_xml("a", length=60.0, x=x, y=y, hdg=-1.5, curvature=0.025, link=successor_xml("b"), lanes=lanes(1, 1))
    if reverse:
        link = predecessor_xml("b", "start")
        first = road_xml("a", length=60.0, hdg=math.pi, curvature=-0.025, link=link, lanes=lanes(-1, 1))
    link = predecessor_xml("a", "start" if reverse else "end")
    second = road_xml("b", length=60.0, curvature=0.025, link=link, lanes=lanes(-1 if reverse else 1, 1))
    roads = RoadNetwork.parse(map_xml(first, second))
    way = -1 if lane > 0 else 1
    other_actor = relation(roads, place(lane, 2.0 * way), place(beside, -8.0 * way))
    own, other = ((n - math.copysign(0.5, n)) * 3.5 for n in (lane, beside))
    assert other_actor.ahead == pytest.approx(-10.0 * (40.0 - own) / 40.0, rel=2e-3)
    assert other_actor.left == pytest.approx((other - own) * way)
    assert other_actor.side_gap == pytest.approx(1.5)
    assert abs(other_actor.other_side_speed) < 1e-6


def test_actor_behind_a_fork_or_a_merge_is_placed_straight() -> None:
    """The lane behind the Ego forks, with the other branch 30° to the right, or is one of two."""
    lanes = section_xml(right=lane_xml(-1, link='<predecessor id="-1"/><successor id="-1"/>'))
    ways = [road_xml(n, x=-100.0, link=successor_xml("c"), lanes=lanes) for n in ("a", "b")]
    own = road_xml("c", curvature=0.01, link=predecessor_xml("a"), lanes=lanes)
    branch = road_xml("d", y=-60.0, hdg=-0.5, link=predecessor_xml("a"), lanes=lanes)
    for roads in (map_xml(*ways, own), map_xml(ways[0], own, branch)):
        cars = view(Ego=(2.0, -1.75, 0.02, 5.0), Near=(-8.0, -1.75, 0.0, 5.0), Far=(-40.0, -1.75, 0.0, 5.0))
        aheads = {each.other: each.ahead for each in Surroundings(RoadNetwork.parse(roads)).relations(cars, "Ego")}
        assert aheads == {"Near": pytest.approx(-10.0 * math.cos(0.02))}
