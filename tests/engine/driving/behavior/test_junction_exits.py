"""Junctions that the vehicle keeps clear: it does not enter one in which it would have to wait behind a queue.

The four-way junction of the library begins at x = 29 m and ends at 55 m; the vehicle comes from the west at y = 0.
"""

from __future__ import annotations

import numpy as np
import pytest
from planned_drive import FRONT, KnownBox, PlannedDrive, behavior
from signal_street import CAR

from eidrive_scenario.driving.planning.behavior.right_of_way import JunctionRules
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.extensions.library import library_path
from eidrive_scenario.roads import RoadNetwork

ENTRY, EXIT = 29.0, 55.0
SAMPLING = 1.0
"""Maximum error of the extent of a junction along the way [m]."""


def drive(
    seconds: float,
    *queue: KnownBox,
    seen: float = 0.0,
    leaves: float = 1e9,
    road: str = "four_way_junction",
    lane_changes: bool = False,
) -> PlannedDrive:
    """Return a drive from x = -30 m on behind cars, which are first seen and drive away at these times [s]."""
    roads = RoadNetwork.load(library_path() / "roads" / f"{road}.xodr")
    run = PlannedDrive(behavior(roads, 8.0, lane_changes=lane_changes), roads, speed=8.0, start=-30.0, y=0.0)
    run.run(seconds, lambda now: [_moved(car, now, leaves) for car in queue if now >= seen])
    run.world.close()
    return run


def _moved(car: KnownBox, now: float, leaves: float) -> KnownBox:
    if now < leaves:
        return car
    return car._replace(x=car.x + 8.0 * (now - leaves), vx=8.0)


SPACE = SAMPLING + CAR.size[0] + BehaviorSettings().standstill_gap + BehaviorSettings().passing_gap + 0.5
"""Distance from the junction to a standing car behind which the vehicle stops outside the junction [m]."""


def standing(rear: float) -> KnownBox:
    return KnownBox(rear + 2.25, 0.0)


def test_vehicle_waits_before_the_junction_until_the_queue_leaves() -> None:
    run = drive(20.0, standing(EXIT + 2.0), standing(EXIT + 9.0), leaves=14.0)
    waiting = run.path[: round(14.0 / 0.05)]
    assert ENTRY - 4.0 < max(x for x, _, _ in waiting) + FRONT < ENTRY
    assert waiting[-1][2] < 0.1
    assert run.hardest_braking < 2.5
    assert run.front > ENTRY
    assert "keep a junction clear" in " ".join(run.reasons)


def test_vehicle_enters_where_it_has_space_behind_the_junction() -> None:
    run = drive(20.0, standing(EXIT + SPACE))
    assert run.path[-1][0] + FRONT - CAR.size[0] > EXIT
    assert not any("clear" in reason for reason in run.reasons)


def test_space_behind_the_junction_belongs_to_the_car_ahead() -> None:
    """A car at 1 m/s in the junction takes the space before it, which suffices for one car."""
    cars = standing(EXIT + SPACE), KnownBox(40.0, 0.0, vx=1.0)
    run = drive(10.0, *cars)
    assert any("clear" in reason for reason in run.reasons)


@pytest.mark.parametrize("seen", [0.0, 0.5])
def test_standing_queue_is_passed_in_the_free_lane_beside_it(seen: float) -> None:
    """After 20 s the cars behind the junction of two lanes count as parked; up to then the vehicle waits."""
    cars = standing(EXIT + 5.0), standing(EXIT + 13.0)
    run = drive(40.0, *cars, seen=seen, road="four_way_signals", lane_changes=True)
    x, y, speed = np.array(run.path).T
    yaw = np.unwrap(np.arctan2(np.gradient(y), np.maximum(np.gradient(x), 1e-3)))
    # Limit of comfort of nuPlan
    assert np.abs(speed * np.gradient(yaw, 0.05)).max() < 4.89
    assert x[round(15.0 / 0.05)] + FRONT < ENTRY
    assert run.front > EXIT + 30.0


@pytest.mark.parametrize(
    ("name", "first", "last", "expected"),
    [
        ("four_way_junction", (0.0, 0.0), (70.0, 0.0), True),
        ("motorway", (-100.0, 0.0), (150.0, 0.0), False),  # an entry ramp joins
    ],
)
def test_only_junctions_with_cross_traffic_are_kept_clear(
    name: str, first: tuple[float, float], last: tuple[float, float], expected: bool
) -> None:
    rules = JunctionRules(RoadNetwork.load(library_path() / "roads" / f"{name}.xodr"))
    passages = rules.passages(np.linspace(first, last, 200))
    assert [passage.is_crossed for passage in passages] == [expected]
