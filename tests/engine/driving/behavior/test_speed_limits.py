"""Speed limits of the road that the vehicle follows."""

from __future__ import annotations

import math

import numpy as np
import pytest
from opendrive_xml import map_xml, road_xml
from planned_drive import LANE, PlannedDrive
from signal_street import CAR

from eidrive_scenario.base.requests import Goal
from eidrive_scenario.driving.planning.behavior.planner import BehaviorPlanner
from eidrive_scenario.driving.planning.behavior.reference import ReferenceLine
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.path import PlannedPath
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.roads import RoadNetwork

BORDER = 200.0
"""Distance along the road at which the limit changes from 20 to 10 m/s [m]."""
TYPES = '<type s="0" type="rural"><speed max="20"/></type><type s="200" type="town"><speed max="10"/></type>'


def road() -> RoadNetwork:
    return RoadNetwork.parse(map_xml(road_xml(length=400.0).replace("<planView>", f"{TYPES}<planView>")))


def follower(roads: RoadNetwork) -> BehaviorPlanner:
    settings = AgentSettings.model_validate({"follow_speed_limit": True, "planner": "behavior"})
    settings = settings.model_copy(update={"planner_settings": BehaviorSettings()})
    return BehaviorPlanner(settings, CAR, roads, dt=0.05, seed=0)


def test_vehicle_is_at_a_lower_limit_where_it_begins() -> None:
    """From 20 to 10 m/s with 2 m/s² takes 75 m."""
    roads = road()
    run = PlannedDrive(follower(roads), roads, speed=20.0)
    run.run(13.0, lambda now: [])
    run.world.close()
    assert all(speed == pytest.approx(20.0, abs=0.3) for x, _, speed in run.path if x < BORDER - 80.0)
    at_border = min(run.path, key=lambda place: abs(place[0] - BORDER))
    assert at_border[2] == pytest.approx(10.0, abs=0.5)
    assert run.hardest_braking < 3.0, "2 m/s², and the error of the controller"
    assert "lower speed limit ahead" in run.reasons


def test_commanded_speed_takes_precedence_over_limits() -> None:
    roads = road()
    run = PlannedDrive(follower(roads), roads, speed=20.0)
    run.run(12.0, lambda now: [], goal=Goal(speed=20.0))
    run.world.close()
    assert min(run.speeds) == pytest.approx(20.0, abs=0.3)


def test_limits_along_a_line_are_those_of_its_lanes() -> None:
    """Half of the line is off the road, where no limit holds."""
    line = ReferenceLine(PlannedPath(np.array([[190.0, LANE], [210.0, LANE], [600.0, LANE]]), ends=False), road())
    x = line.points[:, 0]
    assert set(line.speed_limits[x < BORDER - 1e-6]) == {20.0}
    assert set(line.speed_limits[(x > BORDER) & (x < 400.0)]) == {10.0}
    assert set(line.speed_limits[x > 406.0]) == {math.inf}
