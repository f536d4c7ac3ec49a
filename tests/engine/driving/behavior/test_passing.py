"""Obstacles that the vehicle recognizes while it passes another one."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from opendrive_xml import map_xml, road_xml
from planned_drive import FRONT, LANE, KnownBox, PlannedDrive, behavior, two_lane_road
from signal_street import CAR

from eidrive_scenario.base.coverage import ViewSector
from eidrive_scenario.base.requests import Goal
from eidrive_scenario.driving.planning.behavior.proposals import Start, change_length, passing
from eidrive_scenario.driving.planning.signal_stops import StopPoint
from eidrive_scenario.extensions.library import library_path
from eidrive_scenario.roads import RoadNetwork


@pytest.mark.parametrize("y", [LANE, LANE - 1.0])
def test_parked_bus_that_another_hid_is_passed_as_well(y: float) -> None:
    """The second bus stands 4 m behind the first one, and is visible from 10 m before the rear of the first one.

    From where the vehicle stops it sees 48 m of the oncoming lane: it waits for 12 s, in which no traffic comes.
    """
    buses = [KnownBox(x, y, kind="bus", size=(12.0, 2.5)) for x in (80.0, 96.0)]
    roads = two_lane_road()
    run = PlannedDrive(behavior(roads), roads)
    run.run(36.0, lambda now: buses if run.path and run.path[-1][0] > 64.0 else buses[:1])
    run.world.close()
    assert run.front > 130.0
    assert run.path[-1][1] == pytest.approx(LANE, abs=0.1)
    assert min(speed for place, _, speed in run.path if 74.0 < place < 102.0) > 0.5


def test_row_of_parked_cars_longer_than_the_horizon_is_passed() -> None:
    """Cars every 12 m along 84 m, which take longer than 8 s at 6 m/s, without oncoming traffic."""
    cars = [KnownBox(60.0 + 12.0 * number) for number in range(8)]
    roads = two_lane_road()
    run = PlannedDrive(behavior(roads, 6.0), roads, speed=6.0)
    run.run(60.0, lambda now: cars)
    run.world.close()
    assert run.front > 170.0
    assert run.path[-1][1] == pytest.approx(LANE, abs=0.1)


def test_row_of_obstacles_is_no_queue_and_passed_without_a_stop() -> None:
    barriers = [KnownBox(100.0 + 7.0 * number, kind="misc", size=(3.0, 1.0)) for number in range(3)]
    roads = two_lane_road()
    run = PlannedDrive(behavior(roads), roads)
    run.run(18.0, lambda now: barriers)
    run.world.close()
    assert run.front > 130.0
    assert min(run.speeds) > 3.0


def _queue_that_sets_off(start: float) -> PlannedDrive:
    """Return a drive behind two cars, of which the first one hides the second one, which sets off first, at `start`."""

    def car(place: float, time: float) -> KnownBox:
        accelerates = min(max(time, 0.0), 4.0)
        return KnownBox(place + 1.1 * accelerates**2 + 8.8 * max(time - 4.0, 0.0), vx=2.2 * accelerates)

    def queue(now: float) -> list[KnownBox]:
        cars = [car(80.0, now - start - 1.5), car(88.0, now - start)]
        return cars if run.path and run.path[-1][0] > 55.0 else cars[:1]

    roads = two_lane_road()
    run = PlannedDrive(behavior(roads), roads)
    run.run(20.0, queue)
    run.world.close()
    assert run.front < queue(20.0)[0].x - 2.25
    return run


@pytest.mark.parametrize("start", [6.8, 7.8])
def test_pass_of_a_queue_that_sets_off_is_given_up(start: float) -> None:
    """The vehicle waits at the edge of its lane until 6.5 s, and is beside the first car at 10 s."""
    run = _queue_that_sets_off(start)
    assert any("pass car" in plan.reason for plan in run.plans[130:])
    assert max(y for _, y, _ in run.path) + CAR.size[1] / 2.0 < 0.1, "in its lane, within the error of the control"


@pytest.mark.parametrize(("start", "gives_up"), [(7.8, True), (8.8, False)])
def test_pass_of_a_queue_ends_where_comfortable_braking_suffices(start: float, *, gives_up: bool) -> None:
    """At v the vehicle stops within v² / (2 · 2 m/s²). The second car moves, with 0.5 m/s, 0.23 s after it sets off."""
    run = _queue_that_sets_off(start)
    x, _, speed = run.path[round((start + 0.5 / 2.2) / 0.05)]
    rear = 80.0 - 2.25
    assert (x + FRONT + speed**2 / (2.0 * 2.0) < rear) is gives_up
    # In the decision after that, 0.1 s later.
    assert ("pass car" not in run.reasons[round((start + 0.5) / 0.05)]) is gives_up


def test_standing_car_is_passed_once_what_it_may_wait_behind_is_considered() -> None:
    """At 30 m/s the window ends after 8 s and 40 m, 280 m ahead of the vehicle. A queue has gaps of up to 15 m.

    A maneuver begins when it has been the best one for 0.5 s.
    """
    roads = two_lane_road(1200.0)
    run = PlannedDrive(behavior(roads, 30.0), roads, speed=30.0)
    run.run(6.0, lambda now: [KnownBox(400.0)], goal=Goal(waypoints=np.array([[1100.0, LANE, 0.0]])))
    run.world.close()
    begins = next(number for number, reason in enumerate(run.reasons) if "pass" in reason)
    to_front = 400.0 + 2.25 - run.path[begins][0]
    assert 280.0 - 15.0 - 30.0 * (0.5 + 0.2) < to_front < 280.0 - 15.0


def test_queue_at_a_light_may_be_passed_a_time_after_green(monkeypatch: pytest.MonkeyPatch) -> None:
    """The car has stood for 30 s, of which the light is red for 24 s; its queue counts for 20 s of green."""
    roads = two_lane_road()
    planner = behavior(roads)
    stop = StopPoint(58.0, "red light")
    monkeypatch.setattr(planner, "_stop", lambda *arguments: stop if arguments[-1] < 24.0 else None)
    run = PlannedDrive(planner, roads)
    run.run(60.0, lambda now: [KnownBox(60.0), KnownBox(68.0)])
    run.world.close()
    begins = next(number for number, reason in enumerate(run.reasons) if "pass" in reason)
    assert begins * 0.05 == pytest.approx(44.0, abs=0.2)


@pytest.mark.parametrize(("length", "overtakes"), [(420.0, False), (700.0, True)])
def test_moving_vehicle_is_overtaken_with_space_before_the_end_of_the_route(length: float, overtakes: bool) -> None:
    """A bus is 2.6 m/s slower. The vehicle comes out of its lane at 255 m, and gains 45 m, with both lengths, within
    200 m: until 455 m."""
    roads = two_lane_road(length)
    run = PlannedDrive(behavior(roads, 11.6), roads, speed=9.0)
    run.run(50.0, lambda now: [KnownBox(65.0 + 9.0 * now, vx=9.0, kind="bus", size=(12.0, 2.5))])
    run.world.close()
    assert (max(y for _, y, _ in run.path) > 0.0) is overtakes
    assert run.path[-1][1] == pytest.approx(LANE, abs=0.1)


def test_pedestrian_along_the_lane_is_overtaken() -> None:
    roads = two_lane_road()
    run = PlannedDrive(behavior(roads), roads)
    walker = KnownBox(80.0, LANE - 0.8, vx=1.4, kind="pedestrian", size=(0.5, 0.5))
    run.run(25.0, lambda now: [walker._replace(x=80.0 + 1.4 * now)])
    run.world.close()
    assert run.front > 80.0 + 1.4 * 25.0 + 10.0


def test_standing_car_is_passed_by_a_vehicle_at_walking_pace() -> None:
    # Along 40 m at 1.5 m/s: 27 s, and a wait behind the car.
    roads = two_lane_road()
    run = PlannedDrive(behavior(roads, 1.5), roads, speed=1.5)
    run.run(60.0, lambda now: [KnownBox(45.0)])
    run.world.close()
    assert run.front > 55.0


def test_pass_ends_behind_parked_cars_that_come_into_view() -> None:
    """Each car of a row of 36 m is visible from 25 m before the rear of the one before it. A car that comes at 10 m/s
    is beside the vehicle 12 s after the start, and the next one 20 s later: enough for the whole row."""
    row = [KnownBox(80.0 + 8.0 * number, LANE - 0.8) for number in range(5)]
    roads = two_lane_road(600.0)
    run = PlannedDrive(behavior(roads), roads)

    def objects(now: float) -> list[KnownBox]:
        x = run.path[-1][0] if run.path else 20.0
        oncoming = [KnownBox(start - 10.0 * now, 1.75, vx=-10.0, yaw=math.pi) for start in (180.0, 380.0)]
        return [*(car for number, car in enumerate(row) if not number or x > car.x - 33.0), *oncoming]

    run.run(32.0, objects)
    run.world.close()
    assert run.front > 130.0
    assert run.path[-1][1] == pytest.approx(LANE, abs=0.1)
    assert min(speed for place, _, speed in run.path if 80.0 < place < 112.0) > 3.0


def test_vehicle_returns_before_an_oncoming_car_that_has_stopped_for_it() -> None:
    """The car brakes from 9 m/s with 1.8 m/s², and stands 19 m behind a truck from 9 s on.

    From standstill 59 m before, the front of the vehicle is at 130 m after 8.8 s with 1.5 m/s².
    """
    truck, front = KnownBox(100.0, kind="truck", size=(8.0, 2.5)), 104.0 + 19.0

    def objects(now: float) -> list[KnownBox]:
        left = max(9.0 - 1.8 * max(now - 4.0, 0.0), 0.0)
        way = left**2 / (2.0 * 1.8) + 9.0 * max(4.0 - now, 0.0)
        return [truck, KnownBox(front + 2.25 + way, 1.75, vx=-left, yaw=math.pi)]

    roads = two_lane_road()
    planner = behavior(roads)
    planner.view = (ViewSector(0.0, 0.0, 1.8, 0.0, math.pi, 120.0),)
    run = PlannedDrive(planner, roads)
    run.run(18.0, objects)
    run.world.close()
    assert run.front > 130.0
    assert min(run.least_distance(body) for body in objects(18.0)) > 0.4


def test_vehicle_returns_behind_cones_between_the_lanes() -> None:
    """Cones lead out of the lane, which is free behind them, and for 25 m on between the lanes, one every 5 m."""
    closing = [KnownBox(80.0 + 4.0 * number, LANE * (2.0 - number / 4.0)) for number in range(8)]
    between = [KnownBox(112.0 + 5.0 * number, 0.0) for number in range(6)]
    cones = [cone._replace(kind="misc", size=(0.4, 0.4)) for cone in (*closing, *between)]
    roads = two_lane_road()
    run = PlannedDrive(behavior(roads), roads)
    run.run(28.0, lambda now: cones)
    run.world.close()
    assert run.front > 160.0
    assert run.path[-1][1] == pytest.approx(LANE, abs=0.1)
    assert min(run.least_distance(cone) for cone in cones) > 0.4


@pytest.mark.parametrize("gap", [20.0, 25.0])
def test_vehicle_returns_before_a_pedestrian_behind_the_passed_truck(gap: float) -> None:
    """When the vehicle leaves its lane, the pedestrian and a car 112 m ahead come into view. Beside
    the truck it would be in the way of that car; between both there is space for it, 5 m long."""
    truck = KnownBox(100.0, kind="truck", size=(8.5, 2.6))
    pedestrian = KnownBox(104.25 + gap, kind="pedestrian", size=(0.5, 0.5))
    roads = two_lane_road(400.0)
    run = PlannedDrive(behavior(roads), roads)
    in_view: list[float] = []

    def car(now: float) -> KnownBox:
        return KnownBox(197.0 - 12.0 * (now - in_view[0]), -LANE, vx=-12.0, yaw=math.pi)

    def objects(now: float) -> list[KnownBox]:
        if not in_view and run.path and run.path[-1][0] > 85.0:
            in_view.append(now)
        return [truck, pedestrian, car(now)] if in_view else [truck]

    run.run(40.0, objects)
    run.world.close()
    beside = [
        y for tick, (x, y, _) in enumerate(run.path) if in_view and abs(car(0.05 * tick).x - x - CAR.offset[0]) < 4.8
    ]
    assert max(beside) + CAR.size[1] / 2.0 < -LANE - 0.9
    assert run.front > 130.0


@pytest.mark.parametrize(("kind", "y"), [("pedestrian", LANE - 2.9), ("pedestrian", 3.9), ("bicycle", LANE - 2.9)])
def test_oncoming_pedestrians_and_cyclists_beside_the_road_are_no_oncoming_traffic(kind: str, y: float) -> None:
    """One is always ahead. From where the vehicle stops the bus hides the oncoming lane."""
    bus = KnownBox(80.0, kind="bus", size=(12.0, 2.5))
    roads = two_lane_road()
    run = PlannedDrive(behavior(roads), roads)

    def objects(now: float) -> list[KnownBox]:
        walkers = (
            KnownBox(90.0 + 10.0 * number - 1.4 * now, y, vx=-1.4, kind=kind, size=(0.5, 0.5), yaw=math.pi)
            for number in range(12)
        )
        return [bus, *walkers]

    run.run(36.0, objects)
    run.world.close()
    assert run.front > 130.0


def test_standing_bus_is_passed_with_one_meter_between() -> None:
    """Its side is 1.25 m left of the middle of the lane; the car is half as wide as its box."""
    bus = KnownBox(120.0, kind="bus", size=(12.0, 2.5))
    roads = two_lane_road(600.0)
    run = PlannedDrive(behavior(roads), roads)
    run.run(40.0, lambda now: [bus])
    run.world.close()
    beside = [y for x, y, _ in run.path if 114.0 < x < 126.0]
    assert min(beside) - CAR.size[1] / 2.0 - (LANE + 1.25) > 1.0
    assert run.front > 180.0


def test_vehicle_at_a_place_with_a_view_begins_after_two_pauses() -> None:
    """An oncoming car passes while the vehicle approaches; then none comes within 60 m for 2 · 6 s."""
    bus = KnownBox(130.0, LANE - 0.6, kind="bus", size=(11.0, 2.5))
    roads = two_lane_road()
    planner = behavior(roads)
    planner.view = (ViewSector(0.0, 0.0, 1.8, 0.0, math.pi, 60.0),)
    run = PlannedDrive(planner, roads, speed=8.0)
    in_view: list[float] = []

    def objects(now: float) -> list[KnownBox]:
        x = run.path[-1][0] if run.path else 20.0
        car = KnownBox(150.0 - 12.0 * now, -LANE, vx=-12.0, yaw=math.pi)
        near = [other for other in (bus, car) if -10.0 < other.x - other.size[0] / 2.0 - x < 60.0]
        in_view.extend([now] if car in near else [])
        return near

    run.run(32.0, objects)
    run.world.close()
    begins = next(0.05 * tick for tick, (_, y, _) in enumerate(run.path) if y > LANE + 0.8)
    assert in_view[-1] + 12.0 < begins < in_view[-1] + 12.0 + 4.0
    assert run.front > 150.0


def test_vehicle_that_appears_nearer_than_the_place_with_a_view_passes() -> None:
    """A car at rest appears 21.2 m behind a truck, which hides the oncoming lane near it; no traffic comes in 45 s."""
    truck = KnownBox(50.0, kind="truck", size=(10.0, 2.5))
    roads = two_lane_road()
    run = PlannedDrive(behavior(roads, 16.0), roads, speed=0.0)
    run.run(45.0, lambda now: [truck])
    run.world.close()
    assert run.front > 60.0


@pytest.mark.parametrize(("kind", "size"), [("motorbike", (2.2, 0.8)), ("pedestrian", (0.5, 0.5))])
def test_standing_road_user_is_passed(kind: str, size: tuple[float, float]) -> None:
    """The vehicle stops `passing_gap` farther away than the standstill gap of 2 m, and then passes."""
    other = KnownBox(70.0, kind=kind, size=size)
    roads = two_lane_road()
    run = PlannedDrive(behavior(roads), roads)
    run.run(26.0, lambda now: [other])
    run.world.close()
    assert run.front > 120.0


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(("start", "speed"), [(2.0, 0.0), (2.0, 10.0), (2.05, 10.0), (3.0, 5.0)])
def test_vehicle_at_the_offset_beside_a_standing_obstacle_continues(side: int, start: float, speed: float) -> None:
    out = change_length(2.0 - start, speed, 2.0)
    vehicle = Start(100.0, side * start, 0.0, speed)
    profile = passing("pass", side * 2.0, (80.0, 120.0), vehicle, 2.0, side, lengths=(out, 20.0), stands=True)
    assert profile is not None
    assert side * profile.offset_at(100.0) == pytest.approx(start)
    inside = min(100.0 + out, 120.0)
    assert side * profile.offset_at(inside) == pytest.approx(2.0)
    assert side * profile.offset_at(120.0) == pytest.approx(2.0)
    assert profile.offset_at(profile.places[-1]) == 0.0


def test_vehicle_not_aside_of_a_near_obstacle_does_not_pass_it() -> None:
    vehicle = Start(100.0, 1.5, 0.0, 5.0)
    assert passing("pass", 2.0, (80.0, 120.0), vehicle, 2.0, 1, lengths=(11.0, 11.0), stands=True) is None


@pytest.mark.parametrize(("place", "number", "speed"), [(45.0, 1, 0.0), (60.0, 3, 0.0), (200.0, 1, 3.0)])
def test_lateral_motion_suits_the_speed_that_the_vehicle_has_then(place: float, number: int, speed: float) -> None:
    """It accelerates before and beside the cars; 4.89 m/s² is nuPlan's limit of comfort for lateral acceleration."""
    cars = [KnownBox(place + 8.0 * index) for index in range(number)]
    roads = two_lane_road(600.0)
    run = PlannedDrive(behavior(roads, 14.0), roads, speed=speed)
    run.run(45.0, lambda now: cars)
    run.world.close()
    x, y, speeds = np.array(run.path).T
    turn = np.diff(np.unwrap(np.arctan2(np.diff(y), np.diff(x))), append=0.0) / 0.05
    lateral = np.convolve(turn * speeds[1:], np.ones(6) / 6.0, mode="valid")[speeds[4:-2] > 1.0]
    assert np.abs(lateral).max() < 4.89
    assert y.max() > LANE + 2.0
    assert y[x > place + 8.0 * number].min() > LANE - 0.3


