"""Tests of cars that follow lanes and leaders."""

import math
from dataclasses import replace

import numpy as np
import pytest
from fleet_scene import LENGTH, add_car, car, view_of
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

from eidrive_scenario.base.geometry import overlap
from eidrive_scenario.extensions.library import library_path
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.traffic import Fleet, IntelligentDriver
from eidrive_scenario.traffic.spawning.bodies import library_bodies
from eidrive_scenario.world.actor import Placement

DT = 0.05
RADIUS = 100.0


@pytest.fixture(scope="module")
def loop() -> RoadNetwork:
    """Circle of radius 100 m in two roads; lane -1 runs counter-clockwise at 102 m from the center."""
    return RoadNetwork.parse(ring_xml(RADIUS, section_xml(right=lane_xml(-1, 4, link=lane_links_xml(-1, -1)))))


def gaps(placements: dict[str, Placement]) -> list[float]:
    """Return the gaps between bumpers along the circle from each car to the next."""
    angles = np.sort([math.atan2(p.y, p.x) for p in placements.values()])
    between = np.diff(np.append(angles, angles[0] + 2 * math.pi))
    return [float(angle) * (RADIUS + 2.0) - LENGTH for angle in between]


@pytest.mark.exhaustive
def test_ring_of_cars_converges_to_equilibrium_gap(loop: RoadNetwork) -> None:
    driver = IntelligentDriver(lateral_acceleration=9.0)
    fleet = Fleet(loop, driver=driver)
    rng = np.random.default_rng(5)
    count = 24
    for k in range(count):
        place = (k + 0.3 * rng.uniform(-1, 1)) * 2 * math.pi * RADIUS / count % (2 * math.pi * RADIUS)
        road, s = ("a", place) if place < math.pi * RADIUS else ("b", place - math.pi * RADIUS)
        add_car(fleet, car(f"car{k}"), loop.location(road, -1, s), speed=float(rng.uniform(0, 6)), desired_speed=15.0)
    smallest = math.inf
    for _ in range(8000):
        smallest = min(smallest, *gaps(fleet.step(None, DT)))
    assert smallest > 0.5
    speeds = np.array(list(fleet.speeds.values()))
    assert np.ptp(speeds) < 0.2
    mean_gap = 2 * math.pi * (RADIUS + 2.0) / count - LENGTH
    speed = float(speeds.mean())
    # Equation 5 of the paper on the intelligent driver model
    equilibrium_gap = (driver.standstill_gap + speed * driver.time_gap) / math.sqrt(
        1.0 - (speed / 15.0) ** driver.exponent
    )
    assert equilibrium_gap == pytest.approx(mean_gap, rel=0.02)


def test_shorter_time_steps_give_the_same_positions(loop: RoadNetwork) -> None:
    """Drivers decide every 0.05 s and the curvature is constant, so that positions are equal in each step."""
    places = {}
    for dt in (0.05, 0.01):
        fleet = Fleet(loop)
        for k, speed in enumerate((3.0, 12.0, 8.0)):
            add_car(fleet, car(f"car{k}"), loop.location("a", -1, 20.0 + 25.0 * k), speed=speed, desired_speed=13.0)
        path = [fleet.step(None, dt) for _ in range(round(20.0 / dt))]
        places[dt] = path[round(0.05 / dt) - 1 :: round(0.05 / dt)]
    for coarse, fine in zip(places[0.05], places[0.01], strict=True):
        for name, there in coarse.items():
            assert (fine[name].x, fine[name].y, fine[name].speed) == pytest.approx((there.x, there.y, there.speed))


def test_car_added_between_decisions_reacts_in_the_next_step(loop: RoadNetwork) -> None:
    """A car is added 8 m ahead of a car that drives 10 m/s. The follower brakes in the next step."""
    fleet = Fleet(loop)
    add_car(fleet, car("first"), loop.location("a", -1, 20.0), speed=10.0, desired_speed=13.0)
    fleet.step(None, 0.01)
    add_car(fleet, car("second"), loop.location("a", -1, 20.0 + LENGTH + 8.0), speed=0.0)
    before = fleet.speeds["first"]
    fleet.step(None, 0.01)
    assert fleet.speeds["first"] < before - 0.05


@pytest.mark.exhaustive
def test_string_of_cars_stops_for_obstacle_and_restarts_after_its_removal(loop: RoadNetwork) -> None:
    fleet = Fleet(loop)
    for k in range(5):
        add_car(fleet, car(f"car{k}"), loop.location("a", -1, 100.0 - 20.0 * k), speed=10.0, desired_speed=13.0)
    pose = loop.lane_pose_at("a", -1, 250.0)
    wall = {"wall": Placement(pose.x, pose.y, yaw=pose.h)}
    closest = math.inf
    for _ in range(1200):
        placements = fleet.step(view_of(wall), DT)
        closest = min(closest, *gaps(placements | wall))
    queue = sorted(gaps(placements | wall))[:5]
    assert closest > 1.5
    assert all(speed < 0.05 for speed in fleet.speeds.values())
    assert queue == pytest.approx([2.0] * 5, abs=0.5)
    for _ in range(400):
        fleet.step(view_of({}), DT)
    assert min(fleet.speeds.values()) > 5.0


