"""Obstacles that the vehicle recognizes while it passes another one."""

from __future__ import annotations

import pytest
from planned_drive import LANE, KnownBox, PlannedDrive, behavior, two_lane_road

from eidrive_scenario.driving.planning.behavior.proposals import Start, change_length, passing


@pytest.mark.parametrize("y", [LANE, LANE - 1.0])
def test_parked_bus_that_another_hid_is_passed_as_well(y: float) -> None:
    """The second bus stands 4 m behind the first one, and is visible from 10 m before the rear of the first one."""
    buses = [KnownBox(x, y, kind="bus", size=(12.0, 2.5)) for x in (80.0, 96.0)]
    roads = two_lane_road()
    run = PlannedDrive(behavior(roads), roads)
    run.run(26.0, lambda now: buses if run.path and run.path[-1][0] > 64.0 else buses[:1])
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


def test_standing_motorbike_is_passed() -> None:
    """The vehicle stops `passing_gap` farther away than the standstill gap of 2 m, and then passes."""
    bike = KnownBox(70.0, kind="motorbike", size=(2.2, 0.8))
    roads = two_lane_road()
    run = PlannedDrive(behavior(roads), roads)
    run.run(26.0, lambda now: [bike])
    run.world.close()
    assert run.front > 120.0


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(("start", "speed"), [(2.0, 0.0), (2.0, 10.0), (2.05, 10.0), (3.0, 5.0)])
def test_vehicle_at_the_offset_beside_a_standing_obstacle_continues(side: int, start: float, speed: float) -> None:
    profile = passing("pass", side * 2.0, (80.0, 120.0), Start(100.0, side * start, 0.0, speed), 2.0, side, stands=True)
    assert profile is not None
    assert side * profile.offset_at(100.0) == pytest.approx(start)
    inside = min(100.0 + change_length(2.0 - start, speed, 2.0), 120.0)
    assert side * profile.offset_at(inside) == pytest.approx(2.0)
    assert side * profile.offset_at(120.0) == pytest.approx(2.0)
    assert profile.offset_at(profile.places[-1]) == 0.0


def test_vehicle_not_aside_of_a_near_obstacle_does_not_pass_it() -> None:
    assert passing("pass", 2.0, (80.0, 120.0), Start(100.0, 1.5, 0.0, 5.0), 2.0, 1, stands=True) is None
