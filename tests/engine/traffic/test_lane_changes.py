"""Tests of lane changes: the two criteria of MOBIL by numbers, and cars that apply them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from fleet_scene import add_car, car, street
from opendrive_xml import lane_links_xml, lane_xml, map_xml, predecessor_xml, road_xml, section_xml, successor_xml

from eidrive_scenario.base.geometry import overlap
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.traffic import Fleet, LaneChanger
from eidrive_scenario.traffic.lane_changes import Prospect, incentive, safe
from eidrive_scenario.traffic.spawning.bodies import library_bodies

BUMPERS = 4.6
"""Distance between the reference points of two cars in contact [m]."""


def prospect(**given: float) -> Prospect:
    names = ("own", "own_after", "new_follower", "new_follower_after", "old_follower", "old_follower_after")
    return Prospect(*(np.array([given.get(name, 0.0)]) for name in names))


def test_incentive_weights_own_gain_and_loss_of_followers() -> None:
    """(0.4 + 1.0) + 0.5·(-0.6 - 0.2 + 0.1 + 0.3) - 0.1 = 1.1, and 0.3 more towards the slow side."""
    case = prospect(
        own=-1.0,
        own_after=0.4,
        new_follower=0.2,
        new_follower_after=-0.6,
        old_follower=-0.3,
        old_follower_after=0.1,
    )
    assert incentive(LaneChanger(politeness=0.5, threshold=0.1), case, True) == pytest.approx(1.1)
    biased = LaneChanger(politeness=0.5, threshold=0.1, bias=0.3)
    assert incentive(biased, case, True) == pytest.approx(1.4)
    assert incentive(biased, case, False) == pytest.approx(0.8)


def test_safety_criterion_limits_braking_of_both_cars() -> None:
    changer = LaneChanger(safe_deceleration=4.0)
    assert safe(changer, prospect(new_follower_after=-4.0)).tolist() == [True]
    assert safe(changer, prospect(new_follower_after=-4.1)).tolist() == [False]
    assert safe(changer, prospect(own_after=-4.1)).tolist() == [False]


def lane_after_one_step(fleet: Fleet, name: str = "me") -> int:
    """Return the lane of a car after one decision of every driver."""
    fleet.step(None, 0.5)
    return fleet.lanes.keys[int(fleet.places([name])[0][0])].lane


def queue(roads: RoadNetwork, changer: LaneChanger, *, leader_gap: float, follower_gap: float | None = None) -> Fleet:
    """Return a fleet with a car, a leader and a follower.

    The car drives 20 m/s in the right of two lanes with a desired speed of 25 m/s. The leader drives 10 m/s. The
    follower is in the other lane.
    """
    fleet = Fleet(roads, changer=changer)
    add_car(fleet, car("me"), roads.location("1", -2, 400.0), speed=20.0, desired_speed=25.0)
    add_car(fleet, car("leader"), roads.location("1", -2, 400.0 + BUMPERS + leader_gap), speed=10.0, desired_speed=10.0)
    if follower_gap is not None:
        behind = roads.location("1", -1, 400.0 - BUMPERS - follower_gap)
        add_car(fleet, car("follower"), behind, speed=20.0, desired_speed=25.0)
    return fleet


def test_car_changes_lane_behind_a_slow_leader() -> None:
    """At a gap of 100 m the desired gap is 2 + 20 + 20·10/(2·√1.5) = 103.65 m.

    So a = 1 - 0.8⁴ - 1.0365² = -0.484 behind the leader, and +0.590 on the free lane.
    """
    assert lane_after_one_step(queue(street(), LaneChanger(), leader_gap=100.0)) == -1


def test_gain_below_the_threshold_prevents_lane_change() -> None:
    """The gain is (103.65 / gap)²: 1.074 at 100 m."""
    assert lane_after_one_step(queue(street(), LaneChanger(threshold=1.07), leader_gap=100.0)) == -1
    assert lane_after_one_step(queue(street(), LaneChanger(threshold=1.08), leader_gap=100.0)) == -2


def test_near_follower_in_target_lane_prevents_lane_change() -> None:
    """The follower would brake by (22 / gap)² - 0.590: 4.0 m/s² at 10.27 m."""
    egoistic = LaneChanger(politeness=0.0)
    assert lane_after_one_step(queue(street(), egoistic, leader_gap=100.0, follower_gap=10.4)) == -1
    assert lane_after_one_step(queue(street(), egoistic, leader_gap=100.0, follower_gap=10.1)) == -2


def test_polite_driver_does_not_change_ahead_of_near_follower() -> None:
    """At 20 m the follower loses (22/20)² = 1.21. The incentive is positive if 1.074 - 1.21·p > 0.1, for p < 0.805."""
    for politeness, lane in ((0.80, -1), (0.81, -2)):
        polite = LaneChanger(politeness=politeness)
        fleet = queue(street(), polite, leader_gap=100.0, follower_gap=20.0)
        assert lane_after_one_step(fleet) == lane


def test_polite_leader_changes_lane_for_faster_follower() -> None:
    """The leader loses nothing, and its follower gains 1.074: p·1.074 > 0.1 for p > 0.093."""
    for politeness, lane in ((0.09, -2), (0.10, -1)):
        roads = street()
        fleet = Fleet(roads, changer=LaneChanger(politeness=politeness))
        add_car(fleet, car("me"), roads.location("1", -2, 504.6), speed=10.0, desired_speed=10.0)
        add_car(fleet, car("follower"), roads.location("1", -2, 400.0), speed=20.0, desired_speed=25.0)
        assert lane_after_one_step(fleet) == lane


def test_car_changes_lanes_over_a_lane_of_width_0() -> None:
    lanes = section_xml(right=lane_xml(-1) + lane_xml(-2, 0) + lane_xml(-3))
    roads = RoadNetwork.parse(map_xml(road_xml(length=1000.0, lanes=lanes)))
    fleet = Fleet(roads, changer=LaneChanger(bias=0.3))
    add_car(fleet, car("me"), roads.location("1", -1, 500.0), speed=20.0, desired_speed=20.0)
    assert lane_after_one_step(fleet) == -3


def test_solid_marking_prevents_lane_change() -> None:
    for mark, lane in (("none", -2), ("decrease", -2), ("increase", -1)):
        assert lane_after_one_step(queue(street(mark=mark), LaneChanger(), leader_gap=100.0)) == lane


@pytest.mark.parametrize(
    ("rule", "begin", "end", "after"),
    [
        *(("RHT", 600, 700, -2), ("RHT", 560, 700, -1), ("RHT", 530, 540, -1), ("RHT", 0, 490, -2)),
        *(("LHT", 300, 400, -2), ("LHT", 300, 440, -1), ("LHT", 460, 470, -1), ("LHT", 510, 600, -2)),
    ],
)
def test_solid_stretch_of_a_marking_prevents_changes_that_reach_it(
    rule: str, begin: float, end: float, after: int
) -> None:
    """A change at 20 m/s lasts 4 s: it reaches from s = 500 m to 580 m, in left-hand traffic against s to 420 m."""
    marks = "".join(
        f'<roadMark sOffset="{s}" type="solid" laneChange="{change}"/>'
        for s, change in ((0, "both"), (begin, "none"), (end, "both"))
    )
    lanes = section_xml(right=lane_xml(-1, more=marks) + lane_xml(-2))
    roads = RoadNetwork.parse(map_xml(road_xml(length=1000.0, lanes=lanes, rule=rule)))
    fleet = Fleet(roads, changer=LaneChanger(bias=0.3))
    add_car(fleet, car("me"), roads.location("1", -1, 500.0), speed=20.0, desired_speed=20.0)
    assert lane_after_one_step(fleet) == after


def test_car_does_not_change_to_oncoming_lane() -> None:
    roads = street(1, 1)
    fleet = Fleet(roads)
    add_car(fleet, car("me"), roads.location("1", -1, 400.0), speed=20.0, desired_speed=25.0)
    add_car(fleet, car("leader"), roads.location("1", -1, 450.0), speed=10.0, desired_speed=10.0)
    assert lane_after_one_step(fleet) == -1


def test_free_car_returns_to_slow_lane_with_bias_only() -> None:
    # In left-hand traffic lane -1 of a one-way road drives against s, and its left neighbor is lane -2.
    for rule, bias, lane, after in (
        ("RHT", 0.0, -1, -1),
        ("RHT", 0.3, -1, -2),
        ("LHT", 0.3, -1, -2),
        ("LHT", 0.3, -2, -2),
    ):
        roads = street(rule=rule)
        fleet = Fleet(roads, changer=LaneChanger(bias=bias))
        add_car(fleet, car("me"), roads.location("1", lane, 500.0), speed=20.0, desired_speed=20.0)
        assert lane_after_one_step(fleet) == after


def test_one_of_two_cars_changes_into_the_same_gap() -> None:
    roads = street(right=3)
    fleet = Fleet(roads)
    for lane in (-1, -3):
        add_car(fleet, car(f"me{lane}"), roads.location("1", lane, 400.0), speed=20.0, desired_speed=25.0)
        add_car(fleet, car(f"leader{lane}"), roads.location("1", lane, 450.0), speed=10.0, desired_speed=10.0)
    fleet.step(None, 0.5)
    rows = fleet.places(["me-1", "me-3"])[0]
    assert sorted(fleet.lanes.keys[int(row)].lane for row in rows) in ([-2, -1], [-3, -2])


def test_lateral_path_is_a_quintic_of_stated_duration() -> None:
    """The path is 3.5 m along a quintic over v·4 s, with a maximum slope of 1.875·3.5/80 in the middle."""
    fleet = queue(street(), LaneChanger(politeness=0.0), leader_gap=100.0)
    path = [(place.x, place.y, place.yaw) for _ in range(160) if (place := fleet.step(None, 0.05)["me"])]
    x, y, yaw = np.array(path).T
    moving = (y > -5.25 + 1e-6) & (y < -1.75 - 1e-6)
    assert y[[0, -1]] == pytest.approx([-5.25, -1.75])
    assert np.ptp(x[moving]) == pytest.approx(80.0, abs=2.5)
    assert np.all(np.diff(y) > -1e-9)
    assert np.max(np.abs(yaw)) == pytest.approx(math.atan(1.875 * 3.5 / 80.0), rel=0.02)
    assert np.arctan2(np.diff(y), np.diff(x)) == pytest.approx(0.5 * (yaw[1:] + yaw[:-1]), abs=2e-3)


def test_bus_changes_lanes_without_its_front_in_the_oncoming_lane() -> None:
    """The oncoming lane is at y > 0. The bus changes at 3 m/s from behind a car of 1 m/s."""
    (bus,) = (spec for spec, _ in library_bodies("bus"))
    roads = street(1, 2)
    fleet = Fleet(roads)
    add_car(fleet, bus, roads.location("1", -2, 400.0), speed=3.0, desired_speed=3.0)
    add_car(fleet, car("leader"), roads.location("1", -2, 440.0), speed=1.0, desired_speed=1.0)
    for _ in range(600):
        pose = fleet.step(None, 0.05)[bus.name]
        length, width, _ = bus.size
        front = bus.offset[0] + 0.5 * length
        assert pose.y + math.sin(pose.yaw) * front + 0.5 * math.cos(pose.yaw) * width < 0.0
    assert pose.y == pytest.approx(-1.75)


def test_changing_car_brakes_for_standing_car_beyond_a_nearer_faster_one() -> None:
    """By the model with v0 = 25 m/s, for a gap of 80 m in the new lane; that of 40 m in the former lane is no limit."""
    roads = street()
    fleet = queue(roads, LaneChanger(), leader_gap=100.0)
    assert lane_after_one_step(fleet) == -1
    x, v = float(fleet.places(["me"])[1][0]), fleet.speeds["me"]
    add_car(fleet, car("fast"), roads.location("1", -2, x + BUMPERS + 40.0), speed=v)
    add_car(fleet, car("standing"), roads.location("1", -1, x + BUMPERS + 80.0), desired_speed=0.0)
    fleet.step(None, 0.05)
    expected = 1.0 - (v / 25.0) ** 4 - ((2.0 + v + v * v / (2.0 * math.sqrt(1.5))) / 80.0) ** 2
    assert (fleet.speeds["me"] - v) / 0.05 == pytest.approx(expected)


@pytest.mark.statistical
def test_end_of_merging_lane_does_not_hide_followers_before_it() -> None:
    """Lanes -1 and -2 merge at s = 100 m; a car of 20 m/s follows a slow one 13 m ahead in the next lane."""
    merging = lane_xml(-1, link=lane_links_xml(after=-1)).replace('b="0"', 'b="-0.01"')
    before = merging + lane_xml(-2, link=lane_links_xml(after=-1)) + lane_xml(-3, link=lane_links_xml(after=-2))
    after = lane_xml(-1, link=lane_links_xml(before=-1)) + lane_xml(-2, link=lane_links_xml(before=-3))
    lanes = section_xml(right=before) + section_xml(right=after, s=100)
    roads = RoadNetwork.parse(map_xml(road_xml(length=300.0, lanes=lanes)))
    fleet = Fleet(roads)
    add_car(fleet, car("me"), roads.location("1", -2, 108.0), speed=6.0, desired_speed=13.0)
    add_car(fleet, car("standing"), roads.location("1", -2, 130.0), desired_speed=0.01)
    add_car(fleet, car("late"), roads.location("1", -1, 95.0), speed=20.0)
    assert lane_after_one_step(fleet) == -2


def test_dense_traffic_changes_lanes_without_contact() -> None:
    roads = street(right=3, length=3000.0)
    rng = np.random.default_rng(3)
    fleet = Fleet(roads, seed=2)
    for k in range(45):
        place = roads.location("1", -1 - k % 3, 20.0 + 14.0 * k)
        add_car(fleet, car(f"car{k}"), place, speed=12.0, desired_speed=float(rng.uniform(9.0, 25.0)))
    lanes = {name: {0} for name in fleet.names}
    for tick in range(1200):
        fleet.step(None, 0.05)
        for name, row in zip(fleet.names, fleet.places(fleet.names)[0].tolist(), strict=True):
            lanes[name].add(fleet.lanes.keys[row].lane)
        if tick % 4 == 0:
            boxes = fleet.boxes
            near = np.triu(np.hypot(*(boxes[:, None, :2] - boxes[None, :, :2]).transpose(2, 0, 1)) < 6.0, 1)
            assert not [(i, j) for i, j in zip(*np.nonzero(near), strict=True) if overlap(boxes[i], boxes[j])]
    assert sum(len(found) > 2 for found in lanes.values()) > 10


def ending_lane(link: str) -> RoadNetwork:
    """Return two lanes, of which the right one tapers off from s = 250 to 300 m, and a following road."""

    taper = (
        f'<lane id="-2" type="driving"><link>{link}</link><width sOffset="0" a="3.5" b="0" c="0" d="0"/>'
        '<width sOffset="250" a="3.5" b="-0.07" c="0" d="0"/></lane>'
    )
    both = section_xml(right=lane_xml(-1, link=lane_links_xml(after=-1)) + taper)
    one = section_xml(right=lane_xml(-1, link=lane_links_xml(-1)))
    return RoadNetwork.parse(
        map_xml(
            road_xml("1", length=300.0, link=successor_xml("2"), lanes=both),
            road_xml("2", length=300.0, x=300.0, link=predecessor_xml("1"), lanes=one),
        )
    )


def test_lane_that_narrows_beside_another_ends_there() -> None:
    """Parking bays as a lane: it opens from 100 m on, is 3 m wide from 130 to 200 m, and 2.2 m at 208 m of 0.1 m/m."""
    widths = ((0, 0.0, 0.0), (100, 0.0, 0.1), (130, 3.0, 0.0), (200, 3.0, -0.1), (230, 0.0, 0.0))
    width = "".join(f'<width sOffset="{s}" a="{a}" b="{b}" c="0" d="0"/>' for s, a, b in widths)
    bays = f'<lane id="-2" type="driving"><link/>{width}</lane>'
    lanes = section_xml(right=lane_xml(-1) + bays)
    fleet = Fleet(RoadNetwork.parse(map_xml(road_xml("1", length=300.0, lanes=lanes))))
    assert fleet.lanes.ends_at[np.isfinite(fleet.lanes.ends_at)] == pytest.approx([210.0])


@pytest.mark.exhaustive
@pytest.mark.parametrize("link", ["", lane_links_xml(after=-1)])
def test_cars_leave_lane_that_ends_or_merges(link: str) -> None:
    """The lane is narrower than 2.2 m from s = 250 + 1.3/0.07 = 268.6 m on; the next sample is at 270 m."""
    roads = ending_lane(link)
    fleet = Fleet(roads)
    assert fleet.lanes.ends_at[np.isfinite(fleet.lanes.ends_at)] == pytest.approx([270.0])
    for k in range(6):
        add_car(fleet, car(f"right{k}"), roads.location("1", -2, 20.0 + 25.0 * k), speed=13.0, desired_speed=14.0)
        add_car(fleet, car(f"left{k}"), roads.location("1", -1, 10.0 + 25.0 * k), speed=13.0, desired_speed=14.0)
    arrived: set[str] = set()
    for _ in range(1600):
        placements = fleet.step(None, 0.05)
        arrived |= {name for name, place in placements.items() if place.x > 310.0}
        for name, place in placements.items():
            if place.y < -4.2:
                assert place.x < 270.0, name
        boxes = fleet.boxes
        near = np.triu(np.hypot(*(boxes[:, None, :2] - boxes[None, :, :2]).transpose(2, 0, 1)) < 6.0, 1)
        assert not [(i, j) for i, j in zip(*np.nonzero(near), strict=True) if overlap(boxes[i], boxes[j])]
    assert len(arrived) == 12
