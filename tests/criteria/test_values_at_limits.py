"""A value that equals its limit fulfills it, whatever the rounding error of its calculation."""

import math
from typing import Any

import pytest
from eidrive_criteria.average_speed import AverageSpeed, AverageSpeedSettings
from eidrive_criteria.collision import Collision, CollisionSettings
from eidrive_criteria.driven_distance import DrivenDistance, DrivenDistanceSettings
from eidrive_criteria.min_distance import MinDistance, MinDistanceSettings
from eidrive_criteria.off_road import OffRoad, OffRoadSettings
from eidrive_criteria.outside_route_lanes import OutsideRouteLanes, OutsideRouteLanesSettings
from eidrive_criteria.time_headway import TimeHeadway, TimeHeadwaySettings

from eidrive_scenario.api.common import Contact, RoadNetwork
from eidrive_scenario.api.criteria import Criterion, evaluate_criteria
from eidrive_scenario.simulation import RunSettings, run_file

HEADINGS = [0.0, 0.3, 0.7, 1.2, 2.0]


@pytest.mark.parametrize("heading", HEADINGS)
@pytest.mark.parametrize("speed", [5.0, 8.3333, 27.7778])
def test_constant_speed_fulfills_equal_limits(frame: Any, car: Any, heading: float, speed: float) -> None:
    """80 steps of 0.05 s."""
    frames = [
        frame(tick * 0.05, {"Ego": car(0.05 * tick * speed * math.cos(heading), 0.0, heading, speed)})
        for tick in range(81)
    ]
    criteria: list[Criterion] = [
        AverageSpeed(AverageSpeedSettings(of="Ego", at_least=speed)),
        AverageSpeed(AverageSpeedSettings(of="Ego", at_most=speed)),
        DrivenDistance(DrivenDistanceSettings(of="Ego", at_least=4.0 * speed)),
    ]
    assert [verdict.passed for verdict in evaluate_criteria(frames, criteria)] == [True] * 3


@pytest.mark.parametrize("heading", HEADINGS)
def test_gap_fulfills_an_equal_limit(frame: Any, car: Any, heading: float) -> None:
    """Cars of 4 m in a row with a gap of 2 m, at 4 m/s."""
    cars = {
        "Ego": car(0.1, 0.1, heading, 4.0),
        "Lead": car(0.1 + 6.0 * math.cos(heading), 0.1 + 6.0 * math.sin(heading), heading, 4.0),
    }
    criteria: list[Criterion] = [
        MinDistance(MinDistanceSettings(of="Ego", to="Lead", at_least=2.0)),
        TimeHeadway(TimeHeadwaySettings(of="Ego", at_least=0.5)),
    ]
    assert [verdict.passed for verdict in evaluate_criteria([frame(0.0, cars)], criteria)] == [True] * 2


def test_stopped_actor_is_not_at_fault_in_any_direction(frame: Any, car: Any) -> None:
    """At 0.05 m/s the Ego has stopped; at 0.051 m/s it hits with its front."""
    for yaw in map(math.radians, range(360)):
        x, y = math.cos(yaw), math.sin(yaw)
        for speed, faults in ((0.05, 0.0), (0.051, 1.0)):
            cars = {"Ego": car(0.0, 0.0, yaw, speed), "Bus": car(4.0 * x, 4.0 * y, yaw + math.pi, 4.0)}
            collision = Collision(CollisionSettings(of="Ego"))
            evaluate_criteria([frame(0.0, cars, [Contact("Ego", "Bus", (2.0 * x, 2.0 * y, 0.5), 4.0)])], [collision])
            assert collision.metrics()["collision.at_fault"] == faults


def test_leader_that_reverses_slowly_leads_in_any_direction(frame: Any, car: Any) -> None:
    """A standing actor moves at up to 0.1 m/s; one at 45° to the path does not cross it."""
    for yaw in map(math.radians, range(360)):
        for turn, speed in ((0.0, -0.1), (math.pi / 4.0, 5.0), (-math.pi / 4.0, 5.0)):
            lead = car(8.0 * math.cos(yaw), 8.0 * math.sin(yaw), yaw + turn, speed)
            (verdict,) = evaluate_criteria(
                [frame(0.0, {"Ego": car(0.0, 0.0, yaw, 5.0), "Lead": lead})],
                [TimeHeadway(TimeHeadwaySettings(of="Ego", at_least=2.0))],
            )
            assert not verdict.passed


def test_standing_actor_drives_no_distance_in_any_direction(frame: Any, car: Any, roads: RoadNetwork) -> None:
    """80 steps of 0.05 s at 0.02 m/s."""
    for yaw in map(math.radians, range(0, 360, 10)):
        steps = [0.02 * 0.05 * tick for tick in range(81)]
        cars = [car(-60.0 + step * math.cos(yaw), step * math.sin(yaw), yaw, 0.02) for step in steps]
        criterion = OutsideRouteLanes(OutsideRouteLanesSettings(of="Ego"))
        evaluate_criteria([frame(0.05 * tick, {"Ego": at}) for tick, at in enumerate(cars)], [criterion], roads)
        assert criterion.metrics()["outside_route_lanes.Ego.driven"] == 0.0


@pytest.mark.parametrize("steps", [3, 6, 7, 12])
def test_time_off_the_road_fulfills_an_equal_limit(frame: Any, car: Any, roads: RoadNetwork, steps: int) -> None:
    frames = [frame(0.05 * tick, {"Ego": car(-60.0, -7.0)}) for tick in range(steps + 1)]
    criteria = [OffRoad(OffRoadSettings(of="Ego", at_most=limit)) for limit in (round(0.05 * steps, 2), 0.05)]
    assert [verdict.passed for verdict in evaluate_criteria(frames, criteria, roads)] == [True, False]


def test_constant_delay_fulfills_an_equal_limit() -> None:
    channel = {"delay": {"kind": "constant", "seconds": 0.3}}
    criteria = [
        {"latency": {"receiver": "Ego", "measure": measure, "at_most": 0.3, "name": measure}}
        for measure in ("mean", "p95", "max")
    ]
    verdicts = run_file("coop/scenario_1", settings=RunSettings(channel=channel, criteria=criteria)).criteria
    assert {verdict.name: verdict.passed for verdict in verdicts if verdict.name in ("mean", "p95", "max")} == {
        "mean": True,
        "p95": True,
        "max": True,
    }