def test_slow_bicycle_is_overtaken_on_an_empty_road() -> None:
    """At 4.5 m/s it is 195 m along the road after 30 s; the vehicle is beyond it, and back in its lane."""
    roads = two_lane_road()
    run = PlannedDrive(behavior(roads, 13.0), roads, speed=13.0)
    run.run(30.0, lambda now: [KnownBox(60.0 + 4.5 * now, LANE - 0.6, vx=4.5, kind="bicycle", size=(1.8, 0.6))])
    run.world.close()
    assert run.front > 220.0
    assert run.path[-1][1] == pytest.approx(LANE, abs=0.1)


def test_overtaking_is_given_up_behind_the_truck_for_an_oncoming_car() -> None:
    """The car comes into view 110 m ahead, at 18 m/s, when the front is 3 m behind the truck, which drives 7 m/s. When
    they meet, the vehicle has left the lane of the car, whose side is 0.85 m beyond the middle of the road."""
    roads = two_lane_road(700.0)
    run = PlannedDrive(behavior(roads, 19.4), roads, speed=19.4)
    cars: list[tuple[float, float]] = []
    beside = []

    def objects(now: float) -> list[KnownBox]:
        x, y, _ = run.path[-1] if run.path else (20.0, LANE, 0.0)
        truck = KnownBox(120.0 + 7.0 * now, vx=7.0, kind="truck", size=(8.5, 2.5))
        if y > 0.5 and not cars and truck.x - 4.25 - run.front < 3.0:
            cars.append((now, x + 110.0))
        if not cars:
            return [truck]
        car = KnownBox(cars[0][1] - 18.0 * (now - cars[0][0]), -LANE, vx=-18.0, yaw=math.pi)
        if run.front > car.x - 2.25 and x - 1.0 < car.x + 2.25:
            beside.append(y)
        return [truck, car]

    run.run(24.0, objects)
    run.world.close()
    assert beside
    assert max(beside) < 0.85 - CAR.size[1] / 2.0


