"""A vehicle that comes towards the car in its lane: a neighboring lane of the same direction is the way out."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from opendrive_xml import lanes_xml, map_xml, road_xml
from planned_drive import FRONT, LANE, KnownBox, PlannedDrive, behavior, detections, two_lane_road
from signal_street import CAR

from eidrive_scenario.base.requests import Goal
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import EgoState

Traffic = Callable[[float], KnownBox]
WIDTH, SPEED = 3.5, 20.0


def wrong_way(now: float) -> KnownBox:
    """Return the oncoming car in the lane of the driven one, 200 m ahead at the start."""
    return KnownBox(220.0 - SPEED * now, LANE, vx=-SPEED, yaw=math.pi)


def drive(lanes: int, own: int, *others: Traffic, **settings: bool) -> PlannedDrive:
    """Drive at 10 m/s in lane `own` (1 is the one on the left) of a direction with a number of lanes."""
    middle = LANE + (own - 0.5) * WIDTH
    roads = RoadNetwork.parse(map_xml(road_xml(length=500.0, y=middle, lanes=lanes_xml(1, lanes))))
    run = PlannedDrive(behavior(roads, **settings), roads)
    run.run(14.0, lambda now: [wrong_way(now), *(other(now) for other in others)])
    run.world.close()
    return run


def clearance(run: PlannedDrive, other: Traffic) -> float:
    """Return the minimum distance from another car along or across the road [m], negative after a contact."""
    found = []
    for tick, (x, y, _) in enumerate(run.path):
        box = other(tick * 0.05)
        along = abs(x + CAR.offset[0] - box.x) - (CAR.size[0] + box.size[0]) / 2.0
        across = abs(y - box.y) - (CAR.size[1] + box.size[1]) / 2.0
        found.append(max(along, across))
    return min(found)


@pytest.mark.parametrize(("lanes", "own", "side"), [(2, 1, "right"), (2, 2, "left"), (3, 2, "right")])
def test_vehicle_leaves_the_lane_of_a_wrong_way_driver(lanes: int, own: int, side: str) -> None:
    run = drive(lanes, own)
    assert f"change lane to the {side}; keep speed" in run.reasons
    # A lane is 3.5 m wide, the cars 1.84 and 1.8 m.
    assert clearance(run, wrong_way) > WIDTH - 1.82 - 0.1
    assert run.path[-1][1] == pytest.approx(LANE, abs=0.1), "back in the lane of the route"
    assert run.speeds[-1] == pytest.approx(10.0, abs=0.3)


def test_vehicle_lets_traffic_in_the_neighboring_lane_pass_first() -> None:
    def beside(now: float) -> KnownBox:
        return KnownBox(15.0 + 10.0 * now, LANE + WIDTH, vx=10.0)

    run = drive(2, 2, beside)
    assert clearance(run, wrong_way) > 1.0
    assert clearance(run, beside) > 1.0


def test_vehicle_without_a_neighboring_lane_stands_before_the_collision() -> None:
    """It does not come closer to stop in the last moment."""
    run = drive(1, 1)
    assert max(abs(y - LANE) for _, y, _ in run.path) < 0.1
    gaps = [wrong_way(tick * 0.05).x - x - CAR.offset[0] for tick, (x, _, _) in enumerate(run.path)]
    contact = next(tick for tick, gap in enumerate(gaps) if gap < (CAR.size[0] + 4.5) / 2.0)
    assert max(run.speeds[contact - 20 : contact]) < 0.1


def plans(*gaps: float) -> list[Plan]:
    """Return plans every 0.1 s, at 10 m/s in the left one of two lanes.

    gaps  to the wrong-way car [m]; inf if that is out of view
    """
    roads = RoadNetwork.parse(map_xml(road_xml(length=500.0, lanes=lanes_xml(1, 2))))
    planner, made = behavior(roads), list[Plan]()
    for tick, gap in enumerate(gaps):
        now, x = 0.1 * tick, 20.0 + tick
        car = KnownBox(x + FRONT + gap + 2.25, vx=-SPEED, yaw=math.pi)
        ego = EgoState(now, np.array([x, LANE, 0.0]), 0.0, 0.0, 0.0, 10.0, 0.0, 0.0)
        made.append(planner.plan(ego, detections(now, *([car] if math.isfinite(gap) else [])), Goal(), now))
    return made


@pytest.mark.parametrize(("gap", "lateral_acceleration"), [(48.0, 4.0), (80.0, 2.0)])
def test_change_is_hasty_only_where_the_wrong_way_driver_is_near(gap: float, lateral_acceleration: float) -> None:
    """A change by 3.5 m takes √(5.774 · 3.5 m / a): 3.2 s with 2 m/s², and 2.2 s with 4 m/s².

    The sides are apart (1.82 m and 0.1 m) after 53 % of it, at the rear axle 0.2 s later: after 1.9 s or 1.4 s. At
    30 m/s that is 56 m or 41 m.
    """
    (plan,) = plans(gap)
    assert plan.reason == "change lane to the right; keep speed"
    x, y = plan.points.T
    lateral = np.gradient(np.gradient(y, x), x) * 10.0**2
    assert np.abs(lateral).max() == pytest.approx(lateral_acceleration, rel=0.05)
    assert y[-1] == pytest.approx(LANE - WIDTH, abs=0.01)


def test_free_lane_is_taken_at_once_instead_of_an_emergency_stop() -> None:
    """A stop takes 10²/2a + 20 · 10/a m, with the way of the car: 62.5 m with the hard 4 m/s², and 50 m with 5 m/s².

    The change needs 41 m.
    """
    assert plans(math.inf, 52.0)[-1].reason == "change lane to the right; keep speed"


def test_lane_is_kept_if_lane_changes_are_switched_off() -> None:
    run = drive(2, 1, lane_changes=False)
    assert max(abs(y - LANE) for _, y, _ in run.path) < 0.1


@pytest.mark.parametrize(
    ("kind", "y", "speed"),
    [
        ("bicycle", LANE - 1.4, 4.0),
        ("bicycle", LANE, 4.0),
        ("bicycle", LANE - 1.2, 9.0),
        ("pedestrian", LANE - 1.2, 1.4),
    ],
)
def test_wrong_way_cyclist_has_one_meter_without_a_stop(kind: str, y: float, speed: float) -> None:
    """Cyclists and pedestrians come at the edge or in the middle of the lane; the other lane is empty."""
    roads = two_lane_road(600.0)
    run = PlannedDrive(behavior(roads, 12.0), roads, speed=12.0)

    def other(now: float) -> KnownBox:
        return KnownBox(160.0 - speed * now, y, vx=-speed, kind=kind, size=(1.8, 0.6), yaw=math.pi)

    run.run(18.0, lambda now: [other(now)])
    run.world.close()
    beside = [place for tick, (x, place, _) in enumerate(run.path) if abs(x + 1.4 - other(0.05 * tick).x) < 3.0]
    assert min(beside) - CAR.size[1] / 2.0 - (y + 0.3) > 0.95
    assert min(run.speeds) > 4.0
    assert run.path[-1][1] == pytest.approx(LANE, abs=0.15)
