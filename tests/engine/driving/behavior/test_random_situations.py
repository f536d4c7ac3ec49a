"""Plans in random situations on the roads of the library: finite, within bounds, and with reasons."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from planned_drive import KnownBox, behavior, detections

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.requests import Goal
from eidrive_scenario.driving.planning.behavior.memory import nearest_rows
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import EgoState

ROADS = sorted((Path(__file__).parents[4] / "xosc" / "roads").glob("*.xodr"))
CLASSES = ("car", "truck", "pedestrian", "bicycle", "misc", "unknown")


def random_detections(rng: np.random.Generator, time: float, x: float, y: float) -> Detections:
    count = int(rng.choice([0, 0, 1, 3, 10, 40]))
    spread = float(rng.choice([1.0, 20.0, 100.0]))
    columns = (
        x + rng.normal(0.0, spread, count),
        y + rng.normal(0.0, spread, count),
        np.zeros(count),
        rng.choice([0.0, 0.5, 4.5, 20.0], count),
        rng.choice([0.0, 0.5, 2.0], count),
        np.ones(count),
        rng.uniform(-7.0, 7.0, count),
    )
    velocity = rng.normal(0.0, rng.choice([0.01, 5.0, 60.0]), (count, 2))
    return Detections(
        time - float(rng.choice([0.0, 0.0, 0.5, 3.0])),
        np.column_stack(columns),
        rng.uniform(0.0, 1.0, count),
        tuple(rng.choice(CLASSES, count).tolist()),
        np.where(rng.random((count, 1)) < 0.2, np.nan, velocity),
        np.eye(2) * rng.choice([0.0, 0.01, 4.0, 1e6, np.nan], (count, 1, 1)),
    )


def random_goal(rng: np.random.Generator, x: float, y: float, yaw: float) -> Goal:
    ahead = [x + 20.0 * math.cos(yaw), y + 20.0 * math.sin(yaw), 0.0]
    goals = (
        Goal(),
        Goal(),
        Goal(speed=float(rng.choice([0.0, 5.0, 30.0])), acceleration=float(rng.choice([0.0, 2.0, -5.0]))),
        Goal(path=np.array([[x, y, 0.0], ahead])),
        Goal(path=np.array([[x, y, 0.0], [x, y, 0.0]])),
    )
    return goals[int(rng.integers(len(goals)))]


def check(plan: Plan, count: int) -> None:
    assert np.isfinite(plan.points).all()
    assert np.isfinite(plan.speeds).all()
    assert (plan.speeds >= 0.0).all()
    assert len(plan.points) == len(plan.speeds) >= 2
    assert plan.reason
    assert all(0 <= row < count for row in plan.objects)


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", range(24))
def test_plans_are_finite_and_their_objects_exist(seed: int) -> None:
    rng = np.random.default_rng(seed)
    roads = RoadNetwork.load(ROADS[seed % len(ROADS)])
    lanes = [key for row, key in enumerate(roads.tables.lane_keys) if roads.tables.lane_drivable[row]]
    for _ in range(2):
        key = lanes[int(rng.integers(len(lanes)))]
        section = roads.road(key.road).sections[key.section]
        pose = roads.lane_pose_at(key.road, key.lane, rng.uniform(section.s, section.end))
        x, y = pose.x, pose.y
        yaw = pose.h + (0.0 if roads.driving_direction(key.road, key.lane) > 0 else math.pi)
        yaw += float(rng.choice([0.0, 0.0, 0.0, 1.5, 3.1]))
        planner = behavior(roads, float(rng.choice([0.0, 0.1, 5.0, 15.0, 60.0])), period=float(rng.choice([0.1, 0.5])))
        speed, goal, now = float(rng.choice([-2.0, 0.0, 1e-9, 3.0, 15.0, 60.0])), random_goal(rng, x, y, yaw), 0.0
        for _ in range(10):
            found = random_detections(rng, now, x, y)
            ego = EgoState(now, np.array([x, y, 0.0]), yaw, 0.0, 0.0, speed, 0.0, 0.0)
            check(planner.plan(ego, found, goal, now), len(found))
            x, y = x + 0.05 * speed * math.cos(yaw), y + 0.05 * speed * math.sin(yaw)
            now += 0.05 * int(rng.choice([1, 1, 2, 20]))


def test_objects_of_a_plan_are_found_again_in_later_detections() -> None:
    found = detections(0.0, KnownBox(0.0, 0.0), KnownBox(20.0, 1.0), KnownBox(40.0, 0.0))
    assert nearest_rows(found, np.array([(39.0, 0.0)])) == (2,)
    assert nearest_rows(found, np.array([(60.0, 0.0)])) == ()
    assert nearest_rows(found, np.empty((0, 2))) == ()
    assert nearest_rows(Detections(0.0), np.array([(0.0, 0.0)])) == ()