@pytest.mark.parametrize(
    ("mark", "overtakes"),
    [("solid", False), ("solid solid", False), ("broken solid", False), ("solid broken", True), ("broken", True)],
)
def test_moving_vehicle_is_not_overtaken_over_a_solid_line(mark: str, overtakes: bool) -> None:
    """The lines of a mark in the middle are named from left to right; the vehicle is to the right of them."""
    roads = marked_road(mark)
    run = PlannedDrive(behavior(roads, 13.0), roads, speed=13.0)
    run.run(24.0, lambda now: [KnownBox(60.0 + 4.5 * now, vx=4.5, kind="bicycle", size=(1.8, 0.6))])
    run.world.close()
    assert (run.front > 60.0 + 4.5 * 24.0 + 5.0) == overtakes
    assert overtakes or max(y for _, y, _ in run.path) < 0.0


def test_moving_vehicle_is_not_overtaken_before_a_junction() -> None:
    """The junction begins at x = 29 m, the cyclist is up to 34 m before it, and the other lane is free."""
    roads = RoadNetwork.load(library_path() / "roads" / "four_way_junction.xodr")
    run = PlannedDrive(behavior(roads), roads, start=-75.0, y=0.0)
    run.run(14.0, lambda now: [KnownBox(-5.0 + 2.0 * now, -0.6, vx=2.0, kind="bicycle", size=(1.8, 0.6))])
    run.world.close()
    assert run.front < -5.0 + 2.0 * 14.0
    assert max(abs(y) for _, y, _ in run.path) < 0.2