def test_car_beside_the_lane_is_ignored(loop: RoadNetwork) -> None:
    fleet = Fleet(loop)
    add_car(fleet, car("car"), loop.location("a", -1, 50.0), speed=10.0, desired_speed=10.0)
    pose = loop.lane_pose_at("a", -1, 90.0, -4.0)
    for _ in range(100):
        fleet.step(view_of({"parked": Placement(pose.x, pose.y, yaw=pose.h)}), DT)
    assert fleet.speeds["car"] > 9.9


def test_step_length_equals_speed_times_dt(loop: RoadNetwork) -> None:
    fleet = Fleet(loop)
    before = add_car(fleet, car("car"), loop.location("a", -1, 300.0), speed=12.0, desired_speed=12.0)
    assert before.teleport
    for _ in range(100):
        (after,) = fleet.step(None, DT).values()
        assert math.hypot(after.x - before.x, after.y - before.y) == pytest.approx(after.speed * DT, rel=0.01)
        assert math.hypot(after.x, after.y) == pytest.approx(RADIUS + 2.0)
        before = after


def test_cars_slow_down_ahead_of_a_bend(library_roads: RoadNetwork) -> None:
    fleet = Fleet(library_roads, seed=1, driver=IntelligentDriver(lateral_acceleration=2.0))
    for k in range(6):
        add_car(fleet, car(f"car{k}"), library_roads.location("3", 1, 80.0 - 14.0 * k), desired_speed=13.0)
    turned = False
    heading: dict[str, float] = {}
    for _ in range(1200):
        placements = fleet.step(None, DT)
        for name, place in placements.items():
            rate = math.remainder(place.yaw - heading.get(name, place.yaw), 2 * math.pi) / DT
            turned |= abs(rate) > 0.3
            assert abs(rate) * place.speed < 2.0 * 1.4
            heading[name] = place.yaw
    assert turned


def crossing_fleet(library_roads: RoadNetwork, seed: int, *, bus: bool = False) -> Fleet:
    fleet = Fleet(library_roads, seed=seed)
    lanes = [(road, n) for road, lanes in {"1": (-1, -2), "2": (2, 3), "3": (1,), "4": (-1,)}.items() for n in lanes]
    for road, n in lanes:
        for k in range(4):
            length = library_roads.roads[road].length
            s = length - 12.0 - 16.0 * k if n < 0 else 12.0 + 16.0 * k
            if road in ("1", "4"):
                s = length - 12.0 - 16.0 * k
            spec = (
                replace(library_bodies("bus")[0][0], name=f"{road}/{n}/{k}")
                if bus and k % 2
                else car(f"{road}/{n}/{k}")
            )
            add_car(fleet, spec, library_roads.location(road, n, s), speed=5.0)
    return fleet


@pytest.mark.exhaustive
@pytest.mark.parametrize("bus", [False, True])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_vehicles_pass_a_crossing_without_contact(library_roads: RoadNetwork, seed: int, bus: bool) -> None:
    fleet = crossing_fleet(library_roads, seed, bus=bus)
    gone: set[str] = set()
    for tick in range(4000):
        placements = fleet.step(None, DT)
        gone |= fleet.departed
        if tick % 5 == 0 and len(placements) > 1:
            boxes = fleet.boxes
            near = np.hypot(*(boxes[:, None, :2] - boxes[None, :, :2]).transpose(2, 0, 1)) < 13.0
            for i, j in zip(*np.nonzero(np.triu(near, 1)), strict=True):
                assert not overlap(boxes[i], boxes[j]), (list(placements)[i], list(placements)[j])
        if not placements:
            break
    assert len(gone) == 24


def test_cars_wait_for_foreign_car_in_crossing(library_roads: RoadNetwork) -> None:
    fleet = Fleet(library_roads)
    add_car(fleet, car("car"), library_roads.location("3", 1, 8.0), speed=8.0)
    route = library_roads.route(library_roads.location("1", -1, 90.0), library_roads.location("2", -1, 40.0))
    for tick in range(200):
        pose = route.pose_at(min(4.0 * tick * DT, route.length))
        ego = Placement(pose.x, pose.y, yaw=pose.h, speed=4.0)
        placements = fleet.step(view_of({"ego": ego}), DT)
        boxes = view_of({"ego": ego} | placements).boxes
        assert len(boxes) == 1 or not overlap(boxes[0], boxes[1])