def test_column_longer_than_the_rest_of_the_route_is_not_overtaken() -> None:
    """The last truck hides three others, one every 14 m at 7 m/s. At 3 m/s more, the vehicle needs at least 50 · 10 / 3
    m to pass them, and sees them 140 m before the end of its route."""
    roads = two_lane_road(300.0)
    run = PlannedDrive(behavior(roads), roads)
    trucks = [KnownBox(60.0 + 14.0 * number, kind="truck", vx=7.0, size=(8.5, 2.5)) for number in range(4)]

    def objects(now: float) -> list[KnownBox]:
        seen = 4 if run.path and run.path[-1][1] > 0.5 else 1
        return [truck._replace(x=truck.x + 7.0 * now) for truck in trucks[:seen]]

    run.run(44.0, objects)
    run.world.close()
    x, y, speed = run.path[-1]
    assert x == pytest.approx(300.0, abs=2.0)
    assert y == pytest.approx(LANE, abs=0.1)
    assert speed < 0.1


@pytest.mark.parametrize("place", [196.0, 204.0])
def test_vehicle_waits_in_its_lane_behind_a_car_at_its_destination(place: float) -> None:
    """The route ends at x = 200 m, before the vehicle could return from the other lane; it stands until the end."""
    roads = two_lane_road(200.0)
    run = PlannedDrive(behavior(roads), roads, start=120.0)
    run.run(28.0, lambda now: [KnownBox(place)])
    run.world.close()
    assert max(y for _, y, _ in run.path) + CAR.size[1] / 2.0 < 0.0
    assert run.front < place - 2.25
    assert max(run.speeds[-200:]) < 0.01


def test_cyclist_at_the_edge_of_the_lane_is_passed_before_a_junction() -> None:
    """The other lane, from y = 1.75 m on, is not needed: the car is 1.84 m wide."""
    roads = RoadNetwork.load(library_path() / "roads" / "four_way_junction.xodr")
    run = PlannedDrive(behavior(roads), roads, start=-75.0, y=0.0)
    run.run(14.0, lambda now: [KnownBox(-5.0 + 2.0 * now, -1.6, vx=2.0, kind="bicycle", size=(1.8, 0.6))])
    run.world.close()
    assert run.front > -5.0 + 2.0 * 14.0 + 5.0
    assert max(y for _, y, _ in run.path) < 1.75 - 1.84 / 2.0


def test_standing_vehicle_is_passed_over_a_solid_line() -> None:
    roads = marked_road("solid")
    run = PlannedDrive(behavior(roads), roads)
    run.run(26.0, lambda now: [KnownBox(70.0)])
    run.world.close()
    assert run.front > 120.0


@pytest.mark.parametrize("cars", [0, 4])
def test_block_of_both_own_lanes_is_passed_in_the_oncoming_lane(cars: int) -> None:
    """A truck and a van stand side by side. Cars at 12 m/s, one every 60 m, come in the lane of the opposite direction,
    whose center is two lanes beside that of the vehicle: it passes behind the last one."""
    # The lanes of the direction of the line are at 1.75 m and 5.25 m below it.
    width = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'
    side = [f'<lane id="{number}" type="driving">{width}</lane>' for number in (1, -1, -2)]
    center = '<center><lane id="0" type="none"><roadMark sOffset="0" type="solid"/></lane></center>'
    lanes = f'<laneSection s="0"><left>{side[0]}</left>{center}<right>{side[1]}{side[2]}</right></laneSection>'
    roads = RoadNetwork.parse(map_xml(road_xml(length=600.0, lanes=lanes)))
    right = -5.25
    block = [KnownBox(140.0, LANE, kind="truck", size=(8.5, 2.5)), KnownBox(143.0, right, size=(6.0, 2.0))]
    run = PlannedDrive(behavior(roads), roads, y=right)

    def objects(now: float) -> list[KnownBox]:
        return [*block, *(KnownBox(180.0 + 60.0 * k - 12.0 * now, 1.75, vx=-12.0, yaw=math.pi) for k in range(cars))]

    run.run(60.0, objects)
    run.world.close()
    assert run.front > 200.0
    assert run.path[-1][1] < LANE + 0.1, "back in a lane of its direction"
    for number, (x, y, _) in enumerate(run.path):
        if any(abs(car.x - x - CAR.offset[0]) < 4.7 for car in objects(number * 0.05)[2:]):
            assert y + CAR.size[1] / 2.0 < 1.75 - 0.9, "clear of the oncoming car"
    assert min(run.least_distance(standing) for standing in block) > 0.25