def test_car_on_a_circle_waits_before_its_second_passage() -> None:
    """The circle of 107 m is within sight as a whole. Its lower half and a street across it are one junction, in which
    the car starts. A foreign car drives on the street until 40 s, 33 m beyond the circle.
    """
    lane = section_xml(right=lane_xml(-1, 4, link=lane_links_xml(-1, -1)))
    halves = [
        road_xml(
            name,
            length=math.pi * 15.0,
            x=x,
            hdg=hdg,
            curvature=1.0 / 15.0,
            link=predecessor_xml(other) + successor_xml(other),
            lanes=lane,
            junction=junction,
        )
        for name, other, x, hdg, junction in (("a", "b", 15.0, math.pi / 2, "-1"), ("b", "a", -15.0, -math.pi / 2, "9"))
    ]
    street = road_xml("c", length=60.0, x=2.0, y=-5.0, hdg=-math.pi / 2, lanes=lane, junction="9")
    fleet = Fleet(RoadNetwork.parse(map_xml(*halves, street)))
    add_car(fleet, car("car"), fleet.lanes.roads.location("b", -1, 5.0), speed=5.0)
    foreign = {"foreign": Placement(0.0, -50.0, yaw=-math.pi / 2, speed=1.0)}
    below = []
    for tick in range(1200):
        (place,) = fleet.step(view_of(foreign if tick < 800 else {}), DT).values()
        below.append(place.y < 0.0)
    left = below.index(False)
    assert not any(below[left:800])
    assert any(below[800:])


def test_cars_that_wait_for_each_other_on_a_circle_move_on() -> None:
    """Four cars of 4.5 m stand on links of 7 m before connecting roads of 22 m. None has the space of its length and
    the standstill gap behind the junction before the next car has moved. All then complete the circle of 116 m.
    """
    lane = section_xml(right=lane_xml(-1, link=lane_links_xml(-1, -1)))
    radius = 116.0 / (2.0 * math.pi)
    roads, angle = [], 0.0
    for number in range(8):
        length = 22.0 if number % 2 else 7.0
        link = predecessor_xml(str((number - 1) % 8)) + successor_xml(str((number + 1) % 8))
        roads.append(
            road_xml(
                str(number),
                length=length,
                x=radius * math.cos(angle),
                y=radius * math.sin(angle),
                hdg=angle + 0.5 * math.pi,
                curvature=1.0 / radius,
                junction=str(number) if number % 2 else "-1",
                link=link,
                lanes=lane,
            )
        )
        angle += length / radius
    circle = RoadNetwork.parse(map_xml(*roads))
    fleet = Fleet(circle)
    for road in "0246":
        add_car(fleet, car(road), circle.location(road, -1, 1.5), speed=0.0)
    before, covered = fleet.placements(), dict.fromkeys("0246", 0.0)
    for _ in range(1200):
        after = fleet.step(None, DT)
        for name, place in after.items():
            covered[name] += math.hypot(place.x - before[name].x, place.y - before[name].y)
        before = after
    assert min(covered.values()) > 116.0


@pytest.mark.exhaustive
def test_buses_leave_a_roundabout_with_short_links() -> None:
    """Buses of 12.1 m cannot stop on the links of 8.1 m between the exits, so that none may enter to wait there."""
    roads = RoadNetwork.load(library_path() / "roads" / "roundabout.xodr")
    fleet = Fleet(roads)
    spec, _ = library_bodies("bus")[0]
    for road in "1234":
        for number, s in enumerate((20.0, 40.0, 60.0)):
            add_car(fleet, replace(spec, name=f"{road}.{number}"), roads.location(road, 1, s), speed=5.0)
    for _ in range(round(300.0 / DT)):
        fleet.step(None, DT)
    assert not fleet.names


def test_branches_depend_on_the_seed(library_roads: RoadNetwork) -> None:
    def traces(seed: int) -> list[Placement]:
        fleet = crossing_fleet(library_roads, seed)
        for _ in range(300):
            placements = fleet.step(None, DT)
        return list(placements.values())

    same, again, other = traces(1), traces(1), traces(2)
    assert same == again
    assert same != other


def test_add_with_used_name_is_an_error_until_removal(loop: RoadNetwork) -> None:
    fleet = Fleet(loop)
    add_car(fleet, car("car"), loop.location("a", -1, 10.0))
    with pytest.raises(ValueError, match="'car' is in the fleet already"):
        add_car(fleet, car("car"), loop.location("a", -1, 30.0))
    fleet.remove("car")
    assert fleet.step(None, DT) == {}
    add_car(fleet, car("car"), loop.location("a", -1, 30.0))
    assert fleet.names == ("car",)


@pytest.mark.exhaustive
def test_cars_keep_their_order_over_a_long_run(loop: RoadNetwork) -> None:
    fleet = Fleet(loop)
    wishes = (6.0, 14.0, 9.0, 12.0)
    for k, wish in enumerate(wishes):
        add_car(fleet, car(f"car{k}"), loop.location("a", -1, 280.0 - 30.0 * k), desired_speed=wish)
    for _ in range(3000):
        placements = fleet.step(None, DT)
        ahead = sorted(placements, key=lambda name: math.atan2(placements[name].y, placements[name].x))
        start = ahead.index("car0")
        assert ahead[start:] + ahead[:start] == ["car0", "car3", "car2", "car1"]
    assert min(gaps(placements)) > 1.0
    assert max(fleet.speeds.values()) < 6.5