@pytest.mark.parametrize("arrival", [9.0, 11.0, 13.0])
def test_vehicle_behind_a_junction_is_passed_only_in_a_gap(arrival: float) -> None:
    """A car comes at 8 m/s in the lane of the opposite direction, which the vehicle sees across the junction."""
    roads = RoadNetwork.load(library_path() / "roads" / "four_way_junction.xodr")
    standing = KnownBox(63.0, 0.0, kind="truck", size=(6.1, 2.2))
    run = PlannedDrive(behavior(roads, 8.0), roads, speed=8.0, start=-30.0, y=0.0)
    run.run(40.0, lambda now: [standing, KnownBox(63.0 + 8.0 * (arrival - now), 3.5, vx=-8.0, yaw=math.pi)])
    run.world.close()
    oncoming = (63.0 + 8.0 * (arrival - 0.05 * number) for number in range(len(run.path)))
    beside = [y for (x, y, _), other in zip(run.path, oncoming, strict=True) if abs(x + 1.4 - other) < 5.0]
    # Half the widths of both: 0.9 m each.
    assert max(beside, default=0.0) < 3.5 - 1.8
    assert run.front > 80.0


def marked_road(mark: str) -> RoadNetwork:
    """Return a road of two directions with a mark in the middle."""
    lane = f'<lane id="0" type="none"><roadMark sOffset="0" type="{mark}"/></lane>'
    road = re.sub("<center>.*?</center>", f"<center>{lane}</center>", road_xml(length=600.0), flags=re.DOTALL)
    return RoadNetwork.parse(map_xml(road))


def test_bicycle_is_followed_until_the_oncoming_lane_is_free() -> None:
    """Cars at 10 m/s, one every 40 m and the last one from 300 m, meet the vehicle on its side of the road."""
    roads = two_lane_road()
    run = PlannedDrive(behavior(roads, 13.0), roads, speed=13.0)

    def others(now: float) -> list[KnownBox]:
        bicycle = KnownBox(60.0 + 4.5 * now, LANE - 0.6, vx=4.5, kind="bicycle", size=(1.8, 0.6))
        return [bicycle, *(KnownBox(60.0 + 40.0 * k - 10.0 * now, 1.75, vx=-10.0, yaw=math.pi) for k in range(7))]

    run.run(40.0, others)
    run.world.close()
    for number, (x, y, _) in enumerate(run.path):
        cars = others(number * 0.05)[1:]
        if any(abs(car.x - x - 1.4) < 4.7 for car in cars):
            assert y + 0.92 < 1.75 - 0.9, "clear of the oncoming car"
    assert run.front > others(40.0)[0].x + 5.0
